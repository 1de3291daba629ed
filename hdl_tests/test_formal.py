"""Proofs for every program, request and clock: k-induction over the shipped modules, by yosys-smtbmc with z3.

The properties stand in ``formal/``, one file a harness. A wire ``a__b`` of a harness is the signal ``b`` of its
instance ``a``, connected here after flattening, so that the shipped modules stay free of assertions. Mutants show that
the harnesses can fail, and by what: a counterexample from power-up, not a lost induction.
"""

import re
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from building import REPOSITORY, tool
from limits import PATIENCE_S

pytestmark = pytest.mark.rest

FORMAL = REPOSITORY / "hdl_tests" / "formal"
MODULES = REPOSITORY / "firmware_templates" / "verilog"
PASSED, FAILED = "Status: PASSED", "Status: FAILED"


@dataclass(frozen=True)
class Proof:
    """A harness; how many clocks the induction looks back, and how many a counterexample may take."""

    top: str
    depth: int
    reach: int
    parameters: Mapping[str, int] = field(default_factory=dict)
    stubs: tuple[str, ...] = ()
    covers: int = 0


ALL_STUBS = ("dac_axis", "dac_axis_serial", "dac_fourier")
PROOFS = {
    "slew": Proof("slew_properties", 1, 12, {"BITS": 4}),
    # These look back for as long as a sample is under way.
    "writes_pipelined": Proof("writes_properties", 26, 34, {"LOW_AREA": 0}, ALL_STUBS, 40),
    "writes_low_area": Proof("writes_properties", 10, 20, {"LOW_AREA": 1}, ALL_STUBS, 30),
    "scan": Proof("scan_properties", 2, 20, covers=20),
    "valid": Proof("valid_properties", 4, 20, covers=12),
    "sequencer": Proof("sequencer_properties", 26, 34, stubs=("dac_axis",), covers=40),
    "sequencer_of_look_up_tables": Proof("sequencer_properties", 38, 40, {"PLAIN_MULTIPLIER": 0}, stubs=("dac_axis",)),
}


def _read(proof: Proof, modules: Mapping[str, str], folder: Path) -> str:
    """The start of a yosys script: everything read, flattened, and the signals of the properties connected."""
    texts = {path.stem: path.read_text("utf-8") for path in MODULES.glob("dac_*.v")} | dict(modules)
    for name, text in texts.items():
        if name not in proof.stubs:
            (folder / f"{name}.v").write_text(text, "utf-8")
    harness = FORMAL / f"{proof.top}.v"
    seen = sorted(set(re.findall(r"\b\w*[a-z0-9]__\w+", harness.read_text("utf-8"))))
    lines = [f"read_verilog -defer {folder}/dac_*.v"]
    lines += [f"read_verilog -formal -defer {FORMAL / stub}.v" for stub in proof.stubs]
    lines += [
        f"read_verilog -formal -defer {harness}",
        f"hierarchy -check -top {proof.top} " + " ".join(f"-chparam {k} {v}" for k, v in proof.parameters.items()),
        "proc; flatten",
        *(f"connect -nounset -set {name} {name.replace('__', '.')}" for name in seen),
        f"check -assert; opt_clean; prep -top {proof.top}; memory_nordff; dffunmap; opt_clean",
    ]
    return "\n".join(lines) + "\n"


def _translate(proof: Proof, folder: Path, modules: Mapping[str, str] | None = None) -> Path:
    script, smt2 = folder / "read.ys", folder / "proof.smt2"
    script.write_text(_read(proof, modules or {}, folder) + f"write_smt2 -wires {smt2}\n", "utf-8")
    subprocess.run([tool("yosys"), "-q", "-s", script], check=True, capture_output=True, text=True)
    return smt2


def _solve(smt2: Path, *options: str | int) -> str:
    command = [tool("yosys-smtbmc"), "--noprogress", "-s", Path(tool("z3")).name, *map(str, options), str(smt2)]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S).stdout


@pytest.mark.parametrize("name", PROOFS)
def test_holds_for_ever(name: str, tmp_path: Path) -> None:
    proof = PROOFS[name]
    smt2 = _translate(proof, tmp_path)
    base = _solve(smt2, "-t", proof.depth + 1)
    assert PASSED in base, base
    step = _solve(smt2, "-i", "-t", proof.depth)
    assert PASSED in step, step


# Where z3 is slow at sums of words: the same induction, base and step, by the SAT solver of yosys.
SERIAL = Proof("serial_properties", 1, 0)
WIDER = {
    "slew_8_bits": Proof("slew_properties", 1, 0, {"BITS": 8}),
    "slew_16_bits": Proof("slew_properties", 1, 0, {"BITS": 16}),
    "serial": SERIAL,
}


def _proven_by_sat(proof: Proof, folder: Path, modules: Mapping[str, str] | None = None) -> bool:
    script = folder / "prove.ys"
    induction = "memory_map; opt -full; sat -tempinduct -prove-asserts -set-assumes -verify -maxsteps 4\n"
    script.write_text(_read(proof, modules or {}, folder) + induction, "utf-8")
    done = subprocess.run([tool("yosys"), "-s", script], capture_output=True, text=True, timeout=PATIENCE_S)
    proven = "Induction step proven: SUCCESS!" in done.stdout
    assert proven or "proof did fail" in done.stderr, done.stderr  # and not something else
    assert proven == (done.returncode == 0)
    return proven


@pytest.mark.timeout(86_400)  # of 16 bits it takes two minutes
@pytest.mark.parametrize("name", WIDER)
def test_holds_for_ever_by_sat(name: str, tmp_path: Path) -> None:
    assert _proven_by_sat(WIDER[name], tmp_path)


@pytest.mark.parametrize("name", [name for name, proof in PROOFS.items() if proof.covers])
def test_is_not_vacuous(name: str, tmp_path: Path) -> None:
    """What the assumptions leave still plays a second program and images."""
    answer = _solve(_translate(PROOFS[name], tmp_path), "-c", "-t", PROOFS[name].covers)
    assert PASSED in answer, answer
    assert "Reached cover statement" in answer, answer


AT_Y = """[LATENCY-4:0]),
                .runnings(runnings_now[LATENCY-4:0]),
                .bank(bank), .restart(frame_0)"""
# Property, harness, module, text, and what stands there instead.
MUTANTS = {
    # a. a swap takes a committed program, at the start of a line
    "swap_in_mid_line": ("scan", "dac_scan", "(!running || first)", "1"),
    "swap_a_tick_early": ("scan", "dac_scan", "(!running || first)", "(!running || last)"),
    "swap_without_commit": ("scan", "dac_scan", "tick && committed &&", "tick &&"),
    "swap_only_at_rest": ("scan", "dac_scan", "(!running || first)", "!running"),
    "line_a_tick_longer": ("scan", "dac_scan", "idle_ticks - 2", "idle_ticks - 1"),
    # b. both axes, and all stages, change on the same tick
    "y_loads_a_clock_late": (
        "sequencer", "dac_sequencer", f".loads(loads_now{AT_Y}", f".loads(loads{AT_Y}"
    ),
    "y_reads_the_other_bank": (
        "sequencer", "dac_sequencer", ".bank(bank), .restart(frame_0)", ".bank(!bank), .restart(frame_0)"
    ),
    "x_registers_with_those_of_y": ("sequencer", "dac_sequencer", "address[15:4] == X_PAGE", "address[15:4] == Y_PAGE"),
    # c. no write reaches what plays
    "writable_while_committed": ("sequencer", "dac_bank", "!committed && !draining", "!draining"),
    "writable_while_draining": ("sequencer", "dac_bank", "!committed && !draining", "!committed"),
    "writes_not_gated": (
        "sequencer",
        "dac_sequencer",
        "accepted_write = write && writable;",
        "accepted_write = write;",
    ),
    "writable_as_a_commit_comes": ("sequencer", "dac_sequencer", " && !host_commit;", ";"),
    "drained_too_early": ("sequencer", "dac_sequencer", "drained = loads_now[LATENCY]", "drained = loads_now[4]"),
    "low_area_takes_a_tick_too_early": ("writes_low_area", "dac_sequencer", "tick && !busy;", "tick;"),
    "low_area_busy_too_short": ("writes_low_area", "dac_sequencer", "(works && !done)", "1'b0"),
    "host_writes_into_a_rendering": ("writes_low_area", "dac_sequencer", " && !rendering && ", " && "),
    "commit_before_it_is_rendered": (
        "writes_low_area", "dac_render", "default: if (!start && !busy)", "default: if (!start)"
    ),
    "rendering_not_cancelled": ("writes_low_area", "dac_render", ".reset(cancel)", ".reset(1'b0)"),
    # d. a step is at most max_step, towards the target
    "guard_compares_only_above": ("slew", "dac_slew", "wire is_below = below[BITS+2]", "wire is_below = 1'b0"),
    "guard_off_by_one": ("slew", "dac_slew", "{2'b11, step_inverse} + 1", "{2'b11, step_inverse}"),
    "guard_wraps": (
        "slew", "dac_slew", "{1'b0, target} + {1'b1, delta_inverse} + 1", "{1'b0, target + delta_inverse} + 1"
    ),
    "guard_forgets_how_far": ("slew", "dac_slew", "{{2{behind[BITS]}}, behind} + {delta_less", "0 + {delta_less"),
    # e. valid only when settled, on target and without a fault
    "valid_with_a_fault": ("valid", "dac_verdict", "images && reached && !faulty", "images && reached"),
    "valid_with_a_fault_between_ticks": ("valid", "dac_verdict", "else if (faulty)", "else if (1'b0)"),
    "valid_off_the_target": ("valid", "dac_verdict", "images && reached && !faulty", "images && !faulty"),
    "valid_while_it_settles": ("valid", "dac_markers", "runs_2 && settled_2 &&", "runs_2 &&"),
    "a_settle_line_dropped": ("valid", "dac_markers", "settle_left <= 1;", "settle_left <= 2;"),
    "settle_lines_of_the_last_program": ("valid", "dac_markers", ".load(load),", ".load(1'b0),"),
    "fault_forgotten": ("valid", "dac_faults", "faults) | happens", "faults & happens) | happens"),
    # f. refusals are said, a commit is kept
    "refusal_not_said": ("sequencer", "dac_sequencer", "if (write && !writable)", "if (write && committed)"),
    "commit_lost": ("scan", "dac_bank", "withdraw || take", "withdraw || take || (committed && !bank)"),
    "commit_not_withdrawn": ("scan", "dac_bank", "reset || withdraw || take", "reset || take"),
}  # fmt: skip


@pytest.mark.parametrize("name", MUTANTS)
def test_mutant_has_a_counterexample(name: str, tmp_path: Path) -> None:
    harness, module, text, instead = MUTANTS[name]
    proof = PROOFS[harness]
    original = (MODULES / f"{module}.v").read_text("utf-8")
    assert original.count(text) == 1, f"{text} is {original.count(text)} times in {module}"
    answer = _solve(_translate(proof, tmp_path, {module: original.replace(text, instead)}), "-t", proof.reach)
    assert FAILED in answer, answer
    assert "Assert failed" in answer, answer


# A counterexample from power-up would lie 40 clocks of arithmetic deep: these fail in the step of the induction, from a
# state that the shipped text keeps, and the last one in its base.
SERIAL_MUTANTS = {
    "only_upwards": ("HOLD_LOWER: begin\n                if (beyond) a <= m;", "HOLD_LOWER: begin"),
    "wrong_sign": ("code} - step_word;", "code} + step_word;"),
    "word_a_clock_late": ("TARGET, UPPER: address", "UPPER: address"),
    "moves_at_once": (
        "step == DONE) begin\n            if (loaded)",
        "step == DONE || restart) begin\n            if (loaded)",
    ),
    "powers_up_elsewhere": ("code = POWER_UP_CODE[DAC_BITS-1:0]", "code = 0"),
}


def test_the_documentation_counts_them() -> None:
    page = MODULES.parents[1] / "docs" / "verilog.md"
    assert f"{len(MUTANTS) + len(SERIAL_MUTANTS)} in all" in page.read_text("utf-8")


@pytest.mark.parametrize("name", SERIAL_MUTANTS)
def test_mutant_of_the_low_area_axis_is_not_proven(name: str, tmp_path: Path) -> None:
    text, instead = SERIAL_MUTANTS[name]
    original = (MODULES / "dac_axis_serial.v").read_text("utf-8")
    assert original.count(text) == 1, f"{text} is {original.count(text)} times in dac_axis_serial"
    assert not _proven_by_sat(SERIAL, tmp_path, {"dac_axis_serial": original.replace(text, instead)})
