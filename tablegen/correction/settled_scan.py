"""The positions of a scan by the scanner file: the drive of each axis, its settled loop, creep and dynamics."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from tablegen.base.input_errors import Document, Problems, Rejected, Unphysical
from tablegen.compensation import models
from tablegen.compensation.frequency import frequency_gain
from tablegen.compensation.line import LineRequest
from tablegen.compensation.model_problems import ModelProblems
from tablegen.compensation.offset import OffsetLaw
from tablegen.compensation.offset_sizes import OffsetSurface
from tablegen.compensation.operator.settled import settled
from tablegen.compensation.size import SizeLaw
from tablegen.config.scanner import Scanner, ScannerAxis
from tablegen.correction.distortion import Distortion, Sweep1D
from tablegen.numerics.arrays import Floats
from tablegen.planning.laws import dynamics_of, offset_surface, outside_driver, size_law_of

_COUNT = 8192  # drives of a period
_ROUNDS = 30  # of a contraction that reduces an error to less than a tenth
_BEYOND = 1e-3  # of the driver's range: by how much a drive may leave the driver's range in its last digits

Waveform = Callable[[Floats], Floats]  # of times in periods, 0 where the sweep there begins


@dataclass(frozen=True, eq=False)
class AxisScan:
    """The drive of one axis: volts at the piezo against the time in periods, and the imaged part.

    ``turn`` is the time at which the sweep back begins, in periods; ``window`` the part of each sweep that the pixels
    span.

    Raises
    ------
    Unphysical
        If the turn or the window is out of range.
    """

    volts: Waveform
    rate_hz: float
    turn: float
    window: tuple[float, float] = (0.0, 1.0)

    def __post_init__(self) -> None:
        if not 0.0 < self.turn <= 1.0:
            raise Unphysical(f"a turn of {self.turn:g} is outside 0..1")
        low, high = self.window
        if not (0.0 <= low < high <= 1.0 and high - low >= 0.01):
            raise Unphysical(f"a window of {low:g}..{high:g} is no part of the sweep, 0..1")

    def drive(self) -> Floats:
        """Return the drive at even times of a period.

        Returns
        -------
        Drive in V, shape (8192,).
        """
        return self.volts(np.arange(_COUNT) / _COUNT)


def triangle(size_v: float, offset_v: float, turn: float) -> Waveform:
    """Return the triangle (14) of an instrument without correction; a turn of 1 gives a sawtooth."""

    def volts(time: Floats) -> Floats:
        back = (1.0 - time) / max(1.0 - turn, 1e-12)
        return offset_v + size_v * (np.where(time <= turn, time / turn, back) - 0.5)

    return volts


@dataclass(frozen=True, eq=False)
class ScannerModel:
    """A scanner file, the positions of its keys, and the folder of the files that it names."""

    scanner: Scanner
    file: Document
    folder: Path

    def position(self, axis: Literal["x", "y"], scan: AxisScan) -> Floats:
        """Return the position at even times of a period.

        Returns
        -------
        Position in nm from near the lower turn on, shape (8192,).

        Raises
        ------
        Rejected
            If the scanner or scan file has unsuitable keys, which the message names.
        Unphysical
            If the driver cannot put out the drive.
        """
        its: ScannerAxis = getattr(self.scanner, axis)
        driver = self.scanner.driver
        drive = scan.drive()
        low, high = float(np.min(drive)), float(np.max(drive))
        for volts in (low, high):
            if driver.beyond(volts, volts) > _BEYOND * driver.span:
                raise Unphysical(f"{axis}: {outside_driver(volts, driver)}")
        problems = Problems()
        size_law: SizeLaw | None = None
        with problems.at(self.file, f"{axis}.size.base_nm"):
            size_law = size_law_of(its.size, driver)
        surface = OffsetSurface.everywhere(OffsetLaw())
        if its.offset is not None and size_law is not None:
            with problems.at(self.file, f"{axis}.offset"):
                surface = offset_surface(its.offset, driver, size_law)
        gain, law = 1.0, its.frequency
        if law is not None:
            with problems.at(self.file, f"{axis}.frequency.alpha"):
                gain = frequency_gain(scan.rate_hz, law.alpha, law.reference_hz)
        response = None
        if its.resonance is not None:
            with problems.at(self.file, f"{axis}.resonance"):
                response = dynamics_of(its.resonance, self.folder)
        problems.stop_if_any()
        assert size_law is not None
        amplitude, offset_v = (high - low) / driver.span, float(np.mean(drive))
        share = _scan_share(surface, driver.p(offset_v), gain, amplitude)
        hysteresis = models.get(models.UNCOMPENSATED)() if its.hysteresis is None else its.hysteresis
        request = LineRequest(
            axis=axis,
            turn=scan.turn,
            v=share,
            driver=driver,
            v_amplitude=high - low,
            v_offset=offset_v,
            size_nm=size_law.size_nm(share),
            rate_hz=scan.rate_hz,
            harmonics=64,
            window=scan.window,
            both=True,
            response=response,
            max_boost_db=0.0 if its.resonance is None else its.resonance.max_boost_db,
            factor_at=lambda v: surface.small.factor(driver.p(driver.volts(v))),
            rate_gain=None if law is None else lambda hz: frequency_gain(hz, law.alpha, law.reference_hz),
            folder=self.folder,
        )
        parts = hysteresis.loop(
            request,
            driver.share(low),
            driver.share(high),
            ModelProblems(axis, Document("the image", None), self.file, problems),
        )
        problems.stop_if_any()
        if parts is None:
            raise Rejected(problems.entries)
        loop, creep, dynamics = parts
        return settled(loop, driver.share(drive), scan.rate_hz, creep, dynamics)


def _scan_share(surface: OffsetSurface, p: float, gain: float, amplitude: float) -> float:
    """Return V_scan as a share of v_max where m g V_scan is ``amplitude``, since m may depend on V_scan."""
    share = amplitude
    for _ in range(_ROUNDS):
        share = amplitude / (surface.at(share).factor(p) * gain)
    return min(share, 1.0)


def scanner_distortion(
    model: ScannerModel,
    x: AxisScan,
    y: AxisScan,
    rows: int,
    columns: int,
    lines: int | None = None,
    back: bool = False,
    sides: tuple[bool, ...] = (True, False),
    delay_pixels: float = 0.0,
) -> Distortion:
    """Compute the positions of the pixels of a scan, in nm, 0 at the left edge and at the first row.

    Columns are evenly spread in time over the window of each sweep of ``x``; they show the sample ``delay_pixels``
    late. Rows follow each other, ``lines`` per period of ``y``, from the beginning of its window, on its way up, or
    ``back``; see ``lines_of``.

    Raises
    ------
    Rejected
        If the scanner file does not suit the scan.
    Unphysical
        If the driver cannot put out the drive, or an axis stands still or goes back.
    """
    position_nm = model.position("x", x)
    low, high = x.window
    place = low + (high - low) * (np.arange(columns) + 0.5) / columns
    late = delay_pixels * (high - low) / columns
    sweeps: dict[bool, Sweep1D] = {}
    for forward in sides:
        way = (place if forward else 1.0 - place) - late
        time = x.turn * way if forward else x.turn + (1.0 - x.turn) * way
        sweeps[forward] = Sweep1D(_at(position_nm, time), time)
    begin = y.turn + (1.0 - y.turn) * (1.0 - y.window[1]) if back else y.turn * y.window[0]
    frame = begin + np.arange(rows + 1) / (lines or lines_of(rows, y, back))
    slow = _at(model.position("y", y), frame) * (-1.0 if back else 1.0)
    whole = Distortion(rows, columns, sweeps.get(True), sweeps.get(False), slow, np.zeros(rows + 1))
    whole.check()
    left_edge, top = whole.x_range[0], whole.y_range[0]

    def shifted(one: Sweep1D | None) -> Sweep1D | None:
        return None if one is None else replace(one, x=one.x - left_edge)

    return replace(whole, forward=shifted(whole.forward), backward=shifted(whole.backward), y=whole.y - top)


def lines_of(rows: int, y: AxisScan, back: bool = False) -> int:
    """Return the lines per period of the slow axis, of which the window of one way has so many rows."""
    return round(rows / ((1.0 - y.turn if back else y.turn) * (y.window[1] - y.window[0])))


def _at(position_nm: Floats, time: Floats) -> Floats:
    values: Floats = np.interp(time, np.arange(len(position_nm)) / len(position_nm), position_nm, period=1.0)
    return values
