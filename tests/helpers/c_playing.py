"""What the C sequencer puts out: words, markers, tables from Fourier words; checks of ``c_checks``."""

import ctypes
from ctypes import c_size_t, c_void_p

import numpy as np
from c_devices import SHAPE, Libraries, flat, gentle, playing
from c_library import MARKER, AxisProgram, Converter, CProgram, Status, Twin, same
from c_scripts import long_dual
from programs import random_fourier
from replacing import replace

from tablegen.device.schedule import Window as Lines
from tablegen.fixedpoint.synthesis import sine_periods, synthesize
from tablegen.verification.play.sequencer_shape import SequencerShape

CODINGS = [
    (16, 16, "twos-complement", "right"), (12, 16, "offset-binary", "left"), (12, 16, "twos-complement", "left"),
    (12, 16, "twos-complement", "right"), (8, 16, "offset-binary", "left"), (16, 16, "offset-binary", "left"),
]  # fmt: skip


WIDE_CODINGS = [
    (18, 24, "twos-complement", "left"), (24, 32, "offset-binary", "left"), (24, 24, "twos-complement", "right"),
    (20, 20, "twos-complement", "right"), (8, 32, "twos-complement", "left"),
]  # fmt: skip


def layout(libraries: Libraries) -> None:
    """The structures of ctypes are those of C, and the words are those of the build."""
    for library, size in zip(libraries, (2, 4), strict=True):
        sizes = [library.dll.probe_size(which) for which in range(8)]
        assert sizes[1:4] == [ctypes.sizeof(each) for each in (CProgram, AxisProgram, Converter)]
        assert sizes[5:] == [ctypes.sizeof(Status), size, size]


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
            shape = SequencerShape(bits, 1, 7, words, 1, 6, words)
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
    shapes = (SequencerShape(16, 1, 7, 16, 1, 5, 16), SequencerShape(24, 1, 7, 24, 0, 8, 18))
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


def renderings(libraries: Libraries) -> None:
    """Tables from Fourier words are those of the host; of words that could overflow there is none."""
    rng = np.random.default_rng(1)
    for library in libraries:
        bits = 8 * library.word_bytes - 8
        for index_bits, harmonics in ((3, 1), (3, 9), (4, 2), (6, 3), (7, 12), (9, 31)):
            words = random_fourier(rng, harmonics)
            sine = sine_periods(index_bits + harmonics % 2).astype(np.int32)
            fourier = words.in_order.astype(np.int32)
            length = 1 << index_bits
            table = np.full(length + 1, -1, library.word)
            where = [array.ctypes.data_as(c_void_p) for array in (table, fourier, sine)]
            for wanted in (True, False):
                if not wanted:
                    fourier[:3] = -(1 << 31)
                    table[:] = 0
                done = library.dll.dac_synthesize(
                    where[0], length + 1, index_bits, bits, where[1], harmonics, where[2], index_bits + harmonics % 2
                )
                assert done == wanted
                expected = synthesize(words, length, bits) if wanted else np.zeros(length, np.int64)
                same("words", np.append(expected, expected[0]), table.astype(np.int64))
                assert not library.dll.dac_synthesize(
                    where[0], length, index_bits, bits, where[1], harmonics, where[2], index_bits + harmonics % 2
                ), "no room for the word behind the last"
