"""What serial lines do to bytes and frames, from a seed: for lines in virtual time and for a proxy in real time."""

from collections import Counter
from dataclasses import dataclass, fields
from random import Random

from replacing import replace


@dataclass(frozen=True, slots=True)
class Chances:
    """How probable each fault is: the first four of a byte, the others of a frame, or what looks like one.

    ``reset`` and ``vanish`` are of frames to the device: it starts again when the frame has come, the port goes and
    comes back. A reset device is deaf for ``deaf_s``, a port away for ``away_s``, a stall is ``stall_s``.
    """

    drop: float = 0.0
    flip: float = 0.0
    insert: float = 0.0
    double: float = 0.0
    lose: float = 0.0
    repeat: float = 0.0
    reorder: float = 0.0
    truncate: float = 0.0
    stall: float = 0.0
    reset: float = 0.0
    vanish: float = 0.0
    stall_s: float = 0.2
    deaf_s: float = 0.02
    away_s: float = 0.8

    def times(self, factor: float) -> "Chances":
        """All of them, so many times as probable."""
        return replace(self, **{name: factor * getattr(self, name) for name in KINDS})


KINDS = tuple(field.name for field in fields(Chances) if not field.name.endswith("_s"))
_OF_BYTES = KINDS[:4]
MIXED = Chances(
    drop=0.0006,
    flip=0.0006,
    insert=0.0006,
    double=0.0006,
    lose=0.02,
    repeat=0.02,
    reorder=0.02,
    truncate=0.02,
    stall=0.01,
    reset=0.003,
    vanish=0.003,
)


class Spoiler:
    """One direction of a line: what becomes of a frame, and after what delay. ``done`` counts what was done."""

    def __init__(self, chances: Chances, random: Random) -> None:
        self._chances, self._random = chances, random
        self._kept: bytes | None = None
        self.done: Counter[str] = Counter()

    def heal(self) -> None:
        """No more faults."""
        self._chances, self._kept = Chances(), None

    def happens(self, kind: str) -> bool:
        """Whether a fault does, this time."""
        chance: float = getattr(self._chances, kind)
        happens = chance > 0.0 and self._random.random() < chance
        self.done[kind] += happens
        return happens

    def spoil(self, frame: bytes) -> list[tuple[float, bytes]]:
        """Seconds of delay, and the bytes that arrive then, in this order; a frame ends in 0x00."""
        delay = self._chances.stall_s if self.happens("stall") else 0.0
        if self.happens("lose"):
            arrives = []
        elif self.happens("repeat"):
            arrives = [frame, frame]
        elif self.happens("truncate"):
            arrives = [frame[: self._random.randrange(len(frame))]]
        elif self._kept is None and self.happens("reorder"):
            self._kept, arrives = frame, []
        else:
            arrives = [frame]
            if self._kept is not None:
                arrives.append(self._kept)
                self._kept = None
        return [(delay, self._bytes(one)) for one in arrives]

    def _bytes(self, frame: bytes) -> bytes:
        if not any(getattr(self._chances, kind) for kind in _OF_BYTES):
            return frame
        out = bytearray()
        for byte in frame:
            if self.happens("drop"):
                continue
            out.append(byte ^ (1 << self._random.randrange(8)) if self.happens("flip") else byte)
            if self.happens("double"):
                out.append(byte)
            if self.happens("insert"):
                out.append(self._random.randrange(256))
        return bytes(out)


def split(data: bytes) -> list[bytes]:
    """Pieces that end in 0x00, and what follows the last one."""
    pieces = [piece + b"\0" for piece in data.split(b"\0")]
    pieces[-1] = pieces[-1][:-1]
    return [piece for piece in pieces if piece]
