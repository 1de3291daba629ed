"""The choice of the table of an axis: the one that is written, or the least memory that keeps an error."""

from typing import TYPE_CHECKING, cast

from msgspec import Struct

from tablegen.base.figures import at_least
from tablegen.base.input_errors import Unphysical
from tablegen.config.schema import DEFAULT_BITS, Cost, Limits, Table
from tablegen.fixedpoint.program import Mode
from tablegen.fixedpoint.table_shape import LEAST_BITS, LEAST_LENGTH, MODES, MOST_BITS, MOST_LENGTH, TableShape
from tablegen.planning.feasibility import DEFAULT_LENGTH

if TYPE_CHECKING:
    from tablegen.planning.table_search import TableSearch

# A code is rounded by up to 1/2 LSB whatever the table is. With as much again for the table, what is played is one of
# the two codes next to the ideal one.
DEFAULT_ERROR_LSB = 1.0
# Of shaped output the table's own error, before the rounding that is shaped: little beside what shaping leaves.
DEFAULT_SHAPED_ERROR_LSB = 0.01


class TableRequest(Struct, frozen=True):
    """The request for a table that the build chooses: the worst error, and the keys that are free.

    For ``shaped`` output it is the error before the rounding. ``cost`` is there if instructions are limited too.
    """

    max_error_lsb: float
    free: tuple[str, ...]
    shaped: bool = False
    cost: Cost | None = None

    def __str__(self) -> str:
        return f"the least memory within {self.max_error_lsb:g} LSB{' before the rounding' if self.shaped else ''}" + (
            "" if self.cost is None else f" and {self.cost.max_instructions:g} instructions on {self.cost.processor}"
        )


def table_request(table: Table, limits: Limits, shaped: bool, cost: Cost | None = None) -> TableRequest | None:
    """Return the request for a table; None where the scan file gives the whole table."""
    if not table.chosen_by_build:
        return None
    written = {"mode": table.mode not in (None, "auto"), "length": table.length, "bits": table.bits}
    free = tuple(key for key, value in written.items() if not value)
    limited = None if cost is None or cost.max_instructions is None else cost
    return TableRequest(allowed_lsb(table, limits, shaped), free, shaped, limited)


def allowed_lsb(table: Table, limits: Limits, shaped: bool) -> float:
    """Return the worst error of a table that the build chooses, in LSB; for shaped output before the rounding."""
    if table.max_error_lsb is not None:
        return table.max_error_lsb
    if shaped:
        return DEFAULT_SHAPED_ERROR_LSB
    return min(DEFAULT_ERROR_LSB, limits.max_error_lsb or DEFAULT_ERROR_LSB)


def written_shape(table: Table, period: int) -> TableShape:
    """Return the shape that is written, or its defaults, for ``period`` advances."""
    mode = cast(Mode, "interpolated" if table.mode in (None, "auto") else table.mode)
    length = period if mode == "direct" else table.length or DEFAULT_LENGTH[mode]
    return TableShape(mode, length, table.bits or DEFAULT_BITS)


def possible_shapes(table: Table, period: int, harmonics: int) -> list[TableShape]:
    """Return every shape that carries the harmonics and agrees with the keys of a table."""
    modes = MODES if table.mode in (None, "auto") else (cast(Mode, table.mode),)
    return [
        TableShape(mode, length, bits)
        for mode in modes
        for length in _lengths(table, mode, period, harmonics, only_mode=len(modes) == 1)
        for bits in (range(LEAST_BITS, MOST_BITS[mode] + 1) if table.bits is None else (table.bits,))
        if bits <= MOST_BITS[mode]
    ]


def _lengths(table: Table, mode: Mode, period: int, harmonics: int, only_mode: bool) -> list[int]:
    """Return powers of two that carry the harmonics; in ``direct`` mode a word for each advance.

    Not every device can address as many as ``direct`` takes: such a table counts only if it is the ``only_mode``.
    """
    if mode == "direct":
        fits = table.length in (None, period) and (only_mode or LEAST_LENGTH <= period <= MOST_LENGTH[mode])
        return [period] if fits else []
    powers = range(MOST_LENGTH[mode].bit_length())
    lengths = [1 << power for power in powers] if table.length is None else [table.length]
    return [length for length in lengths if length >= LEAST_LENGTH and harmonics <= length // 2 - 1]


def choose(search: "TableSearch", shapes: list[TableShape], max_error_lsb: float) -> TableShape:
    """Return the table of least memory that keeps an error.

    Raises
    ------
    Unphysical
        If no table keeps it; the message has the least error of any table.
    """
    smallest = search.smallest(shapes, max_error_lsb)
    if smallest is None:
        best = search.best(shapes)
        raise Unphysical(
            f"no table keeps {max_error_lsb:g} LSB; the best, {best.shape}, errs by up to "
            f"{at_least(best.max_error_lsb, 4)} LSB; allow that much"
        )
    return smallest
