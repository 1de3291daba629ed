"""The paper's equations with its own parameters: what (6), (10), (15), (17) and (22) give, no scanner in between."""

import numpy as np

from tablegen.compensation.hysteresis import BranchShape, beta_at
from tablegen.compensation.size import SizeLaw
from tablegen.numerics.arrays import Floats

V_MAX = 100.0
BASE_NM = 200.0
SIZE_BETA, THRESHOLD = 0.53, 0.5  # section 6
BASE_V = 0.13  # 200 nm as a fraction of v_max, section 5
EXAMPLE_BASE_V = 0.2  # what the 436 and 467 nm of section 6 imply
FORWARD_GROWTH, BACKWARD_GROWTH = (0.037, 4.0), (0.08, 1.5)  # figure 5k
LOSS = 0.03  # a decade, section 10

_U = np.linspace(0.0, 1.0, 20001)


def size_law(beta: float = SIZE_BETA, base_v: float = BASE_V, threshold: float = THRESHOLD) -> SizeLaw:
    """(6) and (10), calibrated so that 200 nm take ``base_v`` of v_max."""
    return SizeLaw.calibrated(BASE_NM / (base_v * V_MAX), V_MAX, beta, BASE_NM, threshold)


def uncorrected(law: SizeLaw, nominal_nm: float, base_v: float = BASE_V) -> float:
    """The size in nm that comes of one that is set with a linear piezo constant."""
    return law.size_nm(nominal_nm / BASE_NM * base_v)


def responses(shape: BranchShape) -> tuple[Floats, Floats]:
    """The inverse characteristic of figures 5b, 5g and 5h: drive u, and residual of the displacement in percent."""
    return _U, 100.0 * (shape.inverse(_U) - _U)


def peak(shape: BranchShape) -> tuple[float, float]:
    """The largest residual in percent, with its sign, and the u where it is."""
    u, residual = responses(shape)
    i = int(np.argmax(np.abs(residual)))
    return float(residual[i]), float(u[i])


def growth(v: float, side: tuple[float, float]) -> float:
    """(22): the residual in percent at a normalised size."""
    return 100.0 * beta_at(v, *side)
