"""A program that does not fit the registers of a device is refused at its commit, with a flag; and no other.

``dac_fit`` is held against the definition in Python, over words at both sides of every limit. In the whole sequencer a
line of 429 ticks stays out of a counter of 8 bits, and the program before it plays on.
"""

import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from building import BENCHES, tool
from programs import random_dual
from stream_scripts import play

from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS, SCAN_WORDS, program_words
from tablegen.device.widths import AxisWidths, Widths, least_widths, misfits
from tablegen.resources import verilog_runtime
from tablegen.verification.bench import SequencerBench, SequencerShape
from tablegen.verification.stream import PROGRAM, Script

FIT = [path for path in verilog_runtime() if path.name in ("dac_fit.v", "dac_fit_axis.v")]
WIDTHS = {
    "defaults": Widths(16, 24, 16, AxisWidths(True, 11, 16, 25), AxisWidths(True, 11, 16, 31)),
    "least": Widths(8, 3, 1, AxisWidths(True, 2, 8, 4), AxisWidths(True, 2, 8, 1), 1),
    "most": Widths(24, 30, 16, AxisWidths(True, 16, 24, 31), AxisWidths(False, 16, 24, 31), 512),
    "direct": Widths(12, 8, 5, AxisWidths(False, 6, 22, 9), AxisWidths(False, 2, 12, 7), 63),
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
    return found | {"HARMONICS": widths.harmonics}


def writes(seed: int) -> list[tuple[int, int]]:
    """Addresses and words: a program that fits everything, in any order, then words around every power of two."""
    rng = np.random.default_rng(seed)
    good = [0] * 48
    good[0], good[1] = 8, 1
    order = [int(at) for at in rng.permutation(48)]
    found = [(at, good[at]) for at in order]
    used = [*range(len(SCAN_WORDS)), *(page + at for page in (16, 32) for at in range(len(AXIS_WORDS)))]
    for at in [*used, *rng.permutation(used)]:
        bits = list(rng.permutation(33))[:12] if len(found) > 600 else range(33)
        edges = {max((1 << int(bit)) + d, 0) & 0xFFFFFFFF for bit in bits for d in (-1, 0, 1)}
        edges |= {-(1 << int(bit)) + d & 0xFFFFFFFF for bit in bits for d in (-1, 0)}
        found += [(int(at), word) for word in sorted(edges)] + [(int(at), good[at])]
    return found


@pytest.mark.parametrize("name", WIDTHS)
def test_what_fits_is_what_the_registers_hold(name: str, tmp_path: Path) -> None:
    """Every power of two and its neighbours in every word, and words never written."""
    widths, played = WIDTHS[name], writes(len(name))
    (tmp_path / "writes.hex").write_text("".join(f"{at:02x}{word:08x}\n" for at, word in played), "ascii")
    given = [f"-Pfit_bench.{key}={value}" for key, value in (parameters(widths) | {"DEPTH": len(played)}).items()]
    program = tmp_path / "fit.vvp"
    command = [tool("iverilog"), "-g2005", "-Wall", "-o", program, *given, BENCHES / "fit_bench.v", *FIT]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    printed = subprocess.run([tool("vvp"), "-n", program], capture_output=True, text=True, cwd=tmp_path, check=True)
    words: list[int | None] = [None] * 48
    expected = []
    for at, word in played:
        words[at] = word
        expected.append("01"[_fits(words, widths)])
    assert printed.stdout.split() == expected
    assert set(expected) == {"0", "1"}


def _fits(words: Sequence[int | None], widths: Widths) -> bool:
    """A word that was never written is wrong wherever one that is too large would be."""
    return not misfits([0xFFFFFFF0 ^ 0x5A5A5A50 if word is None else word for word in words], widths)


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
    """429 ticks in 8 bits would be 173. The commit is refused and flagged; written again, the program is taken."""
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
    script.request("commit", program=second)  # on the clock after the write
    script.wait_ticks(60)
    script.refused = True
    widths = {"TICK_BITS": 8, "LINE_BITS": 4, "PERIOD_BITS": 9, "LOW_AREA": low_area}
    run = SequencerBench("icarus", SHAPE, tmp_path, widths).play(script)
    assert run.equal, run
    assert script.swaps == 2


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
