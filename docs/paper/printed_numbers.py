"""The numbers that the paper prints of its scanner, beside those of the virtual scanners of the package.

PYTHONPATH=docs python -m paper.printed_numbers     prints the table of docs/virtual.md
"""

from collections.abc import Iterator

import numpy as np

from paper.identify import OFFSETS_V, X_TARGETS
from tablegen.compensation.hysteresis import BranchShape, beta_at
from tablegen.compensation.line import LineShape
from tablegen.compensation.models.harmonic import HarmonicModel
from tablegen.compensation.models.sinusoidal import SinusoidalModel
from tablegen.numerics.arrays import Floats
from tablegen.virtual.experiments import apparent_sizes, triangle_size
from tablegen.virtual.line_error import BranchError, LineError, ideal_triangle, line_error
from tablegen.virtual.parameters import BUILT_IN, load_truth
from tablegen.virtual.scanner import VirtualAxis, VirtualScanner

TICKS, RATE_HZ = 4000, 100.0
SECTION_8 = LineShape(0.5, BranchShape.harmonic(0.035, 0.37), BranchShape.harmonic(0.085, 0.48))
# The paper does not print the optimised beta of its sinusoidal model.
SINUSOIDAL = LineShape(0.5, BranchShape.sinusoidal(0.032), BranchShape.sinusoidal(0.081))
GROWTH_V = (13.0, 20.0, 30.0, 50.0, 70.0, 100.0)


def default_x() -> VirtualAxis:
    """The fast axis of the default scanner."""
    return VirtualScanner.of(load_truth()).x


def played_line(axis: VirtualAxis, w: Floats, size_v: float, offset_v: float = 50.0) -> LineError:
    """A settled line of a normalised drive ``w`` over a period."""
    return line_error(axis.settled(offset_v + size_v * (w - 0.5), 1.0 / (RATE_HZ * len(w))), 0.5)


def triangle_line(axis: VirtualAxis, size_v: float, offset_v: float = 50.0) -> LineError:
    """A settled triangle."""
    return played_line(axis, ideal_triangle(TICKS, 0.5), size_v, offset_v)


def comparison(axis: VirtualAxis) -> Iterator[tuple[str, str, str]]:
    """What it is, what the paper has, what the axis gives."""
    t = np.arange(TICKS) / TICKS
    whole = triangle_line(axis, 100.0)
    for name, branch, paper in (
        ("forward", whole.forward, "-3.5 % at 0.35 (section 7), 0.37 (section 8)"),
        ("backward", whole.backward, "+8.5 % at 0.55 (section 7), 0.52 (section 8)"),
    ):
        yield f"residual of a 100 V triangle, {name}", paper, f"{branch.peak[0]:+.2f} % at {branch.peak[1]:.2f}"
    for name, branch, paper in (("forward", whole.forward, "30 %"), ("backward", whole.backward, "60 %")):
        yield f"its scaling error, {name}", f"about {paper}", f"{branch.scaling_peak_to_peak:.0f} %"
    for model, shape, papers in (
        (SinusoidalModel.model(), SINUSOIDAL, (("1.5", "15"), ("1.5", "15"))),
        (HarmonicModel.model(), SECTION_8, (("0.5", "5"), ("1", "11"))),
    ):
        line = played_line(axis, shape.value(t), 100.0)
        for (residual, scaling), name in zip(papers, ("forward", "backward"), strict=True):
            one: BranchError = getattr(line, name)
            low, high = one.residual_range
            found = f"{low:+.2f} .. {high:+.2f} %, {one.scaling_peak_to_peak:.1f} %"
            yield f"residual and scaling error, {model} model, {name}", f"±{residual} %, {scaling} %", found
    offsets = apparent_sizes(axis, OFFSETS_V, 13.0, RATE_HZ, true_nm=1.0)["apparent_nm"]
    fit = np.array([X_TARGETS.offset.factor(v / 50.0 - 1.0) for v in OFFSETS_V])
    yield "apparent size at 93 V", "+25 %", f"{100.0 * (offsets[-1] - 1.0):+.1f} %"
    yield "apparent size at 7 V", "-8 %", f"{100.0 * (offsets[0] - 1.0):+.1f} %"
    yield "apparent size between, off equation (1)", "a good fit", f"{100.0 * np.max(np.abs(offsets - fit)):.1f} %"
    sizes = [triangle_size(axis, v, 50.0, RATE_HZ) / X_TARGETS.size.size_nm(v / 100.0) - 1.0 for v in GROWTH_V]
    yield "sizes off (6) and (10), beta 0.53, threshold 0.5", "1 %", f"{100.0 * np.max(np.abs(sizes)):.1f} %"
    for name, beta_max, rho in (("forward", 0.037, 4.0), ("backward", 0.08, 1.5)):
        for v in GROWTH_V[1::2]:
            found_peak = abs(getattr(triangle_line(axis, v), name).peak[0])
            expected = 100.0 * beta_at(v / 100.0, beta_max, rho)
            yield f"residual at {v:g} V by (22), {name}", f"{expected:.2f} %", f"{found_peak:.2f} %"
    slow, fast = (triangle_size(axis, 20.0, 50.0, rate) for rate in (1.0, 100.0))
    decade = 50.0 * (slow - fast) / triangle_size(axis, 20.0, 50.0, 100.0)
    yield "loss of size a decade of rate", "3 %", f"{decade:.1f} %"
    f = np.geomspace(1e4, 1e5, 4001)
    yield "resonance", "50 kHz", f"{f[np.argmax(np.abs(axis.response(f)))] / 1e3:.0f} kHz"


def table() -> str:
    """The comparison in Markdown: a column for each scanner of the package."""
    columns = [list(comparison(VirtualScanner.of(load_truth(name)).x)) for name in BUILT_IN]
    lines = ["| | paper | default | duhem |", "|---|---|---|---|"]
    for rows in zip(*columns, strict=True):
        lines.append(f"| {' | '.join((*rows[0][:2], *(row[2] for row in rows)))} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(table(), end="")
