"""The shape that a sequencer is compiled or synthesised for, and the names of its script and capture."""

from dataclasses import asdict, dataclass

from tablegen.emit.constants import DEGREES
from tablegen.fixedpoint.program import Program

SCRIPT, CAPTURE = "script.hex", "capture.hex"  # in the folder of a bench


@dataclass(frozen=True)
class SequencerShape:
    """The shape for which a sequencer is synthesised; the names are those of its parameters in lower case."""

    dac_bits: int
    x_interpolated: int
    x_index_bits: int
    x_word_bits: int
    y_interpolated: int
    y_index_bits: int
    y_word_bits: int

    @classmethod
    def of(cls, *programs: tuple[Program, Program]) -> "SequencerShape":
        """Return the smallest shape for programs of x and y, which have to agree on modes and widths."""
        return cls(
            programs[0][0].output.dac_bits,
            *_table(tuple(pair[0] for pair in programs)),
            *_table(tuple(pair[1] for pair in programs)),
        )

    def parameters(self) -> dict[str, int | str]:
        """Return the parameters of the Verilog."""
        return {name.upper(): value for name, value in asdict(self).items()}


def _table(programs: tuple[Program, ...]) -> tuple[int, int, int]:
    longest = max(len(program.words) for program in programs)
    return DEGREES[programs[0].mode], max((longest - 1).bit_length(), 2), programs[0].bits
