"""The integer model of ``adc_pixels``: laws that hold for all inputs, a scan worked by hand, and the picture."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablegen.device.adc_pixels import (
    PixelInputs,
    PixelOutputs,
    PixelStream,
    PixelSums,
    PixelWord,
    pixel_dtype,
    pixel_picture,
)
from tablegen.device.marker_delay import MarkerDelay

pytestmark = pytest.mark.common

LIKELY, RARE = st.sampled_from([True] * 5 + [False]), st.sampled_from([False] * 7 + [True])
INPUTS = st.builds(
    PixelInputs,
    samples=st.none() | st.tuples(st.integers(-128, 127)),
    reset=st.just(False),
    pixel=st.booleans(),
    line=RARE,
    frame=RARE,
    backward=RARE,
    valid=LIKELY,
    playing=LIKELY,
    fault=RARE,
    ready=st.booleans(),
)
CLOCKS = st.lists(INPUTS, max_size=120)


def words_of(clocks: Sequence[PixelInputs], count_bits: int = 16) -> list[PixelWord]:
    """The words before the FIFO; at the end the scan stops, so that no pixel stays open."""
    sums = PixelSums(count_bits=count_bits)
    words = [sums.step(inputs) for inputs in (*clocks, PixelInputs(playing=False))]
    return [word for word in words if word is not None]


def beats_of(stream: PixelStream, clocks: Sequence[PixelInputs]) -> tuple[list[PixelWord], PixelOutputs]:
    """The words that the sink takes, until the FIFO is empty, and the last outputs."""
    beats, outputs = [], PixelOutputs(None, 0)
    for inputs in (*clocks, *[PixelInputs(playing=False)] * 40):
        if outputs.word is not None and inputs.ready:
            beats.append(outputs.word)
        outputs = stream.step(inputs)
    return beats, outputs


@given(CLOCKS)
def test_each_pulse_of_a_scan_gives_a_word(clocks: list[PixelInputs]) -> None:
    assert len(words_of(clocks)) == sum(inputs.pixel and inputs.playing for inputs in clocks)


@given(CLOCKS)
def test_no_sample_is_in_two_words(clocks: list[PixelInputs]) -> None:
    """Each sample is a bit of its own: the sums of the words have none in common."""
    number, marked = 0, []
    for inputs in clocks:
        sample = None if inputs.samples is None else (1 << number,)
        number += sample is not None
        marked.append(inputs._replace(samples=sample))
    sums = [word.sums[0] for word in words_of(marked)]
    assert sum(sums) == sum(bit for bit in {1 << k for k in range(number)} if any(one & bit for one in sums))
    assert all(word.count == word.sums[0].bit_count() for word in words_of(marked))


@given(CLOCKS)
def test_columns_of_a_sweep_follow_each_other_and_its_last_is_marked(clocks: list[PixelInputs]) -> None:
    words = words_of(clocks)
    for one, after in pairwise(words):
        if not one.last:
            assert (after.line, after.backward, after.column) == (one.line, one.backward, one.column + 1)
    assert not words or words[-1].last


@given(CLOCKS, st.integers(1, 4))
def test_a_sum_of_few_bits_stops_and_says_so(clocks: list[PixelInputs], bits: int) -> None:
    for few, whole in zip(words_of(clocks, bits), words_of(clocks), strict=True):
        most = 2**bits - 1
        assert few.count == min(whole.count, most)
        assert few.overfull == (whole.count > most)
        if not few.overfull:
            assert few == whole


def places_of(beats: list[PixelWord], made: list[PixelWord]) -> set[int]:
    """Return where the last beat may be among the words that were made; empty where no order fits all beats.

    A beat is a word, marked if words before it were lost, and the first of its line if one of those was. Words may be
    equal, so that a beat may have several places.
    """
    places = {-1}
    for beat in beats:
        places = {
            at
            for before in places
            for at in range(before + 1, len(made))
            if made[at] == replace(beat, lost=False, first=made[at].first)
            and beat.lost == (at > before + 1)
            and beat.first == any(word.first for word in made[before + 1 : at + 1])
        }
    return places


def test_a_gap_without_a_mark_has_no_place() -> None:
    """The control: a gap without a mark, and a mark without a gap; equal words may have several places."""
    begin, on = PixelInputs((1,), pixel=True), PixelInputs((1,))
    one, other, last = words_of([begin, on, begin, on, begin, on])
    assert places_of([one, replace(last, lost=True)], [one, other, last]) == {2}
    assert places_of([one, last], [one, other, last]) == set()
    assert places_of([one, replace(other, lost=True)], [one, other, last]) == set()
    same = [one, one, one]
    assert places_of([replace(one, lost=True)], same) == {1, 2}
    assert places_of([one, one], same) == {1}


@given(CLOCKS, st.integers(1, 3))
def test_what_a_sink_does_not_take_is_counted_and_marked(clocks: list[PixelInputs], depth_bits: int) -> None:
    """What comes is a part of what was made, in its order; a gap is marked in the next word, and nothing else is."""
    made = words_of(clocks)
    beats, last = beats_of(PixelStream(depth_bits=depth_bits), clocks)
    assert last.word is None
    assert len(beats) + last.lost_words == len(made)
    assert places_of(beats, made)


@given(CLOCKS)
def test_a_sink_that_is_always_ready_loses_nothing(clocks: list[PixelInputs]) -> None:
    ready = [inputs._replace(ready=True) for inputs in clocks]
    beats, last = beats_of(PixelStream(depth_bits=1), ready)
    assert beats == words_of(clocks)
    assert last.lost_words == 0


def test_a_reset_ends_the_pixel_without_a_word_and_numbers_from_0() -> None:
    begin, on = PixelInputs((1,), pixel=True), PixelInputs((1,))
    before = [begin._replace(line=True, frame=True), begin._replace(line=True)]
    words = words_of([*before, on._replace(reset=True), on, begin, on])
    assert [(word.line, word.column, word.count, word.first) for word in words] == [(0, 0, 1, True), (0, 0, 2, False)]


def test_two_pixels_worked_by_hand() -> None:
    """The example of docs/pixels.md."""
    pixel, valid = "_#___#___________", "_########________"
    samples: list[int | None] = [9, 1, None, 2, 3, 4, None, 5, 6, 7, 8]
    clocks = [
        PixelInputs(
            samples=None if sample is None else (sample,),
            pixel=pixel[k] == "#",
            line=k == 1,
            frame=k == 1,
            valid=valid[k] == "#",
        )
        for k, sample in enumerate(samples)
    ]
    assert words_of(clocks) == [
        PixelWord((6,), 3, line=0, column=0, valid=True, backward=False, first=True),
        PixelWord((15,), 3, line=0, column=1, valid=True, backward=False, last=True),
    ]


def test_a_fault_and_a_park_make_the_pixel_invalid_and_a_window_does_not() -> None:
    begin, on = PixelInputs((1,), pixel=True), PixelInputs((1,))
    for end, valid in (
        (on._replace(valid=False), True),
        (on._replace(valid=False, fault=True), False),
        (on._replace(valid=False, playing=False), False),
        (on._replace(line=True), True),
    ):
        (word,) = words_of([begin, on, end])
        assert word.valid == valid
        assert word.count >= 2


def test_a_picture_has_the_means_of_the_valid_words_of_one_direction() -> None:
    words = [
        PixelWord((-30, 5), 3, line=4, column=0, valid=True, backward=False),
        PixelWord((8, 5), 2, line=5, column=1, valid=True, backward=False, last=True),
        PixelWord((8, 7), 2, line=5, column=0, valid=True, backward=True),
        PixelWord((8, 7), 2, line=5, column=0, valid=False, backward=False),
        PixelWord((8, 7), 2, line=6, column=0, valid=True, backward=False),
    ]
    data = np.frombuffer(b"".join(word.data.to_bytes(16, "little") for word in words), pixel_dtype(2))
    nan = np.nan
    np.testing.assert_array_equal(pixel_picture(data, range(4, 6), 2), [[-10.0, nan], [nan, 4.0]])
    np.testing.assert_array_equal(pixel_picture(data, range(4, 6), 2, True, 1), [[nan, nan], [3.5, nan]])


@given(st.lists(st.lists(st.booleans(), min_size=2, max_size=2), max_size=40), st.integers(2, 20), st.integers(0, 20))
def test_a_delay_keeps_every_level(levels: list[list[bool]], first: int, second: int) -> None:
    model = MarkerDelay(2)
    delays = [first, second]
    model.step([0, 0], delays)
    out = [model.step(one, delays) for one in (*levels, *[[False, False]] * 20)]
    for signal, delay in enumerate(delays):
        assert [one[signal] for one in out] == ([False] * delay + [one[signal] for one in levels] + [False] * 20)[
            : len(out)
        ]
