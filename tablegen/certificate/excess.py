"""Scans that are worse than they should be: an error above 1 %, or above that of the line without any correction."""

from collections.abc import Mapping
from typing import Literal

from msgspec import Struct

from tablegen.base.remedies import FindingCode
from tablegen.certificate.line_errors import ScalingError

LARGEST_PERCENT = 1.0  # the largest error without a warning
_NOTHING_PERCENT = 0.0005  # what rounds to 0: no hysteresis
Cause = Literal["quantisation", "band limit", "model"]
_CALLED: dict[Cause, str] = {"quantisation": "quantisation", "band limit": "the band limit", "model": "the model"}


class Excess(Struct, frozen=True):
    """The worst error of one axis that is worth a warning: its figure in percent, its limit, and its parts.

    ``what`` is "scaling error" (peak to peak) or "size error" (with its sign), ``side`` the direction, ``limit`` the
    percentage that it exceeds. ``parts`` are those of this direction.
    """

    what: Literal["scaling error", "size error"]
    side: str
    percent: float
    limit: float
    parts: ScalingError

    @property
    def code(self) -> FindingCode:
        """The code of the finding."""
        return "scaling-error" if self.what == "scaling error" else "size-error"

    @property
    def times(self) -> float:
        """The ratio of the error to its limit."""
        return abs(self.percent) / self.limit

    @property
    def cause(self) -> Cause:
        """The largest part of the error."""
        parts: list[tuple[float, Cause]] = [
            (self.parts.quantisation, "quantisation"),
            (self.parts.band_limit, "band limit"),
            (self.parts.model, "model"),
        ]
        return max(parts, key=lambda part: part[0])[1]

    def text(self, axis: str) -> str:
        """Return the error, what it is above, and its parts, in words."""
        parts, above = self.parts, []
        if self.what == "scaling error":
            figure = f"{self.percent:.3g} %"
            if self.percent > LARGEST_PERCENT:
                above.append(f"{LARGEST_PERCENT:g} %")
            if parts.uncompensated is not None and self.percent > parts.uncompensated >= _NOTHING_PERCENT:
                above.append(f"the {parts.uncompensated:.3g} % of the uncompensated line")
        else:
            figure = f"{self.percent:+.3g} %"
            above.append(f"{LARGEST_PERCENT:g} %")
        return (
            f"the {axis} axis has a {self.what} of {figure} {self.side}, above {' and above '.join(above)}; "
            f"the cause is {_CALLED[self.cause]} (quantisation {_figure(parts.quantisation)}, "
            f"band limit {_figure(parts.band_limit)}, model {_figure(parts.model)} %)"
        )


def excess(scaling: Mapping[str, ScalingError], most: float | None = None) -> Excess | None:
    """Return the worst error of one axis that is to be reported; None where there is none.

    An uncompensated line is one to compare with only where the scanner file has a hysteresis to compensate. With
    ``most``, a limit of the scan file in percent, that alone counts.
    """
    candidates = []
    for side, parts in scaling.items():
        error = max(parts.total, parts.band_limit)
        limit = size_limit = LARGEST_PERCENT if most is None else most
        if most is None and parts.uncompensated is not None and parts.uncompensated >= _NOTHING_PERCENT:
            limit = min(limit, parts.uncompensated)
        if error > limit:
            candidates.append(Excess("scaling error", side, error, limit, parts))
        if abs(parts.size) > size_limit:
            candidates.append(Excess("size error", side, parts.size, size_limit, parts))
    return max(candidates, key=lambda one: one.times, default=None)


def _figure(percent: float) -> str:
    return f"{percent:.3g}" if percent >= 1.0 else f"{percent:.3f}" if percent >= _NOTHING_PERCENT else "0"
