"""A program that does not fit the registers of a device is refused at its commit, with a flag; and no other.

``dac_fit`` is held against the definition in Python, over words at both sides of every limit. In the whole sequencer a
line of 429 ticks stays out of a counter of 8 bits, and the program before it plays on.
"""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from building import BENCHES, tool
from programs import random_dual
from stream_scripts import crowded_windows, play

from tablegen.base.resources import verilog_runtime
from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS, SCAN_WORDS, program_words
from tablegen.device.widths import AxisWidths, Widths, cut_words, least_widths, misfits
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import PROGRAM, Script
from tablegen.verification.verilog.sequencer_bench import SequencerBench

FIT = [path for path in verilog_runtime() if path.name == "dac_fit.v"]
WIDTHS = {
    "defaults": Widths(16, 24, 16, AxisWidths(True, 11, 16, 25), AxisWidths(True, 11, 16, 31)),
    "least": Widths(8, 3, 1, AxisWidths(True, 2, 8, 4), AxisWidths(True, 2, 8, 1), 1),
    "most": Widths(24, 30, 16, AxisWidths(True, 16, 24, 31), AxisWidths(False, 16, 24, 31), 512),
    "direct": Widths(12, 8, 5, AxisWidths(False, 6, 22, 9), AxisWidths(False, 2, 12, 7), 63),
    **{
        name: Widths(16, 24, 16, AxisWidths(True, 11, 16, 25), AxisWidths(True, 11, 16, 31), shaping=order)
        for order, name in enumerate(("first", "second", "scanner"), 1)
    },
}


def parameters(widths: Widths) -> dict[str, int]:
    """As dac_fit has them."""
    found = {"DAC_BITS": widths.dac_bits, "TICK_BITS": widths.tick_bits, "LINE_BITS": widths.line_bits}
    for name, axis in (("X", widths.x), ("Y", widths.y)):
        found |= {
            f"{name}_INTERPOLATED": int(axis.interpolated),
            f"{name}_INDEX_BITS": axis.index_bits,
            f"{name}_WORD_BITS": axis.word_bits,
            f"{name}_PERIOD_BITS": axis.period_bits,
        }
    return found | {"HARMONICS": widths.harmonics, "SHAPING": widths.shaping}


DISCARD, WRITE = 1 << 7, 1 << 6


def entries(seed: int) -> list[tuple[int, int]]:
    """What comes in on each clock, and its word: words around every power of two, and what follows them."""
    rng = np.random.default_rng(seed)
    good = [0] * 48
    good[0], good[1] = 8, 1
    used = [*range(len(SCAN_WORDS)), *(page + at for page in (16, 32) for at in range(len(AXIS_WORDS)))]
    found = [(WRITE | at, good[at]) for at in reversed(used)]  # nothing fits before the first word is there
    for at in used:
        edges = {(1 << bit) + d & 0xFFFFFFFF for bit in range(33) for d in (-1, 0, 1)}
        edges |= {-(1 << bit) + d & 0xFFFFFFFF for bit in range(32) for d in (-1, 0, 1)}
        zeros = {order | zero << 8 for order in range(5) for zero in (0, 1, 64, 127, 128, 129, 192, 255)}
        for word in [*sorted(edges), 63, 64, 512, 513, *sorted(zeros)]:
            after = [(WRITE | at, good[at]), (int(rng.choice([0, WRITE | 14])), 0)][: int(rng.integers(3))]
            found += [(WRITE | at, word), *after, (DISCARD, 0), (0, 0), (WRITE | 0, 8)]
    found += [(DISCARD | WRITE | at, good[at]) for at in used]
    found += [(DISCARD | WRITE | 1, 0), (0, 0), (DISCARD, 0), (WRITE | 17, 0), (WRITE | 0, 7), (DISCARD, 0), (WRITE, 8)]
    return found


def law(played: list[tuple[int, int]], widths: Widths) -> list[bool]:
    """Whether the program could be committed, by clocks: the words as Python judges them, one at a time."""
    spoilt, empty, found = False, True, []
    good = [0] * 48
    good[0], good[1] = 8, 1
    for what, word in played:
        at, writes = what & 0x3F, bool(what & WRITE)
        spoils = writes and bool(cut_words([*good[:at], word, *good[at + 1 :]], widths))
        begins = writes and at == 0
        found.append(not spoilt and not spoils and (not empty or begins))
        empty = (empty or (bool(what & DISCARD) and spoilt)) and not begins
        spoilt = spoils or (spoilt and not what & DISCARD)
    return found


@pytest.mark.rest
@pytest.mark.parametrize("name", WIDTHS)
def test_what_fits_is_what_the_registers_hold(name: str, tmp_path: Path) -> None:
    """Every power of two and its neighbours in every word; what is spoilt stays so until it is discarded."""
    widths, played = WIDTHS[name], entries(len(name))
    (tmp_path / "writes.hex").write_text("".join(f"{what:02x}{word:08x}\n" for what, word in played), "ascii")
    given = [f"-Pfit_bench.{key}={value}" for key, value in (parameters(widths) | {"DEPTH": len(played)}).items()]
    program = tmp_path / "fit.vvp"
    command = [tool("iverilog"), "-g2005", "-Wall", "-o", program, *given, BENCHES / "fit_bench.v", *FIT]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    printed = subprocess.run([tool("vvp"), "-n", program], capture_output=True, text=True, cwd=tmp_path, check=True)
    expected = law(played, widths)
    assert [line == "1" for line in printed.stdout.split()] == expected
    assert set(expected) == {False, True}


SHAPE = SequencerShape(16, 1, 3, 16, 1, 2, 16)
COMMIT = (
    3 << 60 | 2 << 16
)  # a clock with a commit, as the bench reads it; of one that is refused the model knows nothing


def commit_refused(script: Script) -> None:
    script.wait(1)
    script.commands[-1] = COMMIT
    script.wait(1)  # it is decided on the next clock, on which nothing can be written


@pytest.mark.common
@pytest.mark.parametrize(("low_area", "pace"), [(0, 3), (1, 41)])
def test_a_line_that_is_too_long_is_refused_and_the_old_one_plays_on(low_area: int, pace: int, tmp_path: Path) -> None:
    """429 ticks in 8 bits would be 173. The commit is refused and flagged; discarded and written again it is taken."""
    rng = np.random.default_rng(429)
    first, second = (random_dual(rng, SHAPE, (20, 24), lines=(2, 3)) for _ in range(2))
    script = Script()
    script.tick_every(pace)
    commit_refused(script)  # nothing was written yet
    play(script, first)
    script.load(second)
    script.write(PROGRAM, [429])
    commit_refused(script)
    script.wait_ticks(30)
    script.write(PROGRAM, [second.schedule.ticks])
    commit_refused(script)  # which of its words is to be trusted?
    script.request("withdraw")
    commit_refused(script)
    script.load(second)
    script.request("commit", program=second)
    script.wait_ticks(60)
    script.refused = True
    widths = {"TICK_BITS": 8, "LINE_BITS": 4, "PERIOD_BITS": 9, "LOW_AREA": low_area}
    run = SequencerBench("icarus", SHAPE, tmp_path, widths).play(script)
    assert run.equal, run
    assert script.swaps == 2


@pytest.mark.common
def test_a_window_has_a_tick_for_each_pixel(tmp_path: Path) -> None:
    """Or none: pixels and ticks about the edge, committed with the last word that was written or soon after."""
    rng = np.random.default_rng(30)
    program = random_dual(rng, SHAPE, (20, 24), lines=(2, 3))
    script = Script()
    crowded_windows(rng, script, program, (2 << 8) - 1, 400)
    script.tick_every(3)
    play(script, random_dual(rng, SHAPE, (20, 24), kind="tame", lines=(2, 3)))
    script.wait_ticks(60)
    widths = {"TICK_BITS": 8, "LINE_BITS": 4, "PERIOD_BITS": 9}
    run = SequencerBench("icarus", SHAPE, tmp_path, widths).play(script)
    assert run.equal, run
    verdicts = [state.flags[2] for _, state in script.states]
    assert 100 < sum(verdicts) < 300


def test_misfits_are_words_that_are_cut_and_pixels_without_ticks() -> None:
    """The pixels are named once, and only where a window has ticks."""
    widths = WIDTHS["defaults"]
    words = [0] * 48
    words[0] = words[1] = 8
    pixels, forward, backward = (SCAN_WORDS.index(name) for name in ("pixels", "forward_count", "backward_count"))
    words[pixels] = 5
    for ticks, names in (((0, 0), []), ((5, 0), []), ((5, 4), ["scan.pixels"]), ((4, 5), ["scan.pixels"])):
        words[forward], words[backward] = ticks
        assert misfits(words, widths) == names
        assert cut_words(words, widths) == []
    words[pixels] = 1 << 25
    assert misfits(words, widths) == cut_words(words, widths) == ["scan.pixels"]


@pytest.mark.parametrize("seed", range(4))
def test_the_least_widths_are_the_least(seed: int) -> None:
    """A program fits them, and one bit less of any it does not."""
    rng = np.random.default_rng(seed)
    program = random_dual(rng, SHAPE, (9, 40), lines=(2, 9))
    words = program_words(program.schedule, program.x, program.y)
    least = least_widths(program.schedule, program.y)

    def of(tick_bits: int, line_bits: int, period_bits: int) -> Widths:
        x, y = AxisWidths(True, 3, 16, tick_bits + 1), AxisWidths(True, 2, 16, period_bits)
        return Widths(16, tick_bits, line_bits, x, y)

    bits = list(least.values())
    assert misfits(words, of(*bits)) == []
    for index, name in enumerate(("scan.line_ticks", "scan.frame_lines", "y.phase_period")):
        assert name in misfits(words, of(*(each - (at == index) for at, each in enumerate(bits))))


def test_every_word_is_held_to_its_limit() -> None:
    """No name of a word is without one but the phase step, which fits 32 bits as it is."""
    wide = misfits([0xFFF5FFF0] * 3 * PAGE_WORDS, WIDTHS["least"])
    named = [f"scan.{name}" for name in SCAN_WORDS] + [f"{axis}.{name}" for axis in "xy" for name in AXIS_WORDS]
    assert [name for name in named if name not in wide] == ["x.phase_step", "y.phase_step"]
