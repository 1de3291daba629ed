"""What to know before the image is trusted: what spoils it first comes first, small print last."""

from collections.abc import Iterator
from pathlib import Path

from tablegen.base.input_errors import Problem
from tablegen.base.warnings import Finding, worst_first
from tablegen.certificate.scan_notes import expected_mismatch, note_findings
from tablegen.html_report.subject import Subject
from tablegen.html_report.verify_record import VerifyRecord
from tablegen.manifest.fields import ManifestCertificate

_CHORD = 0.05  # of the line: a scaling error over it is a place that is wrong by so much of it


def ranked(subject: Subject) -> list[Finding]:
    """All that is known, the worst first."""
    return worst_first(_found(subject))


def _found(subject: Subject) -> Iterator[Finding]:
    planned = subject.planned
    for state in subject.files:
        if state.wrong:
            yield Finding("limit", 1000.0, f"{state.name} {state.wrong}; build it again")
    yield from _verified(subject.verified, subject)
    told = []
    if planned is not None:
        told = [*planned.broken, *(text for _, text in planned.warnings)]
        yield from (Finding("limit", 100.0, text) for text in planned.broken)
        for percent, text in planned.warnings:
            if not any(_same(text, broken) for broken in planned.broken):
                yield Finding("spoils", percent, text)
        yield from note_findings(planned.plan)
    for axis, entry in subject.axes:
        yield from _expected(axis, entry.certificate, any(_scaling(axis) in text for text in told))


def _scaling(axis: str) -> str:
    """How a sentence on the scaling error of an axis begins."""
    return f"the {axis} axis has a scaling error"


def _same(one: str, other: str) -> bool:
    """Whether both are on the scaling error of the same axis, which is said once."""
    return any(_scaling(axis) in one and _scaling(axis) in other for axis in ("x", "y"))


def _expected(axis: str, certificate: ManifestCertificate, told: bool) -> Iterator[Finding]:
    """What to expect of an axis; its scaling error unless that was ``told``."""
    expected = certificate.expected
    if expected is not None and expected.mismatch_percent is not None:
        figure = expected.mismatch_percent
        yield expected_mismatch(axis, expected.basis, figure.value, figure.uncertainty)
    for side, error in ({} if told else certificate.scaling_error_percent or {}).items():
        text = f"{axis} {side}: the waveform itself has {error.get('total', 0.0):.3g} % of scaling error"
        if error.get("uncompensated", 0.0) > 0.0005:
            text += f"; without correction it would be {error['uncompensated']:.3g} %"
        yield Finding("expect", _CHORD * error.get("total", 0.0), text)


def _verified(record: VerifyRecord | None, subject: Subject) -> Iterator[Finding]:
    if record is None:
        return
    if record.digest != subject.digest:
        yield Finding("limit", 900.0, "the record of verify is of another build, or does not say of which")
    failed = [check for check in record.checks if check.failure]
    if failed:
        yield Finding("limit", 950.0, f"verify found {len(failed)} of {len(record.checks)} checks failed")


def placed(problem: Problem) -> str:
    """A problem at its place in the file, without the folder, which is of one machine alone."""
    return str(problem._replace(file=Path(problem.file).name))


__all__ = ["Finding", "placed", "ranked"]
