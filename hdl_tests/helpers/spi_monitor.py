"""A serial DAC as its wires see it: decodes a capture of sclk, select, data and LDAC, and finds protocol faults.

It knows nothing of the module that drives the wires, only what a converter of the described type does with them. A
capture is an array of levels for each wire, one for each clock of the driver; levels that are neither 0 nor 1 stand
for an unknown. Times are indices into it: an edge is at the first clock that has the new level.
"""

from dataclasses import dataclass

import numpy as np

from tablegen.numerics.arrays import Ints


class ProtocolFault(Exception):
    """The wires broke a rule of the converter; says which, and when."""

    def __init__(self, clock: int, rule: str) -> None:
        super().__init__(f"clock {clock}: {rule}")
        self.clock = clock
        self.rule = rule


@dataclass(frozen=True)
class Wires:
    """The pins of one converter, or of one daisy chain."""

    sclk: Ints
    cs_n: Ints
    mosi: Ints
    ldac_n: Ints


@dataclass(frozen=True)
class Converter:
    """What a converter asks of its wires. Times are least times, in clocks of the capture.

    ``chain`` converters have sclk and the select in common, and the input of each but the first is the output of the
    one before. ``ldac`` is "pulse" (input registers are taken over as it falls), "low" (held: as the select rises) or
    "high" (held: never; a command has to do it).
    """

    frame_bits: int
    cpol: int
    cpha: int
    chain: int = 1
    ldac: str = "pulse"
    setup: int = 1  # data before the sampling edge
    hold: int = 1  # data after it
    sclk_high: int = 1
    sclk_low: int = 1
    select_setup: int = 1  # select before the first edge of sclk
    select_hold: int = 1  # select after the last edge of sclk
    select_high: int = 1  # between two frames
    ldac_low: int = 1
    ldac_delay: int = 1  # from the select rising to LDAC falling


@dataclass(frozen=True)
class Frames:
    """What was received: columns of ``values`` are the converters of a chain, the nearest to the driver first."""

    start: Ints  # select falls
    end: Ints  # select rises
    values: Ints


def receive(wires: Wires, converter: Converter) -> Frames:
    """The frames that a converter receives. Raises ``ProtocolFault``."""
    for name in ("sclk", "cs_n", "mosi", "ldac_n"):
        level = getattr(wires, name)
        _never((level != 0) & (level != 1), f"{name} is unknown")
    start, end = _falls(wires.cs_n), _rises(wires.cs_n)
    if wires.cs_n[0] == 0:
        raise ProtocolFault(0, "the select is low from the beginning")
    if len(start) != len(end):
        raise ProtocolFault(int(start[-1]), "a frame does not end")
    selected = wires.cs_n == 0
    bits = converter.frame_bits * converter.chain

    # sclk is at rest wherever the select changes, and where nothing is selected its edges would be noise.
    for edge, what in ((start, "falls"), (end, "rises")):
        wrong = edge[(wires.sclk[edge] != converter.cpol) | (wires.sclk[edge - 1] != converter.cpol)]
        if len(wrong):
            raise ProtocolFault(int(wrong[0]), f"the select {what} with sclk not at rest")

    leading = (_rises if converter.cpol == 0 else _falls)(wires.sclk)
    trailing = (_falls if converter.cpol == 0 else _rises)(wires.sclk)
    leading, trailing = leading[selected[leading]], trailing[selected[trailing]]
    sampling = leading if converter.cpha == 0 else trailing
    count = np.searchsorted(sampling, end) - np.searchsorted(sampling, start)
    if np.any(count != bits):
        first = int(np.flatnonzero(count != bits)[0])
        raise ProtocolFault(int(end[first]), f"a frame of {count[first]} bits instead of {bits}")
    if len(start) == 0:
        return Frames(start, end, np.empty((0, converter.chain), np.int64))
    assert len(leading) == len(trailing) == len(sampling)

    rise, fall = (leading, trailing) if converter.cpol == 0 else (trailing, leading)
    _times(wires.sclk, rise, 1, converter.sclk_high, "sclk is high for too short a time")
    _times(wires.sclk, fall, 0, converter.sclk_low, "sclk is low for too short a time")
    first_edge, last_edge = leading.reshape(-1, bits)[:, 0], trailing.reshape(-1, bits)[:, -1]
    _least(start, first_edge - start, converter.select_setup, "sclk begins too soon after the select")
    _least(end, end - last_edge, converter.select_hold, "the select rises too soon after sclk")
    _least(start[1:], start[1:] - end[:-1], converter.select_high, "the select is high for too short a time")
    _stable(wires.mosi, sampling, converter.setup, converter.hold)

    _ldac(wires.ldac_n, selected, end, converter)
    weights = 1 << np.arange(converter.frame_bits - 1, -1, -1, dtype=np.int64)
    # Of a chain the bits that came first have been shifted on to the far end.
    received = wires.mosi[sampling].astype(np.int64).reshape(-1, converter.chain, converter.frame_bits)
    return Frames(start, end, (received @ weights)[:, ::-1])


def updates(wires: Wires, converter: Converter, frames: Frames) -> tuple[Ints, Ints]:
    """When the outputs change, and the index of the last frame that they then have received.

    For converters without commands, and for commands that only write the input register.
    """
    if converter.ldac == "low":
        return frames.end, np.arange(len(frames.end))
    if converter.ldac == "high":
        raise ValueError("with LDAC held high a command updates the outputs: decode the frames")
    falls = _falls(wires.ldac_n)
    return falls, np.searchsorted(frames.end, falls, side="right") - 1


def quiet(sclk: Ints, cs_n: list[Ints], cpol: int) -> None:
    """sclk is at rest while nothing on the bus is selected."""
    nobody = np.logical_and.reduce([level == 1 for level in cs_n])
    _never(nobody & (sclk != cpol), "sclk is not at rest with nothing selected")


def _ldac(ldac_n: Ints, selected: np.ndarray, end: Ints, converter: Converter) -> None:
    if converter.ldac != "pulse":
        _never(ldac_n != (converter.ldac == "high"), "LDAC is not held")
        return
    if ldac_n[0] == 0:
        raise ProtocolFault(0, "LDAC is low from the beginning")
    _never((ldac_n == 0) & selected, "LDAC is low during a frame")
    falls, rises = _falls(ldac_n), _rises(ldac_n)
    if len(falls) != len(rises):
        raise ProtocolFault(int(falls[-1]), "LDAC stays low")
    _least(falls, rises - falls, converter.ldac_low, "LDAC is low for too short a time")
    before = np.searchsorted(end, falls, side="right") - 1
    if np.any(before < 0):
        raise ProtocolFault(int(falls[0]), "LDAC falls before any frame")
    if len(np.unique(before)) != len(before):
        raise ProtocolFault(int(falls[0]), "LDAC falls twice after one frame")
    _least(falls, falls - end[before], converter.ldac_delay, "LDAC falls too soon after the select rises")


def _stable(mosi: Ints, sampling: Ints, setup: int, hold: int) -> None:
    for offset in range(-setup, hold):
        wrong = sampling[mosi[sampling + offset] != mosi[sampling]]
        if len(wrong):
            raise ProtocolFault(int(wrong[0]), "data changes at the sampling edge")


def _times(level: Ints, edges: Ints, value: int, least: int, rule: str) -> None:
    for offset in range(least):
        wrong = edges[level[edges + offset] != value]
        if len(wrong):
            raise ProtocolFault(int(wrong[0]), rule)


def _least(clocks: Ints, times: Ints, least: int, rule: str) -> None:
    wrong = clocks[times < least]
    if len(wrong):
        raise ProtocolFault(int(wrong[0]), rule)


def _never(condition: np.ndarray, rule: str) -> None:
    where = np.flatnonzero(condition)
    if len(where):
        raise ProtocolFault(int(where[0]), rule)


def _falls(level: Ints) -> Ints:
    return np.flatnonzero((level[1:] == 0) & (level[:-1] != 0)) + 1


def _rises(level: Ints) -> Ints:
    return np.flatnonzero((level[1:] != 0) & (level[:-1] == 0)) + 1


def two_channels(wires: Wires, converter: Converter, frames: Frames) -> list[tuple[int, tuple[int, int]]]:
    """What the outputs of a chip with two channels change to, and when; DAC8562 and AD5663R style.

    A frame is 2 bits of anything, 3 of command, 3 of address and 16 of data. Command 0 writes the input register of
    the channel, 2 does that and updates both outputs, 3 does that and updates its own; addresses are 0 and 1. LDAC
    held low is edge-triggered here, that is, never.
    """
    registers, outputs = [0, 0], [0, 0]
    changes: list[tuple[int, tuple[int, int]]] = []
    events = [(int(end), int(value)) for end, value in zip(frames.end, frames.values[:, 0], strict=True)]
    if converter.ldac == "pulse":
        events += [(int(clock), -1) for clock in _falls(wires.ldac_n)]
    for clock, value in sorted(events):
        command, channel = value >> 19 & 7, value >> 16 & 7
        if value >= 0:
            if command not in (0, 2, 3) or channel > 1:
                raise ProtocolFault(clock, f"command {command} to channel {channel}")
            registers[channel] = value & 0xFFFF
        updated = (0, 1) if value < 0 or command == 2 else (channel,) if command == 3 else ()
        for each in updated:
            outputs[each] = registers[each]
        if updated:
            changes.append((clock, (outputs[0], outputs[1])))
    return changes
