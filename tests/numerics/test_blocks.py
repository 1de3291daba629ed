"""What is worked out in blocks, to stay in the cache, has the bits of what is worked out at once."""

import subprocess
from pathlib import Path

import measured
import numpy as np
import pytest
from editing import SCAN, edited, write_pair

from tablegen.fixedpoint import runs
from tablegen.fixedpoint.runs import Runs
from tablegen.numerics import arrays, linear, turns
from tablegen.numerics.arrays import Floats, tree_sum
from tablegen.numerics.linear import Cholesky
from tablegen.numerics.turns import sine_and_cosine
from tablegen.waveform import sampler, series
from tablegen.waveform.sampler import Sampler
from tablegen.waveform.series import FourierSeries, values


def by_columns(matrix: Floats) -> Floats:
    """The factor by the textbook: column after column, the whole rest at a time."""
    work = np.array(matrix)
    for j in range(len(work)):
        work[j:, j] /= np.sqrt(work[j, j])
        work[j + 1 :, j + 1 :] -= work[j + 1 :, j, None] * work[None, j + 1 :, j]
    return np.tril(work)


@pytest.mark.common
@pytest.mark.parametrize("block", [linear._BLOCK, 300, 1])
@pytest.mark.parametrize("size", [1, 2, 31, 32, 33, 64, 65, 288, 289, 330])
def test_a_factor_has_the_bits_of_column_by_column(monkeypatch: pytest.MonkeyPatch, size: int, block: int) -> None:
    monkeypatch.setattr(linear, "_BLOCK", block)
    random = np.random.default_rng(size)
    half = random.normal(size=(size, size))
    matrix = half @ half.T + size * np.eye(size)
    assert np.array_equal(np.triu(Cholesky(matrix)._columns).T, by_columns(matrix))


def solved_by_columns(factor: Floats, right: Floats) -> Floats:
    """By the textbook: each unknown in turn, taken from all the others at once."""
    x = np.array(right)
    for j in range(len(x)):
        x[j] /= factor[j, j]
        x[j + 1 :] -= x[j] * factor[j + 1 :, j]
    for j in reversed(range(len(x))):
        x[j] /= factor[j, j]
        x[:j] -= x[j] * factor[j, :j]
    return x


@pytest.mark.parametrize("size", [1, 2, 7, 8, 9, 31, 65, 128, 129])
def test_a_solution_has_the_bits_of_column_by_column(size: int) -> None:
    random = np.random.default_rng(size)
    half, right = random.normal(size=(size, size)), random.normal(size=size)
    matrix = half @ half.T + size * np.eye(size)
    assert Cholesky(matrix).solve(right).tobytes() == solved_by_columns(by_columns(matrix), right).tobytes()


def test_a_pivot_that_is_not_positive_is_named_in_any_block() -> None:
    matrix = np.eye(100)
    matrix[70, 70] = 0.0
    with pytest.raises(ArithmeticError, match="pivot 70 of 100 is 0"):
        Cholesky(matrix)


def test_sines_sums_and_series(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(3)
    t = random.uniform(-3.0, 3.0, (7, 501))
    many = random.normal(size=(37, 129))
    wave = FourierSeries(0.5, random.normal(size=9), random.normal(size=9))
    other = FourierSeries(0.1, random.normal(size=4), random.normal(size=4))
    ticks = random.integers(0, 10**6, 5000)

    def all_of_them() -> list[Floats]:
        return [
            *sine_and_cosine(t),
            tree_sum(many),
            *values(t, (wave, 0), (other, 1), (wave, 2)),
            wave.value(t, 3),
            Sampler(wave, 10**6).at(ticks),
        ]

    at_once = all_of_them()
    for module, name, size in (
        *((turns, "_BLOCK", 64), (arrays, "_BLOCK", 256), (series, "_BLOCK", 100), (sampler, "_CHUNK_TICKS", 333)),
    ):
        monkeypatch.setattr(module, name, size)
    assert all(np.array_equal(one, other) for one, other in zip(at_once, all_of_them(), strict=True))
    assert all(one.shape == t.shape for one in (*at_once[:2], *at_once[3:7]))


def test_quadrants_at_their_ends() -> None:
    """Exact where an eighth, a quarter or a half of a turn is, on both sides of 0."""
    eighths = np.arange(-16, 17) / 8.0
    sines, cosines = sine_and_cosine(eighths)
    half = 0.5**0.5
    assert sines == pytest.approx([(0.0, half, 1.0, half, 0.0, -half, -1.0, -half)[k % 8] for k in range(-16, 17)])
    assert [k for k in range(33) if sines[k] == 0.0] == list(range(0, 33, 4))
    assert [k for k in range(33) if cosines[k] == 0.0] == list(range(2, 33, 4))


def test_lengths_of_some_runs() -> None:
    some = Runs(np.array([0, 3, 4, 9]), np.array([5, 6, 5, 7]), 12)
    assert some.lengths.tolist() == [3, 1, 5, 3]
    assert [some.lengths_of(slice(a, a + 2)).tolist() for a in range(4)] == [[3, 1], [1, 5], [5, 3], [3]]
    single = Runs(np.arange(6), np.arange(6), 6)
    assert single.by_tick
    assert single.lengths.tolist() == single.lengths_of(slice(0, 99)).tolist() == [1] * 6


@pytest.mark.parametrize("most", [runs._MOST_TICKS_PER_CODE, 0, 10**9], ids=["chosen", "searched", "counted"])
@pytest.mark.parametrize("chunk", [runs._CHUNK_TICKS, 7])
def test_codes_of_runs_are_those_of_their_ticks(monkeypatch: pytest.MonkeyPatch, chunk: int, most: int) -> None:
    """In any order, twice, at the first and the last tick; all ticks and few of them; none."""
    monkeypatch.setattr(runs, "_CHUNK_TICKS", chunk)
    monkeypatch.setattr(runs, "_MOST_TICKS_PER_CODE", most)
    random = np.random.default_rng(5)
    lengths = random.integers(1, 40, 300)
    codes = random.integers(-99, 99, 300)
    played, by_tick = Runs(np.cumsum(lengths) - lengths, codes, int(lengths.sum())), np.repeat(codes, lengths)
    ticks = played.ticks
    for k in (
        np.arange(ticks),
        random.integers(0, ticks, 500),
        np.array([ticks - 1, 0]),
        np.array([ticks // 2] * 3),
        np.array([ticks - 1]),
        played.lasts,
        np.zeros(0, dtype=np.int64),
    ):
        assert np.array_equal(played.at(k), by_tick[k])


@pytest.mark.common
def test_a_build_of_millions_of_ticks_and_512_harmonics_fits_small_computers(tmp_path: Path) -> None:
    scan = write_pair(
        tmp_path,
        edited(
            SCAN,
            *("dac.update_rate_hz = 10e6", "dac.bits = 24", "x.band_limit.harmonics = 512"),
            *("y.band_limit.harmonics = 512", "x.table.bits = 24", "y.table.bits = 24"),
            *("x.table.length = 65536", "y.table.length = 65536", "- [limits]"),
            *("- x.band_limit.window", "- y.band_limit.window"),
        ),
    )
    memory = tmp_path / "memory"
    subprocess.run([*measured.command(memory), "build", scan, "-o", tmp_path / "out", "-q"], check=True)
    assert int(memory.read_text()) < 450 << 20
