"""``examples/verilog/scanner.v``, a whole device: from the memory files of a build to the wires of two converters.

It boots from Fourier words, renders its tables and starts its scan; what the converters receive are the model's codes.
"""

from pathlib import Path

import numpy as np
import pytest
from building import BENCHES, REPOSITORY, VARIANTS, build, run_clean
from spi_monitor import Converter, ProtocolFault, Wires, quiet, receive

from tablegen.base.resources import verilog_runtime
from tablegen.device.dual_program import DualProgram
from tablegen.device.sequencer import Sequencer
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
            [*verilog_runtime(), SCANNER, BENCH],
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
    sources = sorted(built.folder.glob("dac_*.v"))
    run_clean(["iverilog", "-g2005", f"-I{built.folder}", "-s", "scanner", "-o", program, SCANNER, *sources])
    assert program.exists()


@pytest.mark.rest
def test_the_converters_receive_the_codes_of_the_model(captured: tuple[DualProgram, np.ndarray]) -> None:
    program, levels = captured
    sclk, x_data, y_data, select_n, load_n = (levels >> i & 1 for i in range(5))
    model = Sequencer(None)
    model.commit(program)
    assert model.step().swapped  # the first tick that it takes the program with lets it start
    model.arm()
    assert model.trigger()
    ticks = [model.step() for _ in range(TICKS)]
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
