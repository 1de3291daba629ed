"""A build of a scan at an angle read back from its ``manifest.json``: the program that its integers are."""

from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, Struct

from tablegen.base.reading import MANIFEST as MANIFEST_KIND
from tablegen.base.reading import read_bytes
from tablegen.config.names import why_not_a_name
from tablegen.config.schema import SEQUENCER_FORMATS, TILT_NAMES, SequencerFormat, TiltName
from tablegen.device.dual_program import ScanProgram
from tablegen.manifest.fields import BuildFileName, Digest, FileName, ManifestSequence, Version
from tablegen.manifest.format import MANIFEST, content_hash, read_json
from tablegen.manifest.frame_fields import TiltFields, TiltFigures, TurnedAxisFields, TurnedCodes, beside_of
from tablegen.manifest.read import AngleManifest, DamagedManifest, NotABuild, StoredBuild, parse_manifest


class TurnedAxes(Struct, forbid_unknown_fields=True):
    """Both axes."""

    x: TurnedAxisFields
    y: TurnedAxisFields


class TurnedFields(Struct):
    """What a scan at an angle is; keys that were added since are ignored."""

    angle_deg: float
    size_nm: tuple[float, float]
    coupling: tuple[float, float]
    drift_nm_per_s: tuple[float, float]
    axes: TurnedAxes
    z: TiltFields | None = None
    aux: TiltFields | None = None

    @property
    def tilts(self) -> dict[TiltName, TiltFields]:
        """The outputs beside both axes, by their names."""
        return {name: tilt for name in TILT_NAMES if (tilt := getattr(self, name)) is not None}


class TurnedFigures(Struct):
    """The part of the certificate that follows from the integers alone."""

    codes: dict[Literal["x", "y", "z", "aux"], TurnedCodes]
    z: TiltFigures | None = None
    aux: TiltFigures | None = None


class TurnedManifest(Struct, kw_only=True):
    """The part of a manifest that is read; ``clocks_per_tick`` are those of an FPGA, 0 where they are not known."""

    tablegen: Version
    hash: Digest
    name: FileName
    scanner: str
    files: dict[BuildFileName, Digest]
    sequence: ManifestSequence
    turned: TurnedFields
    formats: Annotated[list[SequencerFormat], Meta(min_length=1, max_length=len(SEQUENCER_FORMATS))] = msgspec.field(
        default_factory=lambda: ["c"]
    )
    clocks_per_tick: Annotated[int, Meta(ge=0, lt=1 << 31)] = 0
    certificate: TurnedFigures


class StoredTurned(Struct, frozen=True, eq=False):
    """A build of a scan at an angle as its manifest has it; ``plain`` is the manifest as JSON.

    ``z`` is what a second sequencer plays, where the scan has the output z; its y is aux.
    """

    manifest: TurnedManifest
    program: ScanProgram
    plain: dict[str, Any]
    z: ScanProgram | None = None

    @property
    def own_hash(self) -> str:
        """The hash of the plan, computed again from the manifest."""
        keys = "name", "scanner", "sequence", "turned"
        return content_hash({key: self.plain[key] for key in keys})

    def certified(self, axis: Literal["x", "y", "z", "aux"]) -> tuple[int, int, int] | None:
        """Return the least and the greatest code, and the largest step, by the certificate; None if it has none."""
        codes = self.manifest.certificate.codes.get(axis)
        return None if codes is None else (codes.least, codes.most, codes.steepest)


def is_turned(folder: Path) -> bool:
    """Return True if a directory holds a build of a scan at an angle."""
    try:
        plain = read_json(read_bytes(folder / MANIFEST, MANIFEST_KIND))
    except (OSError, ValueError):
        return False
    return isinstance(plain, dict) and "turned" in plain


def read_turned(folder: Path) -> StoredTurned:
    """Read a build of a scan at an angle back from the manifest in its directory.

    Raises
    ------
    NotABuild
        The manifest is missing, damaged, or cannot be played.
    """
    path = folder / MANIFEST
    try:
        return parse_turned(read_bytes(path, MANIFEST_KIND))
    except OSError as error:
        raise NotABuild(f"{path}: cannot be read: {error.strerror or error}") from None
    except DamagedManifest as damage:
        raise NotABuild("\n".join(f"{path}: is damaged: {why}; build it again" for why in damage.reasons)) from None


def parse_any(content: bytes) -> StoredBuild | StoredTurned:
    """Read a build, at an angle or not, from the content of its manifest.

    Raises
    ------
    ForeignManifest
        The content is JSON, and no manifest of tablegen.
    DamagedManifest
        The content is no JSON, or no device can play it.
    """
    try:
        return parse_manifest(content)
    except AngleManifest:
        return parse_turned(content)


def parse_turned(content: bytes) -> StoredTurned:
    """Read a build of a scan at an angle from the content of its manifest.

    Raises
    ------
    DamagedManifest
        The content is no JSON, or no device can play it.
    """
    try:
        plain = read_json(content)
        manifest = msgspec.convert(plain, TurnedManifest)
        fields = manifest.turned.axes
        program = ScanProgram(
            fields.x.program(manifest.sequence), fields.y.program(manifest.sequence), manifest.sequence.schedule
        )
        z = beside_of(manifest.turned.tilts, manifest.formats, manifest.sequence)
    except (msgspec.ValidationError, ValueError, OverflowError, RecursionError) as error:
        raise DamagedManifest([str(error)]) from None
    if (why := why_not_a_name(manifest.name)) is not None:
        raise DamagedManifest([f"name: {why}"])
    return StoredTurned(manifest, program, plain, z)
