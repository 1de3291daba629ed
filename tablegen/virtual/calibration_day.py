"""A simulated calibration session: the virtual scanner's own data through the fits of ``tablegen.calibration``.

The result is the scanner file that a laboratory would have, noise included: only measured quantities enter it.
It needs scipy, of the extra ``calibrate``.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from typing import Any, Literal, TypeVar

import msgspec
import numpy as np
from msgspec.structs import replace

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.frequency import fit_frequency
from tablegen.calibration.laws.hysteresis import HysteresisFit, Trace, fit_hysteresis
from tablegen.calibration.laws.image_sizes import (
    Acquisition,
    ImageSizes,
    KnownSample,
    SampleImage,
    apparent_of,
    sizes_of,
)
from tablegen.calibration.laws.images import Pair, fit_images
from tablegen.calibration.laws.offset_sizes import fit_offset_sizes
from tablegen.calibration.laws.resonance import ResonanceFit, fit_resonance
from tablegen.calibration.laws.size import SizeFit, fit_size
from tablegen.calibration.summary import change
from tablegen.compensation import models
from tablegen.compensation.size import SizeLaw
from tablegen.config.load import Setup
from tablegen.config.scanner import Frequency, Offset, Resonance, ScannerAxis, Size
from tablegen.fitting.estimate import Fit
from tablegen.images.line_length import Cell, Grating
from tablegen.numerics.arrays import Floats
from tablegen.virtual.experiments import actual_sizes, apparent_sizes, frequency_response, sensor_trace
from tablegen.virtual.imaging import Surface, grating, hexagonal, image_pair
from tablegen.virtual.scanner import VirtualAxis, VirtualScanner
from tablegen.virtual.sensor import Sensor

T = TypeVar("T")
_AXES: tuple[Literal["x", "y"], ...] = ("x", "y")
NOISE = 0.002  # rms noise of every reading, relative to the scan or to the value
# Shares of v_max. Offsets stay away from the ends, as the paper advises.
OFFSETS = (0.07, 0.285, 0.5, 0.715, 0.93)
OFFSET_SIZE = 0.13
OFFSET_SIZES = (0.06, 0.13, 0.25, 0.4, 0.55)  # where m is measured over the size too
OFFSET_ROOM = 0.97  # of the offsets at which a scan of such a size fits, those that are used
SIZES = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
AMPLITUDES = (0.2, 0.4, 0.6, 0.8, 1.0)
SMALL_IMAGE, LATTICE_NM, GRATING_NM = 0.2, 17.7, 50.0
SAMPLES_SEEN = KnownSample(Cell.hexagonal(LATTICE_NM), Grating(GRATING_NM))
IMAGED_SIZES = SIZES[1:]  # shares of v_max: below, a lattice has too few periods
IMAGE_DRIFT, IMAGE_SLOPE = 0.02, 2e-3  # drift along x in a frame, of the line, at most; heights per nm
PERIODS, SAMPLES = 4, 1000  # periods per trace, samples per period


@dataclass(frozen=True)
class Calibration:
    """The calibrated setup, and by axis and kind the fits on which it rests."""

    setup: Setup
    fits: dict[str, dict[str, Fit]]


def calibrate(
    setup: Setup,
    scanner: VirtualScanner,
    noise: float = NOISE,
    seed: int = 0,
    amplitudes: Sequence[float] = AMPLITUDES,
    points: bool = True,
    images: bool = False,
    offset_sizes: Sequence[float] = (),
    sizes_from_images: bool = False,
) -> Calibration:
    """Measure both axes and fit what a scanner file holds; its base size, references and boost stay.

    Parameters
    ----------
    noise
        Rms noise of every reading, relative.
    amplitudes
        Peak-to-peak voltages of the traces, as shares of the driver's span.
    points
        True to write the hysteresis as measured at each amplitude, false to write (22) with one u_peak.
    images
        True to fit hysteresis to trace and retrace of a lattice and a grating (256 x 256 pixels, 5 % noise), false to
        fit it to a sensor's traces.
    offset_sizes
        Scan voltages, as shares of the span, of the images that give m; ``OFFSET_SIZE`` if empty.
    sizes_from_images
        True to fit size and offset to such images too, with drift and tilt, and not to sizes with ``noise``.

    Raises
    ------
    Unphysical
        If a fit fails.
    """
    axes: dict[str, ScannerAxis] = {}
    fits: dict[str, dict[str, Fit]] = {}
    for number, name in enumerate(_AXES):
        axis: VirtualAxis = getattr(scanner, name)
        day = _Day(setup, name, axis, noise, 1000 * (2 * seed + number), sizes_from_images)
        fits[name] = day.fits(amplitudes, images, offset_sizes)
        axes[name] = day.scanner_axis(fits[name], points)
    scan = msgspec.structs.replace(  # a refinement over another model does not fit this one
        setup.scan,
        x=msgspec.structs.replace(setup.scan.x, refinement=None),
        y=msgspec.structs.replace(setup.scan.y, refinement=None),
    )
    return Calibration(replace(setup, scan=scan, scanner=msgspec.structs.replace(setup.scanner, **axes)), fits)


class _Day:
    """The measurements of one axis, each with noise of its own."""

    def __init__(
        self, setup: Setup, name: Literal["x", "y"], axis: VirtualAxis, noise: float, seed: int, imaged: bool
    ) -> None:
        self._imaged = imaged
        self._axis, self._noise, self._seed = axis, noise, seed
        self._before: ScannerAxis = getattr(setup.scanner, name)
        self._driver = setup.scanner.driver
        self._turn: float = getattr(setup.scan, name).turn
        timing = setup.scan.timing
        self._rate_hz = timing.line_rate_hz if name == "x" else timing.line_rate_hz / timing.lines
        frequency = self._before.frequency
        self._reference_hz = self._rate_hz if frequency is None else frequency.reference_hz
        scan = getattr(setup.scan, name)
        self._scan_v: float = scan.size_v or scan.size_nm / self._before.size.k_nm_per_v

    def fits(self, amplitudes: Sequence[float], images: bool, offset_sizes: Sequence[float]) -> dict[str, Fit]:
        """Fit all that can be calibrated; a resonance only where the scanner file has one.

        Raises
        ------
        Unphysical
            If a fit fails. Where both the resonance and the hysteresis fail, the error is that of the hysteresis.
        """
        size = self._size()
        offset = self._offset(size, offset_sizes or (OFFSET_SIZE,))
        imaged = self._imaged_hysteresis(amplitudes) if images else None
        traces = [] if images else self._traces(amplitudes)
        gains = self._gains()
        resonance, delay_s = None, 0.0
        if self._before.resonance is not None:
            try:
                resonance = self._resonance(self._before.resonance)
            except Unphysical:
                if traces:  # of two errors that of the hysteresis is raised: without it there is nothing to correct
                    fit_hysteresis(traces, self._driver)
                raise
            # A build undoes this lag by the resonance; if it stayed in the loops, they would undo it a second time.
            lag_s = 1.0 / (2.0 * pi * resonance.frequency_hz.value * resonance.quality.value)
            delay_s = resonance.delay_s.value + lag_s
        fits: dict[str, Fit] = {
            "offset": offset,
            "size": size,
            "hysteresis": imaged or fit_hysteresis(traces, self._driver, delay_s=delay_s),
            "frequency": fit_frequency(gains["frequency_hz"], gains["gain"], self._reference_hz),
        }
        if resonance is not None:
            fits["resonance"] = resonance
        return fits

    def scanner_axis(self, fits: dict[str, Fit], points: bool) -> ScannerAxis:
        """Return the axis of a scanner file with these parameters, as ``tablegen calibrate --write`` writes them."""
        changes = {kind: change(fit, (), points) for kind, fit in fits.items()}
        branches = list(changes["hysteresis"].branches)
        resonance = None
        if self._before.resonance is not None:
            boost = {"max_boost_db": self._before.resonance.max_boost_db}
            resonance = _as(Resonance, {**changes["resonance"].values, **boost})
        return ScannerAxis(
            size=_as(Size, changes["size"].values),
            offset=_as(Offset, changes["offset"].values),
            hysteresis=_as(models.get(changes["hysteresis"].values["model"]), {"branches": branches}),
            frequency=_as(Frequency, changes["frequency"].values),
            resonance=resonance,
            dac=self._before.dac,
            amplifier=self._before.amplifier,
        )

    def _offset(self, size: SizeFit, sizes: Sequence[float]) -> Fit:
        """Fit m to images of one object at five offsets, for a large scan closer to the middle, so that it fits."""
        k, beta, threshold = size.k_nm_per_v.value, size.beta.value, size.v_threshold.value
        law = SizeLaw.calibrated(k, self._driver.span, beta, size.base_nm, threshold)
        groups = []
        for share in sizes:
            room = min(1.0, OFFSET_ROOM * (1.0 - share) / (OFFSETS[-1] - OFFSETS[0])) if len(sizes) > 1 else 1.0
            volts = [self._driver.volts(0.5 + room * (offset - 0.5)) for offset in OFFSETS]
            size_v = share * self._driver.span
            if self._imaged:
                image_sizes = self._images([(size_v, offset) for offset in volts])
                nm, errors = apparent_of(image_sizes, law, self._driver, SAMPLES_SEEN)
                groups.append((np.array(volts), nm, np.full(len(volts), size_v), errors))
                continue
            simulated = apparent_sizes(
                self._axis, volts, size_v, self._reference_hz, noise=self._noise, seed=self._next(), turn=self._turn
            )
            unknown = np.zeros(len(volts))
            groups.append((simulated["offset_v"], simulated["apparent_nm"], np.full(len(volts), size_v), unknown))
        offset_v, apparent_nm, size_v_each, errors = (np.concatenate(column) for column in zip(*groups, strict=True))
        errors_nm = errors if self._imaged else None
        return fit_offset_sizes(offset_v, apparent_nm, size_v_each, self._driver, law, errors_nm)

    def _size(self) -> SizeFit:
        size = self._before.size
        if self._imaged:
            drives = [share * self._driver.span for share in IMAGED_SIZES]
            image_sizes = self._images([(volts, self._driver.middle) for volts in drives])
            return fit_size(
                np.array(drives),
                image_sizes.nm,
                self._driver,
                size.base_nm,
                errors_nm=image_sizes.errors_nm,
                shared=image_sizes.shared,
            )
        nominal = [share * self._driver.span * size.k_nm_per_v for share in SIZES]
        sizes = actual_sizes(
            self._axis,
            nominal,
            size.k_nm_per_v,
            self._reference_hz,
            noise=self._noise,
            seed=self._next(),
            turn=self._turn,
        )
        return fit_size(
            sizes["nominal_nm"] / size.k_nm_per_v, sizes["actual_nm"], self._driver, size.base_nm, None, "relative"
        )

    def _images(self, scans: Sequence[tuple[float, float]]) -> ImageSizes:
        """Simulate images at scan voltages and offsets: of a lattice where the line is short, else of a grating.

        The sample drifts by a share of the line and is tilted.
        """
        images = []
        for volts, offset in scans:
            sample = hexagonal(LATTICE_NM) if volts <= SMALL_IMAGE * self._driver.span else grating(GRATING_NM)
            random = np.random.default_rng(self._next())
            slope, drift = random.uniform(-IMAGE_SLOPE, IMAGE_SLOPE, 2), float(random.uniform(-1.0, 1.0)) * IMAGE_DRIFT
            tilted = _tilted(sample, slope)
            trace, retrace = image_pair(
                self._axis,
                tilted,
                volts,
                offset,
                self._reference_hz,
                turn=self._turn,
                drift=drift,
                seed=self._next(),
            )
            images.append(SampleImage(f"{volts:g} V at {offset:g} V", volts, offset, trace, retrace))
        return sizes_of(images, self._driver, SAMPLES_SEEN, Acquisition(turn=self._turn))

    def _traces(self, amplitudes: Sequence[float]) -> list[Trace]:
        traces = []
        for share in amplitudes:
            volts = share * self._driver.span
            rate = self._rate_at(volts)
            size_nm = volts * self._before.size.k_nm_per_v
            sensor = Sensor(noise_nm=self._noise * size_nm, seed=self._next())
            trace = sensor_trace(
                self._axis, volts, self._driver.middle, rate, PERIODS, SAMPLES, turn=self._turn, sensor=sensor
            )
            traces.append(Trace(f"{volts:g} V", trace["time_s"], trace["drive_v"], trace["displacement_nm"]))
        return traces

    def _imaged_hysteresis(self, amplitudes: Sequence[float]) -> HysteresisFit:
        """Fit hysteresis from images: of a lattice where the line is short, of a grating where it is long."""
        pairs = []
        for share in amplitudes:
            volts = share * self._driver.span
            rate = self._rate_at(volts)
            sample = hexagonal(LATTICE_NM) if share <= SMALL_IMAGE else grating(GRATING_NM)
            middle, seed = self._driver.middle, self._next()
            trace, retrace = image_pair(self._axis, sample, volts, middle, rate, turn=self._turn, seed=seed)
            pairs.append(Pair(f"{volts:g} V", volts, trace, retrace))
        return fit_images(pairs, self._driver, turn=self._turn)

    def _rate_at(self, volts: float) -> float:
        """Return the rate in Hz with the scan's tip velocity, and no faster than the scan, as the paper does."""
        return self._rate_hz * min(self._scan_v / volts, 1.0)

    def _gains(self) -> dict[str, Floats]:
        """Return the response over two decades about the reference, below a tenth of any resonance."""
        f = self._reference_hz * np.geomspace(0.1, 10.0, 15)
        return frequency_response(self._axis, f, noise=self._noise, seed=self._next())

    def _resonance(self, before: Resonance) -> ResonanceFit:
        near = before.frequency_hz or 1e4
        f = near * np.geomspace(0.2, 3.0, 200)
        response = frequency_response(self._axis, f, noise=self._noise, seed=self._next())
        return fit_resonance(response["frequency_hz"], response["gain"], response["phase_deg"])

    def _next(self) -> int:
        self._seed += 1
        return self._seed


def _tilted(sample: Surface, slope: Floats) -> Surface:
    """Tilt the sample by heights per nm along x and y."""
    return lambda x, y: sample(x, y) + slope[0] * x + slope[1] * y


def _as(kind: type[T], values: Any) -> T:
    return msgspec.convert(dict(values), kind)
