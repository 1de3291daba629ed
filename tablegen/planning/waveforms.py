"""Make the waveform that is played from the drive of an axis: band limit, inverse dynamics, converter's hold."""

import numpy as np
from msgspec import Struct

from tablegen.base.input_errors import Problems, Unphysical
from tablegen.compensation.dynamics import capped_inverse
from tablegen.compensation.hold import hold_inverse
from tablegen.config.load import Setup
from tablegen.config.schema import FastAxis
from tablegen.planning.band_limit import band_limited, minimum_acceleration_line
from tablegen.planning.drive import Drive
from tablegen.planning.harmonic_choice import HarmonicChoice
from tablegen.planning.refinement_layer import learnt_layer
from tablegen.planning.timing import AxisTiming
from tablegen.waveform.series import FourierSeries


class Waveforms(Struct, frozen=True, eq=False):
    """The waveforms of one axis, as ``LinePlan`` describes them."""

    target: FourierSeries
    drive_series: FourierSeries
    series: FourierSeries
    held_harmonics: tuple[int, ...]
    layer: FourierSeries | None
    kept_percent: float | None


def make_waveforms(
    setup: Setup,
    axis: str,
    timing: AxisTiming,
    drive: Drive,
    choice: HarmonicChoice,
    harmonics: int,
    problems: Problems,
) -> Waveforms | None:
    """Limit the band of a drive's shape, and undo what dynamics and hold do to it; None where ``problems`` grew."""
    before = len(problems.entries)
    rate_hz = float(timing.rate)
    layer = learnt_layer(setup, axis, drive, rate_hz, harmonics, problems)
    if len(problems.entries) > before:
        return None
    target, kept_percent = None, None
    with problems.at(setup.scan_file, choice.key):
        target, kept_percent = _target(setup, axis, drive, choice, harmonics, layer)
    if target is None:
        return None
    at_piezo: FourierSeries = target
    reduced: tuple[int, ...] = ()
    if drive.response is not None:
        with problems.at(setup.scanner_file, f"{axis}.resonance.response"):
            at_piezo, reduced = _through_inverse(target, drive, rate_hz)
    series = at_piezo.times(*hold_inverse(harmonics, timing.period, steps=timing.hold > 1))
    return Waveforms(target, at_piezo, series, reduced, layer, kept_percent)


def _target(
    setup: Setup, axis: str, drive: Drive, choice: HarmonicChoice, harmonics: int, layer: FourierSeries | None
) -> tuple[FourierSeries, float | None]:
    """Return what the piezo is to follow, and the scaling error for which it has minimum acceleration."""
    scan: FastAxis = getattr(setup.scan, axis)
    if drive.resting:
        return FourierSeries(0.5, np.zeros(1), np.zeros(1)), None
    if drive.allowed is None:
        return band_limited(drive.shape, scan.band_limit, harmonics, layer), None
    try:
        return minimum_acceleration_line(drive.shape, scan.band_limit, harmonics, layer, drive.allowed)
    except Unphysical as reason:
        raise choice.with_advice(drive, harmonics, layer, reason) from None


def _through_inverse(target: FourierSeries, drive: Drive, rate_hz: float) -> tuple[FourierSeries, tuple[int, ...]]:
    """Divide each harmonic by the response at its frequency, with the boost limited."""
    assert drive.response is not None
    n = np.arange(1.0, target.harmonics + 1.0)
    real, imaginary, reduced = capped_inverse(drive.response, n * rate_hz, drive.max_boost_db)
    return target.times(real, imaginary), tuple(int(h) for h in n[reduced])
