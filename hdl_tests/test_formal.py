"""Proofs for every program, request and clock: k-induction over the shipped modules, by the SAT solver of yosys.

The properties stand in ``formal/``, one file a harness. A wire ``a__b`` of a harness is the signal ``b`` of its
instance ``a``, connected here after flattening, so that the shipped modules stay free of assertions. Mutants show that
the harnesses can fail, and by what: a counterexample from power-up, not a lost induction.
"""

import itertools
import re
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from building import REPOSITORY, tool
from limits import PATIENCE_S
from sets import long
from test_lint import MODULES, SOURCES, path_of

pytestmark = pytest.mark.rest

FORMAL = REPOSITORY / "hdl_tests" / "formal"
COVER = re.compile(r"cover \((.*)\);")
PIPELINED = re.compile(r"`ifdef PIPELINED\n(.*?)`endif\n", re.DOTALL)  # what low area does not have
SHORT = re.compile(r"^// `(\w+)` is `([\w.]+)`$", re.MULTILINE)  # of an instance with a long name
ASIDE = re.compile(r"`ifndef PROPERTIES_ALONE\n.*?\n`endif\n", re.DOTALL)  # assertions that are no property


@dataclass(frozen=True)
class Proof:
    """A harness; how many clocks the induction looks back, and how many a counterexample may take."""

    top: str
    depth: int
    reach: int
    parameters: Mapping[str, int] = field(default_factory=dict)
    stubs: tuple[str, ...] = ()
    covers: int = 0
    asserts_in_stubs: bool = True
    maps_memory: bool = False  # its memories are registers, and words of them signals of the harness
    skip: int = 0  # clocks after power-up in which a mutant is not asked for a violation
    words: int = 0  # of `words.mem`, which the harness names: word n is n * 79337 modulo 2^18


ALL_STUBS = ("dac_axis", "dac_axis_serial", "dac_fourier", "dac_fit", "dac_whole")
SLOW_STUBS = ("dac_fit", "dac_whole", "dac_slow_fit", "dac_slow_engine", "dac_slow_store", "dac_slow_axis")
CONTROL_STUBS = ("dac_axis", "dac_fit", "dac_whole")
_14_BITS = {"X_INDEX_BITS": 14, "Y_INDEX_BITS": 14, "SLOW_INDEX_BITS": 14}
SERIAL = Proof("serial_properties", 1, 0)
PROOFS = {
    "slew": Proof("slew_properties", 1, 12, {"BITS": 4}),
    "slew_8_bits": Proof("slew_properties", 1, 0, {"BITS": 8}),
    "slew_16_bits": Proof("slew_properties", 1, 0, {"BITS": 16}),
    # These look back for as long as a sample is under way.
    "writes_pipelined": Proof("writes_properties", 26, 34, {"FOURIER": 1}, ALL_STUBS, 40),
    "writes_low_area": Proof("writes_properties", 10, 20, {"FOURIER": 1, "LOW_AREA": 1}, ALL_STUBS, 30),
    "scan": Proof("scan_properties", 2, 20, covers=20),
    "play_pipelined": Proof("play_properties", 2, 34, {}, ALL_STUBS, 40, asserts_in_stubs=False),
    "play_low_area": Proof("play_properties", 18, 26, {"LOW_AREA": 1}, ALL_STUBS, 30),
    "play_cubic": Proof("play_properties", 12, 67, {"CUBIC": 1}, ALL_STUBS, 90, asserts_in_stubs=False),
    "play_cubic_low_area": Proof("play_properties", 18, 26, {"CUBIC": 1, "LOW_AREA": 1}, ALL_STUBS, 30),
    "valid": Proof("valid_properties", 4, 20, covers=12),
    "sequencer": Proof("sequencer_properties", 1, 34, {}, CONTROL_STUBS, 40),
    "sequencer_of_look_up_tables": Proof("sequencer_properties", 1, 40, {"PLAIN_MULTIPLIER": 0}, CONTROL_STUBS, 52),
    "sequencer_that_shapes": Proof("sequencer_properties", 1, 35, {"SHAPING": 3}, CONTROL_STUBS, 41),
    "first": Proof("shaper_properties", 1, 8, {"SHAPING": 1}, covers=8),
    "second": Proof("shaper_properties", 2, 12, {"SHAPING": 2}, covers=12),
    "serial": SERIAL,
    "serial_that_shapes": Proof("serial_properties", 1, 0, {"SHAPING": 3}),
    "requests": Proof("request_properties", 2, 30),
    "windows": Proof("window_properties", 1, 16),
    # The product of a tick is made on the clocks after it.
    "scanner": Proof("scanner_properties", 7, 26, {"SHAPING": 3, "BITS": 2}),
    "scanner_of_3_bits": Proof("scanner_properties", 7, 26, {"SHAPING": 3, "BITS": 3}),
    "axi_lite": Proof("axi_properties", 1, 12),
    "wishbone": Proof("wishbone_properties", 1, 12),
    "synchronise": Proof("synchronise_properties", 5, 12, covers=12),
    "synchronise_by_four": Proof("synchronise_properties", 7, 16, {"STAGES": 4}, covers=16),
    "pixels": Proof("pixels_properties", 1, 12, covers=12),
    "fifo": Proof("fifo_properties", 1, 14, covers=14, maps_memory=True),
    "marker_delay": Proof("marker_delay_properties", 2, 10, covers=10, maps_memory=True),
    "product": Proof("product_properties", 1, 14, {"BITS": 10}),
    "product_of_words_of_21_bits": Proof("product_properties", 1, 14, {"BITS": 28}),
    "slow_play": Proof("slow_play_properties", 3, 26, {}, SLOW_STUBS, 26),
    "slow_divide": Proof("slow_divide_properties", 1, 20, covers=20),
    **{
        f"slow_store_{kind}": Proof("slow_store_properties", 1, 8, {"KIND": number})
        for number, kind in enumerate(("page", "fast", "second", "slow", "gains", "ratios"))
    },
    "slow_fit": Proof("slow_fit_properties", 1, 50, covers=4, skip=44),
    "slow_fit_of_14_bits": Proof("slow_fit_properties", 1, 0, {**_14_BITS, "LINE_BITS": 16}),
    "slow_engine": Proof("slow_engine_properties", 2, 6),
    "slow_engine_mix": Proof("slow_engine_properties", 2, 0, {"RATIO_BITS": 4, "RATIO_ZEROS": 10}),
    "slow_line": Proof("slow_line_properties", 1, 0, {}, ("dac_slow_divide",)),
    "slow_boot": Proof("slow_boot_properties", 1, 12, words=42),
    "slow_boot_without_waits": Proof("slow_boot_properties", 1, 50, {"WAITS": 0}, covers=50, words=42),
    "slow_axis": Proof("slow_axis_properties", 1, 14, {}, ("dac_axis_serial",), 16, asserts_in_stubs=False),
    "pair_slew": Proof("pair_slew_properties", 1, 14, {"BITS": 4}),
    "pair_slew_of_16_bits": Proof("pair_slew_properties", 1, 0, {"BITS": 16}),
    "pair_phase": Proof("pair_phase_properties", 1, 12, {"PERIOD_BITS": 4}),
    "pair_phase_of_31_bits": Proof("pair_phase_properties", 1, 0, {"PERIOD_BITS": 31}),
    "pair_table": Proof("pair_table_properties", 1, 10, maps_memory=True),
    "pair_play": Proof("pair_play_properties", 2, 60, {"ALTERNATE": 1}, ("dac_fit", "dac_whole", "dac_pair_delay"), 70),
    "pair_words": Proof("pair_words_properties", 2, 14, covers=14, maps_memory=True),
    "pair_programs": Proof("pair_program_properties", 6, 34, {}, ("dac_pair_delay", "dac_pair_words"), 34),
    "pair_delay": Proof("pair_delay_properties", 2, 8, {"CLOCKS": 3}, maps_memory=True),
    "pair_delay_of_64_clocks": Proof("pair_delay_properties", 2, 66, {"CLOCKS": 64}, maps_memory=True),
}
COVERS_AS_ASSERTIONS = """
(* techmap_celltype = "$cover" *)
module cover_as_assertion (input A, input EN);
    \\$assert assertion (.A(!A), .EN(EN));
endmodule
"""
# A further port to read a memory of an instance: the name of both is known after flattening alone.
MEMORY_PORT = """
module memory_port (input CLK, input EN, input [ABITS-1:0] ADDR, output [WIDTH-1:0] DATA);
    parameter MEMID = "";
    parameter ABITS = 1;
    parameter WIDTH = 1;
    parameter CLK_ENABLE = 0;
    parameter CLK_POLARITY = 1;
    parameter TRANSPARENT = 0;
endmodule
"""


def _read(proof: Proof, modules: Mapping[str, str], folder: Path, alone: bool = False, cover: int = -1) -> str:
    """The start of a yosys script: everything read, flattened, and the signals of the properties connected.

    ``alone`` leaves out what makes a harness inductive, where it marks that: a mutant has to break a property. A
    harness may choose its inputs then, so that a deep counterexample is found. Of the cover statements only number
    ``cover`` stays.
    """
    for path in FORMAL.glob("*.vh"):  # harnesses of the same modules share their ports
        shutil.copy(path, folder)
    texts = {path.stem: path.read_text("utf-8") for path in SOURCES} | dict(modules)
    for name, text in texts.items():
        if name not in proof.stubs:
            (folder / f"{name}.v").write_text(text, "utf-8")
    text = (FORMAL / f"{proof.top}.v").read_text("utf-8")
    if alone:
        text = "`define PROPERTIES_ALONE\n" + ASIDE.sub("", text)
    text = PIPELINED.sub("" if alone or proof.parameters.get("LOW_AREA") else r"\1", text)
    numbers = itertools.count()
    text = COVER.sub(lambda statement: statement[0] if next(numbers) == cover else ";", text)
    harness = folder / f"{proof.top}.v"
    memory = folder / "words.mem"
    memory.write_text("".join(f"{number * 79337 % 2**18:05x}\n" for number in range(proof.words)), "utf-8")
    harness.write_text(text.replace('"words.mem"', f'"{memory}"'), "utf-8")
    short = dict(SHORT.findall(text))
    seen = sorted(set(re.findall(r"\b\w*[a-z0-9]__\w+", text)))
    lines = [f"read_verilog -defer {folder / name}.v" for name in texts if name not in proof.stubs]
    for stub in proof.stubs:
        text = (FORMAL / f"{stub}.v").read_text("utf-8")
        (folder / f"{stub}_stub.v").write_text(text if proof.asserts_in_stubs else ASIDE.sub("", text), "utf-8")
        lines.append(f"read_verilog -formal -defer {folder / stub}_stub.v")
    port = folder / "memory_port.v"
    port.write_text(MEMORY_PORT, "utf-8")
    lines += [
        f"read_verilog -lib {port}",
        f"read_verilog -formal -defer {harness}",
        f"hierarchy -check -top {proof.top} " + " ".join(f"-chparam {k} {v}" for k, v in proof.parameters.items()),
        "proc; flatten; memory_map" if proof.maps_memory else "proc; flatten; chtype -set $memrd t:memory_port",
        *(f"connect -nounset -set {name} {_inner(name, short)}" for name in seen),
        f"check -assert; opt_clean; prep -top {proof.top}; memory_nordff; dffunmap; opt_clean",
    ]
    return "\n".join(lines) + "\n"


def _inner(name: str, short: Mapping[str, str]) -> str:
    """The signal ``b`` of the instance ``a`` for ``a__b``; a number at the end or on the way is an index."""
    instance, signal = re.sub(r"__(\d+)", r"[\1]", name).replace("__", ".").split(".", 1)
    return f"{short.get(instance, instance)}.{signal}"


def _proven(proof: Proof, folder: Path, modules: Mapping[str, str] | None = None) -> bool:
    induction = f"-tempinduct -maxsteps {max(proof.depth + 1, 4)}"
    read = _read(proof, modules or {}, folder)
    return _sat(read, induction, folder, "Induction step proven: SUCCESS!")


def _has_counterexample(read: str, reach: int, folder: Path, skip: int = 0) -> bool:
    """Search from power-up, over so many clocks, for a violation that does not come in the first ones."""
    if skip:
        return not _sat(read, f"-seq {reach} -prove-skip {skip}", folder, "no model found: SUCCESS!")
    return not _sat(read, f"-tempinduct -tempinduct-baseonly -maxsteps {reach}", folder, "proved base case")


def _mutant_has_counterexample(proof: Proof, folder: Path, modules: Mapping[str, str]) -> bool:
    """Search for a violation of a property, not of what makes it inductive."""
    read = _read(proof, modules, folder, alone=True)
    return _has_counterexample(read, proof.reach, folder, proof.skip)


def _sat(read: str, how: str, folder: Path, success: str) -> bool:
    script = folder / "prove.ys"
    options = f"-prove-asserts -set-assumes -verify {how}"
    script.write_text(read + f"memory_map; opt -full; sat {options}\n", "utf-8")
    done = subprocess.run([tool("yosys"), "-s", script], capture_output=True, text=True, timeout=PATIENCE_S)
    proven = success in done.stdout
    assert proven or "proof did fail" in done.stderr, done.stderr  # and not something else
    assert proven == (done.returncode == 0)
    return proven


# Wider words of what is proven beside them, and the longest of a harness; they take up to two minutes.
SLOW_PROOFS = {
    "slew_8_bits",
    "slew_16_bits",
    "writes_pipelined",
    "play_cubic",
    "serial_that_shapes",
    "scanner_of_3_bits",
    "product_of_words_of_21_bits",
    "pair_slew_of_16_bits",
    "pair_phase_of_31_bits",
    "pair_delay_of_64_clocks",
    "slow_engine_mix",
    "slow_fit_of_14_bits",
    "slow_store_gains",
    "slow_store_ratios",
}


@pytest.mark.parametrize("name", long(PROOFS.keys() - SLOW_PROOFS, PROOFS))
def test_holds_for_ever(name: str, tmp_path: Path) -> None:
    assert _proven(PROOFS[name], tmp_path)


SLOW = {"writes_pipelined", "play_cubic", "sequencer", "sequencer_of_look_up_tables", "sequencer_that_shapes"}
SLOW |= {"pair_play", "pair_programs"}
COVERED = [name for name, proof in PROOFS.items() if proof.covers]


@pytest.mark.parametrize("name", long(set(COVERED) - SLOW, COVERED))
def test_is_not_vacuous(name: str, tmp_path: Path) -> None:
    """Reach every cover statement: what the assumptions leave still plays a second program and images."""
    proof = PROOFS[name]
    techmap = tmp_path / "techmap.v"
    techmap.write_text(COVERS_AS_ASSERTIONS, "utf-8")
    statements = COVER.findall((FORMAL / f"{proof.top}.v").read_text("utf-8"))
    assert statements
    for number in range(len(statements)):
        folder = tmp_path / str(number)
        folder.mkdir()
        read = _read(proof, {}, folder, cover=number) + f"chformal -assert -remove; techmap -map {techmap}\n"
        assert _has_counterexample(read, proof.covers, folder), statements[number]


BOUNDS = FORMAL / "spline_bounds.smt2"
BOUNDS_MUTANTS = {  # what stands there, and instead
    "rounding_down": ("(<= (- half) third half)", "(<= (- 1) third 1)"),
    "another_bend": ("(* 24 (+ c0", "(* 23 (+ c0"),
    "fraction_of_two_segments": ("(< v half)", "(< v 1)"),
}


def _bounds(text: str) -> str:
    command = [tool("z3"), "-in"]
    return subprocess.run(command, input=text, capture_output=True, text=True, timeout=PATIENCE_S).stdout.strip()


def test_no_sample_of_a_spline_leaves_its_words() -> None:
    """Of words of any width: the rule and the error of its roundings, as the header of the file has them."""
    assert _bounds(BOUNDS.read_text("utf-8")) == "unsat"


@pytest.mark.parametrize("name", BOUNDS_MUTANTS)
def test_a_sample_of_another_rule_leaves_them(name: str) -> None:
    text = BOUNDS.read_text("utf-8")
    old, new = BOUNDS_MUTANTS[name]
    assert text.count(old) == 1
    assert _bounds(text.replace(old, new)) == "sat"


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
    "line_a_tick_longer": ("scan", "dac_scan", "[TICK_BITS-1:0] - 2", "[TICK_BITS-1:0] - 1"),
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
        "accepted_write = write && writable && exists;",
        "accepted_write = write && exists;",
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
    "fault_counter_wraps": ("valid", "dac_faults", " && count != {COUNT_BITS{1'b1}})", ")"),
    "fault_not_counted": ("valid", "dac_faults", "{{COUNT_BITS-1{1'b0}}, happens[i]}", "0"),
    "slew_fault_not_flagged": ("valid", "dac_verdict", "runs && !reached && !was", "runs && !reached && !runs && !was"),
    # f. refusals are said, a commit is kept
    "refusal_not_said": (
        "sequencer",
        "dac_sequencer",
        "(write && !(writable && exists)) ||",
        "(write && committed) ||",
    ),
    "commit_of_what_does_not_fit": ("sequencer", "dac_sequencer", "1'b0, sound_commit,", "1'b0, host_commit,"),
    "refused_commit_not_said": ("sequencer", "dac_sequencer", " || (commits && !fits)", ""),
    "commit_lost": ("scan", "dac_bank", "withdraw || take", "withdraw || take || (committed && !bank)"),
    "commit_not_withdrawn": ("scan", "dac_bank", "reset || withdraw || take", "reset || take"),
    # g. what stops a scan
    "park_ignored": ("requests", "dac_scan", "unloads) || go) && !park", "unloads) || go)"),
    "park_lost_to_trigger": (
        "requests", "dac_scan", "((plays_on && !unloads) || go) && !park", "((plays_on && !unloads && !park) || go)"
    ),
    "park_lost_to_arm": ("requests", "dac_scan", "&& !park && !reset;", "&& !(park && !arm) && !reset;"),
    "park_waits_for_a_tick": ("requests", "dac_scan", "&& !park && !reset;", "&& !(park && tick) && !reset;"),
    "park_leaves_it_armed": ("requests", "dac_scan", "if (park || reset) armed", "if (reset) armed"),
    "reset_ignored": ("requests", "dac_scan", "&& !park && !reset;", "&& !park;"),
    "trigger_without_arm": ("requests", "dac_scan", "trigger && (armed || arm)", "trigger"),
    "trigger_without_program": ("requests", "dac_scan", "(loaded || (committed && (tick || !withdraw)))", "1"),
    "trigger_before_the_first_tick_lost": (
        "requests", "dac_scan", "(committed && (tick || !withdraw))", "take"
    ),
    "withdrawn_and_started": ("requests", "dac_scan", "(committed && (tick || !withdraw))", "committed"),
    "withdrawn_and_running": ("requests", "dac_scan", "(plays_on && !unloads)", "plays_on"),
    "taken_and_withdrawn": ("requests", "dac_scan", "!loaded && !(tick && committed);", "!loaded;"),
    "trigger_restarts_a_scan": ("requests", "dac_scan", " && !plays_on;", ";"),
    "arm_alone_starts": ("requests", "dac_scan", "go = trigger && (armed || arm)", "go = (trigger && armed || arm)"),
    "armed_for_ever": ("requests", "dac_scan", "armed <= 1'b0;\n            frames_left", "frames_left"),
    "endless_count": ("requests", "dac_scan", "!(frame_ends && last_frame)", "1"),
    "count_a_frame_short": ("requests", "dac_scan", "frames_left == 1", "frames_left <= 2"),
    "count_of_lines": ("requests", "dac_scan", "!(frame_ends && last_frame)", "!(plays && last && last_frame)"),
    "count_of_the_last_arm": ("requests", "dac_scan", "frames_left <= arm ? arm_frames : ", "frames_left <= "),
    "count_is_endless_where_armed_before": ("requests", "dac_scan", ": armed_frames == 0;", ": arm_frames == 0;"),
    "line_number_does_not_wrap": ("requests", "dac_scan", "bottom ? {LINE_BITS{1'b0}} : at_line + 1", "at_line + 1"),
    "frame_a_line_longer": ("requests", "dac_scan", "[LINE_BITS-1:0] - 1;", "[LINE_BITS-1:0];"),
    "keep_goes_on_in_any_frame": ("requests", "dac_scan", "!(keep && can_keep)", "!keep"),
    "frame_goes_on_in_every_mode": ("requests", "dac_scan", "!(keep && can_keep)", "!can_keep"),
    "frame_does_not_wait": ("requests", "dac_scan", "running && at_frame && !top && !starts", "1'b0"),
    "scan_begins_where_it_was_parked": ("requests", "dac_scan", "            at_tick <= 0;\n", ""),
    "park_not_connected": ("play_pipelined", "dac_sequencer", ".park(park),", ".park(park && !trigger),"),
    "reset_not_connected": (
        "play_low_area", "dac_sequencer", "scan (\n        .clock(clock), .reset(reset)",
        "scan (\n        .clock(clock), .reset(reset && !arm)",
    ),
    "plays_what_did_not_run": ("play_pipelined", "dac_sequencer", "= runnings_now[LATENCY]", "= runnings[LATENCY-2]"),
    "low_area_plays_what_ran_before": ("play_low_area", "dac_sequencer", "runs <= runs_0;", "runs <= runs_0 || runs;"),
    "ticks_closer_than_a_product": ("play_cubic", "dac_sequencer", "SPACING = SPLINE ? 11", "SPACING = SPLINE ? 10"),
    "lost_tick_is_no_fault": ("play_cubic", "dac_sequencer", ".overrun(overrun),", ".overrun(overrun && !running),"),
    "lost_tick_is_no_fault_in_low_area": (
        "play_cubic_low_area", "dac_sequencer", ".overrun(overrun),", ".overrun(overrun && !running),"
    ),
    # h. the imaging window
    "window_a_tick_longer": ("windows", "dac_window", "idle_first + idle_count;", "idle_first + idle_count + 1;"),
    "window_a_tick_shorter": ("windows", "dac_window", "idle_first + idle_count;", "idle_first + idle_count - 1;"),
    "window_a_tick_long": ("windows", "dac_window", "idle_first + idle_count;", "idle_first + 1;"),
    "window_without_end": ("windows", "dac_window", "imaging <= !is_stop && (", "imaging <= ("),
    "window_into_the_next_line": ("windows", "dac_window", "imaging && !is_zero)", "imaging)"),
    "window_of_the_last_program": ("windows", "dac_window", "if (load) begin", "if (load && valid) begin"),
    "backward_window_not_seen": (
        "windows", "dac_markers", "settled_2 && (forward_imaging || backward_imaging)", "settled_2 && forward_imaging"
    ),
    "lines_outside_their_window": ("windows", "dac_markers", "(up_imaging || down_imaging)", "1"),
    # i. remainders are fed back by their definition, from 0 where a program begins
    "remainder_of_the_last_program": ("second", "dac_shaper", "begins || order == 2'd0", "order == 2'd0"),
    "difference_of_the_last_program": ("second", "dac_shaper", "begins || !order[1]", "!order[1]"),
    "carry_lost": ("first", "dac_shaper", "carry <= sum[BITS];", "carry <= 1'b0;"),
    "unshaped_is_shaped": ("first", "dac_shaper", "begins || order == 2'd0", "begins"),
    "first_order_is_second": ("second", "dac_shaper", "begins || !order[1]", "begins"),
    "second_order_without_its_zero": ("scanner", "dac_shaper", "word[14] || word[1:0] == 2'd2", "word[14]"),
    "product_of_three_digits": ("scanner", "dac_shaper", "step != 3'd0 && step != 3'd5", "step != 3'd0 && step < 3'd4"),
    # j. the products of a spline
    "product_without_its_carry": ("product", "dac_spline_step", "{term, minus}", "{term, 1'b0}"),
    "digit_of_two_is_one": (
        "product", "dac_spline_step", "{factor[BITS-1], factor, 1'b0}", "{{2{factor[BITS-1]}}, factor}"
    ),
    "product_goes_on": ("product", "dac_spline_step", "product <= 0;", "product <= product;"),
    "half_of_another_bit": ("product", "dac_spline_step", "half <= total[2];", "half <= total[1];"),
    "sum_of_the_next_clock": ("product", "dac_spline_step", "if (load) factor <= sum;", "if (!load) factor <= sum;"),
    # k. the rules of the buses
    "response_replaced": ("axi_lite", "dac_axi_lite", "w_kept && !s_axi_bvalid", "w_kept"),
    "response_of_a_reset_access": ("axi_lite", "dac_axi_lite", "s_axi_rvalid <= 1'b0;\n        end", "end"),
    "write_without_its_data": ("axi_lite", "dac_axi_lite", "may_write = aw_kept && w_kept", "may_write = aw_kept"),
    "word_while_not_writable": ("axi_lite", "dac_bus", "has_mode && !waits", "has_mode"),
    "mode_that_there_is_not": ("axi_lite", "dac_bus", "&& has_mode", ""),
    "answer_of_another_cycle": ("wishbone", "dac_wishbone", "ack_o = done && waits && cycle", "ack_o = done && cycle"),
    "answer_without_a_cycle": ("wishbone", "dac_wishbone", "err_o = done && waits && cycle", "err_o = done && waits"),
    # l. one pulse for each edge of another clock domain
    "a_stage_less": ("synchronise_by_four", "dac_synchronise", "level = chain[LATER]", "level = chain[LATER-1]"),
    "a_fall_is_a_rise": ("synchronise", "dac_synchronise", "(level || PULSE == 2)", "(level || PULSE != 2)"),
    "rises_alone": ("synchronise", "dac_synchronise", "(level || PULSE == 2)", "level"),
    "a_pulse_as_long_as_the_level": ("synchronise", "dac_synchronise", "level != level_before && (level", "(level"),
    "a_high_level_at_power_up_is_a_rise": (
        "synchronise", "dac_synchronise", "initial level_before = LEVEL", "initial level_before = 0"
    ),
    "a_chain_that_powers_up_low": ("synchronise", "dac_synchronise", "{LATER{LEVEL}}", "{LATER{1'b0}}"),
    # m. pixels of an ADC, their FIFO and the delay of their markers
    "sample_of_the_pulse_lost": ("pixels", "adc_pixels", "if (begins) sum <= term;", "if (begins) sum <= 0;"),
    "sum_goes_on": ("pixels", "adc_pixels", "else if (!counted) sum", "else sum"),
    "pixel_without_an_end": ("pixels", "adc_pixels", "(begins || sweep_ends || window_ends)", "(begins || sweep_ends)"),
    "pixel_ends_twice": ("pixels", "adc_pixels", "(open && !ends)", "open"),
    "valid_in_a_part": ("pixels", "adc_pixels", "(begins || complete) && valid", "valid"),
    "valid_though_parked": ("pixels", "adc_pixels", "complete && playing && count", "complete && count"),
    "last_though_it_goes_on": ("pixels", "adc_pixels", "sweep_ends || !begins,", "sweep_ends || begins,"),
    "column_skipped": ("pixels", "adc_pixels", "begins ? column_now + 16'd1", "pixel ? column_now + 16'd1"),
    "loss_is_silent": ("pixels", "adc_pixels", "lost <= full;", "lost <= 1'b0;"),
    "loss_is_not_counted": ("pixels", "adc_pixels", "lost_words + 16'd1", "lost_words"),
    "start_of_a_frame_lost": ("pixels", "adc_pixels", "full && (is_first", "1'b0 && (is_first"),
    "word_overwritten": ("fifo", "adc_fifo", "writes = write && !full", "writes = write"),
    "word_replaced": ("fifo", "adc_fifo", "stored != 0 && (!out_valid || out_ready)", "stored != 0"),
    "word_twice": ("fifo", "adc_fifo", "else if (out_ready) out_valid", "else if (0) out_valid"),
    "word_dropped": ("fifo", "adc_fifo", "else if (out_ready) out_valid", "else out_valid"),
    "word_never_sent": ("fifo", "adc_fifo", "reads = stored != 0", "reads = stored > 1"),
    "full_too_early": ("fifo", "adc_fifo", "full = stored[DEPTH_BITS]", "full = &stored[DEPTH_BITS-1:0]"),
    "marker_a_clock_late": ("marker_delay", "dac_marker_delay", "now + 1'b1 - delay", "now - delay"),
    "marker_of_its_neighbour": ("marker_delay", "dac_marker_delay", "past[now] <= in[i]", "past[now] <= in[0]"),
    "marker_without_its_bypass": ("marker_delay", "dac_marker_delay", "is_1 <= delay == 1", "is_1 <= 1'b0"),
    "a_line_settles_too_long": ("windows", "dac_markers", "settle_left <= 1;", "settle_left <= 0;"),
    # n. both axes by turns
    "pair_step_of_the_other_axis": ("pair_slew", "dac_pair_slew", "step = ~step_inverse;", "step = ~last_step;"),
    "pair_target_of_the_other_axis": ("pair_slew", "dac_pair_slew", "? ~target : target_2", "? ~target : target_1"),
    "pair_moves_without_a_tick": ("pair_slew", "dac_pair_slew", "if (valid_1)", "if (1)"),
    "pair_step_by_the_other_way": ("pair_phase", "dac_pair_phase", "advances ? at_step", "advances ? other_step"),
    "pair_phase_never_wraps": ("pair_phase", "dac_pair_phase", "advances && wraps;", "1'b0;"),
    "pair_phase_by_the_other_rest": (
        "pair_phase", "dac_pair_phase", ": {1'b0, at_remainder}", ": {1'b0, other_remainder}"
    ),
    "pair_delay_a_clock_longer": ("pair_delay", "dac_pair_delay", "BEHIND = 65 - ", "BEHIND = 64 - "),
    "pair_word_of_the_other_axis": (
        "pair_table", "dac_pair_table", "odd_row <= {read_y,", "odd_row <= {even_row[ROW_BITS+1],"
    ),
    "pair_word_of_the_other_bank": (
        "pair_table", "dac_pair_table", "{write_y, write_bank, write_index", "{write_y, read_bank, write_index"
    ),
    "pair_word_after_the_last_of_x": (
        "pair_table", "dac_pair_table", "next = read_y ? y_even : x_even", "next = x_even"
    ),
    "pair_digits_of_the_other_axis": ("pair_programs", "dac_pair_output", "i % 2 == 0 ? held[", "i % 2 == 1 ? held["),
    "pair_remainder_too_early": ("pair_programs", "dac_pair", "load_phase <= ends;", "load_phase <= is_remainder;"),
    "pair_ring_stands_still": ("pair_programs", "dac_pair_ring", "load ? value : other;", "load ? value : now;"),
    "pair_step_at_the_period": ("pair_words", "dac_pair_words", "was == PHASE_STEP", "was == PHASE_PERIOD"),
    "pair_step_of_x_for_y": ("pair_words", "dac_pair_words", "{1'b1, PHASE_STEP}", "{1'b0, PHASE_STEP}"),
    "pair_word_is_kept_too_short": ("pair_play", "dac_sequencer", "drained = swapped_done;", "drained = load_0;"),
    "pair_reads_what_is_written": ("pair_play", "dac_pair", "? tick_bank : y_bank;", "? tick_bank : !y_bank;"),
    "pair_takes_a_tick_a_clock": ("pair_play", "dac_sequencer", "works <= accepted_tick;", "works <= 1'b0;"),
    # o. lines with a slow part
    "slow_line_before_it_is_ready": ("slow_play", "dac_slow_part", "ready = ended && !other;", "ready = !other;"),
    "slow_words_of_the_old_program": ("slow_play", "dac_slow_part", ".bank(bank ^ is_idle)", ".bank(bank)"),
    "slow_half_does_not_change": ("slow_play", "dac_slow_part", "half <= half ^ changes;", "half <= half;"),
    "slow_divisor_stays_in_the_rest": (
        "slow_divide", "dac_slow_divide", "rest <= reduces ? less : from", "rest <= from"
    ),
    "slow_rest_is_not_reduced": ("slow_divide", "dac_slow_divide", "else if (twice || reduce)", "else if (twice)"),
    "slow_both_bits_are_one": ("slow_divide", "dac_slow_divide", "(add && here && there)", "(add && here)"),
    "slow_word_of_the_other_axis": (
        "slow_store_fast", "dac_slow_store", "fast_words[{write_bank, write_axis,", "fast_words[{write_bank, 1'b0,"
    ),
    "slow_word_of_another_part": (
        "slow_store_second", "dac_slow_store", "write_part && part == SECOND", "write_part && !part[1]"
    ),
    "slow_word_of_the_other_bank": (
        "slow_store_slow", "dac_slow_store", "{bank, axis, slow_index}", "{!bank, axis, slow_index}"
    ),
    "slow_word_does_not_stay": ("slow_store_slow", "dac_slow_store", "if (enable) begin", "begin"),
    "slow_page_by_turns": (
        "slow_store_page",
        "dac_slow_store",
        "pages[{write_bank, write_axis, write_address",
        "pages[{write_axis, write_bank, write_address",
    ),
    "slow_gain_of_another_knot": (
        "slow_store_gains",
        "dac_slow_store",
        "gains[{write_bank, write_axis, write_address[6:0]}]",
        "gains[{write_bank, write_axis, 1'b0, write_address[5:0]}]",
    ),
    "slow_ratio_of_another_knot": (
        "slow_store_ratios", "dac_slow_store", "ratios[{bank, axis, knot}]", "ratios[{bank, axis, 1'b0, knot[5:0]}]"
    ),
    "slow_gain_behind_the_last_one": (
        "slow_fit", "dac_slow_fit", "place < {7'd0, MOST_KNOTS}", "place <= {7'd0, MOST_KNOTS}"
    ),
    "slow_knots_of_more": ("slow_fit", "dac_slow_fit", "data[6:0] <= MOST_KNOTS && !data[7]", "!data[7]"),
    "slow_withdrawn_word_is_right": (
        "slow_fit",
        "dac_slow_fit",
        "(writes_spacing && y_page ? is_spacing : y_spaced)",
        "(y_spaced || (writes_spacing && y_page))",
    ),
    "slow_word_too_few": ("slow_fit", "dac_slow_fit", "(1 << Y_INDEX_BITS) + 8", "(1 << Y_INDEX_BITS) + 7"),
    "slow_ramp_of_the_next_line": ("slow_axis", "dac_slow_axis", "if (next) by <= next_ramp", "by <= next_ramp"),
    "slow_offset_in_the_next_line": ("slow_axis", "dac_slow_axis", "half ^ of_offset", "half"),
    "slow_offset_is_cut": ("slow_axis", "dac_slow_axis", "{{6{at[43]}}, at[43:18]}", "{6'd0, at[43:18]}"),
    "slow_axis_begins_too_early": ("slow_axis", "dac_slow_axis", ".tick(ticks[2])", ".tick(ticks[1])"),
    "slow_engine_writes_while_it_stands": (
        "slow_engine", "dac_slow_engine", "write = enable && ((state", "write = ((state"
    ),
    "slow_boot_begins_at_once": (
        "slow_boot", "dac_slow_boot", "started = waited == START[START_BITS-1:0]", "started = 1'b1"
    ),
    "slow_boot_does_not_wait": ("slow_boot", "dac_slow_boot", "if (reading && started && writable)", "if (reading)"),
    "slow_boot_of_a_word_twice": ("slow_boot", "dac_slow_boot", "   if (writable) begin", "   if (1'b1) begin"),
    "slow_boot_has_no_sign": ("slow_boot", "dac_slow_boot", "{{32{word[WORD_BITS-1]}}, word[", "{32'd0, word["),
    "slow_boot_of_ratios_as_gains": (
        "slow_boot_without_waits", "dac_slow_boot", "wire ends = place", "wire ends = !part[1] && place"
    ),
    "slow_boot_of_the_knots_of_x": (
        "slow_boot_without_waits", "dac_slow_boot", "(is_y ? LAST_Y_KNOT : LAST_X_KNOT)", "LAST_X_KNOT"
    ),
    "slow_boot_ends_a_word_early": (
        "slow_boot_without_waits", "dac_slow_boot", "read_at == LAST[", "read_at + 1'b1 == LAST["
    ),
    "slow_boot_commits_too_early": (
        "slow_boot_without_waits", "dac_slow_boot", "commit = !loading &&", "commit = !reading &&"
    ),
    "slow_boot_goes_on_after_a_reset": ("slow_boot", "dac_slow_boot", "            place <= 14'd0;\n", ""),
    "slow_half_is_lost": ("slow_divide", "dac_slow_divide", "half ? {1'b0, whole[REST_BITS-1:1]}", "half ? 0"),
}  # fmt: skip


# With the first one of each module in each harness.
FIRSTS = {(harness, module): name for name, (harness, module, _, _) in reversed(MUTANTS.items())}
LATE = {"pair_digits_of_the_other_axis", "pair_step_of_x_for_y"}  # many clocks deep
LATE |= {"slow_knots_of_more", "slow_word_too_few", "slow_withdrawn_word_is_right"}
LATE |= {"slow_page_by_turns", "slow_gain_of_another_knot", "slow_ratio_of_another_knot"}  # large memories
SOME = {*list(MUTANTS)[::6], *FIRSTS.values()} - LATE


@pytest.mark.parametrize("name", long(SOME, MUTANTS))
def test_mutant_has_a_counterexample(name: str, tmp_path: Path) -> None:
    harness, module, text, instead = MUTANTS[name]
    original = path_of(module).read_text("utf-8")
    assert original.count(text) == 1, f"{text} is {original.count(text)} times in {module}"
    mutated = {module: original.replace(text, instead)}
    assert _mutant_has_counterexample(PROOFS[harness], tmp_path, mutated)


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


# As these do, whose counterexamples lie 500 clocks of arithmetic deep: of the proof, module, text, and instead.
ENGINE_MUTANTS = {
    "slow_search_without_end": ("slow_engine", "if (reduces && knot != 7'd63)", "if (reduces)"),
    "slow_mix_a_bit_short": ("slow_engine_mix", "bits_left <= 6'd7", "bits_left <= 6'd6"),
    "slow_mix_cut_off": ("slow_engine_mix", "12'h800", "12'h000"),
    "slow_limit_is_the_other_one": ("slow_engine_mix", "beyond ? limits ^ sign_bit", "beyond ? ~limits ^ sign_bit"),
    "slow_table_a_word_longer": ("slow_engine", "if (word_ends) begin", "if (word_ends && !enable) begin"),
    "slow_gain_is_rounded_down": ("slow_line", "count == 6'd17 ? HALF :", "count == 6'd17 ? BETWEEN :"),
    "slow_gain_a_bit_short": ("slow_line", "count == 6'd17 ? HALF :", "count == 6'd16 ? HALF :"),
    "slow_ratio_is_the_gain": ("slow_line", "   here <= of_ratio ?", "   here <= 1'b0 ?"),
    "slow_gain_of_one_knot": ("slow_line", "NEXT: begin\n                    knot <= knot + 1;", "NEXT: begin"),
    "slow_gain_has_no_sign": ("slow_line", "{{14{between[17]}}, between};", "{14'd0, between};"),
    "slow_gain_of_the_word_that_was": ("slow_line", ".load_part(state == HERE)", ".load_part(state == NEXT)"),
    "slow_next_line_is_the_line": ("slow_line", "{{LINE_BITS{1'b0}}, state == SLOW_TAKE}", "{LINE_BITS+1{1'b0}}"),
    "slow_next_line_has_no_frame": ("slow_line", ".reduce(state == PLACE || state", ".reduce(state"),
    "slow_place_a_bit_short": ("slow_line", "{1'b0, slow_bits} + 6'd17", "{1'b0, slow_bits} + 6'd16"),
}


def test_the_documentation_counts_them() -> None:
    page = MODULES.parents[1] / "docs" / "verilog.md"
    assert f"{len(MUTANTS) + len(SERIAL_MUTANTS) + len(ENGINE_MUTANTS)} in all" in page.read_text("utf-8")


@pytest.mark.parametrize("name", long(("word_a_clock_late", "moves_at_once", "powers_up_elsewhere"), SERIAL_MUTANTS))
def test_mutant_of_the_low_area_axis_is_not_proven(name: str, tmp_path: Path) -> None:
    text, instead = SERIAL_MUTANTS[name]
    original = (MODULES / "dac_axis_serial.v").read_text("utf-8")
    assert original.count(text) == 1, f"{text} is {original.count(text)} times in dac_axis_serial"
    assert not _proven(SERIAL, tmp_path, {"dac_axis_serial": original.replace(text, instead)})


@pytest.mark.parametrize("name", long(("slow_search_without_end", "slow_next_line_has_no_frame"), ENGINE_MUTANTS))
def test_mutant_of_the_engine_is_not_proven(name: str, tmp_path: Path) -> None:
    proof, text, instead = ENGINE_MUTANTS[name]
    original = path_of("dac_slow_engine").read_text("utf-8")
    assert original.count(text) == 1, f"{text} is {original.count(text)} times in dac_slow_engine"
    assert not _proven(PROOFS[proof], tmp_path, {"dac_slow_engine": original.replace(text, instead)})
