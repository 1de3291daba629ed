"""Name records that are wrong by what they look like: units, sign, delay, hum, voltages before the amplifier, clipping.

A record whose fit would be wrong is refused, any other gets a remark. Each has a code, listed in
docs/troubleshooting.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tablegen.base.input_errors import Problem, Rejected, Unphysical
from tablegen.base.remedies import FindingCode
from tablegen.base.warnings import Remark, spoils
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.periodic_line import PHASES, PeriodicLine, periodic_line
from tablegen.calibration.spans import LEAST_SPAN
from tablegen.calibration.tables.columns import ACTUAL, DRIVE, OFFSET, Column
from tablegen.calibration.tables.table import MeasuredTable
from tablegen.calibration.tables.traces import split_traces
from tablegen.compensation.dynamics import Response
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver

_TYPICAL_NM_PER_V = (0.1, 2e4)  # single piezo plates and levered stages of 100 um for 10 V are within
_NEAR_THOUSAND = 4.0  # ratio to a factor of 1000 that a wrong unit may have beside the scanner's own scatter
_NEAR_GAIN = 2.0  # ratio to the gain of the amplifier
_CONVERTER_V = 10.5  # converters and controllers give 10 V at most
_LEAST_GAIN = 4.0  # of amplifiers that are looked for
_AT_END, _MOVES_THERE = 0.003, 0.06  # of the displacement's and of the drive's span
_LEAST_AT_END = 0.03  # share of samples at an end that is called clipped
_DELAY = 0.007  # of the period, at both turns
_TURN_NEAR, _TURN_FAR = 0.01, 0.10  # of the period: samples from which a turn is extrapolated
_SHARP = 0.01  # of the stroke that the drive is below its turn after 0.01 of the period
_MAINS_HZ = (50.0, 60.0)
_HUM, _HUM_RATIO, _HUM_NEAREST = 5e-4, 6.0, 2.5  # of the displacement's span; of median and most beside the line
_LEAST_CYCLES = 10  # of the mains in a record
_HARMONIC_HUM, _HARMONIC_RATIO = 2e-3, 5.0
_LEAST_SAMPLES = 40
_MOST_SAMPLES, _MOST_HARMONICS = 20_000, 40


@dataclass(frozen=True)
class Known:
    """What is known of the scanner: the driver's range, nm per V and the amplifier's gain; None where unknown.

    ``states_gain`` is True if the user stated the gain between the recorder and the piezo, ``fits_delay`` if the delay
    of the sensor is fitted, ``delay_s`` is that which was given. ``absolute`` is True if the fit takes lengths in nm.
    ``response`` are the dynamics that the fit removes.
    """

    driver: Driver
    nm_per_v: float | None = None
    gain: float | None = None
    states_gain: bool = False
    fits_delay: bool = False
    delay_s: float = 0.0
    absolute: bool = False
    response: Response | None = None


class WrongRecord(Unphysical):
    """A record that is wrong by a cause that is known; ``code`` is that of the finding."""

    def __init__(self, text: str, code: FindingCode) -> None:
        super().__init__(text)
        self.code = code


def trace_remarks(tables: Sequence[MeasuredTable], known: Known, axis: str) -> tuple[Remark, ...]:
    """Check the traces of a sensor; return remarks on those that may be wrong, and those of their tables.

    Raises
    ------
    Rejected
        If a trace is wrong by a cause that makes the fit wrong; the problem has its code.
    """
    remarks: list[Remark] = [remark for table in tables for remark in table.remarks]
    problems: list[Problem] = []
    traces = [(table, trace) for table in tables for trace in split_traces(table) if _is_record(trace)]
    if not traces:
        return tuple(remarks)
    try:
        remarks += _voltages([trace.drive_v for _, trace in traces], _sensitivity([one for _, one in traces]), known)
    except WrongRecord as fault:
        problems.append(Problem(traces[0][0].file, 0, DRIVE.name, str(fault)).coded(fault.code, axis))
    signs: list[bool] = []
    for table, trace in traces:
        try:
            remarks += [one.under(trace.name) for one in _of_trace(trace, known)]
        except WrongRecord as fault:
            text = f"{trace.name}: {fault}" if trace.name != table.source.name else str(fault)
            problems.append(Problem(table.file, 0, "", text).coded(fault.code, axis))
        signs.append(_is_inverted(trace))
    if problems:
        raise Rejected(problems)
    if any(signs):
        remarks.append(_inverted([trace.name for _, trace in traces], signs))
    return tuple(remarks)


def table_remarks(table: MeasuredTable, known: Known) -> tuple[Remark, ...]:
    """Return remarks on a table of sizes or offsets: on its units, and on voltages before the amplifier."""
    remarks = list(table.remarks)
    column: Column | None = next((one for one in (OFFSET, DRIVE) if one in table), None)
    if column is None:
        return tuple(remarks)
    volts = table[column]
    is_size = ACTUAL in table and float(np.min(volts)) > LEAST_SPAN
    nm_per_v = float(np.median(table[ACTUAL] / volts)) if is_size else None
    try:
        remarks += _voltages([volts], nm_per_v, known)
        if nm_per_v is not None:
            remarks += _lengths(nm_per_v, known, "the size")
    except WrongRecord as fault:  # the table may be right, and the law in the scanner file wrong
        remarks.append(spoils(str(fault), code=fault.code))
    return tuple(remarks)


def _is_record(trace: Trace) -> bool:
    """Return True if times ascend and everything moves: the fits refuse any other trace, with the reason."""
    columns = (trace.time_s, trace.drive_v, trace.displacement_nm)
    if len(trace.time_s) < _LEAST_SAMPLES or not all(np.all(np.isfinite(values)) for values in columns):
        return False
    return bool(np.all(np.diff(trace.time_s) > 0.0)) and all(np.ptp(values) >= LEAST_SPAN for values in columns)


def _of_trace(trace: Trace, known: Known) -> list[Remark]:
    refuse_clipped(trace)
    remarks = _lengths(_sensitivity([trace]) or 0.0, known, "the sensor")
    try:
        line = periodic_line(trace, known.driver)
    except Unphysical:
        return remarks  # the fits refuse it, or need no period
    return remarks + _delay(line, known) + hum_remarks(trace, line)


def _sensitivity(traces: Sequence[Trace]) -> float | None:
    spans = [(float(np.ptp(one.displacement_nm)), float(np.ptp(one.drive_v))) for one in traces if len(one.drive_v)]
    ratios = [nm / v for nm, v in spans if v > 0.0]
    return float(np.median(ratios)) if ratios else None


def _lengths(nm_per_v: float, known: Known, what: str) -> list[Remark]:
    """Compare nm per V with the scanner's, or with those of any scanner.

    Raises
    ------
    WrongRecord
        If lengths are wrong by a factor of 1000, and the fit takes them in nm.
    """
    measured = f"{what} moves {nm_per_v:.3g} nm per V"
    if known.nm_per_v is not None:
        ratio = nm_per_v / known.nm_per_v
        usual = f"the size law of the scanner says {known.nm_per_v:.3g}"
        small = 1e-3 / _NEAR_THOUSAND < ratio < 1e-3 * _NEAR_THOUSAND
        large = 1e3 / _NEAR_THOUSAND < ratio < 1e3 * _NEAR_THOUSAND
        right = ""
    else:
        small, large = nm_per_v < _TYPICAL_NM_PER_V[0], nm_per_v > _TYPICAL_NM_PER_V[1]
        usual = f"piezo scanners move {_TYPICAL_NM_PER_V[0]:g} to {_TYPICAL_NM_PER_V[1]:g}"
        right = "; if it is right, calibrate the size first"
    if not small and not large:
        return []
    swap = ("micrometres called nanometres", "um") if small else ("nanometres called micrometres", "nm")
    text = (
        f"{measured} where {usual}: this looks like {swap[0]}. Name the column displacement_{swap[1]} or "
        f"Position ({swap[1]}), or give --columns displacement=COLUMN:{swap[1]}{right}"
    )
    if known.absolute:
        raise WrongRecord(text, "wrong-length-unit")
    return [spoils(text, code="wrong-length-unit")]


def _voltages(drives: Sequence[Floats], nm_per_v: float | None, known: Known) -> list[Remark]:
    """Look for the voltage of a controller, before the amplifier, in place of that at the piezo.

    Raises
    ------
    WrongRecord
        If the sensitivity or the gain in the scanner file says so.
    """
    most = max((float(np.max(np.abs(drive))) for drive in drives if len(drive)), default=0.0)
    span = known.driver.span
    if known.states_gain or not most > 0.0:
        return []
    before = f"the recorded drive reaches {most:.3g} V, {100.0 * most / span:.2g} % of the driver's {known.driver}"
    remedy = (
        "Give --drive-gain G, volts at the piezo for a recorded volt, and --drive-offset V if 0 V is not 0 V there; "
        "--drive-gain 1 if it was recorded at the piezo"
    )
    gain, cause = None, ""
    if nm_per_v is not None and known.nm_per_v is not None:
        ratio = nm_per_v / known.nm_per_v
        if ratio >= _LEAST_GAIN and most * ratio <= _NEAR_GAIN * span and ratio < 1e3 / _NEAR_THOUSAND:
            gain = ratio
            cause = f"the sensor moves {ratio:.3g} times as far per volt as the size law of the scanner says"
    elif known.gain is not None and known.gain >= _LEAST_GAIN and 0.2 * span <= most * known.gain <= 1.05 * span:
        gain = known.gain
        cause = f"the amplifier of the scanner file has a gain of {gain:.3g}"
    if gain is not None:
        text = f"{before}, and {cause}: this looks like volts of the controller, before the amplifier. {remedy}"
        raise WrongRecord(text, "controller-volts")
    if known.nm_per_v is None and most <= _CONVERTER_V and span >= _LEAST_GAIN * _CONVERTER_V:
        return [
            spoils(
                f"{before}, as a controller before an amplifier gives: are these volts at the piezo? {remedy}",
                code="controller-volts",
            )
        ]
    return []


def refuse_clipped(trace: Trace) -> None:
    """Refuse a displacement that stands still at an end of its range while the drive moves.

    Raises
    ------
    WrongRecord
        If it does.
    """
    x, drive = trace.displacement_nm, trace.drive_v
    span, stroke = float(np.ptp(x)), float(np.ptp(drive))
    for end, at in (("largest", float(np.max(x))), ("least", float(np.min(x)))):
        still = np.abs(x - at) <= _AT_END * span
        share = float(np.mean(still))
        runs = max(int(np.sum(np.diff(still, prepend=False) & still)), 1)
        moves = float(np.ptp(drive[still])) / stroke
        if share > _LEAST_AT_END and np.sum(still) >= 6 * runs and moves > _MOVES_THERE:
            raise WrongRecord(
                f"the displacement stays at its {end} value, {at:.6g} nm, for {100.0 * share:.2g} % of the record "
                f"while the drive moves by {100.0 * moves:.2g} % of its stroke: the sensor, or the input of its "
                "recorder, is clipped. Record with more range, a centred sensor, or a smaller stroke",
                "clipped-sensor",
            )


def _is_inverted(trace: Trace) -> bool:
    return bool(np.corrcoef(trace.drive_v, trace.displacement_nm)[0, 1] < 0.0)


def _inverted(names: Sequence[str], signs: Sequence[bool]) -> Remark:
    listed = [name for name, sign in zip(names, signs, strict=True) if sign]
    which = "every trace" if all(signs) else ", ".join(listed[:3]) + (", ..." if len(listed) > 3 else "")
    text = (
        f"{which}: the displacement falls where the drive rises; its sign was inverted. The sensor counts against the "
        "axis, or its leads are exchanged; if the sensor is right, the axis is wired backwards"
    )
    if all(signs):
        return Remark(text, code="inverted-sensor")
    return spoils(f"{text}. The other traces have the other sign", code="inverted-sensor")


def _delay(line: PeriodicLine, known: Known) -> list[Remark]:
    if known.fits_delay:
        return []
    moved = line.earlier(known.delay_s) if known.delay_s else line
    delays = turn_delays(moved if known.response is None else moved.without(known.response, None))
    sizes = [abs(delay) for delay in delays]
    one_sign = len({delay > 0.0 for delay in delays}) == 1
    if not one_sign or min(sizes) < _DELAY or max(sizes) > 3.0 * min(sizes):
        return []
    share = float(np.mean(delays))
    seconds = share / line.rate_hz
    side = "after" if share > 0.0 else "before"
    state = "" if not known.delay_s else f", beyond the --delay-s {known.delay_s:g} that was given"
    return [
        spoils(
            f"the displacement turns {abs(seconds):.3g} s {side} the drive: this looks like a delay of "
            f"{100.0 * abs(share):.2g} % of the period{state}, of the sensor's filter, the recorder or the scanner's "
            f"dynamics. Give --delay-s fit, or --delay-s {known.delay_s + seconds:.3g}",
            100.0 * abs(share),
            "sensor-delay",
        )
    ]


def turn_delays(line: PeriodicLine) -> list[float]:
    """Return by how much the displacement turns after the drive, in periods, at the upper and the lower turn.

    Both sides of a turn are extrapolated by parabolas to the point where they meet. Empty where the drive is rounded at
    its turns.
    """
    drive = (line.drive - line.low) / line.stroke
    top = int(np.argmax(drive))
    delays = []
    for at, before, after in ((top, top, PHASES - top), (0, PHASES - top, top)):
        far = min(_TURN_FAR, 0.4 * min(before, after) / PHASES)
        height = drive if at == top else 1.0 - drive
        beside = [float(height[(at + step) % PHASES]) for step in (-PHASES // 100, PHASES // 100)]
        if float(height[at]) - max(beside) < _SHARP or far < 3.0 * _TURN_NEAR:
            return []
        window = np.arange(at - round(far * PHASES), at + round(far * PHASES) + 1)
        moved = line.displacement_nm[window % PHASES]
        latest = int(window[int(np.argmax(moved) if at == top else np.argmin(moved))])
        own, other = _turn(drive, at / PHASES, far), _turn(line.displacement_nm, latest / PHASES, far)
        if own is None or other is None:
            return []
        delays.append(other - own)
    return delays


def _turn(values: Floats, start: float, far: float) -> float | None:
    """Return the phase, in periods, near ``start`` at which the branches before and after a turn meet."""
    at = start
    for _ in range(12):
        polynomials = []
        for sign in (-1.0, 1.0):
            steps = np.arange(_TURN_NEAR, far, 1.0 / PHASES)
            phases = (at + sign * steps) * PHASES
            there = np.interp(phases, np.arange(PHASES), values, period=PHASES)
            polynomials.append(np.polyfit(sign * steps, there, 2))
        difference = polynomials[1] - polynomials[0]
        roots = [float(root.real) for root in np.roots(difference) if abs(root.imag) < 1e-9]
        if not roots:
            return None
        step = float(np.clip(min(roots, key=abs), -far, far))
        at += 0.7 * step
        if abs(step) < 1e-5:
            break
    return at


def hum_remarks(trace: Trace, line: PeriodicLine) -> list[Remark]:
    """Return a remark if mains stand out of the displacement, beside or on a harmonic of the line."""
    time, x = trace.time_s[:_MOST_SAMPLES], trace.displacement_nm[:_MOST_SAMPLES]
    seconds = float(time[-1] - time[0])
    rate_hz = (len(time) - 1) / seconds
    residual: Floats | None = None
    for mains in _MAINS_HZ:
        order = mains / line.rate_hz
        if rate_hz < 2.5 * mains or seconds < _LEAST_CYCLES / mains:
            continue
        distance = abs(order - round(order)) * line.rate_hz * seconds
        if distance >= 0.1 and distance < 2.5:
            continue  # too near a harmonic to be told from it
        if distance < 0.1:
            share = _harmonic_share(line, round(order)) if seconds * line.rate_hz >= 1.0 else 0.0
        else:
            residual = _beside_harmonics(time, x, line.rate_hz) if residual is None else residual
            share = _share_at(mains, time, residual) / float(np.ptp(line.displacement_nm))
            share = share if share > _HUM else 0.0
        if share:
            hz = f"{mains:g} Hz"
            text = (
                f"a line at {hz} of {100.0 * share:.2g} % of the displacement stands out of the residual: this looks "
                "like mains hum"
            )
            return [spoils(text, 100.0 * share, "mains-hum")]
    return []


def _beside_harmonics(time: Floats, x: Floats, rate_hz: float) -> Floats:
    """Return a displacement without drift and harmonics of the line, under a Hann window."""
    seconds = float(time[-1] - time[0])
    count = int(min(_MOST_HARMONICS, (len(time) - 1) / seconds / rate_hz / 2.5))
    s = 2.0 * (time - time[0]) / seconds - 1.0
    once = np.exp(2j * np.pi * rate_hz * (time - time[0]))
    waves = once[:, None] ** np.arange(1, count + 1)
    basis = np.column_stack([s[:, None] ** np.arange(4), waves.real, waves.imag])
    fit = np.linalg.lstsq(basis.T @ basis, basis.T @ x, rcond=None)[0]
    residual: Floats = (x - basis @ fit) * np.hanning(len(time))
    return residual


def _share_at(mains: float, time: Floats, residual: Floats) -> float:
    """Return the amplitude at the mains frequency, 0 where it does not stand out of frequencies beside it."""

    def amplitude(hz: float) -> float:
        return 4.0 * float(np.abs(np.mean(residual * np.exp(-2j * np.pi * hz * time))))

    seconds = float(time[-1] - time[0])
    own = max(amplitude(mains + step) for step in np.linspace(-0.1, 0.1, 5))
    hz_beside = [mains + sign * n / seconds for n in range(3, 10) for sign in (-1.0, 1.0)]
    beside = [amplitude(hz) for hz in hz_beside]
    # Creep leaves a slope of low frequencies, the nearest of which is as high as the mains.
    return own if own > max(_HUM_RATIO * float(np.median(beside)), _HUM_NEAREST * max(beside)) else 0.0


def _harmonic_share(line: PeriodicLine, order: int) -> float:
    """Return the amplitude of one harmonic that stands out of its neighbours, beyond that of the drive."""
    if not 6 <= order < PHASES // 8:
        return 0.0
    slope, offset = np.polyfit(line.drive, line.displacement_nm, 1)
    spectrum = 2.0 / PHASES * np.abs(np.fft.rfft(line.displacement_nm - slope * line.drive - offset))
    steps = (-2, -1, 1, 2, 4) if order < 10 else (-4, -2, -1, 1, 2, 4)  # hysteresis has low harmonics of its own
    beside = max(float(spectrum[order + step]) for step in steps)
    own, span = float(spectrum[order]), float(np.ptp(line.displacement_nm))
    return own / span if own > max(_HARMONIC_HUM * span, _HARMONIC_RATIO * beside) else 0.0
