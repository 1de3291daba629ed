"""The check that the passage that a certificate states is that of its axis."""

from math import isclose

import numpy as np

from tablegen.manifest.fields import ManifestAxis, ManifestPassage
from tablegen.numerics.arrays import Floats
from tablegen.verification.checks.certified import played_series
from tablegen.verification.checks.passage import passes
from tablegen.verification.checks.scaling import hold_response, reached

_SAME = 1e-9  # of the largest harmonic; both ways are in float64


def wrong_passage(axis: ManifestAxis, rate_hz: float) -> list[str]:
    """Check the passage against the axis: the response that takes harmonics to their target, or their band."""
    stated, resonance = axis.certificate.shaped, axis.drive.resonance
    if (stated is None) != (axis.output.shaping is None):
        return [
            "certificate.shaped is there, and the output does not shape" if stated else "certificate.shaped is missing"
        ]
    if stated is None:
        return _wrong_response(axis, rate_hz)
    passage = stated.passage
    if resonance is None:
        band = axis.fourier.harmonics * rate_hz
        right = passage == ManifestPassage(band_hz=passage.band_hz) and isclose(passage.band_hz or 0.0, band)
        return [] if right else [f"certificate.shaped.passage is not the band up to {band:.6g} Hz"]
    if passage.band_hz is not None or not _follows(axis, passage, rate_hz) or not _is_resonance(axis, passage):
        return ["certificate.shaped.passage is not the response that was compensated"]
    return []


def _wrong_response(axis: ManifestAxis, rate_hz: float) -> list[str]:
    """Check the response behind which the position of an unshaped axis is judged."""
    stated, resonance = axis.certificate.position, axis.drive.resonance
    if stated is None or resonance is None:
        return []
    passage = stated.passage
    known = passage.response is not None or (passage.frequency_hz is not None and passage.quality is not None)
    if known and passage.band_hz is None and _follows(axis, passage, rate_hz) and _is_resonance(axis, passage):
        return []
    return ["certificate.position.passage is not the response that was compensated"]


def _follows(axis: ManifestAxis, passage: ManifestPassage, rate_hz: float) -> bool:
    """Return True if the waveform that is played arrives as the one that the axis is to follow."""
    program, played, target = axis.program, played_series(axis), reached(axis)
    real, imaginary = hold_response(axis.fourier.harmonics, program.phase.ticks, program.hold > 1)
    f_hz: Floats = rate_hz * np.arange(1, axis.fourier.harmonics + 1, dtype=np.float64)
    if passage.response is not None and f_hz[-1] > passage.response.hz[-1]:
        return False
    output = (np.array(played.a) - 1j * np.array(played.b)) * (real + 1j * imaginary)
    arrives = np.asarray(output * passes(passage, f_hz))
    intended = np.array(target.a) - 1j * np.array(target.b)
    return bool(np.max(np.abs(arrives - intended)) <= _SAME * max(float(np.max(np.abs(intended))), 1e-300))


def _is_resonance(axis: ManifestAxis, passage: ManifestPassage) -> bool:
    """Return True if the resonance of the passage, above the harmonics too, is that of the axis."""
    resonance = axis.drive.resonance
    assert resonance is not None
    if passage.response is not None:
        return isclose(passage.response.hz[int(np.argmax(passage.response.gain))], resonance.hz)
    half = (passage.frequency_hz or 0.0) / (2.0 * (passage.quality or 1.0))
    return isclose(passage.frequency_hz or 0.0, resonance.hz) and isclose(half, resonance.half_width_hz)
