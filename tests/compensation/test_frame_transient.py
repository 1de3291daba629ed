"""The drift of a frame after a change: against many frames in time, and against the closed form of lines."""

from dataclasses import replace

import numpy as np
import pytest
from operator_files import operator_file

from tablegen.compensation.operator.bias_memory import BiasMemory
from tablegen.compensation.operator.file import operator_text, read_operator
from tablegen.compensation.operator.frame_transient import DrivenFrame, frame_drift_nm
from tablegen.compensation.operator.in_time import OperatorInTime, Start
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.transient import SettledLine, transient_between
from tablegen.numerics.arrays import Floats

pytestmark = pytest.mark.common

LINES, SAMPLES, LINE_S = 12, 128, 0.01


@pytest.fixture(scope="module")
def operator(tmp_path_factory: pytest.TempPathFactory) -> Operator:
    """Plays over a bent line, with creep of ten frames."""
    path = tmp_path_factory.mktemp("operator") / "x.toml"
    path.write_text(operator_text(operator_file(creep=0.03), []), "utf-8")
    known = read_operator(path, "x")[0]
    return replace(known, creep=known.creep.down_to(1.0 / (LINES * LINE_S)))


def triangle(t: Floats) -> Floats:
    return np.asarray(1.0 - np.abs(2.0 * (t % 1.0) - 1.0) - 0.5)


def frame(centre: float, fast: float, slow: float, lines: int = LINES) -> DrivenFrame:
    """A frame that follows a line and a frame, both triangles."""
    at, t = np.arange(lines)[:, None], np.arange(SAMPLES) / SAMPLES
    return DrivenFrame(centre + fast * triangle(t) + slow * triangle((at + t) / lines), LINE_S)


def stepped(axis: OperatorInTime, before: DrivenFrame, now: DrivenFrame, many: int = 60) -> float:
    """The drift of the first frame, after many frames of the scan before, against the last of many frames."""
    u = np.concatenate([np.tile(before.u.ravel(), many), np.tile(now.u.ravel(), many), now.u[:1].ravel()])
    position = axis.position(np.arange(len(u)) * (LINE_S / SAMPLES), u, Start.REST)
    means = position.reshape(-1, SAMPLES).mean(axis=1)
    lines, first = len(now.u), many * len(before.u)
    off = means[first : first + lines + 1] - np.append(means[-lines - 1 : -1], means[-lines - 1])
    return float(abs(off[lines] - off[0]))


@pytest.mark.parametrize(
    ("before", "now"),
    [
        (frame(0.4, 0.2, -0.15), frame(0.55, 0.2, -0.15)),  # a move
        (frame(0.5, 0.2, 0.1), frame(0.5, 0.1, 0.05)),  # a smaller scan
        (frame(0.5, 0.25, 0.1), frame(0.5, 0.1, 0.25)),  # a turn
        (frame(0.45, -0.2, 0.1), frame(0.4, -0.2, 0.1).from_line(5)),
    ],
)
def test_it_is_that_of_many_frames_in_time(operator: Operator, before: DrivenFrame, now: DrivenFrame) -> None:
    axis = OperatorInTime(operator)
    expected = stepped(axis, before, now)
    assert frame_drift_nm(axis, before, now) == pytest.approx(expected, rel=0.05, abs=0.02)
    assert expected > 0.1


def test_without_a_change_there_is_none(operator: Operator) -> None:
    same = frame(0.5, 0.2, 0.1)
    assert frame_drift_nm(OperatorInTime(operator), same, same) == 0.0
    assert frame_drift_nm(OperatorInTime(operator), frame(0.5, 0.2, 0.12), same) > 0.0


@pytest.mark.parametrize("memory", [None, BiasMemory(0.2, 2.0, 0.1, 1.2)])
def test_without_a_slow_part_it_is_that_of_lines(operator: Operator, memory: BiasMemory | None) -> None:
    """The closed form of lines, which other piezos have confirmed."""
    operator = replace(operator, bias_memory=memory)
    lines = [SettledLine(centre - 0.1, centre + 0.1, 0.5, LINE_S) for centre in (0.4, 0.5)]
    closed = transient_between(operator, lines[0], lines[1], 1.0).drift_nm(LINE_S, 0, LINES)
    frames = frame(0.4, 0.2, 0.0), frame(0.5, 0.2, 0.0)
    assert frame_drift_nm(OperatorInTime(operator), *frames) == pytest.approx(closed, rel=0.1)
