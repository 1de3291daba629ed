"""The compared quantities of an output with a slow part: an axis of a scan at an angle, or z."""

from collections.abc import Iterator

from tablegen.comparison.quantity import ComparedQuantity, digest
from tablegen.manifest.frame_fields import TurnedAxisFields


def frame_quantities(axis: str, fields: TurnedAxisFields) -> Iterator[ComparedQuantity]:
    """Yield the shares of both motions of an axis, and its tables, gains and ratios."""
    section, slow = f"{axis} tables", fields.slow
    yield ComparedQuantity(f"{axis} drive", "of the line", fields.fast_nm, "nm")
    yield ComparedQuantity(f"{axis} drive", "of the frame", fields.slow_nm, "nm")
    yield ComparedQuantity(section, "table of a line, words", len(fields.words))
    yield ComparedQuantity(section, "table of a line, bits a word", fields.bits)
    yield ComparedQuantity(section, "table of a line, content", digest(fields.words))
    yield ComparedQuantity(section, "second table, content", digest(fields.second))
    yield ComparedQuantity(section, "slow part, words", len(slow.words))
    yield ComparedQuantity(section, "slow part, content", digest(slow.words))
    yield ComparedQuantity(section, "slow part, gain word", slow.gain_word)
    yield ComparedQuantity(section, "slow part, offset word", slow.offset_word)
    for name, knots in (("gains", fields.gains), ("ratios", fields.ratios)):
        yield ComparedQuantity(section, f"{name}, lines apart", knots.spacing)
        yield ComparedQuantity(section, name, digest(knots.words))
