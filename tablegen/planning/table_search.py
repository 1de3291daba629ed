"""The least memory that keeps an error, and the Pareto front of memory and error."""

from collections.abc import Iterable, Iterator
from math import floor

from msgspec import Struct

from tablegen.fixedpoint.table_shape import MODES, TableShape
from tablegen.planning.emitted_error import FRACTION_BITS, IdealCodes
from tablegen.planning.table_maker import TableMaker

_UNIT = 1 << FRACTION_BITS
_BETTER = (95, 100)  # an error that is less than 5 % smaller is no better


class RatedTable(Struct, frozen=True):
    """A shape, and the worst error of its table in LSB of the converter."""

    shape: TableShape
    max_error_lsb: float


class TableSearch:
    """The tables of one axis, with the errors of those that were quantised.

    A table is checked on a sample of ticks first: where these err by too much the rest can only be worse.
    """

    def __init__(self, maker: TableMaker) -> None:
        self._maker = maker
        self._ideal = IdealCodes(maker)
        self._least: dict[TableShape, int] = {}
        self._worst: dict[TableShape, int] = {}

    @property
    def quantised(self) -> int:
        """The number of tables that were quantised."""
        return len(self._least)

    @property
    def measured(self) -> int:
        """The number of tables of which every tick was checked."""
        return len(self._worst)

    def least_error(self, shape: TableShape) -> int:
        """Return a lower bound of the worst error of a table, in 2^-16 LSB."""
        if shape not in self._least:
            self._least[shape] = self._ideal.least_error(self._maker.quantise(shape).program)
        return self._least[shape]

    def worst_error(self, shape: TableShape) -> int:
        """Return an upper bound of the error of a table over all ticks, in 2^-16 LSB: rounded up, with one more."""
        if shape not in self._worst:
            self._worst[shape] = self._ideal.worst_error(self._maker.quantise(shape).program) + 1
        return self._worst[shape]

    def smallest(self, shapes: Iterable[TableShape], max_error_lsb: float) -> TableShape | None:
        """Return the first shape by ``TableShape.order`` that keeps an error in LSB; None where no table does."""
        most = floor(max_error_lsb * _UNIT)
        for shape in sorted(shapes, key=lambda one: one.order):
            if self.least_error(shape) < most and self.worst_error(shape) <= most:
                return shape
        return None

    def best(self, shapes: Iterable[TableShape]) -> RatedTable:
        """Return the table with the least worst error; of equal ones the first by ``TableShape.order``."""
        best: TableShape | None = None
        for shape in sorted(shapes, key=lambda one: (self.least_error(one), one.order)):
            if best is None or self.least_error(shape) < self.worst_error(best):
                best = min(filter(None, (best, shape)), key=lambda one: (self.worst_error(one), one.order))
        assert best is not None
        return RatedTable(best, self.worst_error(best) / _UNIT)

    def front(self, shapes: Iterable[TableShape], from_lsb: float) -> list[RatedTable]:
        """Return, by memory, every table than which no other is as small, as simple to play and better.

        Tables with an error above ``from_lsb`` are left out.
        """
        return list(self._front(sorted(shapes, key=lambda one: one.order), floor(from_lsb * _UNIT)))

    def _front(self, shapes: Iterable[TableShape], most: int) -> Iterator[RatedTable]:
        reached: dict[int, int] = {}  # by how a table is played, the simplest first
        for shape in shapes:
            rank = MODES.index(shape.mode)
            before = min((error for simpler, error in reached.items() if simpler <= rank), default=None)
            limit = most if before is None else min(most, before * _BETTER[0] // _BETTER[1])
            if self.least_error(shape) < limit and self.worst_error(shape) <= limit:
                reached[rank] = self.worst_error(shape)
                yield RatedTable(shape, self.worst_error(shape) / _UNIT)
