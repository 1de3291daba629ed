"""A round on a scan at an angle: from a trace of whole frames to what an axis goes further than its operator says.

The position error of the imaged samples is fitted by harmonics of the line and of the frame. Of all fits the one with
the least acceleration is selected: little of it decides what the imaging windows leave open. The next frame is learnt
on the operator with that much less to do. Unlike in a scan at 0 degrees the sizes are learnt too, since at an angle
the operator may have the one across the lines wrong; so the sensor has to be calibrated.
"""

from dataclasses import dataclass

import msgspec
import numpy as np
from msgspec.structs import replace

from tablegen.base.input_errors import Unphysical
from tablegen.base.warnings import Remark
from tablegen.calibration.spans import check_spans
from tablegen.compensation.operator.frame_layer import FrameLayer
from tablegen.config.load import Setup
from tablegen.config.schema import FrameRefinement
from tablegen.fitting.correlation import correlation_length
from tablegen.numerics.arrays import Floats, Ints
from tablegen.numerics.turns import sine_and_cosine
from tablegen.planning.refinement_layer import model_digest
from tablegen.planning.turned_plan import TurnedAxis, TurnedPlan, make_turned_plan
from tablegen.refinement.learning import DEFAULT_GAIN
from tablegen.waveform.series import FourierSeries

_MOST_LINE_HARMONICS = 16
_MOST_FRAME_HARMONICS = 12
_SMOOTHNESS = 1e-8  # of the mean square acceleration, against that of the error
_BINS_A_HARMONIC = 8
_LEAST_SAMPLES = 4  # inside the windows of a line for each harmonic of it that is learnt
_LEAST_COVERED = 0.9  # of the imaged lines: fewer are no frame
_COST = 9.0  # of a number that is learnt, in variances of its noise: what explains less is taken for noise
_FOREIGN = 0.2  # rms error, of the longer motion: more is no trace of this scan
_GROWN = 1.05
_NOISES = 3.0
_DIGITS = 6  # of a nanometre


@dataclass(frozen=True)
class FrameOptions:
    """Settings of a round on a frame; ``harmonics`` of the line, None is as many as there are, up to 16."""

    gain: float = DEFAULT_GAIN
    harmonics: int | None = None
    period_s: float | None = None
    delay_s: float = 0.0
    settle_periods: int | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class FrameRound:
    """The result of a trace of frames; ``setup`` has the new layer.

    Errors are in percent of the longer motion of the axis, rms: ``before_percent`` is the measured part that a layer
    can hold, ``after_percent`` is left of it if the model is right, ``noise_percent`` is its standard error, and
    ``beside_percent`` what the fit leaves: noise, and errors that are neither of the line nor of the frame.
    ``line_percent`` and ``frame_percent`` are by how much its shares of both motions are too large, None where it has
    hardly any. ``error`` is it as a layer, ``rest`` what is predicted of it. ``worse`` is why the round must
    not be used, if so.
    """

    axis: TurnedAxis
    setup: Setup
    refinement: FrameRefinement | None
    frames: float
    samples: int
    before_percent: float
    after_percent: float
    noise_percent: float
    beside_percent: float
    line_percent: float | None
    frame_percent: float | None
    error: FrameLayer
    rest: FrameLayer
    worse: str
    remarks: tuple[Remark, ...]


@dataclass(frozen=True, eq=False)
class _Bins:
    """Means of the error over bins of the line, in nm: at phases ``t`` of ``lines``, of ``counts`` samples each."""

    error: Floats
    lines: Ints
    t: Floats
    counts: Floats


def refine_frame(setup: Setup, axis: str, time_s: Floats, displacement_nm: Floats, options: FrameOptions) -> FrameRound:
    """Learn from a trace of the running scan, whose time 0 is a frame start.

    Parameters
    ----------
    time_s, displacement_nm
        Times in s, ascending, and the displacement in nm, shape (samples,) each.

    Raises
    ------
    Rejected
        If the scan, or the scan with the new layer, cannot be planned.
    Unphysical
        If the trace is not of this scan.
    """
    check_spans(time_s, displacement_nm, None)
    plan = make_turned_plan(setup)
    own = plan.x if axis == "x" else plan.y
    motion = own.motion
    harmonics = min(options.harmonics or _MOST_LINE_HARMONICS, motion.harmonics)
    period_s = options.period_s or motion.lines / motion.line_rate_hz
    turns = (time_s - options.delay_s) / period_s
    settle = options.settle_periods if options.settle_periods is not None else int(float(np.ptp(turns)) >= 3.0)
    settled = turns >= settle
    turns, displacement_nm = turns[settled], displacement_nm[settled]
    bins, drifts = _binned(own, turns, displacement_nm, harmonics)
    longest, mean = motion.longest_nm, float(np.average(bins.error, weights=bins.counts))
    _refuse_foreign(own, bins, _rms(bins.error - mean, bins.counts) / longest)
    fit = _fit_of(own, bins, harmonics)
    noise, before = fit.noise_nm, _rms(fit.whole_nm, bins.counts) / longest
    layer = fit.lasting if fit.stands_out else None
    change = fit.lasting.times(options.gain)
    worse = _grew(setup, axis, 100.0 * before, 100.0 * noise / longest)
    refinement, changed = _with_layer(setup, plan, own, None if layer is None else change, before)
    return FrameRound(
        axis=own,
        setup=changed,
        refinement=refinement,
        frames=float(np.ptp(turns)),
        samples=len(turns),
        before_percent=100.0 * before,
        after_percent=100.0 * _rms(fit.whole_nm - options.gain * fit.lasting_nm, bins.counts) / longest,
        noise_percent=100.0 * noise / longest,
        beside_percent=100.0 * _rms(bins.error - mean - fit.whole_nm, bins.counts) / longest,
        error=fit.whole,
        rest=fit.whole.plus(change.times(-1.0)),
        worse=worse,
        remarks=_remarks(layer is not None, drifts),
        **dict(zip(("line_percent", "frame_percent"), _shares(own, bins), strict=True)),
    )


def _binned(axis: TurnedAxis, turns: Floats, displacement_nm: Floats, harmonics: int) -> tuple[_Bins, bool]:
    """Return the means of the error over bins, and whether drift was taken off."""
    motion = axis.motion
    phase = (turns % 1.0) * motion.lines
    line = np.minimum(phase.astype(np.int64), motion.lines - 1)
    t = phase - line
    inside = motion.imaged[line] & motion.inside(t)
    turns, line, t = turns[inside], line[inside], t[inside]
    lines = int(np.sum(motion.imaged))
    counts = np.bincount(line, minlength=motion.lines)[motion.imaged]
    least = _LEAST_SAMPLES * harmonics
    if float(np.mean(counts >= least)) < _LEAST_COVERED:
        raise Unphysical(
            f"the trace has {int(np.sum(counts >= least))} of the {lines} imaged lines of a frame, with {least} "
            f"samples or more inside the imaging window: record one whole frame or more, faster, from a frame start"
        )
    error = displacement_nm[inside] - motion.wanted_nm(line, t)
    count = _BINS_A_HARMONIC * motion.harmonics
    at = line * count + np.minimum((t * count).astype(np.int64), count - 1)
    in_bins = np.bincount(at, minlength=motion.lines * count).astype(np.float64)
    filled = in_bins > 0.0

    def means(values: Floats) -> Floats:
        return np.asarray(np.bincount(at, values, len(in_bins))[filled] / in_bins[filled])

    drifts = float(np.ptp(turns)) >= 1.5
    if drifts:  # what differs between frames is of the sensor
        number = np.cumsum(filled) - 1
        apart, later = error - means(error)[number[at]], turns - means(turns)[number[at]]
        error = error - float(apart @ later) / max(float(later @ later), 1e-300) * (turns - float(np.mean(turns)))
    return _Bins(means(error), np.flatnonzero(filled) // count, means(t), in_bins[filled]), drifts


def _refuse_foreign(axis: TurnedAxis, bins: _Bins, before: float) -> None:
    """Refuse a trace that is far from the scan, with what it looks like."""
    if before < _FOREIGN:
        return
    target = axis.motion.wanted_nm(bins.lines, bins.t)
    target = target - float(np.average(target, weights=bins.counts))
    position = target + bins.error
    ratio = float(np.sum(bins.counts * position * target) / np.sum(bins.counts * target * target))
    looks = "it starts elsewhere in the frame, or another scan was running"
    if ratio < -0.5:
        looks = "the sensor counts downwards, or the frame began elsewhere"
    elif not 1e-2 < ratio < 1e2:
        looks = "its unit is another one: name the column displacement_um, or give --columns displacement=COLUMN:um"
    raise Unphysical(
        f"the displacement is {100.0 * before:.3g} % of the motion off the scan, {ratio:.3g} times as large: {looks}"
    )


@dataclass(frozen=True, eq=False)
class _Fit:
    """An error as a layer: ``whole``, and ``lasting`` without what may be noise, which is nothing unless it stands out.

    ``whole_nm`` and ``lasting_nm`` are both at the bins, shape (bins,) each; ``noise_nm`` is the standard error of the
    first, rms.
    """

    whole: FrameLayer
    lasting: FrameLayer
    stands_out: bool
    whole_nm: Floats
    lasting_nm: Floats
    noise_nm: float


def _fit_of(axis: TurnedAxis, bins: _Bins, harmonics: int) -> _Fit:
    """Fit the error by harmonics of line and frame.

    The fit is computed in modes that are independent of each other in the data, so that the noise of each is known: a
    mode that explains less than it costs is left out.
    """
    motion, weight = axis.motion, bins.counts / float(np.sum(bins.counts))
    frame_harmonics = min(motion.slow_harmonics, _MOST_FRAME_HARMONICS)
    line, frame = np.arange(1.0, harmonics + 1.0), np.arange(1.0, frame_harmonics + 1.0)
    scale = np.concatenate([1.0 / line**2, 1.0 / line**2, 1.0 / frame**2, 1.0 / frame**2])
    design = np.concatenate(
        [_waves(bins.t, harmonics), _waves((bins.lines + bins.t) / motion.lines, frame_harmonics)], axis=1
    )
    root = np.sqrt(weight)[:, None]
    mean = design.T @ weight
    centred = bins.error - float(bins.error @ weight)
    u, singular, v = np.linalg.svd(root * (design - mean) * scale, full_matrices=False)
    modes = u.T @ (root[:, 0] * centred)
    filter_ = singular / (singular * singular + _SMOOTHNESS)

    def result(shares: Floats) -> tuple[FrameLayer, Floats]:
        solution = scale * (v.T @ (filter_ * shares * modes))
        a, b, frame_a, frame_b = np.split(solution, np.cumsum([harmonics, harmonics, frame_harmonics]))
        layer = FrameLayer(FourierSeries(0.0, a, b), FourierSeries(0.0, frame_a, frame_b))
        return layer, (design - mean) @ solution

    whole, whole_nm = result(np.ones(len(modes)))
    left = centred - whole_nm
    variance = float(left * weight @ left) * correlation_length(left) / len(left)
    passes = modes * modes > _COST * variance
    lasting, lasting_nm = result(passes.astype(np.float64))
    noise = float(np.sqrt(variance * float(np.sum((singular * filter_) ** 2))))
    return _Fit(whole, lasting, bool(passes.any()), whole_nm, lasting_nm, noise)


def _waves(t: Floats, harmonics: int) -> Floats:
    """Return cosines and sines of harmonics 1.. at phases, shape (len(t), 2 harmonics)."""
    sines, cosines = sine_and_cosine(np.arange(1.0, harmonics + 1.0)[:, None] * t)
    return np.concatenate([cosines, sines]).T


def _shares(axis: TurnedAxis, bins: _Bins) -> list[float | None]:
    """Return by how many percent the shares of line and frame are too large; None for one that is hardly any."""
    motion = axis.motion
    across = motion.slow((bins.lines + bins.t) / motion.lines)
    design = np.stack([np.ones(len(bins.t)), motion.fast(bins.t), across], axis=1)
    root = np.sqrt(bins.counts)
    shares = np.linalg.lstsq(design * root[:, None], bins.error * root, rcond=None)[0]
    pairs = zip(shares[1:].tolist(), (motion.fast_nm, motion.slow_nm), strict=True)
    return [100.0 * more / nm if abs(nm) > 0.1 * motion.longest_nm else None for more, nm in pairs]


def _rms(values: Floats, counts: Floats) -> float:
    return float(np.sqrt(np.average(values * values, weights=counts)))


def _grew(setup: Setup, axis: str, before: float, noise: float) -> str:
    """Return why the layer that was played made the error grow, empty where it did not."""
    played: FrameRefinement | None = getattr(setup.scan, axis).frame_refinement
    if played is None or played.before_percent is None:
        return ""
    if before <= float(np.hypot(_GROWN * played.before_percent, _NOISES * noise)):
        return ""
    return (
        f"the error grew from {played.before_percent:.3g} % to {before:.3g} % rms since the last round: the loop does "
        f"not converge, or the scanner has changed. Remove [{axis}.frame_refinement] and begin again with a smaller "
        "--gain, or learn from this trace all the same with --force"
    )


def _with_layer(
    setup: Setup, plan: TurnedPlan, axis: TurnedAxis, change: FrameLayer | None, before: float
) -> tuple[FrameRefinement | None, Setup]:
    """Return the new layer, None if there is none, and the scan with it, which can be planned."""
    if change is None:
        return None, setup
    motion, line = axis.motion, plan.straight.x if axis.axis == "x" else plan.straight.y
    whole = change if motion.layer is None else motion.layer.plus(change)

    def rounded(values: Floats) -> list[float]:
        return [float(value) for value in np.round(values, _DIGITS).tolist()]

    refinement = FrameRefinement(
        line_a=rounded(whole.line.a),
        line_b=rounded(whole.line.b),
        frame_a=rounded(whole.frame.a),
        frame_b=rounded(whole.frame.b),
        line_nm=_short(motion.fast_nm),
        frame_nm=_short(motion.slow_nm),
        v_offset=_short(line.drive.v_offset),
        rate_hz=_short(motion.line_rate_hz),
        lines=motion.lines,
        turn=_short(motion.fast_turn),
        window=motion.fast_window,
        model=model_digest(setup, axis.axis, line.drive),
        before_percent=min(float(f"{100.0 * before:.3g}"), 100.0),
    )
    scan_axis = msgspec.structs.replace(getattr(setup.scan, axis.axis), frame_refinement=refinement)
    changed = replace(setup, scan=msgspec.structs.replace(setup.scan, **{axis.axis: scan_axis}))
    make_turned_plan(changed)  # what is written can be built
    return refinement, changed


def _remarks(has_layer: bool, drifts: bool) -> tuple[Remark, ...]:
    remarks = []
    if not has_layer:
        remarks.append(Remark("the error is within the noise of the sensor", code="noise-limit"))
    if not drifts:
        why = "drift of the sensor cannot be told from the motion of a single frame: record two or more"
        remarks.append(Remark(why, code="few-periods"))
    return tuple(remarks)


def _short(value: float) -> float:
    return float(f"{value:.6g}")
