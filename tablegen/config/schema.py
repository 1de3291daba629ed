"""The scan file as frozen types. ``config/scanner.py`` has those of the scanner file.

Units are part of every name. The ranges are defined here only: the decoder checks them, ``tablegen schema`` prints
them.
"""

from typing import Annotated, Literal, get_args

from msgspec import Meta, Struct

from tablegen.base.quantities import FileName, Hertz, Micrometres, Nanometres, Normalised, PositiveVolts, Volts

# Leaves room for the suffixes of emitted names; reserved words are refused as well, see ``why_not_a_name``.
MAXIMUM_NAME = 48
Identifier = Annotated[str, Meta(min_length=1, max_length=MAXIMUM_NAME, pattern="^[A-Za-z](_?[A-Za-z0-9])*$")]
Percent = Annotated[float, Meta(gt=0.0, le=1000.0)]
LayerNm = Annotated[list[Annotated[float, Meta(ge=-1e6, le=1e6)]], Meta(min_length=1, max_length=512)]
Harmonics = Annotated[list[Annotated[float, Meta(ge=-0.5, le=0.5)]], Meta(min_length=1, max_length=512)]
DEFAULT_BITS = 16  # of a table word
Window = tuple[Annotated[float, Meta(ge=0.0, le=1.0)], Annotated[float, Meta(ge=0.0, le=1.0)]]


MAXIMUM_SPLINE_BITS = 21  # the sample of a cubic table has 25 bits then, as that of any other
MAXIMUM_SPLINE_LENGTH = 1 << 14  # index and fraction of a segment are the 32 bits of a phase


class Table(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the waveform is stored on the device."""

    mode: (
        Annotated[
            Literal["interpolated", "cubic", "direct", "auto"],
            Meta(
                description="interpolated: `length` words and linear interpolation; cubic: `length` coefficients of a "
                "cubic spline; direct: one word per tick; auto: the build finds the least memory for `max_error_lsb`; "
                "default: interpolated, or auto with an error"
            ),
        ]
        | None
    ) = None
    length: (
        Annotated[
            int,
            Meta(
                ge=4,
                le=65536,
                description="number of words; interpolated, cubic: a power of two, default 2048 and 256; "
                "cubic: up to 16384",
            ),
        ]
        | None
    ) = None
    bits: Annotated[int, Meta(ge=8, le=24, description="bits of a table word; cubic: up to 21; default: 16")] | None = (
        None
    )
    max_error_lsb: (
        Annotated[
            float,
            Meta(
                gt=0.0,
                le=1e6,
                description="the build chooses the table with the least memory whose codes have at most this error, in "
                "LSB of the converter (shaped output: before the rounding). Given `mode`, `length` and `bits` stay; "
                "default with auto: 1, or that of `limits` if that is less; 0.01 with shaped output",
            ),
        ]
        | None
    ) = None

    @property
    def chosen_by_build(self) -> bool:
        """True if the build chooses the keys that are not given."""
        return self.mode == "auto" or self.max_error_lsb is not None


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
            Annotated[int, Meta(ge=1, le=512)] | Literal["fewest"],
            Meta(
                description="highest harmonic of the rate; fewest: as few as the error allows; default: 32, unless "
                "`cutoff_hz` is given"
            ),
        ]
        | None
    ) = None
    max_scaling_error_percent: (
        Annotated[
            float,
            Meta(
                ge=0.001,
                le=10.0,
                description="window: play the waveform of least acceleration whose scaling error is at most this, peak "
                "to peak in the imaging window; alone: with 32 harmonics, or as many as it takes. Default on an "
                "operator, without `harmonics` and `cutoff_hz`: the error of the converter's steps",
            ),
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
    before_scaling_percent: (
        Annotated[
            float,
            Meta(ge=0.0, le=1e4, description="scaling error of the same trace, peak to peak, of the worse direction"),
        ]
        | None
    ) = None
    after_percent: (
        Annotated[float, Meta(ge=0.0, le=100.0, description="rms residual that was predicted with this layer")] | None
    ) = None
    previous_a: (
        Annotated[Harmonics, Meta(description="cosine terms of the layer with which that residual was measured")] | None
    ) = None
    previous_b: Annotated[Harmonics, Meta(description="sine terms of the same layer")] | None = None
    best: (
        Annotated[bool, Meta(description="this layer is the best: the round after it had a larger scaling error")]
        | None
    ) = None
    before_of: (
        Annotated[
            Literal["line", "mismatch"],
            Meta(description="residual of the line, or the difference of trace and retrace alone; default: line"),
        ]
        | None
    ) = None


class FrameRefinement(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What `tablegen refine` learnt of an axis at an angle, and the scan to which it belongs."""

    line_a: Annotated[LayerNm, Meta(description="cosine terms of harmonics 1, 2, ... of the line, in nm")]
    line_b: Annotated[LayerNm, Meta(description="sine terms of the same harmonics")]
    frame_a: Annotated[LayerNm, Meta(description="cosine terms of harmonics 1, 2, ... of the frame, in nm")]
    frame_b: Annotated[LayerNm, Meta(description="sine terms of the same harmonics")]
    line_nm: Annotated[float, Meta(ge=-1e9, le=1e9, description="share of the line's motion at which it was learnt")]
    frame_nm: Annotated[float, Meta(ge=-1e9, le=1e9, description="share of the frame's motion at which it was learnt")]
    v_offset: Annotated[Volts, Meta(description="offset voltage at which it was learnt")]
    rate_hz: Annotated[Hertz, Meta(description="line rate at which it was learnt")]
    lines: Annotated[int, Meta(ge=1, description="line periods of the frame at which it was learnt")]
    turn: Annotated[Normalised, Meta(description="turning point of the line at which it was learnt")]
    window: Annotated[Window, Meta(description="imaging window of the line that was measured")]
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
        Annotated[float, Meta(ge=0.0, le=100.0, description="rms error of the trace from which it was learnt")] | None
    ) = None


class FastAxis(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The axis that moves once a line."""

    size_nm: (
        Annotated[Nanometres, Meta(description="scan size; or give `size_v`, or `image_nm` of the scan")] | None
    ) = None
    size_um: Annotated[Micrometres, Meta(description="the same in micrometres")] | None = None
    size_v: Annotated[PositiveVolts, Meta(description="scan voltage V_scan at the piezo, before m and g")] | None = None
    size_of: Annotated[
        Literal["line", "window"],
        Meta(description="what `size_nm` measures: the whole line, or the imaging window"),
    ] = "line"
    offset_v: Annotated[Volts, Meta(description="offset voltage at the piezo; or give `offset_nm`")] | None = None
    offset_nm: Annotated[float, Meta(ge=-1e9, le=1e9, description="position relative to that at 0 V")] | None = None
    offset_um: Annotated[float, Meta(ge=-1e6, le=1e6, description="the same in micrometres")] | None = None
    park_v: Annotated[Volts, Meta(description="voltage at the piezo after park; default: the offset")] | None = None
    turn: Annotated[
        Normalised, Meta(description="turning point: fraction of the period in which the axis moves forward")
    ] = 0.5
    band_limit: BandLimit = BandLimit()
    table: Table = Table()
    refinement: Refinement | None = None
    frame_refinement: FrameRefinement | None = None


class LineAxis(FastAxis, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The fast axis of a scan, with the motion of its line."""

    motion: Annotated[
        Literal["line", "sine", "auto"],
        Meta(
            description="line: straight in time; sine: one harmonic, with pixels at equal steps of the position that "
            "the operator of the axis predicts; auto: what leaves the smaller error at this rate"
        ),
    ] = "line"


class SlowAxis(FastAxis, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The axis that moves once a frame."""

    like: (
        Annotated[
            Literal["x"],
            Meta(description="y takes all keys of `[x]` except `refinement`; its own keys take precedence"),
        ]
        | None
    ) = None
    motion: Annotated[
        Literal["ramp", "step", "off"],
        Meta(
            description="ramp: moves on every tick; step: moves once per line, at its start; off: rests at its offset, "
            "for line scans"
        ),
    ] = "ramp"

    @property
    def off(self) -> bool:
        """True if the axis is static."""
        return self.motion == "off"


class Dac(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The converter of both axes, or of one. Code c gives v_min + (v_max - v_min) c / 2^bits.

    Each key may stand in the scan file or in the scanner file; ``config/hardware.py`` puts them together.
    """

    bits: (
        Annotated[
            int,
            Meta(ge=8, le=24, description="required; resolution, one for both axes; straight codes 0..2^bits - 1"),
        ]
        | None
    ) = None
    coding: (
        Annotated[
            Literal["offset-binary", "twos-complement"],
            Meta(description="coding of the word that is sent; default: offset-binary"),
        ]
        | None
    ) = None
    v_min: Annotated[Volts, Meta(description="required; lowest voltage, at code 0")] | None = None
    v_max: Annotated[Volts, Meta(description="required; voltage one LSB above the highest")] | None = None
    inverted: (
        Annotated[
            bool,
            Meta(
                description="complementary codes, every bit inverted: code 0 gives the highest voltage, the last "
                "one v_min; default: false"
            ),
        ]
        | None
    ) = None
    output: (
        Annotated[
            Literal["A", "B"],
            Meta(description="output of a dual converter that drives this axis; default: A for x, B for y"),
        ]
        | None
    ) = None
    update_rate_hz: (
        Annotated[float, Meta(ge=1.0, le=1e9, description="required; ticks per second, for both axes")] | None
    ) = None
    align: (
        Annotated[
            Literal["right", "left"],
            Meta(description="alignment of the code in the word that is sent; default: right"),
        ]
        | None
    ) = None
    word_bits: (
        Annotated[int, Meta(ge=8, le=32, description="bits of the word that is sent; default: `bits`")] | None
    ) = None
    shaping: (
        Annotated[
            Literal["off", "first", "second", "scanner"],
            Meta(
                description="error feedback of the rounding, which moves its error to high frequencies: of first or "
                "second order, or chosen for the resonance of the axis; default: off"
            ),
        ]
        | None
    ) = None


class Amplifier(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Piezo voltage = gain * converter voltage + bias_v; of both axes, or of one."""

    gain: (
        Annotated[float, Meta(ge=-1e4, le=1e4, description="required; gain of the amplifier; negative if it inverts")]
        | None
    ) = None
    bias_v: Annotated[Volts, Meta(description="piezo voltage if the converter outputs 0 V; default: 0")] | None = None
    max_slew_v_per_s: (
        Annotated[
            float,
            Meta(
                ge=1e-3,
                le=1e12,
                description="maximum slew rate at the piezo; without it the slew guard is twice the steepest step",
            ),
        ]
        | None
    ) = None


class WrittenTiming(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Pixels, lines and rates."""

    pixels: Annotated[int, Meta(ge=1, le=65536, description="pixels per line and direction, over the imaging window")]
    image_lines: (
        Annotated[
            int,
            Meta(
                ge=1,
                le=32768,
                description="lines of the image; line periods for the turnarounds of y are added to them",
            ),
        ]
        | None
    ) = None
    lines: Annotated[int, Meta(ge=1, le=65536, description="line periods per frame; or give `image_lines`")] | None = (
        None
    )
    frame: (
        Annotated[
            Literal["flyback", "up-down"],
            Meta(
                description="flyback: every image goes up, and y flies back; up-down: images on the way up and down. "
                "Sets `y.turn`, `y.band_limit.directions` and, unless it is given, `y.band_limit.window`"
            ),
        ]
        | None
    ) = None
    line_rate_hz: (
        Annotated[
            float,
            Meta(
                ge=1e-3,
                le=1e6,
                description="lines per second; forward and backward make one line; or give `frame_rate_hz` or a speed",
            ),
        ]
        | None
    ) = None
    frame_rate_hz: (
        Annotated[
            float, Meta(ge=1e-9, le=1e6, description="frames per second; a frame is one period of y: up and back")
        ]
        | None
    ) = None
    speed_um_per_s: (
        Annotated[float, Meta(ge=1e-6, le=1e9, description="speed of the tip along the forward line, in the window")]
        | None
    ) = None
    speed_mm_per_s: Annotated[float, Meta(ge=1e-9, le=1e6, description="the same in mm/s")] | None = None
    ticks_per_line: (
        Annotated[int, Meta(ge=8, le=1 << 24, description="ticks of a line; default: the nearest to the line rate")]
        | None
    ) = None
    ticks_per_pixel: (
        Annotated[int, Meta(ge=1, le=1 << 20, description="ticks of a pixel; the length of the line follows from it")]
        | None
    ) = None
    settle_lines: Annotated[
        Annotated[int, Meta(ge=0, le=255)] | Literal["auto"],
        Meta(
            description="lines after a change during which valid is low; auto: by the operators of x, of y or of both"
        ),
    ] = 2


class Timing(WrittenTiming, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Pixels, lines and rates, solved: line periods and line rate."""

    lines: int
    line_rate_hz: float


class Limits(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Limits of the certificate; a build that exceeds one fails."""

    max_error_lsb: (
        Annotated[float, Meta(gt=0.0, le=1e6, description="largest error of any code, in LSB of the converter")] | None
    ) = None
    max_scaling_error_percent: (
        Annotated[
            Percent,
            Meta(
                description="largest scaling error, peak to peak, and largest size error, both of the imaging window; "
                "the errors that an operator expects on the scanner are added"
            ),
        ]
        | None
    ) = None


ProcessorName = Literal["cortex-m4", "cortex-m0plus", "riscv32"]


class Cost(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The processor that plays the scan in C, and the instructions that a sample may take."""

    processor: Annotated[
        ProcessorName,
        Meta(description="processor whose measured instructions `tables`, `show` and the choice of a table use"),
    ]
    max_instructions: (
        Annotated[
            float,
            Meta(
                gt=0.0,
                le=1e6,
                description="most instructions for a sample of an axis: a table that the build chooses takes no more, "
                "and any other that does is refused; default: no limit",
            ),
        ]
        | None
    ) = None


DEFAULT_FORMATS = ("c", "verilog")
SequencerFormat = Literal[
    "c",
    "verilog",
    "arduino",
    "axi-stream",
    "cargo",
    "cmsis-pack",
    "constraints",
    "esp-idf",
    "fusesoc",
    "platformio",
    "spi",
    "zephyr",
]
"""A format that plays every scan: a sequencer, or a package around one. Others have the tables of a line and a frame.
"""
SEQUENCER_FORMATS: tuple[str, ...] = get_args(SequencerFormat)


class Emit(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the build writes."""

    formats: (
        Annotated[
            list[Annotated[str, Meta(min_length=1, max_length=64)]],
            Meta(
                min_length=1,
                max_length=64,
                description="formats to write, by `tablegen formats`; default: c and verilog, of a scan at an angle "
                "or with [z] c alone",
            ),
        ]
        | None
    ) = None
    header_only: Annotated[
        bool, Meta(description="C: put the tables into the header instead of a .c file; not at an angle")
    ] = False
    clock_hz: (
        Annotated[
            float,
            Meta(
                gt=0.0,
                le=1e10,
                description="Verilog: clock of the FPGA. It has to be a whole multiple of update_rate_hz, to 0.01 %, "
                "and fast enough for the sequencer, and for that of z",
            ),
        ]
        | None
    ) = None


TiltName = Literal["z", "aux"]
"""An output beside x and y: the x of the second sequencer, or its y."""
TILT_NAMES: tuple[TiltName, ...] = get_args(TiltName)


class Tilt(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An output beside x and y that is linear in both, from the scan's centre: z, which follows a tilted sample."""

    slope_x: Annotated[
        float, Meta(ge=-1.0, le=1.0, description="nm of the output for each nm along x on the sample, for example 0.02")
    ] = 0.0
    slope_y: Annotated[
        float, Meta(ge=-1.0, le=1.0, description="nm of the output for each nm along y on the sample")
    ] = 0.0
    offset_v: Annotated[Volts, Meta(description="voltage at the piezo in the centre of the scan")]
    park_v: Annotated[Volts, Meta(description="voltage at the piezo after park; default: the offset")] | None = None


class ScanOfMany(Struct, frozen=True, kw_only=True):
    """One scan of a library, for `tablegen sweep`: its name, and the keys of this file that differ for it."""

    name: Annotated[Identifier, Meta(description="prefix of its files and identifiers, and its directory")]


class WrittenScan(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One scan."""

    name: Annotated[Identifier, Meta(description="prefix of every emitted file and identifier")]
    scanner: Annotated[FileName, Meta(description="path of the scanner file, relative to the scan file")]
    image_nm: (
        Annotated[
            Nanometres | Annotated[list[Nanometres], Meta(min_length=2, max_length=2)],
            Meta(description="size of the image, or [x, y]: what the imaging windows span; in place of sizes of axes"),
        ]
        | None
    ) = None
    image_um: (
        Annotated[
            Micrometres | Annotated[list[Micrometres], Meta(min_length=2, max_length=2)],
            Meta(description="the same in micrometres"),
        ]
        | None
    ) = None
    angle_deg: Annotated[
        float,
        Meta(
            ge=-360.0,
            le=360.0,
            description="scan angle: the fast direction, counterclockwise from the x axis; both axes need an operator",
        ),
    ] = 0.0
    drift_nm_per_s: Annotated[
        tuple[Annotated[float, Meta(ge=-1e6, le=1e6)], Annotated[float, Meta(ge=-1e6, le=1e6)]],
        Meta(description="drift of the sample along x and y, which the scan follows; both axes need an operator"),
    ] = (0.0, 0.0)
    dac: Annotated[
        Dac, Meta(description="The converter of both axes; keys that the scanner file has can be left out.")
    ] = Dac()
    amplifier: Annotated[
        Amplifier, Meta(description="The amplifier of both axes; keys that the scanner file has can be left out.")
    ] = Amplifier()
    timing: WrittenTiming
    x: LineAxis
    y: SlowAxis
    z: Tilt | None = None
    aux: (
        Annotated[
            Tilt, Meta(description="A second output that is linear in x and y, for example a focus. Keys as `[z]`.")
        ]
        | None
    ) = None
    limits: Limits = Limits()
    cost: Cost | None = None
    emit: Emit = Emit()
    scans: (
        Annotated[list[ScanOfMany], Meta(min_length=1, description="scans of a library; `name` above is then its name")]
        | None
    ) = None

    @property
    def tilts(self) -> dict[TiltName, Tilt]:
        """The outputs beside x and y by their names, z first; empty without any."""
        return {name: tilt for name in TILT_NAMES if (tilt := getattr(self, name)) is not None}


class Scan(WrittenScan, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One scan as it is planned: ``config/image_keys.py`` has solved what was written for sizes, lines and rates.

    Sizes stand at the axes, ``timing`` has line periods and a line rate, ``y`` its turn and its window.
    """

    timing: Timing
