"""Plans that a bench of the whole sequencer plays, and what their captures are held to."""

from pathlib import Path

import numpy as np
from building import Variant, write_variant
from stream_scripts import (
    codes,
    flag,
    occurrences,
)

from tablegen.certificate.certificate import certify
from tablegen.config.load import load
from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.line_plan import LinePlan, Plan, make_plan
from tablegen.verification.play.stream import Words

TIMING = {"pixels": 40, "lines": 8, "line_rate_hz": 100.0, "ticks_per_line": 331, "settle_lines": 1}
SHORT: dict[str, object] = {
    "timing": TIMING,
    "dac.update_rate_hz": 50e3,
    "x.band_limit.harmonics": 16,
    "y.band_limit.harmonics": 8,
    "x.table.length": 256,
    "y.table.length": 128,
}


def short(**changes: object) -> Variant:
    return Variant({**SHORT, **{key.replace("__", "."): value for key, value in changes.items()}})


def _bits(dac: int, x: int, y: int) -> Variant:
    return short(dac__bits=dac, x__table__bits=x, y__table__bits=y)


def _turned(turn: float) -> Variant:
    forward = {"beta_max": 0.037, "rho": 4.0, "u_peak": 0.37}
    backward = {"beta_max": 0.03, "rho": 1.5, "u_peak": 0.48}
    branches = [{"turn": turn, "forward": forward, "backward": backward}]
    variant = short(x__turn=turn, x__band_limit__directions="forward")
    return Variant(variant.scan, {"x.hysteresis.branches": branches})


def _settling(lines: int) -> Variant:
    return short(timing={**TIMING, "settle_lines": lines})


PLANS: dict[str, Variant] = {
    "bits_8": _bits(8, 8, 8),
    "bits_12": _bits(12, 12, 12),
    "bits_16": _bits(16, 16, 16),
    "bits_18": _bits(18, 18, 18),
    "bits_20": _bits(20, 20, 20),
    "bits_24": _bits(24, 24, 24),
    "narrow_tables_wide_dac": _bits(24, 8, 12),
    "wide_tables_narrow_dac": _bits(8, 24, 20),
    "turn_0.7": _turned(0.7),
    "turn_0.95": _turned(0.95),
    "direct": short(x__table={"mode": "direct", "bits": 16}, y__table={"mode": "direct", "bits": 12}),
    "direct_steps": short(
        x__table={"mode": "direct", "bits": 24},
        y__table={"mode": "direct", "bits": 8},
        y__motion="step",
        y__band_limit__harmonics=3,
    ),
    "steps": short(y__motion="step", y__band_limit__harmonics=3),
    "twos_complement": short(dac__coding="twos-complement"),
    "inverting": short(amplifier__gain=-10.0),
    "settle_0": _settling(0),
    "settle_5": _settling(5),
    "cubic": short(
        x__table={"mode": "cubic", "length": 64, "bits": 14}, y__table={"mode": "cubic", "length": 32, "bits": 16}
    ),
    "guarded": short(amplifier__max_slew_v_per_s=40e3),
}
PLAIN = {"bits_12", "bits_18", "bits_24", "wide_tables_narrow_dac", "steps", "direct"}  # multiplier blocks


def planned(folder: Path, variant: Variant) -> Plan:
    return make_plan(load(write_variant(folder, variant)))


def asked(line: LinePlan, k: Ints) -> Floats:
    """The codes, unrounded, that the float waveform of an axis asks for at ticks k of its period."""
    program = line.program
    return line.float_codes(line.series.value(k % program.ticks // program.hold / program.phase.ticks))


def within_certificate(capture: Words, plan: Plan) -> None:
    """Every code of a scan, once it has caught up, is as near to the float waveform as the certificate says."""
    playing = capture[flag(capture, "playing")]
    k = np.arange(len(playing))
    certificates = certify(plan)
    caught_up = len(playing)
    for line in plan.lines:
        errors = np.abs(codes(playing, line.axis) - asked(line, k))
        close = errors <= certificates[line.axis].max_error_lsb + 1e-6
        first = int(np.argmax(close))
        assert np.all(close[first:])
        caught_up = min(caught_up, len(playing) - first)
    assert caught_up > 0.9 * len(playing) > 1000
    assert not np.any(playing >> np.uint64(56))  # no fault


def markers_of_a_scan(capture: Words, plan: Plan, frames: int) -> None:
    """Lines, frames, pixels and the valid windows of whole frames, counted off the capture."""
    schedule, seen = plan.schedule, occurrences(capture)
    assert seen["playing"] == frames * schedule.frame_ticks
    assert seen["line"] == frames * schedule.lines
    assert seen["frame"] == frames
    ways = 1 + bool(schedule.backward.count)
    assert seen["pixel"] == frames * schedule.lines * ways * schedule.pixels
    settled = [
        line
        for line in range(frames * schedule.lines)
        if line >= schedule.settle_lines
        and (line % schedule.lines in schedule.up or line % schedule.lines in schedule.down)
    ]
    playing = capture[flag(capture, "playing")]
    valid = flag(playing, "valid")
    assert sorted(set(np.flatnonzero(valid) // schedule.ticks)) == settled
    assert seen["valid"] == len(settled) * (schedule.forward.count + schedule.backward.count)
    assert seen["backward"] == frames * schedule.lines * (schedule.ticks - schedule.turn_tick)
