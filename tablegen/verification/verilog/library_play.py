"""A play of a library in Verilog: ``dac_library`` picks its programs out of a memory, and the sequencer plays them.

The sequencer has the parameters of the header. Some picks have to fail: a number that no program has, a record with a
word that is not its own, and a record that fits no sequencer but has a right CRC.
"""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from tablegen.device.dual_program import DualProgram
from tablegen.device.registers import PAGE_WORDS
from tablegen.library.verilog_index import MODULE, words_before_crc
from tablegen.verification import process_group as worker
from tablegen.verification.checks.directory import copies, memory_words, some
from tablegen.verification.checks.played_checks import Check
from tablegen.verification.failures import SimulationFailed
from tablegen.verification.play.capture import UNDEFINED
from tablegen.verification.play.library_session import Pick, expected_ticks, make_picks
from tablegen.verification.play.placement import Placement
from tablegen.verification.play.stream import Sample, Words, pack, read_capture
from tablegen.verification.verilog.bench import TOP

_PICKS, _CAPTURE = "picks.hex", "library_capture.hex"
_TARGET = "tablegen.verification.verilog.target"  # which has the job that compiles and runs a bench
_WORD_CLOCKS = 36  # of a word of the memory, beside the memory's own
_PICK_CLOCKS = 2000  # beside the words, the rendering and the ticks
_UNCHANGED = (1 << 32) - 1  # an address at which no memory ends
_PICK = 0xF << 60  # in the place of a tick: a pick is over, bit 0 is its failure
_FAILED_TICKS = 100  # after a pick that fails
_ANSWERS = ("a commit", "a failure")

_MODULE = """\
// The bench of tablegen verify for a library: picks programs by number, and writes down what plays.
`timescale 1ns / 1ps
`default_nettype none

module verify_bench #(
    parameter PICKS = "", parameter CAPTURE = "", parameter MEMORY_CLOCKS = 1, parameter PLAIN_MULTIPLIER = 0,
    parameter LOW_AREA = 0, parameter ALTERNATE = 0, parameter PACE = 1
);
`include "{name}_library.vh"
    localparam ADDRESS_BITS = 24;

    // For the cocotb side of the bench.
    reg finished = 0;
    wire [127:0] fault_counts = 128'd0;
    wire [31:0] strobes = 32'd0, ticks = 32'd0, jitter = 32'd0, latency = 32'd0;

    reg clock = 0, pick = 0, tick = 0, start = 0, park = 0;
    reg [31:0] number = 0, restarts = 0, count = 0, at_1 = 0, word_1 = 0, at_2 = 0, word_2 = 0;
    reg [31:0] memory [0:{NAME}_LIBRARY_{MEMORY}_WORDS-1];
    initial $readmemh({NAME}_LIBRARY_{MEMORY}_FILE, memory);

    wire busy, failed, memory_read, writable, write, commit, withdraw, refused, committed, strobe;
    wire line, frame, pixel, backward, valid, swapped, playing, parked;
    wire [ADDRESS_BITS-1:0] address;
    wire [2:0] region;
    wire [15:0] write_address;
    wire [{NAME}_LIBRARY_DAC_BITS-1:0] x_code, y_code;
    wire [23:0] x_wide = x_code, y_wide = y_code;
    wire [7:0] flags = {{parked, playing, swapped, valid, backward, pixel, frame, line}};
    wire [31:0] data;
    wire [31:0] at = address;
    wire [3:0] faults;

    reg [7:0] delay = 0;
    reg memory_ready = 0;
    reg [31:0] memory_data = 0;
    always @(posedge clock) begin
        if (delay != 0) delay <= delay - 8'd1;
        else if (memory_read) delay <= MEMORY_CLOCKS;
        memory_ready <= delay == 1;
        memory_data <= delay != 1 ? 32'hDEADBEEF : at == at_1 ? word_1 : at == at_2 ? word_2 : memory[address];
    end

    dac_library #(.PROGRAMS({NAME}_LIBRARY_PROGRAMS), .ADDRESS_BITS(ADDRESS_BITS)) picker (
        .clock(clock), .reset(1'b0), .pick(pick), .number(number[15:0]), .busy(busy), .failed(failed),
        .memory_read(memory_read), .memory_address(address), .memory_ready(memory_ready), .memory_data(memory_data),
        .writable(writable), .committed(committed), .write(write), .write_region(region),
        .write_address(write_address), .write_data(data), .commit(commit), .withdraw(withdraw)
    );

    dac_sequencer #(
        .DAC_BITS({NAME}_LIBRARY_DAC_BITS), .X_INTERPOLATED({NAME}_LIBRARY_X_INTERPOLATED),
        .X_INDEX_BITS({NAME}_LIBRARY_X_INDEX_BITS), .X_WORD_BITS({NAME}_LIBRARY_X_WORD_BITS),
        .Y_INTERPOLATED({NAME}_LIBRARY_Y_INTERPOLATED), .Y_INDEX_BITS({NAME}_LIBRARY_Y_INDEX_BITS),
        .Y_WORD_BITS({NAME}_LIBRARY_Y_WORD_BITS), .TICK_BITS({NAME}_LIBRARY_TICK_BITS),
        .LINE_BITS({NAME}_LIBRARY_LINE_BITS), .PERIOD_BITS({NAME}_LIBRARY_PERIOD_BITS),
        .SHAPING({NAME}_LIBRARY_SHAPING), .PIXEL_INDEX_BITS({NAME}_LIBRARY_PIXEL_INDEX_BITS),
        .PLAIN_MULTIPLIER(PLAIN_MULTIPLIER), .LOW_AREA(LOW_AREA), .ALTERNATE(ALTERNATE){rendered}
    ) sequencer (
        .clock(clock), .reset(1'b0), .write(write), .write_region(region), .write_address(write_address),
        .write_data(data), .writable(writable), .refused(refused), .commit(commit), .commit_mode(2'd0),
        .withdraw(withdraw), .committed(committed), .arm(start), .arm_frames(16'd0), .trigger(start), .park(park),
        .clear_faults(1'b0), .armed(), .running(), .tick(tick), .underrun(1'b0), .busy(), .strobe(strobe),
        .x_code(x_code), .y_code(y_code), .line_marker(line), .frame_marker(frame), .pixel_marker(pixel),
        .backward_marker(backward), .valid_marker(valid), .swapped_marker(swapped), .playing(playing),
        .parked(parked), .faults(faults), .fault_counts()
    );

    integer picks, capture, clocks, fields;

    task step;
        begin
            #5 clock = 1;
            #5 clock = 0;
            if (strobe)
                $fwrite(capture, "%016x\\n", {{4'd0, faults, flags, y_wide, x_wide}});
        end
    endtask

    task play(input integer ticks_to_play);
        begin
            repeat (ticks_to_play) begin
                tick = 1;
                step;
                tick = 0;
                repeat (PACE - 1) step;
            end
            repeat (150) step;
        end
    endtask

    initial begin
        picks = $fopen(PICKS, "r");
        capture = $fopen(CAPTURE, "w");
        repeat (8) step;
        fields = $fscanf(picks, "%h %h %h %h %h %h %h", number, restarts, count, at_1, word_1, at_2, word_2);
        while (fields == 7) begin
            park = restarts[0];
            step;
            park = 0;
            repeat (100) step;
            pick = 1;
            step;
            pick = 0;
            clocks = 0;
            while (busy !== 1'b0 && clocks < {most_clocks}) begin
                step;
                clocks = clocks + 1;
            end
            repeat (4) step;
            $fwrite(capture, "%016x\\n", {{4'hF, 58'd0, busy, failed}});
            if (restarts[0]) begin
                play(1);
                start = 1;
                step;
                start = 0;
            end
            play(count);
            fields = $fscanf(picks, "%h %h %h %h %h %h %h", number, restarts, count, at_1, word_1, at_2, word_2);
        end
        $fclose(capture);
        finished = 1;
    end
endmodule

`default_nettype wire
"""
_RENDERED = """,
        .FOURIER(1), .HARMONICS({NAME}_LIBRARY_HARMONICS), .SINE_FILE({NAME}_LIBRARY_SINE_FILE)"""


@dataclass(frozen=True)
class LibraryPlay:
    """A play of a library whose programs, by number, have ``names``.

    With ``placement.fourier`` the programs come from the memory of Fourier words, and the device renders their tables.
    ``memory_clocks`` pass from a read of the memory to its word.
    """

    library: str
    names: Sequence[str]
    programs: Sequence[DualProgram] = field(repr=False)
    harmonics: int  # most of an axis
    placement: Placement
    most_ticks: int
    memory_clocks: int = 1

    def check(self, folder: Path, work: Path, simulator: Literal["icarus", "verilator"]) -> Check:
        """Play the library in ``folder``, and compare every tick with the model.

        Parameters
        ----------
        work
            Directory for the model and its record, which is made.

        Raises
        ------
        ToolMissing
            If the simulator is not installed.
        """
        work.mkdir(parents=True, exist_ok=True)
        modules = sorted({MODULE, *(path.name for path in folder.glob("dac_*.v"))})
        sources, missing = copies(folder, [*modules, f"{self.library}_library.vh"], work / "rtl")
        if missing:
            return self._check("nothing", "", some(missing))
        (work / simulator).mkdir(exist_ok=True)
        for path in folder.glob(f"{self.library}_library_*.mem"):
            copies(folder, [path.name], work / simulator)
        try:
            picks = make_picks(self.programs, self._failing(folder), self.most_ticks)
            (work / _PICKS).write_text("".join(map(_pick_line, picks)), "ascii")
            bench = work / f"{TOP}.v"
            bench.write_text(self._bench_text(), "ascii")
            job = {
                "simulator": simulator,
                "sources": [str(path) for path in (*sources[: len(modules)], bench)],
                "includes": [str(sources[-1].parent)],
                "parameters": self._parameters(),
                "clocks": sum(self._pick_clocks + pick.ticks * self._pace for pick in picks),
            }
            worker.run(work, _TARGET, job)
            return self._compared(picks, read_capture(work / _CAPTURE))
        except (SimulationFailed, OSError, ValueError) as error:
            return self._check("nothing", "", str(error))

    def _check(self, compared: str, worst: str, failure: str | None) -> Check:
        failure = failure and f"{self.library}, {MODULE}: {failure}"
        return Check(f"library {MODULE}", "integer model", compared, worst, "0", failure)

    @property
    def _pace(self) -> int:
        return max(self.placement.playing(program).tick_clocks for program in self.programs)

    @property
    def _memory(self) -> str:
        return "FOURIER" if self.placement.fourier else "TABLES"

    @property
    def _pick_clocks(self) -> int:
        """Clocks of a pick at most, without its ticks."""
        words = max(len(one.x.words) + len(one.y.words) + 2 * one.schedule.pixels for one in self.programs) + 3 * (
            PAGE_WORDS + 1
        )
        tables = [
            [(len(axis.words), self.harmonics if self.placement.renders(axis) else 0) for axis in (one.x, one.y)]
            for one in self.programs
        ]
        rendering = max(self.placement.commit_clocks(*each) for each in tables)
        return words * (_WORD_CLOCKS + self.memory_clocks) + rendering + _PICK_CLOCKS

    def _parameters(self) -> dict[str, int | str]:
        every = self.placement.parameters(0, "")
        kinds = {key: every.get(key, 0) for key in ("PLAIN_MULTIPLIER", "LOW_AREA", "ALTERNATE")}
        files = {"PICKS": f"../{_PICKS}", "CAPTURE": f"../{_CAPTURE}"}
        return {**files, **kinds, "MEMORY_CLOCKS": self.memory_clocks, "PACE": self._pace}

    def _bench_text(self) -> str:
        name = self.library.upper()
        rendered = _RENDERED.format(NAME=name) if self.placement.fourier else ""
        return _MODULE.format(
            name=self.library, NAME=name, MEMORY=self._memory, rendered=rendered, most_clocks=self._pick_clocks
        )

    def _failing(self, folder: Path) -> list[Pick]:
        """Return picks that must fail.

        Raises
        ------
        ValueError
            If the memory cannot be read, or holds no such records.
        """
        count, path = len(self.programs), folder / f"{self.library}_library_{self._memory.lower()}.mem"
        words = memory_words(path, None)
        starts = words[:count]
        if len(starts) < count or any(start + 2 > len(words) for start in starts):
            raise ValueError(f"{path.name} has no {count} records")
        ends = [start + words_before_crc(words[start], words[start + 1]) for start in starts]
        shortest = min(range(count), key=lambda number: ends[number] - starts[number])
        start, end = starts[shortest], ends[shortest]
        if end >= len(words):
            raise ValueError(f"{path.name} ends within the record of {self.names[shortest]}")
        unfit = [*words[start : start + 2], _UNCHANGED, *words[start + 3 : end]]
        crc = zlib.crc32(np.array(unfit, dtype="<u4").tobytes())
        damaged = ((start + 2 + PAGE_WORDS, words[start + 2 + PAGE_WORDS] ^ 1),)
        return [
            Pick(count, _FAILED_TICKS, fails=True),
            Pick(shortest, _FAILED_TICKS, changes=damaged, fails=True),
            Pick(shortest, _FAILED_TICKS, changes=((start + 2, _UNCHANGED), (end, crc)), fails=True),
        ]

    def _compared(self, picks: Sequence[Pick], played: Words) -> Check:
        parts = [
            [_PICK | int(pick.fails), *map(pack, ticks)]
            for pick, ticks in zip(picks, expected_ticks(self.programs, picks), strict=True)
        ]
        expected = np.array([word for part in parts for word in part], dtype=np.uint64)
        length = min(len(expected), len(played))
        wrong = np.flatnonzero(expected[:length] != played[:length])
        count = len(wrong) + abs(len(expected) - len(played))
        at = int(wrong[0]) if len(wrong) else length
        failure = None
        if count:
            ends = np.cumsum([len(part) for part in parts])
            number = min(int(np.searchsorted(ends, at, side="right")), len(picks) - 1)
            place = at - int(ends[number]) + len(parts[number])
            failure = f"{self._of_pick(picks[number])}, {self._difference(place, expected[at:], played[at:])}"
        ticks = len(expected) - len(picks)
        return self._check(f"{len(self.programs)} programs, {ticks} ticks", f"{count} differ", failure)

    def _of_pick(self, pick: Pick) -> str:
        if pick.number >= len(self.names):
            return f"number {pick.number}, which no program has"
        name = self.names[pick.number]
        if not pick.fails:
            return name
        return f"{name} with {'a CRC that is wrong' if len(pick.changes) == 1 else 'a word that fits no sequencer'}"

    @staticmethod
    def _difference(place: int, expected: Words, played: Words) -> str:
        if place == 0:
            ours, theirs = (
                "nothing" if not len(words) else "no answer" if int(words[0]) & 2 else _ANSWERS[int(words[0]) & 1]
                for words in (expected, played)
            )
            return f"the pick: expected {ours}, got {theirs}"
        ours, theirs = (_told(words) for words in (expected, played))
        return f"tick {place - 1} after the pick:\n  expected  {ours}\n  got       {theirs}"


def _pick_line(pick: Pick) -> str:
    changes = [*pick.changes, *[(_UNCHANGED, 0)] * 2][:2]
    return " ".join(f"{word:x}" for word in (pick.number, pick.restarts, pick.ticks, *changes[0], *changes[1])) + "\n"


def _told(words: Words) -> str:
    if not len(words):
        return "nothing"
    if words[0] == UNDEFINED:
        return "undefined"
    sample = Sample.of(int(words[0]))
    return f"x {sample.x}, y {sample.y}, markers {' '.join(sample.flags) or 'none'}, faults {sample.faults:04b}"
