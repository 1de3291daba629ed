"""The image of a scan for an upload, and the check, before anything is sent, that a device would accept it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import AxisProgram, ScanProgram
from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.interpolation import index_bits_of
from tablegen.fixedpoint.output import Output
from tablegen.link.acceptance import first_objection
from tablegen.link.errors import Unsuitable
from tablegen.link.messages import SPLINE_DEGREE, AxisShape, DeviceInfo, Feature, More
from tablegen.link.program_image import (
    FOURIER_BYTES,
    PROGRAM_BYTES,
    ProgramImage,
    fast_of,
    join,
    make_image,
    shape_of,
    take_apart,
)
from tablegen.link.refusal_reasons import Limits, about_z, explain, lacks_mode, lacks_z
from tablegen.manifest.format import content_hash
from tablegen.manifest.read import NotABuild, read_build
from tablegen.manifest.record import plan_record
from tablegen.manifest.turned import StoredTurned, is_turned, read_turned
from tablegen.manifest.turned_record import turned_record
from tablegen.numerics.arrays import Ints
from tablegen.planning.line_plan import Plan
from tablegen.planning.turned_plan import TurnedPlan

Form = Literal["auto", "table", "fourier"]
TWOS_COMPLEMENT, LEFT_ALIGNED = 64, 128  # bits of AxisShape.converter
_RATE_TOLERANCE_HZ = 1.0  # a device states its rate to the nearest integer


@dataclass(frozen=True, eq=False)
class PreparedScan:
    """A scan that can be uploaded: a program, the hash of its plan, and the Fourier words of both axes.

    These are int64 of shape (2 H + 1,), in the order of devices; None of a scan at an angle, whose tables they do not
    make. ``program_of_z`` is that of the second sequencer, whose x is z; None without z.
    """

    name: str
    digest: str
    program: ScanProgram
    x_fourier: Ints | None
    y_fourier: Ints | None
    program_of_z: ScanProgram | None = None

    @classmethod
    def of_plan(cls, plan: Plan) -> "PreparedScan":
        """Prepare the scan of a plan."""
        digest = content_hash(plan_record(plan))
        words = plan.x.fourier.in_order, plan.y.fourier.in_order
        return cls(plan.name, digest, plan.program, *words, plan.program_of_z)

    @classmethod
    def of_turned(cls, plan: TurnedPlan) -> "PreparedScan":
        """Prepare the scan of a plan at an angle."""
        return cls(plan.name, content_hash(turned_record(plan)), plan.program, None, None, plan.program_of_z)

    @classmethod
    def of_build(cls, folder: Path) -> "PreparedScan":
        """Prepare the scan that ``tablegen build`` wrote into a folder.

        Raises
        ------
        NotABuild
            If the folder holds none, or its manifest was changed.
        """
        stored = read_turned(folder) if is_turned(folder) else read_build(folder)
        manifest = stored.manifest
        if stored.own_hash != manifest.hash:
            raise NotABuild(f"{folder}: its manifest was changed after the build; build it again")
        if isinstance(stored, StoredTurned):
            return cls(manifest.name, manifest.hash, stored.program, None, None, stored.z)
        axes = stored.manifest.axes
        words = axes.x.fourier_words, axes.y.fourier_words
        return cls(manifest.name, manifest.hash, stored.program, *words, stored.program_of_z)

    @property
    def axes(self) -> tuple[tuple[str, AxisProgram, Ints | None], tuple[str, AxisProgram, Ints | None]]:
        """The name, the program and the Fourier words of each axis, x first.

        Returns
        -------
        tuple of tuple
            The words are Q2.30 of shape (2 H + 1,), or None.
        """
        return ("x", self.program.x, self.x_fourier), ("y", self.program.y, self.y_fourier)

    def image(self, form: Form = "auto", info: DeviceInfo | None = None) -> ProgramImage:
        """Make the image to upload: as tables, as Fourier words, or for each axis what is smaller and the device takes.

        Raises
        ------
        Unsuitable
            If an axis has no Fourier words that would render its table.
        """
        if form == "fourier" and (
            why := [why for name, axis, words in self.axes for why in _unrendered(name, axis, words)]
        ):
            raise Unsuitable(why)
        fourier = [
            words if form == "fourier" or (form == "auto" and _rendered(axis, words, info)) else None
            for _, axis, words in self.axes
        ]
        try:
            return self._with_z(make_image(self.program, self.digest, fourier[0], fourier[1]))
        except ValueError as error:
            raise Unsuitable([str(error)]) from None

    def like(self, image: bytes) -> ProgramImage:
        """Make the image that a device which plays this scan should hold, each axis in the form that this one has."""
        x, y = harmonics_of(image)
        first = make_image(self.program, self.digest, self.x_fourier if x else None, self.y_fourier if y else None)
        return self._with_z(first)

    def _with_z(self, image: ProgramImage) -> ProgramImage:
        """Add the image of z, if there is one."""
        return image if self.program_of_z is None else join(image, make_image(self.program_of_z, self.digest))


def harmonics_of(image: bytes) -> tuple[int, int]:
    """Return the harmonics of x and y; 0 where a table follows, or the image is too short to tell."""
    words = np.frombuffer(image.ljust(PROGRAM_BYTES, b"\0"), dtype="<u4", count=PROGRAM_BYTES // 4)
    x, y = (int(words[page * PAGE_WORDS + AXIS_WORDS.index("harmonics")]) for page in (1, 2))
    return x, y


def _unrendered(name: str, axis: AxisProgram, words: Ints | None) -> list[str]:
    """Return why the table of an axis cannot be sent as Fourier words; empty if it can."""
    if words is None:
        return [f"{name}: a table with a slow part is not sent as Fourier words; use --as table"]
    if fast_of(axis).mode == "direct":
        return [f"{name}: a direct table cannot be computed from Fourier words; use --as table"]
    return []


def _rendered(axis: AxisProgram, words: Ints | None, info: DeviceInfo | None) -> bool:
    """Return True if Fourier words are the smaller form of an axis that the device takes."""
    if words is None or isinstance(axis, FrameProgram) or axis.mode == "direct":
        return False
    if info is not None:
        if not info.features & Feature.FOURIER or len(words) // 2 > info.harmonics:
            return False
        if not info.features & Feature.TABLES:
            return True
    return FOURIER_BYTES * len(words) < shape_of(axis).word_bytes * len(axis.words)


def check(
    scan: PreparedScan,
    image: ProgramImage,
    info: DeviceInfo,
    limits: Limits,
    any_rate: bool = False,
    swap: CommitMode = CommitMode.LINE,
) -> None:
    """Check that a device with these active limits would accept the image, as far as can be known without it.

    Parameters
    ----------
    any_rate
        True to accept another update rate than the device has.
    swap
        Where in a running scan the new one is swapped in.

    Raises
    ------
    Unsuitable
        If it would not, with every objection.
    """
    second = image.second
    objections = [*_of_sequencer(scan, image.first, info, limits)]
    objections += [] if any_rate else _rate(scan, info)
    if why := lacks_mode(info, swap):
        objections.append(why)
    if second is not None and scan.program_of_z is not None:
        beside = PreparedScan(scan.name, scan.digest, scan.program_of_z, None, None)
        objections += _of_z(beside, second, info)
    if objections:
        raise Unsuitable(objections)


def _of_z(scan: PreparedScan, image: ProgramImage, info: DeviceInfo) -> list[str]:
    """Return why the second sequencer of a device does not play the program of z."""
    if why := lacks_z(info):
        return [why]
    info = info.of_z
    if More.SLOW_PARTS not in info.more:
        return ["z has a slow part, for which the device has no memory: set slow_knots in the configuration of its z"]
    return [about_z(why) for why in _of_sequencer(scan, image, info, (info.x_limits, info.y_limits))]


def _of_sequencer(scan: PreparedScan, image: ProgramImage, info: DeviceInfo, limits: Limits) -> list[str]:
    """Return why a sequencer of a device does not play a program."""
    objections = [*_device(image, info, scan), *_slow_parts(scan, info), *_pixel_table(scan, info)]
    for (name, axis, _), shape, theirs in zip(scan.axes, (image.info.x, image.info.y), (info.x, info.y), strict=True):
        objections += [f"{name}: {why}" for why in _axis(axis, shape, theirs)]
    contents = take_apart(image.data, image.info.x, image.info.y)
    if objection := first_objection(contents, *limits, None, info.shaping):
        objections.append(explain(*objection, info, contents, limits))
    return objections


def _device(image: ProgramImage, info: DeviceInfo, scan: PreparedScan) -> list[str]:
    reasons = []
    harmonics = harmonics_of(image.data)
    if any(harmonics) and not info.features & Feature.FOURIER:
        reasons.append("the device does not support Fourier words; upload --as table")
    elif max(harmonics) > info.harmonics:
        reasons.append(
            f"{max(harmonics)} harmonics; the device supports at most {info.harmonics}: lower band_limit.harmonics, or "
            "upload --as table"
        )
    if not all(harmonics) and not info.features & Feature.TABLES:
        reasons.append("the device does not support tables; upload --as fourier")
    if len(image.data) > info.image_bytes:
        reasons.append(
            f"{len(image.data)} bytes; the device accepts {info.image_bytes}: upload --as fourier, or make the tables "
            "shorter"
        )
    if info.degree < SPLINE_DEGREE:
        reasons += [
            f"{name}: a cubic table; the device plays none: build it with DAC_SPLINE=1 in C, "
            f"{name.upper()}_INTERPOLATED=3 in Verilog, or set table.mode"
            for name, axis, _ in scan.axes
            if fast_of(axis).mode == "cubic"
        ]
    return reasons


def _slow_parts(scan: PreparedScan, info: DeviceInfo) -> list[str]:
    """Return why a device does not play the slow parts of a scan; empty if there are none, or it does."""
    axes = [(name, axis) for name, axis, _ in scan.axes if isinstance(axis, FrameProgram)]
    if not axes:
        return []
    if More.SLOW_PARTS not in info.more:
        return [
            "the scan is at an angle, on coupled axes or drifts, and the device plays one table for each axis alone: "
            "build its firmware with DAC_SLOW_PART=1 and memory for slow parts (of FPGAs a soft core has them), or set "
            "angle_deg = 0"
        ]
    reasons = []
    for name, axis in axes:
        knots, length = len(axis.gains.words), len(axis.slow.words)
        if knots > info.slow_knots:
            reasons.append(
                f"{name}: {knots} knots; the device has memory for {info.slow_knots}: raise slow_knots in it"
            )
        if index_bits_of(length) > info.slow_index_bits:
            most = 1 << info.slow_index_bits
            reasons.append(
                f"{name}: a slow table of {length} words; the device holds {most}: raise its slow_index_bits"
            )
    return reasons


def _pixel_table(scan: PreparedScan, info: DeviceInfo) -> list[str]:
    """Return why a device does not play the table of pixels of a scan; empty if there is none, or it does."""
    schedule = scan.program.schedule
    if schedule.pixel_table is None:
        return []
    if More.PIXEL_TABLES not in info.more:
        return [
            "the fast axis is a sine, whose pixels have a table, and the device plays none over its link: build its "
            "firmware with DAC_PIXEL_TABLE=1 and memory for a table of pixels, or set motion = 'line'"
        ]
    if schedule.pixels > info.table_pixels:
        return [
            f"a table of {schedule.pixels} pixels; the device has memory for {info.table_pixels}: raise table_pixels "
            "in it"
        ]
    return []


def _rate(scan: PreparedScan, info: DeviceInfo) -> list[str]:
    rate_hz = float(scan.program.schedule.update_rate_hz)
    if not info.update_rate_hz or abs(rate_hz - info.update_rate_hz) <= _RATE_TOLERANCE_HZ:
        return []
    return [
        f"built for {rate_hz:g} ticks a second; the device runs at {info.update_rate_hz}: each line would take "
        f"{rate_hz / info.update_rate_hz:.4g} times as long; set dac.update_rate_hz, or allow it with --any-rate"
    ]


def _axis(axis: AxisProgram, shape: AxisShape, theirs: AxisShape) -> list[str]:
    reasons = []
    length = len(fast_of(axis).words)
    if shape.word_bits != theirs.word_bits:
        reasons.append(f"table words of {shape.word_bits} bits; the device has {theirs.word_bits}: set table.bits")
    if shape.dac_bits != theirs.dac_bits:
        reasons.append(f"codes of {shape.dac_bits} bits; the device has {theirs.dac_bits}: set dac.bits")
    if length > 1 << theirs.index_bits:
        reasons.append(f"a table of {length} words; the device holds {1 << theirs.index_bits}: set table.length")
    ours = _converter(axis.output)
    if theirs.converter and ours != _converter_of(theirs):
        reasons.append(
            f"converter words {ours}; the device sends {_converter_of(theirs)}: set dac.coding, word_bits and align"
        )
    return reasons


def _converter(output: Output) -> str:
    return _described(output.word_bits, output.dac_bits, output.coding == "twos-complement", output.align == "left")


def _converter_of(shape: AxisShape) -> str:
    bits = shape.converter & (TWOS_COMPLEMENT - 1)
    return _described(
        bits, shape.dac_bits, bool(shape.converter & TWOS_COMPLEMENT), bool(shape.converter & LEFT_ALIGNED)
    )


def _described(word_bits: int, dac_bits: int, twos_complement: bool, left: bool) -> str:
    """Describe the format of a code; one that fills its word is aligned to both sides."""
    side = "" if word_bits == dac_bits else ", left-aligned" if left else ", right-aligned"
    return f"of {word_bits} bits, {'twos-complement' if twos_complement else 'offset-binary'}{side}"
