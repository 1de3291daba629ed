"""The model plays undisturbed ticks of a line at once, as `step` plays them one by one."""

from collections import Counter

import numpy as np
import pytest
from programs import Kind, random_dual
from stream_scripts import clamped, occurrences

from tablegen.device.sequencer import LineTicks, Sequencer
from tablegen.numerics.arrays import Ints
from tablegen.verification.bench import SequencerShape
from tablegen.verification.stream import Script, StoredState

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


def one_by_one(sequencer: Sequencer, most: int) -> LineTicks | None:
    return None


@pytest.mark.parametrize("shape", SHAPES, ids=["interpolated", "direct"])
def test_it_is_what_single_steps_make(shape: SequencerShape, monkeypatch: pytest.MonkeyPatch) -> None:
    lengths, seen, at_once = [0], Counter[str](), Sequencer.undisturbed

    def counted(sequencer: Sequencer, most: int) -> LineTicks | None:
        ticks = at_once(sequencer, most)
        lengths.append(0 if ticks is None else len(ticks.x))
        assert lengths[-1] <= most
        return ticks

    for seed in range(3):
        monkeypatch.setattr(Sequencer, "undisturbed", counted)
        many = played(shape, seed)
        monkeypatch.setattr(Sequencer, "undisturbed", one_by_one)
        assert many == played(shape, seed)
        seen += occurrences(np.array(many[0], dtype=np.uint64))
    assert sum(lengths) > 1000
    assert max(lengths) > 90
    assert all(seen[name] for name in ("slew", "clamp", "underrun", "swapped", "valid"))


def test_a_disturbance_that_is_overlooked_makes_a_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    """The negative control of the above: it would see it."""
    monkeypatch.setattr(Sequencer, "undisturbed", one_by_one)
    right = played(SHAPES[0], 0)
    monkeypatch.undo()

    def none(*_: object) -> Ints:
        return np.zeros(0, dtype=np.int64)

    monkeypatch.setattr(Sequencer, "_where_disturbed", none)
    assert played(SHAPES[0], 0) != right
