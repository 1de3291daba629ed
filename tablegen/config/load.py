"""From the path of a scan file to everything that the rest of the build needs to know."""

from dataclasses import dataclass
from pathlib import Path

from msgspec import Struct

from tablegen.config.decode import decode
from tablegen.config.names import why_not_a_name
from tablegen.config.schema import Scan, Scanner
from tablegen.config.toml import read_toml
from tablegen.problems import Document, Problems, Rejected


@dataclass(frozen=True)
class Setup:
    """A scan, the scanner it runs on, and where each of their keys stands."""

    scan: Scan
    scanner: Scanner
    scan_file: Document
    scanner_file: Document
    scanner_folder: Path


def load(path: str | Path) -> Setup:
    """Read a scan file and the scanner file that it names.

    Raises ``Rejected`` with every fault of both files.
    """
    path = Path(path)
    values, scan_file = read_toml(path, str(path))
    problems = Problems()
    scan = decode(Scan, values, scan_file, problems)
    if scan is not None:
        _check_scan(scan, scan_file, problems)

    named = values.get("scanner")
    if not isinstance(named, str) or not named or "\0" in named:
        if isinstance(named, str) and "\0" in named:
            problems.add(scan_file, "scanner", "a file name has no NUL character")
        raise Rejected(problems.found)
    scanner_path = path.parent / named
    if not scanner_path.is_file():
        problems.add(scan_file, "scanner", f"{scanner_path} is not a file; the path is relative to this file")
        raise Rejected(problems.found)
    try:
        scanner_values, scanner_file = read_toml(scanner_path, str(scanner_path))
    except Rejected as rejected:
        raise Rejected(problems.found + rejected.problems) from None
    scanner = decode(Scanner, scanner_values, scanner_file, problems)
    if scanner is not None:
        _check_scanner(scanner, scanner_file, problems)
    problems.stop_if_any()
    assert scan is not None
    assert scanner is not None
    return Setup(scan, scanner, scan_file, scanner_file, scanner_path.parent)


def _given(table: Struct, *names: str) -> list[str]:
    return [name for name in names if getattr(table, name) is not None]


def _one_of(table: Struct, names: tuple[str, ...], key: str, file: Document, problems: Problems) -> None:
    given = _given(table, *names)
    if not given:
        problems.add(file, key, f"missing; give {' or '.join(names)}")
    elif len(given) > 1:
        problems.add(file, f"{key}.{given[1]}", f"{given[0]} is given as well; keep one of the two")


def _check_scan(scan: Scan, file: Document, problems: Problems) -> None:
    """What the ranges of single keys cannot say."""
    if why := why_not_a_name(scan.name):
        problems.add(file, "name", why)
    dac = scan.dac
    if dac.v_max <= dac.v_min:
        problems.add(file, "dac.v_max", f"{dac.v_max:g} V is not above v_min = {dac.v_min:g} V")
    if dac.word_bits is not None and dac.word_bits < dac.bits:
        problems.add(file, "dac.word_bits", f"{dac.word_bits} is below bits = {dac.bits}; the code would not fit")
    if abs(scan.amplifier.gain) < 1e-4:
        problems.add(file, "amplifier.gain", f"{scan.amplifier.gain:g} is no gain; at least 1e-4 in size is needed")
    if len(_given(scan.timing, "ticks_per_line", "ticks_per_pixel")) == 2:
        problems.add(file, "timing.ticks_per_pixel", "ticks_per_line is given as well; keep one of the two")
    for key, axis in (("x", scan.x), ("y", scan.y)):
        _one_of(axis, ("size_nm", "size_v"), key, file, problems)
        _one_of(axis, ("offset_v", "offset_nm"), key, file, problems)
        if axis.size_v is not None and axis.size_of == "window":
            problems.add(file, f"{key}.size_of", "only a size in nm can be that of the window; size_v is the drive's")
        limit = axis.band_limit
        if len(_given(limit, "harmonics", "cutoff_hz")) == 2:
            problems.add(file, f"{key}.band_limit.cutoff_hz", "harmonics is given as well; keep one of the two")
        low, high = limit.window
        if high - low < 0.01:
            problems.add(file, f"{key}.band_limit.window", f"[{low:g}, {high:g}] is narrower than 0.01 of the line")
        table = axis.table
        if table.mode == "interpolated" and table.length is not None and table.length & (table.length - 1):
            lower = 1 << (table.length.bit_length() - 1)
            problems.add(
                file,
                f"{key}.table.length",
                f"{table.length} is not a power of two; the nearest are {lower} and {2 * lower}",
            )


def _check_scanner(scanner: Scanner, file: Document, problems: Problems) -> None:
    for key, axis in (("x", scanner.x), ("y", scanner.y)):
        if axis.offset is not None:
            _check_offset(axis.offset, f"{key}.offset", file, problems)
        hysteresis = axis.hysteresis
        if hysteresis is not None and hysteresis.model != "triangle":
            if not hysteresis.branches:
                why = f"missing; the {hysteresis.model} model needs a calibrated branch"
                problems.add(file, f"{key}.hysteresis.branches", why)
            for i, branches in enumerate(hysteresis.branches):
                place = f"{key}.hysteresis.branches[{i}]"
                if any(branches.turn == earlier.turn for earlier in hysteresis.branches[:i]):
                    problems.add(file, f"{place}.turn", f"{branches.turn:g} is calibrated twice")
                for side, branch in (("forward", branches.forward), ("backward", branches.backward)):
                    if hysteresis.model == "harmonic" and branch.u_peak is None:
                        problems.add(file, f"{place}.{side}.u_peak", "missing; the harmonic model needs it")
        if axis.resonance is not None:
            _check_resonance(axis.resonance, f"{key}.resonance", file, problems)


def _check_offset(offset: Struct, key: str, file: Document, problems: Problems) -> None:
    ways = [("m_minus", "m_plus"), ("alpha", "beta"), ("points",)]
    used = [way for way in ways if _given(offset, *way)]
    if not used:
        problems.add(file, key, "missing; give m_minus and m_plus, or alpha and beta, or points")
    elif len(used) > 1:
        second = _given(offset, *used[1])[0]
        problems.add(file, f"{key}.{second}", f"{used[0][0]} is given as well; keep one of the ways")
    elif missing := [name for name in used[0] if getattr(offset, name) is None]:
        problems.add(file, key, f"{missing[0]} is missing beside {_given(offset, *used[0])[0]}")


def _check_resonance(resonance: Struct, key: str, file: Document, problems: Problems) -> None:
    second_order = _given(resonance, "frequency_hz", "quality")
    if _given(resonance, "response"):
        if second_order:
            problems.add(file, f"{key}.{second_order[0]}", "response is given as well; keep one of the two")
    elif len(second_order) < 2:
        problems.add(file, key, "missing; give frequency_hz and quality, or response")
