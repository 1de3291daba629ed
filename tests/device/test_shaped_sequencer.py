"""The sequencer with shaped output against a loop of plain integers: remainders run on, and begin at 0."""

import numpy as np
import pytest
from replacing import replace
from test_sequencer import SMALL, run, started
from variants import plan_of

from tablegen.device.dual_program import DualProgram
from tablegen.device.played_lines import PlayedLines, play_line
from tablegen.device.sequencer import Fault, Sequencer
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.runs import runs_of
from tablegen.fixedpoint.shaping import Shaping

PAIRS = [(Shaping(1), Shaping()), (Shaping(2), Shaping(1)), (Shaping(3, 100), Shaping(3, 128))]


def shaped(program: DualProgram, x: Shaping, y: Shaping) -> DualProgram:
    def with_room(one: Program, shaping: Shaping) -> Program:
        output = replace(one.output, shaping=shaping, max_step=one.output.max_step + shaping.step_excess)
        return replace(one, output=output)

    return replace(program, x=with_room(program.x, x), y=with_room(program.y, y))


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> DualProgram:
    return plan_of(tmp_path_factory.mktemp("shaped"), SMALL, {"x.resonance.frequency_hz": "400e3"}).program


def codes_of(program: Program, ticks: int) -> list[int]:
    """Codes since the beginning, each sample and each remainder by itself."""
    output, (e1, e2, e3) = program.output, (0, 0, 0)
    r = 28 - output.dac_bits
    codes = []
    for tick in range(ticks):
        s = int(program.samples(np.array([tick % program.ticks]))[0])
        u = (output.gain_word * s + output.offset_word + 2 ** (output.gain_q - 1)) >> (output.gain_q - r)
        zero = output.shaping.zero
        w = u + (0, e1, 2 * e1 - e2, e1 - e2 + e3 + (zero * (e1 - e2) >> 6))[output.shaping.order]
        codes.append(min(max(w >> r, output.code_min), output.code_max))
        e1, e2, e3 = (w & (2**r - 1)) - 2 ** (r - 1), e1, e2
    return codes


@pytest.mark.parametrize("pair", PAIRS)
def test_remainders_run_on_over_lines_and_frames(program: DualProgram, pair: tuple[Shaping, Shaping]) -> None:
    both = shaped(program, *pair)
    ticks = 2 * both.schedule.frame_ticks + both.schedule.ticks // 2
    played = run(started(both), ticks)
    caught_up = both.schedule.frame_ticks // 2
    assert [t.x for t in played][caught_up:] == codes_of(both.x, ticks)[caught_up:]
    assert [t.y for t in played][caught_up:] == codes_of(both.y, ticks)[caught_up:]
    assert played[-1].faults is Fault.NONE
    assert both.x.played(100, ticks).tolist() == codes_of(both.x, ticks)[100:]


def test_a_trigger_and_a_swap_begin_with_no_remainder(program: DualProgram) -> None:
    both = shaped(program, *PAIRS[2])
    ticks = both.schedule.frame_ticks
    first = run(started(both), ticks)
    sequencer = started(both, frames=1)
    run(sequencer, ticks // 3)
    sequencer.park()
    while not run(sequencer, 1)[0].parked:
        pass
    sequencer.arm()
    sequencer.trigger()
    assert run(sequencer, ticks) == first
    sequencer.commit(both)
    swapped = run(sequencer, ticks)[both.schedule.ticks // 2 :]
    assert [(t.x, t.y) for t in swapped] == [(t.x, t.y) for t in first[both.schedule.ticks // 2 :]]
    assert run(sequencer, ticks) != first  # running on, the remainders are others


def test_many_ticks_at_once_are_those_of_single_steps(program: DualProgram) -> None:
    both = shaped(program, *PAIRS[2])
    one, other = started(both), started(both)
    ticks = 3 * both.schedule.ticks
    single = [(t.x, t.y) for t in run(one, ticks)]
    many: list[tuple[int, int]] = []
    while len(many) < ticks:
        part = other.ahead(ticks - len(many))
        if part is None:
            step = other.step()
            many.append((step.x, step.y))
        else:
            many += zip(part[0].x.tolist(), part[0].y.tolist(), strict=True)
    assert many == single


def test_shaped_codes_have_no_period(program: DualProgram) -> None:
    both = shaped(program, *PAIRS[2])
    with pytest.raises(ValueError, match="not periodic"):
        play_line(both, 0)
    with pytest.raises(ValueError, match="not periodic"):
        both.x.codes(np.arange(4))
    with pytest.raises(ValueError, match="not periodic"):
        runs_of(both.x)
    lines = PlayedLines(both)
    assert not np.array_equal(lines.play(0).x, lines.play(0).x)


def test_off_is_what_it_was(program: DualProgram) -> None:
    line = PlayedLines(program).play(1)
    assert np.array_equal(line.x, play_line(program, 1).x)
    assert np.array_equal(program.x.played(0, program.x.ticks), program.x.codes(np.arange(program.x.ticks)))
    assert Sequencer(program).playing is program
