"""The C sequencer under the scripts of the Verilog one: compiled for this machine, run as a process."""

import re
import shlex
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tablegen.base.resources import c_runtime
from tablegen.emit.constants import DEGREES
from tablegen.fixedpoint.synthesis import sine_periods
from tablegen.numerics.arrays import Ints
from tablegen.verification.c.play import compile_line, run
from tablegen.verification.failures import ToolMissing
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import FAULTS, STATE_WORDS, Script, Words

_HERE = Path(__file__).parent
BENCH = (_HERE / "stream_bench.c", _HERE / "stream_bench.h")
OWN_SOURCES = (BENCH[0], _HERE / "stream_bench_host.c")
_SHAPE, _SINE = 5 << 60, 2 << 60 | 5 << 48
HASH_DIGITS = 64
CUBIC = DEGREES["cubic"]
OPTIONS = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Werror")


@dataclass(frozen=True)
class CRecord:
    """The record of a script: the ticks, the count of each fault, and the words of the states.

    ``constants`` are those of an emitted header that was compiled into the bench.
    """

    capture: Words
    counts: list[int]
    states: list[int] = field(default_factory=list)
    constants: list[int] = field(default_factory=list)

    @classmethod
    def of(cls, capture: Words, script: str, constants: int = 0) -> "CRecord":
        """Split what the bench wrote while it played a script: ticks, then counts, states, constants.

        Parameters
        ----------
        capture
            Words of 64 bits, shape (n,).
        script
            Text of the script.
        constants
            Number of the words of constants.

        Returns
        -------
        CRecord
            Its ``capture`` has the shape (ticks,).
        """
        states = STATE_WORDS * len(re.findall(r"^6", script, re.MULTILINE))
        ticks = len(capture) - len(FAULTS) - states - constants
        tail = capture[ticks:].astype(np.int64).tolist()
        counted, reported = len(FAULTS), len(FAULTS) + states
        return cls(capture[:ticks], tail[:counted], tail[counted:reported], tail[reported:])


def storage_bits(bits: int) -> int:
    """Return the bits in which the C runtime stores table or converter words of so many bits."""
    return 16 if bits <= 16 else 32


def defines(shape: SequencerShape, fill: int = 0) -> dict[str, int]:
    """Return the macros of a firmware for programs of a shape; with ``fill``, at most that many ticks a call."""
    macro_values = {
        "DAC_REQUESTS": 128,
        "DAC_TABLE_STORAGE_BITS": storage_bits(max(shape.x_word_bits, shape.y_word_bits)),
        "DAC_OUTPUT_STORAGE_BITS": storage_bits(shape.dac_bits),
    }
    if CUBIC in (shape.x_interpolated, shape.y_interpolated):
        macro_values["DAC_SPLINE"] = 1
    return macro_values | ({"BENCH_FILL": fill} if fill else {})


def constants_written(macro_values: Mapping[str, int] | None) -> int:
    """Return how many numbers of its header a bench writes: its constants, and its hash."""
    constants = (macro_values or {}).get("BENCH_CONSTANTS")
    return 0 if constants is None else constants + HASH_DIGITS


def script_words(script: Script, shape: SequencerShape, sine: Ints | None = None) -> str:
    """Format a script for the C bench: shape, codes at power-up, the sine table if it is needed, commands.

    Parameters
    ----------
    sine
        Words with 30 fraction bits, shape (n,): see ``sine_periods``.

    Returns
    -------
    str
        A word of 16 hexadecimal digits a line.
    """
    x_index, y_index = (
        getattr(shape, f"{axis}_index_bits") if getattr(shape, f"{axis}_interpolated") else 0 for axis in "xy"
    )
    word = shape.dac_bits | shape.x_word_bits << 5 | x_index << 10 | shape.y_word_bits << 15 | y_index << 20
    word |= (shape.x_interpolated == CUBIC) << 25 | (shape.y_interpolated == CUBIC) << 26
    first = [_SHAPE | word, script.power_up[0] | script.power_up[1] << 24]
    if sine is not None:
        first += [_SINE | at << 32 | int(value) & 0xFFFFFFFF for at, value in enumerate(sine)]
    return "".join(f"{value:016x}\n" for value in first) + script.text()


def sine_of(shape: SequencerShape) -> Ints:
    """Return the sine table from which the runtime renders tables of a shape.

    Returns
    -------
    Words of the table, shape (entries,).
    """
    return sine_periods(max(shape.x_index_bits, shape.y_index_bits))


def require_compiler(compiler: str) -> list[str]:
    """Return the words of a compiler's command.

    Raises
    ------
    ToolMissing
        If no command has that name.
    """
    try:
        command = shlex.split(compiler)
    except ValueError:
        command = []
    if not command or shutil.which(command[0]) is None:
        raise ToolMissing(f"{command[0] if command else compiler} is not installed: apt-get install gcc, or set CC")
    return command


def macros(macro_values: Mapping[str, int]) -> list[str]:
    """Return macros as words of a compiler's command."""
    return [f"-D{name}={value}" for name, value in macro_values.items()]


class CBench:
    """The bench, compiled once for programs of one shape."""

    def __init__(
        self,
        shape: SequencerShape,
        folder: Path,
        compiler: str = "cc",
        options: Sequence[str] = OPTIONS,
        sources: Sequence[Path] | None = None,
        fill: int = 0,
        macro_values: Mapping[str, int] | None = None,
    ) -> None:
        """Compile the bench; ``sources`` replace the shipped runtime, ``macro_values`` those that suit the shape."""
        runtime = list(c_runtime() if sources is None else sources)
        folder.mkdir(parents=True, exist_ok=True)
        self.shape, self.program = shape, folder / "stream_bench"
        self._constants = constants_written(macro_values)
        choices = macros(defines(shape, fill) if macro_values is None else macro_values)
        places = [f"-I{place}" for place in sorted({str(path.parent.absolute()) for path in (*runtime, *BENCH)})]
        parts = [str(path.absolute()) for path in runtime if path.suffix == ".c"]
        line = [*require_compiler(compiler), *options, *choices, *places, *parts, *map(str, OWN_SOURCES)]
        compile_line([*line, "-o", str(self.program)])

    def play(self, script: Script, fourier: bool = False) -> CRecord:
        """Run a script; raises ``SimulationFailed`` where the bench ends before its script."""
        return self.run(script_words(script, self.shape, sine_of(self.shape) if fourier else None))

    def run(self, words: str, timeout: float | None = None) -> CRecord:
        """Play a script in the form of ``script_words``; a bench fails that takes longer than ``timeout`` seconds."""
        written = run(self.program, words.encode("ascii"), timeout)
        return CRecord.of(np.frombuffer(written, dtype="<u8"), words, self._constants)
