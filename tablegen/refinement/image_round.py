"""A round from images of the running scan to the new layer, and whether it should be written."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.base.warnings import Remark, spoils
from tablegen.calibration.laws.image_sizes import KnownSample
from tablegen.config.load import Setup
from tablegen.fitting.estimate import Estimate, LineSize
from tablegen.images.cell_vectors import area
from tablegen.images.line_length import Cell, size_of_line
from tablegen.images.pair_checks import check_size
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan, Plan, make_straight_plan
from tablegen.refinement.free_rows import FreeRowsFit
from tablegen.refinement.lattice_line import ImageOptions, LatticeLine, lattice_line
from tablegen.refinement.lattice_start import SampleCell
from tablegen.refinement.learning import LayerUpdate, learn
from tablegen.refinement.registration import SweepMismatch, mismatch
from tablegen.refinement.round import (
    NO_LAYER,
    Options,
    Round,
    divergence_reason,
    learning_bound,
    mostly_noise,
    stop,
    with_layer_update,
)
from tablegen.refinement.slow_line import slow_line
from tablegen.refinement.whole_periods import check_periods_apart
from tablegen.refinement.window_line import WindowLine, averaged

_MIN_EXPLAINED = 0.03  # share of the variance of an image
_LITTLE_EXPLAINED = 0.5
_MOST_UNEXPLAINED = 0.12  # share of the variance of an image, with the periods of the sample
_SURE_LAG = 0.2  # standard error below which the order of time is determined
_FAR_APART = 0.35  # periods
_SIZE_NOTE_LIMIT, _SIZE_NOTE_ERRORS = 0.002, 3.0  # of the line, and standard errors: a larger size error gets a remark
_MIN_PIXELS_PER_PERIOD = 4.0


@dataclass(frozen=True, eq=False, kw_only=True)
class ImageRound(Round):
    """Round learnt from trace and retrace.

    ``size`` is that of x, where the constant of the sample is known, and ``requested_nm`` the requested size of x.
    """

    frames: tuple[LatticeLine, ...]
    measured: WindowLine
    size: LineSize | None
    requested_nm: float

    @property
    def periods(self) -> float:
        """Periods in the whole line of x, of the wave that has most."""
        return self.frames[0].periods

    @property
    def recorded(self) -> str:
        """The number of frames, pixels and periods, in words."""
        return f"{_pixels(self.frames)}, {self.periods:.4g} periods in the line"


def refine_images(
    setup: Setup,
    axis: Literal["x", "y"],
    pairs: Sequence[tuple[Floats, Floats]],
    options: Options,
    images: ImageOptions | None = None,
    sample: KnownSample | None = None,
) -> ImageRound:
    """Learn from images of a grating or a lattice that the running scan images.

    Parameters
    ----------
    pairs
        Trace and retrace of one or more consecutive frames: heights in any unit, (rows, columns) each. Rows are in the
        order of time, columns those of the scan's imaging window.
    sample
        A sample of known constant, with which the size of the line is compared; the size is not learnt.

    Raises
    ------
    Rejected
        If the scan, or the scan with the new layer, cannot be planned.
    Unphysical
        If the images are not of this scan, nothing shows which periods of trace and retrace belong together, or a bound
        forbids learning.
    """
    plan = make_straight_plan(setup, NO_LAYER)
    line: LinePlan = getattr(plan, axis)
    limits = learning_bound(line, options)
    images = images or ImageOptions()
    frames = _frames(plan, pairs, images, sample)
    if axis == "x":  # a shift of x does not change the rows
        check_periods_apart(frames, images.delay_pixels)
    measured = averaged([frame.line for frame in frames]) if axis == "x" else slow_line(plan, frames)
    size = None if sample is None else _size(plan, frames, sample)
    update = learn(line, measured, options.gain, limits.used)
    refinement, changed = with_layer_update(setup, line, update)
    return ImageRound(
        line=line,
        bound=limits,
        update=update,
        refinement=refinement,
        setup=changed,
        worse=divergence_reason(setup, axis, update),
        **stop(setup, line, update),
        remarks=(*_size_remarks(plan, size), *_remarks(line, frames, update)),
        frames=frames,
        measured=measured,
        size=size,
        requested_nm=plan.x.drive.size_nm,
    )


def _frames(
    plan: Plan, pairs: Sequence[tuple[Floats, Floats]], images: ImageOptions, sample: KnownSample | None
) -> tuple[LatticeLine, ...]:
    """Fit each frame; all of them begin with the cell with which the first one begins."""
    known = SampleCell()
    if sample is not None and sample.cell is not None:
        known = SampleCell(True, _expected_area(plan, sample.cell))
    frames: list[LatticeLine] = []
    for trace, retrace in pairs:
        _check_shape(plan, trace)
        line = lattice_line(plan, trace, retrace, images, known)
        _check(line)
        frames.append(line)
        known = replace(known, cell=frames[0].start.cell)
    return tuple(frames)


def _expected_area(plan: Plan, cell: Cell) -> float:
    """Return the area of the sample's cell in square pixels, by the sizes of the scan file."""
    shares = [line.band_limit.window[1] - line.band_limit.window[0] for line in (plan.x, plan.y)]
    column_nm = plan.x.drive.size_nm * shares[0] / plan.schedule.pixels
    row_nm = plan.y.drive.size_nm * shares[1] / max(plan.schedule.up.count, 1)
    return area(cell.vectors) / (column_nm * row_nm)


def _check_shape(plan: Plan, trace: Floats) -> None:
    """Check that a column is a pixel of the imaging window."""
    if plan.x.band_limit.directions != "both":
        raise Unphysical("this scan images forward only, and a retrace is not of it; image both directions")
    columns, pixels = trace.shape[-1], plan.schedule.pixels
    if columns != pixels:
        raise Unphysical(
            f"the images have {columns} columns, and this scan {pixels} pixels over its imaging window; do not crop or "
            f"resample them, or set timing.pixels to what your instrument takes over that window"
        )


def _check(frame: LatticeLine) -> None:
    fit = frame.fit
    least = min(fit.explained)
    if least < _MIN_EXPLAINED:
        name = "trace" if fit.explained[0] < fit.explained[1] else "retrace"
        raise Unphysical(
            f"{100.0 * max(least, 0.0):.0f} % of the {name}'s contrast is a periodic sample; the rest is something "
            f"else, or trace and retrace are not of one scan"
        )
    if len(fit.state.q) < 2:
        return
    if frame.rows_model.moves and max(error for _, error in fit.lags) <= _SURE_LAG:
        _check_order(fit)
    if (rest := max(frame.unexplained)) > _MOST_UNEXPLAINED:
        raise Unphysical(
            f"trace and retrace show the waves of the lattice at different places: {100.0 * rest:.0f} % of the "
            f"contrast has their periods and is not explained, as where both are a period of the sample apart; if one "
            f"was cropped, do not; else calibrate first, or take a sample of a longer period"
        )


def _check_order(fit: FreeRowsFit) -> None:
    """Check that rows and columns are in the order of time, by the phases of two waves."""
    between, along = (lag < 0.0 for lag, _ in fit.lags)
    if between or along:
        what = {
            (True, True): "the images are exchanged, or their rows upside down",
            (False, True): "both images are mirrored",
            (True, False): "the images are exchanged or upside down, and mirrored; or one of them is cropped",
        }[between, along]
        raise Unphysical(
            f"the pattern goes on from trace to retrace against the order of time: {what}; the left end must be where "
            f"the trace begins, and the first row the first in time"
        )


def _size(plan: Plan, frames: Sequence[LatticeLine], sample: KnownSample) -> LineSize:
    """Return the size of x, the mean over the frames.

    Raises
    ------
    Unphysical
        If the sample is another one, or the size is implausible.
    """
    x, y = plan.x, plan.y
    low, high = y.band_limit.window
    aspect = y.drive.size_nm * (high - low) / x.drive.size_nm
    sizes = [size_of_line(frame, sample.cell, sample.grating, aspect) for frame in frames]
    value = float(np.mean([one.nm.value for one in sizes]))
    error = float(np.sqrt(np.mean([one.nm.standard_error**2 for one in sizes]) / len(sizes)))
    check_size(value, x.drive.size_nm, "the scan file")
    return replace(sizes[0], nm=Estimate(value, float(np.hypot(error, sizes[0].shared * value))))


def _size_remarks(plan: Plan, size: LineSize | None) -> list[Remark]:
    if size is None:
        return []
    requested, nm, error = plan.x.drive.size_nm, size.nm.value, size.nm.standard_error
    if abs(nm / requested - 1.0) < max(_SIZE_NOTE_LIMIT, _SIZE_NOTE_ERRORS * error / requested):
        return []
    return [
        spoils(
            f"the line of x is {nm:.5g} nm where the scan file asks for {requested:.5g} nm "
            f"({100.0 * (nm / requested - 1.0):+.2f} %); sizes are not learnt; "
            f"{requested * requested / nm:.5g} nm in the scan file give {requested:.5g} nm here",
            100.0 * abs(nm / requested - 1.0),
            code="measured-size-error",
        )
    ]


def _remarks(line: LinePlan, frames: Sequence[LatticeLine], update: LayerUpdate) -> tuple[Remark, ...]:
    texts = [text for frame in frames[:1] for text in _remarks_of(frame)]
    if line.axis == "y" and len(frames) == 1:
        texts.append(
            spoils(
                "a drift that becomes faster or slower counts as an error of y",
                code="uneven-drift",
            )
        )
    if line.axis == "y" and line.band_limit.directions == "both":
        texts.append(
            Remark(
                "y was learnt on its way up, which these images show; its way down stays as it was",
                code="way-up-only",
            )
        )
    return tuple(texts + _learning_remarks(update))


def _remarks_of(frame: LatticeLine) -> list[Remark]:
    remarks: list[Remark] = []
    fit, geometry = frame.fit, frame.geometry
    explained = min(fit.explained)
    if explained < _LITTLE_EXPLAINED:
        remarks.append(
            Remark(
                f"{100.0 * explained:.0f} % of the contrast is periodic, the rest noise, debris or defects",
                code="aperiodic-contrast",
            )
        )
    span = (geometry.window[1] - geometry.window[0]) * frame.periods
    if geometry.columns / span < _MIN_PIXELS_PER_PERIOD:
        remarks.append(
            Remark(
                f"the shortest period has {geometry.columns / span:.2g} pixels",
                code="few-pixels",
            )
        )
    if frame.start.mismatch > _FAR_APART:
        remarks.append(
            spoils(
                f"trace and retrace are {frame.start.mismatch:.2g} periods apart, and beyond half a period they would "
                f"be taken for the next one",
                code="period-slip",
            )
        )
    if fit.loud:
        row_numbers = ", ".join(str(i + 1) for i in fit.loud[:5]) + (", ..." if len(fit.loud) > 5 else "")
        remarks.append(
            Remark(
                f"{len(fit.loud)} rows differ from the others (row {row_numbers}); they counted less",
                code="outlying-samples",
            )
        )
    return remarks


@dataclass(frozen=True, eq=False, kw_only=True)
class MismatchRound(Round):
    """Round learnt from trace and retrace of a sample without a period: residuals are half of their mismatch."""

    frames: tuple[SweepMismatch, ...]
    measured: WindowLine

    @property
    def recorded(self) -> str:
        """The number of frames and pixels, in words."""
        return f"{_pixels(self.frames)}, trace against retrace"


def refine_mismatch(
    setup: Setup,
    axis: Literal["x", "y"],
    pairs: Sequence[tuple[Floats, Floats]],
    options: Options,
    images: ImageOptions | None = None,
) -> MismatchRound:
    """Learn the mismatch of trace and retrace of any sample, half in each; see ``refine_images``.

    An error that both directions share stays: no sample without a period shows it.

    Parameters
    ----------
    pairs
        Trace and retrace of one or more frames: heights in any unit, (rows, columns) each.

    Raises
    ------
    Rejected
        If the scan, or the scan with the new layer, cannot be planned.
    Unphysical
        If the axis is y, the images are not of this scan, or a bound forbids learning.
    """
    plan = make_straight_plan(setup, NO_LAYER)
    if axis == "y":
        raise Unphysical("trace and retrace do not show the error of y; it needs a sample with a period")
    limits = learning_bound(plan.x, options)
    for trace, _ in pairs:
        _check_shape(plan, trace)
    frames = tuple(mismatch(plan, trace, retrace, images or ImageOptions()) for trace, retrace in pairs)
    measured = averaged([frame.line for frame in frames])
    update = learn(plan.x, measured, options.gain, limits.used)
    refinement, changed = with_layer_update(setup, plan.x, update, "mismatch")
    remarks = [
        spoils(
            "only the mismatch of trace and retrace was measured and is corrected, half in each; an error that both "
            "share stays, and is in none of these figures",
            code="mismatch-only",
        ),
        *_learning_remarks(update),
    ]
    return MismatchRound(
        line=plan.x,
        bound=limits,
        update=update,
        refinement=refinement,
        setup=changed,
        worse=divergence_reason(setup, axis, update, "mismatch"),
        **stop(setup, plan.x, update, "mismatch"),
        remarks=tuple(remarks),
        frames=frames,
        measured=measured,
    )


def _learning_remarks(update: LayerUpdate) -> list[Remark]:
    remarks: list[Remark] = []
    if update.harmonics == 0:
        remarks.append(
            Remark(
                "the error is within the noise of the images",
                code="noise-limit",
            )
        )
    elif mostly_noise(update):
        remarks.append(Remark("most of the remaining error is noise", code="noise-limit"))
    return [
        *remarks,
        Remark("images do not show that the build of this scan file was running", code="unverified-build"),
    ]


def _pixels(frames: Sequence[LatticeLine] | Sequence[SweepMismatch]) -> str:
    rows, columns = frames[0].geometry.rows, frames[0].geometry.columns
    count = f"{len(frames)} frames of " if len(frames) > 1 else ""
    return f"{count}{rows} x {columns} pixels"
