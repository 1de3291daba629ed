"""Runs of one code against the codes of every single tick."""

from math import floor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from replacing import replace

from tablegen.fixedpoint import pieces as pieces_module
from tablegen.fixedpoint import runs as module
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.pieces import most_levels, pieces_of
from tablegen.fixedpoint.program import Mode, Program
from tablegen.fixedpoint.rounding import shift_round, signed_limits
from tablegen.fixedpoint.runs import runs_of
from tablegen.fixedpoint.spline import SPLINE_FRACTION_BITS, cubic


@st.composite
def programs(draw: st.DrawFn) -> Program:
    bits, dac = draw(st.integers(8, 20)), draw(st.integers(8, 14))
    gain_q = 16 + bits + guard_bits(bits) - dac
    offset = draw(st.floats(0.0, 1.0)) * (1 << dac)
    limits = sorted(draw(st.tuples(st.integers(0, (1 << dac) - 1), st.integers(0, (1 << dac) - 1))))
    output = Output(
        gain_word=draw(st.integers(-(2**17), 2**17 - 1)),
        gain_q=gain_q,
        offset_word=floor(offset * (1 << gain_q)),
        code_min=limits[0],
        code_max=limits[1],
        max_step=1,
        park_code=limits[0],
        dac_bits=dac,
        coding="offset-binary",
        align="right",
        word_bits=dac,
    )
    length = 1 << draw(st.integers(2, 6))
    word = st.integers(*signed_limits(bits))
    words = np.array(draw(st.lists(word, min_size=length, max_size=length)), dtype=np.int64)
    return Program(RationalPhase(draw(st.integers(3, 20000))), 1, "interpolated", bits, words, output)


@st.composite
def splines(draw: st.DrawFn) -> Program:
    """Cubic programs, of smooth words and of words that jump; their pieces are few enough to try."""
    program = draw(programs())
    bits, length = draw(st.integers(8, 21)), 1 << draw(st.integers(3, 6))
    swing = draw(st.floats(0.0, 0.98)) * (1 << (bits - 1))
    jump = draw(st.integers(0, min(60, (1 << (bits - 1)) // 50)))
    turns = draw(st.floats(0.0, 1.0)) + np.arange(length) * draw(st.integers(0, 3)) / length
    jumps = np.array(draw(st.lists(st.integers(-jump, jump), min_size=length, max_size=length)))
    words = np.rint(swing * np.sin(2 * np.pi * turns)).astype(np.int64) + jumps
    return replace(program, mode="cubic", bits=bits, words=words)


def check_every_tick_is_in_its_run(program: Program) -> None:
    ticks = np.arange(program.ticks)
    codes = program.codes(ticks)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            module, "_MIN_TICKS_PER_RUN", 0
        )  # runs even where ticks are cheaper: more of them, shorter, skipped
        runs = runs_of(program)
    assert int(runs.lengths.min()) >= 1
    assert int(runs.lengths.sum()) == program.ticks
    assert np.array_equal(np.repeat(runs.codes, runs.lengths), codes)
    assert np.array_equal(runs.at(ticks), codes)
    k = ticks[:: max(1, program.ticks // 7)]
    split = runs.split_at(k)
    assert np.isin(k, split.starts).all()
    assert np.array_equal(np.repeat(split.codes, split.lengths), codes)


@pytest.mark.common
@settings(max_examples=10, deadline=None)
@given(st.one_of(programs(), splines()))
def test_every_tick_is_in_its_run(program: Program) -> None:
    check_every_tick_is_in_its_run(program)


@pytest.mark.rest
@settings(max_examples=60, deadline=None)
@given(st.one_of(programs(), splines()))
def test_every_tick_is_in_its_run_of_many(program: Program) -> None:
    check_every_tick_is_in_its_run(program)


@settings(max_examples=30, deadline=None)
@given(programs(), st.integers(2, 50))
def test_held_and_direct_programs(program: Program, hold: int) -> None:
    held = replace(program, hold=hold)
    direct = replace(program, mode="direct", words=np.resize(program.words, program.phase.ticks))
    for one in (held, direct):
        runs = runs_of(one)
        assert np.array_equal(np.repeat(runs.codes, runs.lengths), one.codes(np.arange(one.ticks)))


@pytest.mark.common
@settings(max_examples=150, deadline=None)
@given(programs(), st.integers(0, 2), st.sampled_from((1, -1)))
def test_codes_finer_than_samples(program: Program, doubled: int, sign: int) -> None:
    """Where each sample is a code or more, or less, within the limits and beyond them: no run but of another code."""
    output = program.output
    wide = replace(
        output,
        gain_word=sign * ((doubled << 15) + abs(output.gain_word) % (1 << 15)),
        gain_q=15,
        offset_word=1 << 38,
        code_min=(doubled // 2) << 23,
        code_max=(1 << 24) - 1,
        dac_bits=24,
    )
    program = replace(program, output=wide, words=program.words >> program.bits - 5)  # few enough levels for runs
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_MIN_TICKS_PER_RUN", 0)
        runs = runs_of(program)
    codes = program.codes(np.arange(program.ticks))
    assert int(runs.lengths.min()) >= 1
    assert np.array_equal(np.repeat(runs.codes, runs.lengths), codes)
    assert len(runs.starts) <= np.count_nonzero(np.diff(codes)) + len(program.words)


def check_pieces_of_splines(program: Program) -> None:
    """They cover every fraction of every segment once, their samples are those of the spline, and they rise or fall."""
    count = 0
    for pieces in pieces_of(program):
        assert np.array_equal(pieces.begins == 0, np.diff(pieces.segment, prepend=pieces.segment[0] - 1) > 0)
        inside = np.diff(pieces.segment) == 0
        assert np.array_equal(pieces.begins[1:][inside], pieces.ends[:-1][inside])
        assert (pieces.ends > pieces.begins).all()
        assert (np.append(pieces.ends[:-1][~inside], pieces.ends[-1]) == 1 << SPLINE_FRACTION_BITS).all()
        count += len(pieces.begins)
        some = np.arange(0, len(pieces.begins), max(1, len(pieces.begins) // 500))
        for fraction in (pieces.begins[some], (pieces.begins[some] + pieces.ends[some]) // 2, pieces.ends[some] - 1):
            sample = pieces.base[some] + shift_round(pieces.slope[some] * fraction, pieces.shift)
            assert np.array_equal(cubic(program.words, pieces.phase(some, fraction)), sample)
    assert len(program.words) <= count <= most_levels(program)


@pytest.mark.common
@settings(max_examples=15, deadline=None)
@given(splines())
def test_pieces_of_splines(program: Program) -> None:
    check_pieces_of_splines(program)


@pytest.mark.long
@pytest.mark.timeout(86_400)
@settings(max_examples=100, deadline=None)
@given(splines())
def test_pieces_of_splines_of_many(program: Program) -> None:
    check_pieces_of_splines(program)


def check_runs_of_splines_are_no_more_than_their_bound(program: Program) -> None:
    """So that pieces are given up for ticks before they take memory; and pieces do not show in the runs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_MIN_TICKS_PER_RUN", 0)
        runs = runs_of(program)
    assert len(runs.starts) <= most_levels(program)
    changes = np.count_nonzero(np.diff(program.codes(np.arange(program.ticks))))
    assert len(runs.starts) <= changes + len(program.words)


@settings(max_examples=6, deadline=None)
@given(splines())
def test_runs_of_splines_are_no_more_than_their_bound(program: Program) -> None:
    check_runs_of_splines_are_no_more_than_their_bound(program)


@pytest.mark.long
@pytest.mark.timeout(86_400)
@settings(max_examples=100, deadline=None)
@given(splines())
def test_runs_of_splines_are_no_more_than_their_bound_of_many(program: Program) -> None:
    check_runs_of_splines_are_no_more_than_their_bound(program)


def check_parts_do_not_show(program: Program, size: int) -> None:
    """However many levels, and pieces, are worked out together, the runs are the same."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_MIN_TICKS_PER_RUN", 0)
        whole = runs_of(program)
        patch.setattr(pieces_module, "_PIECES", 50 * size)
        patch.setattr(module, "_CHUNK_LEVELS", size * max(1, len(whole.starts) // 100))
        parts = runs_of(program)
    assert np.array_equal(parts.starts, whole.starts)
    assert np.array_equal(parts.codes, whole.codes)


@pytest.mark.long
@pytest.mark.timeout(86_400)
@settings(max_examples=30, deadline=None)
@given(st.one_of(programs(), splines()), st.integers(1, 40))
def test_parts_do_not_show(program: Program, size: int) -> None:
    check_parts_do_not_show(program, size)


@pytest.mark.parametrize(("mode", "bits"), [("interpolated", 16), ("cubic", 16), ("cubic", 14)])
def test_a_frame_of_minutes_takes_no_more_than_its_codes(mode: Mode, bits: int) -> None:
    """2^31 - 1 ticks: the ends of every run are checked against the arithmetic, without playing the rest."""
    words = np.rint(20000 / 2 ** (16 - bits) * np.sin(2 * np.pi * np.arange(256) / 256)).astype(np.int64)
    output = Output(50000, bits + 4, 32768 << (bits + 4), 0, 65535, 1, 0, 16, "offset-binary", "right", 16)
    program = Program(RationalPhase(2**31 - 1), 1, mode, bits, words, output)
    runs = runs_of(program)
    assert not runs.by_tick
    assert len(runs.starts) < 70000
    assert int(runs.lengths.sum()) == 2**31 - 1
    assert np.array_equal(program.codes(runs.starts), runs.codes)
    assert np.array_equal(program.codes(runs.lasts), runs.codes)
