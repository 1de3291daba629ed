"""The drive of one axis: its voltages, and the shape w of the line that the model of the piezo asks for."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from tablegen.base.input_errors import Problems
from tablegen.compensation import models
from tablegen.compensation.dynamics import Response
from tablegen.compensation.frequency import frequency_gain
from tablegen.compensation.line import AppliedBranch, LineRequest, LineShape, SineLine
from tablegen.compensation.model import Hysteresis
from tablegen.compensation.model_problems import ModelProblems
from tablegen.compensation.offset import OffsetLaw
from tablegen.compensation.size import SizeLaw
from tablegen.config.load import Setup
from tablegen.config.schema import FastAxis
from tablegen.numerics.driver import Driver
from tablegen.planning.voltages import Voltages
from tablegen.waveform.error_allowance import AllowedError


class Drive(Struct, frozen=True, eq=False):
    """The voltages at the piezo, and every factor that went into them.

    ``v_scan`` is from (9)/(12), before ``m`` of (1) and ``g`` of (23). The amplitude played is m g v_scan, peak to
    peak, for w from 0 to 1. ``position_nm`` is that of the offset, above the one at 0 V. ``line_at`` returns the line
    that the model makes at another normalised scan voltage, None where it makes none; ``model_files`` has the files
    that the model names, and their SHA-256. ``allowed`` is the scaling error that may be left for less acceleration.
    """

    driver: Driver
    v_offset: float
    position_nm: float
    size_nm: float
    window_nm: float
    v_scan: float
    v_scan_normalised: float
    p_offset: float
    m: float
    g: float
    hysteresis: Hysteresis
    turn: float
    offset_law: OffsetLaw
    size_law: SizeLaw
    shape: LineShape
    response: Response | None
    max_boost_db: float
    line_at: Callable[[float], LineShape | None]
    allowed: AllowedError | None
    model_files: tuple[tuple[str, str], ...] = ()

    @property
    def resting(self) -> bool:
        """True if the axis stays at its offset: w is 1/2 throughout, and the line has no size."""
        return self.size_nm == 0.0

    @property
    def model(self) -> str:
        """The name of the hysteresis model."""
        return self.hysteresis.model()

    @property
    def forward(self) -> AppliedBranch:
        """The residual that is applied in the forward direction."""
        return self.shape.peaks[0]

    @property
    def backward(self) -> AppliedBranch:
        """The residual that is applied in the backward direction."""
        return self.shape.peaks[1]

    @property
    def v_amplitude(self) -> float:
        """The amplitude m g V_scan: volts peak to peak at the piezo for w from 0 to 1."""
        return self.m * self.g * self.v_scan

    def v_amplitude_at(self, v_offset: float) -> float:
        """Return ``v_amplitude`` in V at another offset voltage."""
        return self.offset_law.factor(self.driver.p(v_offset)) * self.g * self.v_scan


def make_drive(
    setup: Setup, axis: str, rate_hz: float, voltages: Voltages, harmonics: int, problems: Problems
) -> Drive | None:
    """Ask the model of the piezo for the line of one axis ("x" or "y").

    Returns None where the model refuses; the reason goes to ``problems``.

    Parameters
    ----------
    harmonics
        The highest harmonic for a model that makes the whole waveform itself.
    """
    scan: FastAxis = getattr(setup.scan, axis)
    low, high = scan.band_limit.window
    driver, law, hysteresis = voltages.driver, voltages.rate_law, voltages.hysteresis
    request = LineRequest(
        axis=axis,
        turn=scan.turn,
        v=voltages.v,
        driver=driver,
        v_amplitude=voltages.v_amplitude,
        v_offset=voltages.v_offset,
        size_nm=voltages.size_nm,
        rate_hz=rate_hz,
        harmonics=harmonics,
        window=(low, high),
        both=scan.band_limit.directions == "both",
        response=voltages.response,
        max_boost_db=voltages.max_boost_db,
        factor_at=partial(_factor_at, voltages.small_scans, driver),
        rate_gain=None if law is None else partial(frequency_gain, alpha=law.alpha, reference_hz=law.reference_hz),
        folder=setup.scanner_folder,
        allowed=voltages.allowed,
        sine=getattr(scan, "motion", "line") == "sine",
    )
    before = len(problems.entries)
    places = ModelProblems(axis, setup.scan_file, setup.scanner_file, problems)
    shape = models.line_of(hysteresis, request, places)
    if len(problems.entries) > before or shape is None:
        return None
    if request.sine and not isinstance(shape, SineLine):
        why = (
            f"a sine needs an operator, which says where the piezo is, and {axis} has the model {hysteresis.model()!r}"
        )
        problems.add(
            setup.scan_file, f"{axis}.motion", f"{why}; `tablegen calibrate operator` makes one, or take 'line'"
        )
        return None
    return Drive(
        driver=driver,
        v_offset=voltages.v_offset,
        position_nm=voltages.position_nm,
        size_nm=voltages.size_nm,
        window_nm=voltages.size_nm * (high - low),
        v_scan=voltages.v * driver.span,
        v_scan_normalised=voltages.v,
        p_offset=voltages.p_offset,
        m=voltages.m,
        g=voltages.g,
        hysteresis=hysteresis,
        turn=scan.turn,
        offset_law=voltages.offset_law,
        size_law=voltages.size_law,
        shape=shape,
        response=voltages.response,
        max_boost_db=voltages.max_boost_db,
        line_at=partial(_line_at, hysteresis, request),
        allowed=voltages.allowed,
        model_files=tuple(
            (Path(name).name, digest)
            for name, digest in zip(hysteresis.files(), hysteresis.contents(setup.scanner_folder), strict=True)
        ),
    )


# Functions of the module rather than closures, so that a plan can be pickled for another process.
def _factor_at(law: OffsetLaw, driver: Driver, share: float) -> float:
    return law.factor(driver.p(driver.volts(share)))


def _line_at(hysteresis: Hysteresis, request: LineRequest, v: float) -> LineShape | None:
    problems = Problems()
    shape = models.line_of(hysteresis, replace(request, v=v), ModelProblems.without_files(request.axis, problems))
    return None if problems.entries else shape
