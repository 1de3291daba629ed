"""Correct images by a fit to a periodic sample."""

from dataclasses import replace
from typing import Any

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.correction.affine_map import ImplausibleMap
from tablegen.correction.by_affine_map import by_affine_map
from tablegen.correction.corrected_images import corrected
from tablegen.correction.distortion import Distortion, Resampler
from tablegen.correction.fit_checks import check_agreement, check_cell, check_constant, check_moves, check_straight_cell
from tablegen.correction.old_scan import OldScan
from tablegen.correction.periodic_scan import PeriodicScan, periodic_scan
from tablegen.correction.scan_images import Images, check_reference, timed
from tablegen.correction.straight import StraightScan
from tablegen.images.measured_cell import IDEAL_ANGLES
from tablegen.images.pair_checks import check_size
from tablegen.images.periodicity import NOTHING_PERIODIC, shows_nothing_periodic
from tablegen.numerics.arrays import Floats


def by_fit(
    images: Images,
    conditions: OldScan,
    pitch_nm: float | None = None,
    lattice_nm: float | None = None,
    kind: str | None = None,
) -> tuple[StraightScan, PeriodicScan]:
    """Correct images by a fit to a periodic sample; return the fit too.

    ``kind`` is that of the lattice of ``lattice_nm``: "hexagonal" or "square".

    Raises
    ------
    Unphysical
        If there is no fit, or the image does not support the correction: the cell is ambiguous, the displacement is too
        large, or trace and retrace do not agree better.
    """
    images = images.of_imaged_rows()
    try:
        return _by_fit(images, conditions, pitch_nm, lattice_nm, kind)
    except Unphysical as reason:
        if shows_nothing_periodic(images.heights(images.reference[0])):
            raise Unphysical(NOTHING_PERIODIC) from None
        advice = "" if pitch_nm is not None else _affine_advice(images, lattice_nm, kind)
        if not advice:
            raise
        raise Unphysical(f"{reason}; {advice}") from None


def _affine_advice(images: Images, lattice_nm: float | None, kind: str | None) -> str:
    """Return a sentence for the text of a refused fit, where an affine map is possible; else nothing."""
    for name in IDEAL_ANGLES if kind is None else (kind,):
        try:
            by_affine_map(images, lattice_nm, name)
        except ImplausibleMap:
            continue
        except Unphysical:
            return ""
        condition = "" if kind is not None else f"if the lattice is {name}, "
        return f"{condition}--affine --lattice {name} corrects width, height and shear alone"
    return ""


def _by_fit(
    images: Images, conditions: OldScan, pitch_nm: float | None, lattice_nm: float | None, kind: str | None
) -> tuple[StraightScan, PeriodicScan]:
    conditions = timed(images, conditions)
    trace, retrace = (*(images.channels[i].heights for i in images.reference), None)[:2]
    retrace_alone = not any(images.forward)
    first, (rows, columns) = images.first, images.shape
    expected = None
    if lattice_nm is not None and first.width_nm is not None and first.height_nm is not None:
        angle = np.radians(IDEAL_ANGLES[kind or "hexagonal"])
        expected = lattice_nm**2 * float(np.sin(angle)) * rows * columns / (first.width_nm * first.height_nm)
    check_reference(images)
    assert trace is not None
    (turn, (low, high)), delay_pixels, mirrored = conditions.x.timing, conditions.delay_pixels, images.mirrored
    if retrace_alone:  # a way back is a way forward over the mirror image of the sample
        trace = np.ascontiguousarray(images.heights(images.reference[0])[:, ::-1])
        fit = periodic_scan(trace, None, 1.0 - turn, (1.0 - high, 1.0 - low), False, delay_pixels, expected)
    else:
        fit = periodic_scan(trace, retrace, turn, (low, high), mirrored, delay_pixels, expected)
    fit = replace(fit, frame_share=images.frame_share)
    size: tuple[float, float] | None = None
    distortion: Distortion = fit.distortion
    record: dict[str, Any] = {"by": "fit to a periodic sample", "sources": images.sources}
    record |= {**images.angle, **images.timing, **images.missing}
    if lattice_nm is not None or pitch_nm is not None:
        if lattice_nm is not None:
            check_constant(fit, lattice_nm, expected is not None)
            distortion = fit.of_lattice(lattice_nm, kind)
            kind = kind or fit.likely_kind()
            record |= {"lattice_nm": lattice_nm, "lattice": kind}
        else:
            has_size = first.width_nm is not None and first.height_nm is not None
            aspect = (first.height_nm or 1.0) / (first.width_nm or 1.0) if has_size else rows / columns
            check_constant(fit, pitch_nm or 0.0, first.width_nm is not None)
            distortion = fit.of_pitch(pitch_nm or 0.0, aspect)
            record["pitch_nm"] = pitch_nm
        size = distortion.x_range[1] - distortion.x_range[0], distortion.y_range[1] - distortion.y_range[0]
        if first.width_nm is not None:
            check_size(size[0], first.width_nm, "the file")
        if first.height_nm is not None and fit.tells_y and lattice_nm is not None:
            check_size(size[1], first.height_nm, "the file", "frame")
    elif first.width_nm is not None and first.height_nm is not None:
        size = first.width_nm, first.height_nm
    record |= {
        "turn": turn,
        "window": [low, high],
        "periods_in_the_line": [round(float(q), 4) for q in fit.waves[:, 0]],
        "explained": round(fit.explained, 6),
        "slow_axis": "fitted" if fit.tells_y else "as taken: a grating does not tell it",
    }
    if fit.straight_axes:
        record["not_displaced"] = list(fit.straight_axes)
    if retrace_alone:
        distortion = distortion.mirrored()
        record["retrace_alone"] = True
    scan = corrected(images, distortion, size, record)
    check_moves(distortion)
    recorded, pictures = _checked_pictures(fit, scan, trace)
    check_cell(fit, recorded, True)
    check_agreement(scan.agreement)
    check_straight_cell(fit, pictures, size, lattice_nm, kind or "hexagonal", expected is not None)
    return scan, fit


def _checked_pictures(fit: PeriodicScan, scan: StraightScan, trace: Floats) -> tuple[Floats, list[Floats]]:
    """Return the first image as it was fitted, without steps and gaps, and the straight pictures without gaps."""
    recorded, pictures = trace, [scan.pictures[i].heights for i in scan.reference]
    if fit.without_gaps is not None:
        recorded = fit.without_gaps[0]
        both = zip((True, False), fit.without_gaps, strict=False)
        pictures = [Resampler.of(fit.distortion, way)(one) for way, one in both]
    return recorded if fit.stepless is None else fit.stepless, pictures
