"""The expected errors of a line on the scanner, by what a model knows of the piezo, each with its uncertainty."""

from collections.abc import Mapping
from typing import Literal

from msgspec import Struct, field
from msgspec.structs import replace

LEVEL_PERCENT = 90  # of scans that leave less than a figure and its uncertainty together


class Figure(Struct, frozen=True):
    """A figure in percent of the line, and its uncertainty in the same unit; None where it is not known.

    The uncertainty is at ``LEVEL_PERCENT``.
    """

    value: float
    uncertainty: float | None = None


class PlayedStroke(Struct, frozen=True):
    """The stroke that is played, by the laws: the peak of each branch and its place, and the size.

    ``size`` is that of the stroke over that of the line.
    """

    forward: tuple[float, float]
    backward: tuple[float, float]
    size: float


class Expectation(Struct, frozen=True):
    """The expected errors of the line on the scanner; a waveform's own errors are the certificate's.

    ``rms`` is the residual about the best straight line, ``scaling`` the scaling error, peak to peak, each by
    direction; ``mismatch`` the largest distance of trace and retrace; ``size`` the error of the size, with its sign.
    ``basis`` says where they are from: "traces" of the piezo, or the "laws" of the scanner file, by which the
    mismatch alone is known. ``distance`` is how far stroke or centre are from the nearest measured line, in percent of
    v_max. ``stroke`` is what the mismatch follows from where it is by the laws.
    """

    basis: Literal["traces", "laws"]
    rms: Mapping[str, Figure] = field(default_factory=dict)
    scaling: Mapping[str, Figure] = field(default_factory=dict)
    mismatch: Figure | None = None
    size: Figure | None = None
    distance: float | None = None
    stroke: PlayedStroke | None = None

    @property
    def forward_only(self) -> "Expectation":
        """The expectation of a scan whose retrace is not imaged."""
        rms, scaling = ({"forward": one["forward"]} if "forward" in one else {} for one in (self.rms, self.scaling))
        return replace(self, rms=rms, scaling=scaling, mismatch=None)
