"""The expectation on the scanner: by the operator of an axis, or of trace and retrace by the laws of its file.

A branch of (17) runs from turn to turn of a line of V_scan. Turnarounds are rounded, so that the drive of a build turns
earlier: at a stroke of V_scan (w_max - w_min). The piezo's loop is that of this stroke, with the smaller residual of
(22), and its branches meet where the drive really turns. So trace and retrace are apart, although each is straight by
the branches that were applied.
"""

from math import hypot

import numpy as np
from msgspec.structs import replace

from tablegen.certificate.converter_errors import converter_errors
from tablegen.certificate.line_errors import EmittedPeriod
from tablegen.compensation.expectation import Expectation, Figure, PlayedStroke
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan
from tablegen.waveform.sampler import Expansion, on_grid

_POINTS = 401  # over the window
_GRID = 32  # points per period of the highest harmonic


def expected_of(line: LinePlan) -> Expectation | None:
    """Compute what a line should do on the scanner; None where nothing is known.

    A layer of ``tablegen refine`` was learnt on the scanner, and knows more than the model.
    """
    if line.layer is not None:
        return None
    known = known_expectation(line)
    if known is not None:
        return known
    rounding = _rounding(line) if line.band_limit.directions == "both" else None
    return None if rounding is None else Expectation("laws", mismatch=Figure(rounding[0]), stroke=rounding[1])


def known_expectation(line: LinePlan) -> Expectation | None:
    """Return the expectation by the operator of an axis; None without one, where the laws know the mismatch at most."""
    known = line.drive.shape.identification.expectation
    if known is None or line.layer is not None:
        return None
    return known if line.band_limit.directions == "both" else known.forward_only


def certified_expectation(line: LinePlan, played: EmittedPeriod) -> Expectation | None:
    """Compute the expectation of the emitted integers: what the converter's steps leave is uncertain too.

    Steps and departures of the piezo are independent: the squares of their errors add up.
    """
    expected = expected_of(line)
    if expected is None or expected.basis != "traces":
        return expected
    steps = converter_errors(line, played)
    return replace(
        expected,
        rms={side: _less_certain(figure, steps.rms[side]) for side, figure in expected.rms.items()},
        scaling={side: _less_certain(figure, steps.scaling[side]) for side, figure in expected.scaling.items()},
        mismatch=None if expected.mismatch is None else _less_certain(expected.mismatch, steps.mismatch),
    )


def _less_certain(figure: Figure, by: float) -> Figure:
    if figure.uncertainty is None:
        return figure
    return replace(figure, uncertainty=hypot(figure.uncertainty, by))


def rounding_mismatch(line: LinePlan) -> float | None:
    """Compute the largest distance of trace and retrace inside the window, in percent of the line, by the laws.

    None where a model has no branches for the stroke that is played.
    """
    rounding = _rounding(line)
    return None if rounding is None else rounding[0]


def forward_residual(line: LinePlan) -> float | None:
    """Compute the rms residual of the way forward alone, about its best straight line, in percent, by the laws.

    This is what a slow axis leaves in its images, which has no retrace. None as for ``rounding_mismatch``.
    """
    played = _played(line)
    if played is None:
        return None
    x, forward, _, extent, _ = played
    reached = extent * forward
    return 100.0 * float(np.std(reached - np.polyval(np.polyfit(x, reached, 1), x)))


def _rounding(line: LinePlan) -> tuple[float, PlayedStroke] | None:
    played = _played(line)
    if played is None:
        return None
    _, forward, backward, extent, peaks = played
    return 100.0 * extent * float(np.max(np.abs(forward - backward))), PlayedStroke(*peaks, extent)


Peaks = tuple[tuple[float, float], tuple[float, float]]


def _played(line: LinePlan) -> tuple[Floats, Floats, Floats, float, Peaks] | None:
    """Compute the places on the line, where both ways are at them by the laws of the played stroke, and that stroke."""
    drive = line.drive
    if drive.shape.whole is not None or not drive.hysteresis.compensates:
        return None
    w = on_grid(line.target, _GRID * line.target.harmonics)
    target = Expansion(line.target)
    low, high = float(np.min(w)), float(np.max(w))
    played = drive.line_at(drive.v_scan_normalised * (high - low))
    if played is None:
        return None
    x = np.linspace(*line.band_limit.window, _POINTS)
    there, back = (_share(line, target, side, x, low, high) for side in ("forward", "backward"))
    at = played.forward.inverse(there), 1.0 - played.backward.inverse(1.0 - back)
    extent = drive.size_law.size_nm(drive.v_scan_normalised * (high - low)) / drive.size_nm
    forward, backward = ((one.beta, one.u_peak) for one in played.peaks)
    return x, *at, extent, (forward, backward)


def _share(line: LinePlan, target: Expansion, side: str, x: Floats, low: float, high: float) -> Floats:
    """Return the drive where the line is at ``x``, from 0 to 1 between its turns."""
    return (target.at(line.drive.shape.times(side, x), 0)[0] - low) / (high - low)
