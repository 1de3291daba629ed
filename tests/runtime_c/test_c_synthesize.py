"""``dac_synthesize`` against the host's synthesis, word for word: sizes, harmonics, sine tables, refusals."""

import ctypes
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from c_library import Library, compile_library
from hypothesis import given, settings
from hypothesis import strategies as st
from sets import by_tool

from tablegen.fixedpoint.synthesis import FourierWords, sine_periods, synthesize
from tablegen.numerics.arrays import Ints

INDEX_BITS, BITS, HARMONICS = (3, 16), (8, 24), (1, 200)
MOST_HARMONICS = 4096
UNTOUCHED = 0x5A
FOUR = 1 << 32  # the sum of magnitudes that the accumulator does not hold
BUILDS = {
    "gcc": ("gcc", ()),
    "gcc_small": ("gcc", ("-DDAC_SMALL=1",)),
    "gcc_optimised": ("gcc", ("-O3", "-DDAC_SMALL=0")),
    "clang": ("clang", ()),
    "clang_small": ("clang", ("-Os",)),
}


@cache
def sine_of(index_bits: int) -> "ctypes.Array[ctypes.c_int32]":
    """A period and a quarter, in just the memory that it needs."""
    words = sine_periods(index_bits)
    return (ctypes.c_int32 * len(words))(*words.tolist())


@dataclass(frozen=True, eq=False)
class Renderer:
    """``dac_synthesize`` of a build."""

    library: Library

    def table(self, words: Ints, index_bits: int, bits: int, harmonics: int, sine_index_bits: int) -> Ints | None:
        """The words, or None if it was refused; nothing may be written before or behind them, or after a refusal.

        Behind the last word stands the first again.
        """
        length = (1 << index_bits if index_bits <= 16 else 8) + 1
        word = ctypes.c_int16 if self.library.word_bytes == 2 else ctypes.c_int32
        size = ctypes.sizeof(word)
        memory = ctypes.create_string_buffer(bytes([UNTOUCHED]) * size * (length + 2), size * (length + 2))
        fourier = (ctypes.c_int32 * len(words))(*words.tolist())
        sine = sine_of(min(sine_index_bits, 16))
        done = self.library.dll.dac_synthesize(
            ctypes.byref(memory, size), length, index_bits, bits, fourier, harmonics, sine, sine_index_bits
        )
        raw = memory.raw
        edges = raw if not done else raw[:size] + raw[-size:]
        assert set(edges) == {UNTOUCHED}
        if not done:
            return None
        table = np.frombuffer(raw[size:-size], self.library.word).astype(np.int64)
        assert table[-1] == table[0]
        return table[:-1]


@pytest.fixture(scope="module", params=by_tool(BUILDS))
def renderers(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict[int, Renderer]:
    """By the bits of a word in memory."""
    compiler, more = BUILDS[request.param]
    folder = tmp_path_factory.mktemp("renderer")
    options = ("-std=c99", "-O1", "-g", "-fsanitize=undefined", "-fno-sanitize-recover=all", *more)
    if compiler == "clang":  # its run-time library is no part of a shared one
        options = (*options[:3], *more)
    return {
        bits: Renderer(Library(compile_library(folder / f"{bits}.so", bits, compiler=(compiler,), options=options)))
        for bits in (16, 32)
    }


def random_words(rng: np.random.Generator, harmonics: int, total: float) -> FourierWords:
    """Words whose magnitudes sum to ``total`` of what the accumulator holds, or a little less."""
    words = rng.integers(-(1 << 31), 1 << 31, 2 * harmonics + 1) * rng.choice([1.0, 0.0, 1e-3], 2 * harmonics + 1)
    words[int(rng.integers(len(words)))] += 1.0
    words = np.trunc(words / np.sum(np.abs(words)) * total * FOUR)
    words = np.clip(words, -(1 << 31), (1 << 31) - 1).astype(np.int64)
    return FourierWords(int(words[0]), words[1 : harmonics + 1], words[harmonics + 1 :])


@given(data=st.data())
@settings(max_examples=60)
def test_equals_the_host_word_for_word(renderers: dict[int, Renderer], data: st.DataObject) -> None:
    index_bits = data.draw(st.integers(INDEX_BITS[0], 9))
    sine_index_bits = data.draw(st.integers(index_bits, 12))
    bits = data.draw(st.integers(*BITS))
    harmonics = data.draw(st.integers(*HARMONICS) | st.integers(1, 9))
    total = data.draw(st.sampled_from([0.1, 0.25, 0.3, 0.9, 0.9999]))
    words = random_words(np.random.default_rng(data.draw(st.integers(0, 1 << 32))), harmonics, total)
    renderer = renderers[16 if bits <= 16 and data.draw(st.booleans()) else 32]
    table = renderer.table(words.in_order, index_bits, bits, harmonics, sine_index_bits)
    assert table is not None
    assert np.array_equal(table, synthesize(words, 1 << index_bits, bits))


@pytest.mark.parametrize(("index_bits", "bits", "harmonics"), [(16, 24, 7), (16, 16, 33), (13, 20, 200), (3, 24, 4096)])
def test_the_longest(renderers: dict[int, Renderer], index_bits: int, bits: int, harmonics: int) -> None:
    words = random_words(np.random.default_rng(index_bits), harmonics, 0.3)
    for storage in (16, 32) if bits <= 16 else (32,):
        table = renderers[storage].table(words.in_order, index_bits, bits, harmonics, max(index_bits, 8))
        assert table is not None
        assert np.array_equal(table, synthesize(words, 1 << index_bits, bits))


@pytest.mark.parametrize("n", range(1, 9))
def test_one_harmonic_at_a_time(renderers: dict[int, Renderer], n: int) -> None:
    """Sine and cosine of either sign, in the shortest tables, saturated at both ends."""
    for word in (1 << 30, -(1 << 30), (1 << 31) - 1, -(1 << 31)):
        for place in (n, 8 + n):
            raw = np.zeros(17, np.int64)
            raw[place] = word
            words = FourierWords(0, raw[1:9], raw[9:])
            for index_bits in (3, 4, 5):
                table = renderers[16].table(raw, index_bits, 16, 8, 6)
                assert table is not None
                assert np.array_equal(table, synthesize(words, 1 << index_bits, 16))


def test_ties_are_rounded_up(renderers: dict[int, Renderer]) -> None:
    """A mean halfway between two words, of either sign."""
    for bits in range(*BITS):
        lsb = 1 << (31 - bits)
        for word in range(-3, 3):
            words = FourierWords(word * lsb + lsb // 2, np.zeros(1, np.int64), np.zeros(1, np.int64))
            table = renderers[32].table(words.in_order, 3, bits, 1, 3)
            assert table is not None
            assert set(table) == {word + 1}


def test_what_it_refuses(renderers: dict[int, Renderer]) -> None:
    """Sizes outside their ranges, words that could leave the accumulator; nothing is written."""
    good = {"index_bits": 5, "bits": 16, "harmonics": 3, "sine_index_bits": 6}
    words = np.array([0, 1 << 29, 0, 5, 1 << 28, 7, 0])
    assert renderers[16].table(words, **good) is not None
    refused = {
        "index_bits": [0, 2, 7, 17, 40], "bits": [0, 7, 17, 25, 40], "sine_index_bits": [0, 4, 17, 40],
        "harmonics": [0, MOST_HARMONICS + 1, (1 << 32) - 1],
    }  # fmt: skip
    for key, values in refused.items():
        for value in values:
            assert renderers[16].table(words, **{**good, key: value}) is None, f"{key} = {value}"
    for bits in (7, 25):
        assert renderers[32].table(words, **{**good, "bits": bits}) is None
    full = 1 << 31
    for magnitudes, fits in (
        ([full - 1, full - 1, 1, 0, 0, 0, 0], True), ([-full, full - 1, 0, 0, 0, 0, 0], True),
        ([-full, full - 1, 0, 0, 0, 0, 1], False), ([-full, 0, 0, -full, 0, 0, 0], False),
        ([-full, 0, 0, 0, 0, 0, -full], False), ([1, -full, full - 1, 0, 0, 0, 0], False), ([-full] * 7, False),
        ([0, 0, 0, 0, 0, -full, full - 1], True),
    ):  # fmt: skip
        table = renderers[16].table(np.array(magnitudes), **good)
        assert (table is not None) == fits, magnitudes
        if table is not None:
            words = FourierWords(magnitudes[0], np.array(magnitudes[1:4]), np.array(magnitudes[4:]))
            assert np.array_equal(table, synthesize(words, 32, 16))
