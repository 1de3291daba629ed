"""The layer that `tablegen refine` learnt: the check that it belongs to the scan, and its series."""

import hashlib
import json
from typing import Any

import msgspec
import numpy as np

from tablegen.base.input_errors import Problems
from tablegen.compensation.dynamics import Measured
from tablegen.config.load import Setup
from tablegen.config.scanner import ScannerAxis
from tablegen.config.schema import FastAxis, Refinement
from tablegen.planning.drive import Drive
from tablegen.waveform.series import FourierSeries

# How far a scan may be from the one at which a layer was learnt: docs/refine.md has what it is worth at the edges.
AMPLITUDE_REACH = 0.05  # relative difference
OFFSET_REACH = 0.05  # share of the driver's range
RATE_REACH = 0.2  # relative difference
TURN_REACH = 0.02
WINDOW_REACH = 0.02  # share of the line beyond the measured window


def model_digest(setup: Setup, axis: str, drive: Drive) -> str:
    """Return 16 hexadecimal digits of hysteresis and dynamics in the scanner file: what the layer was learnt over.

    The converter's hold is part of it, since builds undo it: layers of earlier versions may have learnt it.
    """
    scanner: ScannerAxis = getattr(setup.scanner, axis)
    parts = ["hold", *(_without_unset(msgspec.to_builtins(part)) for part in (scanner.hysteresis, scanner.resonance))]
    if scanner.hysteresis is not None:
        parts += scanner.hysteresis.contents(setup.scanner_folder)
    if isinstance(drive.response, Measured):  # the content of the file that it names
        parts += [drive.response.f_hz.tolist(), drive.response.gain.tolist(), drive.response.phase_turns.tolist()]
    plain = json.dumps(parts, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(plain.encode("ascii")).hexdigest()[:16]


def _without_unset(value: Any) -> Any:
    """Return a value without the keys that are not set: keys that a later version adds then change nothing."""
    if isinstance(value, dict):
        return {key: _without_unset(item) for key, item in value.items() if item is not None}
    return [_without_unset(item) for item in value] if isinstance(value, list) else value


def learnt_layer(
    setup: Setup, axis: str, drive: Drive, rate_hz: float, harmonics: int, problems: Problems
) -> FourierSeries | None:
    """Return the layer of one axis; None where the scan file has none, or where ``problems`` grew."""
    scan: FastAxis = getattr(setup.scan, axis)
    refinement = scan.refinement
    if refinement is None:
        return None
    faults = _faults(refinement, scan, drive, rate_hz, setup.scanner.driver.span)
    if len(refinement.a) > harmonics:
        why = f"{len(refinement.a)} harmonics, and the band limit passes {harmonics}"
        faults.append(("a", why))
    if refinement.model is not None and refinement.model != model_digest(setup, axis, drive):
        why = f"learnt over another {axis}.hysteresis or {axis}.resonance of the scanner file"
        faults.append(("model", f"{why}, or by tablegen before 0.3.0, which left the converter's hold to the layer"))
    for key, why in faults:
        problems.add(setup.scan_file, f"{axis}.refinement.{key}", f"{why}; {_remedy(axis)}")
    return None if faults else FourierSeries(0.0, np.array(refinement.a), np.array(refinement.b))


def _remedy(axis: str) -> str:
    return f"remove [{axis}.refinement], build, and run tablegen refine on a new trace"


def _faults(layer: Refinement, scan: FastAxis, drive: Drive, rate_hz: float, span: float) -> list[tuple[str, str]]:
    """Return the keys by which the scan differs from the one at which the layer was learnt, each with the reason."""
    faults = []
    if abs(drive.v_amplitude - layer.v_amplitude) > AMPLITUDE_REACH * layer.v_amplitude:
        by = 100.0 * (drive.v_amplitude / layer.v_amplitude - 1.0)
        why = f"learnt at {layer.v_amplitude:.6g} V, this scan drives {drive.v_amplitude:.6g} V"
        faults.append(("v_amplitude", f"{why}, {by:+.3g} % of it; up to {100 * AMPLITUDE_REACH:g} % are served"))
    if abs(drive.v_offset - layer.v_offset) > OFFSET_REACH * span:
        why = f"learnt at {layer.v_offset:.6g} V, this scan is at {drive.v_offset:.6g} V"
        by = drive.v_offset - layer.v_offset
        faults.append(("v_offset", f"{why}, {by:+.4g} V off; up to {OFFSET_REACH * span:g} V are served"))
    if abs(rate_hz - layer.rate_hz) > RATE_REACH * layer.rate_hz:
        by = 100.0 * (rate_hz / layer.rate_hz - 1.0)
        why = f"learnt at {layer.rate_hz:.6g} Hz, this scan has {rate_hz:.6g} Hz"
        faults.append(("rate_hz", f"{why}, {by:+.3g} % of it; up to {100 * RATE_REACH:g} % are served"))
    if abs(drive.turn - layer.turn) > TURN_REACH + 1e-12:
        why = f"learnt at {layer.turn:.6g}, this scan turns at {drive.turn:.6g}"
        by = drive.turn - layer.turn
        faults.append(("turn", f"{why}, {by:+.3g} off; up to {TURN_REACH:g} are served"))
    (low, high), limit = layer.window, scan.band_limit
    beyond = max(low - limit.window[0], limit.window[1] - high)
    if beyond > WINDOW_REACH + 1e-12:
        why = f"learnt over {low:g}..{high:g}, this scan images {limit.window[0]:g}..{limit.window[1]:g}"
        faults.append(("window", f"{why}, {beyond:.3g} beyond; up to {WINDOW_REACH:g} are served"))
    if limit.directions == "both" and layer.directions != "both":
        faults.append(("directions", "learnt forward only, and this scan images both directions"))
    return faults
