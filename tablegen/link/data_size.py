"""The number of bytes in a DATA: fewer on a line that damages most frames, since a shorter frame is hit less often."""

_MIN_BYTES = 24  # of which a frame has 16 more on the wire
_LONG_TRIES = 2  # tries in vain before they are shorter
_MEMORY = 16  # frames over which the share of lost ones is averaged
_HIGH_LOSS = 0.4  # share at which half as many bytes are faster
_LOW_LOSS = 1 / 20  # share at which twice as many are
_START_LOSS = 1 / 5  # share that is assumed of another size


class DataSize:
    """The bytes of the next DATA: half as many where two fifths of them are lost, twice as many on a good line."""

    def __init__(self, most: int) -> None:
        self._bytes = self._most = most
        self._least = min(most, _MIN_BYTES)
        self._loss = 0.0

    def next(self, in_vain: int) -> int:
        """Return the bytes of the next DATA; after so many tries in vain it is a short one."""
        return max(self._bytes >> max(in_vain - _LONG_TRIES, 0), self._least)

    def learn(self, lost: int) -> None:
        """Count frames that were lost before one that has arrived."""
        for is_lost in [True] * lost + [False]:
            self._loss += (is_lost - self._loss) / _MEMORY
            if self._loss > _HIGH_LOSS and self._bytes > self._least:
                self._use(self._bytes // 2)
            elif self._loss < _LOW_LOSS and self._bytes < self._most:
                self._use(2 * self._bytes)

    def _use(self, size: int) -> None:
        self._bytes = min(max(size, self._least), self._most)
        self._loss = _START_LOSS
