"""Outputs z and aux of a scan that is changed while it plays: the plane that each follows, and its room."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tablegen.base.figures import at_most
from tablegen.base.input_errors import Problems, Rejected
from tablegen.config.image_keys import OFFSETS
from tablegen.config.load import Setup
from tablegen.config.schema import TILT_NAMES, TiltName
from tablegen.planning.tilt import TiltedOutput
from tablegen.planning.voltages import axis_voltages

Z_BEGINS = (
    "one of the scan that plays and the new one has the output z, which begins and ends to play only where no scan "
    'plays: park first, with `tablegen park --wait`, or in a session with "park" and "status" until the device is '
    'parked; then do the same again, and in a session "trigger"'
)
_PLACE_KEYS = frozenset(f"{axis}.{name}" for axis in "xy" for name in OFFSETS)
_ROUNDING = 1.0  # a code, by which the ends of a frame differ from one place to another
_NO_SHIFT = 1e-6  # of a code


@dataclass(frozen=True)
class LiveZ:
    """The output z of a scan, or aux: its slopes, its voltage in the centre of the scan, and its heights in a frame.

    Heights are those above 0 V. ``room_below_nm`` and ``room_above_nm`` are what is left from the frame to both ends of
    the range that the driver and the converter of z have in common.
    """

    slope_x: float
    slope_y: float
    offset_v: float
    lowest_nm: float
    highest_nm: float
    room_below_nm: float
    room_above_nm: float

    @classmethod
    def of_plan(cls, z: TiltedOutput, setup: Setup) -> "LiveZ":
        """Return the place of a planned output of a setup."""
        tilt, codes = setup.scan.tilts[z.name], z.errors.codes
        output, converter = z.program.output, z.converter

        def heights_nm(*ends: int) -> tuple[float, float]:
            first, second = (z.nm_per_v * (converter.v_zero + converter.v_per_code * code) for code in ends)
            return min(first, second), max(first, second)

        lowest, highest = heights_nm(codes.least, codes.most)
        bottom, top = heights_nm(output.code_min, output.code_max)
        return cls(z.slope_x, z.slope_y, tilt.offset_v, lowest, highest, lowest - bottom, top - highest)


def offset_key(name: TiltName) -> str:
    """Return the key of the voltage of an output in the centre of the scan."""
    return f"{name}.offset_v"


def split_table(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings with the keys of ``[z]`` and ``[aux]`` in place of the tables, so that offsets can be set too."""
    split: dict[str, Any] = {}
    for name, value in settings.items():
        if name in TILT_NAMES and isinstance(value, Mapping):
            split |= {f"{name}.{key}": each for key, each in value.items()}
        else:
            split[name] = value
    return split


def followed_offset_v(before: Setup, after: Setup, name: TiltName = "z") -> float:
    """Return the voltage of an output in the centre of a scan, on the plane through the centre of the scan before it.

    Axes move the tip along each other where they are coupled; slopes are those along x and y of the sample at any
    angle. A scan about the same centre keeps the voltage.

    Parameters
    ----------
    before, after
        Both scans have the output; slopes are those of ``after``.
    name
        Of the output.

    Raises
    ------
    Rejected
        If the position of an axis leaves its range.
    """
    tilt, last, piezo = after.scan.tilts[name], before.scan.tilts[name], getattr(after.scanner, name)
    by_x, by_y = _move_nm(before, after)
    coupling = after.scanner.coupling
    along_x, along_y = by_x + coupling.x_per_y * by_y, by_y + coupling.y_per_x * by_x
    return float(last.offset_v + (tilt.slope_x * along_x + tilt.slope_y * along_y) / piezo.nm_per_v)


def check_room(z: TiltedOutput, before: Setup, after: Setup, settings: Mapping[str, Any]) -> None:
    """Check that a move leaves an output within its range; changes of more than the place are checked by their plan.

    Parameters
    ----------
    z
        Output of the scan that plays.
    before, after
        That scan, and the one that is moved.
    settings
        Keys that differ.

    Raises
    ------
    Rejected
        With the part of the move that its range has room for.
    """
    if not _PLACE_KEYS.issuperset(settings):
        return
    last, tilt = before.scan.tilts[z.name], after.scan.tilts[z.name]
    output, codes, converter = z.program.output, z.errors.codes, z.converter
    shift = (tilt.offset_v - last.offset_v) / converter.v_per_code
    room = max((output.code_max - codes.most if shift > 0.0 else codes.least - output.code_min) - _ROUNDING, 0.0)
    if abs(shift) <= max(room, _NO_SHIFT):
        return
    reach, ends = (
        sorted(converter.v_zero + converter.v_per_code * code for code in pair)
        for pair in ((output.code_min, output.code_max), (codes.least + shift, codes.most + shift))
    )
    move, share = _move_nm(before, after), room / abs(shift)
    part = [f"{'-' if one < 0.0 else ''}{at_most(abs(one) * share)}" if one else "0" for one in move]
    fits = f"x_nm = {part[0]} and y_nm = {part[1]} of it fit" if room else "nothing of it fits"
    why = (
        f"a move by x_nm = {move[0]:.6g} and y_nm = {move[1]:.6g} takes {z.name} to {ends[0]:.6g}..{ends[1]:.6g} V, "
        f"beyond its {reach[0]:.6g}..{reach[1]:.6g} V; {fits}"
    )
    raise Rejected([after.scan_file.problem(z.name, why)])


def _move_nm(before: Setup, after: Setup) -> tuple[float, float]:
    """Return how far the centre of a scan is from that of another one, along the axes of the scanner."""
    (x_before, y_before), (x_after, y_after) = _centre_nm(before), _centre_nm(after)
    return x_after - x_before, y_after - y_before


def _centre_nm(setup: Setup) -> tuple[float, float]:
    """Return the positions of both axes in the centre of a scan, above those at 0 V."""
    problems, timing = Problems(), setup.scan.timing
    rates = {"x": timing.line_rate_hz, "y": timing.line_rate_hz / timing.lines}
    x, y = (axis_voltages(setup, axis, rate_hz, problems).position_nm for axis, rate_hz in rates.items())
    problems.stop_if_any()
    return x, y
