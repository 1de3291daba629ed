"""Fit m_minus and m_plus to apparent sizes of one object at several offset voltages, equations (1)-(4)."""

from dataclasses import dataclass

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.base.warnings import Remark, spoils
from tablegen.compensation.offset import OffsetLaw
from tablegen.compensation.size import SizeLaw
from tablegen.fitting.estimate import Curve, Estimate, Fit
from tablegen.fitting.least_squares import Solution, solve, with_errors
from tablegen.fitting.outliers import outliers
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver

_NAMES = ("m_minus", "m_plus", "centre_nm")
_MIN_SCATTER = 1e-7  # relative scatter that is rounding of the file, not of the microscope


@dataclass(frozen=True, kw_only=True)
class OffsetFit(Fit):
    """The amplitude factors at v_min and at v_max, dimensionless, and the apparent size at the centre in nm.

    ``size_v`` is the scan voltage at which a size law made them factors of the drive, None where none did.
    """

    m_minus: Estimate
    m_plus: Estimate
    centre_nm: Estimate
    size_v: float | None


def fit_offset(
    offset_v: Floats,
    apparent_nm: Floats,
    v_max: Driver | float,
    size_law: SizeLaw | None = None,
    size_v: float | None = None,
    errors_nm: Floats | None = None,
) -> OffsetFit:
    """Fit the law of (1) to apparent sizes (of one object, or lattice constants) at three or more offsets.

    Least squares; exact for three different offsets. m multiplies the drive, and a drive that is m times as large makes
    the scan more than m times as large, (6): with the size law and ``size_v``, apparent sizes are R(V) / R(V / m).
    Without them they are taken for m itself, as ``OffsetLaw.fit`` does.

    Parameters
    ----------
    offset_v
        Offsets in V, shape (points,).
    apparent_nm
        Apparent sizes in nm, shape (points,).
    size_v
        Scan voltage of the images, peak to peak at the piezo, in V.
    errors_nm
        Standard errors of the sizes, shape (points,), their weights as in ``fit_size``; equal by default.

    Raises
    ------
    Unphysical
        If there are too few offsets, or the sizes make no law.
    """
    driver = Driver.of(v_max)
    outside = (offset_v < driver.v_min) | (offset_v > driver.v_max)
    if outside.any():
        wrong = float(offset_v[outside][0])
        raise Unphysical(f"an offset of {wrong:g} V is outside the driver's {driver}; is v_max right?")
    p = np.array([driver.p(v) for v in offset_v.tolist()])
    law = OffsetLaw.fit(p.tolist(), apparent_nm.tolist())
    shape = _shape(p)
    factors = np.array([law.factor(one) for one in p.tolist()])
    start = [law.factor(-1.0), law.factor(1.0), float(np.mean(apparent_nm) / np.mean(factors))]

    def looks(m: Floats) -> Floats:
        """Return apparent sizes, relative to that at m = 1.

        Returns
        -------
        Floats
            Dimensionless, of the shape of ``m``.
        """
        if size_law is None or size_v is None:
            return m
        v = size_v / driver.span
        return size_law.size_nm(v) / np.array([size_law.size_nm(v / one) for one in np.maximum(m, 0.1).tolist()])

    def solved(errors: Floats) -> Solution:
        """Fit with these standard errors.

        Parameters
        ----------
        errors
            Standard errors in nm, shape (points,).
        """

        def residuals(x: Floats) -> Floats:
            """Compute the misfit in standard errors.

            Returns
            -------
            Floats
                Shape (points,).
            """
            misfits: Floats = (x[2] * looks(shape @ np.array([1.0, x[0], x[1]])) - apparent_nm) / errors
            return misfits

        return solve(residuals, start, _NAMES, [0.5, 0.5, scale])

    scale = float(np.mean(apparent_nm))
    solution = solved(np.full(len(p), scale)) if errors_nm is None else with_errors(solved, apparent_nm, errors_nm)
    centre = float(solution.values[2])
    expected = centre * looks(shape @ np.array([1.0, *solution.values[:2]]))
    strays = outliers(solution.jacobian, solution.residuals, _MIN_SCATTER)
    line = np.linspace(driver.v_min, driver.v_max, 101)
    curve = looks(_shape(driver.p(line)) @ np.array([1.0, *solution.values[:2]]))
    return OffsetFit(
        points=len(p),
        residual_percent=100.0 * (apparent_nm / expected - 1.0),
        before_percent=float(np.max(np.abs(100.0 * (apparent_nm / centre - 1.0)))),
        remarks=tuple(_remarks(p, solution, driver)),
        outliers=strays,
        curves=(
            Curve(
                "apparent size, relative",
                "offset [V]",
                f"size / that at {f'{driver.middle:g} V' if driver.v_min else 'v_max / 2'} [ratio]",
                (offset_v, apparent_nm / centre),
                (line, curve),
            ),
        ),
        m_minus=solution.estimate("m_minus"),
        m_plus=solution.estimate("m_plus"),
        centre_nm=solution.estimate("centre_nm"),
        size_v=None if size_law is None else size_v,
    )


def _shape(p: Floats) -> Floats:
    """Return columns that give m(p) when multiplied by 1, m_minus and m_plus: (1) with (3) and (4) inserted."""
    columns: Floats = np.stack([1.0 - p * p, 0.5 * (p * p - p), 0.5 * (p * p + p)], axis=1)
    return columns


def _remarks(p: Floats, solution: Solution, driver: Driver) -> list[Remark]:
    remarks: list[Remark] = []
    if solution.freedom == 0 and solution.absolute_errors:
        remarks.append(
            Remark(
                "three points fit exactly: errors are those of the images alone",
                code="few-points",
            )
        )
    elif solution.freedom == 0:
        remarks.append(
            Remark(
                "three points fit exactly, so errors cannot be estimated",
                code="few-points",
            )
        )
    low, high = float(np.min(p)), float(np.max(p))
    bottom = "v_min" if driver.v_min else "0 V"
    for name, gap, volts in (("m_minus", low + 1.0, bottom), ("m_plus", 1.0 - high, "v_max")):
        if gap > 0.4:
            remarks.append(
                spoils(
                    f"{name} is extrapolated over {50.0 * gap:.0f} % of the range; measure at some 7 % from {volts}",
                    code="extrapolated-parameter",
                )
            )
    for name in ("m_minus", "m_plus"):
        if name in solution.undetermined:
            remarks.append(
                spoils(
                    f"{name} is not determined by these points; spread the offsets over most of {driver}",
                    code="undetermined-parameter",
                )
            )
    return remarks
