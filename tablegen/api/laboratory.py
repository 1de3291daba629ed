"""A laboratory with a virtual scanner: simulated measurements of its instruments, as columns and images.

It serves to try a procedure before the instrument is there, and to measure its errors where the truth is known.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from tablegen.config.load import Setup, load, load_scanner
from tablegen.config.scanner import Scanner
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver
from tablegen.planning.line_plan import Plan, make_plan
from tablegen.planning.turned_plan import TurnedPlan, make_turned_plan
from tablegen.virtual.experiments import apparent_sizes, frequency_response, sensor_trace, triangle_size
from tablegen.virtual.imaging import (
    Conditions,
    FrameImages,
    Surface,
    grating,
    hexagonal,
    running_frame,
    triangle_frame,
    turned_frame,
)
from tablegen.virtual.parameters import BUILT_IN, load_truth
from tablegen.virtual.running import running_trace
from tablegen.virtual.scaling import scaled_to
from tablegen.virtual.scanner import VirtualAxis, VirtualScanner
from tablegen.virtual.sensor import Sensor
from tablegen.virtual.simulation import AxisRun, run_of_axis

Axis = Literal["x", "y"]


class Laboratory:
    """Measurements on a virtual scanner, with noise that comes from ``seed`` alone: the same calls give the same data.

    ``truth`` is "default", "duhem", or a file of a virtual scanner. With ``like``, a scanner file, a built-in scanner
    moves as far as by that file, over the same volts. ``noise`` is relative, rms, of every reading.
    """

    def __init__(
        self,
        truth: str | Path = "default",
        like: "str | Path | Scanner | None" = None,
        noise: float = 0.002,
        seed: int = 0,
    ) -> None:
        self.truth = load_truth(truth)
        self.scanner, self.scaled = VirtualScanner.of(self.truth), ""
        """The scanner, and its scaling in words; empty without scaling."""
        if like is not None and truth in BUILT_IN:
            file = like if isinstance(like, Scanner) else load_scanner(like)[0]
            self.scanner, self.scaled = scaled_to(self.scanner, file)
        self.noise, self._seed = noise, seed

    @property
    def driver(self) -> Driver:
        """The range of the driver: ``v_min``, ``v_max``, ``middle`` and ``span`` in V."""
        return self.scanner.x.driver

    def sizes(self, axis: Axis, drives_v: Sequence[float], rate_hz: float) -> dict[str, Floats]:
        """Measure ``drive_v`` and ``actual_nm`` by a sensor: triangles about the middle of the range.

        Parameters
        ----------
        drives_v
            Drives in V peak to peak, shape (n,).
        rate_hz
            Line rate in Hz.

        Returns
        -------
        dict of Floats
            Drives in V and sizes in nm, shape (n,) each.
        """
        one = self._axis(axis)
        nm = np.array([triangle_size(one, volts, one.driver.middle, rate_hz) for volts in drives_v])
        noisy = nm * (1.0 + self.noise * np.random.default_rng(self._next()).standard_normal(len(nm)))
        return {"drive_v": np.array(drives_v, dtype=np.float64), "actual_nm": noisy}

    def apparent_sizes(
        self, axis: Axis, offsets_v: Sequence[float], size_v: float, rate_hz: float
    ) -> dict[str, Floats]:
        """Measure ``offset_v``, ``apparent_nm`` and ``size_v``: one object in images of ``size_v`` at several offsets.

        Parameters
        ----------
        offsets_v
            Offsets in V, shape (n,).
        size_v
            Scan voltage in V peak to peak.
        rate_hz
            Line rate in Hz.

        Returns
        -------
        dict of Floats
            Offsets in V, apparent sizes in nm and scan voltages in V, shape (n,) each.
        """
        columns = apparent_sizes(self._axis(axis), offsets_v, size_v, rate_hz, noise=self.noise, seed=self._next())
        return {**columns, "size_v": np.full(len(offsets_v), float(size_v))}

    def trace(
        self,
        axis: Axis,
        size_v: float,
        offset_v: float,
        rate_hz: float,
        periods: int = 4,
        samples: int = 1000,
        turn: float = 0.5,
    ) -> dict[str, Floats]:
        """Record ``time_s``, ``drive_v``, ``displacement_nm`` of a triangle that begins after a rest.

        Parameters
        ----------
        size_v, offset_v
            Drive peak to peak, and its middle, in V.
        rate_hz
            Line rate in Hz.
        samples
            Samples a period.
        turn
            Share of the period in which the drive rises.

        Returns
        -------
        dict of Floats
            Columns in s, V and nm, shape (periods x samples,) each.
        """
        one = self._axis(axis)
        clean = sensor_trace(one, size_v, offset_v, rate_hz, periods, samples, turn)
        extent = float(np.ptp(clean["displacement_nm"]))
        sensor = Sensor(noise_nm=self.noise * extent, seed=self._next())
        return {**clean, "displacement_nm": sensor.read(clean["displacement_nm"], clean["time_s"])}

    def response(self, axis: Axis, frequency_hz: Sequence[float]) -> dict[str, Floats]:
        """Measure ``frequency_hz``, ``gain``, ``phase_deg`` with a small sine.

        Parameters
        ----------
        frequency_hz
            Frequencies in Hz, shape (n,).

        Returns
        -------
        dict of Floats
            Frequencies in Hz, gains and phases in degrees, shape (n,) each.
        """
        return frequency_response(self._axis(axis), np.asarray(frequency_hz), self.noise, self._next())

    def running_trace(
        self, scan: "str | Path | Setup | Plan", axis: Axis, periods: float = 5.0, samples: int = 2000
    ) -> dict[str, Floats]:
        """Record ``time_s``, ``drive_v``, ``displacement_nm`` by a sensor while a build runs: for ``refine``.

        Returns
        -------
        dict of Floats
            Columns in s, V and nm, shape (n,) each.
        """
        line = getattr(_plan(scan), axis)
        sensor = Sensor(noise_nm=self.noise * line.drive.size_nm, seed=self._next())
        return running_trace(line, self._axis(axis), periods, samples, sensor)

    def play(self, scan: "str | Path | Setup | Plan", axis: Axis) -> AxisRun:
        """Play a build without noise, and return ``displacement_nm``, ``imaged`` and ``error`` of an axis.

        Of a sine on x the errors are those of its pixels.
        """
        plan = _plan(scan)
        return run_of_axis(plan, getattr(plan, axis), self._axis(axis))

    def lattice(self, constant_nm: float, angle_deg: float = 7.0) -> Surface:
        """Return a hexagonal lattice: heights over x and y in nm."""
        return hexagonal(constant_nm, angle_deg)

    def grating(self, pitch_nm: float, angle_deg: float = 3.0) -> Surface:
        """Return a grating with bars across the lines: heights over x and y in nm."""
        return grating(pitch_nm, angle_deg)

    def image(
        self,
        sample: Surface,
        size_v: float,
        offset_v: float,
        rate_hz: float,
        pixels: int = 256,
        slow_turn: float = 0.5,
        conditions: Conditions | None = None,
    ) -> FrameImages:
        """Take trace and retrace with an uncompensated instrument: the same triangle on both axes.

        The slow one goes up in ``slow_turn`` of its period, in which the image is taken.
        """
        axes, drives = (self.scanner.x, self.scanner.y), ((size_v, size_v), (offset_v, offset_v))
        coupling = self.scanner.coupling
        return triangle_frame(
            *axes, sample, *drives, rate_hz, conditions, pixels, pixels, (0.5, slow_turn), coupling=coupling
        )

    def frame(
        self,
        scan: "str | Path | Setup | Plan | TurnedPlan",
        sample: Surface,
        pixels: int | None = None,
        conditions: Conditions | None = None,
    ) -> FrameImages:
        """Take trace and retrace of a settled frame of a build, also of one at an angle."""
        if not isinstance(scan, Plan | TurnedPlan):
            setup = scan if isinstance(scan, Setup) else load(scan)
            scan = make_turned_plan(setup) if setup.mixes_motions else make_plan(setup, sines=True)
        axes, coupling = (self.scanner.x, self.scanner.y), self.scanner.coupling
        if isinstance(scan, TurnedPlan):
            return turned_frame(scan, *axes, sample, conditions, pixels, coupling=coupling)
        return running_frame(scan, *axes, sample, conditions, pixels, coupling=coupling)

    def _axis(self, axis: Axis) -> VirtualAxis:
        scanner_axis: VirtualAxis = getattr(self.scanner, axis)
        return scanner_axis

    def _next(self) -> int:
        self._seed += 1
        return self._seed

    def __repr__(self) -> str:
        scaled = f", {self.scaled}" if self.scaled else ""
        return f"<tablegen laboratory with the virtual scanner {self.truth.name!r}{scaled}: all of it simulated>"


def _plan(scan: "str | Path | Setup | Plan") -> Plan:
    if isinstance(scan, Plan):
        return scan
    return make_plan(scan if isinstance(scan, Setup) else load(scan), sines=True)
