"""The subject of a report of a scan at an angle: a planned scan, or a build in its directory."""

from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from tablegen.base.input_errors import Problem
from tablegen.certificate.turned_errors import TurnedCertificate, certify_turned
from tablegen.certificate.turned_summary import broken_limits
from tablegen.config.load import Setup
from tablegen.emit.turned_scan import formats_of_turned, render_turned, turned_clocks
from tablegen.html_report.ranking import without_folder
from tablegen.html_report.subject import FileState, files_beside, manifest_digest
from tablegen.html_report.verify_record import VerifyRecord
from tablegen.manifest.format import MANIFEST
from tablegen.manifest.turned import StoredTurned, TurnedManifest, parse_turned, read_turned
from tablegen.planning.turned_plan import TurnedPlan, make_turned_plan


@dataclass(frozen=True, eq=False)
class PlannedTurned:
    """The data of a scan that a directory does not have; ``broken`` are limits that the certificate exceeds."""

    setup: Setup
    plan: TurnedPlan
    certificate: TurnedCertificate
    broken: tuple[Problem, ...] = ()

    @property
    def limited(self) -> bool:
        """True if the scan file sets a limit."""
        limits = self.plan.limits
        return limits.max_error_lsb is not None or limits.max_scaling_error_percent is not None


@dataclass(frozen=True, eq=False)
class TurnedSubject:
    """The build as its manifest describes it; ``planned`` is None for a directory."""

    stored: StoredTurned
    digest: str
    files: tuple[FileState, ...]
    planned: PlannedTurned | None = None
    verified: VerifyRecord | None = None

    @property
    def manifest(self) -> TurnedManifest:
        """The manifest."""
        return self.stored.manifest

    @property
    def errors(self) -> dict[str, Any]:
        """The errors of the certificate by the names of ``TurnedErrors``."""
        errors: dict[str, Any] = self.stored.plain["certificate"].get("errors", {})
        return errors


def turned_scan(
    setup: Setup, verified: VerifyRecord | None = None, progress: Callable[[str], object] = lambda _: None
) -> TurnedSubject:
    """Plan and certify a scan at an angle and render its files, without writing them.

    Raises
    ------
    Rejected
        For wrong input.
    """
    formats = formats_of_turned(setup)
    plan = make_turned_plan(setup, progress)
    clocks = turned_clocks(setup, plan, formats)
    certificate = certify_turned(plan, progress)
    progress("writing the formats")
    files = render_turned(plan, certificate, formats, clocks)
    broken = tuple(map(without_folder, broken_limits(setup, plan, certificate)))
    states = tuple(FileState(name, sha256(data).hexdigest()) for name, data in sorted(files.items()))
    content = files[MANIFEST]
    planned = PlannedTurned(setup, plan, certificate, broken)
    return TurnedSubject(parse_turned(content), sha256(content).hexdigest(), states, planned, verified)


def turned_directory(folder: Path, verified: VerifyRecord | None = None) -> TurnedSubject:
    """Read the build of a scan at an angle in a directory.

    Raises
    ------
    NotABuild
        If the directory is not such a build.
    """
    stored, digest = read_turned(folder), manifest_digest(folder)
    wrong = "" if stored.own_hash == stored.manifest.hash else "has a hash that is not that of its plan"
    states = (FileState(MANIFEST, digest, wrong), *files_beside(folder, stored.manifest.files))
    return TurnedSubject(stored, digest, tuple(sorted(states, key=lambda state: state.name)), None, verified)
