"""Small plots of points and a line for the terminal, in plain characters."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tablegen.calibration.estimate import Curve

_WIDTH, _HEIGHT = 64, 10


def scatter(curve: "Curve") -> list[str]:
    """Points as o, the fitted line as dots between them."""
    import numpy as np

    both = [np.concatenate([curve.fitted[i], curve.measured[i]]) for i in (0, 1)]
    low = [float(values.min()) for values in both]
    span = [float(np.ptp(values)) or 1.0 for values in both]
    grid = [[" "] * _WIDTH for _ in range(_HEIGHT)]
    for points, mark in ((curve.fitted, "."), (curve.measured, "o")):
        for x, y in zip(points[0].tolist(), points[1].tolist(), strict=True):
            column = round((x - low[0]) / span[0] * (_WIDTH - 1))
            row = round((1.0 - (y - low[1]) / span[1]) * (_HEIGHT - 1))
            grid[row][column] = mark
    labels = {0: low[1] + span[1], _HEIGHT - 1: low[1]}
    left = [f"{labels[i]:.4g}" if i in labels else "" for i in range(_HEIGHT)]
    lines = [f"{label:>10} |{''.join(row)}".rstrip() for label, row in zip(left, grid, strict=True)]
    ends = f"{low[0]:.4g}", f"{low[0] + span[0]:.4g}"
    middle = f"{curve.x_label}".center(_WIDTH - len(ends[0]) - len(ends[1]))
    return [
        f"{curve.title} [{curve.y_label}]",
        *lines,
        " " * 11 + "+" + "-" * _WIDTH,
        " " * 12 + ends[0] + middle + ends[1],
    ]
