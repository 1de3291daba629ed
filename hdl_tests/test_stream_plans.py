"""Programs of plans in Verilog: equal to the model, and within their certificates of the float waveform.

Down to the wires of a converter, and back to volts.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from building import BENCHES, Variant
from sets import common, common_and_rest
from spi_monitor import Converter, Wires, receive, updates
from stream_benches import equal, with_sine
from stream_configurations import (
    LEAST_PACE,
)
from stream_plans import PLAIN, PLANS, TIMING, markers_of_a_scan, planned, short, within_certificate
from stream_scripts import (
    codes,
    flag,
    rendering_clocks,
)

from tablegen.base.resources import verilog_runtime
from tablegen.certificate.certificate import certify
from tablegen.verification.play.placement import Placement
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script
from tablegen.verification.verilog.sequencer_bench import SequencerBench

# Both kinds of tables and their turns; then each width by one plan.
FEW = ("bits_16", "turn_0.7", "direct_steps", "guarded")
OF_THE_REST = ("bits_8", "bits_24", "narrow_tables_wide_dac", "wide_tables_narrow_dac", "direct", "inverting")


@pytest.mark.common
@pytest.mark.parametrize("name", common_and_rest(FEW, OF_THE_REST, PLANS))
def test_whole_frames_of_a_plan(name: str, tmp_path: Path) -> None:
    plan = planned(tmp_path, PLANS[name])
    program = plan.program
    bench = SequencerBench(
        "icarus",
        SequencerShape.of((program.x, program.y)),
        tmp_path / "bench",
        {"PLAIN_MULTIPLIER": int(name in PLAIN)},
    )
    park = plan.x.program.output.park_code, plan.y.program.output.park_code
    script = Script()
    script.load(program)
    script.tick_every(Placement().playing(program).tick_clocks)
    script.request("commit", program=program)
    script.wait_ticks(100)
    script.request("arm", "trigger", frames=2)
    script.wait_ticks(2 * plan.schedule.frame_ticks + 100)
    played = equal(bench, script)
    within_certificate(played.capture, plan)
    markers_of_a_scan(played.capture, plan, 2)
    assert flag(played.capture, "parked")[-1]
    assert tuple(codes(played.capture, axis)[-1] for axis in "xy") == park


@pytest.mark.rest
@pytest.mark.parametrize(("simulator", "lines"), [("icarus", 3), ("verilator", 200)])
def test_the_shipped_example(simulator: str, lines: int, tmp_path: Path) -> None:
    plan = planned(tmp_path, Variant())
    assert plan.schedule.lines == 200
    program = plan.program
    bench = SequencerBench(simulator, SequencerShape.of((program.x, program.y)), tmp_path / "bench")
    script = Script()
    script.load(program)
    script.tick_every(1)
    script.request("commit", program=program)
    script.wait_ticks(100)
    script.request("arm", "trigger", frames=1)
    script.wait_ticks(lines * plan.schedule.ticks + 20)
    played = equal(bench, script)
    within_certificate(played.capture, plan)
    if lines == plan.schedule.lines:
        markers_of_a_scan(played.capture, plan, 1)


@pytest.mark.rest
def test_the_longest_table(tmp_path: Path) -> None:
    plan = planned(tmp_path, short(x__table__length=65536, timing={**TIMING, "ticks_per_line": 1249}))
    program = plan.program
    bench = SequencerBench(
        "icarus", SequencerShape.of((program.x, program.y)), tmp_path / "bench", {"PLAIN_MULTIPLIER": 1}
    )
    script = Script()
    script.load(program)
    script.tick_every(1)
    script.request("commit", "arm", program=program)
    script.wait_ticks(2)
    script.request("trigger")
    script.wait_ticks(2 * plan.schedule.ticks)
    within_certificate(equal(bench, script).capture, plan)


@pytest.mark.common
@pytest.mark.parametrize("low_area", common([0], [0, 1]))
def test_a_plan_from_its_fourier_words(low_area: int, tmp_path: Path) -> None:
    """The swap is from the uploaded plan to the same, rendered from a fiftieth of the words: no code may differ."""
    plan = planned(tmp_path, PLANS["settle_0"])
    program = plan.program
    shape = SequencerShape.of((program.x, program.y))
    x, y = plan.x.fourier, plan.y.fourier
    parameters = {**with_sine(tmp_path, shape, x.harmonics), "PLAIN_MULTIPLIER": 1, "LOW_AREA": low_area}
    bench = SequencerBench("verilator" if low_area else "icarus", shape, tmp_path / "bench", parameters)
    clocks, pace = rendering_clocks(shape, x, y, 1), LEAST_PACE if low_area else 1
    script = Script()
    script.tick_every(pace)
    for frames in (1, 0):
        script.load(program, x, y) if frames == 0 else script.load(program)
        script.request("commit", program=program, commit_clocks=clocks if frames == 0 else 4)
        if frames:
            script.wait_ticks(50)
            script.request("arm", "trigger")
            script.wait_ticks(plan.schedule.ticks)
    script.wait(clocks)
    script.wait_ticks(5 * plan.schedule.ticks)
    assert script.swaps == 2
    capture = equal(bench, script).capture
    at = int(np.flatnonzero(flag(capture, "swapped"))[1])
    within_certificate(capture[at:], plan)


# From a plan to the wires of a converter, and back to volts.


@dataclass(frozen=True)
class Chip:
    """A converter behind two parallel wires."""

    bits: int
    frame_bits: int
    prefix: int
    twos_complement: bool


CHIPS = {"bits_16": Chip(16, 16, 0, False), "bits_20": Chip(20, 24, 0x100000, True)}


@pytest.mark.rest
@pytest.mark.parametrize("name", CHIPS)
def test_volts_at_the_piezo(name: str, tmp_path: Path) -> None:
    chip = CHIPS[name]
    coding = "twos-complement" if chip.twos_complement else "offset-binary"
    variant = short(dac__bits=chip.bits, dac__coding=coding, x__table__bits=chip.bits, y__table__bits=chip.bits)
    plan = planned(tmp_path, variant)
    program = plan.program
    levels = tmp_path / "levels.txt"
    parameters = {
        "LEVELS": str(levels),
        "WORD_BITS": chip.bits,
        "TWOS_COMPLEMENT": int(chip.twos_complement),
        "FRAME_BITS": chip.frame_bits,
        "PREFIX": chip.prefix,
    }
    sources = [*verilog_runtime(), BENCHES / "stream_spi_bench.v"]
    shape = SequencerShape.of((program.x, program.y))
    bench = SequencerBench("icarus", shape, tmp_path / "bench", parameters, sources, top="stream_spi_bench")
    script = Script()
    script.load(program)
    script.tick_every(2 * chip.frame_bits + 12)
    script.request("commit", program=program)
    script.wait_ticks(20)
    script.request("arm", "trigger")
    script.wait_ticks(plan.schedule.ticks + 20)
    script.tick_every(0)
    script.wait(200)
    played = equal(bench, script)

    digits = np.frombuffer(bytes.fromhex(levels.read_text("ascii")), dtype=np.uint8)
    sclk, mosi_x, mosi_y, cs_n, ldac_n = (digits >> bit & 1 for bit in range(5))
    playing = np.flatnonzero(flag(played.capture, "playing"))
    caught_up = 30
    for line, mosi in ((plan.x, mosi_x), (plan.y, mosi_y)):
        converter = Converter(chip.frame_bits, cpol=0, cpha=0)
        wires = Wires(sclk, cs_n, mosi, ldac_n)
        frames = receive(wires, converter)
        _, latest = updates(wires, converter, frames)
        words = frames.values[latest, 0]
        assert len(words) == played.samples
        assert np.all(words >> chip.bits == chip.prefix >> chip.bits)
        words &= (1 << chip.bits) - 1
        if chip.twos_complement:  # as the converter reads it: 0 in the middle
            signed = np.where(words >= 1 << chip.bits - 1, words - (1 << chip.bits), words)
            at_converter = 10.0 * signed / (1 << chip.bits)
        else:
            at_converter = -5.0 + 10.0 * words / (1 << chip.bits)
        at_piezo = 10.0 * at_converter + 50.0
        k = np.arange(len(playing))
        w = line.series.value(k % line.program.ticks / line.program.ticks)
        wanted = line.drive.v_offset + line.drive.v_amplitude * (w - 0.5)
        lsb = 10.0 * 10.0 / (1 << chip.bits)
        errors = np.abs(at_piezo[playing] - wanted)[caught_up:] / lsb
        assert np.max(errors) <= certify(plan)[line.axis].max_error_lsb + 1e-6
        assert len(errors) > 300
