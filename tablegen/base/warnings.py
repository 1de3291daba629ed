"""Warnings of an image with a weight, by which they are ranked: what spoils the image first, notes last.

A weight follows from the effect on the image; within it findings are ranked by the percentage of the line by which a
place, or the size, is wrong. Where no percentage is known it is 0.
"""

from collections.abc import Iterable
from typing import Literal

from msgspec import Struct

from tablegen.base.remedies import IN_TEXT, REMEDIES, FindingCode

Weight = Literal["limit", "spoils", "expect", "note"]
Axis = Literal["", "x", "y"]
Tone = Literal["", "good", "warn", "bad", "quiet"]
_ORDER: tuple[Weight, ...] = ("limit", "spoils", "expect", "note")
_TONES: dict[Weight, Tone] = {"limit": "bad", "spoils": "warn", "expect": "", "note": "quiet"}
_SIGNS: dict[Weight, str] = {
    "limit": "\u2717 breaks a limit",
    "spoils": "! spoils the image",
    "expect": "to expect",
    "note": "note",
}


class Finding(Struct, frozen=True):
    """A sentence, its weight, and the percentage of the scan that ranks it within that.

    ``called`` replaces the words for its weight on a page, ``label`` begins its line in a terminal. ``code`` names the
    kind of finding for programs, which go by it and by ``axis``, never by the sentence; "" where it has none. The code
    has a remedy in ``tablegen.base.remedies``.
    """

    weight: Weight
    percent: float
    text: str
    called: str = ""
    label: str = "note"
    code: FindingCode = ""
    axis: Axis = ""

    def record(self) -> dict[str, str]:
        """Return the finding as JSON outputs have it."""
        return {"code": self.code, "axis": self.axis, "text": self.text, "remedy": self.remedy}

    @property
    def remedy(self) -> str:
        """What to do about a finding of its code; "" where nothing is needed."""
        return REMEDIES.get(self.code, "")

    @property
    def full_text(self) -> str:
        """The sentence with the remedy of its code, unless it names one itself with the values of the case."""
        return f"{self.text}; next: {self.remedy}" if self.remedy and self.code not in IN_TEXT else self.text

    @property
    def tone(self) -> Tone:
        """The colour of its weight."""
        return _TONES[self.weight]

    @property
    def sign(self) -> str:
        """The weight in words, for output without colours."""
        return self.called or _SIGNS[self.weight]

    @property
    def line(self) -> str:
        """The finding as a line of a terminal."""
        return f"{self.label}: {self.full_text}"


class Remark(str):
    """A warning of a fit: a text with a weight, a percentage of the scan and the code of its finding."""

    weight: Weight
    percent: float
    code: FindingCode

    def __new__(cls, text: str, weight: Weight = "note", percent: float = 0.0, code: FindingCode = "") -> "Remark":
        """Make a remark of a text, its weight, its percentage of the scan and its code."""
        remark = super().__new__(cls, text)
        remark.weight, remark.percent, remark.code = weight, percent, code
        return remark

    def under(self, name: str) -> "Remark":
        """Return the remark with the name of its subject before it; unchanged if that is empty."""
        return Remark(f"{name}: {self}", self.weight, self.percent, self.code) if name else self


def spoils(text: str, percent: float = 0.0, code: FindingCode = "") -> Remark:
    """Return a remark on what makes the image worse, with the percentage of the scan where that is known."""
    return Remark(text, "spoils", percent, code)


def axis_name(axis: str) -> Axis:
    """Return the name of an axis as findings have it: "x" or "y", and "" for anything else."""
    return "x" if axis == "x" else "y" if axis == "y" else ""


def worst_first(findings: Iterable[Finding]) -> list[Finding]:
    """Return findings by weight and percentage; those of equal weight and printed percentage keep their order."""
    return sorted(findings, key=lambda one: (_ORDER.index(one.weight), -as_printed(one.percent)))


def as_printed(percent: float) -> float:
    """Return a percentage in three digits, so that equal texts compare equal."""
    return float(f"{percent:.3g}")


def of_remarks(remarks: Iterable[Remark]) -> list[Finding]:
    """Return remarks as findings, in their own order."""
    return [Finding(one.weight, one.percent, str(one), code=one.code) for one in remarks]
