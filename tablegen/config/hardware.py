"""The converter and the amplifier of each axis, combined from the keys of the scanner file and of the scan file.

The hardware belongs to the instrument: in the scanner file ``[x.dac]`` goes before ``[dac]``, which serves both axes.
``[dac]`` of the scan file serves both axes too; keys that both files have must be equal. The outputs z and
aux take what they do not have in ``[z.dac]`` or ``[aux.dac]`` from ``[dac]`` of the scanner file, then from that of the
scan file.
"""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple, TypeAlias

from msgspec import Struct

from tablegen.base.input_errors import Document, Problems
from tablegen.config.decode import decode, meant
from tablegen.config.scanner import Scanner
from tablegen.config.schema import TILT_NAMES, Amplifier, Dac, TiltName, WrittenScan

_AXES = ("x", "y")
_NOT_OF_TILTS = {
    "shaping": "the output {name} is not shaped; leave this out",
    "output": "x and y are the outputs of a dual converter; leave this out",
}
_KINDS: Mapping[str, type[Dac] | type[Amplifier]] = {"dac": Dac, "amplifier": Amplifier}
_REQUIRED = {"dac": ("bits", "v_min", "v_max", "update_rate_hz"), "amplifier": ("gain",)}


class Place(NamedTuple):
    """A key or a table of one of the two files."""

    in_scanner: bool
    key: str


_Tables: TypeAlias = Mapping[Place, Dac | Amplifier]


class AxisDac(Struct, frozen=True):
    """The converter of one axis; fields as the keys of ``Dac``, ``word_bits`` None where it is that of ``bits``.

    ``output`` is None on both axes where neither gives it.
    """

    bits: int
    v_min: float
    v_max: float
    update_rate_hz: float
    coding: Literal["offset-binary", "twos-complement"] = "offset-binary"
    inverted: bool = False
    output: Literal["A", "B"] | None = None
    align: Literal["right", "left"] = "right"
    word_bits: int | None = None
    shaping: Literal["off", "first", "second", "scanner"] = "off"

    @property
    def highest_v(self) -> float:
        """The highest voltage in V, one LSB below ``v_max``."""
        return self.v_max - (self.v_max - self.v_min) / float(1 << self.bits)


class AxisAmplifier(Struct, frozen=True):
    """The amplifier of one axis; fields as the keys of ``Amplifier``."""

    gain: float
    bias_v: float = 0.0
    max_slew_v_per_s: float | None = None


class AxisHardware(Struct, frozen=True):
    """Converter and amplifier of one axis; ``places`` has the files and keys of keys such as "dac.bits".

    A key that stands in both files has two places and one value.
    """

    dac: AxisDac
    amplifier: AxisAmplifier
    places: Mapping[str, tuple[Place, ...]]

    def where(self, key: str) -> tuple[Place, ...]:
        """Return the places of a key such as "amplifier.bias_v", or those beside the required keys of its table."""
        if key in self.places:
            return self.places[key]
        part, name = key.split(".")
        beside = self.places[f"{part}.{_REQUIRED[part][0]}"]
        return tuple(Place(place.in_scanner, f"{place.key.rsplit('.', 1)[0]}.{name}") for place in beside)


def hardware_of(scan: WrittenScan, scanner: Scanner, axis: str) -> AxisHardware:
    """Return the hardware of one axis ("x" or "y"), or of "z" or "aux" of a scanner that has it, of validated files."""
    tables: dict[Place, Dac | Amplifier] = {}
    for part in _KINDS:
        tables[Place(False, part)] = getattr(scan, part)
        tables[Place(True, part)] = getattr(scanner, part)
        tables[Place(True, f"{axis}.{part}")] = getattr(getattr(scanner, axis), part)
    return _combined(tables, axis)


def _combined(tables: _Tables, axis: str) -> AxisHardware:
    values: dict[str, dict[str, Any]] = {part: {} for part in _KINDS}
    places: dict[str, tuple[Place, ...]] = {}
    for part, kind in _KINDS.items():
        for name in kind.__struct_fields__:
            tables_of_key = _places(tables, axis, part, name)
            if tables_of_key:
                values[part][name] = getattr(tables[tables_of_key[0]], name)
                places[f"{part}.{name}"] = tuple(
                    Place(table.in_scanner, f"{table.key}.{name}") for table in tables_of_key
                )
    return AxisHardware(AxisDac(**values["dac"]), AxisAmplifier(**values["amplifier"]), places)


def _places(tables: _Tables, axis: str, part: str, name: str) -> list[Place]:
    """Return the tables with a key of one axis: that of the scan file, and the first one of the scanner file.

    Of z and aux it is one table: that of the scan file is of x and y, and may have other values.
    """
    scans, own, common = Place(False, part), Place(True, f"{axis}.{part}"), Place(True, part)
    if axis in TILT_NAMES:
        return [place for place in (own, common, scans) if getattr(tables[place], name) is not None][:1]
    defined = [place for place in (scans, own, common) if getattr(tables[place], name) is not None]
    return defined[:2] if defined[:1] == [scans] else defined[:1]


def check_hardware(
    scan: Mapping[str, Any],
    scanner: Mapping[str, Any],
    scan_file: Document,
    scanner_file: Document,
    problems: Problems,
) -> None:
    """Report contradictions of the hardware in both files; faults of single keys were reported before."""
    written, tilts = _written(scan, scanner), [name for name in TILT_NAMES if isinstance(scanner.get(name), dict)]
    if not all(isinstance(table, dict) for table in written.values()):
        return
    files = {False: scan_file, True: scanner_file}
    missing = _missing(written) or [fault for name in tilts for fault in _missing_of_tilt(written, name)]
    for place, why in missing:
        problems.add(files[place.in_scanner], place.key, why)
    tables = _decoded(written, files)
    if missing or len(tables) < len(written):
        return
    if contradictions := _contradictions(tables, scanner_file):
        for key, why in contradictions:
            problems.add(scan_file, key, why)
        return
    each = {axis: _combined(tables, axis) for axis in (*_AXES, *tilts)}
    faults = [(hardware, fault) for hardware in each.values() for fault in _faults(hardware)]
    faults += [(each["y"], fault) for fault in _differences(each["x"], each["y"], files)]
    for name in tilts:
        faults += [(each[name], fault) for fault in _faults_of_tilt(each["x"], each[name], name, files)]
    if {*tilts} == {*TILT_NAMES}:
        faults += [(each["aux"], fault) for fault in _other_bits(each["z"], each["aux"], ("z", "aux"), files)]
    for hardware, (key, why) in faults:
        place = hardware.where(key)[0]
        problems.add(files[place.in_scanner], place.key, why)


def _written(scan: Mapping[str, Any], scanner: Mapping[str, Any]) -> dict[Place, Any]:
    """Return the tables of the hardware as both files have them, empty where they have none."""
    written: dict[Place, Any] = {}
    for part in _KINDS:
        written[Place(False, part)] = scan.get(part, {})
        written[Place(True, part)] = scanner.get(part, {})
        for axis in (*_AXES, *TILT_NAMES):
            its = scanner.get(axis)
            written[Place(True, f"{axis}.{part}")] = its.get(part, {}) if isinstance(its, dict) else {}
    return written


def _decoded(written: Mapping[Place, Any], files: Mapping[bool, Document]) -> "dict[Place, Dac | Amplifier]":
    """Decode the tables, but for those with faults of single keys."""
    tables: dict[Place, Dac | Amplifier] = {}
    for place, table in written.items():
        kind = _KINDS[place.key.rsplit(".", 1)[-1]]
        decoded = decode(kind, table, files[place.in_scanner], Problems(), lambda *_: None)
        if decoded is not None:
            tables[place] = decoded
    return tables


def _missing(written: Mapping[Place, Mapping[str, Any]]) -> list[tuple[Place, str]]:
    """Return required keys that no file has, for one axis or for both; unless an unknown key was meant to be one."""
    faults: list[tuple[Place, str]] = []
    for part, kind in _KINDS.items():
        scans, common = written[Place(False, part)], written[Place(True, part)]
        own = {axis: written[Place(True, f"{axis}.{part}")] for axis in _AXES}
        if not any((scans, common, *own.values())):
            faults.append((Place(False, part), "missing; this table is required, here or in the scanner file"))
            continue
        known = [*kind.__struct_fields__]
        for name in _REQUIRED[part]:
            axes_without = [
                axis
                for axis in _AXES
                if not any(
                    name == key or (key not in known and name in meant(key, known))
                    for table in (scans, common, own[axis])
                    for key in table
                )
            ]
            if axes_without and scans and len(axes_without) == len(_AXES):
                faults.append((Place(False, f"{part}.{name}"), "missing; this key is required"))
            elif axes_without and len(axes_without) == len(_AXES) and common:
                faults.append(
                    (Place(True, f"{part}.{name}"), "missing; this key is required, here or in the scan file")
                )
            else:
                why = f"missing; this key is required, here or in [{part}]"
                faults += [(Place(True, f"{axis}.{part}.{name}"), why) for axis in axes_without]
    return faults


def _missing_of_tilt(written: Mapping[Place, Mapping[str, Any]], name: TiltName) -> list[tuple[Place, str]]:
    """Return required keys of an output beside x and y that only these have, in tables of their own."""
    faults: list[tuple[Place, str]] = []
    for part, kind in _KINDS.items():
        known = [*kind.__struct_fields__]
        tables = written[Place(True, f"{name}.{part}")], written[Place(True, part)], written[Place(False, part)]
        there = {key for table in tables for key in table}
        there |= {other for key in there if key not in known for other in meant(key, known)}
        faults += [
            (Place(True, f"{name}.{part}.{key}"), f"missing; this key is required, here or in [{part}]")
            for key in _REQUIRED[part]
            if key not in there
        ]
    return faults


def _faults_of_tilt(
    x: AxisHardware, tilt: AxisHardware, name: TiltName, files: Mapping[bool, Document]
) -> list[tuple[str, str]]:
    """Return the keys of an output beside x and y that it cannot have, or that have to equal those of x and differ."""
    faults = [
        (key, why.format(name=name))
        for its, why in _NOT_OF_TILTS.items()
        if (key := f"dac.{its}") in tilt.places and tilt.where(key)[0].key == f"{name}.{key}"
    ]
    if x.dac.update_rate_hz != tilt.dac.update_rate_hz:
        faults.append(
            (
                "dac.update_rate_hz",
                f"{tilt.dac.update_rate_hz:.12g} of {name}, and {_place_text(x, 'dac.update_rate_hz', files)} is "
                f"{x.dac.update_rate_hz:.12g} of x; {name} moves on the ticks of x and y: leave this out",
            )
        )
    return faults


def _contradictions(tables: _Tables, scanner_file: Document) -> list[tuple[str, str]]:
    """Return the keys of the scan file whose values differ from those of the scanner file."""
    differences = {}
    for part, kind in _KINDS.items():
        for name in kind.__struct_fields__:
            for axis in _AXES:
                places = _places(tables, axis, part, name)
                values = [getattr(tables[place], name) for place in places]
                if len(set(values)) > 1:
                    theirs = f"{places[1].key}.{name}"
                    line = scanner_file.line_of(theirs)
                    at = f"{scanner_file.name}:{line}" if line else scanner_file.name
                    differences[f"{part}.{name}", theirs] = (
                        f"{_display(values[0])}, and {theirs} is {_display(values[1])} at {at}; the scanner file's is "
                        "that of the instrument: remove this key, or correct the other"
                    )
    return [(key, why) for (key, _), why in differences.items()]


def _faults(hardware: AxisHardware) -> list[tuple[str, str]]:
    """Return the keys of one axis that contradict each other, with the reason."""
    dac, gain, faults = hardware.dac, hardware.amplifier.gain, []
    if dac.v_max <= dac.v_min:
        faults.append(("dac.v_max", f"{dac.v_max:.12g} V is not above v_min = {dac.v_min:.12g} V"))
    elif dac.v_max - dac.v_min < 1e-3:
        why = f"{dac.v_max - dac.v_min:.3g} V above v_min is no range; at least 0.001 V is needed"
        faults.append(("dac.v_max", why))
    if dac.word_bits is not None and dac.word_bits < dac.bits:
        faults.append(("dac.word_bits", f"{dac.word_bits} is below bits = {dac.bits}; the code would not fit"))
    if abs(gain) < 1e-4:
        faults.append(("amplifier.gain", f"{gain:g} is no gain; at least 1e-4 in size is needed"))
    return faults


def _differences(x: AxisHardware, y: AxisHardware, files: Mapping[bool, Document]) -> list[tuple[str, str]]:
    """Return the keys of y that have to equal those of x and differ."""
    differences = _other_bits(x, y, ("x", "y"), files)
    if x.dac.update_rate_hz != y.dac.update_rate_hz:
        differences.append(
            (
                "dac.update_rate_hz",
                f"{y.dac.update_rate_hz:.12g} of y, and {_place_text(x, 'dac.update_rate_hz', files)} is "
                f"{x.dac.update_rate_hz:.12g} of x; both axes move on the same ticks: give it once, in [dac]",
            )
        )
    outputs = (x.dac.output, y.dac.output)
    if outputs not in ((None, None), ("A", "B"), ("B", "A")):
        outputs_text = " and ".join(f"{axis} is on {one or 'none'}" for axis, one in zip("xy", outputs, strict=True))
        differences.append(("dac.output", f"{outputs_text}; give one axis 'A' and the other 'B', or none of them"))
    return differences


def _other_bits(
    first: AxisHardware, second: AxisHardware, names: tuple[str, str], files: Mapping[bool, Document]
) -> list[tuple[str, str]]:
    """Return the bits of the y of a sequencer where its x has others."""
    if first.dac.bits == second.dac.bits:
        return []
    few, many = sorted((first.dac.bits, second.dac.bits))
    why = (
        f"{second.dac.bits} of {names[1]}, and {_place_text(first, 'dac.bits', files)} is {first.dac.bits} of "
        f"{names[0]}; the device computes codes of as many bits for both axes: give bits = {few} to both, and to the "
        f"one of {many} bits word_bits = {many} with align = 'left' as well, which sends them as its upper bits"
    )
    return [("dac.bits", why)]


def _place_text(hardware: AxisHardware, key: str, files: Mapping[bool, Document]) -> str:
    place = hardware.where(key)[0]
    line = files[place.in_scanner].line_of(place.key)
    return f"{place.key} at line {line}" if line else place.key


def _display(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.12g}" if isinstance(value, float) else repr(value)
