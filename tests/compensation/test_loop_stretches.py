"""Positions along many loops at once: bit for bit those of whole loops, one after the other."""

from functools import cache
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
import pytest
from operator_files import operator_file
from replacing import replace

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.operator.file import BoucWenTable, operator_text, read_operator
from tablegen.compensation.operator.in_time import OperatorInTime, Start, late_mode, mean_of, turns_of
from tablegen.compensation.operator.loop_stretches import LoopStretch, positions_on
from tablegen.compensation.operator.operator import Operator
from tablegen.numerics.arrays import Floats

KINDS = {"plays": (0.0, False), "residual": (1.1e-3, False), "rough residual": (2e-3, False), "bouc-wen": (1e-4, True)}


@cache
def operator(kind: str, residual: float | None = None) -> Operator:
    """Plays over a bent line, with a residual of this size, and perhaps Bouc and Wen's equation."""
    size, bouc_wen = KINDS[kind]
    size, random, file = size if residual is None else residual, np.random.default_rng(3), operator_file(creep=0.02)
    if size:
        rows = [size * random.normal(size=(2, 12)) for _ in file.lines]
        lines = [
            replace(line, rising=rising.tolist(), falling=falling.tolist(), size=0.01)
            for line, (rising, falling) in zip(file.lines, rows, strict=True)
        ]
        file = replace(file, lines=lines)
    if bouc_wen:
        table = BoucWenTable(depth_nm=40.0, n=1.5, beta=3.0, gamma=1.0, asymmetry=0.1, bend=[0.2, 0.1])
        file = replace(file, bouc_wen=table)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "operator.toml"
        path.write_text(operator_text(file, []), "utf-8")
        return read_operator(path, "operator.toml")[0]


def one_by_one(model: OperatorInTime, u: Floats, mean: float) -> Floats:
    """The settled hysteresis of a drive, each way along whole loops as it comes."""
    low, high = float(np.min(u)), float(np.max(u))
    widest = model.operator.loop(low, high, model.factor_at(mean), mean)
    turns, rising, at = [(high, widest.extent_nm), (low, 0.0)], True, (low, 0.0)
    for drive in (np.append(u, u[0]), u):
        out = np.empty(len(drive))
        for begin, end in pairwise(turns_of(drive)):
            part = drive[begin : end + 1]
            part = np.maximum.accumulate(part) if part[-1] >= part[0] else np.minimum.accumulate(part)
            up = bool(part[-1] > part[0]) if part[-1] != part[0] else rising
            if up != rising:
                turns, rising = (turns if at[0] == turns[-1][0] else [*turns, at]), up
            y, first, sign = np.full(len(part), at[1]), 1, 1.0 if up else -1.0
            while first < len(part):
                (last, y_last), (aim, y_aim) = turns[-1], turns[-2]
                until = first + int(np.searchsorted(sign * part[first:], sign * aim, side="right"))
                if until > first:
                    ends = min(last, aim), max(last, aim)
                    loop = widest if ends == (low, high) else model.operator.loop(*ends, model.factor_at(mean), mean)
                    here = loop.position(part[first:until], up)
                    y[first:until] = y_last + (y_aim - y_last) * (here if up else 1.0 - here)
                    y[until - 1] = y_aim if part[until - 1] == aim else y[until - 1]
                first = until
                if first < len(part) or part[-1] == aim:
                    if len(turns) == 2:
                        turns.reverse()
                        break
                    turns = turns[:-2] if len(turns) > 3 else [turns[0], (aim, y_aim)]
            at = float(part[-1]), float(y[-1])
            out[begin : end + 1] = y
    return out


def frame(seed: int) -> Floats:
    """Lines of some size about a middle that goes up and down; some of them turn where others do."""
    random = np.random.default_rng(seed)
    lines, samples = int(random.integers(3, 8)), int(random.integers(20, 90))
    t, line = np.arange(samples) / samples, np.arange(lines)[:, None]
    wave = np.abs(2.0 * t - 1.0) if seed % 2 else 0.5 + 0.5 * np.cos(2.0 * np.pi * t)
    sizes = random.uniform(0.1, 0.35) * (1.0 + 0.03 * random.normal(size=(lines, 1)))
    slow = random.uniform(-0.2, 0.2) * np.abs(2.0 * ((line + t) / lines % 1.0) - 1.0)
    u = np.clip(random.uniform(0.4, 0.6) + sizes * (wave - 0.5) + slow, -0.01, 1.01).ravel()
    return np.round(u, 2) if seed % 3 == 0 else u


@pytest.mark.parametrize("kind", KINDS)
def test_a_frame_is_that_of_whole_loops(kind: str) -> None:
    model = OperatorInTime(operator(kind))
    for seed in range(12):
        u = frame(seed)
        u = np.append(u, u[0])
        mean = mean_of(np.arange(len(u)) * 1.0, u)
        assert model.hysteresis(u, Start.SETTLED, mean).tobytes() == one_by_one(model, u, mean).tobytes(), seed


def stretches(seed: int) -> list[LoopStretch]:
    """Stretches of different lengths on random loops, a few of which leave the range of the driver."""
    random = np.random.default_rng(seed)
    some = []
    for _ in range(40):
        low = random.uniform(0.0, 0.6) if random.random() < 0.8 else -0.01
        high = low + random.uniform(0.02, 0.4)
        u = np.sort(random.uniform(low, high, int(random.integers(1, 60))))
        rising = bool(random.integers(0, 2))
        some.append(LoopStretch(low, high, rising, u if rising else u[::-1].copy()))
    return some


@pytest.mark.parametrize("kind", KINDS)
def test_stretches_are_those_of_whole_loops(kind: str) -> None:
    """Also of loops that are made whole, since their bound does not say that they rise."""
    some, its = stretches(1), operator(kind)
    with patch.object(Operator, "shape", autospec=True, side_effect=Operator.shape) as whole:
        positions = positions_on(its, some)
    for one, position in zip(some, positions, strict=True):
        assert position.tobytes() == its.loop(one.low, one.high).position(one.u, one.rising).tobytes()
    least = sum(one.low < 0.0 for one in some)  # envelopes run backwards there
    assert least > 0
    if kind == "plays":
        assert whole.call_count == least
    elif kind == "residual":
        assert least < whole.call_count < len(some)
    else:
        assert whole.call_count == len(some)


def test_a_branch_that_runs_backwards_is_refused_as_by_its_loop() -> None:
    wild = operator("residual", residual=0.03)
    refusals = []
    for one in stretches(2):
        try:
            wild.loop(one.low, one.high)
        except Unphysical as reason:
            refusals.append((one, str(reason)))
    assert len(refusals) > 20
    for one, reason in refusals:
        with pytest.raises(Unphysical) as refused:
            positions_on(wild, [one])
        assert str(refused.value) == reason


def test_few_drives_of_a_branch_are_those_of_many() -> None:
    its = operator("plays").family.plays
    u = np.linspace(0.2, 0.55, 40)
    for rising in (True, False):
        many, rows = its.branch(u, 0.2, 0.55, rising), np.stack([u, u])
        few = np.concatenate([its.branch(part, 0.2, 0.55, rising) for part in np.split(u, 10)])
        both = its.branch_of_loops(rows, np.array([0.2, 0.1]), np.array([0.55, 0.9]), rising)
        assert few.tobytes() == both[0].tobytes() == many.tobytes()
        assert both[1].tobytes() == its.branch(u, 0.1, 0.9, rising).tobytes() != many.tobytes()


def test_a_real_mode_has_the_bits_of_a_complex_one() -> None:
    random = np.random.default_rng(1)
    time_s, y = np.cumsum(random.uniform(1e-4, 2e-4, 300)), random.normal(size=300)
    for tau_s in (1e-5, 3e-3, 0.7, 40.0):
        x = np.diff(time_s) / tau_s
        decay, lost = np.exp(-x), -np.expm1(-x)
        first = np.where(np.abs(x) > 1e-5, lost / x, 1.0 - 0.5 * x)
        gain = np.concatenate([[0.0], (first - decay) * y[:-1] + (1.0 - first) * y[1:]]).astype(np.complex128)
        factor = np.concatenate([[1.0], decay]).astype(np.complex128)
        step = 1
        while step < len(y):
            gain[step:] = gain[step:] + factor[step:] * gain[:-step]
            factor[step:] = factor[step:] * factor[:-step]
            step *= 2
        for repeated, begin in ((0, y[0]), (300, gain[299] / (1.0 - factor[299]))):
            assert late_mode(time_s, y, tau_s, repeated).real.tobytes() == (gain + factor * begin).real.tobytes()
