"""A scan images a lattice: sequencer, virtual scanner, ADC and ``adc_pixels`` together give the picture of the plan.

The simulation is run twice. The codes of the first run move the virtual scanner; what an ADC samples of a lattice there
is the input of the second. The picture is compared with one that is computed from the plan alone.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from building import BENCHES, Build
from short_scans import short
from test_lint import ADC
from test_top import runtime

from tablegen.device.adc_pixels import pixel_dtype, pixel_picture
from tablegen.device.schedule import Window, pixel_starts
from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.line_plan import LinePlan
from tablegen.verification.verilog.simulate import CompiledDesign, Design, compile_design
from tablegen.virtual.imaging import Conditions, hexagonal, running_frame
from tablegen.virtual.parameters import load_truth
from tablegen.virtual.scanner import VirtualAxis, VirtualScanner

pytestmark = pytest.mark.rest

SCAN: dict[str, object] = {
    "timing": {"pixels": 24, "lines": 12, "line_rate_hz": 1500.0, "ticks_per_line": 192},
    "x.size_nm": 60.0,
    "y.size_nm": 60.0,
}
LATTICE = hexagonal(24.0)
FULL_SCALE = 4.0  # height of the largest sample, above that of the lattice
CLOCKS_PER_TICK = 8
# In clocks, both together more than a pixel of 25 clocks: from the strobe to the converter's output, and of the ADC.
CONVERTER_LATENCY, ADC_LATENCY, ADC_CLOCKS = 13, 38, 3
LATENCY = CONVERTER_LATENCY + ADC_LATENCY


@dataclass(frozen=True)
class Setup:
    """A build, and the number of ticks that is played of it: two frames and a line."""

    built: Build
    scanner: VirtualScanner

    @property
    def ticks(self) -> int:
        """The ticks that are played."""
        schedule = self.built.plan.schedule
        return 2 * schedule.frame_ticks + schedule.ticks

    @property
    def conversions(self) -> int:
        """The conversions of the ADC, with those during the boot."""
        return (self.ticks + 2000) * CLOCKS_PER_TICK // ADC_CLOCKS


@dataclass(frozen=True)
class Run:
    """The ticks that were played, and the words that came out."""

    clocks: Ints
    codes: Ints  # (ticks, 2)
    words: npt.NDArray[np.void]


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    return Setup(short(tmp_path_factory.mktemp("scan"), SCAN), VirtualScanner.of(load_truth()))


def compiled(setup: Setup, folder: Path, delay: int) -> CompiledDesign:
    sources = [BENCHES / "adc_picture_bench.v", *runtime(setup.built), *sorted(ADC.glob("*.v"))]
    parameters = {
        "TICKS": setup.ticks,
        "CLOCKS_PER_TICK": CLOCKS_PER_TICK,
        "DELAY": delay,
        "ADC_CLOCKS": ADC_CLOCKS,
        "ADC_LATENCY": ADC_LATENCY,
        "CONVERSIONS": setup.conversions,
    }
    design = compile_design("icarus", Design(sources, "adc_picture_bench", parameters), folder)
    for path in setup.built.folder.glob("*.mem"):
        (folder / path.name).write_bytes(path.read_bytes())
    return design


def played(design: CompiledDesign, samples: Ints) -> Run:
    lines = [f"{sample & 0xFFFF:04x}\n" for sample in samples.tolist()]
    (design.folder / "samples.hex").write_text("".join(lines), "ascii")
    assert design.run("cocotb_adc_pixels", {"PAUSES": "0.5"}) == (1, 0)
    rows = np.loadtxt(design.folder / "ticks.txt", dtype=np.int64)
    assert rows[-1].tolist() == [0, 0, 0], "missing and refused, faults, words that were lost"
    frames = json.loads((design.folder / "received.json").read_text("ascii"))
    words = np.frombuffer(b"".join(map(bytes, frames)), pixel_dtype())
    return Run(rows[:-1, 0], rows[:-1, 1:], words)


def moved(line: LinePlan, axis: VirtualAxis, codes: Ints) -> Floats:
    """Return where an axis is in the middle of each tick of a period of codes, settled."""
    volts = line.converter.v_zero + line.converter.v_per_code * codes
    return axis.settled(volts, 1.0 / (float(line.rate) * len(codes)))


def heights(x_nm: Floats, y_nm: Floats, ticks: Floats) -> Floats:
    """Return the lattice under the tip at times in ticks since the start of a frame."""
    places = [np.interp(ticks, np.arange(len(nm)) + 0.5, nm, period=len(nm)) for nm in (x_nm, y_nm)]
    return LATTICE(*places)


def sampled(setup: Setup, run: Run) -> Ints:
    """Convert what is under the tip at each conversion, by the codes of the second frame that was played."""
    schedule, plan = setup.built.plan.schedule, setup.built.plan
    frame = run.codes[schedule.frame_ticks : 2 * schedule.frame_ticks]
    x_nm = moved(plan.x, setup.scanner.x, frame[: schedule.ticks, 0])
    y_nm = moved(plan.y, setup.scanner.y, frame[:, 1])
    clocks = ADC_CLOCKS * np.arange(setup.conversions)
    ticks = (clocks - run.clocks[0] - CONVERTER_LATENCY) / CLOCKS_PER_TICK
    return np.rint(heights(x_nm, y_nm, ticks) / FULL_SCALE * 32767).astype(np.int64)


def planned(setup: Setup, window: Window, late_clocks: float = 0.0) -> Floats:
    """Return the picture of the plan: the mean over each pixel of its ticks, at 16 instants each."""
    plan, schedule = setup.built.plan, setup.built.plan.schedule
    x_nm, y_nm = (
        moved(line, axis, line.codes(0, line.program.ticks))
        for line, axis in ((plan.x, setup.scanner.x), (plan.y, setup.scanner.y))
    )
    lines = schedule.ticks * np.arange(schedule.up.first, schedule.up.stop)[:, None]
    ticks = window.first + (np.arange(16 * window.count) + 0.5) / 16
    instants = heights(x_nm, y_nm, lines + ticks - late_clocks / CLOCKS_PER_TICK)
    starts = 16 * (pixel_starts(window, schedule.pixels) - window.first)
    picture: Floats = np.add.reduceat(instants, starts, axis=1) / np.diff(starts, append=16 * window.count)
    return picture


def pictures(setup: Setup, run: Run) -> tuple[Floats, Floats]:
    """Return the trace and the retrace of the second frame, in the order of time."""
    schedule = setup.built.plan.schedule
    starts = np.flatnonzero(run.words["flags"] & 4)
    assert len(starts) >= 2
    frame = run.words[starts[1] : starts[2] if len(starts) > 2 else None]
    lines = range(schedule.up.first, schedule.up.stop)
    trace, retrace = (pixel_picture(frame, lines, schedule.pixels, backward) for backward in (False, True))
    return trace * (FULL_SCALE / 32767), retrace * (FULL_SCALE / 32767)


def displacement(setup: Setup, window: Window, picture: Floats) -> int:
    """Return by how many clocks a picture is late against the plan, to a clock.

    Samples are taken at edges of the clock, the first one where a pixel begins: on average half a clock early.
    """
    errors = [float(np.std(planned(setup, window, late + 0.5) - picture)) for late in range(-20, 80)]
    return int(np.argmin(errors)) - 20


@pytest.fixture(scope="module")
def delayed(setup: Setup, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The second run, its markers delayed by the latency."""
    design = compiled(setup, tmp_path_factory.mktemp("delayed"), LATENCY)
    first = played(design, np.zeros(setup.conversions, np.int64))
    second = played(design, sampled(setup, first))
    assert second.clocks.tolist() == first.clocks.tolist()
    assert second.codes.tolist() == first.codes.tolist()
    return second


def test_the_sequencer_plays_the_codes_of_the_plan(setup: Setup, delayed: Run) -> None:
    plan, schedule = setup.built.plan, setup.built.plan.schedule
    frame = delayed.codes[schedule.frame_ticks : 2 * schedule.frame_ticks]
    assert frame[:, 0].tolist() == plan.x.codes(0, schedule.ticks).tolist() * schedule.lines
    assert frame[:, 1].tolist() == plan.y.codes(0, schedule.frame_ticks).tolist()


def test_the_picture_is_that_of_the_plan(setup: Setup, delayed: Run) -> None:
    """Trace and retrace, to a hundredth of the contrast: what nine samples differ from the mean over their time."""
    schedule = setup.built.plan.schedule
    for window, picture in zip((schedule.forward, schedule.backward), pictures(setup, delayed), strict=True):
        wanted = planned(setup, window, 0.5)
        assert np.max(np.abs(picture - wanted)) < 0.011 * np.ptp(wanted)
        assert displacement(setup, window, picture) == 0


def test_it_is_the_picture_of_a_simulated_frame(setup: Setup, delayed: Run) -> None:
    """That of ``running_frame`` has the heights in the middle of equal pixels, the left end first."""
    scanner = setup.scanner
    frame = running_frame(setup.built.plan, scanner.x, scanner.y, LATTICE, Conditions(noise=0.0))
    trace, retrace = pictures(setup, delayed)
    for picture, image in ((trace, frame.trace), (retrace[:, ::-1], frame.retrace)):
        assert np.std(picture - image.heights) < 0.1 * np.std(image.heights)


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_without_the_delay_it_is_displaced_by_the_latency(setup: Setup, delayed: Run, tmp_path: Path) -> None:
    undelayed = played(compiled(setup, tmp_path, 0), sampled(setup, delayed))
    schedule = setup.built.plan.schedule
    for window, picture in zip((schedule.forward, schedule.backward), pictures(setup, undelayed), strict=True):
        assert displacement(setup, window, picture) == LATENCY
        assert np.std(picture - planned(setup, window)) > 0.3 * np.std(picture)
