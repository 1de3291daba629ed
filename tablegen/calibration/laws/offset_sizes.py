"""Fit (1)-(4) at each scan voltage to apparent sizes at several offsets, in images of several scan voltages."""

from dataclasses import dataclass, replace

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.base.warnings import Remark
from tablegen.calibration.laws.offset import OffsetFit, fit_offset
from tablegen.compensation.size import SizeLaw
from tablegen.fitting.estimate import Fit
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver

_WIDE = 2.0  # ratio of the scan voltages above which they determine how m changes with the size


@dataclass(frozen=True, kw_only=True)
class OffsetSizesFit(Fit):
    """The fit of each scan voltage, ascending: between them alpha and beta of (1) are linear in it."""

    sizes: tuple[OffsetFit, ...]


def fit_offset_sizes(
    offset_v: Floats,
    apparent_nm: Floats,
    size_v: Floats,
    v_max: Driver | float,
    size_law: SizeLaw,
    errors_nm: Floats | None = None,
) -> OffsetFit | OffsetSizesFit:
    """Fit m over offset and size: ``fit_offset`` for the images of each scan voltage.

    Images of one scan voltage have to show one object, or a lattice, at three or more offsets; those of another one may
    show another. With one scan voltage it is the fit of ``fit_offset``.

    Parameters
    ----------
    offset_v
        Offsets in V, shape (images,).
    apparent_nm
        Apparent sizes in nm, shape (images,).
    size_v
        Scan voltages, peak to peak at the piezo, in V, shape (images,).
    errors_nm
        Standard errors of the sizes in nm, shape (images,), as in ``fit_offset``.

    Raises
    ------
    Unphysical
        If a scan voltage has too few offsets, or its sizes make no law.
    """
    volts = np.unique(size_v).tolist()
    driver = Driver.of(v_max)
    if volts[-1] > driver.span:
        raise Unphysical(f"a size_v of {volts[-1]:g} V is above {driver.full_scale}")
    fits: list[OffsetFit] = []
    residual, outliers, remarks = np.zeros(len(size_v)), [], []
    for one in volts:
        rows = np.flatnonzero(size_v == one)
        try:
            errors = None if errors_nm is None else errors_nm[rows]
            fit = fit_offset(offset_v[rows], apparent_nm[rows], driver, size_law, one, errors)
        except Unphysical as reason:
            raise Unphysical(f"images of {one:g} V: {reason}" if len(volts) > 1 else str(reason)) from None
        fits.append(fit)
        residual[rows] = fit.residual_percent
        outliers += rows[list(fit.outliers)].tolist()
        remarks += [remark.under(f"images of {one:g} V") for remark in fit.remarks]
    if len(fits) == 1:
        return fits[0]
    if volts[-1] < _WIDE * volts[0]:
        remarks.append(
            Remark(
                f"scan voltages of {volts[0]:g} to {volts[-1]:g} V hardly show how m changes with the size; "
                f"take some further apart",
                code="undetermined-parameter",
            )
        )
    return OffsetSizesFit(
        points=len(size_v),
        residual_percent=residual,
        before_percent=max(fit.before_percent for fit in fits),
        remarks=tuple(remarks),
        outliers=tuple(sorted(outliers)),
        curves=tuple(replace(fit.curves[0], title=f"{fit.curves[0].title}, {fit.size_v:g} V") for fit in fits),
        sizes=tuple(fits),
    )
