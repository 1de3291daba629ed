"""One bad input after another: each a small edit of the shipped pair, each with its whole message.

A message has to stand at the file, line and key that is wrong, and to say by how much and what would fit. The last
tests follow what the messages advise, and hold them to it.
"""

import re
from pathlib import Path

import pytest
from editing import SCAN, SCANNER, edited, run, write_pair
from hypothesis import given, settings
from hypothesis import strategies as st

from tablegen.base.input_errors import Rejected
from tablegen.config.load import load
from tablegen.planning.line_plan import make_plan

REMOVED_RESONANCE = ("- x.resonance.frequency_hz", "- x.resonance.quality", "- x.resonance.delay_s")


def case(
    *scan: str, scanner: str | tuple[str, ...] = (), response: str | None = None, says: str | list[str], status: int = 2
) -> object:
    """Edits of both files, a response file or none, the messages in the order of the alphabet, and the status."""
    edits = (scanner,) if isinstance(scanner, str) else scanner
    if response is not None:
        edits = measured("'r.csv'")
    told = [says] if isinstance(says, str) else says
    name = "; ".join([*scan, *edits] if response is None else [repr(response)])
    return pytest.param(scan, edits, response, told, status, id=ascii(name[:80]).strip("'\""))


def measured(file: str) -> tuple[str, ...]:
    """The scanner with a measured response in place of the second-order one."""
    return (*REMOVED_RESONANCE, f"x.resonance.response = {file}")


def points(text: str) -> tuple[str, ...]:
    """The scanner with measured sizes in place of the two ends."""
    return ("- x.offset.m_minus", "- x.offset.m_plus", f"x.offset.points = [{text}]")


TYPES = [
    case("dac.bits = '16'", says="scan.toml:6: dac.bits: '16' is not a whole number"),
    case("dac.bits = 16.0", says="scan.toml:6: dac.bits: 16.0 has to be written 16"),
    case("dac.bits = 16.5", says="scan.toml:6: dac.bits: 16.5 is not a whole number"),
    case("dac.bits = true", says="scan.toml:6: dac.bits: true is not a whole number"),
    case("dac.bits = [16]", says="scan.toml:6: dac.bits: an array of 1 is not a whole number"),
    case("dac.bits = 1979-05-27", says="scan.toml:6: dac.bits: the date or time 1979-05-27 is not a whole number"),
    case("dac.bits = 07:32:00", says="scan.toml:6: dac.bits: the date or time 07:32:00 is not a whole number"),
    case("dac.v_min = '-5'", says="scan.toml:8: dac.v_min: '-5' is not a number"),
    case("dac.v_min = nan", says="scan.toml:8: dac.v_min: nan is not a finite number"),
    case("dac.v_min = -inf", says="scan.toml:8: dac.v_min: -inf is not a finite number"),
    case("dac.v_max = inf", says="scan.toml:9: dac.v_max: inf is not a finite number"),
    case("dac.v_min = true", says="scan.toml:8: dac.v_min: true is not a number"),
    case("dac.v_max = {}", says="scan.toml:9: dac.v_max: a table is not a number"),
    case("dac.coding = 1", says="scan.toml:7: dac.coding: 1 is not one of 'offset-binary', 'twos-complement'"),
    case("timing.pixels = 200.5", says="scan.toml:18: timing.pixels: 200.5 is not a whole number"),
    case("name = 7", says="scan.toml:2: name: 7 is not a text in quotes"),
    case("scanner = 5", says="scan.toml:3: scanner: 5 is not a text in quotes"),
    case("x.band_limit.window = 0.8", says="scan.toml:30: x.band_limit.window: 0.8 is not an array of 2 numbers"),
    case("x.band_limit.window = [0.1, 'b']", says="scan.toml:30: x.band_limit.window[1]: 'b' is not a number"),
    case(
        "x.band_limit.window = [0.1]",
        says="scan.toml:30: x.band_limit.window: an array of 1 is not an array of 2 numbers",
    ),
    case(
        "x.band_limit.window = [0.1, 0.5, 0.9]",
        says="scan.toml:30: x.band_limit.window: an array of 3 is not an array of 2 numbers",
    ),
    case("- [x.table]", "x.table = 5", says="scan.toml:23: x.table: 5 is not a table"),
    case("- [limits]", "+ [emit]\nheader_only = 1", says="scan.toml:55: emit.header_only: 1 is not true or false"),
    case(scanner="v_max = '100'", says="scanner.toml:3: v_max: '100' is not a number"),
    case(
        scanner="x.hysteresis.branches.forward = 0.037",
        says="scanner.toml:20: x.hysteresis.branches[0].forward: 0.037 is not a table",
    ),
    case(
        scanner=("- [[x.hysteresis.branches]]", "x.hysteresis.branches = {}"),
        says="scanner.toml:16: x.hysteresis.branches: a table is not an array",
    ),
    case(
        scanner=points("{ offset_v = 10, apparent_nm = 200 }, { offset_v = 20, apparent_nm = 201 }, 3"),
        says="scanner.toml:6: x.offset.points[2]: 3 is not a table",
    ),
    case(scanner="name = ['hs-afm']", says="scanner.toml:2: name: an array of 1 is not a text in quotes"),
]

RANGES = [
    case("dac.bits = 7", says="scan.toml:6: dac.bits: 7 is below 8"),
    case("dac.bits = 25", says="scan.toml:6: dac.bits: 25 is above 24"),
    case("dac.v_min = -1e6", says="scan.toml:8: dac.v_min: -1000000 is below -100000"),
    case("dac.v_max = 100001", says="scan.toml:9: dac.v_max: 100001 is above 100000"),
    case("dac.word_bits = 7", says="scan.toml:6: dac.word_bits: 7 is below 8"),
    case("dac.word_bits = 33", says="scan.toml:6: dac.word_bits: 33 is above 32"),
    case("dac.update_rate_hz = 0.5", says="scan.toml:10: dac.update_rate_hz: 0.5 is below 1"),
    case("dac.update_rate_hz = 2e9", says="scan.toml:10: dac.update_rate_hz: 2000000000 is above 1000000000"),
    case("amplifier.gain = -20000", says="scan.toml:13: amplifier.gain: -20000 is below -10000"),
    case(
        "amplifier.gain = 1e-5", says="scan.toml:13: amplifier.gain: 1e-05 is no gain; at least 1e-4 in size is needed"
    ),
    case("amplifier.bias_v = 1e6", says="scan.toml:14: amplifier.bias_v: 1000000 is above 100000"),
    case("amplifier.max_slew_v_per_s = 0", says="scan.toml:15: amplifier.max_slew_v_per_s: 0 is below 0.001"),
    case("amplifier.max_slew_v_per_s = 1e13", says="scan.toml:15: amplifier.max_slew_v_per_s: 1e+13 is above 1e+12"),
    case("timing.pixels = 0", says="scan.toml:18: timing.pixels: 0 is below 1"),
    case("timing.pixels = 70000", says="scan.toml:18: timing.pixels: 70000 is above 65536"),
    case("timing.lines = -1", says="scan.toml:19: timing.lines: -1 is below 1"),
    case("timing.lines = 65537", says="scan.toml:19: timing.lines: 65537 is above 65536"),
    case("timing.settle_lines = -1", says="scan.toml:18: timing.settle_lines: -1 is below 0"),
    case("timing.settle_lines = 256", says="scan.toml:18: timing.settle_lines: 256 is above 255"),
    case("timing.line_rate_hz = 0", says="scan.toml:20: timing.line_rate_hz: 0 is below 0.001"),
    case("timing.line_rate_hz = 2e6", says="scan.toml:20: timing.line_rate_hz: 2000000 is above 1000000"),
    case("timing.ticks_per_line = 7", says="scan.toml:18: timing.ticks_per_line: 7 is below 8"),
    case("timing.ticks_per_line = 16777217", says="scan.toml:18: timing.ticks_per_line: 16777217 is above 16777216"),
    case("timing.ticks_per_pixel = 0", says="scan.toml:18: timing.ticks_per_pixel: 0 is below 1"),
    case(
        "timing.ticks_per_pixel = 0x" + 300 * "f",
        says="scan.toml:18: timing.ticks_per_pixel: a whole number of 1200 bits is above 1048576",
    ),
    case("x.turn = 0", says="scan.toml:25: x.turn: 0 is not above 0"),
    case("x.turn = 1.0", says="scan.toml:25: x.turn: 1 is not below 1"),
    case("x.turn = 1.0000000000001", says="scan.toml:25: x.turn: 1.0000000000001 is not below 1"),
    case("x.size_nm = 0", says="scan.toml:23: x.size_nm: 0 is below 1e-06"),
    case("x.size_nm = 2e9", says="scan.toml:23: x.size_nm: 2000000000 is above 1000000000"),
    case("- x.size_nm", "x.size_v = 0", says="scan.toml:23: x.size_v: 0 is below 0.001"),
    case(
        "- x.offset_v",
        "x.offset_nm = -1",
        says="scan.toml:23: x.offset_nm: -1 nm is outside the 0..980.98 nm that 0..100 V reach",
    ),
    case("x.park_v = 2e5", says="scan.toml:23: x.park_v: 200000 is above 100000"),
    case("x.band_limit.window = [-0.1, 0.9]", says="scan.toml:30: x.band_limit.window[0]: -0.1 is below 0"),
    case("x.band_limit.window = [0.1, 1.1]", says="scan.toml:30: x.band_limit.window[1]: 1.1 is above 1"),
    case("x.band_limit.harmonics = 0", says="scan.toml:29: x.band_limit.harmonics: 0 is below 1"),
    case("x.band_limit.harmonics = 513", says="scan.toml:29: x.band_limit.harmonics: 513 is above 512"),
    case(
        "- x.band_limit.harmonics",
        "x.band_limit.cutoff_hz = 1e-7",
        says="scan.toml:28: x.band_limit.cutoff_hz: 1e-07 is below 1e-06",
    ),
    case("x.table.length = 2", says="scan.toml:35: x.table.length: 2 is below 4"),
    case("x.table.length = 131072", says="scan.toml:35: x.table.length: 131072 is above 65536"),
    case("x.table.bits = 4", says="scan.toml:36: x.table.bits: 4 is below 8"),
    case("x.table.bits = 30", says="scan.toml:36: x.table.bits: 30 is above 24"),
    case("limits.max_error_lsb = 0", says="scan.toml:55: limits.max_error_lsb: 0 is not above 0"),
    case(
        "limits.max_scaling_error_percent = 1001",
        says="scan.toml:56: limits.max_scaling_error_percent: 1001 is above 1000",
    ),
    case(scanner="v_max = 0", says="scanner.toml:3: v_max: 0 is below 0.001"),
    case(scanner="v_max = 1e6", says="scanner.toml:3: v_max: 1000000 is above 100000"),
    case(scanner="x.offset.m_minus = 0.05", says="scanner.toml:6: x.offset.m_minus: 0.05 is below 0.1"),
    case(scanner="x.offset.m_plus = 11", says="scanner.toml:7: x.offset.m_plus: 11 is above 10"),
    case(
        scanner=("- x.offset.m_minus", "- x.offset.m_plus", "x.offset.alpha = -2", "x.offset.beta = 2"),
        says=["scanner.toml:6: x.offset.beta: 2 is above 1", "scanner.toml:7: x.offset.alpha: -2 is below -1"],
    ),
    case(
        scanner=points(
            "{ offset_v = 10, apparent_nm = 200 }, { offset_v = 20, apparent_nm = 0 }, { offset_v = 2e5, "
            "apparent_nm = 201 }"
        ),
        says=[
            "scanner.toml:6: x.offset.points[1].apparent_nm: 0 is below 1e-06",
            "scanner.toml:6: x.offset.points[2].offset_v: 200000 is above 100000",
        ],
    ),
    case(scanner="x.size.k_nm_per_v = 0", says="scanner.toml:10: x.size.k_nm_per_v: 0 is below 1e-06"),
    case(scanner="x.size.k_nm_per_v = 1e7", says="scanner.toml:10: x.size.k_nm_per_v: 10000000 is above 1000000"),
    case(scanner="x.size.beta = -0.5", says="scanner.toml:11: x.size.beta: -0.5 is not above -0.5"),
    case(scanner="x.size.beta = 101", says="scanner.toml:11: x.size.beta: 101 is above 100"),
    case(scanner="x.size.base_nm = 0", says="scanner.toml:12: x.size.base_nm: 0 is below 1e-06"),
    case(scanner="x.size.v_threshold = 0", says="scanner.toml:13: x.size.v_threshold: 0 is not above 0"),
    case(scanner="x.size.v_threshold = 1.5", says="scanner.toml:13: x.size.v_threshold: 1.5 is above 1"),
    case(
        scanner="x.hysteresis.branches.turn = 1.5",
        says="scanner.toml:19: x.hysteresis.branches[0].turn: 1.5 is not below 1",
    ),
    case(
        scanner="x.hysteresis.branches.forward = { beta_max = 0.5, rho = 4.0, u_peak = 0.37 }",
        says="scanner.toml:20: x.hysteresis.branches[0].forward.beta_max: 0.5 is not below 0.5",
    ),
    case(
        scanner="x.hysteresis.branches.forward = { beta_max = -0.1, rho = 0, u_peak = 1.0 }",
        says=[
            "scanner.toml:20: x.hysteresis.branches[0].forward.beta_max: -0.1 is below 0",
            "scanner.toml:20: x.hysteresis.branches[0].forward.rho: 0 is below 1e-06",
            "scanner.toml:20: x.hysteresis.branches[0].forward.u_peak: 1 is not below 1",
        ],
    ),
    case(
        scanner="x.hysteresis.branches.backward = { beta_max = 0.08, rho = 101, u_peak = 0.0 }",
        says=[
            "scanner.toml:21: x.hysteresis.branches[0].backward.rho: 101 is above 100",
            "scanner.toml:21: x.hysteresis.branches[0].backward.u_peak: 0 is not above 0",
        ],
    ),
    case(scanner="x.frequency.alpha = -0.1", says="scanner.toml:24: x.frequency.alpha: -0.1 is below 0"),
    case(scanner="x.frequency.alpha = 0.6", says="scanner.toml:24: x.frequency.alpha: 0.6 is above 0.5"),
    case(scanner="x.frequency.reference_hz = 0", says="scanner.toml:25: x.frequency.reference_hz: 0 is below 1e-06"),
    case(
        scanner="x.resonance.frequency_hz = 1e11",
        says="scanner.toml:28: x.resonance.frequency_hz: 100000000000 is above 10000000000",
    ),
    case(scanner="x.resonance.quality = 0.01", says="scanner.toml:29: x.resonance.quality: 0.01 is below 0.1"),
    case(scanner="x.resonance.quality = 1e6", says="scanner.toml:29: x.resonance.quality: 1000000 is above 100000"),
    case(scanner="x.resonance.delay_s = -1", says="scanner.toml:30: x.resonance.delay_s: -1 is below 0"),
    case(scanner="x.resonance.delay_s = 2", says="scanner.toml:30: x.resonance.delay_s: 2 is above 1"),
    case(scanner="x.resonance.max_boost_db = -1", says="scanner.toml:31: x.resonance.max_boost_db: -1 is below 0"),
    case(scanner="x.resonance.max_boost_db = 61", says="scanner.toml:31: x.resonance.max_boost_db: 61 is above 60"),
]

KEYS = [
    case("nmae = 'a'", says="scan.toml:1: nmae: unknown key; name is given as well"),
    case("- name", "nmae = 'a'", says="scan.toml:1: nmae: unknown key; did you mean name?"),
    case(
        "wholly_different = 1",
        says=(
            "scan.toml:1: wholly_different: unknown key; known here: amplifier, angle_deg, aux, cost, dac, "
            "drift_nm_per_s, emit, image_nm, image_um, limits, name, scanner, scans, timing, x, y, z"
        ),
    ),
    case("+ [emti]\nheader_only = true", says="scan.toml:57: emti: unknown key; did you mean emit?"),
    case(
        "- [limits]",
        '+ ["we.ird \\"key\\""]\na = 1',
        says=(
            'scan.toml:54: "we.ird \\"key\\"": unknown key; known here: amplifier, angle_deg, aux, cost, dac, '
            "drift_nm_per_s, emit, image_nm, image_um, limits, name, scanner, scans, timing, x, y, z"
        ),
    ),
    case(
        "- dac.update_rate_hz",
        "dac.update_rate_khz = 500.0",
        says="scan.toml:6: dac.update_rate_khz: unknown key; did you mean update_rate_hz?",
    ),
    case(
        "- dac.update_rate_hz",
        "dac.update_rate = 500e3",
        says=("scan.toml:6: dac.update_rate: unknown key; did you mean update_rate_hz? (units are part of the name)"),
    ),
    case(
        "dac.update_rate_khz = 500",
        says="scan.toml:6: dac.update_rate_khz: unknown key; update_rate_hz is given as well",
    ),
    case(
        "amplifier.max_slew_v_per_us = 2",
        says="scan.toml:13: amplifier.max_slew_v_per_us: unknown key; max_slew_v_per_s is given as well",
    ),
    case(
        "- amplifier.max_slew_v_per_s",
        "amplifier.max_slew = 2e6",
        says=(
            "scan.toml:13: amplifier.max_slew: unknown key; did you mean max_slew_v_per_s? (units are part of the name)"
        ),
    ),
    case(
        "- x.size_nm",
        "x.size = 200",
        says="scan.toml:23: x.size: unknown key; did you mean size_nm or size_v? (units are part of the name)",
    ),
    case(
        "- x.size_nm", "x.size_pm = 0.2", says="scan.toml:23: x.size_pm: unknown key; did you mean size_nm or size_v?"
    ),
    case("- x.size_nm", "x.siez_nm = 200.0", says="scan.toml:23: x.siez_nm: unknown key; did you mean size_nm?"),
    case(
        "- x.offset_v",
        "x.offset = 50",
        says=("scan.toml:23: x.offset: unknown key; did you mean offset_v or offset_nm? (units are part of the name)"),
    ),
    case(
        "x.motion = 'step'",
        says="scan.toml:23: x.motion: 'step' is not one of 'auto', 'line', 'sine'",
    ),
    case(
        "x.motion = 'sine'",
        "- x.band_limit.harmonics",
        says=(
            "scan.toml:23: x.motion: a sine needs an operator, which says where the piezo is, and x has the model "
            "'harmonic'; `tablegen calibrate operator` makes one, or take 'line'"
        ),
    ),
    case(
        "- x.band_limit.harmonics",
        "x.band_limit.cutoff = 12800.0",
        says=("scan.toml:28: x.band_limit.cutoff: unknown key; did you mean cutoff_hz? (units are part of the name)"),
    ),
    case("limits.max_error = 1", says="scan.toml:55: limits.max_error: unknown key; max_error_lsb is given as well"),
    case("- dac.bits", says="scan.toml:5: dac.bits: missing; this key is required"),
    case("- timing.lines", says="scan.toml:17: timing.lines: missing; give lines or image_lines"),
    case("- [dac]", says="scan.toml:1: dac: missing; this table is required, here or in the scanner file"),
    case("- [timing]", says="scan.toml:1: timing: missing; this table is required"),
    case("- name", says="scan.toml:1: name: missing; this key is required"),
    case("- scanner", says="scan.toml:1: scanner: missing; this key is required"),
    case(scanner="- name", says="scanner.toml:1: name: missing; this key is required"),
    case(scanner=("- v_max", "vmax = 100"), says="scanner.toml:1: vmax: unknown key; did you mean v_max?"),
    case(scanner="- [y.size]", says="scanner.toml:33: y.size: missing; this table is required"),
    case(scanner="- x.size.k_nm_per_v", says="scanner.toml:9: x.size.k_nm_per_v: missing; this key is required"),
    case(
        scanner=("- x.size.k_nm_per_v", "x.size.k = 10"),
        says="scanner.toml:10: x.size.k: unknown key; did you mean k_nm_per_v? (units are part of the name)",
    ),
    case(
        scanner=("- [y.size]", "- [y.offset]", "- [y.hysteresis]", "- [[y.hysteresis.branches]]", "- [y.frequency]"),
        says="scanner.toml:1: y: missing; this table is required",
    ),
    case(
        scanner="- x.hysteresis.branches.turn",
        says="scanner.toml:18: x.hysteresis.branches[0].turn: missing; this key is required",
    ),
    case(
        scanner="x.hysteresis.branches.forward = { rho = 4.0, u_peak = 0.4 }",
        says=(
            "scanner.toml:20: x.hysteresis.branches[0].forward.beta_max: missing; give beta_max, rho and u_peak of "
            "(22), or points"
        ),
    ),
    case(
        scanner="- x.frequency.reference_hz",
        says="scanner.toml:23: x.frequency.reference_hz: missing; this key is required",
    ),
    case(
        scanner="x.resonance.delay_ms = 1",
        says="scanner.toml:28: x.resonance.delay_ms: unknown key; delay_s is given as well",
    ),
    case(
        scanner=points(
            "{ offset_v = 10, apparent = 200 }, { offset_v = 20, apparent_nm = 201 }, { offset_v = 90, "
            "apparent_nm = 202 }"
        ),
        says=(
            "scanner.toml:6: x.offset.points[0].apparent: unknown key; did you mean apparent_nm? (units are "
            "part of the name)"
        ),
    ),
]

CHOICES = [
    case(
        "dac.coding = 'gray'", says="scan.toml:7: dac.coding: 'gray' is not one of 'offset-binary', 'twos-complement'"
    ),
    case("dac.align = 'middle'", says="scan.toml:6: dac.align: 'middle' is not one of 'left', 'right'"),
    case("x.size_of = 'frame'", says="scan.toml:23: x.size_of: 'frame' is not one of 'line', 'window'"),
    case(
        "x.band_limit.harmonics = 'few'",
        says="scan.toml:29: x.band_limit.harmonics: 'few' is not a number, nor 'fewest'",
    ),
    case(
        "x.band_limit.max_scaling_error_percent = 0.0",
        says="scan.toml:28: x.band_limit.max_scaling_error_percent: 0 is below 0.001",
    ),
    case(
        "x.band_limit.max_scaling_error_percent = 11.0",
        says="scan.toml:28: x.band_limit.max_scaling_error_percent: 11 is above 10",
    ),
    case(
        "x.band_limit.method = 'lanczos'",
        "x.band_limit.max_scaling_error_percent = 0.1",
        says="scan.toml:28: x.band_limit.max_scaling_error_percent: method = 'lanczos' keeps no scaling error; take "
        "method = 'window'",
    ),
    case(
        "x.band_limit.method = 'truncate'",
        "x.band_limit.harmonics = 'fewest'",
        says="scan.toml:29: x.band_limit.harmonics: method = 'truncate' keeps no scaling error; take method = 'window'",
    ),
    case(
        "x.band_limit.max_scaling_error_percent = 0.1",
        "x.band_limit.harmonics = 16",
        says="scan.toml:28: x.band_limit.max_scaling_error_percent: 16 harmonics leave 0.621 % of scaling error in "
        "this window; allow that much, or take 21 harmonics",
    ),
    case(
        "x.band_limit.max_scaling_error_percent = 0.1",
        "x.band_limit.window = [0.0, 1.0]",
        says="scan.toml:28: x.band_limit.max_scaling_error_percent: 32 harmonics leave 217 % of scaling error in this "
        "window; image a narrower one",
    ),
    case(
        "x.band_limit.max_scaling_error_percent = 0.1",
        "- x.band_limit.harmonics",
        "x.band_limit.window = [0.0, 1.0]",
        says="scan.toml:28: x.band_limit.max_scaling_error_percent: an end of the line is imaged, where it turns; "
        "image a narrower window",
    ),
    case(
        "x.band_limit.method = 'boxcar'",
        says="scan.toml:28: x.band_limit.method: 'boxcar' is not one of 'lanczos', 'truncate', 'window'",
    ),
    case(
        "x.band_limit.directions = 'backward'",
        says="scan.toml:31: x.band_limit.directions: 'backward' is not one of 'both', 'forward'",
    ),
    case(
        "x.table.mode = 'quadratic'",
        says="scan.toml:34: x.table.mode: 'quadratic' is not one of 'auto', 'cubic', 'direct', 'interpolated'",
    ),
    case(
        "x.table.mode = 'cubic'",
        "x.table.bits = 24",
        says="scan.toml:36: x.table.bits: 24 is above the 21 of mode = 'cubic'",
    ),
    case(
        "x.table.mode = 'cubic'",
        "x.table.length = 32768",
        says="scan.toml:35: x.table.length: 32768 is above the 16384 of mode = 'cubic'",
    ),
    case("y.motion = 'jump'", says="scan.toml:39: y.motion: 'jump' is not one of 'off', 'ramp', 'step'"),
    case(
        scanner="x.hysteresis.model = 'preisach'",
        says="scanner.toml:16: x.hysteresis.model: 'preisach' is not one of "
        "'harmonic', 'operator', 'sinusoidal', 'triangle'",
    ),
]

NAMES = [
    case("name = ''", says="scan.toml:2: name: is empty"),
    case(
        "name = '1st'",
        says=(
            "scan.toml:2: name: '1st' is no identifier; accepted is a letter, then letters, digits and single "
            "underscores"
        ),
    ),
    case(
        "name = 'a-b'",
        says=(
            "scan.toml:2: name: 'a-b' is no identifier; accepted is a letter, then letters, digits and single "
            "underscores"
        ),
    ),
    case(
        "name = 'a__b'",
        says=(
            "scan.toml:2: name: 'a__b' is reserved in C++ or refused by VHDL; accepted is a letter, then "
            "letters, digits and single underscores, none at the end"
        ),
    ),
    case(
        "name = 'a_'",
        says=(
            "scan.toml:2: name: 'a_' is reserved in C++ or refused by VHDL; accepted is a letter, then "
            "letters, digits and single underscores, none at the end"
        ),
    ),
    case("name = '" + 49 * "n" + "'", says="scan.toml:2: name: 49 characters are too many, at most 48 are taken"),
    case(
        "name = 'mü'",
        says=(
            "scan.toml:2: name: 'mü' is no identifier; accepted is a letter, then letters, digits and single "
            "underscores"
        ),
    ),
    case(
        "name = 'restrict'",
        says="scan.toml:2: name: 'restrict' is a reserved word of C, C++, Verilog, SystemVerilog or VHDL",
    ),
    case(
        "name = 'template'",
        says="scan.toml:2: name: 'template' is a reserved word of C, C++, Verilog, SystemVerilog or VHDL",
    ),
    case(
        "name = 'wire'", says="scan.toml:2: name: 'wire' is a reserved word of C, C++, Verilog, SystemVerilog or VHDL"
    ),
    case(
        "name = 'logic'", says="scan.toml:2: name: 'logic' is a reserved word of C, C++, Verilog, SystemVerilog or VHDL"
    ),
    case(
        "name = 'process'",
        says="scan.toml:2: name: 'process' is a reserved word of C, C++, Verilog, SystemVerilog or VHDL",
    ),
    case(
        "name = 'Process'",
        says="scan.toml:2: name: 'Process' is a reserved word of C, C++, Verilog, SystemVerilog or VHDL",
    ),
    case("scanner = ''", says="scan.toml:3: scanner: is empty"),
    case(
        "scanner = 'absent.toml'",
        says="scan.toml:3: scanner: absent.toml is not a file; the path is relative to this file",
    ),
    case("scanner = '.'", says="scan.toml:3: scanner: . is not a file; the path is relative to this file"),
    case(
        'scanner = "a\\u0000b"', says="scan.toml:3: scanner: 'a\\x00b' is not a file; the path is relative to this file"
    ),
    case(
        "scanner = '" + 300 * "s" + "'",
        says="scan.toml:3: scanner: "
        + 100 * "s"
        + "..."
        + 97 * "s"
        + " is not a file; the path is relative to this file",
    ),
    case(
        "scanner = '" + 1025 * "s" + "'",
        says="scan.toml:3: scanner: 1025 characters are too many, at most 1024 are taken",
    ),
    case(scanner="name = ''", says="scanner.toml:2: name: is empty"),
]

ALTERNATIVES = [
    case("x.size_v = 20", says="scan.toml:23: x.size_v: size_nm is given as well; keep one of the two"),
    case("- x.size_nm", says="scan.toml:22: x: missing; give size_nm or size_v"),
    case("x.offset_nm = 5", says="scan.toml:23: x.offset_nm: offset_v is given as well; keep one of the two"),
    case("- y.offset_v", says="scan.toml:38: y: missing; give offset_v or offset_nm"),
    case(
        "timing.ticks_per_line = 1250",
        "timing.ticks_per_pixel = 5",
        says="scan.toml:18: timing.ticks_per_pixel: ticks_per_line is given as well; keep one of the two",
    ),
    case(
        "x.band_limit.cutoff_hz = 12800.0",
        says="scan.toml:28: x.band_limit.cutoff_hz: harmonics is given as well; keep one of the two",
    ),
    case(
        "- x.size_nm",
        "x.size_v = 20",
        "x.size_of = 'window'",
        says="scan.toml:23: x.size_of: only a size in nm can be that of the window; size_v is the drive's",
    ),
    case(
        scanner=("- x.offset.m_minus", "- x.offset.m_plus"),
        says="scanner.toml:5: x.offset: missing; give m_minus and m_plus, or alpha and beta, or points, or sizes",
    ),
    case(
        scanner="x.offset.alpha = 0.1",
        says="scanner.toml:6: x.offset.alpha: m_minus is given as well; keep one of the ways",
    ),
    case(scanner="- x.offset.m_plus", says="scanner.toml:5: x.offset.m_plus: missing beside m_minus"),
    case(
        scanner=("- x.offset.m_minus", "- x.offset.m_plus", "x.offset.alpha = 0.1"),
        says="scanner.toml:5: x.offset.beta: missing beside alpha",
    ),
    case(
        scanner="x.offset.points = []",
        says=[
            "scanner.toml:6: x.offset.points: 0 entries are too few, at least 3 are needed",
            "scanner.toml:6: x.offset.points: m_minus is given as well; keep one of the ways",
        ],
    ),
    case(
        scanner="x.resonance.response = 'r.csv'",
        says="scanner.toml:29: x.resonance.frequency_hz: response is given as well; keep one of the two",
    ),
    case(
        scanner=("- x.resonance.frequency_hz", "- x.resonance.quality", "x.resonance.response = 'r.csv'"),
        says="scanner.toml:29: x.resonance.delay_s: response is given as well; keep one of the two",
    ),
    case(scanner="- x.resonance.quality", says="scanner.toml:27: x.resonance.quality: missing beside frequency_hz"),
    case(
        scanner="- x.resonance.frequency_hz", says="scanner.toml:27: x.resonance.frequency_hz: missing beside quality"
    ),
    case(
        scanner=("- x.resonance.frequency_hz", "- x.resonance.quality"),
        says="scanner.toml:27: x.resonance: missing; give frequency_hz and quality, or response",
    ),
    case("dac.v_max = -5", says="scan.toml:9: dac.v_max: -5 V is not above v_min = -5 V"),
    case(
        "dac.v_max = -4.9995",
        says="scan.toml:9: dac.v_max: 0.0005 V above v_min is no range; at least 0.001 V is needed",
    ),
    case("dac.word_bits = 12", says="scan.toml:6: dac.word_bits: 12 is below bits = 16; the code would not fit"),
    case("x.band_limit.window = [0.9, 0.1]", says="scan.toml:30: x.band_limit.window: [0.9, 0.1] does not ascend"),
    case(
        "x.band_limit.window = [0.5, 0.505]",
        says="scan.toml:30: x.band_limit.window: [0.5, 0.505] is narrower than 0.01 of the line",
    ),
    case(
        "x.table.length = 1000",
        says="scan.toml:35: x.table.length: 1000 is not a power of two; the nearest are 512 and 1024",
    ),
    case(
        scanner="- [[x.hysteresis.branches]]",
        says="scanner.toml:15: x.hysteresis.branches: missing; the harmonic model needs a calibrated branch",
    ),
    case(
        scanner="x.hysteresis.branches.forward = { beta_max = 0.037, rho = 4.0 }",
        says="scanner.toml:20: x.hysteresis.branches[0].forward.u_peak: missing; the harmonic model needs it",
    ),
    case(
        scanner="x.hysteresis.branches.forward = { points = [{ size_v = 20.0, beta = 0.02 }] }",
        says="scanner.toml:20: x.hysteresis.branches[0].forward.points[0].u_peak: missing; the harmonic model needs it",
    ),
    case(
        scanner=(
            "x.hysteresis.branches.forward = { rho = 4.0, points = [{ size_v = 20, beta = 0.02, u_peak = 0.5 },"
            " { size_v = 20, beta = 0.03, u_peak = 0.5 }] }"
        ),
        says=[
            "scanner.toml:20: x.hysteresis.branches[0].forward.points[1].size_v: 20 V is measured twice",
            "scanner.toml:20: x.hysteresis.branches[0].forward.rho: points is given as well; keep one of the two",
        ],
    ),
    case(
        scanner=(
            "+ [[y.hysteresis.branches]]\nturn = 0.95\nforward = { beta_max = 0.037, rho = 4.0, u_peak = 0.37 }\n"
            "backward = { beta_max = 0.037, rho = 4.0, u_peak = 0.37 }"
        ),
        says="scanner.toml:55: y.hysteresis.branches[1].turn: 0.95 is calibrated twice",
    ),
]

DRIVE = [
    case(
        "x.offset_v = 5.0",
        says=(
            "scan.toml:23: x.size_nm: the drive spans -3.8956..13.8805 V, 3.896 V outside the driver's 0..100 "
            "V; an offset of 9 to 88.6 V fits, or at this offset a line of about 106 nm"
        ),
    ),
    case(
        "x.offset_v = 97.0",
        says=(
            "scan.toml:23: x.size_nm: the drive spans 85.1095..108.8703 V, 8.87 V outside the driver's 0..100 "
            "V; an offset of 9 to 88.6 V fits, or at this offset a line of about 46.4 nm"
        ),
    ),
    case(
        "y.offset_v = 0",
        says=(
            "scan.toml:39: y.size_nm: the drive spans -8.3304..8.4018 V, 8.33 V outside the driver's 0..100 V; "
            "an offset of 8.5 to 89.1 V fits, at this one nothing"
        ),
    ),
    case("x.offset_v = -1", says="scan.toml:24: x.offset_v: -1 V is outside the driver's 0..100 V, by 1 V"),
    case("x.offset_v = 100.5", says="scan.toml:24: x.offset_v: 100.5 V is outside the driver's 0..100 V, by 0.5 V"),
    case(
        "- x.offset_v",
        "x.offset_nm = 40",
        says=(
            "scan.toml:24: x.size_nm: the drive spans -5.2132..12.5579 V, 5.213 V outside the driver's 0..100 "
            "V; an offset of 9 to 88.6 V fits, or at this offset a line of about 77.2 nm"
        ),
    ),
    case(
        "- x.offset_v",
        "x.offset_nm = 1100",
        says="scan.toml:23: x.offset_nm: 1100 nm is outside the 0..980.98 nm that 0..100 V reach",
    ),
    case(
        "- x.size_nm",
        "x.size_v = 20",
        "x.offset_v = 5.0",
        says=(
            "scan.toml:23: x.size_v: the drive spans -3.8956..13.8805 V, 3.896 V outside the driver's 0..100 "
            "V; an offset of 9 to 88.6 V fits, or at this offset about 11.1 V"
        ),
    ),
    case(
        "x.size_of = 'window'",
        "x.offset_v = 5.0",
        says=(
            "scan.toml:24: x.size_nm: the drive spans -5.8844..15.8608 V, 5.884 V outside the driver's 0..100 "
            "V; an offset of 11 to 86.2 V fits, or at this offset a window of about 85.2 nm"
        ),
    ),
    case("x.size_nm = 1350.0", says="scan.toml:23: x.size_nm: 1350 nm needs 1.062 of v_max; at most 1263.56 nm fit"),
    case(
        "x.size_nm = 1100.0",
        "x.size_of = 'window'",
        says=(
            "scan.toml:24: x.size_nm: its line of 1375 nm needs 1.081 of v_max; at most 1263.56 nm fit, a "
            "window of 1010.84 nm"
        ),
    ),
    case("- x.size_nm", "x.size_v = 120", says="scan.toml:23: x.size_v: 120 V is above v_max = 100 V"),
    case(
        "x.size_nm = 1200.0",
        "x.offset_v = 70.0",
        says=(
            "scan.toml:23: x.size_nm: the drive spans 20.2876..119.3434 V, 19.34 V outside the driver's 0..100 "
            "V; an offset of 45.4 to 53.7 V fits, or at this offset a line of about 674 nm"
        ),
    ),
    case("x.park_v = -1", says="scan.toml:23: x.park_v: -1 V is outside the driver's 0..100 V, by 1 V"),
    case("y.park_v = 101", says="scan.toml:39: y.park_v: 101 V is outside the driver's 0..100 V, by 1 V"),
    case(
        "x.park_v = 0",
        "amplifier.gain = 8.0",
        says="scan.toml:23: x.park_v: 0 V is outside the 10..89.9988 V that the converter reaches",
    ),
    case(
        "amplifier.gain = 1.0",
        says=[
            (
                "scan.toml:13: amplifier.gain: the x drive of 40.3346..59.6491 V needs -9.6654..9.6491 V of the "
                "converter, 4.665 V beyond its -5..4.99985 V; a gain of 1.932 with a bias_v of 49.992 V would "
                "carry it, or scan less"
            ),
            (
                "scan.toml:13: amplifier.gain: the y drive of 40.7440..59.3354 V needs -9.2560..9.3354 V of the "
                "converter, 4.336 V beyond its -5..4.99985 V; a gain of 1.86 with a bias_v of 50.0398 V would "
                "carry it, or scan less"
            ),
        ],
    ),
    case(
        "amplifier.bias_v = 0.0",
        "y.size_nm = 20.0",
        says=[
            (
                "scan.toml:13: amplifier.gain: the x drive of 40.3346..59.6491 V needs 4.0335..5.9649 V of the "
                "converter, 0.9651 V beyond its -5..4.99985 V; a gain of 1.932 with a bias_v of 49.992 V would "
                "carry it, or scan less"
            ),
            (
                "scan.toml:13: amplifier.gain: the y drive of 48.9692..51.0322 V needs 4.8969..5.1032 V of the "
                "converter, 0.1034 V beyond its -5..4.99985 V; a gain of 0.2064 with a bias_v of 50.0007 V would "
                "carry it, or scan less"
            ),
        ],
    ),
    case(
        "amplifier.gain = -1.0",
        "amplifier.bias_v = 45.0",
        says=[
            (
                "scan.toml:13: amplifier.gain: the x drive of 40.3346..59.6491 V needs -14.6491..4.6654 V of the "
                "converter, 9.649 V beyond its -5..4.99985 V; a gain of -1.932 with a bias_v of 49.9917 V would "
                "carry it, or scan less"
            ),
            (
                "scan.toml:13: amplifier.gain: the y drive of 40.7440..59.3354 V needs -14.3354..4.2560 V of the "
                "converter, 9.335 V beyond its -5..4.99985 V; a gain of -1.86 with a bias_v of 50.0395 V would "
                "carry it, or scan less"
            ),
        ],
    ),
    case(
        "x.size_nm = 0.001",
        says=(
            "scan.toml:23: x.size_nm: the drive of 0.000107 V is 0.0701 codes of the converter, which cannot "
            "draw a line; scan more, or use more dac.bits or less amplifier.gain"
        ),
    ),
    case(
        "y.size_nm = 0.01",
        says=(
            "scan.toml:39: y.size_nm: the drive of 0.001046 V is 0.685 codes of the converter, which cannot "
            "draw a line; scan more, or use more dac.bits or less amplifier.gain"
        ),
    ),
    case(
        "amplifier.max_slew_v_per_s = 9e3",
        says=(
            "scan.toml:20: timing.line_rate_hz: the x drive slews at 17773.2 V/s, 1.975 times the amplifier's "
            "9000 V/s; about 167.91 Hz or a line of 79.28 nm would fit"
        ),
    ),
    case(
        "amplifier.max_slew_v_per_s = 17900",
        says=(
            "scan.toml:20: timing.line_rate_hz: the x drive steps by up to 25 codes a tick with rounding, "
            "17900 V/s allow 23; about 373.96 Hz or a line of 185.8 nm would fit"
        ),
    ),
    case(
        "amplifier.max_slew_v_per_s = 100.0",
        says=[
            (
                "scan.toml:20: timing.line_rate_hz: the x drive slews at 17773.2 V/s, 177.7 times the amplifier's "
                "100 V/s; about 1.1252 Hz or a line of 0.5088 nm would fit"
            ),
            (
                "scan.toml:20: timing.line_rate_hz: the y drive slews at 493.067 V/s, 4.931 times the amplifier's "
                "100 V/s; about 40.562 Hz or a line of 18.32 nm would fit"
            ),
        ],
    ),
    case(
        "amplifier.max_slew_v_per_s = 1000.0",
        "timing.line_rate_hz = 10.0",
        says=[
            (
                "scan.toml:15: amplifier.max_slew_v_per_s: 1000 V/s are 1.31 codes of the x axis in a tick, and a "
                "line needs 2; an update_rate_hz of about 1.187e+05 or more dac.bits would fit"
            ),
            (
                "scan.toml:15: amplifier.max_slew_v_per_s: 1000 V/s are 1.31 codes of the y axis in a tick, and a "
                "line needs 2; an update_rate_hz of about 2.042e+05 or more dac.bits would fit"
            ),
        ],
    ),
    case(
        "amplifier.max_slew_v_per_s = 9e3",
        "timing.ticks_per_line = 1250",
        says=(
            "scan.toml:18: timing.ticks_per_line: the x drive slews at 17773.2 V/s, 1.975 times the "
            "amplifier's 9000 V/s; about 2978 ticks_per_line or a line of 79.28 nm would fit"
        ),
    ),
    case(
        "amplifier.max_slew_v_per_s = 9e3",
        "timing.ticks_per_pixel = 5",
        "timing.pixels = 100",
        says=(
            "scan.toml:18: timing.ticks_per_pixel: the x drive slews at 17773.2 V/s, 1.975 times the "
            "amplifier's 9000 V/s; about 12 ticks_per_pixel or a line of 79.28 nm would fit"
        ),
    ),
    case(
        "amplifier.max_slew_v_per_s = 5e4",
        "y.motion = 'step'",
        says=(
            "scan.toml:39: y.motion: the y axis steps by up to 810 codes in one tick, 50000 V/s allow 65; use "
            "motion = 'ramp'"
        ),
    ),
    case(
        "amplifier.max_slew_v_per_s = 2e4",
        "y.turn = 0.9",
        "timing.lines = 2",
        "y.band_limit.window = [0.01, 0.99]",
        "y.band_limit.harmonics = 16",
        "y.size_nm = 1000.0",
        says=(
            "scan.toml:46: y.band_limit.window: not one of the 2 lines lies inside it; widen it or take more "
            "timing.lines"
        ),
    ),
    case(
        scanner=("x.frequency.alpha = 0.5", "x.frequency.reference_hz = 1.0"),
        says=(
            "scanner.toml:24: x.frequency.alpha: at 400 Hz equation (23) leaves -0.301 of the amplitude; it "
            "was fitted to a few percent a decade and serves down to 0.5, that is up to 10 Hz"
        ),
    ),
]

HYSTERESIS = [
    case(
        scanner="x.hysteresis.branches.forward = { points = [{ size_v = 150, beta = 0.03, u_peak = 0.4 }] }",
        says="scanner.toml:20: x.hysteresis.branches[0].forward.points[0].size_v: 150 V is above v_max = 100 V",
    ),
    case(
        scanner="x.hysteresis.branches.backward = { points = [{ size_v = 9.5, beta = 0.03, u_peak = 0.4 }] }",
        says=(
            "scanner.toml:21: x.hysteresis.branches[0].backward.points: measured up to 9.5 V, which serves scans up to "
            "19.5 V; this one takes 20 V; measure a larger one"
        ),
    ),
    case(
        "x.size_nm = 900.0",
        scanner="x.hysteresis.branches.backward = { points = [{ size_v = 70, beta = 0.45, u_peak = 0.7 }] }",
        says=(
            "scanner.toml:21: x.hysteresis.branches[0].backward.points: beta = 0.45 at u_peak = 0.7 makes the branch "
            "run backwards, its slope falls to -0.8758; a beta up to 0.375 fits, or a smaller scan"
        ),
    ),
    case(
        scanner="x.hysteresis.branches.forward = { beta_max = 0.037, rho = 4.0, u_peak = 0.2 }",
        says=(
            "scanner.toml:20: x.hysteresis.branches[0].forward.u_peak: with beta = 0.02075 equation (20) needs "
            "0.2404 < u_peak < 0.8011; 0.2 is outside"
        ),
    ),
    case(
        scanner="x.hysteresis.branches.backward = { beta_max = 0.08, rho = 1.5, u_peak = 0.9 }",
        says=(
            "scanner.toml:21: x.hysteresis.branches[0].backward.u_peak: with beta = 0.02669 equation (20) "
            "needs 0.2464 < u_peak < 0.8070; 0.9 is outside"
        ),
    ),
    case(
        "x.size_nm = 900.0",
        scanner=("x.hysteresis.model = 'sinusoidal'", "x.hysteresis.branches.forward = { beta_max = 0.4 }"),
        says=(
            "scanner.toml:20: x.hysteresis.branches[0].forward.beta_max: beta = 0.3445 makes the branch run "
            "backwards, its slope falls to -0.08223; a beta_max up to 0.3696 fits, or a smaller scan"
        ),
    ),
    case(
        scanner="x.hysteresis.branches.forward = { beta_max = 0.45, rho = 100.0, u_peak = 0.7 }",
        says=(
            "scanner.toml:20: x.hysteresis.branches[0].forward.beta_max: beta = 0.45 at u_peak = 0.7 makes the "
            "branch run backwards, its slope falls to -0.8758; a beta_max up to 0.375 fits, or a smaller scan"
        ),
    ),
    case(
        "x.turn = 0.7",
        says=(
            "scan.toml:25: x.turn: 0.7 is 0.2 from the nearest calibrated branch (turn = 0.5); 0.4 to 0.6 can "
            "be served, or calibrate one in scanner.toml"
        ),
    ),
    case(
        "x.turn = 0.6000001",
        says=(
            "scan.toml:25: x.turn: 0.6000001 is 0.1000001 from the nearest calibrated branch (turn = 0.5); 0.4 "
            "to 0.6 can be served, or calibrate one in scanner.toml"
        ),
    ),
    case(
        "y.turn = 0.5",
        says=(
            "scan.toml:41: y.turn: 0.5 is 0.45 from the nearest calibrated branch (turn = 0.95); 0.85 to 1 can "
            "be served, or calibrate one in scanner.toml"
        ),
    ),
    case(
        scanner="x.size.base_nm = 2000.0",
        says="scanner.toml:12: x.size.base_nm: 2000 nm needs 2 of v_max; calibrate at 1000 nm or less",
    ),
    case(
        scanner=points("{ offset_v = 10, apparent_nm = 200 }, { offset_v = 20, apparent_nm = 201 }"),
        says="scanner.toml:6: x.offset.points: 2 entries are too few, at least 3 are needed",
    ),
    case(
        scanner=points(
            "{ offset_v = 10, apparent_nm = 200 }, { offset_v = 20, apparent_nm = 201 }, { offset_v = 10, "
            "apparent_nm = 204 }"
        ),
        says=(
            "scanner.toml:6: x.offset.points: 2 different offsets do not determine a parabola; at least 3 are needed"
        ),
    ),
    case(
        scanner=points(
            "{ offset_v = 10, apparent_nm = 200 }, { offset_v = 20, apparent_nm = 20 }, { offset_v = 60, "
            "apparent_nm = 204 }"
        ),
        says=(
            "scanner.toml:6: x.offset.points: the amplitude factor falls to -3.594 inside the driver's range; it has "
            "to stay above 0"
        ),
    ),
    case(
        scanner=points(
            "{ offset_v = 10, apparent_nm = 200 }, { offset_v = 20, apparent_nm = 90 }, { offset_v = 90, "
            "apparent_nm = 204 }"
        ),
        says=(
            "scanner.toml:6: x.offset.points: the fit gives an apparent size of -50.57 at the centre; it has "
            "to be above 0"
        ),
    ),
    case(
        scanner=points(
            "{ offset_v = -10, apparent_nm = 200 }, { offset_v = 20, apparent_nm = 201 }, { offset_v = 130, "
            "apparent_nm = 204 }"
        ),
        says=[
            "scanner.toml:6: x.offset.points[0].offset_v: -10 V is outside the driver's 0..100 V, by 10 V",
            "scanner.toml:6: x.offset.points[2].offset_v: 130 V is outside the driver's 0..100 V, by 30 V",
        ],
    ),
    case(
        scanner=("- x.offset.m_minus", "- x.offset.m_plus", "x.offset.alpha = 0.9", "x.offset.beta = -0.5"),
        says=(
            "scanner.toml:5: x.offset: the amplitude factor falls to -0.4 inside the driver's range; it has to stay "
            "above 0"
        ),
    ),
    case(
        "x.size_nm = 1350.0",
        "x.turn = 0.9",
        scanner="x.size.base_nm = 2000.0",
        says=[
            (
                "scan.toml:18: timing.pixels: 200 pixels do not fit the 100 ticks of the backward imaging window; "
                "take a line rate of at most 200 Hz, or at most 100 pixels"
            ),
            (
                "scan.toml:25: x.turn: 0.9 is 0.4 from the nearest calibrated branch (turn = 0.5); 0.4 to 0.6 can "
                "be served, or calibrate one in scanner.toml"
            ),
            "scanner.toml:12: x.size.base_nm: 2000 nm needs 2 of v_max; calibrate at 1000 nm or less",
        ],
    ),
]

RESPONSE = [
    case(
        response="", says="scanner.toml:28: x.resonance.response: r.csv:1: the first line has to read hz,gain,phase_deg"
    ),
    case(
        response="f,g,p\n1,2,3\n",
        says="scanner.toml:28: x.resonance.response: r.csv:1: the first line has to read hz,gain,phase_deg",
    ),
    case(
        response="hz,gain,phase_deg\n1,2\n3,4\n",
        says="scanner.toml:28: x.resonance.response: r.csv:2: '1,2' is not three numbers",
    ),
    case(
        response="hz,gain,phase_deg\n10,1,0\nfast,1,0\n",
        says="scanner.toml:28: x.resonance.response: r.csv:3: 'fast,1,0' is not three numbers",
    ),
    case(
        response="hz,gain,phase_deg\n1,1,0\n1,1,0\n",
        says="scanner.toml:28: x.resonance.response: r.csv:3: 1 Hz is not above 1 Hz; hz has to ascend",
    ),
    case(
        response="hz,gain,phase_deg\n100,1,0\n\n10,1,0\n",
        says="scanner.toml:28: x.resonance.response: r.csv:4: 10 Hz is not above 100 Hz; hz has to ascend",
    ),
    case(
        response="hz,gain,phase_deg\n0,1,0\n10,1,0\n",
        says="scanner.toml:28: x.resonance.response: r.csv:2: 0 Hz is not above 0 Hz; hz has to ascend",
    ),
    case(
        response="hz,gain,phase_deg\n10,1,0\n",
        says="scanner.toml:28: x.resonance.response: r.csv: 1 rows of numbers; at least 2 are needed",
    ),
    case(
        response="hz,gain,phase_deg\n# measured\n10,0,0\n20,1,0\n",
        says=(
            "scanner.toml:28: x.resonance.response: r.csv:3: '10,0,0' is outside the accepted range: finite hz, a "
            "gain of 1e-6 to 1e6, phase_deg of -1e6 to 1e6"
        ),
    ),
    case(
        response="hz,gain,phase_deg\n10,nan,0\n20,1,0\n",
        says=(
            "scanner.toml:28: x.resonance.response: r.csv:2: '10,nan,0' is outside the accepted range: finite hz, a "
            "gain of 1e-6 to 1e6, phase_deg of -1e6 to 1e6"
        ),
    ),
    case(
        response="hz,gain,phase_deg\n10,1,inf\n20,1,0\n",
        says=(
            "scanner.toml:28: x.resonance.response: r.csv:2: '10,1,inf' is outside the accepted range: finite hz, a "
            "gain of 1e-6 to 1e6, phase_deg of -1e6 to 1e6"
        ),
    ),
    case(
        response="hz,gain,phase_deg\n10,1,0\n1000,1,0\n",
        says=(
            "scanner.toml:28: x.resonance.response: the response is measured up to 1000 Hz; "
            "the scan plays up to 12800 Hz"
        ),
    ),
    case(
        scanner=measured("'absent.csv'"),
        says=(
            "scanner.toml:28: x.resonance.response: absent.csv is not a file; the path is relative to the scanner file"
        ),
    ),
    case(
        scanner=measured("'.'"),
        says="scanner.toml:28: x.resonance.response: . is not a file; the path is relative to the scanner file",
    ),
    case(
        scanner=measured('"a\\u0000b"'),
        says=(
            "scanner.toml:28: x.resonance.response: 'a\\x00b' is not a file; the path is relative to the scanner file"
        ),
    ),
    case(
        scanner=measured('"' + 300 * "r" + '"'),
        says="scanner.toml:28: x.resonance.response: "
        + 100 * "r"
        + "..."
        + 97 * "r"
        + " is not a file; the path is relative to the scanner file",
    ),
]

TIMING = [
    case(
        "timing.pixels = 600",
        says=[
            (
                "scan.toml:18: timing.pixels: 600 pixels do not fit the 500 ticks of the backward imaging window; "
                "take a line rate of at most 333.333 Hz, or at most 500 pixels"
            ),
            (
                "scan.toml:18: timing.pixels: 600 pixels do not fit the 500 ticks of the forward imaging window; "
                "take a line rate of at most 333.333 Hz, or at most 500 pixels"
            ),
        ],
    ),
    case(
        "timing.line_rate_hz = 1100.0",
        "x.band_limit.directions = 'forward'",
        says=(
            "scan.toml:18: timing.pixels: 200 pixels do not fit the 182 ticks of the forward imaging window; "
            "take a line rate of at most 1000 Hz, or at most 182 pixels"
        ),
    ),
    case(
        "timing.ticks_per_line = 400",
        "x.band_limit.directions = 'forward'",
        says=(
            "scan.toml:19: timing.pixels: 200 pixels do not fit the 160 ticks of the forward imaging window; "
            "take at least 500 ticks_per_line, or at most 160 pixels"
        ),
    ),
    case(
        "timing.ticks_per_pixel = 1",
        "x.turn = 0.6",
        says=(
            "scan.toml:18: timing.ticks_per_pixel: 200 pixels of 1 ticks in 0.48 of the line make 416.6667 "
            "ticks a line, which is not whole; 204 pixels make it so, or change x.turn or the window"
        ),
    ),
    case(
        "x.turn = 0.4",
        "timing.line_rate_hz = 1000.0",
        says=(
            "scan.toml:18: timing.pixels: 200 pixels do not fit the 160 ticks of the forward imaging window; "
            "take a line rate of at most 800 Hz, or at most 160 pixels"
        ),
    ),
    case(
        "timing.pixels = 201",
        "timing.ticks_per_pixel = 5",
        says=(
            "scan.toml:18: timing.ticks_per_pixel: 201 pixels of 5 ticks in 0.4 of the line make 2512.5 ticks "
            "a line, which is not whole; 200 pixels make it so, or change x.turn or the window"
        ),
    ),
    case(
        "timing.ticks_per_pixel = 1",
        "x.band_limit.window = [0.1234567, 0.9]",
        says=(
            "scan.toml:18: timing.ticks_per_pixel: 200 pixels of 1 ticks in 0.388272 of the line make 515.1033 "
            "ticks a line, which is not whole; change x.turn or the window"
        ),
    ),
    case(
        "timing.pixels = 65536",
        "timing.ticks_per_pixel = 1000",
        says=(
            "scan.toml:18: timing.ticks_per_pixel: a line of 163840000 ticks is outside 8..16777216; at most 102 fit"
        ),
    ),
    case(
        "timing.pixels = 1",
        "timing.ticks_per_pixel = 1",
        says=[
            (
                "scan.toml:18: timing.ticks_per_pixel: 1 pixels of 1 ticks in 0.4 of the line make 2.5 ticks a "
                "line, which is not whole; 2 pixels make it so, or change x.turn or the window"
            ),
            ("scan.toml:18: timing.ticks_per_pixel: a line of 2 ticks is outside 8..16777216; take more of them"),
        ],
    ),
    case(
        "timing.line_rate_hz = 0.001",
        says=(
            "scan.toml:20: timing.line_rate_hz: a line of 500000000 ticks is outside 8..16777216; at 500000 "
            "updates a second the line rate can be 0.0298024 to 62500 Hz"
        ),
    ),
    case(
        "timing.line_rate_hz = 100e3",
        says=(
            "scan.toml:20: timing.line_rate_hz: a line of 5 ticks is outside 8..16777216; at 500000 updates a "
            "second the line rate can be 0.0298024 to 62500 Hz"
        ),
    ),
    case(
        "timing.lines = 65536",
        "timing.line_rate_hz = 10.0",
        says=(
            "scan.toml:19: timing.lines: 65536 lines of 50000 ticks are 3276800000 ticks a frame, above "
            "2147483647; at most 42949 lines fit"
        ),
    ),
    case(
        "timing.lines = 1",
        says=(
            "scan.toml:46: y.band_limit.window: not one of the 1 lines lies inside it; widen it or take more "
            "timing.lines"
        ),
    ),
    case(
        "timing.lines = 40",
        "y.band_limit.window = [0.5, 0.51]",
        says=(
            "scan.toml:46: y.band_limit.window: not one of the 40 lines lies inside it; widen it or take more "
            "timing.lines"
        ),
    ),
    case(
        "timing.lines = 10",
        "y.band_limit.directions = 'both'",
        says=(
            "scan.toml:47: y.band_limit.directions: not one of the 10 lines lies inside the backward window; "
            "take more timing.lines, a lower y.turn or 'forward'"
        ),
    ),
    case(
        "x.turn = 0.9999999999999999",
        says=[
            (
                "scan.toml:18: timing.pixels: 200 pixels do not fit the 0 ticks of the backward imaging window; no "
                "line is long enough for so many, or directions = 'forward'"
            ),
            (
                "scan.toml:25: x.turn: 1 is 0.5 from the nearest calibrated branch (turn = 0.5); 0.4 to 0.6 can be "
                "served, or calibrate one in scanner.toml"
            ),
        ],
    ),
    case(
        "x.band_limit.harmonics = 100",
        "timing.ticks_per_line = 200",
        "timing.pixels = 50",
        says=("scan.toml:30: x.band_limit.harmonics: 100 harmonics are too many; a period of 200 ticks carries 99"),
    ),
    case(
        "timing.ticks_per_line = 60",
        "timing.pixels = 10",
        says="scan.toml:30: x.band_limit.harmonics: 32 harmonics are too many; a period of 60 ticks carries 29",
    ),
    case(
        "y.motion = 'step'",
        "timing.lines = 100",
        says=("scan.toml:46: y.band_limit.harmonics: 64 harmonics are too many; a period of 100 lines carries 49"),
    ),
    case(
        "y.motion = 'step'",
        "timing.lines = 2",
        "y.band_limit.window = [0.0, 0.9]",
        says=(
            "scan.toml:46: y.band_limit.harmonics: 64 harmonics are too many; a period of 2 lines carries 0; "
            "take more timing.lines"
        ),
    ),
    case(
        "x.table.length = 64",
        says="scan.toml:29: x.band_limit.harmonics: 32 harmonics are too many; a table of 64 words carries 31",
    ),
    case(
        "- x.band_limit.harmonics",
        "x.band_limit.cutoff_hz = 13000.0",
        "x.table.length = 64",
        says=(
            "scan.toml:28: x.band_limit.cutoff_hz: 32 harmonics are too many; a table of 64 words carries 31, "
            "which 12799.9 Hz pass"
        ),
    ),
    case(
        "- x.band_limit.harmonics",
        "x.band_limit.cutoff_hz = 260e3",
        "timing.ticks_per_line = 200",
        "timing.pixels = 50",
        "x.table.length = 4096",
        says=(
            "scan.toml:29: x.band_limit.cutoff_hz: 104 harmonics are too many; a period of 200 ticks carries "
            "99, which 249999 Hz pass"
        ),
    ),
    case(
        "- x.band_limit.harmonics",
        "x.band_limit.cutoff_hz = 399.0",
        says=(
            "scan.toml:28: x.band_limit.cutoff_hz: 399 Hz passes 0 harmonics of 400 Hz; 400 to 204800 Hz pass 1 to 512"
        ),
    ),
    case(
        "- x.band_limit.harmonics",
        "x.band_limit.cutoff_hz = 300e3",
        says=(
            "scan.toml:28: x.band_limit.cutoff_hz: 300000 Hz passes 750 harmonics of 400 Hz; 400 to 204800 Hz "
            "pass 1 to 512"
        ),
    ),
    case(
        "- y.band_limit.harmonics",
        "y.band_limit.cutoff_hz = 1.5",
        says=("scan.toml:44: y.band_limit.cutoff_hz: 1.5 Hz passes 0 harmonics of 2 Hz; 2 to 1024 Hz pass 1 to 512"),
    ),
    case(
        "x.table.mode = 'direct'",
        says=(
            "scan.toml:35: x.table.length: 2048 is not the 1250 words, one a tick, that mode = 'direct' takes; "
            "leave it out"
        ),
    ),
    case(
        "y.table.mode = 'direct'",
        "y.motion = 'step'",
        says=(
            "scan.toml:52: y.table.length: 2048 is not the 200 words, one a line, that mode = 'direct' takes; "
            "leave it out"
        ),
    ),
    case(
        "y.table.mode = 'direct'",
        "- y.table.length",
        "timing.lines = 1000",
        says="scan.toml:50: y.table.mode: 'direct' takes 1250000 words, above 1048576; use 'interpolated'",
    ),
    case(
        "x.band_limit.harmonics = 4",
        "x.band_limit.window = [0.001, 0.999]",
        says=(
            "scan.toml:56: limits.max_scaling_error_percent: the x axis has a scaling error of 132.5 %, above "
            "0.5 %; most of it is the band limit: more `harmonics` or a lower `max_scaling_error_percent`; "
            'a narrower `window` or `method = "window"`; no remedy that was tried is enough; the best: '
            "x.band_limit.window = [0.2, 0.8] leaves 12.3 %"
        ),
        status=3,
    ),
]

LIMITS = [
    case(
        "limits.max_error_lsb = 0.6",
        says=(
            "scan.toml:55: limits.max_error_lsb: the y axis errs by up to 0.7406 LSB, above 0.6; a longer "
            "or wider table, or a lower `max_error_lsb` of the table"
        ),
        status=3,
    ),
    case(
        "limits.max_scaling_error_percent = 0.3",
        says=[
            (
                "scan.toml:56: limits.max_scaling_error_percent: the x axis has a scaling error of 0.3104 %, above "
                "0.3 %; most of it is the converter: more `dac.bits`, or an amplifier whose range fits; "
                "tried: amplifier.gain = 8.7 with amplifier.bias_v = 49.99 leaves 0.282 %; or dac.bits = 17 leaves "
                "0.18 %"
            ),
            (
                "scan.toml:56: limits.max_scaling_error_percent: the y axis has a scaling error of 0.3498 %, above "
                "0.3 %; most of it is the converter: more `dac.bits`, or an amplifier whose range fits; "
                "tried: amplifier.gain = 7.7 with amplifier.bias_v = 49.99 leaves 0.283 %; or dac.bits = 17 leaves "
                "0.2 %"
            ),
        ],
        status=3,
    ),
    case(
        "x.band_limit.method = 'truncate'",
        says=(
            "scan.toml:56: limits.max_scaling_error_percent: the x axis has a scaling error of 11.74 %, above "
            "0.5 %; most of it is the band limit: more `harmonics` or a lower `max_scaling_error_percent`; "
            'a narrower `window` or `method = "window"`; tried: x.band_limit.method = "window" leaves 0.31 %'
        ),
        status=3,
    ),
    case(
        "timing.line_rate_hz = 900.0",
        "x.band_limit.harmonics = 64",
        "limits.max_scaling_error_percent = 0.34",
        says=(
            "scan.toml:56: limits.max_scaling_error_percent: the y axis has a scaling error of 0.3436 %, above "
            "0.34 %; most of it is the converter: more `dac.bits`, or an amplifier whose range fits; tried: "
            "amplifier.gain = 8.9 with amplifier.bias_v = 49.99 leaves 0.315 %; or dac.bits = 17 leaves 0.204 %"
        ),
        status=3,
    ),
]


CASES = [
    *TYPES,
    *RANGES,
    *KEYS,
    *CHOICES,
    *NAMES,
    *ALTERNATIVES,
    *DRIVE,
    *HYSTERESIS,
    *RESPONSE,
    *TIMING,
    *LIMITS,
]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty current directory, so that messages name the files as ``scan.toml`` and ``scanner.toml``."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("scan", "scanner", "response", "says", "status"), CASES)
def test_a_bad_input_is_refused_with_its_whole_message(
    here: Path, scan: tuple[str, ...], scanner: tuple[str, ...], response: str | None, says: list[str], status: int
) -> None:
    write_pair(here, edited(SCAN, *scan), edited(SCANNER, *scanner))
    if response is not None:
        (here / "r.csv").write_text(response, encoding="utf-8")
    before = sorted(here.iterdir())
    outcome = run("build", "scan.toml", "-o", "out")
    assert sorted(outcome.messages) == says
    assert outcome.status == status
    assert outcome.out == ""
    assert sorted(here.iterdir()) == before, "something was written"


def test_the_shipped_pair_is_accepted(here: Path) -> None:
    write_pair(here)
    assert run("check", "scan.toml") == run("check", "scan.toml")
    assert run("check", "scan.toml").status == 0


def test_every_fault_of_both_files_is_reported_in_one_run(here: Path) -> None:
    scan = edited(
        SCAN,
        "name = 'wire'",
        "dac.bits = 30",
        "dac.hue = 1",
        "amplifier.gain = nan",
        "- timing.lines",
        "x.size_v = 20.0",
        "x.turn = 1.5",
        "x.table.length = 1000",
        "x.table.mode = 'quadratic'",
        "- y.size_nm",
        "y.band_limit.window = [0.9, 0.1]",
    )
    scanner = edited(SCANNER, "v_max = -1.0", "- x.offset.m_plus", "x.resonance.quality = 'high'", "- [y.size]")
    write_pair(here, scan, scanner)
    outcome = run("build", "scan.toml", "-o", "out")
    assert outcome.messages == [
        "scan.toml:2: name: 'wire' is a reserved word of C, C++, Verilog, SystemVerilog or VHDL",
        "scan.toml:6: dac.hue: unknown key; known here: align, bits, coding, inverted, output, shaping, "
        "update_rate_hz, v_max, v_min, word_bits",
        "scan.toml:7: dac.bits: 30 is above 24",
        "scan.toml:14: amplifier.gain: nan is not a finite number",
        "scan.toml:18: timing.lines: missing; give lines or image_lines",
        "scan.toml:23: x.size_v: size_nm is given as well; keep one of the two",
        "scan.toml:26: x.turn: 1.5 is not below 1",
        "scan.toml:35: x.table.mode: 'quadratic' is not one of 'auto', 'cubic', 'direct', 'interpolated'",
        "scan.toml:39: y: missing; give size_nm or size_v",
        "scan.toml:46: y.band_limit.window: [0.9, 0.1] does not ascend",
        "scanner.toml:3: v_max: -1 is below 0.001",
        "scanner.toml:5: x.offset.m_plus: missing beside m_minus",
        "scanner.toml:28: x.resonance.quality: 'high' is not a number",
        "scanner.toml:32: y.size: missing; this table is required",
    ]
    assert outcome.status == 2
    assert not (here / "out").exists()


def test_contradictions_of_both_axes_are_reported_in_one_run(here: Path) -> None:
    scan = edited(SCAN, "timing.pixels = 600", "x.size_nm = 5000.0", "y.offset_v = 200.0", "y.turn = 0.5")
    write_pair(here, scan, edited(SCANNER, "x.frequency.reference_hz = 1e-6", "x.frequency.alpha = 0.5"))
    outcome = run("build", "scan.toml", "-o", "out")
    places = [message.split(": ")[:2] for message in outcome.messages]
    assert places == [
        ["scan.toml:18", "timing.pixels"],
        ["scan.toml:18", "timing.pixels"],
        ["scan.toml:23", "x.size_nm"],
        ["scan.toml:40", "y.offset_v"],
        ["scan.toml:41", "y.turn"],
        ["scanner.toml:24", "x.frequency.alpha"],
    ]
    assert outcome.status == 2


def test_a_scan_and_a_scanner_that_are_not_toml_are_reported_in_one_run(here: Path) -> None:
    write_pair(here, edited(SCAN, "dac.bits = 30"), SCANNER + "[x\n")
    outcome = run("check", "scan.toml")
    assert outcome.messages == [
        "scan.toml:6: dac.bits: 30 is above 24",
        "scanner.toml:54: not TOML: Expected ']' at the end of a table declaration, column 3",
    ]
    assert outcome.status == 2


def test_the_files_are_named_as_the_user_named_them(here: Path) -> None:
    (here / "scans").mkdir()
    (here / "lab").mkdir()
    write_pair(here / "scans", edited(SCAN, "scanner = '../lab/scanner.toml'", "x.turn = 2.0"))
    (here / "scans" / "scanner.toml").rename(here / "lab" / "scanner.toml")
    (here / "lab" / "scanner.toml").write_text(edited(SCANNER, "v_max = 0.0"), encoding="utf-8")
    assert run("check", "scans/scan.toml").messages == [
        "scans/../lab/scanner.toml:3: v_max: 0 is below 0.001",
        "scans/scan.toml:25: x.turn: 2 is not below 1",
    ]


FIGURE = r"(-?[0-9.]+(?:e[-+]?[0-9]+)?)"
REMEDIES = [
    (("x.offset_v = 5.0",), f"an offset of {FIGURE} to ", ("x.offset_v = {}",)),
    (("x.offset_v = 97.0",), f"an offset of .* to {FIGURE} V", ("x.offset_v = {}",)),
    (("y.offset_v = 0.0",), f"an offset of {FIGURE} to ", ("y.offset_v = {}",)),
    (("x.size_nm = 1200.0", "x.offset_v = 70.0"), f"an offset of {FIGURE} to ", ("x.offset_v = {}",)),
    (("x.size_nm = 1200.0", "x.offset_v = 70.0"), f"an offset of .* to {FIGURE} V", ("x.offset_v = {}",)),
    (("x.offset_v = 5.0",), f"a line of about {FIGURE} nm", ("x.size_nm = {}",)),
    (("x.offset_v = 97.0",), f"a line of about {FIGURE} nm", ("x.size_nm = {}",)),
    (("x.size_nm = 1200.0", "x.offset_v = 70.0"), f"a line of about {FIGURE} nm", ("x.size_nm = {}",)),
    (("x.size_of = 'window'", "x.offset_v = 5.0"), f"a window of about {FIGURE} nm", ("x.size_nm = {}",)),
    (("- x.size_nm", "x.size_v = 20", "x.offset_v = 5.0"), f"about {FIGURE} V", ("x.size_v = {}",)),
    (("x.size_nm = 1350.0",), f"at most {FIGURE} nm fit", ("x.size_nm = {}",)),
    (("x.size_nm = 1100.0", "x.size_of = 'window'"), f"a window of {FIGURE} nm", ("x.size_nm = {}",)),
    (
        ("amplifier.gain = 1.0", "y.size_nm = 10.0"),
        f"a gain of {FIGURE} with a bias_v of {FIGURE} V",
        ("amplifier.gain = {}", "amplifier.bias_v = {}"),
    ),
    (
        ("amplifier.gain = -1.0", "amplifier.bias_v = 46.0", "y.size_nm = 10.0"),
        f"a gain of {FIGURE} with a bias_v of {FIGURE} V",
        ("amplifier.gain = {}", "amplifier.bias_v = {}"),
    ),
    (("amplifier.max_slew_v_per_s = 9e3",), f"about {FIGURE} Hz", ("timing.line_rate_hz = {}",)),
    (("amplifier.max_slew_v_per_s = 9e3",), f"a line of {FIGURE} nm", ("x.size_nm = {}",)),
    (("amplifier.max_slew_v_per_s = 17900.0",), f"about {FIGURE} Hz", ("timing.line_rate_hz = {}",)),
    (("amplifier.max_slew_v_per_s = 17900.0",), f"a line of {FIGURE} nm", ("x.size_nm = {}",)),
    (
        ("amplifier.max_slew_v_per_s = 9e3", "timing.ticks_per_line = 1250"),
        f"about {FIGURE} ticks_per_line",
        ("timing.ticks_per_line = {}",),
    ),
    (
        ("amplifier.max_slew_v_per_s = 9e3", "timing.ticks_per_pixel = 5", "timing.pixels = 100"),
        f"about {FIGURE} ticks_per_pixel",
        ("timing.ticks_per_pixel = {}",),
    ),
    (
        ("amplifier.max_slew_v_per_s = 800.0", "timing.line_rate_hz = 10.0", "timing.pixels = 50"),
        f"update_rate_hz of about {FIGURE} ",
        ("dac.update_rate_hz = {}",),
    ),
    (("amplifier.max_slew_v_per_s = 5e4", "y.motion = 'step'"), "use motion = ('ramp')", ("y.motion = {}",)),
    (("x.turn = 0.7", "x.band_limit.directions = 'forward'"), f"{FIGURE} to .* can", ("x.turn = {}",)),
    (("x.turn = 0.2", "x.band_limit.directions = 'forward'"), f" to {FIGURE} can", ("x.turn = {}",)),
    (("timing.pixels = 600",), f"at most {FIGURE} Hz", ("timing.line_rate_hz = {}",)),
    (("timing.pixels = 600",), f"at most {FIGURE} pixels", ("timing.pixels = {}",)),
    (
        ("timing.ticks_per_line = 400", "x.band_limit.directions = 'forward'"),
        f"at least {FIGURE} ticks_per_line",
        ("timing.ticks_per_line = {}",),
    ),
    (
        ("timing.ticks_per_pixel = 1", "timing.pixels = 240", "x.turn = 0.6"),
        f"at least {FIGURE} ticks_per_pixel",
        ("timing.ticks_per_pixel = {}",),
    ),
    (("timing.pixels = 201", "timing.ticks_per_pixel = 5"), f"; {FIGURE} pixels", ("timing.pixels = {}",)),
    (
        ("timing.pixels = 65536", "timing.ticks_per_pixel = 1000", "timing.lines = 100"),
        f"at most {FIGURE} fit",
        ("timing.ticks_per_pixel = {}",),
    ),
    (("timing.line_rate_hz = 0.001", "timing.lines = 100"), f"can be {FIGURE} to", ("timing.line_rate_hz = {}",)),
    (
        (
            "timing.line_rate_hz = 100e3",
            "timing.pixels = 1",
            "x.band_limit.harmonics = 3",
            "- amplifier.max_slew_v_per_s",
        ),
        f"to {FIGURE} Hz",
        ("timing.line_rate_hz = {}",),
    ),
    (("timing.lines = 65536", "timing.line_rate_hz = 10.0"), f"at most {FIGURE} lines fit", ("timing.lines = {}",)),
    (("x.table.length = 64",), f"carries {FIGURE}", ("x.band_limit.harmonics = {}",)),
    (("y.motion = 'step'", "timing.lines = 100"), f"carries {FIGURE}", ("y.band_limit.harmonics = {}",)),
    (
        ("- x.band_limit.harmonics", "x.band_limit.cutoff_hz = 13000.0", "x.table.length = 64"),
        f"which {FIGURE} Hz pass",
        ("x.band_limit.cutoff_hz = {}",),
    ),
    (
        ("- x.band_limit.harmonics", "x.band_limit.cutoff_hz = 399.0"),
        f"; {FIGURE} to ",
        ("x.band_limit.cutoff_hz = {}",),
    ),
    (("x.table.mode = 'direct'",), f"the {FIGURE} words", ("x.table.length = {}",)),
    (("x.table.length = 1000",), f"and {FIGURE}", ("x.table.length = {}",)),
    (("x.table.length = 1000",), f"are {FIGURE} and", ("x.table.length = {}",)),
]


@pytest.mark.common
@pytest.mark.parametrize(("wrong", "advice", "remedy"), REMEDIES, ids=lambda value: str(value)[:60])
def test_what_a_message_advises_helps(here: Path, wrong: tuple[str, ...], advice: str, remedy: tuple[str, ...]) -> None:
    scan = edited(SCAN, *wrong, "- [limits]")
    write_pair(here, scan)
    before = run("check", "scan.toml")
    assert before.status == 2
    found = re.search(advice, before.err)
    assert found, before.err
    write_pair(here, edited(scan, *(edit.format(figure) for edit, figure in zip(remedy, found.groups(), strict=True))))
    after = run("check", "scan.toml")
    # Such a scan may be a poor one, of which a warning tells; it is accepted.
    assert [said for said in after.messages if not said.startswith("warning: ")] == []
    assert after.status == 0


SCANNER_REMEDIES = [
    (("x.size.base_nm = 2000.0",), f"calibrate at {FIGURE} nm", "x.size.base_nm = {}"),
    (
        ("x.hysteresis.model = 'sinusoidal'", "x.hysteresis.branches.forward = { beta_max = 0.4 }"),
        f"a beta_max up to {FIGURE} fits",
        "x.hysteresis.branches.forward = {{ beta_max = {} }}",
    ),
    (
        ("x.hysteresis.branches.forward = { beta_max = 0.45, rho = 100.0, u_peak = 0.7 }",),
        f"a beta_max up to {FIGURE} fits",
        "x.hysteresis.branches.forward = {{ beta_max = {}, rho = 100.0, u_peak = 0.7 }}",
    ),
    (
        ("x.hysteresis.branches.forward = { beta_max = 0.037, rho = 4.0, u_peak = 0.2 }",),
        f"needs {FIGURE} < u_peak",
        "x.hysteresis.branches.forward = {{ beta_max = 0.037, rho = 4.0, u_peak = {}1 }}",  # the bound is not inside
    ),
]


@pytest.mark.parametrize(("wrong", "advice", "remedy"), SCANNER_REMEDIES, ids=lambda value: str(value)[:60])
def test_what_a_message_on_the_scanner_advises_helps(
    here: Path, wrong: tuple[str, ...], advice: str, remedy: str
) -> None:
    scan = edited(SCAN, "x.size_nm = 900.0", "- [limits]")
    scanner = edited(SCANNER, *wrong)
    write_pair(here, scan, scanner)
    found = re.search(advice, run("check", "scan.toml").err)
    assert found
    write_pair(here, scan, edited(scanner, remedy.format(found[1])))
    after = run("check", "scan.toml")
    assert after.status == 0
    # At the edge of what can be built a branch all but stands still somewhere, which is a warning.
    assert all(message.startswith("warning: ") for message in after.messages)


def refused(folder: Path, scan: str) -> str:
    """What is said of a scan before its certificate is measured."""
    try:
        make_plan(load(write_pair(folder, scan)))
    except Rejected as rejected:
        return str(rejected)
    return ""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder for all that hypothesis tries."""
    return tmp_path_factory.mktemp("remedies")


STEADY = settings(derandomize=True, deadline=None, max_examples=60)


@pytest.mark.common
@STEADY
@given(
    pixels=st.integers(2, 3000),
    low=st.integers(0, 45),
    high=st.integers(55, 100),
    turn=st.integers(41, 59),
    rate=st.floats(1e2, 2e4),
)
def test_the_line_rate_that_is_said_to_carry_the_pixels_does(
    folder: Path, pixels: int, low: int, high: int, turn: int, rate: float
) -> None:
    asked = [
        f"timing.pixels = {pixels}",
        f"x.turn = {turn / 100}",
        f"x.band_limit.window = [{low / 100}, {high / 100}]",
    ]
    scan = edited(SCAN, *asked, f"timing.line_rate_hz = {rate!r}", "x.band_limit.harmonics = 3", "timing.lines = 40")
    rates = re.findall(f"line rate of at most {FIGURE} Hz", refused(folder, scan))
    if rates:  # of both directions
        scan = edited(scan, f"timing.line_rate_hz = {min(rates, key=float)}")
    assert "timing.pixels" not in refused(folder, scan)


@pytest.mark.common
@STEADY
@given(slew=st.floats(1e2, 3e4), bits=st.integers(10, 24), size=st.floats(20.0, 600.0), rate=st.floats(50.0, 900.0))
def test_the_line_rate_that_is_said_to_suit_the_amplifier_does(
    folder: Path, slew: float, bits: int, size: float, rate: float
) -> None:
    asked = [f"amplifier.max_slew_v_per_s = {slew!r}", f"dac.bits = {bits}", f"x.size_nm = {size!r}"]
    scan = edited(SCAN, *asked, f"timing.line_rate_hz = {rate!r}", "timing.lines = 40")
    if found := re.search(f"the x drive .* about {FIGURE} Hz", refused(folder, scan)):
        scan = edited(scan, f"timing.line_rate_hz = {found[1]}")
    assert "the x drive" not in refused(folder, scan)
