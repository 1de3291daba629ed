"""The scanner file as frozen types: a scanner is calibrated once and shared by its scans.

The keys of ``[x.hysteresis]`` are defined by the models, in ``compensation/models/``.
"""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from tablegen.base.quantities import FileName, Hertz, Name, Nanometres, PositiveVolts, Volts
from tablegen.compensation.model import Hysteresis
from tablegen.config.schema import Amplifier, Dac
from tablegen.numerics.driver import Driver

Factor = Annotated[float, Meta(ge=0.1, le=10.0)]


class OffsetPoint(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The apparent size of one object at one offset voltage."""

    offset_v: Annotated[Volts, Meta(description="offset voltage at which the image was taken")]
    apparent_nm: Annotated[Nanometres, Meta(description="apparent size of the object, or apparent lattice constant")]
    size_v: (
        Annotated[PositiveVolts, Meta(description="scan voltage of the image, at the piezo; of all points or of none")]
        | None
    ) = None


class OffsetSize(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Amplitude factors of (1) at one scan voltage; `alpha` and `beta` are linear in the voltage between two."""

    size_v: Annotated[PositiveVolts, Meta(description="scan voltage V_scan of the images, at the piezo")]
    m_minus: Annotated[Factor, Meta(description="amplitude factor at an offset of v_min, of this size")]
    m_plus: Annotated[Factor, Meta(description="amplitude factor at an offset of v_max, of this size")]


class Offset(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Amplitude factor against offset voltage, (1)-(4): `m_minus` and `m_plus`, `alpha` and `beta`, or `points`.

    Or `sizes`, where it depends on the scan size too; as with points of several `size_v`.
    """

    m_minus: Annotated[Factor, Meta(description="amplitude factor at an offset of v_min")] | None = None
    m_plus: Annotated[Factor, Meta(description="amplitude factor at an offset of v_max")] | None = None
    alpha: Annotated[float, Meta(ge=-1.0, le=1.0, description="linear term of (1)")] | None = None
    beta: Annotated[float, Meta(ge=-1.0, le=1.0, description="quadratic term of (1)")] | None = None
    points: (
        Annotated[
            list[OffsetPoint],
            Meta(min_length=3, max_length=1000, description="apparent sizes at three or more offsets"),
        ]
        | None
    ) = None
    sizes: (
        Annotated[
            list[OffsetSize],
            Meta(min_length=1, max_length=64, description="factors as measured at several scan sizes"),
        ]
        | None
    ) = None


class Size(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Scan size against scan voltage, (5)-(12)."""

    k_nm_per_v: Annotated[float, Meta(ge=1e-6, le=1e6, description="scanner constant at `base_nm`")]
    beta: Annotated[float, Meta(gt=-0.5, le=100.0, description="nonlinearity of (6); 0 is a linear scanner")] = 0.0
    base_nm: Annotated[Nanometres, Meta(description="scan size at which `k_nm_per_v` was calibrated")] = 200.0
    v_threshold: Annotated[
        float, Meta(gt=0.0, le=1.0, description="normalised scan voltage above which the size is linear, (10)")
    ] = 0.5


class Frequency(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Loss of amplitude with frequency, (23)."""

    alpha: Annotated[float, Meta(ge=0.0, le=0.5, description="relative amplitude lost per decade")]
    reference_hz: Annotated[Hertz, Meta(description="rate at which the scanner was calibrated")]


class Resonance(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Inverse dynamics: each harmonic is divided by the response, which is second order with delay, or measured."""

    frequency_hz: Annotated[Hertz, Meta(description="undamped resonance frequency")] | None = None
    quality: Annotated[float, Meta(ge=0.1, le=1e5, description="quality factor")] | None = None
    delay_s: Annotated[
        float,
        Meta(
            ge=0.0, le=1.0, description="dead time of amplifier and scanner; the converter's half tick comes by itself"
        ),
    ] = 0.0
    response: (
        Annotated[
            FileName,
            Meta(description="CSV of the measured response, relative to the scanner file; header hz,gain,phase_deg"),
        ]
        | None
    ) = None
    max_boost_db: Annotated[
        float, Meta(ge=0.0, le=60.0, description="largest gain that the inverse dynamics may apply to a harmonic")
    ] = 6.0


class ScannerAxis(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Calibration of one axis."""

    size: Size
    offset: Offset | None = None
    hysteresis: Hysteresis | None = None
    frequency: Frequency | None = None
    resonance: Resonance | None = None
    dac: Annotated[Dac, Meta(description="The converter of this axis; its keys take precedence over `[dac]`.")] = Dac()
    amplifier: Annotated[
        Amplifier, Meta(description="The amplifier of this axis; its keys take precedence over `[amplifier]`.")
    ] = Amplifier()


class SlowScannerAxis(ScannerAxis, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Calibration of the slow axis."""

    like: (
        Annotated[Literal["x"], Meta(description="y takes all tables of `[x]`; its own keys take precedence")] | None
    ) = None


class LinearPiezo(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The piezo of the output z, taken as linear, and its driver; for scans with `[z]`."""

    nm_per_v: Annotated[
        float,
        Meta(ge=-1e6, le=1e6, description="nm for each V at the piezo; negative if a higher voltage lowers the output"),
    ]
    v_max: Annotated[PositiveVolts, Meta(description="maximum output of its driver")]
    v_min: Annotated[
        float, Meta(ge=-1e5, le=0.0, description="minimum output of its driver; below 0 if it has both signs")
    ] = 0.0
    dac: Annotated[
        Dac,
        Meta(
            description="The converter of this output; its keys take precedence over `[dac]`. It has neither `shaping` "
            "nor `output`; z has its own `bits`, aux those of z."
        ),
    ] = Dac()
    amplifier: Annotated[
        Amplifier, Meta(description="The amplifier of this output; its keys take precedence over `[amplifier]`.")
    ] = Amplifier()

    @property
    def driver(self) -> Driver:
        """The output range of its driver."""
        return Driver(self.v_max, self.v_min)


class Coupling(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Coupling of the axes: what each moves along the other. A scan on coupled axes needs an operator on both."""

    x_per_y: Annotated[
        float, Meta(ge=-0.5, le=0.5, description="nm along x for each nm of the y axis, for example 0.02")
    ] = 0.0
    y_per_x: Annotated[float, Meta(ge=-0.5, le=0.5, description="nm along y for each nm of the x axis")] = 0.0

    def __bool__(self) -> bool:
        """Return True if an axis moves along the other."""
        return self.x_per_y != 0.0 or self.y_per_x != 0.0


class Scanner(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A calibrated scanner."""

    name: Annotated[Name, Meta(description="name of the scanner in reports")]
    v_max: Annotated[
        PositiveVolts,
        Meta(description="maximum output of the piezo driver; normalised voltages refer to v_max - v_min"),
    ]
    v_min: Annotated[
        float, Meta(ge=-1e5, le=0.0, description="minimum output of the piezo driver; below 0 if it has both signs")
    ] = 0.0
    dac: Annotated[Dac, Meta(description="The converter of both axes, for every scan on this scanner.")] = Dac()
    amplifier: Annotated[Amplifier, Meta(description="The amplifier of both axes, for every scan on this scanner.")] = (
        Amplifier()
    )
    x: ScannerAxis
    y: SlowScannerAxis
    coupling: Coupling = Coupling()
    z: LinearPiezo | None = None
    aux: (
        Annotated[
            LinearPiezo,
            Meta(
                description="The actuator of the second output, and its driver; for scans with `[aux]`. Keys as `[z]`."
            ),
        ]
        | None
    ) = None

    @property
    def driver(self) -> Driver:
        """The output range of the piezo driver."""
        return Driver(self.v_max, self.v_min)
