"""dac_synchronise behind changes of another clock: every level and pulse as the chain of the model has them.

The changes come at random times, from a clock that is slower than its own and from one that is faster; with faults put
into the module. What constraints and placers rely on, names and attributes, is read from yosys.
"""

import itertools
import json
import random
import subprocess
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from building import BENCHES, tool
from test_lint import CROSSINGS

from tablegen.verification.verilog.simulate import Design, compile_design

MODULE = CROSSINGS / "dac_synchronise.v"
CLOCK_PS, FIRST_EDGE_PS = 10_000, 5_000
CLOCKS = 1_000


@dataclass(frozen=True)
class Setup:
    """Parameters of an instance, the level of `in` at power-up, and the times of its changes in ps."""

    stages: int
    pulse: int
    power_up: int | None
    start: int
    times: tuple[int, ...]

    @property
    def initial(self) -> int:
        """The level of the chain at power-up."""
        return int(self.pulse == 1) if self.power_up is None else self.power_up

    def level_at(self, edge: int) -> int:
        """Return the level of `in` at an edge of the clock."""
        changes = bisect_left(self.times, FIRST_EDGE_PS + CLOCK_PS * edge)
        return (self.start + changes) % 2

    def expected(self) -> list[str]:
        """Return the level of `in` at each edge and of `out` after it."""
        chain, previous, lines = [self.initial] * self.stages, self.initial, []
        for edge in range(CLOCKS):
            sample = self.level_at(edge)
            previous, chain = chain[-1], [sample, *chain[:-1]]
            out = {0: chain[-1], 1: int(chain[-1] > previous), 2: int(chain[-1] != previous)}[self.pulse]
            lines.append(f"{sample}{out}")
        return lines


def change_times(seed: int, period_ps: int, least: int, most: int) -> tuple[int, ...]:
    """Return the times of changes some periods of another clock apart, none of them at an edge of ours."""
    generator, time, times = random.Random(seed), 0, []
    while (time := time + period_ps * generator.randint(least, most)) < CLOCK_PS * CLOCKS:
        times.append(time + (time % CLOCK_PS == FIRST_EDGE_PS))
    return tuple(times)


SLOW = change_times(1, 13_337, 1, 5)  # of a clock of 75 MHz
FAST = change_times(2, 3_011, 4, 40)  # of 332 MHz
SETUPS = [
    Setup(stages, pulse, power_up, start, times)
    for (stages, pulse, power_up, start), times in zip(
        itertools.product((2, 3, 8), (0, 1, 2), (None, 0, 1), (0, 1)), itertools.cycle((SLOW, FAST)), strict=False
    )
]


def captured(simulator: str, folder: Path, module: Path = MODULE, setups: Sequence[Setup] = SETUPS) -> list[list[str]]:
    """Simulate one instance for each setup; return the lines of their benches."""
    instances = []
    for index, setup in enumerate(setups):
        power_up = "" if setup.power_up is None else f", .POWER_UP({setup.power_up})"
        instances.append(
            f'    synchronise_bench #(.TIMES("{index}.hex"), .CAPTURE("{index}.txt"), .COUNT({len(setup.times)}),\n'
            f"        .CLOCKS({CLOCKS}), .START({setup.start}), .STAGES({setup.stages}),"
            f" .PULSE({setup.pulse}){power_up})\n"
            f"        bench_{index} (.done(done[{index}]));\n"
        )
    folder.mkdir(parents=True, exist_ok=True)
    top = folder / "synchronise_top.v"
    top.write_text(
        f"`timescale 1ns / 1ps\nmodule synchronise_top;\n    wire [{len(instances) - 1}:0] done;\n"
        f"    wire all_done = &done;\n{''.join(instances)}endmodule\n",
        "ascii",
    )
    sources = [top, BENCHES / "synchronise_bench.v", module]
    compiled = compile_design(simulator, Design(sources, "synchronise_top"), folder / "build")
    for index, setup in enumerate(setups):
        (compiled.folder / f"{index}.hex").write_text("".join(f"{time:x}\n" for time in setup.times), "ascii")
    assert compiled.run("cocotb_outputs") == (1, 0)
    return [(compiled.folder / f"{index}.txt").read_text("ascii").split() for index in range(len(setups))]


def test_the_other_clocks_beat_against_ours() -> None:
    """Changes come in every tenth of the clock; of the slow ones some on neighbouring clocks."""
    for times in (SLOW, FAST):
        assert {time % CLOCK_PS // (CLOCK_PS // 10) for time in times} == set(range(10))
    levels = "".join(line[0] for line in SETUPS[0].expected())
    assert "010" in levels
    assert "101" in levels


@pytest.mark.common
def test_levels_and_pulses_are_those_of_the_model(tmp_path: Path) -> None:
    lines = captured("icarus", tmp_path)
    for setup, seen in zip(SETUPS, lines, strict=True):
        assert seen == setup.expected(), setup
    assert sum(line[1] == "1" for setup, seen in zip(SETUPS, lines, strict=True) if setup.pulse for line in seen) > 3000


@pytest.mark.rest
def test_verilator_has_them_too(tmp_path: Path) -> None:
    """Of few setups: each is compiled by itself, with its own processes."""
    setups = [one for one in SETUPS if one.stages < 8 and one.power_up is None and one.start == 1]
    assert captured("verilator", tmp_path, setups=setups) == [setup.expected() for setup in setups]


def _powers_up_otherwise(setup: Setup) -> bool:
    """A chain that begins low instead of high shows, unless only rises count and there is none."""
    return setup.initial == 1 and (setup.pulse != 1 or setup.start == 1)


# A piece of the text, what takes its place, and for which setups that shows.
MUTANTS = {
    "a stage less": ("level = chain[LATER]", "level = chain[LATER-1]", lambda setup: True),
    "the fall instead": ("(level || PULSE == 2)", "(!level || PULSE == 2)", lambda setup: setup.pulse == 1),
    "every change": ("(level || PULSE == 2)", "1'b1", lambda setup: setup.pulse == 1),
    "powers up low": ("LEVEL = POWER_UP != 0", "LEVEL = 1'b0", _powers_up_otherwise),
    "two chains": (
        "dac_synchronise_later <= chain",
        "dac_synchronise_later <= {LATER{in}} | chain",
        lambda setup: True,
    ),
}


@pytest.mark.rest
@pytest.mark.parametrize("name", MUTANTS)
def test_a_fault_in_the_module_is_found(name: str, tmp_path: Path) -> None:
    old, new, shows = MUTANTS[name]
    text = MODULE.read_text("utf-8")
    assert text.count(old) == 1
    changed = tmp_path / MODULE.name
    changed.write_text(text.replace(old, new), "utf-8")
    lines = captured("icarus", tmp_path / "bench", changed)
    different = [setup for setup, seen in zip(SETUPS, lines, strict=True) if seen != setup.expected()]
    assert different == [setup for setup in SETUPS if shows(setup)]


def synthesised(folder: Path, module: Path = MODULE, **parameters: int) -> dict[str, tuple[dict[str, str], bool]]:
    """Synthesise by yosys; return the attributes of each register, and whether `in` drives it without logic."""
    values = " ".join(f"-chparam {name} {value}" for name, value in parameters.items())
    out = folder / "netlist.json"
    script = f"read_verilog {module}; hierarchy -check -top dac_synchronise {values}; proc; opt; write_json {out}"
    subprocess.run([tool("yosys"), "-q", "-p", script], check=True)
    (netlist,) = json.loads(out.read_text("utf-8"))["modules"].values()
    nets = {
        tuple(net["bits"]): (name, net["attributes"])
        for name, net in netlist["netnames"].items()
        if "chain" not in name
    }
    (inputs,) = (port["bits"] for name, port in netlist["ports"].items() if name == "in")
    flipflops = [cell for cell in netlist["cells"].values() if cell["type"] == "$dff"]
    return {
        nets[tuple(cell["connections"]["Q"])][0]: (
            nets[tuple(cell["connections"]["Q"])][1],
            cell["connections"]["D"] == inputs,
        )
        for cell in flipflops
    }


@pytest.mark.rest
def test_the_chain_has_the_attribute_of_vivado_and_the_name_of_the_constraints(tmp_path: Path) -> None:
    registers = synthesised(tmp_path, STAGES=3, PULSE=1)
    chain = {"dac_synchronise_first", "dac_synchronise_later"}
    assert {name for name, (attributes, _) in registers.items() if attributes.get("ASYNC_REG") == "TRUE"} == chain
    assert [name for name, (_, at_port) in registers.items() if at_port] == ["dac_synchronise_first"]
    assert len(registers) == 3  # with the one of the edges


@pytest.mark.rest
def test_logic_before_the_first_flipflop_would_be_seen(tmp_path: Path) -> None:
    text, old = MODULE.read_text("utf-8"), "dac_synchronise_first <= in;"
    assert text.count(old) == 1
    changed = tmp_path / MODULE.name
    changed.write_text(text.replace(old, "dac_synchronise_first <= !in;"), "utf-8")
    assert not any(at_port for _, at_port in synthesised(tmp_path, changed, STAGES=2).values())
