"""The closed loop on the virtual scanner, as tables for docs/virtual.md: a simulation.

``python benchmarks/closed_loop.py`` prints them, ``--write`` puts them into the page.
"""

import argparse
import os
import re
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "docs"))

from paper.other_plants import same_numbers, uniform_density

from tablegen.base.input_errors import Unphysical
from tablegen.config.load import Setup, load
from tablegen.config.schema import BandLimit
from tablegen.virtual.calibration_day import OFFSETS, calibrate
from tablegen.virtual.closed_loop import (
    MAP_SIZES,
    SHARP,
    SHARP_RATE_HZ,
    play_x,
    size_map,
    uncorrected,
    with_scan,
)
from tablegen.virtual.parameters import BUILT_IN, load_truth
from tablegen.virtual.scanner import VirtualScanner
from tablegen.virtual.simulation import with_model

PAGE = ROOT / "docs" / "virtual.md"
SCANNERS = {name: VirtualScanner.of(load_truth(name)) for name in BUILT_IN}
SIZES_V = (20.0, 40.0, 60.0, 80.0, 100.0)
EXAMPLE_RATE_HZ = 100.0


# By line and calibration: a row a size, or why it could not be calibrated.
Figures = dict[tuple[str, str], list[list[float]] | str]
DECIMALS = (2, 2, 1, 1)


def figures(setup: Setup, scanner: VirtualScanner, imaged: bool) -> list[float]:
    """Largest residual and scaling error peak to peak of each direction, and the error of the size, in percent."""
    run = play_x(setup, scanner)
    error = run.imaged if imaged else run.error
    sides = (error.forward, error.backward)
    residuals = [max(map(abs, side.residual_range)) for side in sides]
    return [*residuals, *(side.scaling_peak_to_peak for side in sides), run.size_error_percent]


def played_lines(example: Setup, scanner: VirtualScanner) -> Figures:
    """Every kind of line with every calibration, at each size."""
    kinds: tuple[tuple[str, BandLimit, float, bool], ...] = (
        ("sharp", SHARP, SHARP_RATE_HZ, False),
        ("example", example.scan.x.band_limit, EXAMPLE_RATE_HZ, True),
    )
    found: Figures = {}
    for name, limit, rate, imaged in kinds:
        base = with_scan(example, size_v=50.0, rate_hz=rate, band_limit=limit)
        setup = calibrate(base, scanner).setup
        for what, one in (("no hysteresis", with_model(setup, "triangle")), ("sensor", setup)):
            found[name, what] = [figures(with_scan(one, size_v=size), scanner, imaged) for size in SIZES_V]
        try:
            setup = calibrate(base, scanner, images=True).setup
            found[name, "images"] = [figures(with_scan(setup, size_v=size), scanner, imaged) for size in SIZES_V]
        except Unphysical as reason:
            found[name, "images"] = f"refused: {reason}"
    return found


def loop_table(found: Figures) -> list[str]:
    """A row a kind of line, a calibration and a size."""
    lines = [
        "| line | calibrated with | scan | residual forward [%] | backward | scaling error forward [% p-p] "
        "| backward | size in the image [%] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for (name, what), rows in found.items():
        if isinstance(rows, str):
            lines.append(f"| {name} | {what} | {rows} | | | | | |")
            continue
        for size_v, row in zip(SIZES_V, rows, strict=True):
            cells = [f"{value:.{digits}f}" for value, digits in zip(row, DECIMALS, strict=False)]
            lines.append(f"| {' | '.join([name, what, f'{size_v:g} V', *cells])} | {row[-1]:+.2f} |")
    return lines


def summary_table(plants: dict[str, Figures]) -> list[str]:
    """A row a kind of line, a calibration and a plant: mean and worst over the sizes."""
    lines = [
        "| line | calibrated with | scanner | residual forward [%]: mean, worst | backward "
        "| scaling error forward [% p-p] | backward | size in the image [%] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, what in plants["default"]:
        for plant, found in plants.items():
            rows = found[name, what]
            if isinstance(rows, str):
                lines.append(f"| {name} | {what} | {plant} | {rows} | | | | |")
                continue
            columns = [[abs(value) for value in column] for column in zip(*rows, strict=True)]
            cells = [
                f"{sum(column) / len(column):.{digits}f}, {max(column):.{digits}f}"
                for column, digits in zip(columns, (*DECIMALS, 2), strict=True)
            ]
            lines.append(f"| {' | '.join([name, what, plant, *cells])} |")
    return lines


def map_table(example: Setup, scanner: VirtualScanner) -> list[str]:
    """A row an offset, before and after in each cell."""
    base = with_scan(example, size_v=20.0, rate_hz=EXAMPLE_RATE_HZ)
    setup = calibrate(base, scanner).setup
    before, after = size_map(uncorrected(setup), scanner), size_map(setup, scanner)
    nominal = [share * setup.scanner.x.size.k_nm_per_v * setup.scanner.v_max for share in MAP_SIZES]
    lines = [f"| offset | {' | '.join(f'{one:.0f} nm' for one in nominal)} |", "|---|---|---|---|---|---|"]
    for at, b, a in zip(OFFSETS, before, after, strict=True):
        cells = " | ".join(f"{x:+.1f} → {y:+.2f}" for x, y in zip(b, a, strict=True))
        lines.append(f"| {at * setup.scanner.v_max:g} V | {cells} |")
    return lines


def plants_table(example: Setup) -> list[str]:
    """The range over the sizes of the map, a row a plant and a column an offset, after its own calibration."""
    base = with_scan(example, size_v=20.0, rate_hz=EXAMPLE_RATE_HZ)
    v_max = base.scanner.v_max
    truth = load_truth()
    plants = (
        ("default", truth),
        ("duhem", load_truth("duhem")),
        ("the same printed numbers, without that choice", same_numbers(truth)),
        ("uniform density", uniform_density(truth)),
    )
    offsets = " | ".join(f"{at * v_max:g} V" for at in OFFSETS)
    lines = [f"| plant | {offsets} |", "|---|---|---|---|---|---|"]
    for name, one in plants:
        scanner = VirtualScanner.of(one)
        rows = size_map(calibrate(base, scanner).setup, scanner)
        lines.append(f"| {name} | {' | '.join(f'{row.min():+.1f} .. {row.max():+.1f}' for row in rows)} |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put the tables into {PAGE.name}")
    given = parser.parse_args()
    example = load(ROOT / "examples" / "annexin_200nm.toml")
    plants = {name: played_lines(example, scanner) for name, scanner in SCANNERS.items()}
    tables = [("summary", summary_table(plants)), ("plants", plants_table(example))]
    for name, scanner in SCANNERS.items():
        tables += [(f"measured {name}", loop_table(plants[name])), (f"map {name}", map_table(example, scanner))]
    page = PAGE.read_text("utf-8")
    for mark, table in tables:
        text = "\n".join(table) + "\n"
        print(text)
        marked = re.compile(rf"(?<=<!-- {mark} -->\n).*?(?=<!-- /{mark} -->)", re.DOTALL)
        page = marked.sub(lambda _, text=text: text, page, count=1)
    if given.write:
        PAGE.write_text(page, "utf-8")


if __name__ == "__main__":
    main()
