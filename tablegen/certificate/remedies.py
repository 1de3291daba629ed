"""Remedies for a scan: changes of the scan file, each planned and measured before it is named.

A change is searched for along one key at a time, and only along those that act on the cause. Each key takes a few
trials, so that the search ends soon where nothing helps.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from math import ceil, copysign, log2
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import structs
from msgspec.structs import replace

from tablegen.base.figures import at_least, at_most, shown_path
from tablegen.base.input_errors import Rejected
from tablegen.certificate.certificate import position_scaling, scaling_errors
from tablegen.certificate.excess import Cause, Excess, excess
from tablegen.certificate.expected import expected_of
from tablegen.certificate.line_errors import EmittedPeriod
from tablegen.config.hardware import Place
from tablegen.config.load import Setup
from tablegen.config.schema import FastAxis
from tablegen.fixedpoint.phase import MAXIMUM_TICKS
from tablegen.fixedpoint.table_shape import MOST_LENGTH
from tablegen.planning.line_plan import LinePlan, Plan, make_plan

_MOST_TRIALS = 6  # of one key
_MARGIN = 1.1  # factor of the first guess, since errors of rounding do not scale exactly
_HARDWARE = re.compile(r"([xy]\.)?(amplifier|dac)\.")
_SCANNER = "scanner:"  # before a key of the scanner file
_ROUNDED_LSB = 0.5  # of a code, whatever its table is
_MOST_BITS = 24
_MOST_HARMONICS = 256  # a fit of more takes seconds
_MARGINS = (0.02, 0.05, 0.1, 0.15, 0.2)  # of the line, outside the imaging window

# Keys of the scan file, or behind ``_SCANNER`` of the scanner file, to their values; None takes a key out.
Change = Mapping[str, Any]


@dataclass(frozen=True)
class Remedy:
    """A tested change: the remaining error in percent, whether that is low enough, and whether all limits hold."""

    text: str
    percent: float
    low: bool
    within_limits: bool

    @property
    def enough(self) -> bool:
        """True if the change is enough."""
        return self.low and self.within_limits

    def __str__(self) -> str:
        also = "" if self.within_limits else ", with an error above limits.max_error_lsb"
        return f"{self.text} leaves {self.percent:.3g} %{also}"


def excess_remedies(
    setup: Setup, plan: Plan, line: LinePlan, exceeded: Excess, most: float | None = None
) -> list[Remedy]:
    """Plan and measure the remedies of one axis, a key each: the first value that is enough, or the best.

    ``exceeded`` is what the axis exceeds, ``most`` as in ``excess``. Where a change of the scan is enough, no other
    is looked for; of the hardware, both converter and amplifier are. A change that no plan can be made of is left out.
    """
    return _best_remedies(
        _WAYS[exceeded.cause](setup, plan, line, exceeded), lambda change: _trial(setup, plan, line, change, most)
    )


def operator_remedies(setup: Setup, plan: Plan, line: LinePlan, most: float, own: bool) -> list[Remedy]:
    """Plan and measure remedies for the scaling error that an operator expects: at most ``most`` percent.

    With ``own`` the errors of the emitted waveform count as well.
    """

    def trial(change: Change) -> Remedy | None:
        other = _planned(setup, change)
        if other is None:
            return None
        changed_line = other.x if line.axis == "x" else other.y
        expected = expected_of(changed_line)
        if expected is None or not expected.scaling:
            return None
        more = {side: max(one.total, one.band_limit) for side, one in scaling_errors(changed_line).items() if own}
        remaining = max(figure.value + more.get(side, 0.0) for side, figure in expected.scaling.items())
        return Remedy(_text(setup, change), remaining, remaining <= most, _keeps_the_error(plan, other))

    return _best_remedies(_other_bands(setup, plan, line), trial)


def resonance_remedies(setup: Setup, plan: Plan, line: LinePlan, most: float) -> list[Remedy]:
    """Plan and measure remedies for a resonance that the steps of the codes drive: shaping, or more codes."""
    hardware = [setup.hardware(one.axis) for one in plan.lines]
    shaping = _keys(setup.hardware(line.axis).where("dac.shaping"))
    dac = setup.hardware(line.axis).dac
    finest = min(_MOST_BITS, *(one.dac.word_bits or _MOST_BITS for one in hardware))
    bits = _keys(place for one in hardware for place in one.where("dac.bits"))
    ways: list[Iterator[Change]] = [
        (dict.fromkeys(shaping, order) for order in ("scanner", "second", "first")),
        (dict.fromkeys(bits, n) for n in range(dac.bits + 1, min(dac.bits + 5, finest + 1))),
        islice(_slower(setup, plan), 2),  # where not the rounding but the ticks are coarse
    ]

    def trial(change: Change) -> Remedy | None:
        other = _planned(setup, change)
        if other is None:
            return None
        remaining = position_scaling(other.x if line.axis == "x" else other.y)
        return Remedy(_text(setup, change), remaining, remaining <= most, _keeps_the_error(plan, other))

    return _best_remedies(ways, trial)


def _best_remedies(ways: Iterable[Iterable[Change]], trial: Callable[[Change], Remedy | None]) -> list[Remedy]:
    remedies = []
    for changes in ways:
        best: Remedy | None = None
        for change in changes:
            one = trial(change)
            if one is not None and (best is None or one.percent < best.percent):
                best = one
            if best is not None and best.low:
                break
        if best is not None:
            remedies.append(best)
            if best.enough and not _HARDWARE.match(best.text):
                break
    return remedies


def changed(setup: Setup, change: Change) -> Setup:
    """Return the setup with other values at dotted keys of its files; the values are not checked."""

    def put(struct: Any, path: list[str], value: Any) -> Any:
        name, *rest = path
        return structs.replace(struct, **{name: put(getattr(struct, name), rest, value) if rest else value})

    scan, scanner = setup.scan, setup.scanner
    for key, value in change.items():
        if key.startswith(_SCANNER):
            scanner = put(scanner, key.removeprefix(_SCANNER).split("."), value)
        else:
            scan = put(scan, key.split("."), value)
    return replace(setup, scan=scan, scanner=scanner)


def _trial(setup: Setup, plan: Plan, line: LinePlan, change: Change, most: float | None) -> Remedy | None:
    """Plan and measure one change; None where it cannot be planned."""
    other = _planned(setup, change)
    if other is None:
        return None
    scaling = scaling_errors(other.x if line.axis == "x" else other.y)
    remaining = max(max(one.total, one.band_limit, abs(one.size)) for one in scaling.values())
    return Remedy(_text(setup, change), remaining, excess(scaling, most) is None, _keeps_the_error(plan, other))


def _planned(setup: Setup, change: Change) -> Plan | None:
    try:
        return make_plan(changed(setup, change), sines=True)
    except Rejected:
        return None


def _text(setup: Setup, change: Change) -> str:
    """Write the change as keys and values of the files."""

    def part(key: str, value: Any) -> str:
        name = f" in {shown_path(Path(Path(setup.scanner_file.name).name))}" if key.startswith(_SCANNER) else ""
        written, factor = setup.scan_file.written_key(key)
        text = _value(value if factor == 1.0 else factor * value)
        return f"{written.removeprefix(_SCANNER)} = {text}{name}"

    return " with ".join(part(key, value) for key, value in change.items() if value is not None)


def _keeps_the_error(plan: Plan, other: Plan) -> bool:
    """Return True if no axis newly exceeds ``limits.max_error_lsb``: a finer code is a smaller LSB."""
    limit = plan.limits.max_error_lsb
    return limit is None or all(
        EmittedPeriod(new).largest_error() <= limit or EmittedPeriod(old).largest_error() > limit
        for old, new in zip(plan.lines, other.lines, strict=True)
    )


def _value(value: object) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(f'{one:g}' for one in value)}]"
    return f'"{value}"' if isinstance(value, str) else f"{value:.9g}"


def _against_quantisation(setup: Setup, plan: Plan, line: LinePlan, exceeded: Excess) -> Iterator[Iterator[Change]]:
    axis, table = line.axis, line.program
    if line.table_request is not None:
        requested, least = line.table_request.max_error_lsb, 0.0 if line.table_request.shaped else _ROUNDED_LSB
        yield ({f"{axis}.table.max_error_lsb": requested / share} for share in (2.0, 4.0) if requested / share > least)
    bits = ceil(log2(_MARGIN) + log2(abs(exceeded.percent)) - log2(exceeded.limit))  # their quotient may be no float
    words_per_code = 2.0**table.bits / (abs(line.codes_per_unit) * line.scale)
    if words_per_code < 2.0 and line.table_request is None:
        yield ({f"{axis}.table.bits": b} for b in range(table.bits + bits, _MOST_BITS + 1))
    length = len(table.words)
    if line.table_request is None and table.mode != "direct" and length < 64 * line.series.harmonics:
        yield ({f"{axis}.table.length": n} for n in (4 * length, 16 * length) if n <= MOST_LENGTH[table.mode])
    yield _amplifiers(setup, plan, line, exceeded)
    hardware = [setup.hardware(one.axis) for one in plan.lines]
    dac = setup.hardware(axis).dac
    most = min(_MOST_BITS, *(one.dac.word_bits or _MOST_BITS for one in hardware))
    places = _keys(place for one in hardware for place in one.where("dac.bits"))
    yield (dict.fromkeys(places, b) for b in range(dac.bits + bits, min(dac.bits + bits + 3, most + 1)))


def _keys(places: Iterable[Place]) -> list[str]:
    """List the keys of a change, each once."""
    return list(dict.fromkeys(f"{_SCANNER if place.in_scanner else ''}{place.key}" for place in places))


def _amplifiers(setup: Setup, plan: Plan, line: LinePlan, exceeded: Excess) -> Iterator[Change]:
    """Yield a gain that is as much lower as is needed, or as the drives on this amplifier allow, about their middle."""
    hardware = setup.hardware(line.axis)
    dac, gain = hardware.dac, hardware.amplifier.gain
    gains, biases = _keys(hardware.where("amplifier.gain")), _keys(hardware.where("amplifier.bias_v"))
    ends = []
    for one in plan.lines:
        its = setup.hardware(one.axis)
        if not {*gains, *biases} & {*_keys(its.where("amplifier.gain")), *_keys(its.where("amplifier.bias_v"))}:
            continue  # it has an amplifier of its own
        words, output = one.program.words, one.program.output
        codes = output.code(one.program.resting(np.array([words.min(), words.max()])))
        ends += [one.converter.v_zero + one.converter.v_per_code * code for code in codes.tolist()]
        park_v = getattr(setup.scan, one.axis).park_v
        ends.append(one.drive.v_offset if park_v is None else park_v)
    bottom, top = min(ends), max(ends)
    tightest = float(at_least(1.01 * (top - bottom) / (dac.highest_v - dac.v_min), 4))
    lower = float(at_most(abs(gain) / (_MARGIN * exceeded.times), 2))
    for size in dict.fromkeys((max(lower, tightest), max(0.7 * lower, tightest))):
        if size < 0.99 * abs(gain):
            one_gain = float(f"{copysign(size, gain):.4g}")
            bias_v = 0.5 * (bottom + top) - one_gain * 0.5 * (dac.v_min + dac.highest_v)
            yield dict.fromkeys(gains, one_gain) | dict.fromkeys(biases, float(f"{bias_v:.4g}"))


def _against_band_limit(setup: Setup, plan: Plan, line: LinePlan, exceeded: Excess) -> Iterator[Iterator[Change]]:
    if line.band_limit.method != "window":
        yield iter([{f"{line.axis}.band_limit.method": "window"}])
    yield from _other_bands(setup, plan, line)


def _other_bands(setup: Setup, plan: Plan, line: LinePlan) -> Iterator[Iterator[Change]]:
    """Yield more harmonics, or a narrower window; first what helps more."""
    axis = line.axis
    scan: FastAxis = getattr(setup.scan, axis)
    limit, harmonics = scan.band_limit, line.series.harmonics
    low, high = limit.window
    windows = [(max(low, margin), min(high, round(1.0 - margin, 9))) for margin in _MARGINS]
    narrower = ({f"{axis}.band_limit.window": window} for window in windows if window != (low, high))
    sharp = min(low, 1.0 - high) < _MARGINS[1]  # no number of harmonics makes a sharp turn
    if sharp:
        yield narrower
    most = min((line.program.phase.ticks - 1) // 2, max(_MOST_HARMONICS, harmonics))
    if line.program.mode != "direct":
        most = min(most, len(line.program.words) // 2 - 1)
    more = [min(harmonics << i, most) for i in range(1, _MOST_TRIALS + 1)]
    counts = [n for n in dict.fromkeys(more) if n > harmonics]
    if line.kept_percent is not None:  # more harmonics would lower the acceleration and leave the same error
        errors = [float(at_most(line.kept_percent / (1 << i), 3)) for i in range(1, _MOST_TRIALS + 1)]
        yield ({f"{axis}.band_limit.max_scaling_error_percent": error} for error in errors)
    elif limit.cutoff_hz is None:
        yield ({f"{axis}.band_limit.harmonics": n} for n in counts)
    else:
        yield ({f"{axis}.band_limit.cutoff_hz": float(at_least(float(n * line.rate), 6))} for n in counts)
        yield _slower(setup, plan)
    if not sharp:
        yield narrower


def _against_model(setup: Setup, plan: Plan, line: LinePlan, exceeded: Excess) -> Iterator[Iterator[Change]]:
    axis = line.axis
    limit = getattr(setup.scan, axis).band_limit
    free = (line.held_harmonics[0] if line.held_harmonics else line.series.harmonics) - 1
    counts = [n for n in dict.fromkeys((free, 3 * free // 4, free // 2)) if n >= 1]
    if limit.cutoff_hz is None:
        yield ({f"{axis}.band_limit.harmonics": n} for n in counts)
    else:
        yield ({f"{axis}.band_limit.cutoff_hz": float(at_least(float(n * line.rate), 6))} for n in counts)
    yield _slower(setup, plan)


def _slower(setup: Setup, plan: Plan) -> Iterator[Change]:
    """Yield half the line rate, a quarter, and so on, by the key that sets it."""
    timing = setup.scan.timing
    key = next((k for k in ("ticks_per_line", "ticks_per_pixel") if getattr(timing, k) is not None), "line_rate_hz")
    requested = getattr(timing, key)
    for i in range(1, _MOST_TRIALS + 1):
        if plan.schedule.frame_ticks << i <= MAXIMUM_TICKS:
            value = requested / (1 << i) if key == "line_rate_hz" else requested << i
            yield {f"timing.{key}": value}


_Way = Callable[[Setup, Plan, LinePlan, Excess], Iterator[Iterator[Change]]]
_WAYS: dict[Cause, _Way] = {
    "quantisation": _against_quantisation,
    "band limit": _against_band_limit,
    "model": _against_model,
}
