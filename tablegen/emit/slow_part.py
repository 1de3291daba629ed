"""The slow part of an axis as C objects, for ``DAC_SLOW_AXIS_PROGRAM`` of a runtime with ``DAC_SLOW_PART``."""

import numpy as np

from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.spline import WORDS_BEHIND

_IN_ROW = 12


def slow_part_text(prefix: str, axis: FrameProgram) -> str:
    """Return C that defines ``PREFIX_slow_part`` and its words; ``dac_sequencer.h`` has to be included before.

    A second table of zeros is left out: then nothing is mixed, and no memory is taken for it.
    """
    table = axis.slow.words.tolist()
    mixes = bool(np.any(axis.second))
    objects = [_array("int32_t", f"{prefix}_gains", axis.gains.words.tolist())]
    if mixes:
        objects += [
            _array("int16_t", f"{prefix}_ratios", axis.ratios.words.tolist()),
            _array("int8_t", f"{prefix}_second", axis.second.tolist()),
            f"static dac_word {prefix}_mixed[{len(axis.second)} + DAC_WORDS_BEHIND];\n",
        ]
    objects.append(_array("dac_word", f"{prefix}_slow", [*table, *table[:WORDS_BEHIND]]))
    pointers = [f"{prefix}_{name}" if mixes else "NULL" for name in ("ratios", "second", "mixed")]
    words = ", ".join([f"{prefix}_gains", *pointers, f"{prefix}_slow"])
    numbers = ", ".join(
        str(value)
        for value in (
            axis.gains.spacing, axis.ratios.spacing, len(axis.gains.words), len(axis.ratios.words),
            len(table).bit_length() - 1, axis.slow.gain_word,
        )
    )  # fmt: skip
    offset = f"INT64_C({axis.slow.offset_word})"
    objects.append(f"const dac_slow_part {prefix}_slow_part = {{\n    {words},\n    {numbers}, {offset},\n}};\n")
    return "\n".join(objects)


def _array(kind: str, name: str, values: list[int]) -> str:
    rows = [", ".join(map(str, values[at : at + _IN_ROW])) for at in range(0, len(values), _IN_ROW)]
    body = ",\n    ".join(rows)
    return f"static const {kind} {name}[{len(values)}] = {{\n    {body},\n}};\n"
