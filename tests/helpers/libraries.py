"""A library of three short scans that differ in all that one runtime lets them differ in, and sweeps of it."""

import tomllib
from pathlib import Path

from editing import SCAN, SCANNER, edited, write_pair
from sine_scans import short_sine

from tablegen.device.dual_program import DualProgram
from tablegen.manifest.read import read_build

BASE = edited(
    SCAN,
    'name = "lines"',
    "dac.update_rate_hz = 100e3",
    "timing.line_rate_hz = 500.0",
    "timing.lines = 12",
    "timing.pixels = 20",
    "x.band_limit.harmonics = 24",
    "y.band_limit.harmonics = 64",
    "x.table.length = 128",
    "y.table.length = 256",
    "- [limits]",
)
DAMPED = edited(SCANNER, "x.resonance.quality = 2.0")  # ticks as coarse as these drive a sharp one, with a warning
SCANS = """
[[scans]]
name = "narrow"
x.size_nm = 150.0

[[scans]]
name = "broad"
x = { size_nm = 400.0, offset_v = 45.0 }
timing.line_rate_hz = 625.0
timing.lines = 10

[[scans]]
name = "even"
y.size_nm = 300.0
[scans.x]
band_limit.harmonics = 20
"""
NAMES = ("narrow", "broad", "even")
SINES = """
[[scans]]
name = "left"
x.offset_v = 45.0

[[scans]]
name = "right"
x.offset_v = 55.0
"""
SINE_NAMES = ("left", "right")


def write_library(folder: Path, scans: str = SCANS, base: str = BASE) -> Path:
    """The scan file with its ``[[scans]]``, beside its scanner file."""
    return write_pair(folder, base + scans, DAMPED)


def write_sines(folder: Path) -> Path:
    """Write the scan file of two scans whose x is a sine and whose pixels have a table, and its scanner."""
    short_sine(folder, "name = 'lines'", "x.table.length = 128", "y.table.length = 128")
    path = folder / "scan.toml"
    path.write_text(path.read_text("utf-8") + SINES, "utf-8")
    return path


def programs(library: Path, names: tuple[str, ...] = NAMES) -> list[DualProgram]:
    """What each program plays, by its manifest."""
    return [read_build(library / name).program for name in names]


def loaded(text: str) -> dict[str, object]:
    """TOML as values."""
    return tomllib.loads(text)
