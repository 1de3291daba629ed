"""Flash that loses power in the middle of a word: what was being written or erased then reads as its mode says."""

import random

from tablegen.link.store import LINE

WORD = 8  # bytes that are written at once
MODES = ("old", "new", "early", "late", "mixed", "anything", "unstable")


class CutFlash:
    """Flash by words of 8 bytes, with a supply that fails at an event: a word written, or 32 bytes erased.

    An interrupted word reads as before (``old``), as if finished (``new``), finished only until the next start
    (``early``) or only after it (``late``), as a bitwise mixture (``mixed``), as random bytes (``anything``), or as
    another mixture at each read (``unstable``).
    """

    def __init__(self, size: int, sector_bytes: int) -> None:
        self.cells = bytearray(b"\xff" * size)
        self.sector_bytes = sector_bytes
        self.torn: dict[int, tuple[str, int, bytes, bytes, bytes]] = {}  # by word: mode, start, old, new, mixture
        self.starts = self.events = 0
        self.cut_at: int | None = None
        self.mode, self.on = "old", True
        self.trace: list[tuple[str, int, bytes]] = []
        self.chance = random.Random(1)

    def copy(self) -> "CutFlash":
        other = CutFlash(0, self.sector_bytes)
        other.cells, other.torn, other.starts = bytearray(self.cells), dict(self.torn), self.starts
        return other

    def power_up(self) -> None:
        self.on, self.cut_at, self.events = True, None, 0
        self.starts += 1

    def cut(self, event: int, mode: str) -> None:
        """Let the supply fail in the middle of an event, counted from now on."""
        self.events, self.cut_at, self.mode = 0, event, mode
        self.chance.seed(event)

    def _fails(self) -> bool:
        fails = self.events == self.cut_at
        self.events += 1
        self.on = self.on and not fails
        return fails

    def _tear(self, at: int, new: bytes) -> None:
        old = self._word(at)
        mask = self.chance.randbytes(WORD)
        mixture = bytes((a & ~m | b & m) & 255 for a, b, m in zip(old, new, mask, strict=True))
        if self.mode == "anything":
            mixture = mask
        self.torn[at] = (self.mode, self.starts, old, new, mixture)

    def _word(self, at: int) -> bytes:
        if at not in self.torn:
            return bytes(self.cells[at : at + WORD])
        mode, start, old, new, mixture = self.torn[at]
        if mode == "unstable":
            masks = self.chance.randbytes(WORD)
            return bytes((a & ~m | b & m) & 255 for a, b, m in zip(old, new, masks, strict=True))
        later = self.starts > start + 1
        chosen = {"old": old, "new": new, "early": old if later else new, "late": new if later else old}
        return chosen.get(mode, mixture)

    def erase(self, address: int) -> bool:
        self.trace.append(("erase", address, b""))
        assert address % self.sector_bytes == 0, address
        end = address + self.sector_bytes
        for line in range(address, end, LINE):
            if not self.on:
                return False
            if self._fails():
                for at in range(line, end, WORD):
                    self._tear(at, b"\xff" * WORD)
                return False
            self.cells[line : line + LINE] = b"\xff" * LINE
            for at in range(line, line + LINE, WORD):
                self.torn.pop(at, None)
        return True

    def write(self, address: int, line: bytes) -> bool:
        self.trace.append(("write", address, line))
        assert address % LINE == 0
        assert len(line) == LINE
        for at in range(address, address + LINE, WORD):
            new = line[at - address : at - address + WORD]
            if not self.on:
                return False
            erased = at not in self.torn and self.cells[at : at + WORD] == b"\xff" * WORD
            assert erased, f"{at} is not erased"
            if self._fails():
                self._tear(at, new)
                return False
            self.cells[at : at + WORD] = new
        return True

    def read(self, address: int, count: int) -> bytes | None:
        if not self.on:
            return None
        self.trace.append(("read", address, bytes([count])))
        first = address - address % WORD
        words = b"".join(self._word(at) for at in range(first, address + count, WORD))
        return words[address - first :][:count]
