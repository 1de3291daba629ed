"""What a build promises, measured on every emitted integer of one whole period of each axis.

The scaling error is the paper's: relative deviation of the local slope from the ideal, in percent, peak to
peak over the imaging window. Of float waveforms the slope is the analytic one; of integers it is a chord of 1/20 of the
line, since the slope between neighbouring codes means nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import log10

import numpy as np

from tablegen.compensation.dynamics import capped_inverse
from tablegen.compensation.hysteresis import BranchShape
from tablegen.numerics.arrays import Floats, Ints
from tablegen.plan import LinePlan, Plan
from tablegen.problems import Document, Problem
from tablegen.waveform.sampler import Sampler
from tablegen.waveform.series import FourierSeries

CHORD = 0.05  # of the line, about one lattice constant of the paper's images
_CHUNK = 1 << 15
_POINTS_PER_HARMONIC = 16  # over the window, for analytic slopes
_KEPT = 1 << 24  # errors kept for the chords; longer frames keep every so-manieth, all else sees every tick
_SPECTRUM = 1 << 22  # longest period whose spectrum is taken

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class ScalingError:
    """Scaling error of one direction in percent: peak to peak over the window, and of the window as a whole.

    ``total`` is of the emitted integers through the scanner's model; ``band_limit``, ``quantisation`` and
    ``model`` are its parts taken alone, the last being what the boost limit leaves of the dynamics. ``size`` is the
    error of the window's extent. ``uncompensated`` is what a triangle of the same amplitude would give.
    """

    total: float
    band_limit: float
    quantisation: float
    model: float
    size: float
    uncompensated: float


@dataclass(frozen=True)
class Certificate:
    """The error budget of one axis. Codes and LSB are the converter's; dB are of power, relative to the scan's."""

    ticks: int
    max_error_lsb: float
    rms_error_lsb: float
    scaling: dict[str, ScalingError]
    lowest_code: int
    highest_code: int
    headroom_low: int
    headroom_high: int
    largest_step: int
    max_step: int
    peak_slew_v_per_s: float
    beyond_cutoff_db: float
    at_resonance_db: float | None

    @property
    def scaling_error_percent(self) -> float:
        """The worst of both directions."""
        return max(error.total for error in self.scaling.values())

    @property
    def size_error_percent(self) -> float:
        """The worst of both directions, with its sign."""
        return max((error.size for error in self.scaling.values()), key=abs)


def certify(plan: Plan, progress: Progress | None = None) -> dict[str, Certificate]:
    """Certificates of both axes; ``progress`` is told an axis and the share done, for frames of many ticks."""
    return {line.axis: _certify(line, progress) for line in plan.lines}


def broken_limits(plan: Plan, certificates: dict[str, Certificate], file: Document) -> list[Problem]:
    """The limits of the configuration that a certificate exceeds, each with a remedy."""
    problems = []
    for axis, certificate in certificates.items():
        limit = plan.limits.max_error_lsb
        if limit is not None and certificate.max_error_lsb > limit:
            why = f"the {axis} axis errs by up to {certificate.max_error_lsb:.4g} LSB, above {limit:g}; "
            problems.append(file.problem("limits.max_error_lsb", why + f"lengthen or widen {axis}.table"))
        limit = plan.limits.max_scaling_error_percent
        if limit is None:
            continue
        worst, size = certificate.scaling_error_percent, certificate.size_error_percent
        if worst > limit or abs(size) > limit:
            what = f"scaling error of {worst:.4g} %" if worst > limit else f"size error of {size:+.4g} %"
            parts = max(certificate.scaling.values(), key=lambda error: error.total)
            remedy = _remedy(axis, parts)
            why = f"the {axis} axis has a {what}, above {limit:g} %; {remedy}"
            problems.append(file.problem("limits.max_scaling_error_percent", why))
    return problems


def _remedy(axis: str, parts: ScalingError) -> str:
    largest = max(parts.band_limit, parts.quantisation, parts.model)
    if largest == parts.band_limit:
        return f"most of it is the band limit: more {axis}.band_limit.harmonics, a narrower window or method = 'window'"
    if largest == parts.model:
        return "most of it is dynamics that max_boost_db leaves: fewer harmonics or a lower line rate"
    return f"most of it is quantisation: more dac.bits, or an amplifier whose range fits the {axis} scan"


def _certify(line: LinePlan, progress: Progress | None) -> Certificate:
    program, output = line.program, line.program.output
    stride = -(-program.ticks // _KEPT)
    kept: list[Floats] = []
    worst = total = square = code_sum = code_square = 0.0
    lowest, highest, largest_step = 1 << 30, -1, 0
    previous = int(line.codes(program.ticks - 1, program.ticks)[0])
    first_skip = 0
    reference = Sampler(line.series, program.phase.ticks)
    held = line.float_codes(reference.samples(0, program.phase.ticks)) if program.hold > 1 else None
    for start in range(0, program.ticks, _CHUNK):
        stop = min(start + _CHUNK, program.ticks)
        codes = line.codes(start, stop)
        asked = (
            line.float_codes(reference.samples(start, stop))
            if held is None
            else held[np.arange(start, stop) // program.hold]
        )
        error = codes - asked
        worst = max(worst, float(np.max(np.abs(error))))
        total += float(np.sum(error))
        square += float(np.sum(error * error))
        centred = codes - float(output.offset_code)
        code_sum += float(np.sum(centred))
        code_square += float(np.sum(centred * centred))
        lowest, highest = min(lowest, int(codes.min())), max(highest, int(codes.max()))
        largest_step = max(largest_step, abs(int(codes[0]) - previous), _largest_step(codes))
        previous = int(codes[-1])
        kept.append(error[first_skip::stride])
        first_skip = (first_skip - (stop - start)) % stride
        if progress is not None and stop < program.ticks:
            progress(line.axis, stop / program.ticks)
    ticks = program.ticks
    variance = max(square / ticks - (total / ticks) ** 2, 1e-30)
    power = max(code_square / ticks - (code_sum / ticks) ** 2, 1e-30)
    errors = np.concatenate(kept)
    directions = {"forward": line.drive.shape.forward}
    if line.band_limit.directions == "both":
        directions["backward"] = line.drive.shape.backward
    return Certificate(
        ticks=ticks,
        max_error_lsb=worst,
        rms_error_lsb=float(np.sqrt(square / ticks)),
        scaling={side: _scaling(line, side, branch, errors, stride) for side, branch in directions.items()},
        lowest_code=lowest,
        highest_code=highest,
        headroom_low=lowest - output.code_min,
        headroom_high=output.code_max - highest,
        largest_step=largest_step,
        max_step=output.max_step,
        peak_slew_v_per_s=line.drive.v_amplitude * line.series.peak_slope() * float(line.rate),
        beyond_cutoff_db=10.0 * log10(variance / power),
        at_resonance_db=_at_resonance(line, power),
    )


def _largest_step(codes: Ints) -> int:
    return int(np.max(np.abs(np.diff(codes)))) if len(codes) > 1 else 0


def _times(line: LinePlan, side: str, position: Floats) -> Floats:
    """When the sweep of one direction passes a normalised position, in periods."""
    turn = line.drive.turn
    return turn * position if side == "forward" else turn + (1.0 - turn) * (1.0 - position)


def _scaling(line: LinePlan, side: str, branch: BranchShape, errors: Floats, stride: int) -> ScalingError:
    low, high = line.band_limit.window
    position = np.linspace(low, high, _POINTS_PER_HARMONIC * line.target.harmonics + 513)
    times = _times(line, side, position)
    ideal_slope = line.drive.shape.slope(times)
    reached = _reached(line)
    target_slope = line.target.value(times, 1)
    reached_slope = target_slope if reached is line.target else reached.value(times, 1)
    # Where the modelled piezo is, to first order in a deviation of at most some percent: x - tau = (w - u) / u'.
    sweep = position if side == "forward" else 1.0 - position
    steepness = branch.slope(sweep)
    deviation = (reached.value(times) - line.drive.shape.value(times)) / steepness
    chords, noise = _chords(line, side, position, deviation, steepness, errors, stride)
    # A triangle leaves the piezo at the inverse of the branch, whose slope is 1 / u'.
    triangle = 1.0 / branch.slope(branch.inverse(sweep))
    middle = float(1.0 / branch.slope(branch.inverse(0.5)))
    return ScalingError(
        total=_peak_to_peak(chords),
        band_limit=_peak_to_peak(target_slope / ideal_slope),
        quantisation=_peak_to_peak(noise),
        model=_peak_to_peak((reached_slope - target_slope) / ideal_slope),
        size=100.0 * float(deviation[-1] - deviation[0]) / (high - low),
        uncompensated=_peak_to_peak(triangle / middle),
    )


def _peak_to_peak(values: Floats) -> float:
    return 100.0 * float(np.max(values) - np.min(values))


def _reached(line: LinePlan) -> FourierSeries:
    """The drive as the piezo sees it: the target, less what the boost limit held back."""
    if not line.held_harmonics or line.drive.response is None:
        return line.target
    n = np.arange(1.0, line.target.harmonics + 1.0)
    f = n * float(line.rate)
    asked_real, asked_imaginary = line.drive.response.inverse(f)
    given_real, given_imaginary, _ = capped_inverse(line.drive.response, f, line.drive.max_boost_db)
    # The phase is kept, so that the ratio is real.
    ratio = np.hypot(given_real, given_imaginary) / np.hypot(asked_real, asked_imaginary)
    return FourierSeries(line.target.a0, line.target.a * ratio, line.target.b * ratio)


def _chords(
    line: LinePlan,
    side: str,
    position: Floats,
    deviation: Floats,
    steepness: Floats,
    errors: Floats,
    stride: int,
) -> tuple[Floats, Floats]:
    """Slope errors (1 is 100 %) of the chords inside the window: of the emitted integers, and of quantisation alone.

    Every tick of the window that was kept begins a chord. ``deviation`` and ``steepness`` stand at ``position``.
    """
    ticks, turn = line.program.ticks, line.drive.turn
    share = turn if side == "forward" else 1.0 - turn
    ends = sorted(float(t) * ticks / stride for t in _times(line, side, position[[0, -1]]))
    k = np.arange(int(np.ceil(ends[0])), min(int(np.floor(ends[1])) + 1, len(errors)))
    if len(k) < 2:
        return np.zeros(1), np.zeros(1)
    baseline = max(1, min(round(CHORD * share * ticks / stride), len(k) - 1))
    t = k * (stride / ticks)
    where = t / turn if side == "forward" else (1.0 - t) / share
    noise = errors[k] / line.codes_per_unit / np.interp(where, position, steepness)
    total = noise + np.interp(where, position, deviation)
    run = where[baseline:] - where[:-baseline]
    return (total[baseline:] - total[:-baseline]) / run, (noise[baseline:] - noise[:-baseline]) / run


def _at_resonance(line: LinePlan, power: float) -> float | None:
    """Power of the emitted codes inside the resonance, at least its nearest harmonic, relative to the scan's."""
    response, ticks = line.drive.response, line.program.ticks
    if response is None or ticks > _SPECTRUM:
        return None
    rate = float(line.rate)
    last = (ticks - 1) // 2
    centre, half = response.resonance_hz / rate, response.half_width_hz / rate
    if round(centre) > last:
        return None
    first, stop = max(1, round(centre - half)), min(last, round(centre + half)) + 1
    spectrum = np.abs(np.fft.rfft(line.codes(0, ticks) - float(line.program.output.offset_code))) / ticks
    inside = 2.0 * float(np.sum(spectrum[first:stop] ** 2))
    return 10.0 * log10(max(inside, 1e-30) / power)
