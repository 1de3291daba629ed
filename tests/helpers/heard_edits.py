"""Edits of the Verilog that a build emits, each of which a session of ``tablegen verify`` has to find by itself.

A session is prepared once, and played with one file edited by Icarus alone, without cocotb; it ends where the first
tick or state differs. What stands beside the sequencer is played by the bench of outputs, in a fraction of a second.
"""

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from tablegen.manifest.read import read_build
from tablegen.verification.build_report import PlayJob
from tablegen.verification.checks.played_checks import Check, check_outputs
from tablegen.verification.play.capture import make_capture
from tablegen.verification.play.placement import Placement
from tablegen.verification.play.sequencer_shape import CAPTURE, SCRIPT
from tablegen.verification.play.stream import read_capture
from tablegen.verification.verilog.bench import (
    BOOT,
    OUTPUT_BENCH,
    OUTPUTS,
    TOP,
    read_outputs,
    write_boot_files,
)
from tablegen.verification.verilog.target import VerilogTarget, _memories

_COUNTERS = ("strobes", "ticks", "jitter", "latency")
_EARLY_END = """\
`timescale 1ns / 1ps
module early_end;
    reg [63:0] expected [0:{last}];
    reg [5:0] states [0:{last_state}];
    integer at = 0, state = 0, status;
    initial begin
        $readmemh("../expected.hex", expected);
        $readmemh("../flags.hex", states);
    end
    wire [63:0] command = {top}.bench.command;
    wire [5:0] flags = {{{top}.bench.busy, {top}.bench.running, {top}.bench.armed, {top}.bench.committed,
                        {top}.bench.refused, {top}.bench.writable}};
    always @(command)
        if (command[63:60] == 4'd6) begin  // before the clock of this command
            if (flags !== states[state]) begin
                $display("state %0d differs", state);
                $finish;
            end
            state = state + 1;
        end
    always @(negedge {top}.bench.clock) #1
        if ({top}.bench.strobe) begin
            if ({top}.bench.sample !== expected[at]) begin
                $display("tick %0d differs", at);
                $finish;
            end
            at = at + 1;
        end
    always @(posedge {top}.finished) #20 begin
        status = $fopen("../status.txt", "w");
        $fwrite(status, "%0d %0d %0d %0d\\n", {top}.strobes, {top}.ticks, {top}.jitter, {top}.latency);
        $fwrite(status, "%0d %0d %0d %0d\\n", {top}.fault_counts[31:0], {top}.fault_counts[63:32],
                {top}.fault_counts[95:64], {top}.fault_counts[127:96]);
        $fclose(status);
        $finish;
    end
endmodule
"""


@dataclass(frozen=True)
class Edit:
    """A fault of an emitted file, by its name without ``.v``."""

    breaks: str
    file: str
    old: str
    new: str

    def text(self, folder: Path) -> str:
        """The file of a build with the fault in it."""
        text = (folder / f"{self.file}.v").read_text("ascii")
        assert text.count(self.old) == 1, f"{self.file}.v has {text.count(self.old)} times {self.old!r}"
        return text.replace(self.old, self.new)


class PreparedPlay:
    """The session of a build, as ``tablegen verify --axis blocks --ticks 1000`` plays it."""

    def __init__(self, folder: Path, work: Path) -> None:
        self.folder, self.work, stored = folder, work, read_build(folder)
        self.target = VerilogTarget("icarus", Placement("blocks"))
        memories, missing = _memories(folder, work, stored, self.target.placement)
        assert memories is not None, missing
        limits = {name: axis.certificate.max_error_lsb for name, axis in stored.axes}
        self.job = PlayJob(folder, work, stored, limits, 1000, 1, lambda _: None)
        (self.run,) = self.target._runs(self.job, memories)
        self.sources = sorted(folder.glob("dac_*.v"))
        self.run.prepare("icarus", stored, [work / stored.manifest.name, *self.sources], folder)
        expected = self.run.session.script.expected
        (work / "expected.hex").write_text("".join(f"{word:016x}\n" for word in expected), "ascii")
        flags = [
            sum(flag << bit for bit, flag in enumerate(state.flags)) for _, state in self.run.session.script.states
        ]
        (work / "flags.hex").write_text("".join(f"{word:02x}\n" for word in flags), "ascii")
        text = _EARLY_END.format(top=TOP, last=len(expected) - 1, last_state=len(flags) - 1)
        (work / "early_end.v").write_text(text, "ascii")

    def judge(self, edit: Edit | None, folder: Path) -> str | None:
        """How a session finds an edit, or finds fault with the build as it is; None if it does not."""
        benches = [Path(path) for path in self.run.job["sources"] if Path(path).suffix == ".v"]
        benches = [path for path in benches if not path.name.startswith("dac_") and path.parent != self.folder]
        sources = _edited(self.sources, edit, self.folder, folder)
        for name in (SCRIPT, "expected.hex", "flags.hex", *BOOT.values()):
            shutil.copy(self.work / name, folder)
        words = [f"-I{self.folder}", *map(str, sources), *map(str, benches), str(self.work / "early_end.v")]
        log = _simulate(folder, {TOP: self.run.job["parameters"]}, ["-s", "early_end", *words])
        if "differs" in log:
            return log
        lines = [line.split() for line in (folder / "status.txt").read_text("ascii").splitlines()]
        status = dict(zip(_COUNTERS, map(int, lines[0]), strict=True))
        counts = [int(count) if count.isdigit() else -1 for count in lines[1]]
        script = self.run.session.script
        capture = make_capture(self.job.stored, script, read_capture(folder / CAPTURE))
        self.run.folder = folder
        checks = self.target._outcome(self.job, [self.run], [{**status, "counts": counts}], [capture]).checks
        return _first_failure(checks)


def judge_output(edit: Edit | None, folder: Path, runtime: Path) -> str | None:
    """The same by the bench of outputs alone."""
    names = ("dac_coding", "dac_spi", "dac_axi_stream", "dac_boot")
    sources = _edited([runtime / f"{name}.v" for name in names], edit, runtime, folder)
    write_boot_files(folder)
    keys = ("RESULTS", "PROGRAM_FILE", "X_FILE", "Y_FILE")
    parameters = {key: f"../{name}" for key, name in zip(keys, (OUTPUTS, *BOOT.values()), strict=True)}
    _simulate(folder, {"output_bench": parameters}, [*map(str, sources), str(OUTPUT_BENCH)])
    return _first_failure(check_outputs(read_outputs(folder)))


def _edited(sources: list[Path], edit: Edit | None, runtime: Path, folder: Path) -> list[Path]:
    (folder / "run").mkdir(parents=True, exist_ok=True)
    if edit is None:
        return sources
    edited = folder / f"{edit.file}.v"
    edited.write_text(edit.text(runtime), "ascii")
    return [edited if path.name == edited.name else path for path in sources]


def _simulate(folder: Path, top: dict[str, dict[str, int | str]], words: list[str]) -> str:
    """Compile and run; what the simulation printed."""
    line = ["iverilog", "-g2005", "-o", "model.vvp"]
    for name, parameters in top.items():
        line += ["-s", name]
        for key, value in parameters.items():
            line.append(f"-P{name}.{key}=" + (f'"{value}"' if isinstance(value, str) else str(value)))
    subprocess.run([*line, *words], cwd=folder, check=True, capture_output=True)
    done = subprocess.run(["vvp", "-n", "../model.vvp"], cwd=folder / "run", check=True, capture_output=True, text=True)
    return done.stdout.strip()


def _first_failure(checks: list[Check]) -> str | None:
    return next((check.failure for check in checks if check.failure is not None), None)


SEQUENCER: tuple[Edit, ...] = (
    Edit("no second swap", "dac_bank", "bank <= !bank", "bank <= 1'b1"),
    Edit("registers load once", "dac_register", "if (load) value <= idle", "if (load && value == 0) value <= idle"),
    Edit("offset loads once", "dac_offset", "if (load_high) high", "if (load_high && high == 0) high"),
    Edit(
        "pixels are loaded a clock late",
        "dac_markers",
        """    always @(posedge clock) begin
        tick_1 <= tick;
        tick_2 <= tick_1;
        load_1 <= load;
""",
        """    reg load_late;
    initial load_late = 0;
    always @(posedge clock) begin
        tick_1 <= tick;
        tick_2 <= tick_1;
        load_late <= load;
        load_1 <= load_late;
""",
    ),
    Edit("an empty window opens", "dac_window", "opens <= is_first && !is_stop;", "opens <= is_first;"),
    Edit("no lower clamp", "dac_output", "over_min[CODE_BITS-1] ? {CODE_BITS{1'b1}} : ~over_min", "~over_min"),
    Edit("no upper clamp", "dac_output", "running && room[CODE_BITS-1] ? {DAC_BITS{1'b1}} : ", ""),
    Edit("no guard upwards", "dac_slew", "is_above = !above[BITS+2]", "is_above = 1'b0"),
    Edit("no guard downwards", "dac_slew", "is_below = below[BITS+2]", "is_below = 1'b0"),
    Edit(
        "slew not flagged",
        "dac_verdict",
        "{underrun, overrun, clamp_fault, slew_fault}",
        "{underrun, overrun, clamp_fault, 1'b0}",
    ),
    Edit(
        "clamp not flagged",
        "dac_verdict",
        "{underrun, overrun, clamp_fault, slew_fault}",
        "{underrun, overrun, 1'b0, slew_fault}",
    ),
    Edit(
        "underrun not flagged",
        "dac_verdict",
        "{underrun, overrun, clamp_fault, slew_fault}",
        "{1'b0, overrun, clamp_fault, slew_fault}",
    ),
    Edit("valid in spite of faults", "dac_verdict", "images && reached && !faulty", "images && reached"),
    Edit("counters do not saturate", "dac_faults", " && count != {COUNT_BITS{1'b1}}", ""),
    Edit("clear leaves the counts", "dac_faults", ("if (clear)\n"), ("if (1'b0)\n")),
    Edit("frames without end", "dac_scan", "frame_ends && last_frame", "1'b0"),
    Edit("one frame too many", "dac_scan", "frames_left == 1 && !endless", "frames_left == 0 && !endless"),
    Edit("park ignored", "dac_scan", "(still_running || go) && !park", "(still_running || go)"),
    Edit("park leaves it armed", "dac_scan", "if (park || reset) armed", "if (reset) armed"),
    Edit("reset ignored", "dac_scan", "&& !park && !reset", "&& !park"),
    Edit("trigger without arm", "dac_scan", "trigger && (armed || arm)", "trigger"),
    Edit("arm starts", "dac_scan", "go = trigger && (armed || arm)", "go = (arm || trigger && armed)"),
    Edit("swap in mid-line", "dac_scan", "committed && (!running || first)", "committed"),
    Edit("withdraw ignored", "dac_bank", "reset || withdraw || take", "reset || take"),
    Edit("always writable", "dac_bank", "writable = !committed && !draining", "writable = 1'b1"),
    Edit("never refused", "dac_sequencer", "refused <= 1'b1", "refused <= 1'b0"),
    Edit("refused for ever", "dac_sequencer", "else if (clear_faults || reset)", "else if (1'b0)"),
    Edit(
        "settling ends a line short", "dac_markers", "settled_2 <= settle_left <= 1;", "settled_2 <= settle_left <= 2;"
    ),
    Edit(
        "the last settling line is lost",
        "dac_markers",
        "settle_left <= settle_lines;",
        "settle_left <= settle_lines - 1;",
    ),
    Edit(
        "settle lines are loaded late",
        "dac_markers",
        ".data(write_data[7:0]), .load(load)",
        ".data(write_data[7:0]), .load(load_1)",
    ),
    Edit(
        "seven bits of settle lines",
        "dac_markers",
        ".data(write_data[7:0]), .load(load)",
        ".data({1'b0, write_data[6:0]}), .load(load)",
    ),
    Edit(
        "an empty window images",
        "dac_window",
        (
            "opens <= is_first && !is_stop;\n"
            "            imaging <= !is_stop && (is_first || (JUMPS == 0 && imaging && !is_zero));"
        ),
        ("opens <= is_first;\n            imaging <= is_first || (!is_stop && JUMPS == 0 && imaging && !is_zero);"),
    ),
    Edit("a window goes on behind the line", "dac_window", "imaging && !is_zero)", "imaging)"),
    Edit("a part of a program is committed", "dac_sequencer", "words_fit && whole && ", "words_fit && "),
    Edit("a trigger does not see the program that waits", "dac_scan", "(loaded || committed)", "loaded"),
    Edit("a trigger on the last tick is lost", "dac_scan", "&& !still_running;", "&& !running;"),
    Edit(
        "last tick is not forgotten",
        "dac_scan",
        ("            last <= 1'b0;\n            starts"),
        "            starts",
    ),
    Edit(
        "first is not set by a start",
        "dac_scan",
        ("            first <= 1'b1;\n            last <= 1'b0;"),
        "            last <= 1'b0;",
    ),
    Edit(
        "the count of frames wraps at 8 bits",
        "dac_scan",
        "frames_left <= arm ? arm_frames : armed_frames;",
        "frames_left <= arm ? {8'd0, arm_frames[7:0]} : armed_frames;",
    ),
    Edit(
        "reset does not beat arm",
        "dac_scan",
        "if (park || reset) armed <= 1'b0;",
        "if (park || (reset && !arm)) armed <= 1'b0;",
    ),
    Edit(
        "commit goes on in spite of a reset",
        "dac_sequencer",
        "commit && writable && !withdraw && !reset;",
        "commit && writable && !withdraw;",
    ),
    Edit(
        "an unfit program is committed",
        "dac_sequencer",
        ".commit(host_commit && fits), .bank(bank),",
        ".commit(host_commit), .bank(bank),",
    ),
    Edit(
        "an unfit commit is not said",
        "dac_sequencer",
        "(write && !(writable && exists)) || (host_commit && !fits) || misfilled || unrendered",
        "(write && !(writable && exists)) || misfilled || unrendered",
    ),
    Edit(
        "registers of y are those of x too",
        "dac_sequencer",
        "write_region == PROGRAM && write_address[15:4] == X_PAGE",
        "write_region == PROGRAM && (write_address[15:4] == X_PAGE || write_address[15:4] == Y_PAGE)",
    ),
    Edit(
        "clearing waits for no tick",
        "dac_sequencer",
        "clear_waits <= clear_faults || reset || (clear_waits && !accepted_tick);",
        "clear_waits <= clear_faults || reset;",
    ),
    Edit(
        "writable while a commit is on its way",
        "dac_sequencer",
        "assign writable = !checking && idle_writable && !rendering && !host_commit;",
        "assign writable = !checking && idle_writable && !rendering;",
    ),
    Edit("any order of shaping", "dac_fit", "(data & 32'd3) <= HIGHEST_ORDER &&", "1'b1 &&"),
    Edit("offset of x too wide", "dac_fit", "(of_high && !is_x_high)", "1'b0"),
    Edit("offset of y too wide", "dac_fit", "(of_high && !is_y_high)", "1'b0"),
    Edit(
        "negative offset does not fit",
        "dac_fit",
        "is_x_high <= data[31:X_HIGH_BITS-1] == 0 || &data[31:X_HIGH_BITS-1];",
        "is_x_high <= data[31:X_HIGH_BITS-1] == 0;",
    ),
    Edit("gain too wide", "dac_fit", "(of_gain && !is_gain)", "1'b0"),
    Edit("line of 7 ticks", "dac_fit", "data[TICK_BITS:3] != 0", "data[TICK_BITS:2] != 0"),
    Edit("codes too wide", "dac_fit", "is_code <= data[31:DAC_BITS] == 0;", "is_code <= data[31:DAC_BITS+1] == 0;"),
    Edit("park code unchecked", "dac_fit", "CODES_END = 4'd10", "CODES_END = 4'd9"),
    Edit(
        "spoilt for ever",
        "dac_fit",
        ("else if (discard)\n            spoilt <= 1'b0;"),
        ("else if (1'b0)\n            spoilt <= 1'b0;"),
    ),
    Edit("spoilt is not empty", "dac_fit", "else if (discard && spoilt)", "else if (1'b0)"),
    Edit("settle lines too many", "dac_fit", "is_short <= data[31:8] == 0;", "is_short <= data[31:9] == 0;"),
    Edit("windows of y unchecked", "dac_fit", "(of_line && !is_line)", "1'b0"),
    Edit(
        "valid between ticks in spite of a fault",
        "dac_verdict",
        ("        end else if (faulty)\n            valid_marker <= 1'b0;"),
        "        end",
    ),
    Edit(
        "a slew fault leaves the image valid",
        "dac_verdict",
        "wire was_catching_up = catching_up || begins;",
        "wire was_catching_up = catching_up;",
    ),
    Edit("an underrun with the tick", "dac_verdict", "wire faulty = underrun ||", "wire faulty ="),
    Edit(
        "a fault on the clock of a clear is lost",
        "dac_faults",
        "(clear ? {FAULTS{1'b0}} : faults) | happens",
        "clear ? {FAULTS{1'b0}} : faults | happens",
    ),
    Edit(
        "a fault on the clock of a clear is not counted",
        "dac_faults",
        "{{COUNT_BITS-1{1'b0}}, happens[i]}",
        "{COUNT_BITS{1'b0}}",
    ),
    Edit(
        "the sign of a negative offset",
        "dac_offset",
        "idle[BITS-1:18] <= data[BITS-19:0];",
        "idle[BITS-1:18] <= {1'b0, data[BITS-20:0]};",
    ),
    Edit(
        "minus_min not sign extended",
        "dac_offset",
        "{{BITS-GAIN_Q-CODE_BITS-1{minus_min[CODE_BITS]}}",
        "{{BITS-GAIN_Q-CODE_BITS-1{1'b0}}",
    ),
    Edit(
        "park room of the wrong width",
        "dac_output",
        "wire [CODE_BITS-1:0] room_left = running ? room : park_room;",
        "wire [CODE_BITS-1:0] room_left = room;",
    ),
    Edit("max_step a tick early", "dac_output", "if (loads[LATENCY+1]) begin", "if (loads[LATENCY]) begin"),
    Edit("code_max a tick late", "dac_output", "if (loads[LATENCY-1]) code_max", "if (loads[LATENCY]) code_max"),
    Edit(
        "phase step 31 bits",
        "dac_phase",
        "phase + step + {31'd0, wraps}",
        "phase + {1'b0, step[30:0]} + {31'd0, wraps}",
    ),
    Edit("slew exact limit", "dac_slew", "reached <= behind == 0;", "reached <= behind == 0 || (&behind);"),
    Edit("slew range", "dac_slew", "{{2{behind[BITS]}}, behind} + {delta_less", "{{2{1'b0}}, behind} + {delta_less"),
    Edit("rounds down", "dac_interpolator", "1'b1} + step", "1'b0} + step"),
    Edit(
        "bank drained at once",
        "dac_bank",
        ("else if (drained)\n            draining <= 1'b0;"),
        ("else\n            draining <= 1'b0;"),
    ),
    Edit(
        "write region",
        "dac_sequencer",
        "assign y_table_write = host_write && region == Y_TABLE;",
        "assign y_table_write = host_write && region == X_TABLE;",
    ),
)

OUTPUT: tuple[Edit, ...] = (
    Edit("coding inverted", "dac_coding", "^ INVERTED", "^ !INVERTED"),
    Edit(
        "AXI swaps x and y",
        "dac_axi_stream",
        ("            x_held <= x_word;\n            y_held <= y_word;"),
        ("            x_held <= y_word;\n            y_held <= x_word;"),
    ),
    Edit(
        "AXI drops a held beat", "dac_axi_stream", "wire free = !m_axis_tvalid || m_axis_tready;", "wire free = 1'b1;"
    ),
    Edit("AXI loses markers", "dac_axi_stream", "m_axis_tuser <= markers;", "m_axis_tuser <= 0;"),
    Edit("LDAC a clock early", "dac_spi", "FALL = REST - LDAC_DELAY;", "FALL = REST - LDAC_DELAY + 1;"),
    Edit(
        "LDAC too short",
        "dac_spi",
        "RISE = REST - LDAC_DELAY - LDAC_CLOCKS;",
        "RISE = REST - LDAC_DELAY - LDAC_CLOCKS + 1;",
    ),
    Edit("no gap", "dac_spi", "pause <= last ? REST_LAST[PAUSE_BITS-1:0] : GAP_LAST[PAUSE_BITS-1:0];", "pause <= 0;"),
    Edit("missed is not told", "dac_spi", "missed <= strobe && waiting && !reset;", "missed <= 1'b0;"),
    Edit("the mailbox is lost", "dac_spi", "else if (strobe) waiting <= 1'b1;", "else if (strobe) waiting <= 1'b0;"),
    Edit("second frame of the wrong select", "dac_spi", "cs_x_n <= !SECOND_X;", "cs_x_n <= 1'b1;"),
    Edit("CPHA ignored", "dac_spi", "(CPHA != 0 ? !active && !setting_up : active)", "active"),
    Edit("prefix of y is that of x", "dac_spi", "framed(Y_PREFIX[FRAME_BITS-1:0]", "framed(X_PREFIX[FRAME_BITS-1:0]"),
    Edit("a two's complement code keeps its top bit", "dac_coding", "^ INVERTED", "& !INVERTED"),
    Edit(
        "a left-aligned word is aligned to the right",
        "dac_coding",
        "{coded, {(WORD_BITS - BITS){1'b0}}}",
        "{{(WORD_BITS - BITS){1'b0}}, coded}",
    ),
    Edit(
        "a boot commits although words are missing",
        "dac_boot",
        "commit = booting ? now && writes == COMMIT && !missing :",
        "commit = booting ? now && writes == COMMIT :",
    ),
    Edit(
        "the tables of a boot change places",
        "dac_boot",
        "writes == X ? x_wide[31:0] : y_wide[31:0]",
        "writes == X ? y_wide[31:0] : x_wide[31:0]",
    ),
    Edit(
        "a boot does not begin again",
        "dac_boot",
        ("            reads <= PROGRAM;\n            read_at <= 17'd0;"),
        "            read_at <= 17'd0;",
    ),
    Edit(
        "a boot begins at once", "dac_boot", "wire started = waited == START[START_BITS-1:0];", "wire started = 1'b1;"
    ),
    Edit("a boot does not wait", "dac_boot", "wire now = writing && writable;", "wire now = writing;"),
    Edit("a daisy chain shifts x alone", "dac_spi", "!PARALLEL && tail[FRAME_BITS-1]};", "1'b0};"),
    Edit("the second frame comes without a gap", "dac_spi", "GAP_LAST = GAP - 1;", "GAP_LAST = 0;"),
)
