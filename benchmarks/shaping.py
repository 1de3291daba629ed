"""What shaped output leaves behind scanners of three resonances, its idle tones, and small lines on simulated piezos.

``python benchmarks/shaping.py`` prints the tables, ``--write`` puts them into docs/shaping.md. All codes are the
emitted ones of plans. ``--plants`` measures simulated piezos too, which takes minutes of calibrations.
"""

import argparse
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from msgspec.structs import replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import msgspec
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "helpers"))

import reach
from building import Variant, write_variant
from foreign_plants import TEN, V_MAX

from tablegen.certificate.line_errors import EmittedPeriod, TickErrors, tick_scaling
from tablegen.certificate.shaped_periods import errors_behind_response
from tablegen.compensation.dynamics import SecondOrder
from tablegen.config.load import Setup, load
from tablegen.fixedpoint.shaping import Remainders, Shaping, remainder_bits
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan, make_plan
from tablegen.planning.shaping_choice import best_shaping
from tablegen.virtual.closed_loop import with_scan

PAGE = Path(__file__).parent.parent / "docs" / "shaping.md"
SHAPINGS = ("off", "first", "second", "scanner")
RATE_HZ = 500e3
LINES = 17  # that are played; the first is left out
WIDE = {"x.size.k_nm_per_v": 1000.0, "x.size.base_nm": 1000.0}  # 100 um over the driver's range
SCANNERS: tuple[tuple[str, float, float, dict[str, object], dict[str, object]], ...] = (
    ("40 kHz, Q 20, 20 nm", 40e3, 20.0, {}, {}),
    ("10 kHz, Q 20, 20 nm", 10e3, 20.0, {}, {}),
    ("1 kHz, Q 10, 100 nm of 100 um at 20 Hz", 1e3, 10.0, {"x.size_nm": 100.0, "timing.line_rate_hz": 20.0}, WIDE),
)
TABLES = (("interpolated", 16384, 24), ("interpolated", 2048, 16), ("cubic", 256, 21))
TONE_VALUES = 257  # constants between two codes
TONE_TICKS = 1 << 16
RAMP_TICKS = 1 << 15  # in which the slow ramp moves by one code


def planned(shaping: str, table: tuple[str, int, int], scanner: int) -> LinePlan:
    """The fast axis of the example on one of the scanners."""
    _, hz, quality, scan, changes = SCANNERS[scanner]
    wanted = {"x.size_nm": 20.0, "timing.lines": 40} | scan
    wanted |= dict(zip(("x.table.mode", "x.table.length", "x.table.bits"), table, strict=True))
    resonance = {"frequency_hz": hz, "quality": quality, "max_boost_db": 6.0}
    variant = Variant(wanted, {"x.resonance": resonance, "x.dac": {"shaping": shaping}} | changes)
    with tempfile.TemporaryDirectory() as folder:
        return make_plan(load(write_variant(Path(folder), variant))).x


def judged(line: LinePlan) -> tuple[float, float, float]:
    """Rms of the position about its mean in LSB; scaling errors of the worst line, and their mean, in percent."""
    ticks = line.program.ticks
    exact = EmittedPeriod(replace(line, program=line.program.rounded))
    k = np.arange(ticks)
    asked = line.program.rounded.codes(k) - exact.errors(k)
    errors = (line.program.played(0, LINES * ticks).reshape(LINES, ticks) - asked).reshape(-1)
    lines = errors_behind_response(line, errors).reshape(LINES, ticks)[1:]
    shape = line.drive.shape
    scaling = [
        max(
            tick_scaling(line, exact, side, branch, TickErrors(one))
            for side, branch in (("forward", shape.forward), ("backward", shape.backward))
        )
        for one in lines
    ]
    return float(np.std(lines)), max(scaling), float(np.mean(scaling))


def cell(line: LinePlan) -> str:
    """What was judged, as the page has it."""
    rms, worst, mean = judged(line)
    return f"{rms:.2g} LSB, {worst:.2g} % ({mean:.2g})"


def scanners() -> Iterator[str]:
    """A row a scanner and a table: rms, and scaling errors of the worst line and in the mean."""
    yield f"| scanner | table | {' | '.join(SHAPINGS)} |"
    yield "|---" * (2 + len(SHAPINGS)) + "|"
    for number, (name, *_) in enumerate(SCANNERS):
        for table in TABLES:
            cells = [cell(planned(shaping, table, number)) for shaping in SHAPINGS]
            yield f"| {name} | {table[0]}, {table[1]} x {table[2]} | {' | '.join(cells)} |"


def tones() -> Iterator[str]:
    """The largest single tone behind each scanner, of constants between two codes and of a slow ramp."""
    yield "| scanner | shaping | constants: worst tone [LSB] | at | slow ramp: worst tone [LSB] | at |"
    yield "|---|---|---|---|---|---|"
    bits = remainder_bits(16)
    constants = [(TONE_VALUES // 2 << bits) + (number << bits) // TONE_VALUES for number in range(TONE_VALUES)]
    for name, hz, quality, *_ in SCANNERS:
        response = SecondOrder(hz, quality)
        for shaping in (Shaping(1), Shaping(2), best_shaping(response, RATE_HZ)):
            found = [worst_tone(np.full(TONE_TICKS, value), shaping, response) for value in constants]
            ramp = (np.arange(TONE_TICKS) << bits) // RAMP_TICKS
            cells = [f"{size:.2g} | {at:.3g} Hz" for size, at in (max(found), worst_tone(ramp, shaping, response))]
            order = f"order {shaping.order}" + (f", zero {shaping.zero}" if shaping.order == 3 else "")
            yield f"| {name.split(', 20')[0].split(', 100')[0]} | {order} | {' | '.join(cells)} |"


def worst_tone(values: np.ndarray, shaping: Shaping, response: SecondOrder) -> tuple[float, float]:
    """Amplitude in LSB and frequency of the largest line of the spectrum of the errors behind a response."""
    bits = remainder_bits(16)
    half = 1 << (bits - 1)
    codes = Remainders(shaping, bits).codes(values + half)
    error: Floats = codes - values / float(1 << bits)
    window = np.hanning(len(error))
    spectrum = np.abs(np.fft.rfft((error - np.mean(error)) * window)) * 2.0 / np.sum(window)
    f = np.fft.rfftfreq(len(error), 1.0 / RATE_HZ)
    real, imaginary = response.inverse(f)
    spectrum /= np.hypot(real, imaginary)
    spectrum[:3] = 0.0  # the mean, which the window spreads
    at = int(np.argmax(spectrum))
    return float(spectrum[at]), float(f[at])


def small_lines() -> Iterator[str]:
    """The smallest lines at 85 V and 1 kHz on operators of ten traces: what their converter's steps leave."""
    yield "| plant | rounded: scaling, of the converter [%] | shaped: scaling, of the converter [%] | unrounded [%] |"
    yield "|---|---|---|---|"
    for kind, plants in reach.PLANTS.items():
        for number, plant in enumerate(plants):
            with tempfile.TemporaryDirectory() as folder:
                setup = without_y(reach.calibrated(plant, Path(folder), TEN))
                rounded, shaped = (lines_on(plant, one) for one in (setup, with_shaping(setup)))
            cells = [f"{one[0]:.2f}, {one[1]:.2f}" for one in (rounded, shaped)]
            yield f"| {kind} {number + 1} | {' | '.join(cells)} | {rounded[2]:.2f} |"


def without_y(setup: Setup) -> Setup:
    """The same with a slow axis that takes no operator from the fast one."""
    y = msgspec.structs.replace(setup.scanner.y, hysteresis=None)
    return replace(setup, scanner=msgspec.structs.replace(setup.scanner, y=y))


def with_shaping(setup: Setup) -> Setup:
    """The same with the fast axis shaped by its response."""
    x = setup.scanner.x
    dac = msgspec.structs.replace(x.dac, shaping="scanner")
    scanner = msgspec.structs.replace(setup.scanner, x=msgspec.structs.replace(x, dac=dac))
    return replace(setup, scanner=scanner)


def lines_on(plant: reach.ForeignPlant, setup: Setup) -> tuple[float, float, float]:
    """The worst scaling error of some lines; what the converter makes of it; and that without its steps."""
    offset, share, rate_hz = reach.OFFSETS[-1], reach.SHARES[0], reach.RATES_HZ[-1]
    size_nm = share * reach.extent(plant, offset, 0.995 * 2.0 * min(offset, 1.0 - offset))
    line = make_plan(with_scan(setup, size_nm=size_nm, offset_v=offset * V_MAX, rate_hz=rate_hz)).x
    ticks, turn = line.program.ticks, line.drive.shape.turn
    t = (np.arange(ticks) + 0.5) / ticks
    x = np.where(t <= turn, t / turn, (1.0 - t) / (1.0 - turn))
    exact = line.converter.v_zero + line.converter.v_per_code * line.float_codes(line.series.on_grid(ticks))
    smooth = reach.settled(plant, exact, ticks / RATE_HZ)
    worst, converter = 0.0, 0.0
    for number in range(1, 9 if line.program.output.shaping.order else 2):
        codes = line.program.played(number * ticks, (number + 1) * ticks)
        volts = line.converter.v_zero + line.converter.v_per_code * codes
        moved = reach.settled(plant, volts, ticks / RATE_HZ)
        worst = max(worst, reach.measures(x, t <= turn, moved, size_nm)["scaling"])
        converter = max(converter, reach.measures(x, t <= turn, size_nm * x + moved - smooth, size_nm)["scaling"])
    return worst, converter, reach.measures(x, t <= turn, smooth, size_nm)["scaling"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put the tables into {PAGE.name}")
    parser.add_argument("--plants", action="store_true", help="the simulated piezos too")
    given = parser.parse_args()
    parts = {"scanners": scanners, "tones": tones} | ({"small lines": small_lines} if given.plants else {})
    for mark, rows in parts.items():
        text = "\n".join(rows()) + "\n"
        print(text, flush=True)
        if given.write:
            page = PAGE.read_text("utf-8")
            marked = re.compile(rf"(?<=<!-- {mark} -->\n).*?(?=<!-- /{mark} -->)", re.DOTALL)
            PAGE.write_text(marked.sub(lambda _, text=text: text, page, count=1), "utf-8")


if __name__ == "__main__":
    main()
