"""The Verilog of a scan with the output z and without an operator: the files of z, what is played, and tampering."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
from building import run_clean
from editing import run
from sets import long
from test_verify_turned import NAME, edit
from tilted_scans import write_straight

import tablegen
from tablegen.base.input_errors import Rejected
from tablegen.device.clocks import least_slow_clocks
from tablegen.device.dual_program import ScanProgram
from tablegen.device.sequencer import Sequencer, Tick
from tablegen.emit.stored import stored_content
from tablegen.emit.turned_content import content_beside
from tablegen.manifest.read import NotABuild, read_build
from tablegen.numerics.arrays import Ints
from tablegen.verification.play.stream import FLAGS
from tablegen.verification.run import verify
from tablegen.verification.verilog.turned_play import TurnedPlay

SMALL = (
    "timing.lines = 12", "timing.pixels = 4", "timing.line_rate_hz = 400", "dac.update_rate_hz = 9600",
    "x.band_limit.harmonics = 8", "y.band_limit.harmonics = 8", "x.table.length = 64", "y.table.length = 64",
)  # fmt: skip
RATE, CLOCKS, TICKS = 9600, 101, 12 * 24  # the least clocks a tick of these lines; of longer ones 93
PART = 30  # ticks that show what does not take a frame
TOP = f"{NAME}_z_top.v"
SWAPPED, OF_EACH = 1 << FLAGS.index("swapped"), 1 << FLAGS.index("valid") | 1 << FLAGS.index("swapped")


def emit(clocks: int, formats: str = "'c', 'verilog'") -> str:
    """The table of the formats, with the clock that has so many clocks a tick."""
    return f"+ [emit]\nformats = [{formats}]\nclock_hz = {clocks * RATE}"


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small frame in both formats, at the slowest clock that plays z."""
    folder = tmp_path_factory.mktemp("straight")
    tablegen.build(write_straight(folder, *SMALL, emit(CLOCKS)), folder / "out")
    return folder / "out"


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files of the same scan without z."""
    folder = tmp_path_factory.mktemp("plain")
    return tablegen.build(write_straight(folder, *SMALL, emit(CLOCKS), "- [z]")).files


def code(text: bytes) -> list[str]:
    """The lines of a file but for comments and the hash of the plan."""
    return [line for line in text.decode("ascii").splitlines() if not line.startswith("//") and "_HASH" not in line]


@pytest.mark.common
def test_the_files_of_x_and_y_are_those_without_z(build: Path, plain: dict[str, bytes]) -> None:
    ours = {path.name: path.read_bytes() for path in build.glob("*") if path.suffix in (".v", ".vh", ".mem")}
    others = {name: text for name, text in plain.items() if name.endswith((".v", ".vh", ".mem"))}
    assert {name for name in ours.keys() - others if not name.startswith("dac_slow_")} == {
        TOP, f"{NAME}_z.vh", *(f"{NAME}_z_{each}.mem" for each in ("x", "y", "slow", "program")),
    }  # fmt: skip
    assert {name for name, text in others.items() if ours[name] != text} == {f"{NAME}.vh", f"{NAME}_top.v"}
    for name in (f"{NAME}.vh", f"{NAME}_top.v"):
        assert code(ours[name]) == code(others[name])
    assert f"_CLOCKS_PER_TICK = 32'sd{CLOCKS};" in (build / f"{NAME}_z.vh").read_text("ascii")


def play(folder: Path, ticks: int) -> list[str | None]:
    """Play the top of z in a folder as ``verify`` does; return what its checks say."""
    beside = content_beside(stored_content(read_build(folder)))
    assert beside is not None
    return [check.failure for check in TurnedPlay(beside, ticks, ", z").checks(folder, folder / "work", "icarus")]


@pytest.mark.rest
def test_the_top_of_z_plays_a_frame_of_the_model(build: Path, tmp_path: Path) -> None:
    """And the first line of the next one, with ticks as close to each other as the header says."""
    stored = read_build(build)
    assert stored.program_of_z is not None
    assert stored.program.schedule.frame_ticks == TICKS
    assert least_slow_clocks(stored.program_of_z) == stored.manifest.clocks_per_tick == CLOCKS
    copytree(build, tmp_path / "out")
    assert play(tmp_path / "out", TICKS + 24) == [None, None]


def memory_word(file: str, at: int) -> Callable[[Path], None]:
    """Change the lowest bit of a word of a memory file of z."""

    def do(folder: Path) -> None:
        path = folder / f"{NAME}_z_{file}.mem"
        words = path.read_text("ascii").split()
        words[at] = f"{int(words[at], 16) ^ 1:0{len(words[at])}x}"
        path.write_text("".join(f"{one}\n" for one in words), "ascii")

    return do


def signed(folder: Path) -> None:
    """Make the digests of the manifest those of what stands there."""
    path = folder / "manifest.json"
    plain = json.loads(path.read_text("ascii"))
    plain["files"] = {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in plain["files"]}
    path.write_text(json.dumps(plain), "ascii")


# What is done to the files, what is said of the files, and what is said of what they boot and play.
TAMPERING: dict[str, tuple[Callable[[Path], None], str, str]] = {
    "a word of the line": (memory_word("x", 5), f"{NAME}_z_x.mem: a line is", "at address 5 of region 1"),
    "a slow word": (memory_word("slow", 70), f"{NAME}_z_slow.mem: a line is", "write 70 of its boot is"),
    "a register": (memory_word("program", 20), f"{NAME}_z_program.mem: a line is", "at address 20 of region 0"),
    "a constant": (
        edit(f"{NAME}_z.vh", "_CLOCKS = 32'sd", "_CLOCKS = 32'sd1"), f"{NAME}_z.vh: a line is",
        f"_CLOCKS is 1{CLOCKS} to the simulator",
    ),
    "a coding": (
        edit(TOP, ".TWOS_COMPLEMENT(0), .LEFT_ALIGNED(0)\n    ) x_", ".TWOS_COMPLEMENT(1), .LEFT_ALIGNED(0)\n    ) x_"),
        f"{TOP}: a line is", "words 0x",
    ),
    "a ramp that stands still": (
        edit("dac_slow_part.v", ".write_ramp(write_ramp && !is_y)", ".write_ramp(1'b0)"),
        "dac_slow_part.v: is not the one that is installed", f"{TOP}: tick ",
    ),
    "a missing top": (lambda folder: (folder / TOP).unlink(), f"{TOP}: cannot be read", f"{TOP} is missing"),
}  # fmt: skip


@pytest.mark.common
@pytest.mark.parametrize("what", TAMPERING)
def test_tampering_is_found_in_the_files_of_z_alone(what: str, build: Path, tmp_path: Path) -> None:
    """Though digests are made right again; the check of the format names z."""
    copytree(build, tmp_path / "out")
    change, says, _ = TAMPERING[what]
    change(tmp_path / "out")
    if what != "a missing top":
        signed(tmp_path / "out")
    failures = verify(tmp_path / "out", "files").failures
    assert any(says in failure for failure in failures), failures
    own = "verilog z: " if says.startswith(NAME) else "files: "
    assert any(failure.startswith(own) for failure in failures), failures
    assert not any(failure.startswith(("verilog header", "verilog memories", "c ")) for failure in failures), failures


@pytest.mark.rest
@pytest.mark.parametrize("what", long(["a ramp that stands still", "a missing top"], TAMPERING))
def test_tampering_is_found_in_what_z_boots_and_plays(what: str, build: Path, tmp_path: Path) -> None:
    copytree(build, tmp_path / "out")
    change, _, says = TAMPERING[what]
    change(tmp_path / "out")
    failures = [failure for failure in play(tmp_path / "out", PART) if failure]
    assert len(failures) == 1
    assert says in failures[0]


@pytest.mark.rest
def test_z_is_played_where_x_and_y_are_not(build: Path, tmp_path: Path) -> None:
    """None hides the other; the word of z is heard by ``verify``."""
    copytree(build, tmp_path / "out")
    memory_word("slow", 70)(tmp_path / "out")
    (tmp_path / "out" / f"{NAME}_program.mem").unlink()
    report = verify(tmp_path / "out", ticks=PART)
    assert f"simulation: {NAME}_program.mem is missing" in report.failures
    assert report.checks[-1].subject == "top, z"
    assert report.failures[-1].startswith(f"{TOP}: write 70 of its boot is")
    assert report.notes == [f"{PART} of the {TICKS} ticks of a frame of z were played; --ticks {TICKS} plays them all"]


@pytest.mark.long
def test_x_and_y_are_played_as_before_where_z_is_wrong(build: Path, tmp_path: Path) -> None:
    """By the whole of ``verify``: the word of z is heard in z, and every check of x and y passes."""
    copytree(build, tmp_path / "out")
    memory_word("slow", 70)(tmp_path / "out")
    signed(tmp_path / "out")
    report = verify(tmp_path / "out", ticks=PART)
    failed = {check.subject for check in report.checks if check.failure is not None}
    assert failed == {"files", "verilog z", "top, z"}
    assert report.checks[-1].failure is not None
    assert report.checks[-1].failure.startswith(f"{TOP}: write 70 of its boot is")
    assert {"top", "timing", "markers"} < {check.subject for check in report.checks}
    assert not {TOP, "dac_slow_part.v", "dac_spline_terms.v"} & set(report.unplayed)


@pytest.mark.common
def test_a_clock_that_is_too_slow_for_z_is_refused(tmp_path: Path) -> None:
    """A clock more a tick is taken; x and y alone would do with 1 clock, and C with none."""
    scan = write_straight(tmp_path, *SMALL, emit(CLOCKS - 1))
    says = rf"emit\.clock_hz: {(CLOCKS - 1) * RATE} Hz are 100 clocks a tick, and the sequencer of z takes {CLOCKS}; "
    built = tablegen.build(scan)
    with pytest.raises(Rejected, match=says + "take a clock of at least 969600 Hz"):
        _ = built.files
    assert f"{NAME}_z.c" in tablegen.build(scan, formats=["c"]).files
    outcome = run("build", scan, "-o", tmp_path / "out", "-f", "verilog")
    assert outcome.status == 2
    assert "the sequencer of z takes" in outcome.err
    assert not (tmp_path / "out").exists()


@pytest.mark.common
def test_verilog_alone_is_verified_in_its_files(build: Path, tmp_path: Path) -> None:
    """Without C; a manifest with another format is damaged."""
    tablegen.build(build.parent / "scan.toml", tmp_path / "out", formats=["verilog"])
    assert not list((tmp_path / "out").glob("*.c"))
    assert verify(tmp_path / "out", "files").failures == []
    with pytest.raises(NotABuild, match="has the formats verilog, and no c"):
        verify(tmp_path / "out", "c")
    path = tmp_path / "out" / "manifest.json"
    plain = json.loads(path.read_text("ascii"))
    path.write_text(json.dumps({**plain, "formats": ["verilog", "vhdl"]}), "ascii")
    with pytest.raises(NotABuild, match="vhdl cannot hold the output z, which the scan has"):
        read_build(tmp_path / "out")


def both_tops(build: Path, folder: Path, **parameters: int) -> tuple[Ints, Ints, Ints]:
    """Play both tops on one clock; return words, markers and faults of each tick of x and y, of z, and the requests."""
    design, bench = folder / "two_tops", Path(__file__).with_name("two_tops.v")
    settings = [f"-Ptwo_tops.{key}={value}" for key, value in {"PACE": CLOCKS, **parameters}.items()]
    sources = [*sorted(build.glob("dac_*.v")), build / f"{NAME}_top.v", build / TOP, bench]
    run_clean(["iverilog", "-g2005", "-s", "two_tops", *settings, "-o", design, *sources], folder)
    lines = [line.split() for line in run_clean(["vvp", "-n", design], build).splitlines()]
    axes, z, requests = (np.array([row[1:] for row in lines if row[0] == of], dtype=np.int64) for of in "012")
    assert np.array_equal(axes[:, 0], np.arange(len(axes)))
    return axes[:, 1:], z[:, 1:], requests[:, 0]


def as_row(program: ScanProgram, tick: Tick) -> list[int]:
    """A tick of the model as the bench writes it."""
    markers = sum(getattr(tick, flag) << bit for bit, flag in enumerate(FLAGS))
    return [program.x.output.word(tick.x), program.y.output.word(tick.y), markers, tick.faults.value]


def modelled(program: ScanProgram, requests: Ints, ticks: int) -> Ints:
    """What the model plays of a scan, a park, and a scan of one frame that begin before these ticks, from the first."""
    model, first_scan, parked = Sequencer(None), *np.diff(requests).tolist()
    model.commit(program)
    model.step()
    model.arm()
    model.trigger()
    played = [model.step() for _ in range(first_scan)]
    model.park()
    played += [model.step() for _ in range(parked)]
    model.arm(1)
    model.trigger()
    played += [model.step() for _ in range(ticks - int(requests[-1]))]
    return np.array([as_row(program, tick) for tick in played])


@pytest.mark.rest
def test_both_tops_stay_on_the_same_ticks(build: Path, tmp_path: Path) -> None:
    """From a trigger while x and y still render, over more than a frame, through a park, and a trigger three ticks on.

    Each begins while z or x and y are not ready: z hands its trigger over, and no tick comes between. Which tick takes
    the program is a matter of each.
    """
    axes, z, requests = both_tops(build, tmp_path, HAND_OVER=1, TICKS=TICKS + 40, LATER=30)
    stored, begin = read_build(build), requests[0]
    assert stored.program_of_z is not None
    assert len(axes) == len(z) > begin + TICKS + 70
    for played in (axes, z):
        played[begin, 2] &= ~SWAPPED
    assert np.array_equal(axes[begin:], modelled(stored.program, requests, len(axes)))
    assert np.array_equal(z[begin:], modelled(stored.program_of_z, requests, len(z)))
    assert np.array_equal(axes[begin:, 2] | OF_EACH, z[begin:, 2] | OF_EACH)
    for flag in ("line", "frame", "pixel", "backward", "valid"):
        assert np.count_nonzero(z[begin:, 2] >> FLAGS.index(flag) & 1) > 1, flag


@pytest.mark.rest
def test_markers_tell_that_z_began_late(build: Path, tmp_path: Path) -> None:
    """A trigger of both after a park, before z has its line, begins x and y alone."""
    axes, z, (begin, park, again) = both_tops(build, tmp_path, WAIT=80 * CLOCKS, TICKS=30, LATER=30)
    differ = (axes[:, 2] ^ z[:, 2]) & ~OF_EACH != 0
    assert not differ[begin:again].any()
    assert park + 3 == again
    assert differ[again]
    playing = 1 << FLAGS.index("playing")
    late = np.flatnonzero(z[again:, 2] & playing)[0]
    assert axes[again, 2] & playing
    assert 8 <= late <= 20
