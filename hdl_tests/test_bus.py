"""dac_axi_lite and dac_wishbone in front of a sequencer: every answer of both buses is that of the model.

Random traffic, addresses that there are not, partial writes, resets in the middle, and programs that are uploaded and
played; with mutants. The bench holds both buses to their rules on every clock.
"""

from collections.abc import Sequence
from pathlib import Path

import pytest
from building import BENCHES
from bus_model import BUS, SEQUENCER
from sets import one_of
from slow_scripts import SLOW_FOLDER, SLOW_INDEX_BITS
from stream_benches import HARMONICS, with_sine
from test_lint import MODULES

from tablegen.verification.verilog.simulate import CompiledDesign, Design, SimulationFailed, compile_design

pytestmark = pytest.mark.rest
BUSES = ("axi_lite", "wishbone")
FRONTS = {"axi_lite": "dac_axi_lite.v", "wishbone": "dac_wishbone.v"}


def compiled(bus: str, folder: Path, modules: Sequence[Path] = (), *, slow: bool = False) -> CompiledDesign:
    """The bench of a bus; ``modules`` take the places of those of the same names; ``slow``: it has slow parts."""
    folder.mkdir(parents=True, exist_ok=True)
    changed = {path.name: path for path in modules}
    every = sorted([*MODULES.glob("*.v"), *BUS.glob("*.v"), *SLOW_FOLDER.glob("*.v")])
    sources = [changed.get(path.name, path) for path in every]
    parameters = with_sine(folder, SEQUENCER, HARMONICS) | {"WISHBONE": int(bus == "wishbone")}
    if slow:
        parameters |= {"SLOW_PART": 1, "SLOW_INDEX_BITS": SLOW_INDEX_BITS, "SHAPING": 3}
        parameters |= {"FOURIER": 0, "PIXEL_INDEX_BITS": 0}
    return compile_design("icarus", Design([BENCHES / "bus_bench.v", *sources], "bus_bench", parameters, [BUS]), folder)


def mutant(folder: Path, module: str, old: str, new: str) -> Path:
    """A module of the bus with a change."""
    text = (BUS / module).read_text("utf-8")
    assert text.count(old) == 1
    changed = folder / module
    changed.write_text(text.replace(old, new), "utf-8")
    return changed


def run(design: CompiledDesign, bus: str, test: str, amount: float = 1.0) -> bool:
    """Whether all was as the model has it."""
    settings = {"BUS": bus, "BUS_AMOUNT": str(amount), "COCOTB_TEST_FILTER": test}
    tests, failed = design.run("cocotb_registers", settings)
    assert tests == 1
    return failed == 0


@pytest.fixture(scope="module", params=BUSES)
def design(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, CompiledDesign]:
    return request.param, compiled(request.param, tmp_path_factory.mktemp(request.param))


def test_every_access_is_answered_as_the_model_has_it(design: tuple[str, CompiledDesign]) -> None:
    bus, simulation = design
    assert run(simulation, bus, "accesses")


def test_programs_that_are_uploaded_play_as_the_model_does(design: tuple[str, CompiledDesign]) -> None:
    bus, simulation = design
    assert run(simulation, bus, "uploads")


def test_a_commit_takes_its_mode_and_a_table_of_pixels(design: tuple[str, CompiledDesign]) -> None:
    bus, simulation = design
    assert run(simulation, bus, "moves")


@pytest.mark.parametrize("bus", BUSES)
def test_a_turned_program_plays_as_the_model_does(bus: str, tmp_path: Path) -> None:
    assert run(compiled(bus, tmp_path, slow=True), bus, "slow_parts")


SLOW_MUTANTS = [
    ("wishbone", "dac_bus.v", "{word[14:13], 1'b0, place}", "word"),
    ("wishbone", "dac_bus.v", "in_x_slow ? X_PARTS", "in_x_slow ? Y_PARTS"),
    ("wishbone", "dac_bus.v", "place < KNOTS", "place < 13'd2"),
    ("wishbone", "dac_bus_map.v", "address[19:17] == 3'd7", "address[19:17] == 3'd5"),
]


@pytest.mark.parametrize(
    ("bus", "module", "old", "new"), one_of(4, SLOW_MUTANTS, 4), ids=[f"{one[1]}-{one[3]}" for one in SLOW_MUTANTS]
)
def test_a_mutant_of_the_slow_parts_is_found(bus: str, module: str, old: str, new: str, tmp_path: Path) -> None:
    assert not run(
        compiled(bus, tmp_path / "bench", [mutant(tmp_path, module, old, new)], slow=True), bus, "slow_parts"
    )


# A bus, a module, a piece of its text and what takes its place.
MUTANTS = [
    ("wishbone", "dac_bus.v", "request_bytes == 4'b1111", "request_bytes != 4'b0000"),
    ("wishbone", "dac_bus.v", "(in_x_table && word >> X_INDEX_BITS == 16'd0)", "in_x_table"),
    ("wishbone", "dac_bus.v", "word <= LAST[15:0]", "word < LAST[15:0]"),
    ("wishbone", "dac_bus.v", "data[9:8] != 2'd3)", "1'b1)"),
    ("wishbone", "dac_bus.v", "commit_mode = data[9:8]", "commit_mode = 2'd0"),
    ("wishbone", "dac_bus.v", "in_pixel_ticks && word >> PIXEL_INDEX_BITS == 16'd0", "in_pixel_ticks"),
    ("wishbone", "dac_bus.v", "in_pixel_ticks ? PIXEL_TICKS", "in_pixel_ticks ? PROGRAM"),
    ("wishbone", "dac_bus.v", "(in_memory || (command_write && data[0])) && !writable", "in_memory && !writable"),
    ("wishbone", "dac_bus.v", "(pending & ~cleared) | events", "(pending | events) & ~cleared"),
    ("wishbone", "dac_bus.v", "SETTLING = 3'd6", "SETTLING = 3'd1"),
    ("axi_lite", "dac_bus.v", "read_data <= effective ? value : 32'd0", "read_data <= value | {32{!effective}}"),
    ("wishbone", "dac_bus_map.v", "address[19:8] == 12'd4", "address[17:8] == 10'd4"),
    ("axi_lite", "dac_axi_lite.v", "outside = above != 0", "outside = 1'b0"),
    ("axi_lite", "dac_axi_lite.v", "may_write = aw_kept && w_kept", "may_write = aw_kept"),
    ("axi_lite", "dac_axi_lite.v", "s_axi_rvalid ? !s_axi_rready : done && !writes", "done && !writes"),
    ("axi_lite", "dac_axi_lite.v", "            ar_kept <= 1'b0;\n            works", "            works"),
    ("wishbone", "dac_wishbone.v", "wb_ack_o = done && waits && cycle", "wb_ack_o = done && cycle"),
]


@pytest.mark.parametrize(
    ("bus", "module", "old", "new"), one_of(4, MUTANTS, 4), ids=[f"{one[1]}-{one[3]}" for one in MUTANTS]
)
def test_a_mutant_is_found(bus: str, module: str, old: str, new: str, tmp_path: Path) -> None:
    simulation = compiled(bus, tmp_path / "bench", [mutant(tmp_path, module, old, new)])
    try:
        assert not (run(simulation, bus, "accesses", 0.3) and run(simulation, bus, "moves"))
    except SimulationFailed as error:
        raise AssertionError("the simulation did not end with a verdict") from error
