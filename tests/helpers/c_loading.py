"""Which programs the C sequencer takes, and why it refuses others; checks of ``c_checks``."""

from collections.abc import Iterator
from ctypes import addressof, byref, c_int32

import numpy as np
from c_devices import Libraries, device_for, flat
from c_library import (
    BAD_OUTPUT,
    BAD_PERIOD,
    BAD_SCHEDULE,
    BAD_TABLE,
    LOADED,
    OTHER_CONVERTER,
    OTHER_STORAGE,
    Converter,
    CProgram,
    Device,
    Window,
)
from programs import pixels_near_ticks
from replacing import replace

from tablegen.device.schedule import Window as Lines
from tablegen.device.schedule import has_ticks_for_pixels


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
        ("table", None), ("bits", 7), ("index_bits", 2), ("index_bits", 17),
        ("index_bits", 0),
        ("length", length - 1), ("length", length + 1), ("length", 0),
    ))  # fmt: skip
    yield from ((OTHER_STORAGE, f"{axis}.{key}", value) for key, value in (
        ("bits", 17), ("bits", 25), ("storage_bits", 0), ("storage_bits", 8), ("storage_bits", 32),
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
            ("frame_lines", 1 << 31), ("frame_lines", (1 << 32) - 1), ("turn_tick", 33), ("pixels", 9),
            *((side, Window(*window)) for side, window in (
                ("forward", (33, 0)), ("forward", (0, 33)), ("forward", (31, 2)), ("forward", (2**32 - 1, 2)),
                ("backward", (33, 0)), ("backward", (1, 32)), ("up", (3, 0)), ("up", (1, 2)), ("down", (2, 1)),
                ("down", (0, 3)), ("forward", (0, 3)), ("backward", (16, 3)),
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
            ("turn_tick", 32), ("turn_tick", 0), ("pixels", 8), ("pixels", 0), ("settle_lines", (1 << 32) - 1),
            ("forward", Window(32, 0)), ("forward", Window(0, 32)), ("forward", Window(28, 4)),
            ("backward", Window(28, 4)), ("backward", Window(0, 0)), ("down", Window(0, 2)),
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


def crowded_windows(libraries: Libraries) -> None:
    """Programs have a tick in each window for each pixel, or no tick; in short lines and in the longest."""
    device = device_for(libraries.narrow, flat(1))
    rng = np.random.default_rng(30)
    for ticks in (32, 1 << 24):
        program, axes = libraries.narrow.program(flat(1))
        program.schedule.line_ticks = program.x.phase_period = ticks
        program.y.phase_period = 2 * ticks
        for pixels, forward, backward in pixels_near_ticks(rng, ticks, 400):
            program.schedule.pixels = pixels
            program.schedule.forward = Window(ticks - forward, forward)
            program.schedule.backward = Window(0, backward)
            fits = has_ticks_for_pixels(pixels, forward, backward)
            assert device.load(program) == (LOADED if fits else BAD_SCHEDULE), (pixels, forward, backward)
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
    blank = (c_int32 * ((1 << 17) + 2))()
    device.alive.append(blank)
    for interpolated, index_bits, bits, length, result in (
        (1, 16, 24, 65536, LOADED), (1, 16, 25, 65536, BAD_TABLE), (1, 3, 8, 8, LOADED),
        (1, 17, 24, 131072, BAD_TABLE), (1, 2, 24, 4, BAD_TABLE),
        (0, 0, 24, 131072, LOADED), (0, 0, 24, 131073, BAD_TABLE),
        (0, 0, 24, 1, LOADED),
    ):  # fmt: skip
        ticks = 32 if interpolated else length
        program, axes = library.program(flat(1, replace(flat(1).schedule, ticks=ticks, lines=1, pixels=1, **none)))
        program.x.index_bits, program.x.length, program.x.bits = index_bits, length, bits
        program.x.table = addressof(blank)
        program.x.gain_q = 16 + bits + min(4, 25 - bits) - 16
        program.x.offset_word = 0
        assert device.load(program) == result, (interpolated, index_bits, bits, length)
        device.alive.append(axes)


def the_first_word_again(libraries: Libraries) -> None:
    """A table is refused without the word that runs and steps read behind the last one."""
    for library in libraries:
        device = device_for(library, flat(1))
        for axis in (0, 1):
            for last, result in ((1, BAD_TABLE), (-1, BAD_TABLE), (0, LOADED)):
                program, axes = library.program(flat(1))
                axes[axis].words[len(axes[axis].words) - 1] = axes[axis].words[0] + last
                assert device.load(program) == result, (axis, last)
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


def converters_that_do_not_fit(libraries: Libraries) -> None:
    """Those that the runtime cannot serve are refused at the start, on either axis, and then no program is loaded."""
    for library in libraries:
        most = 8 * library.output_bytes
        good = Converter(16, 16, False, False, 0)
        refused = [
            (7, 16, 0), (25, 32, 0), (0, 0, 0), (16, 15, 0), (16, most + 1, 0), (16, 16, -1), (16, 16, 1 << 16),
            (8, 16, 256),
        ]  # fmt: skip
        accepted = [(16, 16, 65535), (8, 16, 255), (8, 8, 0), (12, most, 4095), (min(most, 24), most, 0)]
        for bits, word_bits, code in (*refused, *accepted):
            other = Converter(bits, word_bits, True, True, code)
            for pair in ((other, good), (good, other)):
                device = Device(library, good, good)
                result = library.dll.dac_sequencer_init(device.state, *map(byref, pair))
                assert result == ((bits, word_bits, code) in accepted), (bits, word_bits, code)
                if not result:
                    assert device.load(flat(1)) == OTHER_CONVERTER
                    program, axes = library.program(flat(1))
                    refused_axis = program.x if pair[0] is other else program.y
                    refused_axis.dac_bits = refused_axis.word_bits = 0
                    assert device.load(program) == OTHER_CONVERTER, "a program for no converter"
                    device.alive.append(axes)
                    assert device.steps(3)[0].tolist() == [0, 0, 0]


def requests_that_do_not_fit(libraries: Libraries) -> None:
    """More frames than a count holds are refused; of a reported fault only the bits that there are become one."""
    device = device_for(libraries.narrow, flat(1))
    assert [device.arm(frames) for frames in (1 << 31, (1 << 31) + 1, (1 << 32) - 1)] == [True, False, False]
    device.report(0xF4)
    device.steps(1)
    assert device.status().faults == 4


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
