"""How an existing image was taken: the drive of each axis, and what stands in where it is unknown."""

from dataclasses import dataclass, field, replace

_OLD_TURN = 0.5  # of an instrument that scans forward and back, up and down, at one speed
_WHOLE = 0.0, 1.0  # window of a whole sweep


@dataclass(frozen=True, kw_only=True)
class OldAxis:
    """The drive of an axis of an existing image; a value of None is unknown, and replaced as ``OldScan`` says.

    ``turn`` and ``window`` of x are then those of the file; where it does not say, 0.5 and the whole sweep.
    """

    size_v: float | None = None
    size_nm: float | None = None
    offset_v: float | None = None
    turn: float | None = None
    window: tuple[float, float] | None = None

    def with_defaults(self, turn: float | None = None, window: tuple[float, float] | None = None) -> "OldAxis":
        """Return the axis with turn and window: its own, else these, else those of a symmetric triangle."""
        turn = next((one for one in (self.turn, turn) if one is not None), _OLD_TURN)
        return replace(self, turn=turn, window=self.window or window or _WHOLE)

    @property
    def timing(self) -> tuple[float, tuple[float, float]]:
        """Turn and window, with those of a symmetric triangle where they are unknown."""
        return _OLD_TURN if self.turn is None else self.turn, self.window or _WHOLE


@dataclass(frozen=True, kw_only=True)
class OldScan:
    """The drive of an existing image: volts at the piezo, peak to peak, of a triangle on each axis.

    Instead of ``size_v`` the size in nm that a scan file would have: its volts come from the scanner file. The offset
    is in the middle of the driver's range unless given. The slow axis is driven as the fast one unless given; ``lines``
    are those of its period, ``back`` is true if the rows are of its way back. Columns are ``delay_pixels`` late.
    """

    x: OldAxis = field(default_factory=OldAxis)
    y: OldAxis = field(default_factory=OldAxis)
    rate_hz: float | None = None
    lines: int | None = None
    back: bool = False
    delay_pixels: float = 0.0
