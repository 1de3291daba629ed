"""The least memory that keeps an error, and the tables than which none is smaller and better."""

from collections.abc import Iterable, Iterator
from math import floor

from msgspec import Struct

from tablegen.fixedpoint.table_shape import MODES, TableShape
from tablegen.planning.emitted_error import FRACTION_BITS, AskedCodes
from tablegen.planning.table_maker import TableMaker

_UNIT = 1 << FRACTION_BITS
_BETTER = (95, 100)  # an error that is less than 5 % smaller is no better


class FoundTable(Struct, frozen=True):
    """A shape, and the worst error of its table in LSB of the converter."""

    shape: TableShape
    max_error_lsb: float


class TableSearch:
    """The tables of one axis. ``measured`` counts those whose every tick was looked at, ``made`` those that were made.

    A table is looked at on some of its ticks first: where these err by too much the rest can only be worse.
    """

    def __init__(self, maker: TableMaker) -> None:
        self._maker = maker
        self._asked = AskedCodes(maker)
        self._least: dict[TableShape, int] = {}
        self._worst: dict[TableShape, int] = {}

    @property
    def made(self) -> int:
        """Tables that were made."""
        return len(self._least)

    @property
    def measured(self) -> int:
        """Tables of which every tick was looked at."""
        return len(self._worst)

    def least_error(self, shape: TableShape) -> int:
        """What a table errs by at least, in 2^-16 LSB."""
        if shape not in self._least:
            self._least[shape] = self._asked.least_error(self._maker.made(shape).program)
        return self._least[shape]

    def worst_error(self, shape: TableShape) -> int:
        """What a table errs by at most, over all ticks, in 2^-16 LSB: rounded up, with one more."""
        if shape not in self._worst:
            self._worst[shape] = self._asked.worst_error(self._maker.made(shape).program) + 1
        return self._worst[shape]

    def smallest(self, shapes: Iterable[TableShape], max_error_lsb: float) -> TableShape | None:
        """The first by ``TableShape.order`` whose worst error is at most so many LSB; None where no table keeps it."""
        most = floor(max_error_lsb * _UNIT)
        for shape in sorted(shapes, key=lambda one: one.order):
            if self.least_error(shape) < most and self.worst_error(shape) <= most:
                return shape
        return None

    def best(self, shapes: Iterable[TableShape]) -> FoundTable:
        """The table with the least worst error; of equal ones the first by ``TableShape.order``."""
        found: TableShape | None = None
        for shape in sorted(shapes, key=lambda one: (self.least_error(one), one.order)):
            if found is None or self.least_error(shape) < self.worst_error(found):
                found = min(filter(None, (found, shape)), key=lambda one: (self.worst_error(one), one.order))
        assert found is not None
        return FoundTable(found, self.worst_error(found) / _UNIT)

    def front(self, shapes: Iterable[TableShape], from_lsb: float) -> list[FoundTable]:
        """By memory: every table than which no other is as small, as simple to play and better.

        Those with an error above ``from_lsb`` are left out.
        """
        return list(self._front(sorted(shapes, key=lambda one: one.order), floor(from_lsb * _UNIT)))

    def _front(self, shapes: Iterable[TableShape], most: int) -> Iterator[FoundTable]:
        reached: dict[int, int] = {}  # by how a table is played, the simplest first
        for shape in shapes:
            rank = MODES.index(shape.mode)
            before = min((error for simpler, error in reached.items() if simpler <= rank), default=None)
            limit = most if before is None else min(most, before * _BETTER[0] // _BETTER[1])
            if self.least_error(shape) < limit and self.worst_error(shape) <= limit:
                reached[rank] = self.worst_error(shape)
                yield FoundTable(shape, self.worst_error(shape) / _UNIT)
