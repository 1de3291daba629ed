"""A round from a loaded scan and a trace to the new layer, and whether it should be written."""

from dataclasses import dataclass
from typing import Any, Literal

import msgspec
import numpy as np
from msgspec.structs import replace

from tablegen.base.input_errors import Unphysical
from tablegen.base.remedies import FindingCode
from tablegen.base.warnings import Remark, spoils
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.spans import check_spans
from tablegen.certificate.line_errors import CHORD
from tablegen.config.load import Setup
from tablegen.config.schema import Refinement
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan, make_plan, make_straight_plan
from tablegen.planning.refinement_layer import model_digest
from tablegen.refinement.bound import Bound, bound
from tablegen.refinement.displacement import Displacement, fit_displacement
from tablegen.refinement.learning import DEFAULT_GAIN, DEFAULT_HARMONICS, LayerUpdate, learn
from tablegen.refinement.phase import Phase, phase_by_drive, phase_by_trigger
from tablegen.refinement.trace_checks import refuse_wrong_trace, size_remark, trace_remarks

_FINISHED_RATIO = 0.9  # predicted over measured residual; above it the rest is noise
_CHORD_NOISES = 4.0  # of the largest and the least chord together: the rms noise of one, of some twenty in a window
_MOST_SCALING = 1e4  # percent that a scan file can hold
_SIZE_NOTE_LIMIT = 0.01  # share of the line; a larger size error gets a remark
NO_LAYER = (
    "a layer belongs to a straight line, and the pixels of a sine are where the operator says that the piezo is; "
    "calibrate the operator again, with traces near this scan, or take 'line'"
)


@dataclass(frozen=True)
class Options:
    """Settings of a round; ``harmonics`` None is as many as the bound allows, up to 16."""

    gain: float = DEFAULT_GAIN
    harmonics: int | None = None
    period_s: float | None = None
    delay_s: float = 0.0
    settle_periods: int | None = None
    drift_order: int | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Round:
    """The result of a measurement; ``worse`` is why it must not be learnt from, if so; ``setup`` has the new layer.

    ``stopped`` is why no further layer should be played although the residual did not grow, if so: the scaling error
    rose. ``best`` is the layer of the round before, which had a smaller one; None where that had no layer.
    """

    line: LinePlan
    bound: Bound
    update: LayerUpdate
    refinement: Refinement | None
    setup: Setup
    worse: str
    remarks: tuple[Remark, ...]
    stopped: str = ""
    best: Refinement | None = None

    @property
    def recorded(self) -> str:
        """The amount of data, in words.

        Raises
        ------
        NotImplementedError
            In this base class.
        """
        raise NotImplementedError


@dataclass(frozen=True, eq=False, kw_only=True)
class TraceRound(Round):
    """Round learnt from the trace of a sensor."""

    phase: Phase
    displacement: Displacement

    @property
    def recorded(self) -> str:
        """The number of periods and samples, in words."""
        displacement = self.displacement
        return f"{displacement.periods:.4g} periods of {self.phase.period_s:.6g} s, {displacement.samples} samples"


def refine(
    setup: Setup,
    axis: Literal["x", "y"],
    time_s: Floats,
    displacement_nm: Floats,
    drive_v: Floats | None,
    options: Options,
    states_gain: bool = False,
) -> TraceRound:
    """Learn from a trace of the running scan.

    Parameters
    ----------
    time_s, displacement_nm
        Times in s, ascending, and the displacement in nm, shape (samples,) each.
    drive_v
        Drive at the piezo in V, shape (samples,); without it time 0 is a line start, of y a frame start.
    states_gain
        True if the user stated that the drive is at the piezo, so that no check doubts it.

    Raises
    ------
    Rejected
        If the scan, or the scan with the new layer, cannot be planned.
    Unphysical
        If the trace is not of this scan, or a bound forbids learning.
    """
    check_spans(time_s, displacement_nm, drive_v)
    plan = make_straight_plan(setup, NO_LAYER) if axis == "x" else make_plan(setup, sines=True)
    line: LinePlan = getattr(plan, axis)
    limits = learning_bound(line, options)
    trace = Trace("", time_s, np.zeros(0) if drive_v is None else drive_v, displacement_nm)
    refuse_wrong_trace(line, trace, states_gain)
    if drive_v is None:
        phase = phase_by_trigger(line, time_s, options.period_s, options.delay_s)
    else:
        phase = phase_by_drive(line, time_s, drive_v, options.delay_s)
    measured = fit_displacement(
        phase.turns, displacement_nm, line.target.harmonics, options.settle_periods, options.drift_order
    )
    update = learn(line, measured, options.gain, min(limits.used, measured.series.harmonics))
    refinement, changed = with_layer_update(setup, line, update)
    return TraceRound(
        line=line,
        bound=limits,
        update=update,
        refinement=refinement,
        setup=changed,
        worse=divergence_reason(setup, axis, update),
        **stop(setup, line, update),
        remarks=(
            *_remarks(line, measured, update, phase, time_s),
            *trace_remarks(line, trace, phase, measured, update, options.delay_s),
        ),
        phase=phase,
        displacement=measured,
    )


BeforeOf = Literal["line", "mismatch"]


def with_layer_update(
    setup: Setup, line: LinePlan, update: LayerUpdate, before_of: BeforeOf | None = None
) -> tuple[Refinement | None, Setup]:
    """Build the new layer, None if there is none, and the scan with it.

    Raises
    ------
    Rejected
        If the scan with the layer cannot be built.
    """
    if not update.layer.harmonics:
        return None, setup
    refinement = msgspec.structs.replace(_refinement(setup, line, update), before_of=before_of)
    changed = with_refinement(setup, line.axis, refinement)
    make_plan(changed, sines=True)  # what is written can be built
    return refinement, changed


def _refinement(setup: Setup, line: LinePlan, update: LayerUpdate) -> Refinement:
    """Build the new layer, and the scan at which it was learnt."""
    return Refinement(
        a=update.layer.a.tolist(),
        b=update.layer.b.tolist(),
        v_amplitude=_short(line.drive.v_amplitude),
        v_offset=_short(line.drive.v_offset),
        rate_hz=_short(float(line.rate)),
        turn=_short(line.drive.turn),
        window=line.band_limit.window,
        directions=line.band_limit.directions,
        model=model_digest(setup, line.axis, line.drive),
        before_percent=float(f"{update.before.rms_percent:.3g}"),
        after_percent=float(f"{min(update.after.rms_percent, 100.0):.3g}"),
        before_scaling_percent=float(f"{min(worst_scaling(update), _MOST_SCALING):.3g}"),
        previous_a=None if line.layer is None else line.layer.a.tolist(),
        previous_b=None if line.layer is None else line.layer.b.tolist(),
    )


def with_refinement(setup: Setup, axis: str, refinement: Refinement | None) -> Setup:
    """Return the scan with another layer on one axis."""
    changed: Any = msgspec.structs.replace(getattr(setup.scan, axis), refinement=refinement)
    return replace(setup, scan=msgspec.structs.replace(setup.scan, **{axis: changed}))


def learning_bound(line: LinePlan, options: Options) -> Bound:
    """Compute the bound for the requested gain and harmonics.

    Raises
    ------
    Unphysical
        If learning might not converge, or more harmonics are requested than the scan plays.
    """
    request = options.harmonics
    limits = bound(line, options.gain, min(DEFAULT_HARMONICS, line.target.harmonics) if request is None else request)
    if request is not None and request > line.target.harmonics:
        raise Unphysical(f"{request} harmonics are more than the {line.target.harmonics} that the scan plays")
    if limits.used == 0 or (request is not None and request > limits.harmonics):
        fits = f"learn up to {limits.harmonics} harmonics" if limits.harmonics else "scan slower"
        raise Unphysical(
            f"at a gain of {options.gain:g} the error of harmonic {limits.harmonics + 1} might not shrink, if the "
            f"dynamics of the scanner file are off by a quarter; {fits}, or lower the gain"
        )
    return limits


def divergence_reason(setup: Setup, axis: str, update: LayerUpdate, before_of: BeforeOf | None = None) -> str:
    """Return why the layer that was played made the residual grow since the measurement before; empty where it did not.

    Only measurements of the same kind are compared.
    """
    played: Refinement | None = getattr(setup.scan, axis).refinement
    if played is not None and played.best:
        return (
            f"[{axis}.refinement] is the best of its rounds: the one after it had a larger scaling error. Remove it to "
            "begin again, or learn from this trace all the same with --force"
        )
    if played is None or played.before_percent is None or played.before_of != before_of:
        return ""
    before, now = played.before_percent, update.before.rms_percent
    if np.hypot(1.05 * before, 3.0 * update.noise_percent) >= now:
        return ""
    return (
        f"the residual grew from {before:.3g} % to {now:.3g} % rms since the last round: the loop does not converge, "
        f"or the scanner has changed. Remove [{axis}.refinement] and begin again with a smaller --gain or fewer "
        f"--harmonics, or learn from this trace all the same with --force"
    )


def stop(setup: Setup, line: LinePlan, update: LayerUpdate, before_of: BeforeOf | None = None) -> dict[str, Any]:
    """Return the fields of a round where the scaling error rose with the layer that was played; empty where it did not.

    A rise within the effect of measurement noise and the converter's rounding on chords does not count.
    """
    played: Refinement | None = getattr(setup.scan, line.axis).refinement
    if played is None or played.before_scaling_percent is None or played.before_of != before_of:
        return {}
    before, now = played.before_scaling_percent, worst_scaling(update)
    rounding = 200.0 / (CHORD * abs(line.codes_per_unit))
    if now <= float(np.hypot(1.05 * before, np.hypot(_CHORD_NOISES * update.chord_noise_percent, rounding))):
        return {}
    rose = f"the scaling error rose from {before:.3g} % to {now:.3g} % since the last round"
    if played.previous_a is None or played.previous_b is None:
        without = f"{rose}, which had no layer: remove [{line.axis}.refinement]"
        return {"stopped": f"{without}, or learn from this trace all the same with --force"}
    best = msgspec.structs.replace(
        played,
        a=played.previous_a,
        b=played.previous_b,
        previous_a=None,
        previous_b=None,
        after_percent=None,
        best=True,
    )
    return {"stopped": f"{rose}: the layer of that round is the best, and is kept", "best": best}


def worst_scaling(update: LayerUpdate) -> float:
    """Return the measured scaling error of the worse direction, percent, peak to peak."""
    return max(update.before.scaling_percent.values())


def _remarks(
    line: LinePlan, measured: Displacement, update: LayerUpdate, phase: Phase, time_s: Floats
) -> tuple[Remark, ...]:
    remarks: list[Remark] = []
    size = abs(update.before.size_nm)
    by = size / line.drive.size_nm - 1.0
    if (wrong_unit := size_remark(line, size)) is not None:
        remarks.append(wrong_unit)
    elif abs(by) > _SIZE_NOTE_LIMIT:
        remarks.append(
            spoils(
                f"the line is {size:.5g} nm where the scan file asks for {line.drive.size_nm:.5g} nm "
                f"({100.0 * by:+.2f} %); sizes are not learnt",
                100.0 * abs(by),
                code="measured-size-error",
            )
        )
    if update.before.size_nm < 0.0:
        doubt = "; if the sensor counts upwards, time 0 is where the line turns, and this is not to be learnt"
        turned = "the displacement falls where the drive rises; its sign was inverted"
        code: FindingCode = "inverted-sensor"
        remarks.append(spoils(turned + doubt, code=code) if phase.drive is None else Remark(turned, code=code))
    if measured.stray is not None:
        at = float(time_s[measured.stray])
        remarks.append(
            Remark(f"the reading at {at:.9g} s is far off the others; it adds noise", code="outlying-samples")
        )
    if update.harmonics == 0:
        remarks.append(
            Remark(
                "the error is within the noise of the sensor",
                code="noise-limit",
            )
        )
    elif mostly_noise(update):
        remarks.append(Remark("most of the remaining error is noise", code="noise-limit"))
    if measured.correlated > 3.0:
        remarks.append(
            Remark(
                f"residuals are correlated over {measured.correlated:.0f} samples: besides noise, they contain drift, "
                f"hum or what the harmonics leave; standard errors were widened "
                f"by a factor of {measured.correlated**0.5:.2g}",
                code="widened-errors",
            )
        )
    if measured.periods < 1.99:
        remarks.append(Remark("drift cannot be determined from a single period", code="few-periods"))
    if phase.drive is None:
        remarks.append(
            Remark("without drive_v it is not checked that the trace belongs to this build", code="unverified-build")
        )
    return tuple(remarks)


def mostly_noise(update: LayerUpdate) -> bool:
    """Return true if most of the remaining error is noise."""
    return update.after.rms_percent > _FINISHED_RATIO * update.before.rms_percent


def _short(value: float) -> float:
    return float(f"{value:.6g}")
