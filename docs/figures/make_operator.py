"""Draw the pictures of docs/operator.md and write its table of scans: a simulation. Usage: make figures"""

import os
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from calibrated_plant import Line, calibrated, refined, scanned
from foreign_plants import SIX, TEN, BoucWen, Floats, ForeignPlant, ManyPlays

FOLDER = Path(__file__).parent
PAGE = FOLDER.parent / "operator.md"
GREY, RED, BLUE, GREEN = "#777777", "#c23b22", "#1f5fa8", "#2e7d32"
PLANTS = {"many plays": ManyPlays, "Bouc-Wen": BoucWen}
RATES_HZ = (100.0, 1000.0)
SCANS = {  # offset in V: sizes in nm that no trace had
    "50 V": [(50.0, size) for size in (120.0, 300.0, 500.0, 700.0, 800.0)],
    "70 and 85 V": [(70.0, 120.0), (70.0, 300.0), (70.0, 450.0), (85.0, 100.0), (85.0, 200.0)],
}
LINES = (  # name, protocol, scanner file, model
    ("triangle", SIX, "laws.toml", "triangle"),
    ("laws", SIX, "laws.toml", ""),
    ("operator, six traces", SIX, "operator.toml", ""),
    ("operator, ten traces", TEN, "operator.toml", ""),
)
HEAD = (
    "| piezo | offset | line | rms [% of the line] | scaling error [% p-p] "
    "| trace-retrace [% of the line] | size [%] |",
    "|---|---|---|---|---|---|---|",
)
WORSE = (
    "| piezo | scan | laws: rms, scaling, trace-retrace [%] | operator, six traces | operator, ten traces |",
    "|---|---|---|---|---|",
)
REFINED = "refined once"
CUT = ", "  # before the number of traces
DRAWN = (("many plays", 50.0, 500.0), ("Bouc-Wen", 70.0, 300.0))


def row(plant: str, offsets: str, name: str, lines: Sequence[Line]) -> str:
    """Mean and worst of some scans."""
    cells = []
    for measure, digits in (("rms", 3), ("scaling", 2), ("mismatch", 2), ("size", 2)):
        values = [abs(getattr(line, measure)) for line in lines]
        cells.append(f"{sum(values) / len(values):.{digits}f} / {max(values):.{digits}f}")
    return f"| {plant} | {offsets} | {name} | {' | '.join(cells)} |"


def worse(plant: str, offset_v: float, size_nm: float, rate_hz: float, lines: dict[str, Line]) -> list[str]:
    """A row for a scan of which the operator leaves a larger residual or mismatch than the laws."""
    laws, six, ten = (lines[name] for name, *_ in LINES[1:])
    if six.rms <= laws.rms and six.mismatch <= laws.mismatch:
        return []
    cells = [f"{line.rms:.2f}, {line.scaling:.1f}, {line.mismatch:.2f}" for line in (laws, six, ten)]
    return [f"| {plant} | {size_nm:g} nm at {offset_v:g} V, {rate_hz:g} Hz | {' | '.join(cells)} |"]


def table(folder: Path) -> tuple[list[str], list[str], dict[tuple[str, str], Line]]:
    """The rows of both tables, and the lines of the picture by plant and name."""
    rows, worst, drawn = [], [], {}
    for plant_name, kind in PLANTS.items():
        plant = ForeignPlant(kind())
        folders = {}
        for protocol in (SIX, TEN):
            folders[protocol] = folder / f"{plant_name} {len(protocol)}"
            folders[protocol].mkdir()
            calibrated(plant, folders[protocol], protocol)
        for offsets, scans in SCANS.items():
            found: dict[str, list[Line]] = {name: [] for name, *_ in LINES}
            for (offset_v, size_nm), rate_hz in product(scans, RATES_HZ):
                scan = {
                    name: scanned(plant, folders[protocol], scanner, size_nm, offset_v, rate_hz, model)
                    for name, protocol, scanner, model in LINES
                }
                worst += worse(plant_name, offset_v, size_nm, rate_hz, scan)
                for name, line in scan.items():
                    found[name].append(line)
                    if (plant_name, offset_v, size_nm) in DRAWN and rate_hz == RATES_HZ[0]:
                        drawn[plant_name, name] = line
                if (plant_name, offset_v, size_nm) in DRAWN and rate_hz == RATES_HZ[0]:
                    drawn[plant_name, REFINED] = refined(plant, folders[SIX], size_nm, offset_v, rate_hz)
            (FOLDER / "operator_fit.png").write_bytes((folders[TEN] / "fit.png").read_bytes())
            rows += [row(plant_name, offsets, name, lines) for name, lines in found.items()]
    return rows, worst, drawn


def averaged(values: Floats) -> Floats:
    """A running mean over 2 % of the line, which does not show the converter's steps."""
    count = round(0.02 / 0.8 * len(values))
    return np.convolve(values, np.full(count, 1.0 / count), mode="valid")


def draw(drawn: dict[tuple[str, str], Line]) -> None:
    """The residual before, with the laws, with the operator, and refined."""
    figure, panels = plt.subplots(2, 3, figsize=(14, 6.2), layout="constrained")
    for (plant, offset_v, size_nm), (before, after, last) in zip(DRAWN, panels, strict=True):
        for axes, name, colour in (
            (before, "triangle", GREY),
            (after, "laws", RED),
            (after, "operator, six traces", BLUE),
            (last, "operator, six traces", BLUE),
            (last, REFINED, GREEN),
        ):
            for forward in (True, False):
                x, error = drawn[plant, name].side(forward)
                if axes is last:
                    x, error = averaged(x), averaged(error)
                label = f"{name.split(CUT)[0]}, {'forward' if forward else 'backward'}"
                width, shade = (4.5, 0.4) if name == REFINED else (1.6, 1.0)
                axes.plot(x, error, "-" if forward else "--", color=colour, lw=width, alpha=shade, label=label)
        for axes, most in ((before, 7.0), (after, 1.0), (last, 0.05)):
            axes.axhline(0.0, color="#bbbbbb", lw=0.6)
            axes.set(xlim=(0.1, 0.9), ylabel="residual [% of the line]", xlabel="position in the line")
            axes.legend(frameon=False, fontsize=8, ncols=2, loc="upper center")
            axes.set_ylim(-most, 1.4 * most)
        for axes, what in ((before, "a triangle"), (after, "compensated"), (last, "20 times finer")):
            axes.set_title(f"{plant}: {size_nm:g} nm at {offset_v:g} V, {what}")
    figure.savefig(FOLDER / "operator.png", dpi=100, metadata={"Software": None})


def main() -> None:
    """Write both."""
    with TemporaryDirectory() as folder:
        rows, worst, drawn = table(Path(folder))
    draw(drawn)
    parts = {
        "measured": "\n".join([*HEAD, *rows]),
        "worse": "\n".join([*WORSE, *worst]) if worst else "No scan is worse.",
    }
    text = PAGE.read_text(encoding="utf-8")
    for name, part in parts.items():
        begin, end = f"<!-- {name} -->\n", f"<!-- /{name} -->"
        before, _, rest = text.partition(begin)
        text = before + begin + part + "\n" + end + rest.partition(end)[2]
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    mpl.use("Agg")
    mpl.rcParams.update({"font.size": 10, "axes.spines.top": False, "axes.spines.right": False})
    main()
