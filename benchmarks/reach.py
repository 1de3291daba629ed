"""What laws and operators leave on piezos that the project does not contain, as a table for docs/operator.md.

``python benchmarks/reach.py`` prints it, ``--write`` puts it into the page. Traces, sizes and responses of simulated
plants go through ``tablegen calibrate``; each scan is planned, its emitted 16-bit integers are held, and the plant that
they play is judged. The same drive unrounded is played too: what that leaves is the model's, and what the integers move
the line by beyond it is the converter's. A simulation.
"""

import argparse
import os
import re
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from click.testing import CliRunner

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "helpers"))

from foreign_plants import SIX, TEN, V_MAX, BoucWen, Floats, ForeignPlant, JilesAtherton, ManyPlays, record, triangle

from tablegen.base.input_errors import Rejected
from tablegen.certificate.expected import certified_expectation
from tablegen.certificate.line_errors import EmittedPeriod
from tablegen.cli import cli as tablegen
from tablegen.compensation.expectation import Expectation, Figure
from tablegen.config.load import Setup, load
from tablegen.numerics.arrays import Bools
from tablegen.planning.line_plan import make_plan
from tablegen.virtual.closed_loop import with_scan
from tablegen.virtual.played import played

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "operator.md"
MARK = "reach"
NOISE = 0.001
OFFSETS = (0.5, 0.7, 0.85)
SHARES = (0.15, 0.35, 0.6, 0.9)  # of the range that an offset leaves
RATES_HZ = (100.0, 1000.0)
WINDOW = (0.1, 0.9)
CHORD = 0.05  # of the line
SMALL = 0.1  # of v_max: strokes from which m of (1) comes
MEASURES = ("rms", "scaling", "mismatch", "size")
COLUMNS = (  # header, part of a scan, measure
    ("rms [%]", "left", "rms"),
    ("scaling p-p [%]", "left", "scaling"),
    ("scaling, unrounded", "unrounded", "scaling"),
    ("scaling, converter", "converter", "scaling"),
    ("mismatch [%]", "left", "mismatch"),
    ("size [%]", "left", "size"),
)

PLANTS = {  # kept aside: no constant of the operator was chosen on these
    "plays": (
        ForeignPlant(ManyPlays(seed=11), creep=0.024),
        ForeignPlant(ManyPlays(seed=12), creep=0.018),
        ForeignPlant(ManyPlays(seed=13, count=200), creep=0.03),
    ),
    "Bouc-Wen": (
        ForeignPlant(BoucWen(a=0.3, beta=5.0, gamma=-1.0, n=1.2, depth=0.7, asymmetry=-0.3, bend=0.2, skew=0.1), 0.022),
        ForeignPlant(BoucWen(a=0.4, beta=7.0, gamma=-2.5, n=1.5, depth=0.5, asymmetry=0.35, bend=0.05, skew=-0.1)),
    ),
    "Jiles-Atherton": (
        ForeignPlant(JilesAtherton()),
        ForeignPlant(JilesAtherton(0.45, 0.6, -0.1, 0.5, 0.45, 0.15), creep=0.03),
    ),
}
TUNED = {  # on these they were
    "plays": tuple(
        ForeignPlant(ManyPlays(seed=seed), creep=creep)
        for seed, creep in ((1, 0.026), (2, 0.02), (3, 0.032), (4, 0.028))
    ),
    "Bouc-Wen": (
        ForeignPlant(BoucWen()),
        ForeignPlant(BoucWen(beta=4.5, gamma=-1.0, n=1.0, asymmetry=0.3, bend=0.1), creep=0.02),
        ForeignPlant(BoucWen(beta=8.0, gamma=-3.0, n=1.6, depth=0.5, asymmetry=-0.4), creep=0.03),
    ),
}


@dataclass(frozen=True)
class Judged:
    """A scan on its plant, percent of the line: what it left, and what its certificate expected.

    ``left`` is that of the emitted integers, ``unrounded`` of the same drive without their steps, and ``converter`` of
    a straight line with what these steps move the plant by: what a perfect model would leave.
    """

    offset: float
    share: float
    rate_hz: float
    left: dict[str, float]
    unrounded: dict[str, float]
    converter: dict[str, float]
    expected: Expectation | None = None


def calibrated(plant: ForeignPlant, folder: Path, protocol: Sequence[tuple[float, float]] | None) -> Setup:
    """The example's scan with the plant's scanner file: of laws, or of an operator from a protocol's traces."""
    folder.mkdir(exist_ok=True)
    random = np.random.default_rng(99)
    scanner = folder / "scanner.toml"
    run("init", folder, "--force")

    def calibrate(kind: str, header: str, columns: Sequence[Floats], *options: str) -> None:
        run(
            "calibrate",
            kind,
            csv(folder / f"{kind}.csv", header, columns),
            "--axis",
            "x",
            *options,
            "--scanner",
            scanner,
        )

    strokes = np.array([0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.99])
    sizes = np.array([extent(plant, 0.5, stroke) for stroke in strokes]) * noisy(random, len(strokes))
    calibrate("size", "drive_v,actual_nm", (strokes * V_MAX, sizes), "--write")
    centres = np.linspace(0.1, 0.9, 9)
    lattice = np.array([20.0 / extent(plant, centre, SMALL) for centre in centres]) * noisy(random, len(centres))
    small = ("--size-v", f"{SMALL * V_MAX:g}", "--write", "--force")
    calibrate("offset", "offset_v,apparent_nm", (centres * V_MAX, lattice * extent(plant, 0.5, SMALL)), *small)
    f = np.geomspace(10.0, 2000.0, 15)
    calibrate("frequency", "frequency_hz,gain", (f, np.abs(plant.crept(f)) * noisy(random, len(f))), "--write")
    f = np.geomspace(50.0, 150e3, 400)
    response = plant.dynamics(f)
    gain, phase = np.abs(response) * noisy(random, len(f)), np.unwrap(np.angle(response, deg=True), period=360.0)
    calibrate("resonance", "frequency_hz,gain,phase_deg", (f, gain, phase), "--points", "--write")

    def traces(kind: str, lines: Sequence[tuple[float, float]]) -> list[Path]:
        columns = [record(plant, centre, stroke, seed=i, noise=NOISE) for i, (centre, stroke) in enumerate(lines)]
        header = "time_s,drive_v,displacement_nm"
        return [csv(folder / f"{kind}_{i}.csv", header, one) for i, one in enumerate(columns)]

    def identify(kind: str, files: Sequence[Path], *options: str) -> None:
        run("calibrate", kind, *files, "--axis", "x", *options, "--scanner", scanner, "--write")

    identify("hysteresis", traces("hysteresis", SIX), "--delay-s", "fit", "--force")
    if protocol is not None:
        identify("operator", traces("operator", protocol))
    return load(folder / "annexin_200nm.toml")


def run(*arguments: object) -> None:
    """A command of tablegen, in this process."""
    result = CliRunner().invoke(tablegen, [str(one) for one in arguments])
    if result.exit_code:
        raise SystemExit(f"tablegen {' '.join(map(str, arguments))}: {result.output} {result.exception!r}")


def csv(path: Path, header: str, columns: Sequence[Floats]) -> Path:
    np.savetxt(path, np.stack(columns, axis=1), delimiter=",", header=header, comments="", fmt="%.9g")
    return path


def noisy(random: np.random.Generator, count: int) -> Floats:
    return 1.0 + NOISE * random.standard_normal(count)


def extent(plant: ForeignPlant, centre: float, stroke: float) -> float:
    return float(np.ptp(plant.settled(triangle(1000, centre, stroke), RATES_HZ[0])))


def judge(setup: Setup, plant: ForeignPlant, offset: float, share: float, rate_hz: float) -> Judged:
    """Plan a scan, hold its codes, play them, and compare with the line that was asked for."""
    size_nm = share * extent(plant, offset, 0.995 * 2.0 * min(offset, 1.0 - offset))
    try:
        line = make_plan(with_scan(setup, size_nm=size_nm, offset_v=offset * V_MAX, rate_hz=rate_hz)).x
    except Rejected as rejected:
        raise SystemExit(f"{offset:g}, {share:g}, {rate_hz:g} Hz: {rejected}") from None
    drive = played(line)
    turn, t = line.drive.shape.turn, drive.turns
    x = np.where(t <= turn, t / turn, (1.0 - t) / (1.0 - turn))
    exact = line.converter.v_zero + line.converter.v_per_code * line.float_codes(line.series.on_grid(len(t)))
    moved, smooth = (settled(plant, volts, drive.period_s) for volts in (drive.volts, exact))
    ideal = size_nm * x
    return Judged(
        offset,
        share,
        rate_hz,
        *(measures(x, t <= turn, position, size_nm) for position in (moved, smooth, ideal + moved - smooth)),
        certified_expectation(line, EmittedPeriod(line)),
    )


def settled(plant: ForeignPlant, volts: Floats, period_s: float) -> Floats:
    """nm in the middle of every tick, of volts that are held for a tick each."""
    moved = np.fft.rfft(plant.settled(volts, 1.0 / period_s))
    return np.fft.irfft(moved * np.sinc(np.arange(len(moved)) / len(volts)), len(volts))


def measures(x: Floats, going: Bools, position: Floats, size_nm: float) -> dict[str, float]:
    """What positions in nm leave of the line that was asked for, along x."""
    inside = (x >= WINDOW[0]) & (x <= WINDOW[1])
    slope, start = np.polyfit(x[inside], position[inside], 1)
    error = 100.0 * ((position - start) / slope - x)
    grid = np.linspace(*WINDOW, 401)
    sides = []
    for side in (going, ~going):
        order = np.argsort(x[side])
        sides.append(np.interp(grid, x[side][order], error[side][order]))
    step = round(CHORD / (grid[1] - grid[0]))
    return {
        "rms": max(float(np.sqrt(np.mean(one * one))) for one in sides),
        "scaling": max(float(np.ptp(one[step:] - one[:-step])) / (grid[step] - grid[0]) for one in sides),
        "mismatch": float(np.max(np.abs(sides[0] - sides[1]))),
        "size": 100.0 * (slope / size_nm - 1.0),
    }


def scans(setup: Setup, plant: ForeignPlant) -> Iterator[Judged]:
    for offset in OFFSETS:
        for share in SHARES:
            for rate_hz in RATES_HZ:
                yield judge(setup, plant, offset, share, rate_hz)


METHODS = (("laws", None), ("six traces at 50 V", SIX), ("ten traces", TEN))


def measured(kind: str, plants: Sequence[ForeignPlant], chatty: bool) -> dict[str, list[Judged]]:
    """What every method leaves of every scan, over all plants of a kind."""
    found: dict[str, list[Judged]] = {name: [] for name, _ in METHODS}
    for number, plant in enumerate(plants):
        for name, protocol in METHODS:
            with tempfile.TemporaryDirectory() as folder:
                setup = calibrated(plant, Path(folder), protocol)
                for one in scans(setup, plant):
                    found[name].append(one)
                    if chatty:
                        left = "  ".join(f"{head} {getattr(one, part)[of]:6.3f}" for head, part, of in COLUMNS)
                        print(f"{kind} {number}  {name:18}  {one.offset:4g}  {one.share:4g}  {one.rate_hz:5g}  {left}")
    return found


def table(kinds: dict[str, dict[str, list[Judged]]]) -> list[str]:
    """A row a kind of plant, a method and an offset: worst and mean over plants, sizes and rates."""
    out = [
        f"| plant | scanner file | offset | {' | '.join(head for head, _, _ in COLUMNS)} |",
        "|---" * (3 + len(COLUMNS)) + "|",
    ]
    for kind, methods in kinds.items():
        for name, judged in methods.items():
            for offset in OFFSETS:
                here = [one for one in judged if one.offset == offset]
                cells = []
                for _, part, measure in COLUMNS:
                    values = np.abs([getattr(one, part)[measure] for one in here])
                    cells.append(f"{np.max(values):.2f} ({np.mean(values):.2f})")
                out.append(f"| {kind} | {name} | {offset * V_MAX:g} V | {' | '.join(cells)} |")
    return out


def figures_of(expected: Expectation, measure: str) -> list[Figure]:
    """Those of a measure that have an uncertainty."""
    found = getattr(expected, measure)
    figures = found.values() if measure in ("rms", "scaling") else [found]
    return [one for one in figures if one is not None and one.uncertainty is not None]


def worse(kinds: dict[str, dict[str, list[Judged]]]) -> list[str]:
    """How many scans an operator makes worse than the laws do, and by how much at most; unrounded too."""
    out = []
    laws = METHODS[0][0]
    for kind, methods in kinds.items():
        for name, judged in methods.items():
            for part in ("left", "unrounded") if name != laws else ():
                for measure in MEASURES[:3]:
                    pairs = zip(methods[laws], judged, strict=True)
                    ratios = [getattr(b, part)[measure] / getattr(a, part)[measure] for a, b in pairs]
                    above = sum(ratio > 1.0 for ratio in ratios)
                    of = f"{kind}, {name}: {measure}{' unrounded' if part == 'unrounded' else ''}"
                    out.append(
                        f"{of}: {above} of {len(ratios)} worse than laws, at most {max(ratios):.2f} times; "
                        f"the geometric mean is {np.exp(np.mean(np.log(ratios))):.2f} of theirs"
                    )
    return out


def coverage(kinds: dict[str, dict[str, list[Judged]]]) -> list[str]:
    """How often what is left lies below what was expected and its uncertainty together."""
    out = []
    for kind, methods in kinds.items():
        for name, judged in methods.items():
            shares = []
            for measure in MEASURES:
                inside = []
                for one in judged:
                    figures = [] if one.expected is None else figures_of(one.expected, measure)
                    if figures:
                        most = max(abs(figure.value) + (figure.uncertainty or 0.0) for figure in figures)
                        inside.append(abs(one.left[measure]) <= most)
                if inside:
                    shares.append(f"{measure} {100.0 * np.mean(inside):.0f} %")
            if shares:
                out.append(f"{kind}, {name}: {', '.join(shares)}")
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE.name}")
    parser.add_argument("--every", action="store_true", help="print every scan")
    parser.add_argument("--tuned", action="store_true", help="the plants on which constants were chosen instead")
    parser.add_argument("--plants", type=int, default=9, help="at most so many of each kind")
    given = parser.parse_args()
    chosen = TUNED if given.tuned else PLANTS
    kinds = {kind: measured(kind, plants[: given.plants], given.every) for kind, plants in chosen.items()}
    text = "\n".join(table(kinds)) + "\n"
    print(text)
    print("\n".join(worse(kinds)))
    print("\n".join(["", "expected and its uncertainty cover:", *coverage(kinds)]))
    if given.write and not given.tuned:
        page = PAGE.read_text("utf-8")
        if f"<!-- {MARK} -->" not in page:
            page += f"\n<!-- {MARK} -->\n<!-- /{MARK} -->\n"
        marked = re.compile(rf"(?<=<!-- {MARK} -->\n).*?(?=<!-- /{MARK} -->)", re.DOTALL)
        PAGE.write_text(marked.sub(lambda _: text, page, count=1), "utf-8")


if __name__ == "__main__":
    main()
