"""``adc_pixels`` behind pins: line, frame and pixel signals of another clock, which do not arrive on the same clock."""

import json
import random
from pathlib import Path

import numpy as np
import pytest
from building import BENCHES
from sets import long
from test_lint import ADC, CROSSINGS

from tablegen.device.adc_pixels import pixel_dtype
from tablegen.verification.verilog.simulate import Design, compile_design

FRAMES, LINES, PIXELS = 6, 5, 4
PULSE_PS, PIXEL_PS, TURN_PS = 30_000, 172_300, 400_700  # of a clock of 10,000 ps


def pins(frame_ps: int) -> list[tuple[int, int]]:
    """Return the times of changes in ps and the levels {frame, line, pixel}; ``frame_ps`` after its line a frame."""
    generator, edges, time = random.Random(frame_ps), [], 1_000_000
    for _ in range(FRAMES):
        for line in range(LINES):
            time += TURN_PS + generator.randrange(10_000)
            edges += [(time, 2), (time + PULSE_PS, 2)]
            if line == 0:
                edges += [(time + frame_ps, 4), (time + frame_ps + PULSE_PS, 4)]
            for pixel in range(PIXELS):
                begin = time + 100_000 + pixel * PIXEL_PS
                edges += [(begin, 1), (begin + PULSE_PS, 1)]
            time += 100_000 + PIXELS * PIXEL_PS
    edges.append((time + TURN_PS, 2))
    changes, level = [], 0
    for at, bit in sorted(edges):
        level ^= bit
        changes.append((at, level))
    return changes


@pytest.mark.common
@pytest.mark.parametrize("frame_ps", long([-31_000, 0, 9_000], [-31_000, -9_000, 0, 9_000, 31_000]))
def test_lines_and_frames_are_those_of_the_pins(frame_ps: int, tmp_path: Path) -> None:
    changes = pins(frame_ps)
    sources = [BENCHES / "adc_sync_bench.v", *sorted(ADC.glob("adc_*.v")), CROSSINGS / "dac_synchronise.v"]
    design = compile_design("icarus", Design(sources, "adc_sync_bench", {"CHANGES": len(changes)}), tmp_path)
    (tmp_path / "pins.hex").write_text("".join(f"{time << 3 | level:x}\n" for time, level in changes), "ascii")
    assert design.run("cocotb_adc_pixels", {"PAUSES": "0"}) == (1, 0)
    frames = json.loads((tmp_path / "received.json").read_text("ascii"))
    assert [len(frame) for frame in frames] == [PIXELS * 12] * (FRAMES * LINES)
    words = np.frombuffer(b"".join(map(bytes, frames)), pixel_dtype()).reshape(FRAMES, LINES, PIXELS)
    assert (words["line"] == np.arange(LINES)[:, None]).all()
    assert (words["column"] == np.arange(PIXELS)).all()
    assert (words["flags"][..., :-1] & 0b100000 == 0).all()
    assert (words["flags"] & 0b011011 == 1).all()
    first = words["flags"] & 4 != 0
    assert first[:, 0, 0].all()
    assert first.sum() == FRAMES
    assert set(np.unique(words["count"][..., :-1])) == {17, 18}
