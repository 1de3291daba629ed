"""A play of ``NAME_top.v``: what it boots from the memory files, then codes, words and markers of its first lines.

A build in the format spi or axi-stream has a module around it, which is played too: there words are those of the wires.
It is a second device in the bench of a session, on a clock of its own. To render the tables takes a simulator longer
than a session: a top that boots Fourier words is told to withdraw them once all have been compared, and gets the
tables instead. The other parameters serve both ways.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.device.dual_program import ScanProgram
from tablegen.device.registers import program_words
from tablegen.device.sequencer import Sequencer
from tablegen.emit.content import Content
from tablegen.emit.memory import memories, pixel_words
from tablegen.verification.checks.played_checks import Check
from tablegen.verification.play.capture import UNDEFINED
from tablegen.verification.play.loading import check_clocks
from tablegen.verification.play.placement import Axis, Placement
from tablegen.verification.play.stream import (
    PIXEL_TICKS,
    PROGRAM,
    X_FOURIER,
    X_TABLE,
    Y_FOURIER,
    Y_TABLE,
    Sample,
    Words,
    pack,
    read_capture,
)
from tablegen.verification.verilog.outputs import PINS, SIGNALS, WRITTEN, Output, output_pace, output_ticks, word_bits

_CLOCKS = 6000  # that ticks take, unless a line takes more
_MAX_TICKS = 20_000
_OTHER_CLOCKS = 2000  # to boot, to withdraw and to drain, beside the words
_REST_CLOCKS = 100  # before the tick that takes the program, and before the trigger
_WORD = (1 << 32) - 1

_OTHER_SINE = '{}.sequencer.SINE_FILE != "{}_sine.mem"'  # which only a rendering would read

_MODULE = """\
// The bench of NAME_top.v: compares nothing, writes down what the top boots and plays.
`timescale 1ns / 1ps
`default_nettype none

module {bench} #(
    parameter UPLOAD = "", parameter BOOTED = "", parameter PLAYED = ""
) (
    output reg finished
);
    reg clock = 0, write = 0, commit = 0, withdraw = 0, start = 0, tick = 0;
    reg [63:0] word = 0;
    wire writable, refused, committed, booting, missing, strobe;
    wire line, frame, pixel, backward, valid, swapped, playing, parked;
    wire [3:0] faults;
    wire [{dac_bits}-1:0] x_code, y_code;
    wire [{x_bits}-1:0] x_word;
    wire [{y_bits}-1:0] y_word;
    wire [23:0] x_wide = x_code, y_wide = y_code;
    wire [31:0] x_sent = x_word, y_sent = y_word;
    wire [63:0] sample =
        {{4'd0, faults, parked, playing, swapped, valid, backward, pixel, frame, line, y_wide, x_wide}};
    localparam LANE_BITS = {lane_bits};
    integer upload, booted, played, clocks = 0;
{signals}
    {module} #({settings}.START_CLOCKS(50)) device (
        .clock(clock), .reset(1'b0), .write(write), .write_region(word[50:48]), .write_address(word[47:32]),
        .write_data(word[31:0]), .writable(writable), .refused(refused), .commit(commit), .commit_mode(2'd0),
        .withdraw(withdraw), .can_keep(),
        .committed(committed), .booting(booting), .missing(missing), .arm(start), .arm_frames(16'd0),
        .trigger(start), .park(1'b0), .clear_faults(1'b0), .armed(), .running(), .tick(tick), .underrun(1'b0),
        .busy(), .strobe(strobe), .x_code(x_code), .y_code(y_code), .x_word(x_word), .y_word(y_word),
        .line_marker(line), .frame_marker(frame), .pixel_marker(pixel), .backward_marker(backward),
        .valid_marker(valid), .swapped_marker(swapped), .playing(playing), .parked(parked), .faults(faults),
        .fault_counts(){pins}
    );

    task step;
        begin
            #5 clock = 1;
            #5 clock = 0;
            clocks = clocks + 1;
            {written}
        end
    endtask

    initial begin
        finished = 0;
        upload = $fopen(UPLOAD, "r");
        booted = $fopen(BOOTED, "w");
        played = $fopen(PLAYED, "w");
        #1;
        while (booting !== 1'b0 && clocks < {boot_clocks}) begin
            if ({top}.sequencer.write)
                $fwrite(booted, "%016x\\n", {{13'd0, {top}.sequencer.write_region, {top}.sequencer.write_address,
                                            {top}.sequencer.write_data}});
            step;
        end
        $fwrite(booted, "%016x\\n", {{61'd0, {other_sine}, missing, refused}});
        $fclose(booted);
        if ({withdraws}) begin
            withdraw = 1;
            step;
            withdraw = 0;
            repeat (8) step;
            while ($fscanf(upload, "%h", word) == 1) begin
                write = 1;
                step;
            end
            write = 0;
            commit = 1;
            step;
            commit = 0;
        end
        repeat ({rest}) step;
        tick = 1;
        step;
        tick = 0;
        repeat ({rest}) step;
        start = 1;
        step;
        start = 0;
        repeat ({ticks}) begin
            tick = 1;
            step;
            tick = 0;
            repeat ({pause}) step;
        end
        repeat (100) step;
        $fwrite(played, "%016x\\n%016x\\n", {{63'd0, refused}}, {{63'd0, missing}});
        $fclose(played);
        finished = 1;
    end
endmodule

`default_nettype wire
"""


class Write(NamedTuple):
    """A write at the host port."""

    region: int
    address: int
    data: int

    def packed(self) -> int:
        """Return it as the bench reads and writes it."""
        return self.region << 48 | self.address << 32 | self.data & _WORD


@dataclass(frozen=True)
class TopPlay:
    """A play of the top of a build, of ``ticks`` ticks that are ``pace`` clocks apart.

    With ``by_turns`` it is the top with ``ALTERNATE``, which boots tables; otherwise the one with multiplier blocks.
    With another ``output`` than "top" it is the module around it.
    """

    content: Content
    ticks: int
    pace: int
    by_turns: bool = False
    output: Output = "top"

    @classmethod
    def of(cls, content: Content, most_ticks: int, axis: Axis = "blocks", output: Output = "top") -> "TopPlay":
        """Return a play of a line at least, within ``most_ticks``: by turns if the ``axis`` is, else in blocks.

        Of a module around the top it has 1000 ticks at most.
        """
        by_turns = axis == "alternate"
        pace = Placement("alternate" if by_turns else "blocks").playing(content.program).tick_clocks
        ticks = max(content.schedule.ticks, _CLOCKS // pace)
        ticks = output_ticks(min(ticks, most_ticks, _MAX_TICKS), output)
        return cls(content, ticks, output_pace(pace, content.program, output), by_turns, output)

    @property
    def clocks(self) -> int:
        """The clocks that the play takes at most."""
        other = 2 * check_clocks(self.content.schedule) + _OTHER_CLOCKS
        return self._boot_clocks + len(self._tables()) + self.ticks * self.pace + other

    @property
    def _renders(self) -> bool:
        return self.content.renders_tables and not self.by_turns

    @property
    def _boot_clocks(self) -> int:
        return len(self._boot()) + _OTHER_CLOCKS // 2

    def prepare(self, build: Path, folder: Path, model: Path) -> list[Path]:
        """Copy the top of a build into ``folder``, memory files to where the ``model`` runs; return top and bench."""
        upload = self._tables() if self._renders else []
        names = [f"{self.content.name}_{memory.name}.mem" for memory in memories(self.content)]
        return write_top(self.content.name, self.output, names, self._bench_text(), build, folder, model, upload)

    def check(self, folder: Path) -> Check:
        """Compare what was booted and played in a folder with the manifest and the integer model."""
        return check_top(self.content.name, self.output, self._boot(), self.content.program, self.ticks, folder)

    def _bench_text(self) -> str:
        return top_bench_text(
            self.content.name,
            self.content.program,
            output=self.output,
            boot_clocks=self._boot_clocks,
            ticks=self.ticks,
            pace=self.pace,
            settings=".ALTERNATE(1), " if self.by_turns else ".PLAIN_MULTIPLIER(1), ",
            rest=_REST_CLOCKS + check_clocks(self.content.schedule),
            other_sine=_OTHER_SINE.format(_top(self.output), self.content.name) if self._renders else "1'b0",
            withdraws=self._renders,
        )

    def _boot(self) -> list[Write]:
        """Return what the top writes at power-up."""
        if not self._renders:
            return self._tables()
        x, y = self.content.axes
        words = [(X_FOURIER, x.fourier_words), (Y_FOURIER, y.fourier_words)]
        return self._registers((x.harmonics, y.harmonics)) + writes(words)

    def _tables(self) -> list[Write]:
        x, y = self.content.axes
        return self._registers((0, 0)) + writes([(X_TABLE, x.program.words), (Y_TABLE, y.program.words)])

    def _registers(self, harmonics: tuple[int, int]) -> list[Write]:
        x, y = (axis.program for axis in self.content.axes)
        words = program_words(self.content.schedule, x, y, harmonics)
        pixels = [Write(PIXEL_TICKS, at, ticks) for at, ticks in enumerate(pixel_words(self.content.schedule))]
        return pixels + [Write(PROGRAM, address, word) for address, word in enumerate(words)]


def writes(regions: "list[tuple[int, np.ndarray]]", address: int = 0) -> list[Write]:
    """Return the writes of words to regions, each from an address on."""
    return [
        Write(region, address + at, int(word)) for region, words in regions for at, word in enumerate(words.tolist())
    ]


def instances(outputs: Sequence[Output]) -> list[str]:
    """Return the Verilog that instantiates the benches of these modules; each raises its ``tops_finished``."""
    return [
        f"    {_bench_name(output)} #({_bench_files(output)}) {output} (.finished(tops_finished[{number}]));"
        for number, output in enumerate(outputs)
    ]


def _bench_name(output: Output) -> str:
    return f"{output}_play"


def _bench_files(output: Output) -> str:
    """Return the parameters of a bench: its files, relative to the folder in which the model runs."""
    return ", ".join(f'.{key}("../{name}")' for key, name in _files(output).items())


def _files(output: Output) -> dict[str, str]:
    """Return the files of a bench by its parameters."""
    return {key: f"{output}_{key.lower()}.hex" for key in ("UPLOAD", "BOOTED", "PLAYED")}


def _top(output: Output) -> str:
    """Return the path of ``NAME_top`` in the bench of a module."""
    return "device" if output == "top" else "device.top"


def top_bench_text(
    name: str,
    program: ScanProgram,
    *,
    output: Output = "top",
    boot_clocks: int,
    ticks: int,
    pace: int,
    settings: str = "",
    rest: int = _REST_CLOCKS,
    other_sine: str = "1'b0",
    withdraws: bool = False,
) -> str:
    """Return the bench module of ``NAME_top.v``, or of the module of an ``output`` around it.

    Parameters
    ----------
    boot_clocks
        Clocks in which the boot has to end.
    ticks, pace
        How many ticks of the scan it plays, and how many clocks apart.
    settings
        Parameters of the top, with a comma behind each.
    rest
        Clocks before the tick that takes the program, and before the trigger.
    other_sine, withdraws
        An expression that is 1 for a wrong sine, and whether what was booted is replaced by an upload.
    """
    x_bits, y_bits = word_bits(program)
    return _MODULE.format(
        bench=_bench_name(output),
        module=f"{name}_{output}",
        top=_top(output),
        pins=PINS[output],
        signals=SIGNALS[output],
        written=WRITTEN[output],
        lane_bits=8 * ((max(x_bits, y_bits) + 7) // 8),
        dac_bits=program.x.output.dac_bits,
        x_bits=x_bits,
        y_bits=y_bits,
        boot_clocks=boot_clocks,
        settings=settings,
        rest=rest,
        other_sine=other_sine,
        withdraws=int(withdraws),
        ticks=ticks,
        pause=pace - 1,
    )


def write_top(
    name: str,
    output: Output,
    memories: Iterable[str],
    bench_text: str,
    build: Path,
    folder: Path,
    model: Path,
    upload: Sequence[Write],
) -> list[Path]:
    """Write what plays a module of a build: its copy and the bench into ``folder``, and memory files beside the model.

    Parameters
    ----------
    memories
        Names of memory files; those that the build lacks are left out.
    model
        Folder in which the model runs, which is made.
    upload
        Writes that the bench makes where it withdraws what was booted.

    Returns
    -------
    list of Path
        Module and bench.
    """
    model.mkdir(exist_ok=True)
    for memory in memories:
        if (build / memory).is_file():
            (model / memory).write_bytes(read_bytes(build / memory, BUILD_FILE))
    uploaded = "".join(f"{one.packed():016x}\n" for one in upload)
    (folder / _files(output)["UPLOAD"]).write_text(uploaded, "ascii")
    bench = folder / f"{_bench_name(output)}.v"
    bench.write_text(bench_text, "ascii")
    module = folder / f"{name}_{output}.v"
    module.write_bytes(read_bytes(build / module.name, BUILD_FILE))
    return [module, bench]


def check_top(
    name: str, output: Output, boot: Sequence[Write], program: ScanProgram, ticks: int, folder: Path
) -> Check:
    """Compare what a module booted and played in a folder with the writes of its boot and the integer model."""
    files = _files(output)
    expected = np.array([*(one.packed() for one in boot), 0], dtype=np.uint64)
    model = _model(program, ticks)
    booted, played = (read_capture(folder / files[key]) for key in ("BOOTED", "PLAYED"))
    failure = _boot_failure(expected, booted) or _play_failure(model, played)
    wrong = _different(expected, booted) + _different(model, played)
    compared = f"{len(boot)} words booted, {ticks} ticks"
    failure = failure and f"{name}_{output}.v: {failure}"
    return Check(output.replace("_", "-"), "integer model", compared, f"{wrong} differ", "0", failure)


def _model(program: ScanProgram, count: int) -> Words:
    """Return each tick and its converter words, the tick that takes the program first, and the flags at the end."""
    x, y = program.x.output, program.y.output
    model = Sequencer(None)
    model.commit(program)
    ticks = [model.step()]
    model.arm()
    model.trigger()
    ticks += [model.step() for _ in range(count)]
    words = [word for tick in ticks for word in (pack(tick), y.word(tick.y) << 32 | x.word(tick.x))]
    return np.array([*words, 0, 0], dtype=np.uint64)


def _different(expected: Words, got: Words) -> int:
    """Return the number of words that differ, or that only one of both has."""
    length = min(len(expected), len(got))
    return int(np.sum(expected[:length] != got[:length])) + abs(len(expected) - len(got))


def _first(expected: Words, got: Words) -> int:
    """Return the first place that differs; the shorter length where there is none."""
    length = min(len(expected), len(got))
    return next(iter(np.flatnonzero(expected[:length] != got[:length]).tolist()), length)


def _boot_failure(expected: Words, got: Words) -> str | None:
    at = _first(expected, got)
    if at == len(expected) == len(got):
        return None
    ours, theirs = (_written(words, at) for words in (expected, got))
    return f"write {at} of its boot is {theirs}, it is {ours} in the manifest"


def _written(words: Words, at: int) -> str:
    """Describe a write of a boot; behind the last one are its flags."""
    if at >= len(words):
        return "missing"
    if words[at] == UNDEFINED:
        return "undefined"
    if at == len(words) - 1:
        flags = zip(("refused", "missing", "another SINE_FILE"), range(3), strict=True)
        return "the end with " + (", ".join(name for name, bit in flags if int(words[at]) >> bit & 1) or "no fault")
    word = int(words[at])
    return f"0x{word & _WORD:x} at address {word >> 32 & 0xFFFF} of region {word >> 48}"


def _play_failure(expected: Words, got: Words) -> str | None:
    at = _first(expected, got)
    if at == len(expected) == len(got):
        return None
    ours, theirs = (_played(words, at // 2 * 2) for words in (expected, got))
    return f"tick {at // 2} differs from the model:\n  expected  {ours}\n  got       {theirs}"


def _played(words: Words, at: int) -> str:
    """Describe a tick and its converter words; behind the last one are the flags."""
    if at + 1 >= len(words):
        return "nothing"
    if words[at] == UNDEFINED or words[at + 1] == UNDEFINED:
        return "undefined"
    if at + 2 == len(words):
        return f"the end, refused {int(words[at])}, missing {int(words[at + 1])}"
    sample, sent = Sample.of(int(words[at])), int(words[at + 1])
    markers = " ".join(sample.flags) or "none"
    return (
        f"x {sample.x}, y {sample.y}, markers {markers}, faults {sample.faults:04b}, "
        f"words 0x{sent & _WORD:x} and 0x{sent >> 32:x}"
    )
