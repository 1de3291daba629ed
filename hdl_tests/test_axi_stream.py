"""dac_axi_stream, received by cocotbext-axi, and mutants of it."""

import json
import random
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from building import BENCHES
from sets import one_of
from spi_bench import (
    AD5541A,
    END,
    RESET,
    STREAM,
    STROBE,
    Difference,
    Mutant,
    equal,
)

from tablegen.verification.verilog.simulate import Design, compile_design

pytestmark = pytest.mark.common


@dataclass(frozen=True)
class Beat:
    """The stream on one clock, as captured."""

    reset: int
    strobe: int
    missed: int
    valid: int
    ready: int
    markers: int
    data: int


@dataclass(frozen=True)
class Stream:
    """A stimulus of dac_axi_stream, the interface on every clock, and what the sink received."""

    lane_bits: int
    samples: Sequence[tuple[int, int]]  # data and markers
    clocks: Sequence[Beat]
    received: Sequence[tuple[int, int]]


def stream(folder: Path, word_bits: int, pauses: float, gaps: Sequence[int], module: Path = STREAM) -> Stream:
    """Some thousand strobes at distances drawn from ``gaps``, and some resets."""
    generator, lane = random.Random(word_bits), -(-word_bits // 8) * 8
    lines, samples = [], []
    for index in range(3000):
        x, y = generator.randrange(2**word_bits), generator.randrange(2**word_bits)
        markers, do = generator.randrange(32), STROBE | (RESET if index % 100 == 99 else 0)
        lines.append(f"{do << 60 | generator.choice(gaps) << 53 | markers << 48 | x << 24 | y:016x}\n")
        samples.append((y << lane | x, markers))
    lines.append(f"{END << 60 | 100 << 53:016x}\n")
    design = Design([BENCHES / "outputs_axi_bench.v", module], "outputs_axi_bench", {"WORD_BITS": word_bits})
    compiled = compile_design("icarus", design, folder)
    (folder / "stimulus.hex").write_text("".join(lines), "ascii")
    assert compiled.run("cocotb_outputs_axi", {"PAUSES": str(pauses)}) == (1, 0)
    clocks = []
    for line in (folder / "capture.txt").read_text("ascii").split():
        value = int(line, 16)
        data, top = value & (1 << 2 * lane) - 1, value >> 2 * lane
        clocks.append(Beat(top >> 9 & 1, top >> 8 & 1, top >> 7 & 1, top >> 6 & 1, top >> 5 & 1, top & 31, data))
    received = [(data, markers) for data, markers in json.loads((folder / "received.json").read_text("ascii"))]
    return Stream(lane, samples, clocks, received)


def check_stream(played: Stream) -> tuple[int, int]:
    """The rule of AXI, which sample is lost, and what the sink got. Returns how many were sent and how many missed."""
    for number, (now, after) in enumerate(zip(played.clocks[:-1], played.clocks[1:], strict=True)):
        waits = now.valid and not now.ready and not now.reset
        if waits and (after.valid, after.data, after.markers) != (1, now.data, now.markers):
            raise Difference(f"clock {number}: a beat that waits has changed")
    samples, accepted, sent, missed = iter(played.samples), [], [], []
    held = None
    for number, now in enumerate(played.clocks):
        if now.valid and now.ready:
            accepted.append((now.data, now.markers))
        if held is not None and now.ready:
            sent.append(held)
            held = None
        sample = next(samples) if now.strobe else None
        if now.reset:
            held = None
        elif sample is not None and held is None:
            held = sample
        elif sample is not None:
            missed.append(number + 1)
    equal("beat of the sink", played.received, accepted)
    equal("beat", accepted, sent)
    equal("missed", [number for number, now in enumerate(played.clocks) if now.missed], missed)
    return len(sent), len(missed)


@pytest.mark.rest
@pytest.mark.parametrize(
    ("word_bits", "pauses", "gaps"),
    [(16, 0.0, (0,)), (8, 0.3, (2, 3)), (20, 0.5, (0, 0, 1, 5, 20)), (24, 0.7, (0,))],
)
def test_the_stream_keeps_the_rule_of_axi(tmp_path: Path, word_bits: int, pauses: float, gaps: tuple[int, ...]) -> None:
    sent, missed = check_stream(stream(tmp_path, word_bits, pauses, gaps))
    if pauses == 0.0:
        assert sent >= 2940, "a sink that is always ready gets a beat a clock; those of resets are ignored"
        assert missed == 0
    else:
        assert sent > 500
        assert missed > 50


@pytest.mark.rest
@pytest.mark.parametrize(
    ("old", "new", "found"),
    one_of(
        2,
        [
            ("if (strobe && free) begin", "if (strobe) begin", "a beat that waits has changed"),
            (
                "else if (free) m_axis_tvalid <= strobe;",
                "else m_axis_tvalid <= strobe;",
                "a beat that waits has changed",
            ),
            ("free = !m_axis_tvalid || m_axis_tready;", "free = !m_axis_tvalid;", "beat"),
            ("missed <= strobe && !free && !reset;", "missed <= strobe && m_axis_tvalid;", "missed"),
            (
                "y_held, {(LANE_BITS - WORD_BITS){1'b0}}, x_held",
                "x_held, {(LANE_BITS - WORD_BITS){1'b0}}, y_held",
                "beat 0",
            ),
            ("m_axis_tuser <= markers;", "m_axis_tuser <= ~markers;", "beat 0"),
            ("if (reset) m_axis_tvalid <= 1'b0;\n        else if", "if", "beat"),
        ],
        3,
    ),
)
def test_a_mutant_of_the_stream_is_found(tmp_path: Path, old: str, new: str, found: str) -> None:
    (tmp_path / "dac_axi_stream.v").write_text(Mutant(AD5541A, old, new, found, STREAM).text(), "utf-8")
    played = stream(tmp_path / "played", 20, 0.5, (0, 0, 1, 5), tmp_path / "dac_axi_stream.v")
    with pytest.raises(Difference, match=found):
        check_stream(played)
