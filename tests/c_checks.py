"""What the functions of the C sequencer promise, one check a function; as a program, all of them on two libraries.

A check raises ``AssertionError``. As a program they may crash or hang: with sanitizers, of mutants, for coverage.
"""

import ctypes
import sys
from collections.abc import Callable, Iterator
from ctypes import byref, c_int32, c_size_t, c_uint32, c_uint64, c_void_p
from dataclasses import replace
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from c_library import (
    BAD_OUTPUT,
    BAD_PERIOD,
    BAD_SCHEDULE,
    BAD_TABLE,
    BUSY,
    CLAMP,
    LOADED,
    MARKER,
    OTHER_CONVERTER,
    OVERRUN,
    SLEW,
    UNDERRUN,
    AxisProgram,
    Converter,
    CProgram,
    Device,
    Library,
    Status,
    Twin,
    Window,
    converter_of,
    same,
)
from c_scripts import long_dual, wave_program
from programs import random_dual, random_fourier

from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.synthesis import sine_periods, synthesize
from tablegen.schedule import Schedule
from tablegen.schedule import Window as Lines
from tablegen.sequencer import DualProgram
from tablegen.verify.bench import Shape

SHAPE = Shape(16, 1, 4, 16, 1, 3, 16)
REQUESTS = 8  # in the queue


class Libraries(NamedTuple):
    """Words of 16 bits, and of 32."""

    narrow: Library
    wide: Library


Check = Callable[[Libraries], None]


def gentle(seed: int, shape: Shape = SHAPE, **output: object) -> DualProgram:
    """A program that neither clamps nor is held back, once it has caught up; keys are of both output stages."""
    program = random_dual(np.random.default_rng(seed), shape, (40, 60), kind="tame", lines=(3, 3))
    schedule = replace(
        program.schedule, pixels=5, settle_lines=1, turn_tick=25, forward=Lines(3, 20), backward=Lines(26, 12),
        turn_line=2, up=Lines(0, 2), down=Lines(2, 1),
    )  # fmt: skip
    x, y = (
        replace(axis, output=replace(axis.output, **{"max_step": 3000, **output})) for axis in (program.x, program.y)
    )
    return DualProgram(x, y, schedule)


def flat(code: int, schedule: Schedule | None = None, **output: int) -> DualProgram:
    """A program whose codes are all the same; keys are of both output stages."""
    schedule = schedule or Schedule(
        32, 2, Fraction(1000), 1.0, 4, 0, 16, Lines(0, 8), Lines(16, 8), 1, Lines(0, 1), Lines(1, 1)
    )
    stage = Output(1, 20, code << 20, 0, 65535, 65535, 0, 16, "offset-binary", "right", 16)
    words = np.zeros(8, np.int64)
    axes = (
        Program(RationalPhase(ticks), 1, "interpolated", 16, words, replace(stage, **output))
        for ticks in (schedule.ticks, schedule.frame_ticks)
    )
    return DualProgram(*axes, schedule)


def device_for(library: Library, program: DualProgram, power_up: int = 0) -> Device:
    """A device with the converters of a program."""
    return Device(library, *(converter_of(axis.output, power_up) for axis in (program.x, program.y)))


def playing(library: Library, program: DualProgram, frames: int = 0) -> Device:
    """A device that is about to play a program's first tick."""
    device = device_for(library, program)
    assert device.load(program) == LOADED
    assert device.commit()
    device.steps(1)
    assert device.arm(frames)
    assert device.trigger()
    return device


def layout(libraries: Libraries) -> None:
    """The structures of ctypes are those of C, and the words are those of the build."""
    for library, size in zip(libraries, (2, 4), strict=True):
        sizes = [library.dll.probe_size(which) for which in range(8)]
        assert sizes[1:4] == [ctypes.sizeof(each) for each in (CProgram, AxisProgram, Converter)]
        assert sizes[5:] == [ctypes.sizeof(Status), size, size]


CODINGS = [
    (16, 16, "twos-complement", "right"), (12, 16, "offset-binary", "left"), (12, 16, "twos-complement", "left"),
    (12, 16, "twos-complement", "right"), (8, 16, "offset-binary", "left"), (16, 16, "offset-binary", "left"),
]  # fmt: skip
WIDE_CODINGS = [
    (18, 24, "twos-complement", "left"), (24, 32, "offset-binary", "left"), (24, 24, "twos-complement", "right"),
    (20, 20, "twos-complement", "right"), (8, 32, "twos-complement", "left"),
]  # fmt: skip


def converter_words(libraries: Libraries) -> None:
    """Coding and alignment of what leaves, by step and by fill; x and y have codes of their own at power-up."""
    for library, codings in zip(libraries, (CODINGS, WIDE_CODINGS), strict=True):
        for seed, (bits, word_bits, coding, align) in enumerate(codings):
            shape = replace(SHAPE, dac_bits=bits, x_word_bits=12, y_word_bits=8 * library.word_bytes - 8)
            program = gentle(seed, shape, coding=coding, align=align, word_bits=word_bits, max_step=(1 << bits) // 20)
            twin = Twin(library, program, power_up=((1 << bits) - 1, 1 << (bits - 1)))
            twin.play(3)
            twin.play(20, "fill")
            twin.commit(program)
            twin.ask("arm", "trigger")
            twin.play(300, "fill")
            twin.play(130)
            twin.play(200, "blind")
            twin.ask("park")
            twin.play(100, "fill")


def converter_words_of_runs(libraries: Libraries) -> None:
    """The same for smooth lines, which fills play many ticks at once."""
    for library, codings in zip(libraries, (CODINGS, WIDE_CODINGS), strict=True):
        for seed, (bits, word_bits, coding, align) in enumerate(codings):
            words = 16 if library.word_bytes == 2 else 24
            shape = Shape(bits, 1, 7, words, 1, 6, words)
            program = long_dual(np.random.default_rng(seed), shape, (300, 400), lines=(2, 2))
            x, y = (
                replace(axis, output=replace(axis.output, coding=coding, align=align, word_bits=word_bits))
                for axis in (program.x, program.y)
            )
            if seed % 2:
                y = replace(y, output=replace(y.output, coding="offset-binary", align="right"))
            program = replace(program, x=x, y=y)
            twin = Twin(library, program)
            twin.commit(program)
            twin.play(2)
            twin.ask("arm", "trigger")
            for _ in range(30):
                twin.play(50, "fill")


def several_programs(libraries: Libraries) -> None:
    """Smooth programs one after the other, by steps and fills of all lengths."""
    shapes = (Shape(16, 1, 7, 16, 1, 5, 16), Shape(24, 1, 7, 24, 0, 8, 18))
    for library, shape in zip(libraries, shapes, strict=True):
        rng = np.random.default_rng(3)
        twin: Twin | None = None
        for number in range(12):
            program = long_dual(rng, shape, (50, 300))
            twin = twin or Twin(library, program, (7, 9))
            twin.commit(program)
            if number % 4 == 0:
                twin.ask("arm", "trigger", frames=number // 4)
            while twin.model.idle is not None or rng.random() < 0.9:
                twin.play(int(rng.integers(1, 120)), str(rng.choice(["step", "fill", "fill"])))


def a_fill_that_wants_no_markers(libraries: Libraries) -> None:
    """Equals one that does but for the pixels, which begin again with the next window; an empty fill does nothing."""
    library = libraries.narrow
    program = flat(30000)
    for ticks in range(1, 80):
        twins = [playing(library, program) for _ in range(2)]
        for device in twins:
            device.steps(32)  # settled on its code
        (x, y, _), (x_blind, y_blind, untouched) = twins[0].fill(ticks), twins[1].fill(ticks, markers=False)
        same("x", x, x_blind)
        same("y", y, y_blind)
        assert np.all(untouched == 0xA5)
        marked = twins[0].status().markers
        assert twins[1].status().markers in (MARKER["playing"], marked), "of the last tick, if that was a step"
        for device in twins:
            device.fill(0)
        assert twins[0].status().markers == marked
        (*_, marks, _), (*_, blind, _) = (device.steps(64) for device in twins)
        same("markers but pixels", marks & ~MARKER["pixel"], blind & ~MARKER["pixel"])
        k = (32 + ticks + np.arange(64)) % 32
        window = np.searchsorted([0, 8, 16, 24], k, side="right")  # 1 forward, 3 backward
        changes = np.flatnonzero((np.diff(window) != 0) | (np.diff(k) < 0))
        same("pixels later", marks[changes[0] + 1 :], blind[changes[0] + 1 :])
        assert not np.any(blind & ~marks)


def markers_known_again(libraries: Libraries) -> None:
    """After a blind fill of runs pixels are not told in the middle of a window, however the ticks are played."""
    for by_fill in (False, True):
        schedule = replace(flat(1).schedule, ticks=200, turn_tick=200, forward=Lines(0, 100), backward=Lines(200, 0))
        device = playing(libraries.narrow, flat(30000, replace(schedule, pixels=50)))
        device.fill(232, markers=False)
        marks = device.fill(200)[2] if by_fill else device.steps(200)[2]
        pixels = np.flatnonzero(marks & MARKER["pixel"])
        same("schedule.pixels", 168 + np.arange(0, 32, 2), pixels)


def status_of_power_up(libraries: Libraries) -> None:
    """Everything is stated by init, whatever was in memory; the codes at power-up hold, and nothing can be started."""
    device = device_for(libraries.narrow, flat(1), power_up=4711)
    status = device.status()
    assert (status.markers, status.faults, status.swaps, status.line) == (0, 0, 0, 0)
    assert list(status.fault_counts) == [0] * 4
    assert device.idle() == 0
    assert device.writable()
    assert not device.commit()
    assert device.arm(0)
    assert device.trigger()
    for x, y, marks in (device.steps(5)[:3], device.fill(5)):
        assert set(x) == set(y) == {4711}
        assert set(marks) == {MARKER["parked"]}
    assert device.load(flat(1)) == LOADED
    assert device.commit()
    assert device.trigger()  # still armed
    assert device.steps(1)[2][0] & MARKER["playing"] == 0
    assert device.trigger()
    assert device.steps(1)[2][0] & MARKER["playing"]


def the_queue(libraries: Libraries) -> None:
    """Takes as many requests as it has places, refuses more without effect, and is empty once they were acted on."""
    program = flat(1)
    for start in (0, 3, 250):
        device = device_for(libraries.narrow, program)
        for _ in range(start):
            assert device.clear_faults()
            device.answer()
        assert device.load(program) == LOADED
        assert all(device.arm(5) for _ in range(REQUESTS - 1))
        assert device.arm(1)
        requests = ("commit", "withdraw", "trigger", "park", "reset", "clear_faults")
        assert not any(getattr(device, name)() for name in requests)
        assert not device.arm(7)
        assert device.writable(), "a commit that was refused waits"
        device.answer()
        assert device.writable()
        assert all((device.commit(), device.trigger(), device.trigger()))
        assert not device.writable()
        device.answer()
        assert not device.writable(), "the program was not taken yet"
        assert device.steps(1)[2][0] == MARKER["swapped"] | MARKER["parked"]  # nothing played when it was triggered
        assert device.writable()
        assert device.trigger()
        marks = device.steps(130)[2]
        assert np.sum(marks & MARKER["playing"] != 0) == program.schedule.frame_ticks, "the last count of arm is that"


def answers(libraries: Libraries) -> None:
    """Requests act without ticks where the driver asks for it, and in their order."""
    program = flat(1000)
    device = playing(libraries.narrow, program)
    device.steps(8)
    assert device.park()
    device.answer()
    assert device.load(program) == LOADED
    assert device.commit()
    assert device.load(program) == BUSY
    assert device.withdraw()
    assert device.load(program) == BUSY
    device.answer()
    assert device.writable()
    assert device.load(program) == LOADED
    assert device.commit()
    assert device.reset()
    device.answer()
    assert device.writable()
    device.steps(3)
    assert device.status().swaps == 1
    assert device.arm(0)
    assert device.trigger()
    assert device.park()
    assert device.trigger()
    assert device.steps(1)[2][0] & MARKER["playing"] == 0
    assert device.arm(0)
    assert device.reset()
    assert device.trigger()
    assert device.steps(1)[2][0] & MARKER["playing"] == 0


def banks(libraries: Libraries) -> None:
    """The set of tables to write is the one that does not play; a bank can be loaded again until it is committed."""
    device = device_for(libraries.narrow, flat(1))
    for number, expected in enumerate((0, 1, 0, 1)):
        assert device.idle() == expected
        assert device.load(flat(7)) == LOADED
        assert device.load(flat(100 + number)) == LOADED
        assert device.commit()
        assert device.load(flat(8)) == BUSY
        assert device.idle() == expected
        device.steps(1)
        assert device.arm(0)
        assert device.trigger()
        assert set(device.steps(10)[0]) == {100 + number}
        assert device.park()
        device.steps(1)


def commits(libraries: Libraries) -> None:
    """A commit is for what was loaded since the last swap: after it the idle bank has what played before."""
    device = device_for(libraries.narrow, flat(1))
    assert not device.commit(), "nothing was loaded"
    assert device.load(flat(10)) == LOADED
    assert all(device.commit() for _ in range(3))
    device.steps(2)
    assert device.status().swaps == 1
    assert device.writable()
    assert device.commit()
    assert not device.writable(), "not before it was answered"
    assert not device.steps(3)[2][0] & MARKER["swapped"], "the other bank is empty"
    assert device.status().swaps == 1
    assert device.writable()
    assert device.load(flat(20)) == LOADED
    assert device.load(flat(30)) == LOADED
    assert device.commit()
    assert device.withdraw()
    device.steps(2)
    assert device.status().swaps == 1
    assert device.commit(), "a program that was withdrawn is still loaded"
    assert device.steps(1)[2][0] & MARKER["swapped"]
    assert device.arm(0)
    assert device.trigger()
    assert set(device.steps(4)[0]) == {30}
    assert device.commit()
    assert device.load(flat(40)) == BUSY
    device.steps(70)
    assert device.status().swaps == 2
    # Committed before a swap and after it, both in the queue at once: the second is void.
    assert device.load(flat(50)) == LOADED
    assert device.commit()
    assert device.commit()
    device.steps(70)
    assert device.status().swaps == 3
    assert set(device.steps(4)[0]) == {50}


def reports(libraries: Libraries) -> None:
    """Faults that the driver saw are counted, sticky, told and cleared; counts stay at their highest."""
    program = flat(1000, replace(flat(1).schedule, up=Lines(0, 2)))
    device = playing(libraries.narrow, program)
    valid = MARKER["valid"]
    assert np.any(device.steps(64)[2] & valid)
    for fault, counts in ((OVERRUN, [0, 0, 1, 0]), (UNDERRUN, [0, 0, 1, 1]), (OVERRUN | UNDERRUN, [0, 0, 2, 2])):
        device.report(fault)
        assert list(device.status().fault_counts) == counts
    *_, marks, faults = device.steps(64)
    assert not np.any(marks & valid)
    assert set(faults) == {OVERRUN | UNDERRUN} == {device.status().faults}
    assert not np.any(device.fill(64)[2] & valid)
    assert device.clear_faults()
    assert np.any(device.fill(64)[2] & valid)
    assert device.status().faults == 0
    for fault in range(4):
        device.library.dll.probe_set_count(device.state, fault, c_uint32(2**32 - 2))
    for _ in range(3):
        device.report(SLEW | CLAMP | OVERRUN)
    assert list(device.status().fault_counts) == [2**32 - 1] * 3 + [2**32 - 2]
    assert device.reset()
    device.steps(1)
    assert list(device.status().fault_counts) == [0] * 4
    assert device.status().faults == 0


def _changed(program: CProgram, path: str, value: object) -> CProgram:
    copy = CProgram.from_buffer_copy(program)
    *parents, last = path.split(".")
    place: object = copy
    for parent in parents:
        place = getattr(place, parent)
    setattr(place, last, value)
    return copy


def _axis_refusals(axis: str, length: int) -> Iterator[tuple[int, str, object]]:
    yield from ((OTHER_CONVERTER, f"{axis}.{key}", value) for key, value in (
        ("dac_bits", 15), ("word_bits", 15), ("twos_complement", True),
    ))  # fmt: skip
    yield from ((BAD_TABLE, f"{axis}.{key}", value) for key, value in (
        ("table", None), ("bits", 7), ("bits", 17), ("bits", 25), ("index_bits", 2), ("index_bits", 17),
        ("index_bits", 0),
        ("length", length - 1), ("length", length + 1), ("length", 0),
    ))  # fmt: skip
    yield from ((BAD_PERIOD, f"{axis}.{key}", value) for key, value in (
        ("phase_period", 0), ("phase_period", 1), ("phase_period", 99), ("hold_ticks", 0), ("hold_ticks", 2),
    ))  # fmt: skip
    yield from ((BAD_OUTPUT, f"{axis}.{key}", value) for key, value in (
        ("gain_word", 1 << 17), ("gain_word", -(1 << 17) - 1), ("gain_q", 19), ("gain_q", 21), ("gain_q", 0),
        ("offset_word", 1 << 42), ("offset_word", -(1 << 42)), ("code_min", -1), ("code_min", 501),
        ("park_code", 99), ("park_code", 601), ("code_max", 499), ("code_max", 65536), ("max_step", 0),
        ("max_step", -1), ("max_step", 1 << 24),
    ))  # fmt: skip


def refusals(libraries: Libraries) -> None:
    """Each reason not to load a program, and the last value on its right side."""
    device = device_for(libraries.narrow, flat(1))
    dual = flat(500, code_min=100, code_max=600, park_code=500, max_step=400)
    good, axes = libraries.narrow.program(dual)
    refused: list[tuple[int, str, object]] = [
        *((BAD_SCHEDULE, f"schedule.{key}", value) for key, value in (
            ("line_ticks", 0), ("line_ticks", (1 << 24) + 1), ("frame_lines", 0), ("frame_lines", 1 << 26),
            ("frame_lines", 1 << 31), ("frame_lines", (1 << 32) - 1), ("turn_tick", 33), ("pixels", 33),
            *((side, Window(*window)) for side, window in (
                ("forward", (33, 0)), ("forward", (0, 33)), ("forward", (31, 2)), ("forward", (2**32 - 1, 2)),
                ("backward", (33, 0)), ("backward", (1, 32)), ("up", (3, 0)), ("up", (1, 2)), ("down", (2, 1)),
                ("down", (0, 3)),
            )),
        )),
        *_axis_refusals("x", 8), *_axis_refusals("y", 8),
        (BAD_PERIOD, "x.hold_ticks", 32), (BAD_PERIOD, "y.hold_ticks", 32),
    ]  # fmt: skip
    for reason, path, value in refused:
        got = device.load(_changed(good, path, value))
        assert got == reason, f"{path} = {value}: {got} and not {reason}"
        assert not device.commit(), f"{path} = {value}: committed"
    accepted: list[tuple[str, object]] = [
        *((f"schedule.{key}", value) for key, value in (
            ("turn_tick", 32), ("turn_tick", 0), ("pixels", 32), ("pixels", 0), ("settle_lines", (1 << 32) - 1),
            ("forward", Window(32, 0)), ("forward", Window(0, 32)), ("forward", Window(31, 1)), ("down", Window(0, 2)),
        )),
        *((f"{axis}.{key}", value) for axis in "xy" for key, value in (
            ("gain_word", (1 << 17) - 1), ("gain_word", -(1 << 17)), ("code_min", 0), ("code_min", 500),
            ("code_max", 500), ("code_max", 65535), ("park_code", 100), ("park_code", 600), ("max_step", (1 << 24) - 1),
            ("max_step", 1), ("offset_word", 0), ("left_aligned", True),
        )),
    ]  # fmt: skip
    for path, value in accepted:
        got = device.load(_changed(good, path, value))
        assert got == LOADED, f"{path} = {value}: {got}"
    empty = _changed(_changed(good, "schedule.up", Window(0, 0)), "schedule.down", Window(0, 0))
    for reason, several in (
        (BAD_SCHEDULE, {"schedule.frame_lines": 0, "y.phase_period": 0}),
        (BAD_TABLE, {"x.index_bits": 2, "x.length": 4}), (BAD_TABLE, {"y.index_bits": 17, "y.length": 1 << 17}),
        (BAD_PERIOD, {"y.hold_ticks": 5, "y.phase_period": 2}), (LOADED, {"y.hold_ticks": 32, "y.phase_period": 2}),
    ):  # fmt: skip
        program = empty
        for path, value in several.items():
            program = _changed(program, path, value)
        got = device.load(program)
        assert got == reason, f"{several}: {got}"
    device.alive.append(axes)


def the_largest_schedules(libraries: Libraries) -> None:
    """Lines of 2^24 ticks and frames of just below 2^31 are taken, and no more; and the longest and shortest tables."""
    library = libraries.wide
    device = device_for(library, flat(1))
    none = {"turn_tick": 0, "forward": Lines(0, 0), "backward": Lines(0, 0), "up": Lines(0, 0), "down": Lines(0, 0)}
    for ticks, lines, result in (
        (1 << 24, 127, LOADED), (1 << 24, 128, BAD_SCHEDULE), (1, (1 << 31) - 1, LOADED), (1, 1 << 31, BAD_SCHEDULE),
        (3, 715827882, LOADED), (3, 715827883, BAD_SCHEDULE), (1, 1, LOADED),
    ):  # fmt: skip
        schedule = replace(flat(1).schedule, lines=1, pixels=1, **none)
        program, axes = library.program(flat(1, replace(schedule, ticks=32)))
        program.schedule.line_ticks = program.x.phase_period = ticks
        program.schedule.frame_lines, program.y.phase_period = lines, ticks * lines
        assert device.load(program) == result, (ticks, lines)
        device.alive.append(axes)
    for interpolated, index_bits, bits, length, result in (
        (1, 16, 24, 65536, LOADED), (1, 16, 25, 65536, BAD_TABLE), (1, 3, 8, 8, LOADED),
        (0, 0, 24, 131072, LOADED), (0, 0, 24, 131073, BAD_TABLE),
        (0, 0, 24, 1, LOADED),
    ):  # fmt: skip
        ticks = 32 if interpolated else length
        program, axes = library.program(flat(1, replace(flat(1).schedule, ticks=ticks, lines=1, pixels=1, **none)))
        program.x.index_bits, program.x.length, program.x.bits = index_bits, length, bits
        program.x.gain_q = 16 + bits + min(4, 25 - bits) - 16
        program.x.offset_word = 0
        assert device.load(program) == result, (interpolated, index_bits, bits, length)
        device.alive.append(axes)


def offsets_that_overflow(libraries: Libraries) -> None:
    """An offset that no code needs is refused, or its arithmetic holds: nothing overflows on the way to the clamp."""
    for library, bits, dac_bits in ((libraries.narrow, 8, 16), (libraries.wide, 8, 24), (libraries.wide, 24, 8)):
        gain_q = 16 + bits + min(4, 25 - bits) - dac_bits
        for offset in ((1 << 42) - 1, -(1 << 42) + 1, 1 << (dac_bits + gain_q), (1 << (dac_bits + gain_q)) - 1):
            stage = {"gain_q": gain_q, "offset_word": offset, "dac_bits": dac_bits, "word_bits": dac_bits}
            top = (1 << dac_bits) - 1
            program = flat(0, **stage, code_max=top, max_step=top)
            program = replace(program, x=replace(program.x, bits=bits), y=replace(program.y, bits=bits))
            device = device_for(library, program)
            if device.load(program) != LOADED:
                assert offset not in range(1 << (dac_bits + gain_q)), "an offset that is a code was refused"
                continue
            assert all((device.commit(), device.steps(1), device.arm(0), device.trigger()))
            assert set(device.steps(40)[0]) == {0 if offset < 0 else top}, f"offset {offset} with gain_q {gain_q}"


def other_converters(libraries: Libraries) -> None:
    """What an axis is soldered to decides; where words have no room to be shifted their alignment means nothing."""
    program = flat(1)
    loads = {
        (16, 16, False, False): LOADED, (16, 16, False, True): LOADED, (16, 16, True, False): OTHER_CONVERTER,
        (16, 24, False, False): OTHER_CONVERTER, (12, 16, False, False): OTHER_CONVERTER,
    }  # fmt: skip
    for converter, result in loads.items():
        plain = Converter(16, 16, False, False, 0)
        for pair in ((Converter(*converter, 0), plain), (plain, Converter(*converter, 0))):
            assert Device(libraries.wide, *pair).load(program) == result, converter
    shifted = Converter(16, 24, False, True, 0)
    device = Device(libraries.wide, shifted, shifted)
    assert device.load(flat(1)) == OTHER_CONVERTER
    stage = {"word_bits": 24}
    assert device.load(flat(1, **stage)) == OTHER_CONVERTER
    left = replace(flat(1, **stage))
    left = replace(left, **{
        axis: replace(getattr(left, axis), output=replace(getattr(left, axis).output, align="left")) for axis in "xy"
    })  # fmt: skip
    assert device.load(left) == LOADED


def words_too_wide_for_their_storage(libraries: Libraries) -> None:
    """Programs for words that the build has no room for are refused, not cut off."""
    for word_bits, bits, align in ((24, 24, "right"), (24, 16, "left"), (18, 18, "right")):
        stage = {"dac_bits": bits, "word_bits": word_bits, "gain_q": 16 + 16 + 4 - bits, "offset_word": 0}
        program = flat(1, **stage)
        program = replace(program, **{
            axis: replace(getattr(program, axis), output=replace(getattr(program, axis).output, align=align))
            for axis in "xy"
        })  # fmt: skip
        assert device_for(libraries.narrow, program).load(program) == OTHER_CONVERTER, (word_bits, bits, align)


def lines_of_the_status(libraries: Libraries) -> None:
    """The line of the frame that the next tick belongs to."""
    device = playing(libraries.narrow, flat(5))
    seen = []
    for _ in range(130):
        device.steps(1)
        seen.append(device.status().line)
    lines = np.array(seen)
    same("lines", (np.arange(1, 131) // 32) % 2, lines)


def one_buffer_for_both(libraries: Libraries) -> None:
    """Interleaved, as the header says."""
    program = gentle(5)
    assert libraries.narrow.stride == 2
    twin, device = playing(libraries.narrow, program), playing(libraries.narrow, program)
    x, y = twin.steps(300)[:2]
    buffer = np.zeros(600, np.uint16)
    address = buffer.ctypes.data
    device.library.dll.dac_sequencer_fill(device.state, c_void_p(address), c_void_p(address + 2), None, c_size_t(300))
    same("x", x, buffer[::2].astype(np.int64))
    same("y", y, buffer[1::2].astype(np.int64))


WHOLE = 1 << 96  # of a position
RUN_TICKS = 256


def loaded(library: Library, period: int, index_bits: int, y: Program | None = None) -> Device:
    """A device into whose bank 0 a program was loaded whose y has a period of so many advances."""
    schedule: Schedule = replace(flat(1).schedule, ticks=1, lines=1, pixels=1, turn_tick=0)
    schedule = replace(schedule, **{each: type(schedule.up)(0, 0) for each in ("forward", "backward", "up", "down")})
    program = flat(1, schedule)
    if y is not None:
        program = replace(program, y=y, x=replace(program.x, output=y.output, bits=y.bits))
    device = device_for(library, program)
    words, axes = library.program(program)
    words.schedule.frame_lines = words.y.phase_period = period
    if y is None:
        words.y.index_bits, words.y.length = index_bits, 1 << index_bits  # nothing is read from the table
    assert device.load(words) == LOADED
    device.alive.append((axes, program))
    return device


def step_of(device: Device) -> int:
    low, high = c_uint64(), c_uint32()
    device.library.dll.probe_step_of(device.state, 0, byref(low), byref(high))
    return high.value << 64 | low.value


def skipped(device: Device, position: int, ticks: int) -> int:
    low, high = c_uint64(position & (1 << 64) - 1), c_uint32(position >> 64)
    device.library.dll.probe_skip(device.state, 0, c_uint32(ticks), byref(low), byref(high))
    return high.value << 64 | low.value


def advanced(device: Device, position: int, step: int) -> int:
    low, high = c_uint64(position & (1 << 64) - 1), c_uint32(position >> 64)
    device.library.dll.probe_advance(byref(low), byref(high), c_uint64(step & (1 << 64) - 1), c_uint32(step >> 64))
    return high.value << 64 | low.value


def steep(index_bits: int, seed: int) -> Program:
    """24-bit words so different that one more of the fraction is another code, and a window that lets runs pass."""
    words = np.random.default_rng(seed).integers(-(1 << 22), 1 << 22, 1 << index_bits)
    output = Output(1 << 16, 21, 1 << 40, 0, (1 << 20) - 1, (1 << 20) - 1, 0, 20, "offset-binary", "right", 20)
    return Program(RationalPhase(1), 1, "interpolated", 24, words, output)


def nearest(period: int, index_bits: int) -> int:
    """Of an odd period, the advance k at which k 2^(15 + P) is 1 below a multiple of the period."""
    return (period - 1) * pow(1 << 15 + index_bits, -1, period) % period if period > 1 else 0


def runs_from(library: Library, period: int, index_bits: int, seed: int, first: int) -> None:
    """Ticks played at once from the position of a tick on are those of the model; so is where they end."""
    program = steep(index_bits, seed)
    device = loaded(library, period, index_bits, program)
    program = replace(program, phase=RationalPhase(period))
    step, ticks = step_of(device), min(RUN_TICKS, period - first)
    codes = program.codes(first + np.arange(ticks))
    position = step * first % WHOLE
    low, high, code = c_uint64(position & (1 << 64) - 1), c_uint32(position >> 64), c_int32(int(codes[0]))
    out = np.full(ticks * library.stride + 1, 0xA5A5A5A5, np.uint32)
    done = device.library.dll.probe_run(
        device.state, 0, byref(low), byref(high), byref(code), out.ctypes.data_as(c_void_p), c_uint32(ticks)
    )
    assert done <= ticks
    assert out[-1] == 0xA5A5A5A5
    same("codes of a run", codes[:done], out[: -1 : library.stride].astype(np.int64)[:done])
    assert (high.value << 64 | low.value) == step * (first + done) % WHOLE, "position after a run"
    assert code.value == (codes[done - 1] if done else codes[0]), "code after a run"
    if 20_000 < period < (1 << 32) // 20 and index_bits == 3 and first < period * 3 // 4:
        assert done == ticks, "the window is wide: nothing may stop a run here"


def positions(libraries: Libraries) -> None:
    """Those of long and short periods are exact, by addition, by multiplication, and in runs."""
    rng, library = np.random.default_rng(9), libraries.wide
    for bits in np.repeat(np.arange(1, 31), 4):
        period = 2 * int(rng.integers(1 << bits - 1, 1 << bits)) - 1
        index_bits = int(rng.integers(3, 8))
        device = loaded(library, period, index_bits)
        step, k = step_of(device), int(rng.integers(0, period))
        assert step == -(-(1 << 79 + index_bits) // period), "step"
        ticks = min(k, int(rng.integers(1 << 24)))
        assert skipped(device, step * (k - ticks) % WHOLE, ticks) == step * k % WHOLE, "skip"
        assert advanced(device, step * k % WHOLE, step) == step * (k + 1) % WHOLE, "advance"
        assert advanced(device, WHOLE - 1, WHOLE - (1 << 64)) == WHOLE - (1 << 64) - 1, "advance by no low bits"
        for back in (0, 1, 15, 100, 254, 255):
            runs_from(library, period, index_bits, 0, max(nearest(period, index_bits) - back, 0))
        runs_from(library, period, index_bits, 1, k)
        runs_from(library, period, index_bits, 2, max(period - RUN_TICKS, 0))
    for odd in (1, 3, 12345, 999999):  # an advance that is a whole number of fractions
        for twos in (1, 5, 7):
            for back in range(17):
                runs_from(library, odd << twos, 4, 0, max(odd - back, 0))
    for period in (1, 2, 3, 4, 64, 1 << 20, (1 << 31) - 1, (1 << 32) // 18, (1 << 32) // 50):
        device = loaded(library, period, 3)
        assert step_of(device) == -(-(1 << 82) // period), f"step of {period}"
        runs_from(library, period, 3, 0, 0)


def runs_take_place(libraries: Libraries) -> None:
    """Where a program rests on a code, all of its ticks are one run; but for those that need the last word."""
    for library in libraries:
        for shape in ({}, {"max_step": 1}, {"gain_word": 1000, "offset_word": (30000 << 20) + (1 << 19) - 1}):
            device = device_for(library, flat(30000))
            assert device.load(flat(30000, **shape)) == LOADED
            low, high, code = c_uint64(0), c_uint32(0), c_int32(30000)
            out = np.zeros(64 * library.stride, library.output)
            done = library.dll.probe_run(
                device.state, 0, byref(low), byref(high), byref(code), out.ctypes.data_as(c_void_p), c_uint32(50)
            )
            assert done == 50
            assert set(out[: 50 * library.stride : library.stride]) == {30000}


def rounding(libraries: Libraries) -> None:
    """To nearest, ties up, by steps and by runs; the last bit of sample and offset counts."""
    half = 1 << 19
    for library in libraries:
        for word, rest, code in (
            (0, 0, 30000), (0, half - 1, 30000), (0, half, 30001), (0, 2 * half - 1, 30001), (0, -half, 30000),
            (0, -half - 1, 29999),
            (1, -half - 16, 30000), (1, -half - 17, 29999), (-1, half + 16, 30001), (-1, half + 15, 30000),
        ):  # fmt: skip
            program = flat(0, offset_word=(30000 << 20) + rest)
            words = np.full(8, word)
            device = playing(library, DualProgram(replace(program.x, words=words), program.y, program.schedule))
            device.steps(3)
            assert set(device.steps(20)[0]) == set(device.fill(60)[0]) == {code}, (word, rest)


def _resting(words: list[int], ticks: int, y_words: list[int], **output: int) -> DualProgram:
    """A program of unit gain around the middle of the codes, one line a frame."""
    schedule = replace(flat(1).schedule, ticks=ticks, lines=1, turn_line=1, up=Lines(0, 1), down=Lines(1, 0))
    schedule = replace(schedule, turn_tick=8, forward=Lines(0, 8), backward=Lines(8, 0))
    stage = {"gain_word": 1 << 16, "offset_word": 32768 << 20, "park_code": 32768, **output}
    program = flat(0, schedule, **stage)
    x, y = (replace(axis, words=np.array(each)) for axis, each in ((program.x, words), (program.y, y_words)))
    return DualProgram(x, y, schedule)


def runs_and_what_ends_them(libraries: Libraries) -> None:
    """A jump after runs is a slew fault; y ends a run of x in its middle; short lines of long tables end in time."""
    wave = [int(word) for word in np.floor(900 * np.sin(2 * np.pi * np.arange(128) / 128) + 0.5)]
    for program in (
        _resting([0] * 4 + [20000] * 4, 640, [0] * 8, max_step=100),
        _resting([0] * 8, 640, [0] * 4 + [20000] * 4, max_step=100),
        _resting(wave, 3000, [0] * 8, max_step=400),
        _resting(wave, 3000, [0, 0, 0, 3000, -3000, 0, 0, 0], max_step=400),
        _resting([0] * 65536, 8, [0] * 65536),
        _resting([0] * 65536, 9, [0] * 65536),
    ):
        twin = Twin(libraries.narrow, program, (32768, 32768))
        loaded, axes = libraries.narrow.program(program)
        zeros = (ctypes.c_int16 * (1 << 18))()  # behind the table as well, so that a run too long is not stopped there
        if program.schedule.ticks < 10:
            loaded.x.table = loaded.y.table = ctypes.addressof(zeros)
        twin.device.alive += [axes, zeros]
        twin.commit(program, loaded)
        twin.play(1)
        twin.ask("arm", "trigger")
        for ticks in (241, 109, 1, 700, 63, 2000):  # the first jump comes with the second fill
            twin.play(ticks, "fill")


def no_run_beyond_a_limit(libraries: Libraries) -> None:
    """Where the waveform rests a code outside the limits nothing is a run, wherever the last code was."""
    low, high = 20000, 30000
    for library, max_step in product(libraries, (1, 2, 3, 6, 7, 8, 15, 31, 100, 5000)):
        for target, codes in ((high + 1, range(high - 70, high + 1)), (low - 1, range(low, low + 70))):
            program = flat(target, code_min=low, code_max=high, park_code=low, max_step=max_step)
            device = device_for(library, program)
            assert device.load(program) == LOADED
            for last in codes:
                position, code = (c_uint64(0), c_uint32(0)), c_int32(last)
                out = np.zeros(20 * library.stride, library.output)
                done = library.dll.probe_run(
                    device.state, 0, *map(byref, position), byref(code), out.ctypes.data_as(c_void_p), c_uint32(16)
                )
                assert (done, code.value) == (0, last), f"from {last} to {target} by {max_step}"


def limits(libraries: Libraries) -> None:
    """A wave whose peaks are so many codes beyond the limits or short of them, in runs wherever there is room."""
    for library in libraries:
        shape = Shape(16, 1, 7, 8 * library.word_bytes - 8, 1, 6, 8 * library.word_bytes - 8)
        for height, beyond, max_step in product((300, 1200), (*range(-2, 8), 21, 39), (3, 7, 31, 40)):
            wave = wave_program(shape, height)
            codes = wave.x.codes(np.arange(wave.schedule.ticks))
            low, high = int(np.min(codes)) + beyond, int(np.max(codes)) - beyond
            output = replace(wave.x.output, code_min=low, code_max=high, park_code=low, max_step=max_step)
            # y is to stop no run: it is far from its limits.
            program = replace(wave, x=replace(wave.x, output=output))
            twin = Twin(library, program, (low, 0))
            twin.commit(program)
            twin.play(1)
            twin.ask("arm", "trigger")
            twin.play(wave.schedule.ticks, "fill")


def renderings(libraries: Libraries) -> None:
    """Tables from Fourier words are those of the host; of words that could overflow there is none."""
    rng = np.random.default_rng(1)
    for library in libraries:
        bits = 8 * library.word_bytes - 8
        for index_bits, harmonics in ((3, 1), (3, 9), (4, 2), (6, 3), (7, 12), (9, 31)):
            words = random_fourier(rng, harmonics)
            sine = sine_periods(index_bits + harmonics % 2).astype(np.int32)
            fourier = words.in_order.astype(np.int32)
            table = np.full(1 << index_bits, -1, library.word)
            where = [array.ctypes.data_as(c_void_p) for array in (table, fourier, sine)]
            for wanted in (True, False):
                if not wanted:
                    fourier[:3] = -(1 << 31)
                    table[:] = 0
                done = library.dll.dac_synthesize(
                    where[0], index_bits, bits, where[1], harmonics, where[2], index_bits + harmonics % 2
                )
                assert done == wanted
                expected = synthesize(words, 1 << index_bits, bits) if wanted else np.zeros(1 << index_bits, np.int64)
                same("words", expected, table.astype(np.int64))


CHECKS: tuple[Check, ...] = (
    layout, converter_words, converter_words_of_runs, several_programs, a_fill_that_wants_no_markers,
    markers_known_again, status_of_power_up, the_queue, answers, banks, commits, reports, refusals,
    the_largest_schedules, offsets_that_overflow, other_converters, words_too_wide_for_their_storage,
    lines_of_the_status, one_buffer_for_both,
    runs_and_what_ends_them, rounding, no_run_beyond_a_limit, limits, runs_take_place, positions, renderings,
)  # fmt: skip


def main(paths: list[str]) -> int:
    """All checks on the libraries at these paths, narrow and wide; what fails is named."""
    libraries = Libraries(*(Library(Path(path)) for path in paths))
    for check in CHECKS:
        try:
            check(libraries)
        except Exception as error:  # whatever a broken runtime leads to
            sys.stdout.write(f"{check.__name__}: {error}\n")
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
