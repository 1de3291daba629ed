"""Shaped output against plain integers, closed forms and bounds that hold whatever is played."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablegen.fixedpoint.shaping import MAXIMUM_ZERO, Remainders, Shaping, remainder_bits

ALL = [Shaping(0), Shaping(1), Shaping(2), *(Shaping(3, zero) for zero in range(MAXIMUM_ZERO + 1))]
shapings = st.sampled_from(ALL)


def fed_back(shaping: Shaping, values: list[int], bits: int) -> tuple[list[int], list[int]]:
    """Codes and remainders as the page of the sequencer has them, one tick after another."""
    e1 = e2 = e3 = 0
    codes, remainders = [], []
    for u in values:
        f = (0, e1, 2 * e1 - e2, (e1 - e2) + e3 + ((shaping.zero * (e1 - e2)) >> 6))[shaping.order]
        w = u + f
        codes.append(w >> bits)
        e1, e2, e3 = (w & (2**bits - 1)) - 2 ** (bits - 1), e1, e2
        remainders.append(e1)
    return codes, remainders


@st.composite
def played(draw: st.DrawFn) -> tuple[Shaping, int, list[int]]:
    shaping, bits = draw(shapings), remainder_bits(draw(st.integers(8, 24)))
    code = st.integers(0, (1 << 28) - 1)
    return shaping, bits, draw(st.lists(code, max_size=60))


@given(played(), st.integers(0, 60))
def test_codes_are_those_of_the_page_and_run_on_over_calls(one: tuple[Shaping, int, list[int]], at: int) -> None:
    shaping, bits, values = one
    wanted, _ = fed_back(shaping, values, bits)
    remainders = Remainders(shaping, bits)
    parts = [remainders.codes(np.array(part, dtype=np.int64)) for part in (values[:at], values[at:])]
    assert np.concatenate(parts).tolist() == wanted


@pytest.mark.common
@given(played())
def test_no_code_is_further_off_than_the_excess(one: tuple[Shaping, int, list[int]]) -> None:
    shaping, bits, values = one
    codes, remainders = fed_back(shaping, values, bits)
    half = 2 ** (bits - 1)
    assert all(-half <= e < half for e in remainders)
    # Half a code stands in the values already; the floor of an order 3 takes up to one remainder LSB more.
    off = [code * 2**bits - (value - half) for code, value in zip(codes, values, strict=True)]
    assert max((abs(each) for each in off), default=0) <= shaping.excess * 2**bits + (shaping.order == 3)


@given(played())
def test_a_step_grows_by_no_more_than_the_step_excess(one: tuple[Shaping, int, list[int]]) -> None:
    shaping, bits, values = one
    codes, _ = fed_back(shaping, values, bits)
    rounded = [value >> bits for value in values]
    grown = np.abs(np.diff(codes)) - np.abs(np.diff(rounded))
    assert grown.max(initial=0) <= shaping.step_excess


def test_step_excess_of_each_order() -> None:
    assert [Shaping(order).step_excess for order in (0, 1, 2)] == [0, 2, 4]
    assert [Shaping(3, zero).step_excess for zero in (0, 1, 32, 33, 128)] == [4, 5, 5, 6, 8]


@pytest.mark.parametrize("shaping", ALL[:3] + ALL[3::32])
def test_the_word_of_a_shaping_is_read_back(shaping: Shaping) -> None:
    assert Shaping.of_word(shaping.word) == shaping


@pytest.mark.parametrize("word", [4, 0x100, 0x102, 0x8103, 0x10003, 1 << 31])
def test_a_word_that_is_none_is_refused(word: int) -> None:
    with pytest.raises(ValueError, match="shaping"):
        Shaping.of_word(word)


def summed(values: list[int], order: int, bits: int) -> list[int]:
    """Remainders of order 1 and 2 in closed form: sums of all values so far, and of these, modulo a code."""
    for _ in range(order):
        values = [sum(values[: n + 1]) for n in range(len(values))]
    half = 2 ** (bits - 1)
    return [(value + half) % 2**bits - half for value in values]


@given(st.sampled_from([Shaping(1), Shaping(2)]), st.lists(st.integers(0, (1 << 28) - 1), max_size=40))
def test_remainders_of_low_orders_are_sums_modulo_a_code(shaping: Shaping, values: list[int]) -> None:
    bits = remainder_bits(16)
    half = 2 ** (bits - 1)
    codes, remainders = fed_back(shaping, values, bits)
    assert remainders == summed([value - half for value in values], shaping.order, bits)
    # c = (v + f - e) / 2^R, and what is fed back is 2^R c + e - v.
    sums = np.cumsum(np.array(codes, dtype=object) * 2**bits - np.array(values, dtype=object) + half)
    newest = np.array(remainders, dtype=object)
    before = np.concatenate([[0], newest[:-1]]) if len(values) else newest
    assert sums.tolist() == (-newest if shaping.order == 1 else before - newest).tolist()


@given(played())
def test_errors_do_not_add_up(one: tuple[Shaping, int, list[int]]) -> None:
    """The sum of all errors is that of the noise over 1 - z^-1; the floor of order 3 adds below an LSB a tick."""
    shaping, bits, values = one
    codes, _ = fed_back(shaping, values, bits)
    if shaping.order == 0:
        return
    total = sum(code * 2**bits - (value - 2 ** (bits - 1)) for code, value in zip(codes, values, strict=True))
    most = {1: 0.5, 2: 1.0, 3: 0.5 * (2.0 + shaping.zero / 64)}[shaping.order] * 2**bits
    assert abs(total) <= most + (len(values) if shaping.order == 3 else 0)


@pytest.mark.common
@pytest.mark.parametrize("shaping", [Shaping(1), Shaping(2), Shaping(3, 0), Shaping(3, 110), Shaping(3, 128)])
def test_the_spectrum_of_the_error_is_that_of_the_noise_filter(shaping: Shaping) -> None:
    bits, ticks, parts = remainder_bits(16), 512, 400
    values = np.random.default_rng(4).integers(0, 1 << 28, ticks * parts)
    codes = Remainders(shaping, bits).codes(values)
    errors = (codes - (values - 2 ** (bits - 1)) / 2.0**bits).reshape(parts, ticks) * np.hanning(ticks)
    power = np.mean(np.abs(np.fft.rfft(errors)) ** 2, axis=0) / np.sum(np.hanning(ticks) ** 2)
    turns = np.arange(len(power)) / ticks
    wanted = np.abs(np.polyval(shaping.noise[::-1], np.exp(-2j * np.pi * turns))) ** 2 / 12.0
    inside = wanted > 1e-3  # in a zero the window shows its neighbours
    assert np.count_nonzero(inside) > 200
    assert np.max(np.abs(power[inside] / wanted[inside] - 1.0)) < 0.35
    assert np.mean(power[inside] / wanted[inside]) == pytest.approx(1.0, abs=0.02)
    assert np.all(power[~inside] < 3e-3)
