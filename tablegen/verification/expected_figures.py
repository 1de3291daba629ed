"""The expectations on the scanner that a directory can confirm: the mismatch by the laws, and the text of headers.

Traces are in no build, so that an operator's figures can only be compared with the text of the emitted headers: a
manifest that was edited alone differs from the digits there.
"""

import re
from pathlib import Path

import numpy as np

from tablegen.base.reading import BUILD_FILE, read_text
from tablegen.manifest.fields import ManifestAxis, ManifestExpected, ManifestFigure
from tablegen.manifest.read import StoredBuild
from tablegen.verification.checks.certified import at, different_figures, on_grid
from tablegen.verification.checks.scaling import OPERATOR, followed, law

_POINTS = 401  # over the window
_GRID = 32  # per period of the highest harmonic
_HEADERS = (".h", ".vh")
_BEGIN = "on the scanner"
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_TWO_DIGITS, _THREE_DIGITS = 0.051, 0.0051  # relative: what they round away
_ZERO_PERCENT = 0.0005  # what is printed as 0
_LEVEL_PERCENT = 90.0  # of scans, which a header states beside the distance
_MOST_CHANGE, _LEAST_BETA = 2.0, 0.01  # bounds of the change of a branch between the line's stroke and the played one


def wrong_mismatch(axis: ManifestAxis) -> list[str]:
    """Check the stated mismatch against that of the branches at the played stroke; of known models only."""
    expected = axis.certificate.expected
    if expected is None or expected.basis != "laws" or expected.mismatch_percent is None:
        return []
    stroke = expected.stroke
    if stroke is None:
        return ["certificate.expected.stroke is missing, and the mismatch follows from it"]
    forward, backward = (law(one, axis.drive.model) for one in (stroke.forward, stroke.backward))
    if axis.drive.model == OPERATOR or forward is None or backward is None:
        return []
    target = followed(axis)
    w = on_grid(target, _GRID * axis.fourier.harmonics)
    low, high = float(np.min(w)), float(np.max(w))
    wrong = []
    # A size goes with its voltage by (6) and (10), whose local exponent is between 0 and 2.
    if not abs(stroke.size / (high - low) - 1.0) <= 1.0 - (high - low) + 1e-6:
        wrong.append(f"certificate.expected.stroke.size is {stroke.size:g}, of a stroke of {high - low:.6g}")
    for side in ("forward", "backward"):
        here, of_line = getattr(stroke, side).beta, getattr(axis.drive, side).beta
        if abs(here) > _MOST_CHANGE * abs(of_line) + _LEAST_BETA:
            wrong.append(f"certificate.expected.stroke.{side}.beta is {here:g}, and that of the line {of_line:g}")
    turn, x = axis.drive.turn, np.linspace(*axis.fourier.window, _POINTS)
    there, back = ((at(target, t) - low) / (high - low) for t in (turn * x, turn + (1.0 - turn) * (1.0 - x)))
    mismatch = forward.inverse(there) - (1.0 - backward.inverse(1.0 - back))
    figures: dict[str, float | int | None] = {"value": 100.0 * stroke.size * float(np.max(np.abs(mismatch)))}
    stated: dict[str, float | int | None] = {"value": expected.mismatch_percent.value}
    return wrong + different_figures(stated, figures, True, "expected.mismatch_percent.")


def header_texts(folder: Path, stored: StoredBuild) -> dict[str, str]:
    """Return the comments of the headers of a build by name; another check reports one that cannot be read."""
    name = stored.manifest.name
    texts = {}
    for suffix in _HEADERS:
        if f"{name}{suffix}" in stored.manifest.files:
            try:
                texts[f"{name}{suffix}"] = read_text(folder / f"{name}{suffix}", BUILD_FILE, "ascii")
            except (OSError, ValueError):
                continue
    return texts


def wrong_texts(name: str, axis: ManifestAxis, texts: dict[str, str]) -> list[str]:
    """List the headers whose expected figures of an axis differ from its certificate."""
    expected = axis.certificate.expected
    wrong = []
    for file, text in texts.items():
        stated = _stated(name, text)
        figures = [] if expected is None else _figures(expected)
        alike = len(stated) == len(figures) and all(
            abs(one - value) <= room * abs(value) + _ZERO_PERCENT * (value == 0.0 or room == _THREE_DIGITS)
            for one, (value, room) in zip(stated, figures, strict=True)
        )
        if not alike:
            wrong.append(f"certificate.expected is not what {file} says in its comment")
    return wrong


def _stated(name: str, text: str) -> list[float]:
    """Return the numbers of the lines about the scanner in the certificate of an axis."""
    rows = [row.strip(" */") for row in text.splitlines()]
    begin = next((i for i, row in enumerate(rows) if row == f"{name} certificate"), len(rows))
    numbers: list[float] = []
    inside = False
    for row in text.splitlines()[begin + 1 :]:
        if not row.strip(" */"):
            break
        if _BEGIN in row:
            inside = True
            row = row.partition(_BEGIN)[2]
        elif inside and not re.match(r"^(?: \*|//) {10,}", row):
            break
        if inside:
            numbers += [float(one) for one in _NUMBER.findall(row)]
    return numbers


def _figures(expected: ManifestExpected) -> list[tuple[float, float]]:
    """Return the numbers that a header states, in its order, each with the tolerance of its digits."""
    if expected.basis == "laws":
        return [] if expected.mismatch_percent is None else [(expected.mismatch_percent.value, _THREE_DIGITS)]
    figures: list[ManifestFigure | None] = [
        sides.get(side)
        for sides in (expected.rms_percent, expected.scaling_percent)
        for side in ("forward", "backward")
    ]
    numbers: list[float] = []
    for figure in (*figures, expected.mismatch_percent, expected.size_percent):
        if figure is not None:
            numbers += [figure.value] if figure.uncertainty is None else [figure.value, figure.uncertainty]
    rooms = [(one, _TWO_DIGITS) for one in numbers]
    if expected.distance_percent is not None:
        rooms += [(expected.distance_percent, _TWO_DIGITS), (_LEVEL_PERCENT, 0.0)]
    return rooms
