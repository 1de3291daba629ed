"""What to know before the image is trusted: what spoils it first comes first, small print last."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tablegen.certificate.certificate import Certificate
from tablegen.certificate.doubts import doubts
from tablegen.certificate.excess import excess
from tablegen.certificate.matching import apart_percent
from tablegen.certificate.summary import notes
from tablegen.manifest.fields import ManifestCertificate
from tablegen.planning.line_plan import Plan
from tablegen.problems import Problem
from tablegen.report.blocks import Tone
from tablegen.report.record import VerifyRecord
from tablegen.report.subject import Subject

Weight = Literal["limit", "spoils", "expect", "note"]
_ORDER: tuple[Weight, ...] = ("limit", "spoils", "expect", "note")
_TONES: dict[Weight, Tone] = {"limit": "bad", "spoils": "warn", "expect": "", "note": "quiet"}
_SIGNS: dict[Weight, str] = {
    "limit": "\u2717 breaks a limit",
    "spoils": "! spoils the image",
    "expect": "to expect",
    "note": "note",
}
_UNCOMPENSATED = "is not compensated"
_CHORD = 0.05  # of the line: a scaling error over it is a place that is wrong by so much of it
_TYPICAL_PERCENT = 10.0  # of a piezo whose hysteresis is not compensated: 10 to 20 % of the line


@dataclass(frozen=True)
class Finding:
    """A sentence, how much it weighs, and by what percentage of the line within that.

    ``called`` replaces the words for its weight.
    """

    weight: Weight
    percent: float
    text: str
    called: str = ""

    @property
    def tone(self) -> Tone:
        """Its colour."""
        return _TONES[self.weight]

    @property
    def sign(self) -> str:
        """Its weight in words, for eyes that see no colour."""
        return self.called or _SIGNS[self.weight]


def ranked(subject: Subject) -> list[Finding]:
    """All that is known, the worst first."""
    return sorted(_found(subject), key=lambda one: (_ORDER.index(one.weight), -one.percent))


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
        for text in notes(planned.plan):
            spoils = _UNCOMPENSATED in text
            yield Finding("spoils" if spoils else "note", _TYPICAL_PERCENT if spoils else 0.0, text)
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
        basis = "the operator expects" if expected.basis == "traces" else "the laws expect"
        by = "" if figure.uncertainty is None else f" \u00b1 {figure.uncertainty:.2g}"
        why = ", since turnarounds are rounded" if expected.basis == "laws" else ""
        text = f"trace and retrace of {axis} up to {figure.value:.3g}{by} % of the line apart, {basis}{why}"
        yield Finding("expect", figure.value, text)
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


def weighed(plan: Plan, certificates: Mapping[str, Certificate], warnings: list[Problem]) -> list[tuple[float, str]]:
    """The warnings of a scan, each with the percentage of the error that it tells of, and without folders."""
    known = []
    for line in plan.lines:
        found = excess(certificates[line.axis].scaling)
        known += [] if found is None else [(found.text(line.axis), abs(found.percent))]
        known += [(doubt.text, doubt.percent) for doubt in doubts(line, certificates[line.axis])]
    return [
        (
            next((percent for text, percent in known if problem.why.startswith(text)), apart_percent(plan)),
            placed(problem),
        )
        for problem in warnings
    ]


def placed(problem: Problem) -> str:
    """A problem at its place in the file, without the folder, which is of one machine alone."""
    return str(problem._replace(file=Path(problem.file).name))
