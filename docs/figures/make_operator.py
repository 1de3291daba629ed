"""Draw the picture of docs/operator.md and write its table of scans: a simulation. Usage: make figures"""

import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import matplotlib as mpl
import matplotlib.pyplot as plt
from foreign_scan import Line, calibrated, scanned

from foreign_plants import SIX, TEN, BoucWen, ForeignPlant, ManyPlays

FOLDER = Path(__file__).parent
PAGE = FOLDER.parent / "operator.md"
GREY, RED, BLUE = "#777777", "#c23b22", "#1f5fa8"
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
DRAWN = (("many plays", 50.0, 500.0), ("Bouc-Wen", 70.0, 300.0))


def row(plant: str, offsets: str, name: str, lines: Sequence[Line]) -> str:
    """Mean and worst of some scans."""
    cells = []
    for measure, digits in (("rms", 3), ("scaling", 2), ("mismatch", 2), ("size", 2)):
        values = [abs(getattr(line, measure)) for line in lines]
        cells.append(f"{sum(values) / len(values):.{digits}f} / {max(values):.{digits}f}")
    return f"| {plant} | {offsets} | {name} | {' | '.join(cells)} |"


def table(folder: Path) -> tuple[list[str], dict[tuple[str, str], Line]]:
    """The rows, and the lines of the picture by plant and name."""
    rows, drawn = [], {}
    for plant_name, kind in PLANTS.items():
        plant = ForeignPlant(kind())
        folders = {}
        for protocol in (SIX, TEN):
            folders[protocol] = folder / f"{plant_name} {len(protocol)}"
            folders[protocol].mkdir()
            calibrated(plant, folders[protocol], protocol)
        for offsets, scans in SCANS.items():
            for name, protocol, scanner, model in LINES:
                lines = []
                for offset_v, size_nm in scans:
                    for rate_hz in RATES_HZ:
                        line = scanned(plant, folders[protocol], scanner, size_nm, offset_v, rate_hz, model)
                        lines.append(line)
                        if (plant_name, offset_v, size_nm) in DRAWN and rate_hz == RATES_HZ[0]:
                            drawn[plant_name, name] = line
                rows.append(row(plant_name, offsets, name, lines))
    return rows, drawn


def draw(drawn: dict[tuple[str, str], Line]) -> None:
    """The residual before, with the laws, and with the operator."""
    figure, panels = plt.subplots(2, 2, figsize=(11, 6.2), layout="constrained")
    for (plant, offset_v, size_nm), (before, after) in zip(DRAWN, panels, strict=True):
        for axes, name, colour in (
            (before, "triangle", GREY),
            (after, "laws", RED),
            (after, "operator, six traces", BLUE),
        ):
            for forward in (True, False):
                x, error = drawn[plant, name].side(forward)
                label = f"{name}, {'forward' if forward else 'backward'}"
                axes.plot(x, error, "-" if forward else "--", color=colour, lw=1.6, label=label)
        for axes in (before, after):
            axes.axhline(0.0, color="#bbbbbb", lw=0.6)
            axes.set(xlim=(0.1, 0.9), ylabel="residual [% of the line]", xlabel="position in the line")
            axes.legend(frameon=False, fontsize=8, ncols=2, loc="upper center")
        for axes, what in ((before, "a triangle"), (after, "compensated")):
            low, high = axes.get_ylim()
            axes.set_ylim(low, high + 0.25 * (high - low))
            axes.set_title(f"{plant}: {size_nm:g} nm at {offset_v:g} V, {what}")
    figure.savefig(FOLDER / "operator.png", dpi=100, metadata={"Software": None})


def main() -> None:
    """Write both."""
    with TemporaryDirectory() as folder:
        rows, drawn = table(Path(folder))
    draw(drawn)
    head = [
        "| piezo | offset | line | rms [% of the line] | scaling error [% p-p] | trace-retrace [% of the line] | size [%] |",
        "|---|---|---|---|---|---|---|",
    ]
    made = "\n".join([*head, *rows])
    print(made)
    text = PAGE.read_text(encoding="utf-8")
    if "--write" in sys.argv:
        PAGE.write_text(
            re.sub(r"<!-- measured -->\n.*?\n<!-- /measured -->", f"<!-- measured -->\n{made}\n<!-- /measured -->", text, flags=re.S),
            encoding="utf-8",
        )


if __name__ == "__main__":
    mpl.use("Agg")
    mpl.rcParams.update({"font.size": 10, "axes.spines.top": False, "axes.spines.right": False})
    main()
