"""The two input files as frozen types: a scanner is calibrated once and shared, a scan changes daily.

Units are part of every name. The ranges stand here once: the decoder checks them, ``tablegen schema`` prints them.
"""

from typing import Annotated, Literal

from msgspec import Meta, Struct

Name = Annotated[str, Meta(min_length=1, max_length=64)]
# Short enough to leave room for what is appended; reserved words are refused beside it, see ``why_not_a_name``.
MAXIMUM_NAME = 48
Identifier = Annotated[str, Meta(min_length=1, max_length=MAXIMUM_NAME, pattern="^[A-Za-z](_?[A-Za-z0-9])*$")]
MAXIMUM_FILE_NAME = 1024
FileName = Annotated[str, Meta(min_length=1, max_length=MAXIMUM_FILE_NAME)]
Volts = Annotated[float, Meta(ge=-1e5, le=1e5)]
PositiveVolts = Annotated[float, Meta(ge=1e-3, le=1e5)]
Nanometres = Annotated[float, Meta(ge=1e-6, le=1e9)]
Hertz = Annotated[float, Meta(ge=1e-6, le=1e10)]
Normalised = Annotated[float, Meta(gt=0.0, lt=1.0)]
Residual = Annotated[float, Meta(ge=0.0, lt=0.5)]
Decay = Annotated[float, Meta(ge=1e-6, le=100.0)]
Factor = Annotated[float, Meta(ge=0.1, le=10.0)]
Percent = Annotated[float, Meta(gt=0.0, le=1000.0)]
Harmonics = Annotated[list[Annotated[float, Meta(ge=-0.5, le=0.5)]], Meta(min_length=1, max_length=512)]
Window = tuple[Annotated[float, Meta(ge=0.0, le=1.0)], Annotated[float, Meta(ge=0.0, le=1.0)]]


class Table(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the waveform is stored on the device."""

    mode: Annotated[
        Literal["interpolated", "direct"],
        Meta(description="interpolated: `length` words and linear interpolation; direct: one word per tick"),
    ] = "interpolated"
    length: (
        Annotated[int, Meta(ge=4, le=65536, description="number of words; interpolated: a power of two, default 2048")]
        | None
    ) = None
    bits: Annotated[int, Meta(ge=8, le=24, description="bits of a table word")] = 16


class BandLimit(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The harmonics that are played, and the window in which the scan has to be straight."""

    method: Annotated[
        Literal["window", "lanczos", "truncate"],
        Meta(
            description="window: fitted in the imaging window, with free turnarounds; others: applied to the whole line"
        ),
    ] = "window"
    harmonics: (
        Annotated[
            int,
            Meta(ge=1, le=512, description="highest harmonic of the rate; default 32 unless `cutoff_hz` is given"),
        ]
        | None
    ) = None
    cutoff_hz: Annotated[Hertz, Meta(description="highest frequency; or give `harmonics`")] | None = None
    window: Annotated[Window, Meta(description="imaging window of each branch, in normalised position")] = (
        0.1,
        0.9,
    )
    directions: Annotated[Literal["both", "forward"], Meta(description="directions in which the image is taken")] = (
        "both"
    )


class Refinement(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The residual layer that `tablegen refine` learnt, and the scan to which it belongs."""

    a: Annotated[Harmonics, Meta(description="cosine terms of harmonics 1, 2, ..., as fractions of the line")]
    b: Annotated[Harmonics, Meta(description="sine terms of the same harmonics")]
    v_amplitude: Annotated[
        PositiveVolts, Meta(description="drive at which the layer was learnt, peak to peak at the piezo")
    ]
    v_offset: Annotated[Volts, Meta(description="offset voltage at which the layer was learnt")]
    rate_hz: Annotated[Hertz, Meta(description="rate at which the layer was learnt")]
    turn: Annotated[Normalised, Meta(description="turning point at which the layer was learnt")]
    window: Annotated[Window, Meta(description="imaging window that was measured")]
    directions: Annotated[Literal["both", "forward"], Meta(description="directions that were measured")]
    model: (
        Annotated[
            str,
            Meta(
                pattern="^[0-9a-f]{16}$",
                description="digest of the scanner's hysteresis and resonance; not compared if missing",
            ),
        ]
        | None
    ) = None
    before_percent: (
        Annotated[
            float, Meta(ge=0.0, le=100.0, description="rms residual of the trace from which the layer was learnt")
        ]
        | None
    ) = None


class FastAxis(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The axis that moves once a line."""

    size_nm: Annotated[Nanometres, Meta(description="scan size; or give `size_v`")] | None = None
    size_v: Annotated[PositiveVolts, Meta(description="scan voltage V_scan at the piezo, before m and g")] | None = None
    size_of: Annotated[
        Literal["line", "window"],
        Meta(description="what `size_nm` measures: the whole line, or the imaging window"),
    ] = "line"
    offset_v: Annotated[Volts, Meta(description="offset voltage at the piezo; or give `offset_nm`")] | None = None
    offset_nm: Annotated[float, Meta(ge=0.0, le=1e9, description="position relative to that at 0 V")] | None = None
    park_v: Annotated[Volts, Meta(description="voltage at the piezo after park; default: the offset")] | None = None
    turn: Annotated[
        Normalised, Meta(description="turning point: fraction of the period in which the axis moves forward")
    ] = 0.5
    band_limit: BandLimit = BandLimit()
    table: Table = Table()
    refinement: Refinement | None = None


class SlowAxis(FastAxis, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The axis that moves once a frame."""

    motion: Annotated[
        Literal["ramp", "step"],
        Meta(description="ramp: moves on every tick; step: moves once per line, at its start"),
    ] = "ramp"


class Dac(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The converter. Code c gives v_min + (v_max - v_min) c / 2^bits."""

    bits: Annotated[int, Meta(ge=8, le=24, description="resolution; the arithmetic uses straight codes 0..2^bits - 1")]
    coding: Annotated[
        Literal["offset-binary", "twos-complement"], Meta(description="coding of the word that is sent")
    ] = "offset-binary"
    v_min: Annotated[Volts, Meta(description="voltage at code 0")]
    v_max: Annotated[Volts, Meta(description="voltage one LSB above the highest code")]
    update_rate_hz: Annotated[float, Meta(ge=1.0, le=1e9, description="ticks per second, for both axes")]
    align: Annotated[Literal["right", "left"], Meta(description="alignment of the code in the word that is sent")] = (
        "right"
    )
    word_bits: (
        Annotated[int, Meta(ge=8, le=32, description="bits of the word that is sent; default: `bits`")] | None
    ) = None


class Amplifier(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Piezo voltage = gain * converter voltage + bias_v."""

    gain: Annotated[float, Meta(ge=-1e4, le=1e4, description="gain of the amplifier; negative if it inverts")]
    bias_v: Annotated[Volts, Meta(description="piezo voltage if the converter outputs 0 V")] = 0.0
    max_slew_v_per_s: Annotated[float, Meta(ge=1e-3, le=1e12, description="maximum slew rate at the piezo")] | None = (
        None
    )


class Timing(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Pixels, lines and rates."""

    pixels: Annotated[int, Meta(ge=1, le=65536, description="pixels per line and direction, over the imaging window")]
    lines: Annotated[int, Meta(ge=1, le=65536, description="line periods per frame")]
    line_rate_hz: Annotated[
        float, Meta(ge=1e-3, le=1e6, description="lines per second; forward and backward make one line")
    ]
    ticks_per_line: (
        Annotated[int, Meta(ge=8, le=1 << 24, description="ticks of a line; default: the nearest to the line rate")]
        | None
    ) = None
    ticks_per_pixel: (
        Annotated[int, Meta(ge=1, le=1 << 20, description="ticks of a pixel; the length of the line follows from it")]
        | None
    ) = None
    settle_lines: Annotated[int, Meta(ge=0, le=255, description="lines after a change during which valid is low")] = 2


class Limits(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Limits of the certificate; a build that exceeds one fails."""

    max_error_lsb: (
        Annotated[float, Meta(gt=0.0, le=1e6, description="largest error of any code, in LSB of the converter")] | None
    ) = None
    max_scaling_error_percent: (
        Annotated[
            Percent,
            Meta(description="largest scaling error, peak to peak, and largest size error, both of the imaging window"),
        ]
        | None
    ) = None


DEFAULT_FORMATS = ("c", "verilog")


class Emit(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the build writes."""

    formats: (
        Annotated[
            list[Annotated[str, Meta(min_length=1, max_length=64)]],
            Meta(
                min_length=1,
                max_length=64,
                description="formats to write, by `tablegen formats`; default: c and verilog",
            ),
        ]
        | None
    ) = None
    header_only: Annotated[bool, Meta(description="C: put the tables into the header instead of a .c file")] = False


class Scan(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One scan."""

    name: Annotated[Identifier, Meta(description="prefix of every emitted file and identifier")]
    scanner: Annotated[FileName, Meta(description="path of the scanner file, relative to the scan file")]
    dac: Dac
    amplifier: Amplifier
    timing: Timing
    x: FastAxis
    y: SlowAxis
    limits: Limits = Limits()
    emit: Emit = Emit()


class OffsetPoint(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The apparent size of one object at one offset voltage."""

    offset_v: Annotated[Volts, Meta(description="offset voltage at which the image was taken")]
    apparent_nm: Annotated[Nanometres, Meta(description="apparent size of the object, or apparent lattice constant")]


class Offset(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Amplitude factor against offset voltage, (1)-(4): `m_minus` and `m_plus`, `alpha` and `beta`, or `points`."""

    m_minus: Annotated[Factor, Meta(description="amplitude factor at an offset of 0 V")] | None = None
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


class Size(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Scan size against scan voltage, (5)-(12)."""

    k_nm_per_v: Annotated[float, Meta(ge=1e-6, le=1e6, description="scanner constant at `base_nm`")]
    beta: Annotated[float, Meta(gt=-0.5, le=100.0, description="nonlinearity of (6); 0 is a linear scanner")] = 0.0
    base_nm: Annotated[Nanometres, Meta(description="scan size at which `k_nm_per_v` was calibrated")] = 200.0
    v_threshold: Annotated[
        float, Meta(gt=0.0, le=1.0, description="normalised scan voltage above which the size is linear, (10)")
    ] = 0.5


class HysteresisPoint(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Hysteresis of one direction as measured at one scan voltage."""

    size_v: Annotated[PositiveVolts, Meta(description="scan voltage V_scan of the measurement, at the piezo")]
    beta: Annotated[Residual, Meta(description="peak residual at this voltage, as a fraction of the scan")]
    u_peak: Annotated[Normalised, Meta(description="position of the peak; harmonic model only")] | None = None


class Branch(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Hysteresis of one direction, by (22) or by `points`. Both directions have u_peak in sweep-aligned coordinates."""

    beta_max: (
        Annotated[
            Residual, Meta(description="peak residual at full scale, as a fraction of the scan; or give `points`")
        ]
        | None
    ) = None
    rho: Annotated[Decay, Meta(description="dimensionless decay constant of (22)")] = 1.5
    u_peak: Annotated[Normalised, Meta(description="position of the peak residual; harmonic model only")] | None = None
    points: (
        Annotated[
            list[HysteresisPoint],
            Meta(
                min_length=1,
                max_length=64,
                description="measured values that replace (22); interpolated linearly, from 0 at 0 V",
            ),
        ]
        | None
    ) = None


class Branches(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Both directions, calibrated at one turning point."""

    turn: Annotated[Normalised, Meta(description="turning point at which the branches were calibrated")]
    forward: Branch
    backward: Branch


class Hysteresis(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Hysteresis of the line, (13)-(22)."""

    model: Annotated[
        Literal["harmonic", "sinusoidal", "triangle"],
        Meta(description="harmonic: (17)-(21); sinusoidal: (15); triangle: not compensated"),
    ] = "harmonic"
    branches: Annotated[
        list[Branches], Meta(max_length=64, description="one entry per calibrated turn; interpolated between them")
    ] = []


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


class Scanner(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A calibrated scanner."""

    name: Annotated[Name, Meta(description="name of the scanner in reports")]
    v_max: Annotated[
        PositiveVolts, Meta(description="maximum output of the piezo driver; normalised voltages refer to it")
    ]
    x: ScannerAxis
    y: ScannerAxis
