"""The fields of ``manifest.json``: types with their ranges, and the programs that these fields are."""

from fractions import Fraction
from itertools import pairwise
from math import isqrt
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, Struct

from tablegen.config.schema import ProcessorName
from tablegen.device.schedule import MAXIMUM_LINE_TICKS, Schedule, Window
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.phase import MAXIMUM_TICKS, RationalPhase
from tablegen.fixedpoint.program import Mode, Program
from tablegen.fixedpoint.shaping import MAXIMUM_ZERO, OFF, Shaping
from tablegen.numerics.arrays import Floats, Ints

_CHUNK_PRODUCTS = 1 << 22  # products of harmonics and ticks that are worked out at a time

Natural = Annotated[int, Meta(ge=0, le=MAXIMUM_TICKS)]
Positive = Annotated[int, Meta(ge=1, le=MAXIMUM_TICKS)]
Code = Annotated[int, Meta(ge=0, lt=1 << 24)]
Word = Annotated[int, Meta(ge=-(1 << 31), lt=1 << 31)]
Bits = Annotated[int, Meta(ge=8, le=24)]
Pair = tuple[Natural, Natural]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]
PixelTicks = Annotated[int, Meta(ge=1, le=65535)]
Digest = Annotated[str, Meta(pattern=r"^[0-9a-f]{64}\Z")]
# A name of a file never leads outside the directory.
MAXIMUM_FILE_NAME = 200
FileName = Annotated[str, Meta(max_length=MAXIMUM_FILE_NAME, pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]*\Z")]
# Name of a file of a build; one in a sub-folder has that before it, as ``zephyr/module.yml``.
BuildFileName = Annotated[
    str, Meta(max_length=MAXIMUM_FILE_NAME, pattern=r"^([A-Za-z0-9_][A-Za-z0-9_.-]*/)*[A-Za-z0-9_][A-Za-z0-9_.-]*\Z")
]
# Name of a file beside the scanner file; it may have any characters, since no path is made from it.
SourceName = Annotated[str, Meta(min_length=1, max_length=255)]
Version = Annotated[str, Meta(max_length=64, pattern=r"^[A-Za-z0-9][A-Za-z0-9.+!-]*\Z")]
Number = Annotated[int, Meta(ge=-(1 << 43), lt=1 << 43)]
Volts = Annotated[float, Meta(ge=-1e9, le=1e9)]
Coefficient = Annotated[float, Meta(ge=-1e3, le=1e3)]  # of a waveform from 0 to 1
LEAST_V_PER_CODE = 1e-15  # a range of 1 mV in 24 bits, behind an amplifier of 1e-4, is 6e-15 V


class ManifestBranch(Struct):
    """The hysteresis of one branch: the peak of its residual, and its place."""

    beta: float
    u_peak: float


class ManifestResonance(Struct):
    """The frequency at which the response is largest, and half its width there."""

    hz: float
    half_width_hz: float


class ManifestDrive(Struct):
    """The volts at the piezo, and the shape that they follow."""

    v_offset: Volts
    v_amplitude: Volts
    v_scan: Volts
    v_scan_normalised: Annotated[float, Meta(gt=0.0)]
    m: float
    g: float
    size_nm: float
    window_nm: float
    turn: Annotated[float, Meta(gt=0.0, lt=1.0)]
    model: str
    forward: ManifestBranch
    backward: ManifestBranch
    resonance: ManifestResonance | None = None
    model_files: dict[SourceName, Digest] | None = None


class ManifestLine(Struct):
    """The period of an axis."""

    ticks: Positive
    hold_ticks: Positive
    phase_step: Annotated[int, Meta(ge=0, le=1 << 32)]
    phase_remainder: Natural
    rate_hz: float
    requested_hz: float
    rate_exact: tuple[int, Positive]


class ManifestSeries(Struct):
    """A waveform w(t) in float64; a layer has no mean."""

    a: list[float]
    b: list[float]
    a0: float = 0.0


class ManifestFourier(Struct):
    """The waveform w(t) in float64, its words, and the target where dynamics or a layer make that another one."""

    harmonics: Annotated[int, Meta(ge=1, le=4096)]
    a0: Coefficient
    a: list[Coefficient]
    b: list[Coefficient]
    a0_word: Word
    a_words: list[Word]
    b_words: list[Word]
    band_limit: Literal["truncate", "lanczos", "window"]
    q_format: Literal["Q2.30"]
    window: tuple[float, float]
    directions: Literal["forward", "both"]
    held_harmonics: list[Positive] = []
    held_factors: list[float] = []
    target: ManifestSeries | None = None
    refinement: ManifestSeries | None = None
    max_scaling_error_percent: Annotated[float, Meta(gt=0.0, le=10.0)] | None = None
    place: ManifestSeries | None = None
    imaged: tuple[Share, Share] | None = None


class ManifestAskedTable(Struct):
    """The request for a table that the build chose: its worst error, and the keys that were free."""

    max_error_lsb: Annotated[float, Meta(gt=0.0, le=1e6)]
    free: list[Literal["mode", "length", "bits"]]
    processor: ProcessorName | None = None
    max_instructions: Annotated[float, Meta(gt=0.0, le=1e6)] | None = None


class ManifestTable(Struct):
    """The table: the words that are played."""

    mode: Mode
    bits: Bits
    guard_bits: Number
    scale: Annotated[float, Meta(gt=0.0, le=1e9)]
    words: Annotated[list[Annotated[int, Meta(ge=-(1 << 23), lt=1 << 23)]], Meta(min_length=1, max_length=1 << 20)]
    asked: ManifestAskedTable | None = None


class ManifestShaping(Struct, forbid_unknown_fields=True):
    """The feedback of remainders of the rounding; without it there is none."""

    order: Annotated[int, Meta(ge=1, le=3)]
    zero: Annotated[int, Meta(ge=0, le=MAXIMUM_ZERO)]


class ManifestOutput(Struct):
    """The output stage, and volts of its codes; ``own_hardware`` of y where they are not those of x.

    ``channel`` is the output of a dual converter, where the configuration gives it.
    """

    gain_word: Number
    gain_q: Number
    offset_word: Annotated[int, Meta(gt=-(1 << 43), lt=1 << 43)]
    offset_code: Number
    code_min: Code
    code_max: Code
    max_step: Annotated[int, Meta(ge=1, lt=1 << 24)]
    park_code: Code
    v_zero: Volts
    v_per_code: Volts
    dac_bits: Bits
    coding: Literal["offset-binary", "twos-complement"]
    align: Literal["right", "left"]
    word_bits: Annotated[int, Meta(ge=8, le=32)]
    own_hardware: bool = False
    channel: Literal["", "A", "B"] = ""
    shaping: ManifestShaping | None = None

    @property
    def output(self) -> Output:
        """The output stage in a device."""
        return Output(
            gain_word=self.gain_word,
            gain_q=self.gain_q,
            offset_word=self.offset_word,
            code_min=self.code_min,
            code_max=self.code_max,
            max_step=self.max_step,
            park_code=self.park_code,
            dac_bits=self.dac_bits,
            coding=self.coding,
            align=self.align,
            word_bits=self.word_bits,
            channel=self.channel,
            shaping=OFF if self.shaping is None else Shaping(self.shaping.order, self.shaping.zero),
        )


class ManifestFigure(Struct):
    """A figure in percent, and its uncertainty."""

    value: float
    uncertainty: float | None = None


class ManifestStroke(Struct):
    """The branches at the stroke that is played, and its size over that of the line."""

    forward: ManifestBranch
    backward: ManifestBranch
    size: Annotated[float, Meta(gt=0.0, le=1.0)]


class ManifestExpected(Struct):
    """The expectation of the line on the scanner, by an operator or by the laws of the scanner file."""

    basis: Literal["traces", "laws"]
    rms_percent: dict[str, ManifestFigure] = {}
    scaling_percent: dict[str, ManifestFigure] = {}
    mismatch_percent: ManifestFigure | None = None
    size_percent: ManifestFigure | None = None
    distance_percent: float | None = None
    stroke: ManifestStroke | None = None


class ManifestResponse(Struct):
    """The points of a measured response: ascending Hz, gain over that at low frequency, phase in turns."""

    hz: list[Annotated[float, Meta(gt=0.0)]]
    gain: list[Annotated[float, Meta(gt=0.0)]]
    phase_turns: list[float]

    def __post_init__(self) -> None:
        if not 2 <= len(self.hz) == len(self.gain) == len(self.phase_turns):
            raise ValueError(f"a response of {len(self.hz)}, {len(self.gain)} and {len(self.phase_turns)} points")
        if any(after <= before for before, after in pairwise(self.hz)):
            raise ValueError("a response whose frequencies do not ascend")


class ManifestPassage(Struct):
    """The response that the position has: second order, measured, or a band from 0 Hz."""

    band_hz: Annotated[float, Meta(gt=0.0)] | None = None
    frequency_hz: Annotated[float, Meta(gt=0.0)] | None = None
    quality: Annotated[float, Meta(gt=0.0)] | None = None
    delay_s: float | None = None
    response: ManifestResponse | None = None


class ManifestChanges(Struct):
    """The rate of changes of codes, and their mean size in codes."""

    percent: float
    mean_step: float


class ManifestRounded(Struct):
    """The figures of the scan without shaping."""

    max_error_lsb: float
    rms_error_lsb: float
    scaling_error_percent: dict[str, float]
    changes: ManifestChanges


class ManifestShaped(Struct):
    """The effect of shaping, and its cost."""

    passage: ManifestPassage
    ticks: Positive
    max_code_error_lsb: float
    rms_code_error_lsb: float
    largest_step: int
    changes: ManifestChanges
    rounded: ManifestRounded


class ManifestPosition(Struct):
    """The errors of the held codes of an unshaped axis in its position, behind the response of the scanner."""

    passage: ManifestPassage
    max_error_lsb: float
    rms_error_lsb: float
    scaling_error_percent: dict[str, float]


class ManifestPixels(Struct):
    """The errors of pixels that are taken where the piezo is, in percent of the line."""

    rms_percent: dict[str, float]
    worst_percent: dict[str, float]
    scaling_percent: dict[str, float]
    mismatch_percent: float
    errors_percent: dict[str, list[float]]


class ManifestCertificate(Struct):
    """The certificate of an axis."""

    max_error_lsb: Annotated[float, Meta(ge=0.0)]
    ticks: int | None = None
    rms_error_lsb: float | None = None
    lowest_code: int | None = None
    highest_code: int | None = None
    headroom_low: int | None = None
    headroom_high: int | None = None
    largest_step: int | None = None
    max_step: int | None = None
    peak_slew_v_per_s: float | None = None
    beyond_cutoff_db: float | None = None
    at_resonance_db: float | None = None
    scaling_error_percent: dict[str, dict[str, float]] | None = None
    refinement_percent: dict[str, dict[str, float]] | None = None
    expected: ManifestExpected | None = None
    peak_acceleration: float | None = None
    shaped: ManifestShaped | None = None
    position: ManifestPosition | None = None
    pixels: ManifestPixels | None = None


class ManifestAxis(Struct):
    """One axis of a manifest; one without a size rests at its offset."""

    drive: ManifestDrive
    line: ManifestLine
    fourier: ManifestFourier
    table: ManifestTable
    output: ManifestOutput
    certificate: ManifestCertificate

    @property
    def resting(self) -> bool:
        """True if the axis is static."""
        return self.drive.size_nm == 0.0

    @property
    def fourier_words(self) -> Ints:
        """The Fourier words in the order in which devices hold them: a0, a1..aH, b1..bH.

        Returns
        -------
        Ints
            Q2.30, shape (2 H + 1,).
        """
        fourier = self.fourier
        return np.array([fourier.a0_word, *fourier.a_words, *fourier.b_words], dtype=np.int64)

    @property
    def program(self) -> Program:
        """The program of the axis in a device."""
        return Program(
            RationalPhase(self.line.ticks // self.line.hold_ticks),
            self.line.hold_ticks,
            self.table.mode,
            self.table.bits,
            np.array(self.table.words, dtype=np.int64),
            self.output.output,
        )

    def unrounded_codes(self, k: Ints) -> Floats:
        """Compute the unrounded codes of the float waveform.

        V = v_offset + v_amplitude (w - 1/2), code = (V - v_zero) / v_per_code. Evaluated term by term with exact
        phases, in none of the ways in which the build does it.

        Parameters
        ----------
        k
            Ticks in [0, ticks) of the period, shape (n,).

        Returns
        -------
        Floats
            Codes in LSB of the converter, shape (n,).
        """
        advance, period = k // self.line.hold_ticks, self.line.ticks // self.line.hold_ticks
        if period <= 4 * len(k):
            return self._codes_of(self._whole_period(period))[advance]
        advances, which = np.unique(advance, return_inverse=True)
        a, b = np.array(self.fourier.a), np.array(self.fourier.b)
        w = np.full(len(advances), self.fourier.a0)
        rows = max(_CHUNK_PRODUCTS // len(a), 1)
        for first in range(0, len(advances), rows):
            angle = self._angles(advances[first : first + rows], period)
            w[first : first + rows] += np.cos(angle) @ a + np.sin(angle) @ b
        return self._codes_of(w)[which.reshape(-1)]

    def _whole_period(self, period: int) -> Floats:
        """Compute w of every advance: each angle is the sum of one of a few far apart and one of a few that follow."""
        step = isqrt(period) + 1
        a, b = np.array(self.fourier.a), np.array(self.fourier.b)
        far, near = self._angles(np.arange(0, period, step), period), self._angles(np.arange(step), period)
        cosine, sine = np.cos(near), np.sin(near)
        w = np.cos(far) @ (a * cosine + b * sine).T + np.sin(far) @ (b * cosine - a * sine).T
        whole: Floats = self.fourier.a0 + w.reshape(-1)[:period]
        return whole

    def _angles(self, advances: Ints, period: int) -> Floats:
        """Return the phases of all harmonics at some advances in rad, shape (advances, harmonics)."""
        n = np.arange(1, self.fourier.harmonics + 1, dtype=np.int64)
        phases: Floats = (np.outer(advances, n) % period).astype(np.float64)
        return 2.0 * np.pi / period * phases

    def _codes_of(self, w: Floats) -> Floats:
        volts = self.drive.v_offset + self.drive.v_amplitude * (w - 0.5)
        codes: Floats = (volts - self.output.v_zero) / self.output.v_per_code
        return codes


class ManifestSequence(Struct):
    """The schedule of the scan."""

    update_rate_hz: tuple[Annotated[int, Meta(ge=1)], Annotated[int, Meta(ge=1)]]
    line_ticks: Annotated[int, Meta(ge=1, le=MAXIMUM_LINE_TICKS)]
    frame_lines: Annotated[int, Meta(ge=1, le=1 << 16)]
    pixels: Annotated[int, Meta(ge=1, le=1 << 16)]
    settle_lines: Annotated[int, Meta(ge=0, le=255)]
    turn_tick: Natural
    turn_line: Natural
    forward_ticks: Pair
    backward_ticks: Pair
    up_lines: Pair
    down_lines: Pair
    pixel_table: tuple[list[PixelTicks], list[PixelTicks]] | None = None

    @property
    def schedule(self) -> Schedule:
        """The schedule as the model has it."""
        return Schedule(
            ticks=self.line_ticks,
            lines=self.frame_lines,
            update_rate_hz=Fraction(*self.update_rate_hz),
            requested_hz=float(Fraction(*self.update_rate_hz) / self.line_ticks),
            pixels=self.pixels,
            settle_lines=self.settle_lines,
            turn_tick=self.turn_tick,
            forward=Window(*self.forward_ticks),
            backward=Window(*self.backward_ticks),
            turn_line=self.turn_line,
            up=Window(*self.up_lines),
            down=Window(*self.down_lines),
            pixel_table=None if self.pixel_table is None else (tuple(self.pixel_table[0]), tuple(self.pixel_table[1])),
        )


class ManifestAxes(Struct, forbid_unknown_fields=True):
    """Both axes; no device plays a third one."""

    x: ManifestAxis
    y: ManifestAxis


class Manifest(Struct):
    """The part of a manifest that is read; keys that were added since are ignored."""

    tablegen: Version
    hash: Digest
    name: FileName
    files: dict[BuildFileName, Digest]
    sequence: ManifestSequence
    axes: ManifestAxes
    formats: list[Annotated[str, Meta(min_length=1, max_length=64)]] = []
    clocks_per_tick: Annotated[int, Meta(ge=0, lt=1 << 31)] = 0
