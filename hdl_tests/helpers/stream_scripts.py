"""Scripts for the sequencer under its bench: all that a host may ask of it, at any time, and what it must refuse."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from programs import Kind, pixels_near_ticks, random_dual, random_fourier, rendered, shaped, with_table
from replacing import replace

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import DualProgram
from tablegen.device.registers import PAGE_WORDS, SCAN_WORDS, program_words
from tablegen.device.schedule import Window, has_ticks_for_pixels
from tablegen.fixedpoint.synthesis import FourierWords
from tablegen.verification.play.placement import Placement
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import FLAGS, PROGRAM, X_FOURIER, X_TABLE, Y_FOURIER, Y_TABLE, Script, Words

FAULTS = ("slew", "clamp", "overrun", "underrun")
_KINDS: tuple[Kind, ...] = ("wild", "tame", "smooth", "held")


def flag(capture: Words, name: str) -> np.ndarray:
    """One marker, or fault, of every tick of a capture."""
    bit = 48 + FLAGS.index(name) if name in FLAGS else 56 + FAULTS.index(name)
    return (capture >> np.uint64(bit) & np.uint64(1)).astype(bool)


def codes(capture: Words, axis: str) -> np.ndarray:
    """The codes of an axis of a capture, int64."""
    return (capture >> np.uint64(0 if axis == "x" else 24) & np.uint64(0xFFFFFF)).astype(np.int64)


def occurrences(capture: Words) -> Counter[str]:
    """On how many ticks each marker and each fault was high."""
    return Counter({name: int(np.sum(flag(capture, name))) for name in (*FLAGS, *FAULTS)})


def play(script: Script, program: DualProgram, frames: int = 0) -> None:
    """Upload a program and start it."""
    script.load(program)
    script.request("commit", program=program)
    script.wait_ticks(4)
    script.request("arm", "trigger", frames=frames)


def some_program(rng: Generator, shape: SequencerShape, ticks: tuple[int, int], lines: tuple[int, int]) -> DualProgram:
    """A random program of a random kind."""
    return random_dual(rng, shape, ticks, kind=_KINDS[int(rng.integers(len(_KINDS)))], lines=lines)


def imaging_program(rng: Generator, shape: SequencerShape, kind: Kind) -> DualProgram:
    """A short one that images both ways, on the two middle lines of its four, after two lines to settle in."""
    while True:
        program = random_dual(rng, shape, (11, 16), kind=kind, lines=(4, 4))
        schedule = program.schedule
        if schedule.forward.count > schedule.pixels > 1 and schedule.backward.count > 1:
            lines = {"settle_lines": 2, "up": Window(1, 1), "turn_line": 2, "down": Window(2, 1)}
            return replace(program, schedule=replace(schedule, **lines))


def clamped(program: DualProgram) -> DualProgram:
    """A tame one whose x is held at both limits, a quarter of a line each; it turns at once, and images one way."""
    unclamped = program.x.codes(np.arange(program.schedule.ticks))
    low, high = (int(np.quantile(unclamped, share)) for share in (0.25, 0.75))
    output = replace(program.x.output, code_min=low, code_max=high, park_code=low)
    schedule = replace(program.schedule, turn_tick=0, backward=Window(5, 0))
    return replace(program, x=replace(program.x, output=output), schedule=schedule)


def within_limits(program: DualProgram) -> DualProgram:
    """A tame one whose limits of x are the codes that it reaches: neither of them clamps."""
    codes = program.x.codes(np.arange(program.schedule.ticks))
    output = replace(program.x.output, code_min=int(codes.min()), code_max=int(codes.max()))
    return replace(program, x=replace(program.x, output=output))


def random_requests(rng: Generator, script: Script) -> None:
    """A clock with requests, several of them now and then."""
    names = {str(rng.choice(["arm", "trigger", "park", "clear_faults"]))}
    if rng.random() < 0.5:
        names |= {"arm", "trigger"}
    if rng.random() < 0.15:
        names.add(str(rng.choice(["park", "reset", "withdraw", "clear_faults"])))
    script.request(*names, frames=int(rng.integers(0, 4)))


def _change_pace(rng: Generator, script: Script, paces: Sequence[int]) -> int:
    """Stop the ticks and go on at another pace; no two ticks are closer than the shortest."""
    script.tick_every(0)
    script.wait(min(paces) + int(rng.choice([0, int(rng.integers(1, 80))])))
    pace = int(rng.choice(paces))
    script.tick_every(pace)
    return pace


def random_play(
    rng: Generator,
    script: Script,
    shape: SequencerShape,
    samples: int,
    paces: Sequence[int] = (1,),
    ticks: tuple[int, int] = (8, 40),
    lines: tuple[int, int] = (1, 5),
    shaping: int = 0,
    pixels: bool = False,
) -> None:
    """Programs back to back, requests at any tick, ticks at all paces that stop and go on; until so many samples.

    Those of a device that shapes have orders up to ``shaping``; with ``pixels`` most have a table of pixels.
    """
    pace = _change_pace(rng, script, paces)
    while len(script.expected) < samples:
        if rng.random() < 0.2:
            pace = _change_pace(rng, script, paces)
        if script.waiting and rng.random() < 0.3:
            script.request("withdraw")
        if not script.waiting:
            program = some_program(rng, shape, ticks, lines)
            if shaping:
                program = shaped(rng, program, shaping)
            if pixels and rng.random() < 0.7:
                program = replace(program, schedule=with_table(rng, program.schedule))
            script.load(program)
            names = {"commit"} | ({"arm", "trigger"} if rng.random() < 0.4 else set())
            script.request(*names, program=program, frames=int(rng.integers(0, 3)))
        for _ in range(int(rng.integers(0, 4))):
            script.wait(int(rng.integers(0, 2 * ticks[1])) * pace)
            random_requests(rng, script)
        script.wait(int(rng.integers(0, 3 * ticks[1])) * pace + int(rng.integers(0, pace)))


def rendering_clocks(shape: SequencerShape, x: FourierWords | None, y: FourierWords | None, multiplier: int) -> int:
    """From a commit to the committed bank."""
    return Placement("blocks" if multiplier else "pipelined", fourier=True).commit_clocks(
        (1 << shape.x_index_bits, x.harmonics if x else 0), (1 << shape.y_index_bits, y.harmonics if y else 0)
    )


def random_renderings(
    rng: Generator, script: Script, shape: SequencerShape, programs: int, harmonics: int, multiplier: int
) -> None:
    """Programs whose tables are rendered while another one plays; some are called off, or written to meanwhile."""
    script.tick_every(1)
    for number in range(programs):
        program = random_dual(rng, shape, kind=_KINDS[int(rng.integers(2))])
        x, y = (
            random_fourier(rng, int(rng.integers(1, harmonics + 1))) if rng.random() < 0.8 else None for _ in range(2)
        )
        program = replace(
            program,
            x=rendered(program.x, x) if x else program.x,
            y=rendered(program.y, y) if y else program.y,
        )
        clocks = rendering_clocks(shape, x, y, multiplier)
        script.load(program, x, y)
        script.request("commit", program=program, commit_clocks=clocks)
        if number % 5 == 1:
            script.wait(int(rng.integers(clocks)))
            script.request(str(rng.choice(["withdraw", "reset"])))
            script.request("arm", "trigger")
            continue
        if number % 5 == 2 and clocks > 20:
            for region in (PROGRAM, X_FOURIER, Y_FOURIER):
                script.write_refused(region, [0x15555555] * 4)
            script.request("clear_faults")
        script.wait(clocks + int(rng.integers(40, 100)))
        script.request("arm", "trigger", "clear_faults")
    script.wait_ticks(200)


def first_program(script: Script, program: DualProgram, pace: int) -> None:
    """Triggered before the first tick that could take it: withdrawn, withdrawn at once, and at last taken."""

    def ticks(count: int) -> None:
        script.tick_every(pace)
        script.wait_ticks(count)
        script.come_to_rest()

    def commit() -> None:
        script.request("commit", program=program)
        script.wait(script.commit_clocks + 1)

    script.come_to_rest()
    script.request("park")
    script.load(program)
    commit()
    script.request("arm", "trigger")
    script.wait(2)
    script.request("withdraw")
    ticks(3)
    commit()
    script.request("arm", "trigger", "withdraw")  # it stays armed
    ticks(3)
    commit()
    script.request("trigger")
    script.wait(2)
    script.tick_every(pace)
    script.request("withdraw")  # too late: on the clock of the tick that takes it
    script.wait_ticks(2 * program.schedule.ticks + 3)
    script.request("park")
    script.wait_ticks(3)


def swaps_at_every_tick(script: Script, programs: tuple[DualProgram, DualProgram]) -> None:
    """While a program plays without end, commit the other one at each tick of its line in turn."""
    script.request("park")
    play(script, programs[0])
    now, other = programs
    for tick in range(max(program.schedule.ticks for program in programs)):
        script.load(other)
        length = now.schedule.ticks
        script.wait_ticks((tick - script.model.tick) % length)
        script.request("commit", program=other)
        script.wait_ticks(length + other.schedule.ticks)
        now, other = other, now


def modes(rng: Generator, script: Script, shape: SequencerShape) -> None:
    """Commits of every mode at all places of a frame, of programs of the same frame and of some others."""
    frames = [((9, 9), (4, 4))] * 9 + [((10, 10), (4, 4)), ((9, 9), (5, 5)), ((12, 12), (3, 3))]
    for number in range(120):
        ticks, lines = frames[int(rng.integers(len(frames)))]
        program = random_dual(rng, shape, ticks, kind="tame", lines=lines)
        while number % 5 and program.y.hold != 1:
            program = random_dual(rng, shape, ticks, kind="tame", lines=lines)
        first = int(rng.integers(3))
        images = Window(first, 3 - first if first else 2)
        schedule = replace(program.schedule, settle_lines=number % 5 // 4, up=images, turn_line=3, down=Window(0, 0))
        schedule = replace(schedule, up=Window(0, 0), down=images) if rng.random() < 0.5 else schedule
        program = replace(program, schedule=schedule)
        script.load(program)
        script.request("commit", program=program, mode=CommitMode(int(rng.choice([0, 1, 1, 1, 1, 2]))))
        script.wait(2)
        if not script.model.running or number % 20 == 7:
            script.request("park")
            script.request("arm", "trigger")
        script.wait_ticks(int(rng.integers(30, 60)))


def counted_frames(script: Script, program: DualProgram) -> None:
    """One frame, two frames, and arming for another number while they play."""
    script.load(program)
    script.request("commit", program=program)
    frame = program.schedule.frame_ticks
    script.request("trigger")  # nobody armed
    script.wait_ticks(5)
    script.request("arm", frames=1)
    script.wait_ticks(3)
    script.request("trigger")
    script.wait_ticks(frame + 20)
    script.request("trigger")  # nobody armed it again
    script.wait_ticks(10)
    script.request("arm", "trigger", frames=2)
    script.wait_ticks(frame // 2)
    script.request("arm", frames=3)  # for the next scan
    script.request("trigger")
    script.wait_ticks(2 * frame)
    script.request("trigger")
    script.wait_ticks(frame + 1)
    script.request("arm")
    script.request("park")
    script.wait_ticks(20)
    script.request("trigger")  # park has disarmed
    script.wait_ticks(5)
    script.request("arm", "trigger", "park")  # park has the last word
    script.wait_ticks(5)


def withdrawals(script: Script, playing: DualProgram, other: DualProgram) -> None:
    """A program that waits is withdrawn, emptied by a reset, and at last taken."""
    script.request("park")
    play(script, playing)
    for request in ("withdraw", "reset"):
        script.load(other)
        script.wait_ticks((2 - script.model.tick) % playing.schedule.ticks)
        script.request("commit", program=other)
        script.wait_ticks(2)
        script.request(request)
        script.wait_ticks(2 * playing.schedule.ticks)
        script.request("arm", "trigger")
    script.load(other)
    script.request("commit", "withdraw", program=other)
    script.wait_ticks(2 * playing.schedule.ticks)
    script.request("commit", program=other)
    script.wait_ticks(2 * playing.schedule.ticks + 5)


def refusals(script: Script, playing: DualProgram, other: DualProgram) -> None:
    """Writes while a program waits, and just after it was taken, when the last one is still on its way out."""
    nonsense = 0x15555555
    script.request("park")
    play(script, playing)
    script.load(other)
    ticks = playing.schedule.ticks
    script.wait_ticks((2 - script.model.tick) % ticks)
    script.request("commit", program=other)
    script.write_refused(X_TABLE, [0])
    script.write_refused(Y_TABLE, [0])
    script.wait_ticks((-script.model.tick - 1) % ticks)
    # What the first samples of the new program meet late in the pipeline.
    for first, words in ((PAGE_WORDS + 3, 8), (2 * PAGE_WORDS + 3, 8), (PAGE_WORDS + 6, 2)):
        script.write_refused(PROGRAM, [nonsense] * words, first)
    script.wait_ticks(2 * other.schedule.frame_ticks)
    script.load(playing)
    script.request("commit", program=playing)
    script.wait_ticks(other.schedule.ticks + 4 * ticks)


def crowded_windows(rng: Generator, script: Script, program: DualProgram, most: int, cases: int) -> None:
    """Commit about as many pixels as a window has ticks, on the clock of the last word or soon after; at rest.

    Words are written in any order, and those that stay are not written again: what was refused needs no withdrawal.
    """
    script.come_to_rest()
    script.load(program)
    addresses = [SCAN_WORDS.index(name) for name in ("pixels", "forward_count", "backward_count")]
    written = [-1, -1, -1]
    for case, words in enumerate(pixels_near_ticks(rng, most, cases)):
        changes = [at for at in rng.permutation(3).tolist() if written[at] != words[at]] or [case % 3]
        written, fits = list(words), has_ticks_for_pixels(*words)
        for at in changes[:-1]:
            script.write(PROGRAM, [words[at]], addresses[at])
        if case % 4 == 0:
            script.write_unfit(addresses[changes[-1]], words[changes[-1]], at_once=True)
        else:
            script.write(PROGRAM, [words[changes[-1]]], addresses[changes[-1]])
            script.wait(case % 4 - 1)
            script.commit_unfit()
        script.wait(6)
        if fits:
            script.refused = False
            script.model.commit(program)  # no tick takes it
        script.state(f"{words[0]} pixels in {words[1]} and {words[2]} ticks", rests=True)
        script.request("withdraw", *(["clear_faults"] if case % 3 == 0 or not fits else []))


def in_any_order(rng: Generator, script: Script, program: DualProgram, other: DualProgram) -> None:
    """Every word of a program by itself, in a random order, each of them written twice: first another one.

    The registers get those of ``other`` first, since a word that does not fit would spoil the program.
    """
    script.wait_writable()
    assert script.writable
    regions = {
        PROGRAM: program_words(program.schedule, program.x, program.y),
        X_TABLE: [int(word) for word in program.x.words],
        Y_TABLE: [int(word) for word in program.y.words],
    }
    before = {region: [~word for word in words] for region, words in regions.items()}
    before[PROGRAM] = program_words(other.schedule, other.x, other.y)
    places = [(region, address) for region, words in regions.items() for address in range(len(words))]
    for written in (before, regions):
        for place in rng.permutation(len(places)):
            region, address = places[place]
            script.write(region, [written[region][address]], address)


def clears_at_every_tick(script: Script, program: DualProgram) -> None:
    """Forget the faults of a program at each tick of its line in turn."""
    script.request("park")
    play(script, program)
    for _ in range(program.schedule.ticks):
        script.request("clear_faults")
        script.wait_ticks(program.schedule.ticks)


def counts_after_a_clear(script: Script, tame: DualProgram) -> None:
    """End with faults that are counted, the first on the very tick with which they are cleared."""
    program = clamped(tame)
    script.request("withdraw", "park")
    play(script, program)
    lowest = int(np.argmin(tame.x.codes(np.arange(tame.schedule.ticks))))
    script.wait_ticks((lowest - 1 - script.model.tick) % program.schedule.ticks)
    script.request("clear_faults")
    script.wait_ticks(3 * program.schedule.ticks)


def parks_at_every_tick(script: Script, program: DualProgram) -> None:
    """Park, reset, and start again, at each tick of a line in turn, mostly before the codes are where they park."""
    script.request("park")
    play(script, program)
    for tick in range(program.schedule.ticks):
        script.wait_ticks(tick + 1)
        script.request("reset" if tick % 3 == 2 else "park")
        script.wait_ticks(tick % 5)
        script.request("arm", "trigger", frames=tick % 3)
        script.wait_ticks(program.schedule.ticks // 2)


def sweep(
    rng: Generator, shape: SequencerShape, samples: int, pace: int = 1, commit_clocks: int = 1, refused: bool = False
) -> Script:
    """Some of everything, with ticks all along; whether it ends with refused writes."""
    script = Script(commit_clocks=commit_clocks)
    script.tick_every(pace)
    script.wait(5)
    wild, tame, smooth, held = (imaging_program(rng, shape, kind) for kind in _KINDS)
    # These image from their first line on: one while it catches up, the other, stopped in mid-line, once it is parked.
    smooth, prompt = (
        replace(program, schedule=replace(program.schedule, settle_lines=0, up=Window(0, 1)))
        for program in (smooth, tame)
    )
    script.request("arm", "trigger")  # with nothing to play
    script.wait(3)
    first_program(script, smooth, pace)
    counted_frames(script, tame)
    swaps_at_every_tick(script, (smooth, tame))
    withdrawals(script, smooth, clamped(tame))
    refusals(script, smooth, tame)
    clears_at_every_tick(script, wild)
    clears_at_every_tick(script, held)
    clears_at_every_tick(script, clamped(tame))
    parks_at_every_tick(script, smooth)
    parks_at_every_tick(script, prompt)
    random_play(rng, script, shape, len(script.expected) + samples, (pace,))
    if refused:
        script.request("withdraw", "clear_faults")
        crowded_windows(rng, script, tame, (2 << 24) - 1, 60)
        script.tick_every(pace)
        refusals(script, smooth, tame)
    else:
        counts_after_a_clear(script, tame)
    return script
