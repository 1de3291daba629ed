"""A build read back from its ``manifest.json``: the programs that the model plays, and the floats they came from.

The writer of manifests reads with it too, so that nothing reaches a disk that is refused afterwards.
"""

from functools import cached_property
from hashlib import sha256
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import msgspec
from msgspec import Struct

from tablegen.base.input_errors import shortened
from tablegen.base.reading import MANIFEST as MANIFEST_KIND
from tablegen.base.reading import other_than_file, other_than_folder, read_bytes
from tablegen.config.names import why_not_a_name
from tablegen.config.schema import (
    DEFAULT_FORMATS,
    MAXIMUM_SPLINE_BITS,
    MAXIMUM_SPLINE_LENGTH,
    TILT_NAMES,
    TiltName,
)
from tablegen.device.dual_program import DualProgram, ScanProgram
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.output import GAIN_BITS, UNIT_GAIN_BITS
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.rounding import signed_limits
from tablegen.manifest.fields import LEAST_V_PER_CODE, Manifest, ManifestAxis, ManifestSequence
from tablegen.manifest.format import MANIFEST, RECORD, content_hash, read_json

if TYPE_CHECKING:
    from tablegen.manifest.frame_fields import StraightTilt


class NotABuild(Exception):
    """A directory without a manifest, or with one that is not ours or cannot be played; the message has the reason."""


class DamagedManifest(ValueError):
    """A manifest that is damaged, or cannot be played; ``reasons`` has each reason."""

    def __init__(self, reasons: list[str]) -> None:
        self.reasons = [shortened(why) for why in reasons]
        super().__init__("; ".join(self.reasons))


class ForeignManifest(ValueError):
    """A manifest of another program."""


class AngleManifest(ForeignManifest):
    """A manifest of a scan at an angle, which ``tablegen.manifest.turned`` reads."""


class StoredBuild(Struct, frozen=True, eq=False, dict=True):
    """A build as its manifest has it; ``plain`` is the manifest as JSON.

    ``z`` and ``aux`` are the outputs beside x and y, and ``program_of_z`` is what a second sequencer plays of them.
    """

    manifest: Manifest
    program: DualProgram
    plain: dict[str, Any]
    z: "StraightTilt | None" = None
    aux: "StraightTilt | None" = None
    program_of_z: ScanProgram | None = None

    def __repr__(self) -> str:
        schedule, name = self.program.schedule, self.manifest.name
        rate = f"{float(schedule.line_rate):.6g} Hz lines of {schedule.ticks} ticks, {schedule.lines} a frame"
        return f"<tablegen build {name!r}: {rate}\n  formats {', '.join(self.formats)}\n  plan {self.manifest.hash}>"

    @cached_property
    def own_hash(self) -> str:
        """The hash of the plan, computed again from the manifest."""
        return _hash(self.plain)

    @property
    def axes(self) -> tuple[tuple[Literal["x", "y"], ManifestAxis], ...]:
        """Both axes with their names, the fast one first."""
        return ("x", self.manifest.axes.x), ("y", self.manifest.axes.y)

    @property
    def tilts(self) -> "dict[TiltName, StraightTilt]":
        """The outputs beside both axes, by their names."""
        return {name: tilt for name in TILT_NAMES if (tilt := getattr(self, name)) is not None}

    @property
    def formats(self) -> tuple[str, ...]:
        """The names of its formats."""
        return tuple(self.manifest.formats or DEFAULT_FORMATS)

    def runtime(self, *suffixes: str) -> list[str]:
        """List the files of the build that are parts of a sequencer, by the ends of their names."""
        return sorted(name for name in self.manifest.files if name.startswith("dac_") and name.endswith(suffixes))


def read_build(folder: str | Path) -> StoredBuild:
    """Read a build back from the manifest in its directory.

    Parameters
    ----------
    folder : str or Path
        Directory that ``build`` wrote.

    Returns
    -------
    StoredBuild
        The program that a device plays, and what the manifest says of it.

    Raises
    ------
    NotABuild
        The manifest is missing, damaged, or cannot be played.

    Examples
    --------
    >>> _ = tablegen.build("scan.toml", "build")
    >>> tablegen.read_build("build").program.x.ticks
    1250
    """
    path = Path(folder) / MANIFEST
    try:
        content = read_bytes(path, MANIFEST_KIND)
    except OSError as error:
        if isinstance(error, FileNotFoundError) and (example := _a_program(path.parent)) is not None:
            raise NotABuild(
                f"{folder}: is a library of `tablegen sweep`, not a build; name one of its programs, for example "
                f"{example}"
            ) from None
        raise NotABuild(
            f"{path}: cannot be read: {error.strerror or error}; the directory is the one of `tablegen build -o DIR`"
        ) from None
    try:
        stored = parse_manifest(content)
    except AngleManifest:
        raise NotABuild(
            f"{path}: is of a scan at an angle; of the commands that read a build `tablegen verify`, `upload` and "
            "`readback` take it"
        ) from None
    except ForeignManifest:
        raise NotABuild(f"{path}: is not a manifest of tablegen") from None
    except DamagedManifest as damage:
        raise NotABuild("\n".join(f"{path}: is damaged: {why}; build it again" for why in damage.reasons)) from None
    for name in stored.manifest.files:  # simulators and compilers open them too, and would wait for a pipe
        if misplaced := other_than_folder(path.parent, name):
            raise NotABuild(f"{misplaced[0]}: is {misplaced[1]}, where a directory of the build has to be")
        if other := other_than_file(path.parent / name):
            raise NotABuild(f"{path.parent / name}: is {other}, where a file of the build has to be")
    return stored


def parse_manifest(content: bytes) -> StoredBuild:
    """Read a build from the content of its manifest, without looking at its files.

    Raises
    ------
    ForeignManifest
        The content is JSON, and no manifest of tablegen.
    DamagedManifest
        The content is no JSON, or no device can play it.
    """
    try:
        plain: Any = read_json(content)
    except ValueError as error:
        raise DamagedManifest([str(error)]) from None
    if isinstance(plain, dict) and "turned" in plain:
        raise AngleManifest
    if not isinstance(plain, dict) or not {"tablegen", "hash", "axes"} <= plain.keys():
        raise ForeignManifest
    try:
        manifest = msgspec.convert(plain, Manifest)
        program = DualProgram(manifest.axes.x.program, manifest.axes.y.program, manifest.sequence.schedule)
        tilts, program_of_z = _stored_tilts(plain, manifest)
    except (msgspec.ValidationError, ValueError, OverflowError, RecursionError) as error:
        raise DamagedManifest([str(error)]) from None
    if wrong := [*_wrong_names(manifest), *_wrong_schedule(manifest.sequence), *_wrong_axes(manifest)]:
        raise DamagedManifest(wrong)
    return StoredBuild(manifest, program, plain, **tilts, program_of_z=program_of_z)


def _stored_tilts(
    plain: dict[str, Any], manifest: Manifest
) -> "tuple[dict[TiltName, StraightTilt], ScanProgram | None]":
    """Return the outputs beside x and y of a manifest, and the program of their sequencer.

    Raises
    ------
    ValueError, OverflowError
        If no device plays it.
    """
    written = [name for name in TILT_NAMES if name in plain]
    if not written:
        return {}, None
    from tablegen.manifest.frame_fields import StraightTilt, beside_of  # here: most scans have no z

    tilts = {name: msgspec.convert(plain[name], StraightTilt) for name in written}
    for name, tilt in tilts.items():
        if not _finite(tilt):
            raise ValueError(f"{name} holds a number that is not finite")
    return tilts, beside_of(tilts, manifest.formats, manifest.sequence)


def _a_program(folder: Path) -> Path | None:
    """Find the first program of a library in a folder; None if the folder holds none."""
    try:
        return min((path for path in folder.iterdir() if (path / RECORD).is_file()), default=None)
    except OSError:
        return None


_BESIDE_THE_PLAN = ("tablegen", "hash", "formats", "clocks_per_tick", "files")


def _wrong_names(manifest: Manifest) -> list[str]:
    why = why_not_a_name(manifest.name)
    return [] if why is None else [f"name: {why}"]


def _hash(plain: dict[str, Any]) -> str:
    """Compute the hash of the plan: of everything that decides what is played."""
    record = {key: value for key, value in plain.items() if key not in _BESIDE_THE_PLAN}
    record["axes"] = {axis: _without_certificate(content) for axis, content in plain["axes"].items()}
    record |= {name: _without_certificate(plain[name]) for name in TILT_NAMES if name in plain}
    try:
        return content_hash(record)
    except (ValueError, RecursionError):  # infinity or a depth that no build writes
        return sha256(b"").hexdigest()


def _without_certificate(content: Any) -> Any:
    if not isinstance(content, dict):
        return content
    return {key: value for key, value in content.items() if key != "certificate"}


def _wrong_schedule(sequence: ManifestSequence) -> list[str]:
    """List why no device could play this schedule."""
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
    """Return True if all floats below a value are finite: JSON as Python reads it knows NaN."""
    if isinstance(value, Struct):
        return all(_finite(getattr(value, name)) for name in value.__struct_fields__)
    if isinstance(value, dict):
        return all(map(_finite, value.values()))
    if isinstance(value, list | tuple):
        kind = type(value[0]) if value else int  # the types of fields have arrays of one kind of number only
        return kind is int or all(map(isfinite if kind is float else _finite, value))
    return not isinstance(value, float) or isfinite(value)


def _wrong_axes(manifest: Manifest) -> list[str]:
    """List why no device could play these axes."""
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
        phase = RationalPhase(max(period, 1))
        for right, why in (
            (axis.line.ticks == ticks, f"line.ticks is {axis.line.ticks}, the schedule has {ticks}"),
            (axis.line.hold_ticks in holds, f"line.hold_ticks is {axis.line.hold_ticks}"),
            (axis.line.phase_step == phase.step, f"line.phase_step is {axis.line.phase_step}, not {phase.step}"),
            (axis.line.phase_remainder == phase.remainder, "line.phase_remainder does not belong to the period"),
            (
                words == period if table.mode == "direct" else words & (words - 1) == 0 and words >= 4,
                f"table.words are {words}, for a {table.mode} table of {period} advances",
            ),
            (
                table.mode != "cubic" or table.bits <= MAXIMUM_SPLINE_BITS,
                f"table.bits is {table.bits}, for a cubic table of up to {MAXIMUM_SPLINE_BITS}",
            ),
            (
                table.mode != "cubic" or words <= MAXIMUM_SPLINE_LENGTH,
                f"table.words are {words}, for a cubic table of up to {MAXIMUM_SPLINE_LENGTH}",
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
                {len(coefficients) for coefficients in (fourier.a, fourier.b, fourier.a_words, fourier.b_words)}
                == {fourier.harmonics},
                f"fourier has not {fourier.harmonics} harmonics",
            ),
        ):
            if not right:
                wrong.append(f"axes.{name}.{why}")
    channels = (manifest.axes.x.output.channel, manifest.axes.y.output.channel)
    if channels not in (("", ""), ("A", "B"), ("B", "A")):
        wrong.append(f"axes.x and axes.y are on outputs {channels[0]!r} and {channels[1]!r}")
    if manifest.axes.x.output.dac_bits != manifest.axes.y.output.dac_bits:
        wrong.append("axes.x and axes.y differ in output.dac_bits")
    return wrong
