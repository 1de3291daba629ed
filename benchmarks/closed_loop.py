"""The closed loop on the virtual scanner, as tables for docs/virtual.md: a simulation.

``python benchmarks/closed_loop.py`` prints them, ``--write`` puts them into the page.
"""

import argparse
import os
import re
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from tablegen.config.load import Setup, load
from tablegen.config.schema import BandLimit
from tablegen.virtual.closed_loop import (
    MAP_SIZES,
    SHARP,
    SHARP_RATE_HZ,
    play_x,
    size_map,
    uncorrected,
    with_scan,
)
from tablegen.virtual.laboratory import OFFSETS, calibrate
from tablegen.virtual.other_plants import same_numbers, uniform_density
from tablegen.virtual.parameters import load_truth
from tablegen.virtual.scanner import VirtualScanner
from tablegen.virtual.simulation import with_model

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "virtual.md"
SCANNER = VirtualScanner.of(load_truth())
SIZES_V = (20.0, 40.0, 60.0, 80.0, 100.0)
EXAMPLE_RATE_HZ = 100.0


def row(setup: Setup, size_v: float, imaged: bool) -> str:
    """Largest residual and scaling error peak to peak of each direction."""
    run = play_x(setup, SCANNER)
    error = run.imaged if imaged else run.error
    cells = [f"{max(map(abs, getattr(error, side).residual_range)):.2f}" for side in ("forward", "backward")]
    cells += [f"{getattr(error, side).scaling_peak_to_peak:.1f}" for side in ("forward", "backward")]
    return " | ".join([f"{size_v:g} V", *cells, f"{run.size_error_percent:+.2f}"])


def loop_table(example: Setup) -> list[str]:
    """A row a kind of line, a calibration and a size."""
    lines = [
        "| line | calibrated with | scan | residual forward [%] | backward | scaling error forward [% p-p] "
        "| backward | size in the image [%] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    kinds: tuple[tuple[str, BandLimit, float, bool], ...] = (
        ("sharp", SHARP, SHARP_RATE_HZ, False),
        ("example", example.scan.x.band_limit, EXAMPLE_RATE_HZ, True),
    )
    for name, limit, rate, imaged in kinds:
        base = with_scan(example, size_v=50.0, rate_hz=rate, band_limit=limit)
        calibrations = [
            ("sensor", calibrate(base, SCANNER).setup),
            ("images", calibrate(base, SCANNER, images=True).setup),
        ]
        triangle = with_model(calibrations[0][1], "triangle")
        for what, setup in (("no hysteresis", triangle), *calibrations):
            for size_v in SIZES_V:
                lines.append(f"| {name} | {what} | {row(with_scan(setup, size_v=size_v), size_v, imaged)} |")
    return lines


def map_table(example: Setup) -> list[str]:
    """A row an offset, before and after in each cell."""
    base = with_scan(example, size_v=20.0, rate_hz=EXAMPLE_RATE_HZ)
    setup = calibrate(base, SCANNER).setup
    before, after = size_map(uncorrected(setup), SCANNER), size_map(setup, SCANNER)
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
        ("the virtual scanner", truth),
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
    page = PAGE.read_text("utf-8")
    tables = (("measured", loop_table(example)), ("map", map_table(example)), ("plants", plants_table(example)))
    for mark, table in tables:
        text = "\n".join(table) + "\n"
        print(text)
        marked = re.compile(rf"(?<=<!-- {mark} -->\n).*?(?=<!-- /{mark} -->)", re.DOTALL)
        page = marked.sub(lambda _, text=text: text, page, count=1)
    if given.write:
        PAGE.write_text(page, "utf-8")


if __name__ == "__main__":
    main()
