"""The layer that `tablegen refine` learnt of a scan at an angle: its parts, and the check that they belong to it."""

import numpy as np

from tablegen.base.input_errors import Problems
from tablegen.compensation.operator.frame_layer import FrameLayer
from tablegen.compensation.operator.turned_frame import FrameMotion
from tablegen.config.load import Setup
from tablegen.config.schema import FastAxis, FrameRefinement
from tablegen.planning.line_plan import LinePlan
from tablegen.planning.refinement_layer import (
    AMPLITUDE_REACH,
    OFFSET_REACH,
    RATE_REACH,
    TURN_REACH,
    WINDOW_REACH,
    model_digest,
)
from tablegen.waveform.series import FourierSeries


def learnt_frame_layer(setup: Setup, line: LinePlan, motion: FrameMotion, problems: Problems) -> FrameLayer | None:
    """Return the layer of one axis; None where the scan file has none, or where ``problems`` grew.

    Parameters
    ----------
    line
        The axis of the same scan at 0 degrees.
    motion
        What the axis is to do.
    """
    scan: FastAxis = getattr(setup.scan, line.axis)
    layer = scan.frame_refinement
    if layer is None:
        return None
    faults = _faults(setup, line, motion, layer)
    for key, why in faults:
        remedy = f"remove [{line.axis}.frame_refinement], build, and run tablegen refine on a new trace"
        problems.add(setup.scan_file, f"{line.axis}.frame_refinement.{key}", f"{why}; {remedy}")
    if faults:
        return None
    parts = [
        FourierSeries(0.0, np.array(a), np.array(b))
        for a, b in ((layer.line_a, layer.line_b), (layer.frame_a, layer.frame_b))
    ]
    return FrameLayer(*parts)


def _faults(setup: Setup, line: LinePlan, motion: FrameMotion, layer: FrameRefinement) -> list[tuple[str, str]]:
    """Return the keys by which the scan differs from the one at which the layer was learnt, each with the reason."""
    faults = []
    for part in ("line", "frame"):
        if len(getattr(layer, f"{part}_a")) != len(getattr(layer, f"{part}_b")):
            faults.append((f"{part}_b", f"has another number of harmonics than {part}_a"))
    reach = AMPLITUDE_REACH * motion.longest_nm
    for key, then, now in (("line_nm", layer.line_nm, motion.fast_nm), ("frame_nm", layer.frame_nm, motion.slow_nm)):
        if abs(now - then) > reach:
            why = f"learnt at {then:.6g} nm, this scan has {now:.6g} nm; up to {reach:.3g} nm are served"
            faults.append((key, why))
    offset = OFFSET_REACH * setup.scanner.driver.span
    if abs(line.drive.v_offset - layer.v_offset) > offset:
        why = f"learnt at {layer.v_offset:.6g} V, this scan is at {line.drive.v_offset:.6g} V"
        faults.append(("v_offset", f"{why}; up to {offset:g} V are served"))
    if abs(motion.line_rate_hz - layer.rate_hz) > RATE_REACH * layer.rate_hz:
        why = f"learnt at {layer.rate_hz:.6g} Hz, this scan has {motion.line_rate_hz:.6g} Hz"
        faults.append(("rate_hz", f"{why}; up to {100 * RATE_REACH:g} % are served"))
    if layer.lines != motion.lines:
        faults.append(("lines", f"learnt on a frame of {layer.lines} line periods, this scan has {motion.lines}"))
    if abs(motion.fast_turn - layer.turn) > TURN_REACH + 1e-12:
        faults.append(("turn", f"learnt at {layer.turn:.6g}, this scan turns at {motion.fast_turn:.6g}"))
    (low, high), (least, most) = layer.window, motion.fast_window
    if max(low - least, most - high) > WINDOW_REACH + 1e-12:
        faults.append(("window", f"learnt over {low:g}..{high:g}, this scan images {least:g}..{most:g}"))
    if layer.model is not None and layer.model != model_digest(setup, line.axis, line.drive):
        why = f"learnt over another {line.axis}.hysteresis or {line.axis}.resonance of the scanner file"
        faults.append(("model", why))
    return faults
