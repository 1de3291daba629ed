"""The subject of a report: a planned scan, or a build in its directory."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np

from tablegen.base.input_errors import Problem
from tablegen.base.reading import BUILD_FILE, file_sha256, read_bytes
from tablegen.base.reading import MANIFEST as MANIFEST_KIND
from tablegen.certificate.certificate import Certificate
from tablegen.config.load import Setup
from tablegen.config.schema import TILT_NAMES, TiltName
from tablegen.html_report.verify_record import VerifyRecord
from tablegen.manifest.fields import Manifest, ManifestAxis
from tablegen.manifest.format import MANIFEST, read_json
from tablegen.manifest.frame_fields import StraightTilt
from tablegen.manifest.read import read_build
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import Plan
from tablegen.waveform.series import FourierSeries


@dataclass(frozen=True)
class FileState:
    """A file of the build: its SHA-256 in the manifest, and the fault of the one in the directory."""

    name: str
    sha256: str
    wrong: str = ""


@dataclass(frozen=True)
class PlannedScan:
    """The data of a scan that a directory does not have.

    ``broken`` are limits that the certificate exceeds, ``warnings`` errors above the usual, each with its percentage.
    """

    setup: Setup
    plan: Plan
    certificates: Mapping[str, Certificate]
    broken: tuple[Problem, ...] = ()
    warnings: tuple[tuple[float, Problem], ...] = ()

    @property
    def limited(self) -> bool:
        """True if the scan file sets a limit."""
        limits = self.plan.limits
        return limits.max_error_lsb is not None or limits.max_scaling_error_percent is not None


@dataclass(frozen=True, eq=False)
class OwnImage:
    """An image of the user to show beside the prediction; ``size_nm`` is None where its file does not have it."""

    name: str
    channel: str
    heights: Floats
    unit: str
    size_nm: tuple[float, float] | None
    bottom_first: bool


@dataclass(frozen=True)
class Subject:
    """The build as its manifest describes it; ``planned`` is None for a directory.

    ``tilts`` are the outputs beside x and y, by their names.
    """

    manifest: Manifest
    digest: str
    files: tuple[FileState, ...]
    planned: PlannedScan | None = None
    verified: VerifyRecord | None = None
    image: OwnImage | None = None
    tilts: dict[TiltName, StraightTilt] = field(default_factory=dict)

    @property
    def axes(self) -> tuple[tuple[Literal["x", "y"], ManifestAxis], ...]:
        """The axes that move with their names, the fast one first."""
        both: tuple[tuple[Literal["x", "y"], ManifestAxis], ...] = (
            ("x", self.manifest.axes.x),
            ("y", self.manifest.axes.y),
        )
        return tuple(one for one in both if not one[1].resting)


def series_of(axis: ManifestAxis) -> FourierSeries:
    """Return the emitted waveform w(t)."""
    fourier = axis.fourier
    return FourierSeries(fourier.a0, np.array(fourier.a), np.array(fourier.b))


def of_scan(planned: PlannedScan, files: Mapping[str, bytes], verified: VerifyRecord | None = None) -> Subject:
    """Return a scan and the files that a build of it writes, the manifest among them."""
    content = files[MANIFEST]
    plain = read_json(content)
    manifest = msgspec.convert(plain, Manifest)
    tilts = {name: msgspec.convert(plain[name], StraightTilt) for name in TILT_NAMES if name in plain}
    states = tuple(FileState(name, sha256(data).hexdigest()) for name, data in sorted(files.items()))
    return Subject(manifest, sha256(content).hexdigest(), states, planned, verified, tilts=tilts)


def of_directory(folder: Path, verified: VerifyRecord | None = None) -> Subject:
    """Read the build in a directory.

    Raises
    ------
    NotABuild
        If the directory is not a build.
    """
    stored = read_build(folder)
    manifest = stored.manifest
    digest = manifest_digest(folder)
    states = (FileState(MANIFEST, digest), *files_beside(folder, manifest.files))
    return Subject(
        manifest, digest, tuple(sorted(states, key=lambda state: state.name)), None, verified, tilts=stored.tilts
    )


def manifest_digest(folder: Path) -> str:
    """Return the SHA-256 of the manifest in a directory."""
    return sha256(read_bytes(folder / MANIFEST, MANIFEST_KIND)).hexdigest()


def files_beside(folder: Path, promised_files: Mapping[str, str]) -> list[FileState]:
    """Return the files of a build beside the SHA-256 that its manifest has of them."""
    states = []
    for name, promised in promised_files.items():
        try:
            wrong = "" if file_sha256(folder / name, BUILD_FILE) == promised else "differs from the manifest"
        except OSError as error:
            wrong = f"cannot be read: {error.strerror or error}"
        states.append(FileState(name, promised, wrong))
    return states
