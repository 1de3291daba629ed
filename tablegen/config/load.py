"""Read a scan file and its scanner file into the setup that the rest of the build needs."""

import os
from collections.abc import Mapping
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from tablegen.base.figures import shown_path
from tablegen.base.input_errors import Document, Problem, Problems, Rejected
from tablegen.base.quantities import MAXIMUM_FILE_NAME
from tablegen.base.toml import read_toml
from tablegen.compensation.model import Parameters
from tablegen.config.decode import decode, meant
from tablegen.config.hardware import AxisHardware, Place, check_hardware, hardware_of
from tablegen.config.image_keys import IMAGES, OFFSETS, RATES, SIZES, check_image_keys, solve_scan
from tablegen.config.like import inherited, warn_inherited_once
from tablegen.config.names import why_not_a_name
from tablegen.config.scanner import LinearPiezo, Offset, Resonance, Scanner
from tablegen.config.schema import (
    MAXIMUM_NAME,
    MAXIMUM_SPLINE_BITS,
    MAXIMUM_SPLINE_LENGTH,
    TILT_NAMES,
    BandLimit,
    FastAxis,
    Refinement,
    Scan,
    Table,
    WrittenScan,
    WrittenTiming,
)

_LEAST_NM_PER_V = 1e-6  # of an output beside x and y
_LIBRARY = "this file is a library of scans; `tablegen sweep` builds them, each into a directory of its own"


class Setup(Struct, frozen=True, dict=True):
    """A scan, the scanner it runs on, and where each of their keys stands.

    ``choices`` has, in sentences, what was chosen for the keys of the image in the scan file.
    """

    scan: Scan
    scanner: Scanner
    scan_file: Document
    scanner_file: Document
    scanner_folder: Path
    choices: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<tablegen setup {self.scan.name!r} on {self.scanner.name!r}, from {self.scan_file.name}>"

    def hardware(self, axis: str) -> AxisHardware:
        """Return converter and amplifier of "x", "y", or a "z" or "aux" of the scanner, and where their keys stand."""
        return self._hardware[axis]

    @cached_property
    def _hardware(self) -> dict[str, AxisHardware]:
        axes = [axis for axis in ("x", "y", *TILT_NAMES) if getattr(self.scanner, axis) is not None]
        return {axis: hardware_of(self.scan, self.scanner, axis) for axis in axes}

    def hardware_problem(self, axis: str, key: str, why: str) -> Problem:
        """Return a problem of a key of the hardware such as "amplifier.gain", at the place where the axis has it."""
        place = self.hardware(axis).where(key)[0]
        return (self.scanner_file if place.in_scanner else self.scan_file).problem(place.key, why)

    def named(self, axis: str, key: str) -> str:
        """Return the name of a hardware key such as "dac.bits" in messages, with the scanner file if that has it."""
        return self.placed(self.hardware(axis).where(key)[0])

    def placed(self, place: Place) -> str:
        """Return a key with its file, where that is not the scan file."""
        name = shown_path(Path(Path(self.scanner_file.name).name))
        return f"{place.key} of {name}" if place.in_scanner else place.key

    @property
    def mixes_motions(self) -> bool:
        """True if x or y follows the line and the frame: at an angle, on coupled axes, or with drift.

        A scan with z is planned as one of these where both axes have an operator, and move as they do at an angle.
        """
        scan = self.scan
        usual = scan.x.motion != "sine" and scan.y.motion != "step"
        turned = bool(scan.angle_deg % 360.0) or (scan.z is not None and self.has_operators and usual)
        return turned or bool(self.scanner.coupling) or any(scan.drift_nm_per_s)

    @property
    def has_operators(self) -> bool:
        """True if both axes of the scanner have an operator."""
        tables = (self.scanner.x.hysteresis, self.scanner.y.hysteresis)
        return all(table is not None and table.operator_file is not None for table in tables)

    @property
    def files(self) -> list[Path]:
        """The files that decide this scan, each once: the scan, the scanner, and the files that it names."""
        return list(dict.fromkeys(path for path, _, _ in self.named_files))

    @property
    def named_files(self) -> list[tuple[Path, Document, str]]:
        """The same files with the key that names each, and the document of the key; "" for the scan file itself.

        A file that several keys name stands there several times.
        """
        files = [(self.scan_file, self.scan_file, ""), (self.scanner_file, self.scan_file, "scanner")]
        named = [(Path(file.name), document, key) for file, document, key in files if file.lines is not None]
        for name, axis in (("x", self.scanner.x), ("y", self.scanner.y)):
            if axis.resonance is not None and axis.resonance.response is not None:
                path = self.scanner_folder / axis.resonance.response
                named.append((path, self.scanner_file, f"{name}.resonance.response"))
            if axis.hysteresis is not None:
                key = f"{name}.hysteresis.file"
                named += [(self.scanner_folder / path, self.scanner_file, key) for path in axis.hysteresis.files()]
        return named


def load(path: str | Path) -> Setup:
    """Read a scan file and the scanner file that it names.

    Raises
    ------
    Rejected
        With every fault of both files.
    """
    path = Path(path)
    values, scan_file = read_scan_file(path)
    if "scans" in values:
        raise Rejected([scan_file.problem("scans", _LIBRARY)])
    return assemble_setup(path, values, scan_file)


def read_scan_file(path: Path) -> tuple[dict[str, Any], Document]:
    """Read the values of a scan file, and where its keys stand.

    Raises
    ------
    Rejected
        If it is not a scan file.
    """
    values, scan_file = read_toml(path, str(path))
    if "v_max" in values and not _is_scan(values):  # otherwise every key of it would be reported, and not this
        why = f"this is a scanner file; give the scan file that names it, scanner = '{shown_path(Path(path.name))}'"
        raise Rejected([scan_file.problem("", why)])
    return values, scan_file


Scanners = dict[Path, tuple[Mapping[str, Any], Scanner, Document]]
"""The values, the types and the places of scanner files that were read already, and are valid."""


def assemble_setup(
    path: Path, values: Mapping[str, Any], scan_file: Document, scanners: Scanners | None = None
) -> Setup:
    """Build the setup of the values of a scan file at a path, with the scanner that it names.

    Parameters
    ----------
    scanners
        Cache of valid scanner files, for many scans of one scanner.

    Raises
    ------
    Rejected
        With every fault of both files.
    """
    problems = Problems()
    values, scan_file = inherited(values, scan_file)
    scan = decode(WrittenScan, values, scan_file, problems, partial(_check, values, scan_file, problems))
    name = values.get("name")
    if isinstance(name, str) and 0 < len(name) <= MAXIMUM_NAME and (fault := why_not_a_name(name)):
        problems.add(scan_file, "name", fault)

    named = values.get("scanner")
    if not isinstance(named, str) or not 0 < len(named) <= MAXIMUM_FILE_NAME:
        raise Rejected(problems.entries)
    scanner_path = path.parent / named
    if scanners is not None and scanner_path in scanners:
        known_values, known, scanner_file = scanners[scanner_path]
        check_hardware(values, known_values, scan_file, scanner_file, problems)
        return _setup(scan, known, values, scan_file, scanner_file, scanner_path.parent, problems)
    if not os.path.isfile(scanner_path):  # os.path.isfile never raises, unlike the method of Path
        problems.add(
            scan_file, "scanner", f"{shown_path(scanner_path)} is not a file; the path is relative to this file"
        )
        raise Rejected(problems.entries)
    try:
        scanner_values, scanner_file = read_toml(scanner_path, str(scanner_path))
    except Rejected as rejected:
        raise Rejected(problems.entries + rejected.problems) from None
    if _is_scan(scanner_values):
        problems.add(scan_file, "scanner", f"{shown_path(scanner_path)} is a scan file, not a scanner file")
        raise Rejected(problems.entries)
    scanner_values, scanner_file = inherited(scanner_values, scanner_file)
    check = partial(_check, scanner_values, scanner_file, problems)
    before = len(problems.entries)
    scanner = decode(Scanner, scanner_values, scanner_file, problems, check)
    if scanners is not None and scanner is not None and len(problems.entries) == before:
        scanners[scanner_path] = scanner_values, scanner, scanner_file
    check_hardware(values, scanner_values, scan_file, scanner_file, problems)
    return _setup(scan, scanner, values, scan_file, scanner_file, scanner_path.parent, problems)


def _setup(
    written: WrittenScan | None,
    scanner: Scanner | None,
    values: Mapping[str, Any],
    scan_file: Document,
    scanner_file: Document,
    folder: Path,
    problems: Problems,
) -> Setup:
    """Build the setup of decoded files; raise ``Rejected`` where there are ``problems``."""
    for file in (scan_file, scanner_file):
        warn_inherited_once(problems, file)
    problems.stop_if_any()
    assert written is not None
    assert scanner is not None
    update_rate_hz = hardware_of(written, scanner, "x").dac.update_rate_hz
    for name in written.tilts:
        if getattr(scanner, name) is None:
            what = f"nm_per_v and v_max of the piezo of {name}, and its converter"
            problems.add(scan_file, name, f"{scanner_file.name} has no [{name}]; give it {what}")
    if written.aux is not None and written.z is None:
        why = "is the y of the sequencer whose x is z, and there is no [z]; rename this table to [z], or give both"
        problems.add(scan_file, "aux", why)
    solution = solve_scan(written, update_rate_hz, values, scan_file, problems)
    problems.stop_if_any()
    assert solution is not None
    assert scanner is not None
    return Setup(
        solution.scan,
        scanner,
        replace(scan_file, written_keys=solution.written_keys),
        scanner_file,
        folder,
        solution.choices,
    )


def load_scanner(path: str | Path) -> tuple[Scanner, Document]:
    """Read a scanner file alone, and where its keys stand.

    Raises
    ------
    Rejected
        With every fault.
    """
    values, file = read_toml(Path(path), str(path))
    if _is_scan(values):
        raise Rejected([file.problem("", "this is a scan file; give the scanner file that it names")])
    problems = Problems()
    values, file = inherited(values, file)
    scanner = decode(Scanner, values, file, problems, partial(_check, values, file, problems))
    warn_inherited_once(problems, file)
    problems.stop_if_any()
    assert scanner is not None
    return scanner, file


def _is_scan(values: Mapping[str, Any]) -> bool:
    return "scanner" in values or "timing" in values or ("dac" in values and "v_max" not in values)


def from_values(scan: Mapping[str, Any], scanner: Mapping[str, Any], folder: str | Path = ".") -> Setup:
    """Build a setup of values by the keys of the two files, without any file: numbers, strings, sequences and mappings.

    ``name`` is "scan" unless given, ``scanner`` of the scan is not needed. A response that the scanner names is read
    from ``folder``.

    Raises
    ------
    Rejected
        As ``load``, with "scan" and "scanner" for the names of files.
    """
    values, scan_file = inherited({"name": "scan", "scanner": "values", **_plain(scan)}, Document("scan", None))
    if "scans" in values:
        raise Rejected([scan_file.problem("scans", "values are of one scan; give each of many its own")])
    scanner_values, scanner_file = inherited(_plain(scanner), Document("scanner", None))
    problems = Problems()
    built = decode(WrittenScan, values, scan_file, problems, partial(_check, values, scan_file, problems))
    if isinstance(values["name"], str) and (why := why_not_a_name(values["name"])):
        problems.add(scan_file, "name", why)
    check = partial(_check, scanner_values, scanner_file, problems)
    scanner_struct = decode(Scanner, scanner_values, scanner_file, problems, check)
    check_hardware(values, scanner_values, scan_file, scanner_file, problems)
    return _setup(built, scanner_struct, values, scan_file, scanner_file, Path(folder), problems)


def _plain(value: Any) -> Any:
    """Return values as a TOML file would have them: dicts, lists, and the numbers of Python for those of numpy."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return value.tolist()
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _check(
    values: Mapping[str, Any],
    file: Document,
    problems: Problems,
    kind: type,
    key: str,
    written: Mapping[str, Any],
    built: Any,
) -> None:
    """Report what types and ranges of single keys cannot express: of a table as written, and as decoded.

    ``built`` is None where decoding failed, ``values`` the whole file.
    """
    if kind is WrittenScan:
        _at_most_one(IMAGES, key, written, file, problems)
        check_image_keys(written, file, problems)
    elif issubclass(kind, FastAxis):
        _check_axis(kind, key, any(name in values for name in IMAGES), written, file, problems)
    elif kind is BandLimit:
        _at_most_one(("harmonics", "cutoff_hz"), key, written, file, problems)
    elif kind is WrittenTiming:
        _check_timing(kind, key, written, file, problems)
    elif kind is Offset:
        _check_ways(key, written, file, problems)
    elif kind is Resonance:
        _check_response(key, written, file, problems)
    elif issubclass(kind, Parameters):
        for name, why in kind.contradictions(written):
            problems.add(file, f"{key}.{name}", why)
    if built is not None:
        for name, why in _faults(built):
            problems.add(file, f"{key}.{name}", why)


def _check_timing(kind: type, key: str, written: Mapping[str, Any], file: Document, problems: Problems) -> None:
    """Check that lines and a rate are each given once."""
    _at_most_one(("ticks_per_line", "ticks_per_pixel"), key, written, file, problems)
    for names in (("lines", "image_lines"), RATES):
        _at_most_one(names, key, written, file, problems)
        if not _any_of(names, written, kind):
            problems.add(file, f"{key}.{names[0]}", f"missing; give {' or '.join(names)}")


def _check_axis(
    kind: type, key: str, image: bool, written: Mapping[str, Any], file: Document, problems: Problems
) -> None:
    """Check that a size and an offset are each given once; the size of an ``image`` counts as one."""
    resting = written.get("motion") == "off"  # which needs no size
    for names in (OFFSETS,) if resting else (SIZES, OFFSETS):
        _at_most_one(names, key, written, file, problems)
        if not (_any_of(names, written, kind) or (names is SIZES and image)):
            first, second = (name for name in names if not name.endswith("_um"))
            problems.add(file, key, f"missing; give {first} or {second}")


def _any_of(names: tuple[str, ...], written: Mapping[str, Any], kind: type) -> bool:
    """Return True if one of the keys is there; an unknown key that was meant to be one of them counts."""
    known = [*kind.__struct_fields__]  # type: ignore[attr-defined]
    return any(name in names or {*names} & {*_unknown(name, known)} for name in written)


def _unknown(name: str, known: list[str]) -> list[str]:
    return [] if name in known else meant(name, known)


def _at_most_one(
    names: tuple[str, ...], key: str, written: Mapping[str, Any], file: Document, problems: Problems
) -> None:
    first, *others = [name for name in names if name in written] or [""]
    for other in others:
        problems.add(file, f"{key}.{other}" if key else other, f"{first} is given as well; keep one of the two")


def _check_ways(key: str, written: Mapping[str, Any], file: Document, problems: Problems) -> None:
    ways = [("m_minus", "m_plus"), ("alpha", "beta"), ("points",), ("sizes",)]
    used = [way for way in ways if any(name in written for name in way)]
    if not used:
        problems.add(file, key, "missing; give m_minus and m_plus, or alpha and beta, or points, or sizes")
    elif len(used) > 1:
        first, second = (next(name for name in way if name in written) for way in used[:2])
        problems.add(file, f"{key}.{second}", f"{first} is given as well; keep one of the ways")
    elif missing := [name for name in used[0] if name not in written]:
        other = next(name for name in used[0] if name in written)
        problems.add(file, f"{key}.{missing[0]}", f"missing beside {other}")


def _check_response(key: str, written: Mapping[str, Any], file: Document, problems: Problems) -> None:
    second_order = [name for name in ("frequency_hz", "quality", "delay_s") if name in written]
    if "response" in written:
        if second_order:
            problems.add(file, f"{key}.{second_order[0]}", "response is given as well; keep one of the two")
    elif "frequency_hz" not in written and "quality" not in written:
        problems.add(file, key, "missing; give frequency_hz and quality, or response")
    else:
        for name, other in (("frequency_hz", "quality"), ("quality", "frequency_hz")):
            if name not in written:
                problems.add(file, f"{key}.{name}", f"missing beside {other}")


def _faults(built: Struct) -> list[tuple[str, str]]:
    """Return the keys of a table that contradict each other, with the reason."""
    match built:
        case FastAxis() if built.size_v is not None and built.size_of == "window":
            return [("size_of", "only a size in nm can be that of the window; size_v is the drive's")]
        case BandLimit():
            return _band_limit_faults(built)
        case Table():
            return _table_faults(built)
        case Refinement() if len(built.a) != len(built.b):
            return [("b", f"{len(built.b)} harmonics, and {len(built.a)} in a")]
        case Offset():
            return _offset_faults(built)
        case LinearPiezo() if abs(built.nm_per_v) < _LEAST_NM_PER_V:
            return [("nm_per_v", f"{built.nm_per_v:g} moves nothing; at least {_LEAST_NM_PER_V:g} in size is needed")]
        case Parameters():
            return built.faults()
        case _:
            pass
    return []


def _band_limit_faults(limit: BandLimit) -> list[tuple[str, str]]:
    low, high = limit.window
    if high <= low:
        return [("window", f"[{low:g}, {high:g}] does not ascend")]
    if high - low < 0.01:
        return [("window", f"[{low:.12g}, {high:.12g}] is narrower than 0.01 of the line")]
    if limit.method == "window":
        return []
    keys = {
        "max_scaling_error_percent": limit.max_scaling_error_percent is not None,
        "harmonics": limit.harmonics == "fewest",
    }
    why = f"method = '{limit.method}' keeps no scaling error; take method = 'window'"
    return [(key, why) for key, is_set in keys.items() if is_set]


def _table_faults(table: Table) -> list[tuple[str, str]]:
    if table.mode == "cubic" and (table.bits or 0) > MAXIMUM_SPLINE_BITS:
        return [("bits", f"{table.bits} is above the {MAXIMUM_SPLINE_BITS} of mode = 'cubic'")]
    if table.mode == "cubic" and (table.length or 0) > MAXIMUM_SPLINE_LENGTH:
        return [("length", f"{table.length} is above the {MAXIMUM_SPLINE_LENGTH} of mode = 'cubic'")]
    if table.mode != "direct" and table.length is not None:
        lower = 1 << (table.length.bit_length() - 1)
        if table.length != lower:
            return [("length", f"{table.length} is not a power of two; the nearest are {lower} and {2 * lower}")]
    return []


def _offset_faults(offset: Offset) -> list[tuple[str, str]]:
    points, sizes = offset.points or [], [entry.size_v for entry in offset.sizes or []]
    faults = [(f"sizes[{i}].size_v", f"{v:g} V is given twice") for i, v in enumerate(sizes) if v in sizes[:i]]
    if any(point.size_v is not None for point in points):
        without_size = [i for i, point in enumerate(points) if point.size_v is None]
        faults += [(f"points[{i}].size_v", "missing beside those of other points") for i in without_size]
    return faults
