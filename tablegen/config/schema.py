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
        Meta(description="interpolated: `length` words and linear interpolation; direct: one word a tick"),
    ] = "interpolated"
    length: (
        Annotated[int, Meta(ge=4, le=65536, description="words; interpolated: a power of two, 2048 if not given")]
        | None
    ) = None
    bits: Annotated[int, Meta(ge=8, le=24, description="bits of a table word")] = 16


class BandLimit(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Which harmonics are played, and over which window the scan has to be straight."""

    method: Annotated[
        Literal["window", "lanczos", "truncate"],
        Meta(description="window: fitted inside the imaging window, the turnarounds free; others: of the whole line"),
    ] = "window"
    harmonics: (
        Annotated[
            int,
            Meta(ge=1, le=512, description="highest harmonic of the rate; 32 if neither this nor `cutoff_hz` is given"),
        ]
        | None
    ) = None
    cutoff_hz: Annotated[Hertz, Meta(description="highest frequency; or give `harmonics`")] | None = None
    window: Annotated[Window, Meta(description="imaging window in normalised position, of each branch")] = (
        0.1,
        0.9,
    )
    directions: Annotated[Literal["both", "forward"], Meta(description="the branches that image")] = "both"


class Refinement(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What `tablegen refine` learnt: a residual layer over the model's drive, and the scan that it belongs to."""

    a: Annotated[Harmonics, Meta(description="cosine terms of harmonics 1, 2, ..., as fractions of the line")]
    b: Annotated[Harmonics, Meta(description="sine terms, as many")]
    v_amplitude: Annotated[PositiveVolts, Meta(description="drive that it was learnt at, peak to peak at the piezo")]
    v_offset: Annotated[Volts, Meta(description="offset voltage that it was learnt at")]
    rate_hz: Annotated[Hertz, Meta(description="rate that it was learnt at")]
    turn: Annotated[Normalised, Meta(description="turning point that it was learnt at")]
    window: Annotated[Window, Meta(description="imaging window that was measured")]
    directions: Annotated[Literal["both", "forward"], Meta(description="branches that were measured")]
    model: (
        Annotated[str, Meta(pattern="^[0-9a-f]{16}$", description="digest of the model below; or it is not compared")]
        | None
    ) = None
    before_percent: (
        Annotated[float, Meta(ge=0.0, le=100.0, description="rms residual of the trace that it was learnt from")] | None
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
    offset_nm: Annotated[float, Meta(ge=0.0, le=1e9, description="position above that at 0 V")] | None = None
    park_v: Annotated[Volts, Meta(description="where park leaves the piezo; the offset if not given")] | None = None
    turn: Annotated[Normalised, Meta(description="turning point: fraction of the period spent going forward")] = 0.5
    band_limit: BandLimit = BandLimit()
    table: Table = Table()
    refinement: Refinement | None = None


class SlowAxis(FastAxis, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The axis that moves once a frame."""

    motion: Annotated[
        Literal["ramp", "step"],
        Meta(description="ramp: moves at every tick; step: once a line, at its start"),
    ] = "ramp"


class Dac(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The converter. Code c gives v_min + (v_max - v_min) c / 2^bits."""

    bits: Annotated[int, Meta(ge=8, le=24, description="resolution; arithmetic is in straight codes 0..2^bits - 1")]
    coding: Annotated[Literal["offset-binary", "twos-complement"], Meta(description="of the word sent")] = (
        "offset-binary"
    )
    v_min: Annotated[Volts, Meta(description="voltage at code 0")]
    v_max: Annotated[Volts, Meta(description="voltage one LSB above the highest code")]
    update_rate_hz: Annotated[float, Meta(ge=1.0, le=1e9, description="ticks a second; both axes share them")]
    align: Annotated[Literal["right", "left"], Meta(description="of the code in the word sent")] = "right"
    word_bits: Annotated[int, Meta(ge=8, le=32, description="bits of the word sent; `bits` if not given")] | None = None


class Amplifier(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Piezo voltage = gain * converter voltage + bias_v."""

    gain: Annotated[float, Meta(ge=-1e4, le=1e4, description="negative for an inverting amplifier")]
    bias_v: Annotated[Volts, Meta(description="piezo voltage at 0 V of the converter")] = 0.0
    max_slew_v_per_s: Annotated[float, Meta(ge=1e-3, le=1e12, description="at the piezo")] | None = None


class Timing(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Pixels, lines and rates."""

    pixels: Annotated[int, Meta(ge=1, le=65536, description="per line and direction, over the imaging window")]
    lines: Annotated[int, Meta(ge=1, le=65536, description="line periods per frame")]
    line_rate_hz: Annotated[float, Meta(ge=1e-3, le=1e6, description="forward and backward make one line")]
    ticks_per_line: (
        Annotated[int, Meta(ge=8, le=1 << 24, description="instead of the nearest to the line rate")] | None
    ) = None
    ticks_per_pixel: (
        Annotated[int, Meta(ge=1, le=1 << 20, description="choose the line so that each pixel is this many ticks")]
        | None
    ) = None
    settle_lines: Annotated[int, Meta(ge=0, le=255, description="lines played with valid low after a change")] = 2


class Limits(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the certificate may not exceed."""

    max_error_lsb: (
        Annotated[float, Meta(gt=0.0, le=1e6, description="largest error of any code, in LSB of the converter")] | None
    ) = None
    max_scaling_error_percent: (
        Annotated[Percent, Meta(description="peak to peak over the imaging window, and of the window's size")] | None
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
                description="what to write, by `tablegen formats`; c and verilog if not given",
            ),
        ]
        | None
    ) = None
    header_only: Annotated[bool, Meta(description="C: tables inside the header, without a .c file beside it")] = False


class Scan(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One scan."""

    name: Annotated[Identifier, Meta(description="prefix of every emitted file and identifier")]
    scanner: Annotated[FileName, Meta(description="scanner file, relative to this one")]
    dac: Dac
    amplifier: Amplifier
    timing: Timing
    x: FastAxis
    y: SlowAxis
    limits: Limits = Limits()
    emit: Emit = Emit()


class OffsetPoint(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The apparent size of one object at one offset voltage."""

    offset_v: Annotated[Volts, Meta(description="offset voltage of the image")]
    apparent_nm: Annotated[Nanometres, Meta(description="size of the object, or lattice constant, as it appeared")]


class Offset(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Amplitude factor against offset voltage, (1)-(4): one of the three ways to give it."""

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

    k_nm_per_v: Annotated[float, Meta(ge=1e-6, le=1e6, description="calibrated at base_nm")]
    beta: Annotated[float, Meta(gt=-0.5, le=100.0, description="0 is the linear scanner")] = 0.0
    base_nm: Annotated[Nanometres, Meta(description="scan size of the calibration")] = 200.0
    v_threshold: Annotated[float, Meta(gt=0.0, le=1.0, description="normalised; linear above")] = 0.5


class HysteresisPoint(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Hysteresis of one direction as measured at one scan voltage."""

    size_v: Annotated[PositiveVolts, Meta(description="scan voltage V_scan of the measurement, at the piezo")]
    beta: Annotated[Residual, Meta(description="peak residual there, of the scan")]
    u_peak: Annotated[Normalised, Meta(description="where it peaks; harmonic model only")] | None = None


class Branch(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Hysteresis of one direction: by (22), or as measured; u_peak in sweep-aligned coordinates for both directions."""

    beta_max: Annotated[Residual, Meta(description="peak residual at full scale; or give `points`")] | None = None
    rho: Annotated[Decay, Meta(description="dimensionless decay constant of (22)")] = 1.5
    u_peak: Annotated[Normalised, Meta(description="where the residual peaks; harmonic model only")] | None = None
    points: (
        Annotated[
            list[HysteresisPoint],
            Meta(min_length=1, max_length=64, description="instead of (22); linear between, from 0 at 0 V"),
        ]
        | None
    ) = None


class Branches(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Both directions, as calibrated at one turning point."""

    turn: Annotated[Normalised, Meta(description="turning point of the calibration")]
    forward: Branch
    backward: Branch


class Hysteresis(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Hysteresis of the line, (13)-(22)."""

    model: Annotated[
        Literal["harmonic", "sinusoidal", "triangle"],
        Meta(description="harmonic: (17)-(21); sinusoidal: (15); triangle: not compensated"),
    ] = "harmonic"
    branches: Annotated[
        list[Branches], Meta(max_length=64, description="one entry a calibrated turn; interpolated between")
    ] = []


class Frequency(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Loss of amplitude with frequency, (23)."""

    alpha: Annotated[float, Meta(ge=0.0, le=0.5, description="relative amplitude lost per decade")]
    reference_hz: Annotated[Hertz, Meta(description="rate at which the scanner was calibrated")]


class Resonance(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Inverse dynamics: each harmonic divided by the response; either second order with delay, or measured."""

    frequency_hz: Annotated[Hertz, Meta(description="undamped resonance")] | None = None
    quality: Annotated[float, Meta(ge=0.1, le=1e5, description="quality factor")] | None = None
    delay_s: Annotated[float, Meta(ge=0.0, le=1.0, description="dead time of amplifier and scanner")] = 0.0
    response: (
        Annotated[
            FileName, Meta(description="CSV of the measured response, relative to this file; header hz,gain,phase_deg")
        ]
        | None
    ) = None
    max_boost_db: Annotated[float, Meta(ge=0.0, le=60.0, description="no harmonic is raised by more")] = 6.0


class ScannerAxis(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Calibration of one axis."""

    size: Size
    offset: Offset | None = None
    hysteresis: Hysteresis | None = None
    frequency: Frequency | None = None
    resonance: Resonance | None = None


class Scanner(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A calibrated scanner."""

    name: Annotated[Name, Meta(description="for reports")]
    v_max: Annotated[
        PositiveVolts, Meta(description="maximum output of the piezo driver; normalised voltages refer to it")
    ]
    x: ScannerAxis
    y: ScannerAxis
