"""The C sequencer as a shared library: its structures and functions by ctypes, and a twin of it and of the model."""

import ctypes
from collections.abc import Sequence
from ctypes import Structure, byref, c_bool, c_int32, c_int64, c_size_t, c_uint8, c_uint16, c_uint32, c_void_p
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from building import run_clean
from kept_objects import objects

from tablegen.base.resources import c_runtime
from tablegen.device.dual_program import ScanProgram
from tablegen.device.sequencer import Fault, Sequencer, Tick
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.spline import WORDS_BEHIND
from tablegen.link.messages import CUBIC
from tablegen.numerics.arrays import Ints
from tablegen.verification.play.stream import FLAGS

HERE = Path(__file__).parent
PROBE = HERE / "c_probe.c"
OPTIONS = ("-std=c99", "-O1")
SLEW, CLAMP, OVERRUN, UNDERRUN = 1, 2, 4, 8
LOADED, BUSY, OTHER_CONVERTER, BAD_SCHEDULE, BAD_TABLE, BAD_PERIOD, BAD_OUTPUT, OTHER_STORAGE, BAD_SHAPING = range(9)
BAD_SLOW_PART = 9
MARKER = {name: 1 << bit for bit, name in enumerate(FLAGS)}
NOTHING_PLAYS = 2


class Window(Structure):
    _fields_ = (("first", c_uint32), ("count", c_uint32))


class AxisProgram(Structure):
    _fields_ = (
        ("table", c_void_p),
        ("length", c_uint32),
        ("storage_bits", c_uint8),
        ("bits", c_uint8),
        ("index_bits", c_uint8),
        ("phase_period", c_uint32),
        ("hold_ticks", c_uint32),
        ("gain_word", c_int32),
        ("offset_word", c_int64),
        ("gain_q", c_uint8),
        ("code_min", c_int32),
        ("code_max", c_int32),
        ("park_code", c_int32),
        ("max_step", c_int32),
        ("dac_bits", c_uint8),
        ("word_bits", c_uint8),
        ("twos_complement", c_bool),
        ("left_aligned", c_bool),
    )


class ShapedAxisProgram(AxisProgram):
    """With DAC_SHAPING."""

    _fields_ = (("shaping_order", c_uint8), ("shaping_zero", c_uint8))


class SlowAxisProgram(AxisProgram):
    """With DAC_SLOW_PART."""

    _fields_ = (("slow", c_void_p),)


class ShapedSlowAxisProgram(ShapedAxisProgram):
    """With DAC_SHAPING and DAC_SLOW_PART."""

    _fields_ = (("slow", c_void_p),)


class SlowPart(Structure):
    _fields_ = (
        ("gains", c_void_p),
        ("ratios", c_void_p),
        ("second", c_void_p),
        ("mixed", c_void_p),
        ("table", c_void_p),
        ("gain_spacing", c_uint32),
        ("ratio_spacing", c_uint32),
        ("gain_knots", c_uint8),
        ("ratio_knots", c_uint8),
        ("index_bits", c_uint8),
        ("gain_word", c_int32),
        ("offset_word", c_int64),
    )


class CSchedule(Structure):
    _fields_ = (
        ("line_ticks", c_uint32),
        ("frame_lines", c_uint32),
        ("pixels", c_uint32),
        ("settle_lines", c_uint32),
        ("turn_tick", c_uint32),
        ("forward", Window),
        ("backward", Window),
        ("up", Window),
        ("down", Window),
    )


class PixelCSchedule(CSchedule):
    """With DAC_PIXEL_TABLE."""

    _fields_ = (("pixel_table", c_void_p),)


class CProgram(Structure):
    _fields_ = (("schedule", CSchedule), ("x", AxisProgram), ("y", AxisProgram))


class ShapedCProgram(Structure):
    _fields_ = (("schedule", CSchedule), ("x", ShapedAxisProgram), ("y", ShapedAxisProgram))


class SlowCProgram(Structure):
    _fields_ = (("schedule", CSchedule), ("x", SlowAxisProgram), ("y", SlowAxisProgram))


class ShapedSlowCProgram(Structure):
    _fields_ = (("schedule", CSchedule), ("x", ShapedSlowAxisProgram), ("y", ShapedSlowAxisProgram))


class PixelCProgram(Structure):
    """With DAC_PIXEL_TABLE alone."""

    _fields_ = (("schedule", PixelCSchedule), ("x", AxisProgram), ("y", AxisProgram))


class PixelShapedCProgram(Structure):
    """With DAC_PIXEL_TABLE and DAC_SHAPING."""

    _fields_ = (("schedule", PixelCSchedule), ("x", ShapedAxisProgram), ("y", ShapedAxisProgram))


class PixelSlowCProgram(Structure):
    """With DAC_PIXEL_TABLE and DAC_SLOW_PART."""

    _fields_ = (("schedule", PixelCSchedule), ("x", SlowAxisProgram), ("y", SlowAxisProgram))


AnyCProgram = (
    CProgram
    | ShapedCProgram
    | SlowCProgram
    | ShapedSlowCProgram
    | PixelCProgram
    | PixelShapedCProgram
    | PixelSlowCProgram
)
# By whether the runtime has DAC_SHAPING, and DAC_SLOW_PART.
AXES: dict[tuple[bool, bool], Any] = {
    (False, False): AxisProgram,
    (True, False): ShapedAxisProgram,
    (False, True): SlowAxisProgram,
    (True, True): ShapedSlowAxisProgram,
}
PROGRAMS: dict[tuple[bool, bool], Any] = {
    (False, False): CProgram,
    (True, False): ShapedCProgram,
    (False, True): SlowCProgram,
    (True, True): ShapedSlowCProgram,
}


PIXEL_PROGRAMS: dict[tuple[bool, bool], Any] = {
    (False, False): PixelCProgram,
    (True, False): PixelShapedCProgram,
    (False, True): PixelSlowCProgram,
}


class Converter(Structure):
    _fields_ = (
        ("bits", c_uint8),
        ("word_bits", c_uint8),
        ("twos_complement", c_bool),
        ("left_aligned", c_bool),
        ("power_up_code", c_int32),
    )


class Status(Structure):
    _fields_ = (
        ("markers", c_uint8),
        ("faults", c_uint8),
        ("fault_counts", c_uint32 * 4),
        ("swaps", c_uint32),
        ("line", c_uint32),
    )


REQUESTS = ("commit", "withdraw", "trigger", "park", "reset", "clear_faults")


def storage(bits: int) -> int:
    """Bits in which the runtime holds words of so many bits."""
    return 16 if bits <= 16 else 32


def compile_library(
    path: Path,
    table_bits: int = 16,
    output_bits: int = 16,
    stride: int = 2,
    compiler: Sequence[str] = ("gcc",),
    options: Sequence[str] = OPTIONS,
    runtime: Sequence[Path] | None = None,
    more: Sequence[Path | str] = (),
) -> Path:
    """The runtime and the probe as a shared library; ``more`` are further arguments for the compiler.

    Objects are kept: with a fault in one file, that file alone is compiled. Not those that count lines, whose notes
    stand beside them.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    files = list(c_runtime() if runtime is None else runtime)
    words = [str(word) for word in more if not str(word).endswith(".c")]
    beside = [PROBE, *(Path(word) for word in more if str(word).endswith(".c"))]
    command = [
        *compiler, *options, "-fPIC", f"-DDAC_TABLE_STORAGE_BITS={table_bits}",
        f"-DDAC_OUTPUT_STORAGE_BITS={output_bits}", f"-DDAC_STRIDE={stride}", *words,
    ]  # fmt: skip
    if "--coverage" in options:
        places = sorted({str(file.parent) for file in files})
        parts = [*(f"-I{place}" for place in places), *(file for file in files if file.suffix == ".c"), *beside]
    else:
        parts = [
            *objects(command, files),
            *objects(command, [*beside, *(file for file in files if file.suffix == ".h")]),
        ]
    run_clean([*command, "-shared", *parts, "-o", path])
    return path


def compile_both(folder: Path, **how: Any) -> tuple[Path, ...]:
    """For words of 16 bits, x and y taking turns in a buffer; and for 32, a buffer each."""
    return tuple(
        compile_library(folder / f"library_{bits}.so", bits, bits, stride, **how) for bits, stride in ((16, 2), (32, 1))
    )


@dataclass(frozen=True, eq=False)
class CAxis:
    """An axis of a program as C has it, its table, and its slow part with all that this points to."""

    program: AxisProgram
    words: Any
    slow: SlowPart | None = None
    slow_words: Sequence[Any] = ()


class Library:
    """A compiled runtime."""

    def __init__(self, path: Path) -> None:
        self.dll: Any = ctypes.CDLL(str(path))
        self.dll.probe_size.restype = c_size_t
        self.dll.probe_run.restype = c_uint32
        for name in REQUESTS:
            getattr(self.dll, f"dac_sequencer_{name}").restype = c_bool
        self.dll.dac_sequencer_arm.restype = c_bool
        self.dll.dac_sequencer_init.restype = c_bool
        self.dll.dac_sequencer_writable.restype = c_bool
        self.dll.dac_sequencer_status.restype = Status
        self.dll.dac_synthesize.restype = c_bool
        self.word_bytes, self.output_bytes = int(self.dll.probe_size(6)), int(self.dll.probe_size(7))
        self.stride, self.shaping = int(self.dll.probe_size(8)), int(self.dll.probe_size(9))
        self.slow_part = bool(self.dll.probe_size(10))
        self.words_behind = int(self.dll.probe_size(11))
        self.pixel_table = bool(self.dll.probe_size(12))
        self.word = np.dtype(f"i{self.word_bytes}")
        self.output = np.dtype(f"u{self.output_bytes}")

    def array(self, kind: Any, values: Sequence[int]) -> Any:
        """Words of a type, just as many."""
        return (kind * len(values))(*values)

    def axis(self, axis: Program | FrameProgram) -> CAxis:
        """An axis as C has it; its table has just the words that it needs, and the first ones again."""
        program = axis.fast if isinstance(axis, FrameProgram) else axis
        cubic = program.mode == "cubic"
        word = ctypes.c_int16 if self.word_bytes == 2 else c_int32
        table = self.array(word, [*program.words.tolist(), *program.words[: WORDS_BEHIND if cubic else 1].tolist()])
        output = program.output
        more: dict[str, Any] = {}
        if self.shaping:
            more = {"shaping_order": output.shaping.order, "shaping_zero": output.shaping.zero}
        part: SlowPart | None = None
        words: list[Any] = []
        if isinstance(axis, FrameProgram):
            assert self.slow_part, "this runtime plays no slow part"
            part, words = self.slow(axis, word)
            more["slow"] = ctypes.addressof(part)
        return CAxis(
            AXES[bool(self.shaping), self.slow_part](
                **more,
                table=ctypes.addressof(table),
                length=len(program.words),
                storage_bits=8 * self.word_bytes,
                bits=program.bits,
                index_bits=program.index_bits + (CUBIC if cubic else 0),
                phase_period=program.phase.ticks,
                hold_ticks=program.hold,
                gain_word=output.gain_word,
                offset_word=output.offset_word,
                gain_q=output.gain_q,
                code_min=output.code_min,
                code_max=output.code_max,
                park_code=output.park_code,
                max_step=output.max_step,
                dac_bits=output.dac_bits,
                word_bits=output.word_bits,
                twos_complement=output.coding == "twos-complement",
                left_aligned=output.align == "left",
            ),
            table,
            part,
            words,
        )

    def slow(self, frame: FrameProgram, word: Any) -> tuple[SlowPart, list[Any]]:
        """The slow part of an axis, and what it points to. A second table of zeros is left out."""
        mixes = bool(np.any(frame.second))
        table = frame.slow.words.tolist()
        gains = self.array(c_int32, frame.gains.words.tolist())
        ratios = self.array(ctypes.c_int16, frame.ratios.words.tolist())
        second = self.array(ctypes.c_int8, frame.second.tolist())
        # Behind these words the memory is free, of a size that no test touches.
        mixed = self.array(word, [0x55] * (len(frame.second) + self.words_behind))
        slow = self.array(word, [*table, *table[:WORDS_BEHIND]])
        words = [gains, ratios, second, mixed, slow]
        part = SlowPart(
            gains=ctypes.addressof(gains),
            ratios=ctypes.addressof(ratios) if mixes else None,
            second=ctypes.addressof(second) if mixes else None,
            mixed=ctypes.addressof(mixed) if mixes else None,
            table=ctypes.addressof(slow),
            gain_spacing=frame.gains.spacing,
            ratio_spacing=frame.ratios.spacing,
            gain_knots=len(frame.gains.words),
            ratio_knots=len(frame.ratios.words),
            index_bits=len(table).bit_length() - 1,
            gain_word=frame.slow.gain_word,
            offset_word=frame.slow.offset_word,
        )
        return part, words

    def program(self, program: ScanProgram) -> tuple[AnyCProgram, tuple[Any, ...]]:
        """A program as C has it, and its axes and pixels, which have to live as long as it plays."""
        schedule, axes = program.schedule, (self.axis(program.x), self.axis(program.y))
        windows = (
            Window(each.first, each.count)
            for each in (schedule.forward, schedule.backward, schedule.up, schedule.down)
        )  # fmt: skip
        times = schedule.ticks, schedule.lines, schedule.pixels, schedule.settle_lines, schedule.turn_tick
        if not self.pixel_table:
            assert schedule.pixel_table is None, "this runtime plays no table of pixels"
            kind = PROGRAMS[bool(self.shaping), self.slow_part]
            return kind(CSchedule(*times, *windows), axes[0].program, axes[1].program), axes
        counts = schedule.pixel_table and self.array(c_uint16, [*schedule.pixel_table[0], *schedule.pixel_table[1]])
        table = None if counts is None else ctypes.addressof(counts)
        planned = PixelCSchedule(*times, *windows, pixel_table=table)
        kind = PIXEL_PROGRAMS[bool(self.shaping), self.slow_part]
        return kind(planned, axes[0].program, axes[1].program), (*axes, counts)


def converter_of(output: Output, power_up_code: int = 0) -> Converter:
    """The converter that an output stage was made for."""
    return Converter(
        output.dac_bits, output.word_bits, output.coding == "twos-complement", output.align == "left", power_up_code
    )


class Device:
    """A sequencer in C."""

    def __init__(self, library: Library, x: Converter, y: Converter) -> None:
        self.library = library
        self.state = ctypes.create_string_buffer(b"\xa5" * library.dll.probe_size(0), library.dll.probe_size(0))
        library.dll.dac_sequencer_init(self.state, byref(x), byref(y))
        self.alive: list[object] = []

    def __getattr__(self, name: str) -> Any:
        """A function of the sequencer, by its name without prefix."""
        function = getattr(self.library.dll, f"dac_sequencer_{name}")
        return lambda *arguments: function(self.state, *arguments)

    def load(self, program: ScanProgram | AnyCProgram) -> int:
        """Load a program."""
        if isinstance(program, ScanProgram):
            program, axes = self.library.program(program)
            self.alive.append(axes)
        return int(self.library.dll.dac_sequencer_load(self.state, byref(program)))

    def steps(self, ticks: int) -> tuple[Ints, Ints, Ints, Ints]:
        """So many steps: x, y, markers, faults of each."""
        x, y = (np.zeros(ticks, self.library.output) for _ in range(2))
        markers, faults = (np.zeros(ticks, np.uint8) for _ in range(2))
        self.library.dll.probe_steps(
            self.state, *(array.ctypes.data_as(c_void_p) for array in (x, y, markers, faults)), c_size_t(ticks)
        )
        return x.astype(np.int64), y.astype(np.int64), markers.astype(np.int64), faults.astype(np.int64)

    def fill(self, ticks: int, markers: bool = True) -> tuple[Ints, Ints, Ints]:
        """So many ticks at once: x, y, markers; nothing but what was asked for may be written."""
        stride = self.library.stride
        untouched = 0xA5A5 if self.library.output_bytes == 2 else 0xA5A5A5A5
        x, y = (np.full(ticks * stride + 1, untouched, self.library.output) for _ in range(2))
        marks = np.full(ticks + 1, 0xA5, np.uint8)
        self.library.dll.dac_sequencer_fill(
            self.state,
            x.ctypes.data_as(c_void_p),
            y.ctypes.data_as(c_void_p),
            marks.ctypes.data_as(c_void_p) if markers else None,
            c_size_t(ticks),
        )
        for array in (x, y):
            between = np.delete(array, np.arange(0, ticks * stride, stride))
            assert np.all(between == untouched), "fill has written where it should not"
        assert marks[-1] == 0xA5
        return (
            x[:-1:stride].astype(np.int64)[:ticks],
            y[:-1:stride].astype(np.int64)[:ticks],
            marks[:-1].astype(np.int64),
        )


def markers_of(tick: Tick) -> int:
    """The markers of a tick of the model."""
    return sum(bit for name, bit in MARKER.items() if getattr(tick, name))


class Twin:
    """A device and the model, which are asked for the same, and whose ticks have to be the same."""

    def __init__(self, library: Library, program: ScanProgram, power_up: tuple[int, int] = (0, 0)) -> None:
        self.outputs = program.x.output, program.y.output
        self.device = Device(
            library, *(converter_of(out, code) for out, code in zip(self.outputs, power_up, strict=True))
        )
        self.model = Sequencer(None, codes=power_up)
        self.swaps = 0

    def commit(self, program: ScanProgram, loaded: CProgram | None = None) -> None:
        """Load and commit a program; ``loaded`` is the same, if C has it from elsewhere."""
        result = self.device.load(program if loaded is None else loaded)
        assert result == LOADED, f"not loaded: {result}"
        assert self.device.commit()
        self.model.commit(program)

    def ask(self, *requests: str, frames: int = 0) -> None:
        """Requests other than a commit, in order."""
        for name in requests:
            arguments = (frames,) if name == "arm" else ()
            assert getattr(self.device, name)(*arguments)
            getattr(self.model, name)(*arguments)

    def play(self, ticks: int, by: str = "step") -> None:
        """So many ticks, by ``step``, ``fill`` or ``blind`` (a fill that wants no markers)."""
        expected = [self.model.step() for _ in range(ticks)]
        faults = np.array([tick.faults.value for tick in expected], np.int64)
        wanted = [
            np.array([output.word(code) for code in codes], np.int64)
            for output, codes in zip(self.outputs, zip(*((t.x, t.y) for t in expected), strict=True), strict=True)
        ]
        if by == "step":
            *got, marks, seen = self.device.steps(ticks)
            same("faults", faults, seen)
        else:
            *got, marks = self.device.fill(ticks, by == "fill")
        same("x", wanted[0], got[0])
        same("y", wanted[1], got[1])
        if by != "blind":
            same("markers", np.array([markers_of(tick) for tick in expected], np.int64), marks)
        self.swaps += sum(tick.swapped for tick in expected)
        status = self.device.status()
        assert status.faults == faults[-1], "faults of the status"
        counts = [self.model.fault_counts[fault] for fault in (Fault.SLEW, Fault.CLAMP)]
        assert list(status.fault_counts) == [*counts, 0, 0], "counts of the status"
        assert status.swaps == self.swaps, "swaps of the status"
        assert status.line == self.model.line, "line of the status"
        if by != "blind":
            assert status.markers == markers_of(expected[-1]), "markers of the status"


def same(what: str, wanted: Ints, got: Ints) -> None:
    """Two arrays are; says where they are not."""
    if not np.array_equal(wanted, got):
        at = int(np.flatnonzero(wanted != got)[0])
        raise AssertionError(f"{what} of tick {at}: {got[at]} and not {wanted[at]}")
