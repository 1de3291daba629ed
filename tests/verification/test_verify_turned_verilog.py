"""The Verilog of a scan at an angle: its emitted top plays whole frames of the model, and tampering is found.

The frame is about as small as a plan can be: 12 lines of 24 ticks, each so short that the sequencer needs more clocks
a tick than with longer lines.
"""

from collections.abc import Callable
from pathlib import Path
from shutil import copytree

import pytest
from replacing import replace
from sets import long
from test_verify_turned import NAME, edit, signed, word
from tilted_scans import write_tilted
from turned_scans import turned_setup

from tablegen.api.turned import TurnedBuild, build_turned
from tablegen.base.input_errors import Problems, Rejected
from tablegen.device.clocks import least_slow_clocks
from tablegen.manifest.read import NotABuild
from tablegen.manifest.turned import read_turned
from tablegen.planning.clock import slow_clocks_per_tick
from tablegen.verification.build_report import Report
from tablegen.verification.run import verify
from tablegen.verification.verilog import turned_play
from tablegen.verification.verilog.outputs import OUTPUTS

pytestmark = pytest.mark.common

SMALL = (
    "timing.lines = 12", "timing.pixels = 4", "timing.line_rate_hz = 400", "dac.update_rate_hz = 9600",
    "x.band_limit.harmonics = 8",
)  # fmt: skip
CLOCKS = 103  # a tick at least, of these lines; of longer ones 93
TICKS = 12 * 24
PART = 30  # ticks that show what does not take a frame


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> TurnedBuild:
    """The plan, in both formats, at the slowest clock that plays it."""
    emit = f"+ [emit]\nformats = ['c', 'verilog']\nclock_hz = {CLOCKS * 9600}"
    return build_turned(turned_setup(tmp_path_factory.mktemp("planned"), 30.0, *SMALL, emit))


@pytest.fixture(scope="module")
def build(planned: TurnedBuild, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("turned") / "out"
    planned.write(folder)
    return folder


def subjects(report: Report) -> list[str]:
    return [check.subject for check in report.checks]


def test_a_frame_and_the_start_of_the_next_are_those_of_the_model(build: Path) -> None:
    """From power-up on, with ticks as close to each other as the header says."""
    report = verify(build)
    assert report.failures == []
    assert report.notes == []
    header, top = report.checks[-2:]
    assert header.subject == "verilog header"
    stored = read_turned(build)
    assert stored.program.schedule.frame_ticks == TICKS
    assert top.compared == f"{2 * (64 + 64 + 2 * 13 + 64) + 48} words booted, {TICKS + 24} ticks"
    assert stored.manifest.formats == ["c", "verilog"]
    assert stored.manifest.clocks_per_tick == least_slow_clocks(stored.program) == CLOCKS


def test_the_outputs_around_its_top_are_played_too(tmp_path: Path) -> None:
    formats = ["verilog", *OUTPUTS]
    build_turned(turned_setup(tmp_path, 30.0, *SMALL, f"+ [emit]\nformats = {formats}")).write(tmp_path / "out")
    report = verify(tmp_path / "out", ticks=PART)
    assert report.failures == []
    assert subjects(report)[-3:] == ["top", *OUTPUTS]
    swap = edit(f"{NAME}_spi.v", ".mosi_x(mosi_x), .mosi_y(mosi_y)", ".mosi_x(mosi_y), .mosi_y(mosi_x)")
    swap(tmp_path / "out")
    failures = [one for one in verify(tmp_path / "out", ticks=PART).failures if "tick" in one]
    assert len(failures) == 1
    assert failures[0].startswith(f"{NAME}_spi.v: tick 1 differs from the model")


@pytest.mark.rest
def test_fewer_clocks_a_tick_lose_ticks(build: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """93 are enough for an axis, but not for lines of 24 ticks: the next one is not worked out in time."""
    monkeypatch.setattr(turned_play, "least_slow_clocks", lambda _: 93)
    (failure,) = verify(build).failures
    assert f"{NAME}_top.v: tick " in failure
    assert "overrun" in failure or "faults 01" in failure or "nothing" in failure, failure


def test_files_of_both_formats_are_compared(build: Path) -> None:
    report = verify(build, "files")
    assert report.failures == []
    assert {"c files", "verilog files"} <= set(subjects(report))


def memory_word(file: str, at: int) -> Callable[[Path], None]:
    """Change the lowest bit of a word of a memory file."""

    def do(folder: Path) -> None:
        path = folder / f"{NAME}_{file}.mem"
        words = path.read_text("ascii").split()
        digits = len(words[at])
        words[at] = f"{int(words[at], 16) ^ 1:0{digits}x}"
        path.write_text("".join(f"{one}\n" for one in words), "ascii")

    return do


def cut(file: str, words: int) -> Callable[[Path], None]:
    """Leave so many words of a memory file."""

    def do(folder: Path) -> None:
        path = folder / f"{NAME}_{file}.mem"
        path.write_text("".join(path.read_text("ascii").splitlines(keepends=True)[:words]), "ascii")

    return do


TOP = f"{NAME}_top.v"
CODING, BEHIND = ".TWOS_COMPLEMENT(", "), .LEFT_ALIGNED(0)\n    ) y_"
# A word of x in the memory of slow parts: 64 of the second table, 64 of the slow one, 13 gains, 13 ratios.
TAMPERING: dict[str, tuple[Callable[[Path], None], str]] = {
    "a word of the second table": (memory_word("slow", 63), "write 63 of its boot is"),
    "a slow word": (memory_word("slow", 64), "write 64 of its boot is"),
    "a gain": (memory_word("slow", 130), "write 130 of its boot is"),
    "a ratio of y": (memory_word("slow", 300), "write 300 of its boot is"),
    "an offset": (memory_word("program", 16 + 4), "at address 20 of region 0"),
    "the spacing of the knots": (memory_word("program", 32 + 13), "at address 45 of region 0"),
    "a word of the table": (memory_word("y", 5), "at address 5 of region 2"),
    "a short memory": (cut("slow", 200), "of its boot is undefined"),
    "a number of knots": (edit(TOP, ".X_KNOTS(13)", ".X_KNOTS(12)"), "of its boot is"),
    "a coding": (edit(TOP, f"{CODING}0{BEHIND}", f"{CODING}1{BEHIND}"), "words 0x"),
    "no slow part": (edit(TOP, ".SLOW_PART(1)", ".SLOW_PART(0)"), "the end with refused"),
    "a word of the manifest": (word("turned", "axes", "x", "slow", "words", 7), "of its boot is"),
    "a constant": (edit(f"{NAME}.vh", "_CLOCKS = 32'sd", "_CLOCKS = 32'sd1"), "_CLOCKS is 1103 to the simulator"),
}  # fmt: skip


@pytest.mark.parametrize("what", TAMPERING)
def test_tampering_is_found_in_the_files(what: str, build: Path, tmp_path: Path) -> None:
    """Though hash and digests are made right again."""
    copytree(build, tmp_path / "out")
    TAMPERING[what][0](tmp_path / "out")
    signed(tmp_path / "out")
    failures = verify(tmp_path / "out", "files").failures
    assert any(failure.startswith("verilog files: ") for failure in failures), failures


PLAYED = (
    "a slow word", "a gain", "a ratio of y", "an offset", "a short memory", "a number of knots", "a coding",
    "a constant",
)  # fmt: skip


@pytest.mark.rest
@pytest.mark.parametrize("what", long(["a slow word", "an offset", "a short memory", "a coding"], PLAYED))
def test_tampering_is_found_in_what_is_booted_and_played(what: str, build: Path, tmp_path: Path) -> None:
    change, says = TAMPERING[what]
    copytree(build, tmp_path / "out")
    change(tmp_path / "out")
    signed(tmp_path / "out")
    report = verify(tmp_path / "out", ticks=PART)
    assert report.notes == [f"{PART} of the {TICKS} ticks of a frame were played; --ticks {TICKS} plays them all"]
    failures = [
        check.failure
        for check in report.checks
        if check.failure is not None and check.subject in ("top", "simulation", "verilog header")
    ]
    assert any(says in failure for failure in failures), report.failures


def clocks(planned: TurnedBuild, clock_hz: float) -> int:
    """The clocks of a tick at a clock of the FPGA."""
    emit = replace(planned.setup.scan.emit, clock_hz=clock_hz)
    setup, problems = replace(planned.setup, scan=replace(planned.setup.scan, emit=emit)), Problems()
    found = slow_clocks_per_tick(setup, planned.plan.program, problems)
    problems.stop_if_any()
    return found


def test_a_clock_that_does_not_serve_is_refused(planned: TurnedBuild) -> None:
    assert clocks(planned, CLOCKS * 9600) == CLOCKS
    with pytest.raises(Rejected, match=r"979200 Hz are 102 clocks a tick, and the sequencer of this scan takes 103"):
        clocks(planned, 102 * 9600)
    with pytest.raises(Rejected, match="which is not whole"):
        clocks(planned, 104.5 * 9600)


def test_what_the_verilog_does_not_play_is_refused(planned: TurnedBuild, build: Path) -> None:
    with pytest.raises(Rejected, match="'vhdl' holds no scan at an angle"):
        build_turned(planned.setup, formats=["vhdl"])
    with pytest.raises(NotABuild, match="which no emulator plays"):
        verify(build, "cortex-m")


def test_a_target_that_the_build_has_not_is_named(planned: TurnedBuild, tmp_path: Path) -> None:
    alone = TurnedBuild(planned.setup, planned.plan, planned.certificate, ["verilog"])
    alone.write(tmp_path / "out")
    assert not list((tmp_path / "out").glob("*.c"))
    with pytest.raises(NotABuild, match="has the formats verilog, and no c; verify it with another --target"):
        verify(tmp_path / "out", "c")
    assert "parameter CLOCKS_PER_TICK = 0," in (tmp_path / "out" / TOP).read_text("ascii")


@pytest.fixture(scope="module")
def tilted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The build of the same frame with the output z, whose sequencer has a top of its own."""
    folder = tmp_path_factory.mktemp("tilted")
    path = write_tilted(folder, 30.0, *SMALL, f"+ [emit]\nformats = ['c', 'verilog']\nclock_hz = {CLOCKS * 9600}")
    build_turned(path, folder / "out")
    return folder / "out"


def test_the_top_of_z_plays_a_frame_of_the_model(tilted: Path) -> None:
    report = verify(tilted)
    assert report.failures == []
    assert subjects(report)[-4:] == ["verilog header", "top", "verilog header, z", "top, z"]
    stored = read_turned(tilted)
    assert stored.z is not None
    assert stored.manifest.clocks_per_tick == CLOCKS >= least_slow_clocks(stored.z)
    assert f"_CLOCKS_PER_TICK = 32'sd{CLOCKS};" in (tilted / f"{NAME}_z.vh").read_text("ascii")


@pytest.mark.rest
def test_a_changed_word_is_found_in_the_top_of_z_alone(tilted: Path, tmp_path: Path) -> None:
    copytree(tilted, tmp_path / "out")
    memory_word("z_slow", 70)(tmp_path / "out")
    failures = [one for one in verify(tmp_path / "out", ticks=PART).failures if "_top.v: " in one]
    assert len(failures) == 1
    assert failures[0].startswith(f"{NAME}_z_top.v: write 70 of its boot is"), failures


@pytest.fixture(scope="module")
def shaped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The build of the same frame with shaped x and y, and with z, which is never shaped."""
    folder = tmp_path_factory.mktemp("shaped")
    emit = f"+ [emit]\nformats = ['c', 'verilog']\nclock_hz = {CLOCKS * 9600}"
    build_turned(write_tilted(folder, 30.0, *SMALL, "dac.shaping = 'second'", emit), folder / "out")
    return folder / "out"


def test_shaped_lines_are_those_of_the_model(shaped: Path) -> None:
    stored = read_turned(shaped)
    assert stored.z is not None
    assert (stored.program.shaping_order, stored.z.shaping_order) == (2, 0)
    report = verify(shaped, ticks=3 * 24)
    assert report.failures == []
    assert subjects(report)[-4:] == ["verilog header", "top", "verilog header, z", "top, z"]
    for name, order in ((NAME, 2), (f"{NAME}_z", 0)):
        assert f"_SHAPING = 32'sd{order};" in (shaped / f"{name}.vh").read_text("ascii")
        assert f"parameter SHAPING = {order}," in (shaped / f"{name}_top.v").read_text("ascii")


AXIS = "dac_slow_axis.v"
UNSHAPED: dict[str, tuple[Callable[[Path], None], str]] = {
    "the order of x": (memory_word("program", 16 + 11), "at address 27 of region 0"),
    "an order that the sequencer has not": (
        edit(TOP, "parameter SHAPING = 2,", "parameter SHAPING = 1,"),
        "SHAPING_is",
    ),
    "remainders": (edit(AXIS, ".begins(begin_waits)", ".begins(restarts)"), f"{TOP}: tick "),
}


@pytest.mark.rest
@pytest.mark.parametrize("what", long(["the order of x", "remainders"], UNSHAPED))
def test_what_changes_the_shaping_is_found(what: str, shaped: Path, tmp_path: Path) -> None:
    change, says = UNSHAPED[what]
    copytree(shaped, tmp_path / "out")
    change(tmp_path / "out")
    signed(tmp_path / "out")
    failures = verify(tmp_path / "out", ticks=PART).failures
    assert any(says in failure for failure in failures), failures
