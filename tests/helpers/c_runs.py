"""The path on which the C sequencer plays many ticks at once: positions, rounding, limits; checks of ``c_checks``."""

import ctypes
from ctypes import byref, c_int32, c_uint32, c_uint64, c_void_p
from itertools import product

import numpy as np
from c_devices import Libraries, device_for, flat, playing
from c_library import LOADED, Device, Library, Twin, same
from c_scripts import wave_program
from replacing import replace

from tablegen.device.dual_program import DualProgram
from tablegen.device.schedule import Schedule
from tablegen.device.schedule import Window as Lines
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Program
from tablegen.verification.play.sequencer_shape import SequencerShape

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
        blank = (c_int32 * ((1 << index_bits) + 1))()
        device.alive.append(blank)
        words.y.index_bits, words.y.length, words.y.table = index_bits, 1 << index_bits, ctypes.addressof(blank)
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
    """Where a program rests on a code, all of its ticks are one run, those of the last word too."""
    for library in libraries:
        for shape in ({}, {"max_step": 1}, {"gain_word": 1000, "offset_word": (30000 << 20) + (1 << 19) - 1}):
            device = device_for(library, flat(30000))
            assert device.load(flat(30000, **shape)) == LOADED
            low, high, code = c_uint64(0), c_uint32(0), c_int32(30000)
            out = np.zeros(64 * library.stride, library.output)
            done = library.dll.probe_run(
                device.state, 0, byref(low), byref(high), byref(code), out.ctypes.data_as(c_void_p), c_uint32(64)
            )
            assert done == 64
            assert set(out[: 64 * library.stride : library.stride]) == {30000}


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


def jumps_that_32_bits_do_not_tell(libraries: Libraries) -> None:
    """A code that is 2^12 beside the window, or a few of them, has the same 32 bits with its fraction as one inside."""
    rng = np.random.default_rng(3)
    for gain in (1 << 16, (1 << 17) - 1, -(1 << 17), 3 << 14, 1 << 15, -(1 << 16), 99_999, 1000):
        beside = [0, *(k * (1 << 28) // gain + few for k in (-3, -2, -1, 1, 2, 3) for few in (-1, 0, 1))]
        inside = [word for word in beside if abs(word) < 1 << 15]
        words = np.repeat(rng.choice(inside, 60), rng.integers(1, 40, 60))
        words[rng.integers(0, len(words), 40)] = rng.choice(inside, 40)  # alone, in the middle of a block
        schedule = replace(flat(1).schedule, ticks=len(words), lines=1, turn_line=1, turn_tick=8, up=Lines(0, 1))
        schedule = replace(schedule, forward=Lines(0, 8), backward=Lines(8, 0), down=Lines(1, 0))
        rest = flat(32768, schedule, park_code=32768, max_step=50_000)
        output = replace(rest.x.output, gain_word=gain, offset_word=32768 << 20)
        x = replace(rest.x, mode="direct", words=words, output=output)
        program = DualProgram(x, rest.y, schedule)
        for library in libraries:
            twin = Twin(library, program, (32768, 32768))
            twin.commit(program)
            twin.play(1)
            twin.ask("arm", "trigger")
            for ticks in (241, 1000, 3 * len(words)):
                twin.play(ticks, "fill")
    far = flat(30000)
    for library in libraries:
        device = device_for(library, far)
        assert device.load(far) == LOADED
        for last in range(30000 - 5 * 4096, 65536, 4096):  # the output has not arrived yet
            position, code = (c_uint64(0), c_uint32(0)), c_int32(last)
            out = np.zeros(20 * library.stride, library.output)
            done = library.dll.probe_run(
                device.state, 0, *map(byref, position), byref(code), out.ctypes.data_as(c_void_p), c_uint32(16)
            )
            assert (done, code.value) == ((16, 30000) if last in range(29_500, 30_500) else (0, last)), last


def slew_guards(libraries: Libraries) -> None:
    """The slew guard acts on one steep piece of a table, wherever it is, and on the first code of a run."""
    # 20 codes a tick, and 30 from the last word to the first one, which no window of 16 such ticks refuses
    wave = np.array([0, 1600, 3200, 4800, 4800, 4000, 3200, 2400])
    fine = np.floor(900 * np.sin(np.arange(64) / 64 * 2 * np.pi)).astype(np.int64)
    for words, ticks, max_step in (
        (wave, 640, 24),
        (wave[::-1], 640, 24),
        (np.roll(wave, 3), 640, 24),
        (fine, 20, 190),
    ):
        program = _resting(words.tolist(), ticks, [0] * 8, max_step=max_step)
        twin = Twin(libraries.narrow, program, (32768, 32768))
        twin.commit(program)
        twin.play(1)
        twin.ask("arm", "trigger")
        for many in (241, 700, 2000):
            twin.play(many, "fill")
    for library, max_step in product(libraries, (1, 2, 4, 7)):
        program = flat(30000, max_step=max_step)
        device = device_for(library, program)
        assert device.load(program) == LOADED
        for away in range(-max_step - 2, max_step + 3):
            position, code = (c_uint64(0), c_uint32(0)), c_int32(30000 + away)
            out = np.zeros(20 * library.stride, library.output)
            done = library.dll.probe_run(
                device.state, 0, *map(byref, position), byref(code), out.ctypes.data_as(c_void_p), c_uint32(16)
            )
            assert done == (16 if abs(away) <= max_step else 0), f"from {away} codes beside it, by {max_step}"


def gains_that_fit(libraries: Libraries) -> None:
    """Words of few bits have large gains: up to where one of 32 fraction bits fits, and behind it."""
    for bits, beside, sign in product((8, 11, 12, 13), (-1, 0, 1), (1, -1)):
        wave = wave_program(SequencerShape(16, 1, 6, bits, 1, 6, bits), 0)
        gain = sign * ((1 << wave.x.output.gain_q - 1) + beside)
        output = replace(wave.x.output, gain_word=gain, offset_word=32768 << wave.x.output.gain_q, code_min=0)
        output = replace(output, code_max=65535, park_code=32768, max_step=9000)
        axis = replace(wave.x, words=wave.x.words // 3, output=output)
        program = replace(wave, x=axis, y=replace(axis, words=np.roll(axis.words, 3)))
        twin = Twin(libraries.narrow, program, (32768, 32768))
        twin.commit(program)
        twin.play(1)
        twin.ask("arm", "trigger")
        twin.play(2 * wave.schedule.ticks, "fill")


def limits(libraries: Libraries) -> None:
    """A wave whose peaks are so many codes beyond the limits or short of them, in runs wherever there is room."""
    for library in libraries:
        shape = SequencerShape(16, 1, 7, 8 * library.word_bytes - 8, 1, 6, 8 * library.word_bytes - 8)
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
