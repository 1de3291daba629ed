"""Builds of changed examples, for tests that hold what is emitted against something else.

A variant is the shipped example with some keys changed, by their dotted names, and written out as TOML again. All
variants keep the example's name, so that one player in C and one in Verilog serve them all.
"""

import json
import os
import re
import shutil
import subprocess
import tomllib
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from listed_tools import BASE, PROGRAMS, programs_of, why_missing
from replacing import replace

from tablegen.certificate.certificate import Certificate, certify
from tablegen.config.load import load
from tablegen.emit.render import render
from tablegen.emit.write import write_files
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.output import UNIT_GAIN_BITS
from tablegen.fixedpoint.rounding import signed_limits
from tablegen.planning.line_plan import LinePlan, Plan, make_plan

REPOSITORY = Path(__file__).resolve().parents[2]
HELPERS = REPOSITORY / "tests" / "helpers"
BENCHES = REPOSITORY / "hdl_tests" / "benches"
EXAMPLE = REPOSITORY / "examples" / "annexin_200nm.toml"
NAME = "annexin_200nm"
REMOVED = object()  # as a value: the key is taken out

Changes = Mapping[str, object]


@dataclass(frozen=True)
class Variant:
    """What differs from the example, in the scan and in the scanner."""

    scan: Changes = field(default_factory=dict)
    scanner: Changes = field(default_factory=dict)


def _bits(table: int, dac: int, guarded: Changes | None = None) -> Variant:
    changes = {"x.table.bits": table, "y.table.bits": table, "dac.bits": dac, "timing.lines": 40}
    return Variant({**changes, **(guarded or {})})


def _turned(turn: float) -> Variant:
    forward = {"beta_max": 0.037, "rho": 4.0, "u_peak": 0.37}
    backward = {"beta_max": 0.03, "rho": 1.5, "u_peak": 0.48}
    branches = [{"turn": turn, "forward": forward, "backward": backward}]
    scan = {"x.turn": turn, "x.band_limit.directions": "forward", "timing.lines": 40, "timing.line_rate_hz": 100.0}
    return Variant(scan, {"x.hysteresis.branches": branches})


VARIANTS: dict[str, Variant] = {
    "example": Variant(),
    "header_only": Variant({"emit.header_only": True, "timing.lines": 40}),
    "bits_8": _bits(8, 8),
    "bits_12": _bits(12, 12),
    "bits_18": _bits(18, 18),
    "bits_20": _bits(20, 20, {"emit.header_only": True}),
    "bits_24": _bits(24, 24),
    "narrow_table_wide_dac": _bits(8, 24),
    "wide_table_narrow_dac": _bits(24, 8),
    "direct": Variant(
        {"x.table": {"mode": "direct", "bits": 16}, "y.table": {"mode": "direct", "bits": 12}, "timing.lines": 8}
    ),
    "direct_steps": Variant(
        {
            "x.table": {"mode": "direct", "bits": 24},
            "y.table": {"mode": "direct", "bits": 8},
            "y.motion": "step",
            "emit.header_only": True,
        }
    ),
    "steps": Variant({"y.motion": "step"}),
    "inverting": Variant({"amplifier.gain": -10.0, "timing.lines": 40}),
    "turn_0.7": _turned(0.7),
    "turn_0.95": _turned(0.95),
    "twos_complement": Variant({"dac.coding": "twos-complement", "timing.lines": 40}),
    "left_aligned": Variant(
        {"dac.bits": 18, "dac.word_bits": 24, "dac.align": "left", "dac.coding": "twos-complement", "timing.lines": 40}
    ),
    "prime_line": Variant({"timing.ticks_per_line": 1249, "timing.lines": 37}),
    "binary_line": Variant({"timing.ticks_per_line": 1024, "timing.lines": 32, "x.table.length": 4096}),
    "longest_table": Variant({"x.table.length": 65536, "y.table.length": 256, "timing.lines": 40}),
    "short_frame": Variant(
        {
            "timing": {"pixels": 50, "lines": 8, "line_rate_hz": 1500.0, "ticks_per_line": 331},
            "x.size_nm": 50.0,
            "x.band_limit.harmonics": 16,
            "y.band_limit.harmonics": 16,
        }
    ),
    "low_corner": Variant({"x.offset_v": 11.0, "x.size_nm": 190.0, "y.park_v": 0.0, "timing.lines": 40}),
}

# With those that no Verilog plays.
IN_C = {
    **VARIANTS,
    "cubic": Variant(
        {
            "x.table": {"mode": "cubic", "length": 128, "bits": 14},
            "y.table": {"mode": "cubic", "length": 256, "bits": 14},
            "timing.lines": 40,
            "emit.formats": ["c"],
        }
    ),
    "cubic_wide": Variant(
        {
            "dac.bits": 20,
            "x.table": {"mode": "cubic", "length": 512, "bits": 21},
            "y.table.bits": 20,
            "y.motion": "step",
            "emit": {"header_only": True, "formats": ["c"]},
        }
    ),
}

# In every `make check`, of what is quick.
FEW = ("example", "bits_24", "direct_steps", "turn_0.7", "left_aligned", "header_only")


def stressed(plan: Plan, bits: int, gain_word: int) -> Plan:
    """A plan that no scan makes: noise over the whole range of the words, the largest gain, and limits that clamp."""
    generator = np.random.default_rng(bits)
    low, high = signed_limits(bits)

    def stress(line: LinePlan) -> LinePlan:
        words = generator.integers(low, high, size=len(line.program.words), endpoint=True)
        words[:8] = [low, high, low, high, high, low, 0, -1]
        words[-2:] = [high, low]
        gain_q = UNIT_GAIN_BITS + bits + guard_bits(bits) - 16
        output = replace(
            line.program.output,
            gain_word=gain_word,
            gain_q=gain_q,
            offset_word=(40000 << gain_q) + 12345,
            code_min=1000,
            code_max=60000,
        )
        return replace(line, program=replace(line.program, bits=bits, words=words, output=output))

    return replace(plan, x=stress(plan.x), y=stress(plan.y))


@dataclass(frozen=True, eq=False)
class Build:
    """A build in memory and on disk."""

    folder: Path
    scan: Mapping[str, Any]
    plan: Plan
    certificates: dict[str, Certificate]
    files: dict[str, bytes]

    @property
    def manifest(self) -> dict[str, Any]:
        """The manifest, read again from its bytes."""
        content: dict[str, Any] = json.loads(self.files["manifest.json"])
        return content


def write_variant(folder: Path, variant: Variant) -> Path:
    """Write a variant's two TOML files, and return the scan's path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / EXAMPLE.name
    path.write_text(to_toml(changed(EXAMPLE, variant.scan)), "utf-8")
    scanner = changed(EXAMPLE.with_name("scanner.toml"), variant.scanner)
    (folder / "scanner.toml").write_text(to_toml(scanner), "utf-8")
    return path


def build(folder: Path, variant: Variant) -> Build:
    """Build a variant into a folder. The limits of the example do not apply: coarse converters break them."""
    scan = write_variant(folder, variant)
    plan = make_plan(load(scan))
    return _written(folder, scan, plan, certify(plan))


def build_stressed(folder: Path, bits: int, gain_word: int) -> Build:
    """The short frame with the integers of ``stressed``; its certificate means nothing."""
    scan = write_variant(folder, VARIANTS["short_frame"])
    plan = make_plan(load(scan))
    return _written(folder, scan, stressed(plan, bits, gain_word), certify(plan))


def _written(folder: Path, scan: Path, plan: Plan, certificates: dict[str, Certificate]) -> Build:
    files = render(plan, certificates)
    write_files(folder / "out", files)
    return Build(folder / "out", tomllib.loads(scan.read_text("utf-8")), plan, certificates, files)


def changed(path: Path, changes: Changes) -> dict[str, Any]:
    """The values of a TOML file with changes by dotted key; ``REMOVED`` takes a key out."""
    values = tomllib.loads(path.read_text("utf-8"))
    for key, value in changes.items():
        *parents, last = key.split(".")
        table = values
        for parent in parents:
            table = table.setdefault(parent, {})
        if value is REMOVED:
            del table[last]
        else:
            table[last] = deepcopy(value)  # a later change of a key inside it is no change of the caller
    return values


def to_toml(values: Mapping[str, Any], path: tuple[str, ...] = ()) -> str:
    """TOML of nested tables, strings, numbers, booleans and arrays."""
    plain = {key: value for key, value in values.items() if not isinstance(value, dict)}
    text = f"\n[{'.'.join(path)}]\n" if path and plain else ""
    text += "".join(f"{key} = {_value(value)}\n" for key, value in plain.items())
    for key, value in values.items():
        if isinstance(value, dict):
            text += to_toml(value, (*path, key))
    return text


def _value(value: object) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    return json.dumps(value) if isinstance(value, str | bool) else repr(value)


def constants(manifest: Mapping[str, Any]) -> dict[str, int]:
    """Every constant that a header is to define, worked out from the manifest alone, without the scan's prefix."""
    sequence = manifest["sequence"]
    rate, per_second = sequence["update_rate_hz"]
    found = {"UPDATE_RATE_MILLIHZ": round(rate * 1000 / per_second)}
    for key in ("line_ticks", "frame_lines", "pixels", "settle_lines", "turn_tick", "turn_line"):
        found[key.upper()] = sequence[key]
    for side, unit in (("forward", "tick"), ("backward", "tick"), ("up", "line"), ("down", "line")):
        first, count = sequence[f"{side}_{unit}s"]
        found[f"{side}_FIRST_{unit}".upper()] = first
        found[f"{side}_{unit}s".upper()] = count
    for axis, content in manifest["axes"].items():
        found |= {f"{axis.upper()}_{key}": value for key, value in _axis_constants(content).items()}
    return found


def _axis_constants(axis: Mapping[str, Any]) -> dict[str, int]:
    line, table, fourier, output = (axis[key] for key in ("line", "table", "fourier", "output"))
    degree = {"direct": 0, "interpolated": 1, "cubic": 3}[table["mode"]]
    return {
        "TABLE_LENGTH": len(table["words"]),
        "TABLE_BITS": table["bits"],
        "INDEX_BITS": len(table["words"]).bit_length() - 1 if degree else 0,
        "INTERPOLATED": degree,
        "GUARD_BITS": table["guard_bits"],
        "HARMONICS": fourier["harmonics"],
        "FOURIER_LENGTH": 1 + len(fourier["a_words"]) + len(fourier["b_words"]),
        "FOURIER_FRACTION_BITS": 30,
        "HOLD_TICKS": line["hold_ticks"],
        "PHASE_PERIOD": line["ticks"] // line["hold_ticks"],
        "PHASE_STEP": line["phase_step"],
        "PHASE_REMAINDER": line["phase_remainder"],
        **{
            key.upper(): output[key]
            for key in (
                "gain_word",
                "gain_q",
                "offset_word",
                "offset_code",
                "code_min",
                "code_max",
                "max_step",
                "park_code",
                "dac_bits",
            )
        },
        "DAC_WORD_BITS": output["word_bits"],
        "DAC_TWOS_COMPLEMENT": int(output["coding"] == "twos-complement"),
        "DAC_LEFT_ALIGNED": int(output["align"] == "left"),
    }


def fourier_words(axis: Mapping[str, Any]) -> list[int]:
    """The Fourier words of an axis of a manifest, in the order in which devices hold them."""
    fourier = axis["fourier"]
    words: list[int] = [fourier["a0_word"], *fourier["a_words"], *fourier["b_words"]]
    return words


def tool(name: str) -> str:
    """The path of a tool; one that is not installed, or not listed, fails the test by its name with the remedy."""
    path = shutil.which(name)
    assert path is not None, why_missing(name)
    assert os.sep in name or name in BASE | programs_of(PROGRAMS), f"{name} is of no package of listed_tools.PROGRAMS"
    return path


def run(
    command: Sequence[str | Path], folder: Path | None = None, environment: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a tool, whatever its exit status."""
    arguments = [tool(str(command[0])), *map(str, command[1:])]
    return subprocess.run(arguments, cwd=folder, env=environment, capture_output=True, text=True, check=False)


_OF_A_SCAN = re.compile(r"^warning: \S+\.toml:\d+: .*\n", re.MULTILINE)


def run_clean(command: Sequence[str | Path], folder: Path | None = None) -> str:
    """Run a tool that has to succeed and to have nothing to say on stderr; return its stdout.

    What a build in it says of the errors of a scan is no fault of the tool: short scans of tests have large ones.
    """
    result = run(command, folder)
    shown = f"{' '.join(map(str, command))}\n{result.stdout[-4000:]}{result.stderr[-4000:]}"
    assert result.returncode == 0, shown
    assert _OF_A_SCAN.sub("", result.stderr) == "", shown
    return result.stdout


def run_warned(command: Sequence[str | Path]) -> str:
    """The same of what builds a scan that is small for a test: of that it may be warned."""
    result = run(command)
    assert result.returncode == 0, f"{result.stdout[-4000:]}{result.stderr[-4000:]}"
    assert [line for line in result.stderr.splitlines() if not line.startswith("warning: ")] == []
    return result.stdout
