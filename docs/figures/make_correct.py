"""Draw the picture of docs/correct.md and write its table: a simulation. Usage: make figures"""

import os
import sys
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image as Pillow

FOLDER = Path(__file__).parent
PAGE = FOLDER.parent / "correct.md"
sys.path.insert(0, str(FOLDER.parents[1] / "tests" / "helpers"))

from correcting import OFFSET_V, RATE_HZ, V, off, old_frame, save_pair, scanner_file  # noqa: E402

from tablegen.correction.by_fit import by_fit  # noqa: E402
from tablegen.correction.by_scanner import by_scanner  # noqa: E402
from tablegen.correction.distortion import Distortion, Sweep1D  # noqa: E402
from tablegen.correction.old_scan import OldAxis, OldScan  # noqa: E402
from tablegen.correction.scan_images import Choice, read_scan  # noqa: E402
from tablegen.correction.straight import StraightScan  # noqa: E402
from tablegen.virtual.imaging import FrameImages  # noqa: E402

NAMES = {"default": "virtual scanner", "duhem": "`duhem`", "plays": "many plays", "bouc-wen": "Bouc-Wen"}
DRAWN = "bouc-wen"
PIXELS, LINES = 512, 256
TAKEN = OldScan(x=OldAxis(size_v=V, offset_v=OFFSET_V), rate_hz=RATE_HZ)
BLUE, RED = (31, 95, 168), (194, 59, 34)
HEAD = (
    "| scanner | | x: trace, retrace [%] | y: trace, retrace [%] | size: x, y [%] | apart [pixels] | difference [%] |",
    "|---|---|---|---|---|---|---|",
)


def as_taken(frame: FrameImages) -> Distortion:
    """What an uncorrected image says of its pixels: that they are evenly spaced."""
    rows, columns = frame.trace.heights.shape
    place = (np.arange(columns) + 0.5) / columns
    sweeps = Sweep1D(place, 0.5 * place), Sweep1D(place, 1.0 - 0.5 * place)
    return Distortion(rows, columns, *sweeps, np.arange(rows + 1) / rows, np.zeros(rows + 1))


def row(name: str, how: str, distortion: Distortion, frame: FrameImages, apart: float, difference: float) -> str:
    """One line of the table."""
    found = off(distortion, frame)
    before = how == "as taken"
    size = "" if before else f"{found.size[0]:+.2f}, {found.size[1]:+.2f}"
    (xt, yt), (xr, yr) = found.trace, found.retrace
    digits = 2 if before else 3
    errors = f"{xt:.{digits}f}, {xr:.{digits}f} | {yt:.{digits}f}, {yr:.{digits}f}"
    return f"| {name} | {how} | {errors} | {size} | {apart:.{1 if before else 2}f} | {100.0 * difference:.0f} |"


def scans(plant: str, folder: Path) -> tuple[FrameImages, StraightScan, StraightScan]:
    """An old frame of a lattice, by the operator and by a fit."""
    frame = old_frame(plant, pixels=PIXELS, lines=LINES)
    images = read_scan(*save_pair(frame, folder), Choice())
    return frame, by_scanner(images, scanner_file(plant, folder), TAKEN), by_fit(images, OldScan(), lattice_nm=60.0)[0]


def rows_of(plant: str, folder: Path) -> list[str]:
    """As taken, by the operator, by a fit."""
    frame, operator, fit = scans(plant, folder)
    rows = []
    for how, scan in (("operator", operator), ("fit", fit)):
        found = scan.agreement
        assert found is not None
        assert found.worst is not None
        if not rows:
            rows.append(row(NAMES[plant], "as taken", as_taken(frame), frame, found.worst[0], found.difference[0]))
        rows.append(row(NAMES[plant], how, scan.distortion, frame, found.worst[1], found.difference[1]))
    return rows


def draw(scan: StraightScan) -> None:
    """The trace before and after, and how far it was moved."""
    figure, panels = plt.subplots(1, 3, figsize=(12.6, 4.3), layout="constrained")
    for panel, picture, title in (
        (panels[0], scan.raw[0], "as taken"),
        (panels[1], scan.pictures[0], "put straight by the operator"),
    ):
        shown = picture.heights[::1, ::2]
        panel.imshow(shown, cmap="gray", vmin=np.nanpercentile(shown, 1), vmax=np.nanpercentile(shown, 99))
        panel.set(title=title, xticks=[], yticks=[])
    place = (np.arange(PIXELS) + 0.5) / PIXELS
    for forward, style in ((True, "-"), (False, "--")):
        x, y = scan.distortion.displacement(forward)
        name = "trace" if forward else "retrace"
        along, down = (np.nanmean(one, axis=axis) for one, axis in ((x, 0), (y, 1)))
        panels[2].plot(place, 100.0 * along / PIXELS, style, color=np.array(BLUE) / 255, label=f"x, {name}")
        if forward:
            panels[2].plot(
                (np.arange(LINES) + 0.5) / LINES,
                100.0 * down / LINES,
                ":",
                color=np.array(RED) / 255,
                lw=3.0,
                label="y",
            )
    panels[2].axhline(0.0, color="#bbbbbb", lw=0.6)
    panels[2].set(title="how far it was off", xlabel="position in the picture", ylabel="% of the width")
    panels[2].legend(frameon=False)
    out = BytesIO()
    figure.savefig(out, dpi=72, metadata={"Software": None})
    palette = Pillow.new("P", (1, 1))
    shades = [(level, level, level) for level in np.linspace(0, 255, 64).astype(int).tolist()]
    for colour in (BLUE, RED):
        shades += [tuple(round(255 + share * (one - 255)) for one in colour) for share in np.linspace(0.2, 1.0, 20)]
    palette.putpalette([value for shade in shades for value in shade])
    picture = Pillow.open(out).convert("RGB").quantize(palette=palette, dither=Pillow.Dither.NONE)
    picture.save(FOLDER / "correct.png", optimize=True)


def main() -> None:
    """Write both; with the argument ``picture`` the picture alone."""
    with TemporaryDirectory() as folder:
        draw(scans(DRAWN, Path(folder))[1])
    if "picture" in sys.argv:
        return
    rows: list[str] = []
    for plant in NAMES:
        with TemporaryDirectory() as folder:
            rows += rows_of(plant, Path(folder))
    text = PAGE.read_text(encoding="utf-8")
    begin, end = "<!-- measured -->\n", "<!-- /measured -->"
    before, _, rest = text.partition(begin)
    PAGE.write_text(before + begin + "\n".join([*HEAD, *rows]) + "\n" + end + rest.partition(end)[2], encoding="utf-8")


if __name__ == "__main__":
    mpl.use("Agg")
    mpl.rcParams.update({"font.size": 10, "axes.spines.top": False, "axes.spines.right": False})
    main()
