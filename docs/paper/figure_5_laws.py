"""Figures 5b, 5g and 5h, section 8: the models' own residuals."""

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from paper.drawing import BLUE, GREEN, GREY, RED, key, printed, sheet
from paper.laws import peak, responses
from paper.rows import Row, Source, exact, exactly
from tablegen.compensation.hysteresis import BranchShape

TITLE = "Figures 5b, 5g, 5h: the models"
TEXT = """The residual is the inverse of (15) and (17), as `tablegen` builds them, minus the drive u: the position of
such a piezo, minus the ideal position. "Exactly" is checked to a thousandth; the caption of 5g says "exactly" for the
sinusoidal model too."""

BETAS, SINUSOIDAL_PEAKS = ("0.03", "0.06", "0.09"), ("0.53", "0.56", "0.59")
HARMONIC_PEAK, PEAKS, BETA_5H = "0.48", ("0.37", "0.5", "0.65"), "0.035"


def rows() -> list[Row]:
    """Value and place of every printed peak."""
    found = []
    for beta, at in zip(BETAS, SINUSOIDAL_PEAKS, strict=True):
        value, place = peak(BranchShape.sinusoidal(float(beta)))
        what = f"sinusoidal model, beta = {beta}"
        found.append(Row("5b", f"{what}: peak residual", exactly(f"-{beta[-1]}", "%"), value, Source.LAW))
        found.append(Row("5b", f"{what}: at u", exact(at), place, Source.LAW, decimals=5))
    found.append(
        Row(
            "5b",
            "beta of the curve with -9 %",
            exact("0.9"),
            _beta_of(-9.0),
            Source.LAW,
            "a slip of the paper: 0.9 would run backwards and, by (16), peak at 1.4; figures 5b and 5g use 0.09",
            decimals=3,
        )
    )
    for beta in BETAS:
        value, place = peak(BranchShape.harmonic(float(beta), float(HARMONIC_PEAK)))
        what = f"harmonic model, beta = {beta}, u_peak = {HARMONIC_PEAK}"
        found.append(Row("5g", f"{what}: peak residual", exactly(f"-{beta[-1]}", "%"), value, Source.LAW))
        found.append(Row("5g", f"{what}: at u", exactly(HARMONIC_PEAK), place, Source.LAW))
    for at in PEAKS:
        value, place = peak(BranchShape.harmonic(float(BETA_5H), float(at)))
        what = f"harmonic model, beta = {BETA_5H}, u_peak = {at}"
        found.append(Row("5h", f"{what}: peak residual", exactly("-3.5", "%"), value, Source.LAW))
        found.append(Row("5h", f"{what}: at u", exactly(at), place, Source.LAW))
    return found


def _beta_of(percent: float) -> float:
    """The beta of (15) whose residual peaks at so many percent, by bisection."""
    low, high = 0.0, 0.3
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if peak(BranchShape.sinusoidal(middle))[0] > percent else (low, middle)
    return 0.5 * (low + high)


def figure_5b() -> Figure:
    """The sinusoidal model."""
    figure, axes = sheet(2, 1, 5.6, 6.0, sharex=True)
    shapes = [BranchShape.sinusoidal(float(beta)) for beta in BETAS]
    _pair(axes[:, 0], shapes, [f"beta = {beta}" for beta in BETAS], (-3, -6, -9), SINUSOIDAL_PEAKS)
    axes[0, 0].set_title("5b: sinusoidal model")
    return figure


def figure_5gh() -> Figure:
    """The harmonic model: beta, and u_peak."""
    figure, axes = sheet(2, 2, 10.6, 6.0, sharex=True, sharey="row")
    shapes = [BranchShape.harmonic(float(beta), float(HARMONIC_PEAK)) for beta in BETAS]
    _pair(axes[:, 0], shapes, [f"beta = {beta}" for beta in BETAS], (-3, -6, -9), [HARMONIC_PEAK] * 3)
    axes[0, 0].set_title("5g: harmonic model, u_peak = 0.48")
    shapes = [BranchShape.harmonic(float(BETA_5H), float(at)) for at in PEAKS]
    _pair(axes[:, 1], shapes, [f"u_peak = {at}" for at in PEAKS], (-3.5, -3.5, -3.5), PEAKS)
    axes[0, 1].set_title("5h: harmonic model, beta = 0.035")
    return figure


def _pair(
    panels: Sequence[Any],
    shapes: Sequence[BranchShape],
    labels: Sequence[str],
    values: Sequence[float],
    at: Sequence[str],
) -> None:
    upper, lower = panels
    upper.plot([0, 1], [0, 1], color=GREY, lw=1.0, ls="--")
    for shape, label, colour in zip(shapes, labels, (BLUE, GREEN, RED), strict=True):
        u, residual = responses(shape)
        upper.plot(u, u + 0.01 * residual, color=colour, label=label)
        lower.plot(u, residual, color=colour)
    for place, value, colour in zip(at, values, (BLUE, GREEN, RED), strict=True):
        printed(lower, [float(place)], [value], colour, "printed in the paper" if colour == RED else "_")
    lower.axhline(0.0, color=GREY, lw=0.7)
    upper.set(ylabel="normalised displacement", xlim=(0, 1), ylim=(0, 1))
    lower.set(xlabel="normalised drive u", ylabel="residual [%]", ylim=(-10.5, 0.8))
    key(upper, loc="upper left")
    key(lower, loc="lower left")


PICTURES = {
    "figure_5b": ("Inverse of the sinusoidal model and its residual", figure_5b),
    "figure_5gh": ("Inverse of the harmonic model and its residual, for three beta and three u_peak", figure_5gh),
}
