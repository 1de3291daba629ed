"""The model plays many ticks of a line at once, as `step` plays them one by one."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from programs import Kind, random_dual
from stream_scripts import clamped, occurrences

from tablegen.device import sequencer as sequencer_module
from tablegen.device.played_lines import LineTicks
from tablegen.device.sequencer import Sequencer
from tablegen.device.slew import limit_slew
from tablegen.numerics.arrays import Ints
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script, StoredState

KINDS: tuple[Kind, ...] = ("tame", "wild", "smooth", "held")
SHAPES = [SequencerShape(16, 1, 4, 16, 1, 3, 16), SequencerShape(8, 0, 8, 12, 1, 3, 16)]


def played(shape: SequencerShape, seed: int) -> tuple[list[int], list[tuple[str, StoredState]]]:
    """What the model makes of programs of all kinds, with swaps, faults, parks in mid-line, and ticks at two paces."""
    script, rng = Script(), np.random.default_rng(seed)
    for kind in KINDS:
        program = random_dual(rng, shape, (100, 150), kind=kind, lines=(2, 4))
        for one in (program, clamped(program)):
            script.load(one)
            script.request("commit", program=one)
            script.tick_every(int(rng.choice([1, 5])))
            for _ in range(2):
                script.wait_ticks(int(rng.integers(400, 900)))
                script.request("arm", "trigger", frames=int(rng.integers(3)))
                script.wait_ticks(int(rng.integers(400, 900)))
                script.request(str(rng.choice(["park", "clear_faults"])))
            script.state(kind)
            script.request("underrun")
    return script.expected, script.states


def one_by_one(sequencer: Sequencer, most: int) -> tuple[LineTicks, Ints] | None:
    return None


@pytest.mark.common
@pytest.mark.parametrize("shape", SHAPES, ids=["interpolated", "direct"])
def test_it_is_what_single_steps_make(shape: SequencerShape, monkeypatch: pytest.MonkeyPatch) -> None:
    lengths, seen, at_once = [0], Counter[str](), Sequencer.ahead

    def counted(sequencer: Sequencer, most: int) -> tuple[LineTicks, Ints] | None:
        ticks = at_once(sequencer, most)
        lengths.append(0 if ticks is None else len(ticks[0].x))
        assert lengths[-1] <= most
        return ticks

    for seed in range(3):
        monkeypatch.setattr(Sequencer, "ahead", counted)
        many = played(shape, seed)
        monkeypatch.setattr(Sequencer, "ahead", one_by_one)
        assert many == played(shape, seed)
        seen += occurrences(np.array(many[0], dtype=np.uint64))
    assert sum(lengths) > 1000
    assert max(lengths) > 90
    assert all(seen[name] for name in ("slew", "clamp", "underrun", "swapped", "valid"))


def test_a_guard_that_is_overlooked_makes_a_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    """The negative control of the above: it would see it."""
    monkeypatch.setattr(Sequencer, "ahead", one_by_one)
    right = played(SHAPES[0], 0)
    monkeypatch.undo()

    def unguarded(targets: Ints, code: int, step: int) -> Ints:
        return targets

    monkeypatch.setattr(sequencer_module, "limit_slew", unguarded)
    assert played(SHAPES[0], 0) != right


@pytest.mark.common
@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.tuples(st.integers(-400, 400), st.integers(1, 120)), min_size=1, max_size=12),
    st.integers(-400, 400),
    st.integers(1, 60),
    st.integers(-20, 20),
)
def test_the_guard_is_that_of_single_ticks(levels: list[tuple[int, int]], code: int, step: int, slope: int) -> None:
    """Targets that jump, and rise or fall between, at steps below the guard, at it and above it."""
    targets = np.concatenate([level + slope * np.arange(count) for level, count in levels])
    wanted, now = [], code
    for target in targets.tolist():
        now += min(max(target - now, -step), step)
        wanted.append(now)
    assert limit_slew(targets, code, step).tolist() == wanted
