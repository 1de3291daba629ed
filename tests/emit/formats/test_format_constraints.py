"""Constraints of vendors: their Tcl runs in a Tcl interpreter with commands that record what they are given.

No tool of a vendor reads them here. Names of files are those of the build; clocks and names of flip-flops are those of
the scan and of the module.
"""

import re
import subprocess
from fractions import Fraction
from pathlib import Path

import pytest
from building import NAME, REPOSITORY, tool, write_variant
from formatted import SHORT, Formatted, check_finds_a_flip, formatted
from replacing import replace

from tablegen.certificate.certificate import certify
from tablegen.config.load import load
from tablegen.emit.render import render
from tablegen.emit.write import write_files
from tablegen.planning.line_plan import make_plan

pytestmark = pytest.mark.common
CLOCK_HZ = 100e6
TEXTS = [f"{NAME}.xdc", f"{NAME}.lpf"] + [f"{NAME}_{tool}.sdc" for tool in ("quartus", "radiant", "gowin")]
SCRIPTS = [f"{NAME}_vivado.tcl", f"{NAME}_quartus.tcl"]
MODULE = REPOSITORY / "firmware_templates" / "verilog" / "cdc" / "dac_synchronise.v"
# Defines the commands of a tool: each prints its name and what it is given, and returns that in angle brackets.
COMMANDS = """
foreach name {%s} {
    proc $name {args} {
        set call [list [lindex [info level 0] 0] {*}$args]
        puts [join $call "\\t"]
        return "<[join $call]>"
    }
}
source {%s}
"""
GETTERS = {
    ".xdc": "get_ports get_cells",
    "_quartus.sdc": "get_ports get_registers",
    "_radiant.sdc": "get_ports get_cells",
    "_gowin.sdc": "get_ports get_regs",
}
SDC = "create_clock set_false_path derive_pll_clocks derive_clock_uncertainty"
VIVADO = "add_files set_property get_property current_fileset"
QUARTUS = "set_global_assignment"


def calls_of(path: Path, commands: str) -> list[list[str]]:
    """Run a script; return the calls of these commands. Any other one ends it."""
    script = COMMANDS % (commands, path)
    done = subprocess.run([tool("tclsh")], input=script, capture_output=True, text=True, check=False)
    if done.stderr:
        raise ValueError(done.stderr.splitlines()[0])
    return [line.split("\t") for line in done.stdout.splitlines()]


@pytest.fixture(scope="module")
def clocked(tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    """A build with the clock of its FPGA."""
    folder = tmp_path_factory.mktemp("constraints")
    scan = {**SHORT.scan, "emit.clock_hz": CLOCK_HZ}
    plan = make_plan(load(write_variant(folder / "scan", replace(SHORT, scan=scan))))
    files = render(plan, certify(plan), ("constraints",))
    write_files(folder / "out", files)
    return Formatted(folder / "out", files)


def without_comments(path: Path) -> Path:
    """A copy of an SDC of Gowin without its comments, which begin with // there."""
    text = path.read_text("ascii")
    (copy := path.with_suffix(".tcl.sdc")).write_text(re.sub(r"(?m)^//.*\n", "", text), "ascii")
    return copy


@pytest.mark.parametrize("ending", GETTERS)
def test_the_clock_is_that_of_the_scan_and_the_path_that_of_the_synchroniser(clocked: Formatted, ending: str) -> None:
    path = clocked.folder / f"{NAME}{ending}"
    calls = calls_of(without_comments(path) if "gowin" in ending else path, f"{SDC} {GETTERS[ending]}")
    (clock,) = [call for call in calls if call[0] == "create_clock"]
    options = dict(zip(clock[1:5:2], clock[2:5:2], strict=True))
    assert options == {"-name": f"{NAME}_clock", "-period": "10.000"}
    assert clock[5] == "<get_ports clock>"
    (false_path,) = [call for call in calls if call[0] == "set_false_path"]
    assert false_path[-2] == "-to"
    assert re.search(r"\*dac_synchronise_first(_reg)?\*", false_path[-1])
    assert f"reg {'dac_synchronise_first'};" in MODULE.read_text("ascii")


def test_the_preference_of_lattice_has_the_same_clock(clocked: Formatted) -> None:
    lines = [line for line in clocked.file(".lpf").decode("ascii").splitlines() if not line.startswith("#")]
    assert lines == ['FREQUENCY PORT "clock" 100.000000 MHz ;', 'BLOCK PATH TO CELL "*dac_synchronise_first*" ;']


@pytest.mark.parametrize("name", TEXTS)
def test_without_a_clock_a_comment_says_that_there_is_none(tmp_path: Path, name: str) -> None:
    text = formatted(tmp_path, "short", "constraints").files[name].decode("ascii")
    assert "clock_hz: constrain the clock here" in text
    assert "create_clock" not in text
    assert "FREQUENCY" not in text


def added(clocked: Formatted, calls: list[list[str]], kinds: tuple[str, ...]) -> list[str]:
    """The files of some kinds of calls, all of them in the folder of the build."""
    paths = [Path(call[-1]) for call in calls if " ".join(call[:-1]).endswith(kinds)]
    assert {path.parent for path in paths} == {clocked.folder.resolve()}
    return [path.name for path in paths]


def test_vivado_is_given_every_file_of_the_build(clocked: Formatted) -> None:
    calls = calls_of(clocked.folder / SCRIPTS[0], VIVADO)
    verilog = [name for name in clocked.files if name.endswith((".v", ".vh", ".mem"))]
    assert sorted(added(clocked, calls, ("<current_fileset>",))) == sorted(verilog)
    assert added(clocked, calls, ("<current_fileset -constrset>",)) == [f"{NAME}.xdc"]
    (directories,) = [call for call in calls if call[0] == "set_property"]
    assert directories[1:] == [
        "include_dirs",
        f"<get_property include_dirs <current_fileset>> {clocked.folder.resolve()}",
        "<current_fileset>",
    ]


def test_quartus_is_given_every_file_of_the_build(clocked: Formatted) -> None:
    calls = calls_of(clocked.folder / SCRIPTS[1], QUARTUS)
    names = {
        ending: sorted(name for name in clocked.files if name.endswith(ending)) for ending in (".v", ".vh", ".mem")
    }
    assert sorted(added(clocked, calls, ("VERILOG_FILE",))) == names[".v"]
    assert sorted(added(clocked, calls, ("MISC_FILE",))) == sorted(names[".vh"] + names[".mem"])
    assert added(clocked, calls, ("SDC_FILE",)) == [f"{NAME}_quartus.sdc"]
    assert [call[2:] for call in calls if call[2] in ("SEARCH_PATH", "VERILOG_MACRO")] == [
        ["SEARCH_PATH", str(clocked.folder.resolve())],
        ["VERILOG_MACRO", "SYNTHESIS=1"],
    ]


def test_a_command_that_no_tool_has_ends_the_script(clocked: Formatted, tmp_path: Path) -> None:
    text = clocked.files[SCRIPTS[0]].decode("ascii")
    (tmp_path / "script.tcl").write_text(text.replace("add_files", "add_file", 1), "ascii")
    with pytest.raises(ValueError, match='invalid command name "add_file"'):
        calls_of(tmp_path / "script.tcl", VIVADO)


def test_a_missing_brace_ends_the_script(clocked: Formatted, tmp_path: Path) -> None:
    text = clocked.files[f"{NAME}.xdc"].decode("ascii")
    assert text.endswith("}]\n")
    (tmp_path / "script.tcl").write_text(text[:-3] + "]\n", "ascii")
    with pytest.raises(ValueError, match="missing close-brace"):
        calls_of(tmp_path / "script.tcl", f"{SDC} {GETTERS['.xdc']}")


@pytest.mark.parametrize(("rate", "clock", "period"), [(1e6, 12e6, "83.333"), (300e3, 48e6, "20.833")])
def test_periods_are_rounded_down(tmp_path: Path, rate: float, clock: float, period: str) -> None:
    timing = SHORT.scan["timing"]
    assert isinstance(timing, dict)
    scan = {**SHORT.scan, "dac.update_rate_hz": rate, "emit.clock_hz": clock, "limits": {}}
    scan["timing"] = {**timing, "line_rate_hz": rate / timing["ticks_per_line"]}
    plan = make_plan(load(write_variant(tmp_path / "scan", replace(SHORT, scan=scan))))
    text = render(plan, certify(plan), ("constraints",))[f"{NAME}.xdc"].decode("ascii")
    assert f"-period {period} " in text
    assert Fraction(period) <= Fraction(10**9) / Fraction(clock) < Fraction(period) + Fraction(1, 1000)


def test_a_changed_digit_is_found(tmp_path: Path) -> None:
    check_finds_a_flip(formatted(tmp_path, "short", "constraints"), "constraints", [*TEXTS, *SCRIPTS])
