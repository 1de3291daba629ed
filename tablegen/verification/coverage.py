"""The modules and options of an emitted runtime that a session plays, and those that it does not."""

from collections.abc import Iterable, Sequence

from tablegen.fixedpoint.program import Program
from tablegen.verification.play.placement import Placement

_ALWAYS = {
    "dac_sequencer", "dac_fit", "dac_bank", "dac_scan", "dac_markers", "dac_window", "dac_pixels", "dac_register",
    "dac_verdict", "dac_faults", "dac_whole", "dac_whole_table", "dac_coding", "dac_spi", "dac_axi_stream", "dac_boot",
}  # fmt: skip
_PIPELINED = {"dac_axis", "dac_output", "dac_offset", "dac_slew", "dac_delay"}
_BY_TURNS = {
    "dac_pair", "dac_pair_delay", "dac_pair_interpolator", "dac_pair_output", "dac_pair_phase", "dac_pair_ring",
    "dac_pair_slew", "dac_pair_table", "dac_pair_words", "dac_delay", "dac_skew", "dac_multiply_digits",
}  # fmt: skip
_RENDERER = {"dac_render", "dac_fourier", "dac_fourier_product", "dac_fourier_sum"}
_SPLINE = {"dac_phase", "dac_spline", "dac_spline_step", "dac_direct_table"}
_LINES = {"dac_phase", "dac_table", "dac_memory", "dac_interpolator"}
_BLOCKS = {"dac_multiply_plain", "dac_product"}
_SLOW_PART = {
    "dac_slow_axis", "dac_slow_boot", "dac_slow_divide", "dac_slow_engine", "dac_slow_fit", "dac_slow_part",
    "dac_slow_store", "dac_axis_serial", "dac_spline_terms",
}  # fmt: skip


def played_modules(placement: Placement, programs: Sequence[Program], has_pixel_table: bool = False) -> set[str]:
    """Return the Verilog modules that a session of programs of x and y elaborates."""
    modes = {program.mode for program in programs}
    played = set(_ALWAYS) | (_RENDERER if placement.fourier else set())
    if placement.shaping:
        played.add("dac_shaper")
    if has_pixel_table:
        played |= {"dac_pixel_table", "dac_pixel_boot"}
    if placement.axis == "serial":
        return played | {"dac_axis_serial"} | ({"dac_spline_terms"} if "cubic" in modes else set())
    if placement.axis == "alternate":
        return played | _BY_TURNS
    played |= _PIPELINED | (_BLOCKS if placement.axis == "blocks" else {"dac_multiply_digits"})
    for mode, modules in (("interpolated", _LINES), ("cubic", _SPLINE), ("direct", {"dac_direct_table"})):
        if mode in modes:
            played |= modules
    if "interpolated" in modes and placement.axis != "blocks":
        played.add("dac_skew")
    return played


def unplayed_verilog(
    files: Iterable[str],
    placements: Sequence[Placement],
    programs: Sequence[Program],
    has_pixel_table: bool = False,
    has_z: bool = False,
) -> list[str]:
    """List the files of a runtime, and the options of its sequencer, that no session of these placements plays.

    The top of z, where there is one, plays a slow part.
    """
    played = set().union(*(played_modules(placement, programs, has_pixel_table) for placement in placements))
    played |= _SLOW_PART if has_z else set()
    unplayed = sorted(name for name in files if name.removesuffix(".v") not in played)
    options = [
        f"PLAIN_MULTIPLIER = {int(axis == 'blocks')}"
        for axis in ("pipelined", "blocks")
        if axis not in {one.axis for one in placements}
    ]
    if "serial" not in {one.axis for one in placements}:
        options.append("LOW_AREA = 1")
    if "alternate" not in {one.axis for one in placements}:
        options.append("ALTERNATE = 1")
    if not any(one.fourier for one in placements):
        options.append("FOURIER = 1")
    highest = max(one.shaping for one in placements)
    if highest < 3:
        options.append(f"SHAPING above {highest}")
    return [*unplayed, f"dac_sequencer.v with {', '.join(options)}"]


def unplayed_c(files: Iterable[str], fourier: bool) -> list[str]:
    """List the C files of a runtime that no session plays: the link, and rendering unless ``fourier``."""
    return sorted(name for name in files if name.startswith("dac_link") or (name == "dac_fourier.c" and not fourier))
