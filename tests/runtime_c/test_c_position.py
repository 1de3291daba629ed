"""Positions in a period: 96 bits and no division are exact for every period, 64 bits for as long as a run takes.

``dac_arithmetic.h`` claims that with step = ceil(2^(79 + P) / N) the position after k < N advances, floored to 2^64, is
floor(k 2^(15 + P) / N): index and fraction of the model. Here the step is what a load derived, the position is moved by
the runtime's own addition and multiplication, and Python's integers say what is right.
"""

import pytest
from c_library import Library, compile_library
from c_runs import RUN_TICKS, WHOLE, advanced, loaded, nearest, runs_from, skipped, step_of
from hypothesis import example, given, settings
from hypothesis import strategies as st

MOST_ADVANCES = (1 << 31) - 1
MOST_TICKS = 1 << 24  # of a skip
INDEX_BITS = (3, 16)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return Library(compile_library(tmp_path_factory.mktemp("library") / "library.so", 32, 32, stride=1))


def edges(highest: int) -> "st.SearchStrategy[int]":
    """1..highest, often at its end, and at powers of two and beside them."""
    powers = [n for bit in range(32) for n in ((1 << bit) - 1, 1 << bit, (1 << bit) + 1) if 1 <= n <= highest]
    return st.one_of(st.integers(1, highest), st.integers(max(1, highest - 1000), highest), st.sampled_from(powers))


@pytest.mark.rest
@given(period=edges(MOST_ADVANCES), index_bits=st.integers(*INDEX_BITS), data=st.data())
@settings(max_examples=1500)
@example(period=MOST_ADVANCES, index_bits=16, data=None)
@example(period=1, index_bits=16, data=None)
def test_ninety_six_bits_are_exact(library: Library, period: int, index_bits: int, data: st.DataObject | None) -> None:
    device = loaded(library, period, index_bits)
    step = step_of(device)
    assert step == -(-(1 << 79 + index_bits) // period)
    places = [0, period - 1, period // 2] if data is None else [data.draw(edges(period)) - 1 for _ in range(4)]
    for k in places:
        position = step * k % WHOLE
        exact = k * (1 << 15 + index_bits) // period
        assert position >> 64 == exact
        ticks = min(k, MOST_TICKS - 1)
        assert skipped(device, step * (k - ticks) % WHOLE, ticks) == position
        assert advanced(device, position, step) == (position + step) % WHOLE


LONGEST_RUN = (1 << 32) // 18


@pytest.mark.common
@given(
    period=st.one_of(edges(LONGEST_RUN), edges(MOST_ADVANCES)), index_bits=st.integers(3, 10), seed=st.integers(0, 5),
    data=st.data(),
)  # fmt: skip
@settings(max_examples=600)
def test_runs_are_exact(library: Library, period: int, index_bits: int, seed: int, data: st.DataObject) -> None:
    runs_from(library, period, index_bits, seed, data.draw(edges(period)) - 1)
    runs_from(library, period, index_bits, seed, data.draw(st.integers(0, max(period - RUN_TICKS, 0))))


@pytest.mark.common
@given(period=edges((MOST_ADVANCES - 1) // 2), index_bits=st.integers(3, 10), back=st.integers(0, RUN_TICKS - 1))
@settings(max_examples=600)
def test_runs_are_exact_where_the_next_fraction_is_nearest(
    library: Library, period: int, index_bits: int, back: int
) -> None:
    """At the advance k at which k 2^(15 + P) / N is 1 / N below a whole number, met by a run after ``back`` ticks."""
    period = 2 * period + 1
    runs_from(library, period, index_bits, 0, max(nearest(period, index_bits) - back, 0))


def test_a_step_that_is_rounded_down_is_not_exact() -> None:
    """What the lemma needs: the other rounding fails at once."""
    period, index_bits = 3, 3
    step = (1 << 79 + index_bits) // period
    assert any(step * k >> 64 != k * (1 << 15 + index_bits) // period for k in range(0, 3 * period, period))
