"""``examples/verilog/scanner.v``, a whole device: from the memory files of a build to the wires of two converters.

It boots from Fourier words, renders its tables and starts its scan; what the converters receive are the model's codes.
"""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from building import BENCHES, NAME, REPOSITORY, VARIANTS, Build, build, run_clean
from limits import PATIENCE_S
from sets import common_and_rest
from short_scans import CUBIC, DIRECT, model_ticks, short
from spi_monitor import Converter, ProtocolFault, Wires, quiet, receive

from tablegen.base.resources import verilog_runtime
from tablegen.device.dual_program import DualProgram
from tablegen.verification.verilog.simulate import Design, compile_design

pytestmark = pytest.mark.common

SCANNER = REPOSITORY / "examples" / "verilog" / "scanner.v"
BENCH = BENCHES / "scanner_bench.v"
CLOCKS_PER_TICK = 100
TICKS = 1300  # more than a line
AD5541A = Converter(frame_bits=16, cpol=0, cpha=0)


@pytest.fixture(scope="module")
def captured(tmp_path_factory: pytest.TempPathFactory) -> tuple[DualProgram, np.ndarray]:
    """The model's program, and the levels of {load_n, select_n, y_data, x_data, sclk} clock by clock."""
    folder = tmp_path_factory.mktemp("scanner")
    built = build(folder / "build", VARIANTS["example"])
    capture = folder / "capture.hex"
    simulation = folder / "simulation"
    simulation.mkdir()
    for memory in built.folder.glob("*.mem"):
        (simulation / memory.name).write_bytes(memory.read_bytes())
    design = compile_design(
        "verilator",
        Design(
            [*verilog_runtime(), built.folder / f"{NAME}_top.v", SCANNER, BENCH],
            "scanner_bench",
            {"CAPTURE": str(capture), "CLOCKS": TICKS * CLOCKS_PER_TICK},
            includes=[built.folder],
        ),
        simulation,
    )
    assert design.run("cocotb_scanner") == (1, 0), (simulation / "simulation.log").read_text()
    levels = np.frombuffer(bytes.fromhex(capture.read_text("ascii")), dtype=np.uint8).astype(np.int64)
    return built.plan.program, levels


def test_it_elaborates_as_its_header_says(tmp_path: Path) -> None:
    built = build(tmp_path, VARIANTS["example"])
    program = tmp_path / "scanner.vvp"
    sources = [built.folder / f"{NAME}_top.v", *sorted(built.folder.glob("dac_*.v"))]
    run_clean(["iverilog", "-g2005", f"-I{built.folder}", "-s", "scanner", "-o", program, SCANNER, *sources])
    assert program.exists()


PLAYED: dict[str, dict[str, object]] = {
    "interpolated": {},
    "direct x": {"x.table": DIRECT},
    "direct y": {"y.table": DIRECT},
    "cubic": {"x.table": CUBIC, "y.table": CUBIC},
    "cubic x": {"x.table": CUBIC},
    "shaped": {"dac.shaping": "second"},
    "18 bits": {"dac.bits": 18},
    "24 bits": {"dac.bits": 24, "dac.coding": "twos-complement"},
    "12 bits in 16": {"dac.bits": 12, "dac.word_bits": 16, "dac.align": "left", "dac.coding": "twos-complement"},
    "y at rest": {"y": {"motion": "off", "offset_v": 50.0}},
    "128 harmonics": {"x.band_limit.harmonics": 128, "x.table.length": 512},
}
REFUSED: dict[str, tuple[dict[str, object], str]] = {
    "18 bits": ({"dac.bits": 18}, "serves_converters_with_words_of_16_bits"),
    "direct x": ({"x.table": DIRECT}, "renders_no_direct_table"),
    "direct y": ({"y.table": DIRECT}, "renders_no_direct_table"),
    "shaped": ({"dac.shaping": "first"}, "SHAPING_is_less_than_that_of_the_scan"),
    "128 harmonics": (
        {"x.band_limit.harmonics": 128, "x.table.length": 512},
        "HARMONICS_is_less_than_those_of_the_scan",
    ),
}


def elaborated(built: Build, text: str, top: str, *sources: Path, **parameters: int | str) -> tuple[Path, str]:
    """The program of a copied example, with what Icarus says; it does not exist where Icarus refuses."""
    copy, program = built.folder / f"{top}_copy.v", built.folder / f"{top}.vvp"
    copy.write_text(text, "ascii")
    given = [f"-P{top}.{name}={value}" for name, value in parameters.items()]
    command = ["iverilog", "-g2005", f"-I{built.folder}", "-s", top, "-o", program, *given, *sources, copy]
    runtime = [*sorted(built.folder.glob("dac_*.v")), built.folder / "program_loader.v", built.folder / f"{NAME}_top.v"]
    done = subprocess.run([*command, *runtime], capture_output=True, text=True, check=False)
    return program, done.stdout + done.stderr


QUICKER = ("interpolated", "direct x", "shaped", "18 bits")
SLOW = ("y at rest", "128 harmonics")


@pytest.mark.parametrize("name", common_and_rest(QUICKER, PLAYED.keys() - SLOW, PLAYED))
def test_every_scan_is_played(name: str, tmp_path: Path) -> None:
    built, capture = short(tmp_path, PLAYED[name]), tmp_path / "capture.hex"
    ticks, converter = 60, Converter(built.plan.program.x.output.word_bits, cpol=0, cpha=0)
    program, shown = elaborated(
        built,
        SCANNER.read_text("ascii"),
        "scanner_bench",
        BENCH,
        CAPTURE=f'"{capture}"',
        CLOCKS=ticks * CLOCKS_PER_TICK,
    )
    assert shown == ""
    run = subprocess.run(["vvp", "-n", program], cwd=built.folder, capture_output=True, text=True, timeout=PATIENCE_S)
    assert (run.returncode, run.stdout) == (0, "")
    levels = np.frombuffer(bytes.fromhex(capture.read_text("ascii")), dtype=np.uint8).astype(np.int64)
    sclk, x_data, y_data, select_n, load_n = (levels >> i & 1 for i in range(5))
    played = model_ticks(built.plan.program, ticks)[1:]
    for data, axis in ((x_data, "x"), (y_data, "y")):
        output = getattr(built.plan.program, axis).output
        words = receive(Wires(sclk, select_n, data, load_n), converter).values[:, 0].tolist()
        assert len(words) >= ticks - 1
        assert words == [int(output.word(getattr(tick, axis))) for tick in played][: len(words)]


@pytest.mark.parametrize("name", REFUSED)
def test_a_scan_that_the_linked_one_does_not_serve_is_refused_by_name(name: str, tmp_path: Path) -> None:
    changes, reason = REFUSED[name]
    built, top = short(tmp_path, changes), "linked_scanner"
    program, shown = elaborated(built, SCANNER.with_name(f"{top}.v").read_text("ascii"), top)
    assert f"Unknown module type: {top}_{reason}" in shown
    assert not program.exists()


@pytest.mark.parametrize(("mode", "clocks"), [("interpolated", 41), ("cubic", 90)])
def test_ticks_that_are_too_short_are_refused(mode: str, clocks: int, tmp_path: Path) -> None:
    built = short(tmp_path, {"x.table": CUBIC} if mode == "cubic" else {})
    reason = f"{NAME}_top_CLOCKS_PER_TICK_is_less_than_the_sequencer_takes"
    for given, refused in ((clocks - 1, True), (clocks, False)):
        program, shown = elaborated(built, SCANNER.read_text("ascii"), "scanner", CLOCKS_PER_TICK=given)
        assert (reason in shown, program.exists()) == (refused, not refused)


def test_ticks_that_are_shorter_than_a_frame_are_refused(tmp_path: Path) -> None:
    built = short(tmp_path, {"dac.bits": 24})
    for given, refused in ((55, True), (56, False)):
        program, shown = elaborated(built, SCANNER.read_text("ascii"), "scanner", CLOCKS_PER_TICK=given)
        reason = "scanner_CLOCKS_PER_TICK_is_less_than_a_frame_takes"
        assert (reason in shown, program.exists()) == (refused, not refused)


def test_the_player_refuses_a_shaped_scan(tmp_path: Path) -> None:
    """It would play codes that are not those of the scan."""
    built = short(tmp_path, {"dac.shaping": "first"})
    program, shown = elaborated(built, SCANNER.with_name("play.v").read_text("ascii"), "play")
    assert "Unknown module type: play_plays_no_shaped_scan" in shown
    assert not program.exists()


@pytest.mark.rest
def test_the_converters_receive_the_codes_of_the_model(captured: tuple[DualProgram, np.ndarray]) -> None:
    program, levels = captured
    sclk, x_data, y_data, select_n, load_n = (levels >> i & 1 for i in range(5))
    ticks = model_ticks(program, TICKS)[1:]
    assert {tick.faults.value for tick in ticks} == {0}

    last = (
        int(np.flatnonzero(select_n == 0)[-1]) if select_n[-1] else int(np.flatnonzero(np.diff(select_n) > 0)[-1]) + 1
    )
    quiet(sclk[: last + 1], [select_n[: last + 1]], AD5541A.cpol)
    for data, axis in ((x_data, "x"), (y_data, "y")):
        frames = receive(Wires(sclk, select_n, data, load_n), AD5541A)
        received = frames.values[:, 0].tolist()
        assert len(received) >= TICKS - 1
        assert received == [getattr(tick, axis) for tick in ticks][: len(received)]
        assert set(np.diff(frames.start).tolist()) == {CLOCKS_PER_TICK}, "every sample is as long as every other"


@pytest.mark.rest
def test_a_capture_with_a_wrong_bit_is_not_taken(captured: tuple[DualProgram, np.ndarray]) -> None:
    """Negative control: the select of one frame rises a clock early."""
    _, levels = captured
    wrong = levels.copy()
    rises = np.flatnonzero(np.diff(levels >> 3 & 1) > 0)
    wrong[rises[10] - 3 : rises[10] + 1] |= 8
    sclk, x_data, _, select_n, load_n = (wrong >> i & 1 for i in range(5))
    with pytest.raises(ProtocolFault):
        receive(Wires(sclk, select_n, x_data, load_n), AD5541A)
