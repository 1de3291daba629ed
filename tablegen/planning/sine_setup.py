"""The setup of a scan whose fast axis moves as a sine: what it cannot have, and the keys that follow from the sine."""

from typing import Literal

from msgspec.structs import replace

from tablegen.base.input_errors import Problems
from tablegen.config.load import Setup
from tablegen.config.schema import DEFAULT_FORMATS, SEQUENCER_FORMATS, Scan

SINE = "a straight line is needed here, and this may be a sine; leave it out, or take 'line'"
_DEFAULT_PIXEL_FORMATS = ("c",)  # a build of today keeps its files
_HARMONICS = "a sine has one harmonic of the drive; leave this out, or take motion = 'line'"


def default_formats(scan: Scan) -> tuple[str, ...]:
    """Return the formats of a build: as written, or those that play its motion, and its output z."""
    usual = scan.x.motion == "line" and scan.z is None
    return tuple(scan.emit.formats or (DEFAULT_FORMATS if usual else _DEFAULT_PIXEL_FORMATS))


def with_motion(setup: Setup, motion: Literal["line", "sine"]) -> Setup:
    """Return a setup that leaves its motion to the build with one of them; its band limit is that of a line."""
    scan, x = setup.scan, setup.scan.x
    if motion == "sine":
        limit = replace(x.band_limit, harmonics=None, max_scaling_error_percent=None, cutoff_hz=None)
        x = replace(x, band_limit=limit)
    emit = replace(scan.emit, formats=list(default_formats(scan)))
    return replace(setup, scan=replace(scan, x=replace(x, motion=motion), emit=emit))


def sine_setup(setup: Setup, problems: Problems) -> Setup:
    """Return the setup with one harmonic and the formats that play it; contradictions go to ``problems``."""
    scan, file = setup.scan, setup.scan_file
    limit = scan.x.band_limit
    for name in ("harmonics", "max_scaling_error_percent", "cutoff_hz"):
        if getattr(limit, name) is not None:
            problems.add(file, f"x.band_limit.{name}", _HARMONICS)
    if scan.x.turn != 0.5:
        problems.add(file, "x.turn", f"{scan.x.turn:g} of the period is not half of it, where a sine turns; take 0.5")
    if limit.directions != "both":
        problems.add(file, "x.band_limit.directions", "a sine images in trace and retrace; take 'both'")
    if scan.x.refinement is not None:
        problems.add(
            file, "x.refinement", "the layer belongs to a straight line; leave it out, or take motion = 'line'"
        )
    for i, name in enumerate(scan.emit.formats or ()):
        if name not in SEQUENCER_FORMATS:
            why = (
                f"{name!r} has no table of pixels, which a sine needs; take motion = 'line', or one of "
                f"{', '.join(SEQUENCER_FORMATS)}"
            )
            problems.add(file, f"emit.formats[{i}]", why)
    x = replace(scan.x, band_limit=replace(limit, harmonics=1, max_scaling_error_percent=None, cutoff_hz=None))
    return replace(setup, scan=replace(scan, x=x))
