"""A build read back from its ``manifest.json``: the programs that the model plays, and the floats they came from."""

from dataclasses import dataclass
from fractions import Fraction
from hashlib import sha256
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta, Struct

from tablegen.config.names import why_not_a_name
from tablegen.config.schema import DEFAULT_FORMATS
from tablegen.device.dual_program import DualProgram
from tablegen.device.schedule import MAXIMUM_LINE_TICKS, Schedule, Window
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.output import GAIN_BITS, UNIT_GAIN_BITS, Output
from tablegen.fixedpoint.phase import MAXIMUM_TICKS, RationalPhase
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.rounding import signed_limits
from tablegen.manifest.format import MANIFEST, content_hash, read_json
from tablegen.numerics.arrays import Floats, Ints
from tablegen.problems import shortened
from tablegen.reading import MANIFEST as MANIFEST_KIND
from tablegen.reading import other_than_file, read_bytes

_CHUNK_PRODUCTS = 1 << 22  # products of harmonics and ticks that are worked out at a time


class NotABuild(Exception):
    """The directory holds no manifest, or one that is none of ours or cannot be played; says which and why."""


Natural = Annotated[int, Meta(ge=0, le=MAXIMUM_TICKS)]
Positive = Annotated[int, Meta(ge=1, le=MAXIMUM_TICKS)]
Code = Annotated[int, Meta(ge=0, lt=1 << 24)]
Word = Annotated[int, Meta(ge=-(1 << 31), lt=1 << 31)]
Bits = Annotated[int, Meta(ge=8, le=24)]
Pair = tuple[Natural, Natural]
Digest = Annotated[str, Meta(pattern="^[0-9a-f]{64}$")]
# Never outside the directory.
FileName = Annotated[str, Meta(max_length=200, pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]*\Z")]
Version = Annotated[str, Meta(max_length=64, pattern=r"^[A-Za-z0-9][A-Za-z0-9.+!-]*\Z")]
Number = Annotated[int, Meta(ge=-(1 << 43), lt=1 << 43)]
Volts = Annotated[float, Meta(ge=-1e9, le=1e9)]
Coefficient = Annotated[float, Meta(ge=-1e3, le=1e3)]  # of a waveform from 0 to 1
LEAST_V_PER_CODE = 1e-15  # a range of 1 mV in 24 bits, behind an amplifier of 1e-4, is 6e-15 V


class ManifestBranch(Struct):
    """Hysteresis of one branch: the peak of its residual, and where that is."""

    beta: float
    u_peak: float


class ManifestResonance(Struct):
    """Where the response is largest, and half its width there."""

    hz: float
    half_width_hz: float


class ManifestDrive(Struct):
    """Volts at the piezo, and the shape that they follow."""

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
    """w(t) in float64, its words, and what the piezo is to follow where dynamics or a layer make that another one."""

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


class ManifestTable(Struct):
    """The words that are played."""

    mode: Literal["interpolated", "direct"]
    bits: Bits
    guard_bits: Number
    scale: Annotated[float, Meta(gt=0.0, le=1e9)]
    words: Annotated[list[Annotated[int, Meta(ge=-(1 << 23), lt=1 << 23)]], Meta(min_length=1, max_length=1 << 20)]


class ManifestOutput(Struct):
    """The output stage, and volts of its codes."""

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


class ManifestCertificate(Struct):
    """What the build promised of an axis."""

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


class ManifestAxis(Struct):
    """One axis of a manifest."""

    drive: ManifestDrive
    line: ManifestLine
    fourier: ManifestFourier
    table: ManifestTable
    output: ManifestOutput
    certificate: ManifestCertificate

    @property
    def fourier_words(self) -> Ints:
        """In the order in which devices hold them."""
        fourier = self.fourier
        return np.array([fourier.a0_word, *fourier.a_words, *fourier.b_words], dtype=np.int64)

    @property
    def program(self) -> Program:
        """What the device plays."""
        output = self.output
        return Program(
            RationalPhase(self.line.ticks // self.line.hold_ticks),
            self.line.hold_ticks,
            self.table.mode,
            self.table.bits,
            np.array(self.table.words, dtype=np.int64),
            Output(
                gain_word=output.gain_word,
                gain_q=output.gain_q,
                offset_word=output.offset_word,
                code_min=output.code_min,
                code_max=output.code_max,
                max_step=output.max_step,
                park_code=output.park_code,
                dac_bits=output.dac_bits,
                coding=output.coding,
                align=output.align,
                word_bits=output.word_bits,
            ),
        )

    def asked(self, k: Ints) -> Floats:
        """The codes, unrounded, that the float waveform asks for at ticks k in [0, ticks) of the period.

        V = v_offset + v_amplitude (w - 1/2), code = (V - v_zero) / v_per_code. Evaluated term by term with exact
        phases, in none of the ways in which the build does it.
        """
        advances, which = np.unique(k // self.line.hold_ticks, return_inverse=True)
        period = self.line.ticks // self.line.hold_ticks
        n = np.arange(1, self.fourier.harmonics + 1, dtype=np.int64)
        a, b = np.array(self.fourier.a), np.array(self.fourier.b)
        w = np.full(len(advances), self.fourier.a0)
        if period <= 4 * len(advances):  # a cosine of every phase costs less than one of every product
            angle = 2.0 * np.pi / period * np.arange(period)
            cosines, sines = np.cos(angle), np.sin(angle)
            for harmonic in range(len(n)):
                phase = advances * n[harmonic] % period
                w += a[harmonic] * cosines[phase] + b[harmonic] * sines[phase]
            advances = advances[:0]
        rows = max(_CHUNK_PRODUCTS // len(n), 1)
        for first in range(0, len(advances), rows):
            angle = 2.0 * np.pi / period * (np.outer(advances[first : first + rows], n) % period)
            w[first : first + rows] += np.cos(angle) @ a + np.sin(angle) @ b
        volts = self.drive.v_offset + self.drive.v_amplitude * (w - 0.5)
        codes: Floats = (volts - self.output.v_zero) / self.output.v_per_code
        return codes[which.reshape(-1)]


class ManifestSequence(Struct):
    """The schedule."""

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

    @property
    def schedule(self) -> Schedule:
        """As the model has it."""
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
        )


class ManifestAxes(Struct):
    """Both axes."""

    x: ManifestAxis
    y: ManifestAxis


class Manifest(Struct):
    """What is read of a manifest; keys that were added since are passed over."""

    tablegen: Version
    hash: Digest
    name: FileName
    files: dict[FileName, Digest]
    sequence: ManifestSequence
    axes: ManifestAxes
    formats: list[Annotated[str, Meta(min_length=1, max_length=64)]] = []


@dataclass(frozen=True, eq=False, repr=False)
class StoredBuild:
    """A build as its manifest has it."""

    manifest: Manifest
    program: DualProgram
    own_hash: str  # the hash worked out again from what the manifest says

    def __repr__(self) -> str:
        schedule, name = self.program.schedule, self.manifest.name
        rate = f"{float(schedule.line_rate):.6g} Hz lines of {schedule.ticks} ticks, {schedule.lines} a frame"
        return f"<tablegen build {name!r}: {rate}\n  formats {', '.join(self.formats)}\n  plan {self.manifest.hash}>"

    @property
    def axes(self) -> tuple[tuple[Literal["x", "y"], ManifestAxis], ...]:
        """Both axes with their names, the fast one first."""
        return ("x", self.manifest.axes.x), ("y", self.manifest.axes.y)

    @property
    def formats(self) -> tuple[str, ...]:
        """The names of its formats."""
        return tuple(self.manifest.formats or DEFAULT_FORMATS)

    def runtime(self, *suffixes: str) -> list[str]:
        """The files of the build that are parts of a sequencer, by the ends of their names."""
        return sorted(name for name in self.manifest.files if name.startswith("dac_") and name.endswith(suffixes))


def read_build(folder: str | Path) -> StoredBuild:
    """The build in a directory. Raises ``NotABuild`` for a manifest that is missing, damaged or cannot be played."""
    path = Path(folder) / MANIFEST
    try:
        content = read_bytes(path, MANIFEST_KIND)
    except OSError as error:
        raise NotABuild(
            f"{path}: cannot be read: {error.strerror or error}; the directory is the one of `tablegen build -o DIR`"
        ) from None
    try:
        plain: Any = read_json(content)
    except ValueError as error:
        raise NotABuild(f"{path}: is damaged: {shortened(str(error))}; build it again") from None
    if not isinstance(plain, dict) or not {"tablegen", "hash", "axes"} <= plain.keys():
        raise NotABuild(f"{path}: is not a manifest of tablegen")
    try:
        manifest = msgspec.convert(plain, Manifest)
        program = DualProgram(manifest.axes.x.program, manifest.axes.y.program, manifest.sequence.schedule)
    except (msgspec.ValidationError, ValueError, RecursionError) as error:
        raise NotABuild(f"{path}: is damaged: {shortened(str(error))}; build it again") from None
    if wrong := [*_wrong_names(manifest), *_wrong_schedule(manifest.sequence), *_wrong_axes(manifest)]:
        raise NotABuild("\n".join(f"{path}: is damaged: {why}; build it again" for why in wrong))
    for name in manifest.files:  # simulators and compilers open them too, and would wait for a pipe
        if other := other_than_file(path.parent / name):
            raise NotABuild(f"{path.parent / name}: is {other}, where a file of the build has to be")
    return StoredBuild(manifest, program, _hash(plain))


def _wrong_names(manifest: Manifest) -> list[str]:
    why = why_not_a_name(manifest.name)
    return [] if why is None else [f"name: {why}"]


def _hash(plain: dict[str, Any]) -> str:
    """The hash of the plan: of everything but version, hash, files and certificates."""
    record = {key: value for key, value in plain.items() if key not in ("tablegen", "hash", "formats", "files")}
    record["axes"] = {
        axis: {key: value for key, value in content.items() if key != "certificate"}
        if isinstance(content, dict)
        else content
        for axis, content in plain["axes"].items()
    }
    try:
        return content_hash(record)
    except (ValueError, RecursionError):  # infinity or a depth that no build writes
        return sha256(b"").hexdigest()


def _wrong_schedule(sequence: ManifestSequence) -> list[str]:
    """Why no device could play this schedule."""
    wrong = []
    for key, (first, count), whole in (
        ("forward_ticks", sequence.forward_ticks, sequence.line_ticks),
        ("backward_ticks", sequence.backward_ticks, sequence.line_ticks),
        ("up_lines", sequence.up_lines, sequence.frame_lines),
        ("down_lines", sequence.down_lines, sequence.frame_lines),
    ):
        if first + count > whole:
            wrong.append(f"sequence.{key} ends at {first + count}, beyond {whole}")
    return wrong


def _finite(value: Any) -> bool:
    """Whether all floats below a value are finite: JSON as Python reads it knows NaN."""
    if isinstance(value, Struct):
        return all(_finite(getattr(value, name)) for name in value.__struct_fields__)
    if isinstance(value, dict):
        return all(map(_finite, value.values()))
    if isinstance(value, list | tuple):
        return all(map(_finite, value))
    return not isinstance(value, float) or isfinite(value)


def _wrong_axes(manifest: Manifest) -> list[str]:
    """Why no device could play these axes."""
    wrong = []
    line = manifest.sequence.line_ticks
    for name, axis, ticks, holds in (
        ("x", manifest.axes.x, line, (1,)),
        ("y", manifest.axes.y, line * manifest.sequence.frame_lines, (1, line)),
    ):
        table, output, fourier = axis.table, axis.output, axis.fourier
        words, (low, high) = len(table.words), signed_limits(table.bits)
        period = ticks // axis.line.hold_ticks
        gain_low, gain_high = signed_limits(GAIN_BITS)
        interpolated = table.mode == "interpolated"
        phase = RationalPhase(max(period, 1))
        for right, why in (
            (axis.line.ticks == ticks, f"line.ticks is {axis.line.ticks}, the schedule has {ticks}"),
            (axis.line.hold_ticks in holds, f"line.hold_ticks is {axis.line.hold_ticks}"),
            (axis.line.phase_step == phase.step, f"line.phase_step is {axis.line.phase_step}, not {phase.step}"),
            (axis.line.phase_remainder == phase.remainder, "line.phase_remainder does not belong to the period"),
            (
                words & (words - 1) == 0 and words >= 4 if interpolated else words == period,
                f"table.words are {words}, for a {table.mode} table of {period} advances",
            ),
            (all(low <= word <= high for word in table.words), f"table.words do not fit {table.bits} bits"),
            (table.guard_bits == guard_bits(table.bits), f"table.guard_bits is {table.guard_bits}"),
            (gain_low <= output.gain_word <= gain_high, f"output.gain_word is {output.gain_word}"),
            (
                output.gain_q == UNIT_GAIN_BITS + table.bits + guard_bits(table.bits) - output.dac_bits,
                f"output.gain_q is {output.gain_q}",
            ),
            (
                output.code_min <= output.park_code <= output.code_max < 1 << output.dac_bits,
                "output.code_min, park_code, code_max are not in order within the converter",
            ),
            (abs(output.v_per_code) >= LEAST_V_PER_CODE, f"output.v_per_code is {output.v_per_code:g}"),
            (_finite(axis), "holds a number that is not finite"),
            (
                {len(found) for found in (fourier.a, fourier.b, fourier.a_words, fourier.b_words)}
                == {fourier.harmonics},
                f"fourier has not {fourier.harmonics} harmonics",
            ),
        ):
            if not right:
                wrong.append(f"axes.{name}.{why}")
    if manifest.axes.x.output.dac_bits != manifest.axes.y.output.dac_bits:
        wrong.append("axes.x and axes.y differ in output.dac_bits")
    return wrong
