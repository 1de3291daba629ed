"""The pictures of figures 5a, 5c, 5d, 5i and 5e, 5f, 5j."""

import numpy as np
from matplotlib.figure import Figure

from paper.drawing import BLUE, GREY, RED, SHADE, key, printed, sheet, span
from paper.measured import full_scale
from tablegen.virtual.line_error import BranchError, ideal_triangle

COLOURS = {"forward": RED, "backward": BLUE}
WINDOW = (0.1, 0.9)


def figure_5a() -> Figure:
    """Displacement against drive, and its residual."""
    figure, axes = sheet(2, 1, 5.6, 6.0, sharex=True)
    loop, residual = axes[:, 0]
    error = full_scale("triangle").error
    loop.plot([0, 1], [0, 1], color=GREY, lw=1.0, ls="--", label="linear")
    for side, colour in COLOURS.items():
        branch: BranchError = getattr(error, side)
        loop.plot(branch.position, branch.position + 0.01 * branch.residual, color=colour, label=side)
        residual.plot(branch.position, branch.residual, color=colour)
    printed(residual, [0.35], [-3.5], RED)
    printed(residual, [0.55], [8.5], BLUE, "_")
    residual.axhline(0.0, color=GREY, lw=0.7)
    loop.set(title="5a: triangle of 100 V (simulation)", ylabel="normalised displacement", xlim=(0, 1), ylim=(0, 1))
    residual.set(xlabel="normalised drive", ylabel="residual [%]", ylim=(-5, 10))
    key(loop, loc="upper left")
    key(residual, loc="lower right")
    return figure


def figure_5cdi() -> Figure:
    """Lines in time, and their residuals from the triangle."""
    figure, axes = sheet(2, 3, 12.0, 6.0, sharex=True, sharey="row")
    panels: tuple[tuple[str, str, float, float], ...] = (
        ("triangle", "5c: triangle", -3.5, 8.5),
        ("sinusoidal", "5d: sinusoidal model", 1.5, 1.5),
        ("harmonic", "5i: harmonic model", 0.5, 1.0),
    )
    for (upper, lower), (model, title, forward, backward) in zip(axes.T, panels, strict=True):
        line = full_scale(model)
        t = line.drive.turns
        moved = (line.displacement_nm - np.min(line.displacement_nm)) / np.ptp(line.displacement_nm)
        ideal = ideal_triangle(len(t), 0.5, 0.5)
        upper.plot(t, ideal, color=GREY, lw=1.0, ls="--", label="ideal")
        upper.plot(t, line.drive.volts / 100.0, color=RED, lw=1.2, label="drive, from emitted codes")
        upper.plot(t, moved, color=BLUE, label="displacement (simulation)")
        lower.axhline(0.0, color=GREY, lw=0.7)
        lower.plot(t, 100.0 * (moved - ideal), color=BLUE)
        if model == "triangle":
            printed(lower, [0.5 * 0.35, 0.5 + 0.5 * (1.0 - 0.55)], [forward, backward], GREY)
        else:
            span(lower, 0.25, -forward, 2.0 * forward, GREY, "printed in the paper")
            span(lower, 0.75, -backward, 2.0 * backward, GREY, "_")
        upper.set(title=title, xlim=(0, 1), ylim=(0, 1.02))
        lower.set(xlabel="time [line periods]", ylim=(-5, 10))
    axes[0, 0].set_ylabel("normalised")
    axes[1, 0].set_ylabel("residual [%]")
    key(axes[0, 0], loc="lower center")
    for lower in axes[1]:
        key(lower, loc="upper left")
    return figure


def figure_5efj() -> Figure:
    """Scaling errors over the line."""
    figure, axes = sheet(1, 3, 12.0, 4.2, sharey=True)
    panels: tuple[tuple[str, str, float, float], ...] = (
        ("triangle", "5e: triangle", 30.0, 60.0),
        ("sinusoidal", "5f: sinusoidal model", 15.0, 15.0),
        ("harmonic", "5j: harmonic model", 5.0, 11.0),
    )
    for panel, (model, title, forward, backward) in zip(axes[0], panels, strict=True):
        error = full_scale(model).error
        for low, high in ((0.0, WINDOW[0]), (WINDOW[1], 1.0)):
            panel.axvspan(low, high, color=SHADE, lw=0)
        panel.axhline(0.0, color=GREY, lw=0.7)
        for side, colour in COLOURS.items():
            branch: BranchError = getattr(error, side)
            panel.plot(branch.scaling_position, branch.scaling, color=colour, label=f"{side} (simulation)")
        for side, x, height in (("forward", 0.035, forward), ("backward", 0.965, backward)):
            branch = getattr(error, side)
            middle = 0.5 * (float(np.min(branch.scaling)) + float(np.max(branch.scaling)))
            span(panel, x, middle - 0.5 * height, height, COLOURS[side], "printed peak to peak" if x < 0.5 else "_")
        panel.set(title=title, xlabel="normalised position x", xlim=(0, 1), ylim=(-45, 45))
        key(panel, loc="upper center", ncols=1)
    axes[0, 0].set_ylabel("scaling error [%]")
    return figure


PICTURES = {
    "figure_5a": ("Displacement of a triangle of 100 V and its residual", figure_5a),
    "figure_5cdi": ("Triangle, sinusoidal and harmonic model in time", figure_5cdi),
    "figure_5efj": ("Scaling errors of triangle, sinusoidal and harmonic model", figure_5efj),
}
