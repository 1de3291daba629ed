"""The monitor of SPI against frames that were drawn by hand: the tests of dac_spi are no better than it."""

from collections.abc import Mapping

import numpy as np
import pytest
from replacing import replace
from spi_monitor import Converter, ProtocolFault, Wires, receive, updates

# A frame of four bits, 1011, in mode 0, by hand; and what a change in one wire is to be called.
DRAWN = {
    "cs_n": "11100000000011111111",
    "sclk": "00001010101000000000",
    "mosi": "00011001111000000000",
    "ldac_n": "11111111111111001111",
}
FOUR = Converter(4, 0, 0, ldac_low=2, ldac_delay=2)


def draw(changes: Mapping[str, str]) -> Wires:
    return Wires(**{name: np.array([*map(int, levels)]) for name, levels in {**DRAWN, **changes}.items()})


def test_the_monitor_reads_a_frame_drawn_by_hand() -> None:
    frames = receive(draw({}), FOUR)
    assert (frames.start.tolist(), frames.end.tolist(), frames.values.tolist()) == ([3], [12], [[0b1011]])
    assert [part.tolist() for part in updates(draw({}), FOUR, frames)] == [[14], [0]]
    # The same wires, sampled on the other edge; with sclk inverted; and as two converters of two bits in a chain.
    assert receive(draw({}), replace(FOUR, cpha=1, setup=0)).values.tolist() == [[0b0110]]
    inverted = {"sclk": DRAWN["sclk"].translate({48: "1", 49: "0"})}
    assert receive(draw(inverted), replace(FOUR, cpol=1)).values.tolist() == [[0b1011]]
    assert receive(draw({}), replace(FOUR, frame_bits=2, chain=2)).values.tolist() == [[0b11, 0b10]]


@pytest.mark.parametrize(
    ("wire", "levels", "rule"),
    [
        ("mosi", "00011002111000000000", "mosi is unknown"),
        ("cs_n", "00000000000011111111", "the select is low from the beginning"),
        ("cs_n", "11100000000000000000", "a frame does not end"),
        ("cs_n", "11110000000011111111", "the select falls with sclk not at rest"),
        ("cs_n", "11100000000111111111", "the select rises with sclk not at rest"),
        ("sclk", "00001010100000000000", "a frame of 3 bits instead of 4"),
        ("mosi", "00001001111000000000", "data changes at the sampling edge"),
        ("ldac_n", "11111111111011111111", "LDAC is low during a frame"),
        ("ldac_n", "11111111111110011111", "LDAC falls too soon"),
        ("ldac_n", "11111111111111011111", "LDAC is low for too short a time"),
        ("ldac_n", "11111111111111001001", "LDAC falls twice after one frame"),
        ("ldac_n", "10011111111111111111", "LDAC falls before any frame"),
        ("ldac_n", "11111111111111000000", "LDAC stays low"),
        ("ldac_n", "01111111111111001111", "LDAC is low from the beginning"),
    ],
)
def test_the_monitor_finds_a_fault_drawn_by_hand(wire: str, levels: str, rule: str) -> None:
    with pytest.raises(ProtocolFault, match=rule):
        receive(draw({wire: levels}), FOUR)


@pytest.mark.parametrize(
    ("least", "rule"),
    [
        ({"setup": 2}, "data changes at the sampling edge"),
        ({"hold": 2}, "data changes at the sampling edge"),
        ({"sclk_high": 2}, "sclk is high for too short a time"),
        ({"sclk_low": 2}, "sclk is low for too short a time"),
        ({"select_setup": 2}, "sclk begins too soon after the select"),
        ({"select_hold": 2}, "the select rises too soon after sclk"),
    ],
)
def test_the_monitor_holds_wires_against_the_times_of_a_converter(least: dict[str, int], rule: str) -> None:
    with pytest.raises(ProtocolFault, match=rule):
        receive(draw({}), replace(FOUR, **least))
