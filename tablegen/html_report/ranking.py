"""The findings of a report: errors that spoil the image come first."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from tablegen.base.input_errors import Problem
from tablegen.base.warnings import Axis, Finding, Weight, worst_first
from tablegen.certificate.scan_notes import expected_mismatch, note_findings, whole_ticks
from tablegen.html_report.subject import FileState, Subject
from tablegen.html_report.verify_record import VerifyRecord
from tablegen.manifest.fields import ManifestAxis

_TOTALS = ("total", "uncompensated")
_CHORD = 0.05  # of the line: the position error of a scaling error over a chord is their product


def ranked(subject: Subject) -> list[Finding]:
    """Return all findings, the worst first."""
    return worst_first(_findings(subject))


def _findings(subject: Subject) -> Iterator[Finding]:
    yield from file_findings(subject.files, subject.verified, subject.digest)
    planned, reported = subject.planned, set[tuple[str, str]]()
    groups: list[list[Finding]] = [[finding for axis, entry in subject.axes for finding in _expected(axis, entry)]]
    if planned is not None:
        broken = [_of_problem("limit", 100.0, problem) for problem in planned.broken]
        warnings = [_of_problem("spoils", percent, problem) for percent, problem in planned.warnings]
        groups = [broken, warnings, note_findings(planned.plan), *groups]
    for group in groups:  # a finding of a group with more weight is not repeated
        yield from (finding for finding in group if (finding.code, finding.axis) not in reported)
        reported |= {(finding.code, finding.axis) for finding in group}


def file_findings(files: Iterable[FileState], verified: VerifyRecord | None, digest: str) -> Iterator[Finding]:
    """Yield files that are not those of the manifest, whose SHA-256 is ``digest``, and faults of a record of verify."""
    for state in files:
        if state.wrong:
            yield Finding("limit", 1000.0, f"{state.name} {state.wrong}", code="changed-file")
    yield from _verified(verified, digest)


def _of_problem(weight: Weight, percent: float, problem: Problem) -> Finding:
    return Finding(weight, percent, str(problem), code=problem.code, axis=problem.axis)


def _expected(axis: Axis, entry: ManifestAxis) -> Iterator[Finding]:
    """Yield the expected errors of an axis."""
    certificate = entry.certificate
    expected, pixels = certificate.expected, certificate.pixels
    if pixels is not None:
        yield whole_ticks(axis, pixels.worst_percent, pixels.scaling_percent, pixels.mismatch_percent)
        return
    if expected is not None and expected.mismatch_percent is not None:
        figure = expected.mismatch_percent
        yield expected_mismatch(axis, expected.basis, figure.value, figure.uncertainty)
    scaling = certificate.scaling_error_percent or {}
    if scaling:
        totals, plain = ({side: one.get(name, 0.0) for side, one in scaling.items()} for name in _TOTALS)
        text = f"{axis}: the waveform itself has {_by_side(totals)} of scaling error"
        if max(plain.values()) > 0.0005:
            text += f"; without correction it would be {_by_side(plain)}"
        yield Finding("expect", _CHORD * max(totals.values()), text, code="scaling-error", axis=axis)


def _by_side(percent: Mapping[str, float]) -> str:
    """Format a percentage of each direction, such as ``0.124 % forward and 0.13 % backward``."""
    return " and ".join(f"{value:.3g} % {side}" for side, value in percent.items())


def _verified(record: VerifyRecord | None, digest: str) -> Iterator[Finding]:
    if record is None:
        return
    if record.digest != digest:
        text = "the record of verify is of another build, or does not say of which"
        yield Finding("limit", 900.0, text, code="other-verify-record")
    failed = [check for check in record.checks if check.failure]
    if failed:
        text = f"verify found {len(failed)} of {len(record.checks)} checks failed"
        yield Finding("limit", 950.0, text, code="failed-check")


def without_folder(problem: Problem) -> Problem:
    """Return a problem with the name of its file without the folder, which another machine does not have."""
    return problem._replace(file=Path(problem.file).name)


__all__ = ["Finding", "file_findings", "ranked", "without_folder"]
