"""The tables that an axis of a scan at an angle could have: their errors, the least memory, and the Pareto front."""

from collections.abc import Callable, Iterator
from functools import cached_property
from math import inf, sqrt

import numpy as np
from msgspec import Struct

from tablegen.base.figures import at_least
from tablegen.base.input_errors import Unphysical
from tablegen.compensation.operator.turned_frame import FrameDrive
from tablegen.config.schema import Limits, ProcessorName, Table
from tablegen.fixedpoint.converter import Converter
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.frame_words import BITS, FrameShape
from tablegen.numerics.arrays import Floats, Ints
from tablegen.numerics.driver import Driver
from tablegen.planning.table_choice import allowed_lsb

SAMPLES = 512  # of a line, at most, at which a frame is played on an operator
_LEAST_BITS = 10
_LEAST_LENGTH = 8
_LONGER = 4  # times the length that a drive has by default
_FEW_LINES = 12  # of a frame, on which a table is tried first
_BETTER = 0.95  # an error that is less than 5 % smaller is no better
_TIMES = 8.0  # tables with more than this multiple of the allowed error are not listed

Quantise = Callable[[FrameShape], FrameProgram]


def compared_ticks(line_ticks: int) -> Ints:
    """Return the ticks of a line at which a frame is played on an operator, at most ``SAMPLES``."""
    return np.arange(0, line_ticks, -(-line_ticks // SAMPLES))


class RatedFrameTables(Struct, frozen=True):
    """Tables of an axis, their packed memory in bits, and their largest and rms error in LSB of the converter."""

    shape: FrameShape
    memory_bits: int
    max_error_lsb: float
    rms_error_lsb: float


class FrameTableSearch:
    """The tables of an axis that follows both motions, with the errors of those that were quantised."""

    def __init__(
        self, drive: FrameDrive, converter: Converter, driver: Driver, ticks: int, lines: int, quantise: Quantise
    ) -> None:
        self._ticks, self._some = np.arange(ticks, dtype=np.int64), compared_ticks(ticks)
        # Fast tables lead by the half of a tick that the hold of the converter takes; slow ones do not.
        t, lead = self._ticks / ticks, (self._ticks + 0.5) / ticks
        start = drive.slow.on_grid(lines)
        rise, gain = np.roll(start, -1) - start, drive.at_lines(drive.gains, lines)
        ratio, fast, second = drive.at_lines(drive.ratios, lines), drive.fast.value(lead), drive.second.value(lead)

        def ideal(line: int) -> Floats:
            """Return the codes of the learnt drive in a line, as real numbers, shape (ticks,)."""
            volts = driver.volts(start[line] + rise[line] * t + gain[line] * (fast + ratio[line] * second))
            return np.asarray((volts - converter.v_zero) / converter.v_per_code)

        self._ideal = ideal
        self._few = np.unique(np.linspace(0, lines - 1, min(lines, _FEW_LINES)).astype(np.int64)).tolist()
        self._quantise, self._drive, self._lines = quantise, drive, lines
        self._programs: dict[FrameShape, FrameProgram | None] = {}
        self._rated: dict[FrameShape, RatedFrameTables] = {}

    @property
    def default(self) -> FrameShape:
        """The tables of a drive for which nothing else is requested."""
        return FrameShape.of(self._drive.fast, self._drive.slow)

    @cached_property
    def steepest(self) -> float:
        """The largest step of a tick of the learnt drive within a line, in codes."""
        return max(float(np.max(np.abs(np.diff(self._ideal(line))), initial=0.0)) for line in range(self._lines))

    def shapes(self, table: Table) -> list[FrameShape]:
        """Return the tables that hold the drive and agree with the length and the bits of a table, by memory."""
        default, knots = self.default, len(self._drive.gains)
        fast = _lengths(self._drive.fast.harmonics, default.length) if table.length is None else [table.length]
        slow = _lengths(self._drive.slow.harmonics, default.slow_length)
        widths = range(_LEAST_BITS, BITS + 1) if table.bits is None else (table.bits,)
        shapes = [FrameShape(length, bits, over) for length in fast for bits in widths for over in slow]
        fitting = [one for one in shapes if one.length >= 2 * (self._drive.fast.harmonics + 1) and one.bits <= BITS]
        return sorted(fitting, key=lambda one: (one.memory_bits(knots), one.length, one.slow_length, one.bits))

    def program(self, shape: FrameShape) -> FrameProgram | None:
        """Return the program of a shape; None if its words do not hold the drive."""
        if shape not in self._programs:
            try:
                self._programs[shape] = self._quantise(shape)
            except Unphysical:
                self._programs[shape] = None
        return self._programs[shape]

    def rated(self, shape: FrameShape, most_lsb: float = float("inf")) -> RatedFrameTables | None:
        """Return tables with their errors over a frame; None if they do not hold the drive, or err by more."""
        program = self.program(shape)
        if program is None or max(self._errors(program, line, self._some)[0] for line in self._few) > most_lsb:
            return None
        if shape not in self._rated:
            errors = [self._errors(program, line, self._ticks) for line in range(self._lines)]
            largest, squares = max(most for most, _ in errors), sum(square for _, square in errors)
            rms = sqrt(squares / (self._lines * len(self._ticks)))
            self._rated[shape] = RatedFrameTables(shape, program.memory_bits, largest, rms)
        rated = self._rated[shape]
        return rated if rated.max_error_lsb <= most_lsb else None

    def smallest(self, shapes: list[FrameShape], most_lsb: float) -> RatedFrameTables | None:
        """Return the first of shapes that keeps an error; None if none does."""
        return next((rated for shape in shapes if (rated := self.rated(shape, most_lsb)) is not None), None)

    def best(self, shapes: list[FrameShape]) -> RatedFrameTables | None:
        """Return the shape of least error; None if none holds the drive."""
        best: RatedFrameTables | None = None
        for shape in shapes:
            rated = self.rated(shape, float("inf") if best is None else best.max_error_lsb)
            best = rated if best is None or (rated and rated.max_error_lsb < best.max_error_lsb) else best
        return best

    def front(self, shapes: list[FrameShape], most_lsb: float) -> Iterator[RatedFrameTables]:
        """Yield, by memory, tables than which no smaller ones err less; none that err by far more than allowed."""
        least = _TIMES * most_lsb / _BETTER
        for shape in shapes:
            if rated := self.rated(shape, _BETTER * least):
                least = rated.max_error_lsb
                yield rated

    def _errors(self, program: FrameProgram, line: int, ticks: Ints) -> tuple[float, float]:
        """Return the largest error at ticks of a line in LSB, and the sum of the squares."""
        error = program.output.clamp(program.at(line, ticks)) - self._ideal(line)[ticks]
        return float(np.max(np.abs(error))), float(np.sum(error * error))


def _lengths(harmonics: int, default: int) -> list[int]:
    """Return the powers of two that hold harmonics, up to a multiple of the length by default."""
    least, most = max(_LEAST_LENGTH, 2 * (harmonics + 1)), _LONGER * default
    return [1 << power for power in range(most.bit_length()) if least <= 1 << power <= most]


class FrameTableChoice(Struct, frozen=True):
    """The tables that a build chose, and by what: a text."""

    shape: FrameShape
    reason: str


class CostLimit(Struct, frozen=True):
    """The most instructions that a sample may take on a processor, and what it takes with tables of each shape.

    ``costs`` has the shapes that hold the drive.
    """

    processor: ProcessorName
    most: float
    costs: dict[FrameShape, float]

    def __str__(self) -> str:
        return f"{self.most:g} instructions on {self.processor}"

    def within(self, shapes: list[FrameShape]) -> list[FrameShape]:
        """Return those shapes that take no more, in their order."""
        return [shape for shape in shapes if self.costs.get(shape, inf) <= self.most]

    def cheapest(self, search: FrameTableSearch, shapes: list[FrameShape], most_lsb: float) -> FrameShape | None:
        """Return the shape of fewest instructions that keeps an error, of equal ones the least memory; None if none."""
        for takes in sorted({*self.costs.values()}):
            if rated := search.smallest([shape for shape in shapes if self.costs.get(shape) == takes], most_lsb):
                return rated.shape
        return None


def is_chosen(table: Table, shaped: bool) -> bool:
    """Return True if a table of the scan file lets the build choose the tables at an angle, which are cubic."""
    return table.chosen_by_build and table.mode in (None, "auto", "cubic") and not shaped


def choose_frame_tables(
    search: FrameTableSearch, table: Table, limits: Limits, limit: CostLimit | None = None
) -> FrameTableChoice:
    """Return the tables of least memory that keep an error; about the least error if none does and none is written.

    Tables beyond the ``limit`` are left out.

    Raises
    ------
    Unphysical
        If none keeps the error that is written; if none keeps the limit, with the cheapest.
    """
    most, shapes = allowed_lsb(table, limits, shaped=False), search.shapes(table)
    allowed = shapes if limit is None else limit.within(shapes)
    also = "" if limit is None else f" and {limit}"
    if smallest := search.smallest(allowed, most):
        return FrameTableChoice(smallest.shape, f"the least memory within {most:g} LSB{also}")
    if limit is not None:
        _raise_if_too_dear(search, shapes, limit, most, f"keep {most:g} LSB within")
    if table.max_error_lsb is None and limits.max_error_lsb is None:
        if limit is not None and not allowed:
            _raise_if_too_dear(search, shapes, limit, inf, "keep")
        if best := search.best(allowed):
            near = search.smallest(allowed, best.max_error_lsb / _BETTER) or best
            error = at_least(best.max_error_lsb, 4)
            return FrameTableChoice(near.shape, f"the least memory within 5 % of the least error, {error} LSB{also}")
    best = search.best(shapes)
    if best is None:
        raise Unphysical("no tables of this length and width hold the drive of the frame; leave length and bits out")
    error = at_least(best.max_error_lsb, 4)
    raise Unphysical(f"no tables keep {most:g} LSB; the best, {best.shape}, err by up to {error} LSB; allow that much")


def _raise_if_too_dear(
    search: FrameTableSearch, shapes: list[FrameShape], limit: CostLimit, most_lsb: float, what: str
) -> None:
    """Raise with the cheapest shape, if any keeps an error."""
    cheapest = limit.cheapest(search, shapes, most_lsb)
    if cheapest is not None:
        raise Unphysical(
            f"no tables {what} the {limit.most:g} instructions for a sample on {limit.processor} of "
            f"cost.max_instructions; the cheapest, {cheapest}, take {limit.costs[cheapest]:g}; allow that many"
            + (", or a larger error" if most_lsb < inf else "")
        )
