"""A format of its own for tablegen: constants and tables as a Rust module without ``std``.

It is an entry point of the group ``tablegen.formats`` in ``pyproject.toml``. Once it is installed, ``tablegen formats``
lists it, ``tablegen build -f rust`` writes it, and ``tablegen verify`` makes it again from the manifest and compares.
"""

from collections.abc import Iterator

from tablegen.emit.constants import is_wide, scan_constants
from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.memory import Memory, memories
from tablegen.emit.templates import comment_safe

_NAMES = {
    "x": "X_TABLE",
    "x_fourier": "X_FOURIER",
    "y": "Y_TABLE",
    "y_fourier": "Y_FOURIER",
    "program": "PROGRAM_REGISTERS",
    "sine": "SINE_QUARTER",
}
_WORDS_A_ROW = 10


class Rust(Format):
    """``NAME.rs``."""

    name = "rust"
    purpose = "Rust module: constants, and tables as arrays"
    file_names = "NAME.rs"
    comment = "//"  # lines at the beginning of the file that no manifest has, and no check compares

    def files(self, content: Content) -> dict[str, bytes]:
        """The module. The same content gives the same bytes: no dates, no paths, no order that changes."""
        return {f"{content.name}.rs": "\n".join(_lines(content)).encode("ascii")}


FORMAT = Rust()


def _lines(content: Content) -> Iterator[str]:
    yield f"// {content.name}: compensated scan waveforms, made by tablegen {content.version}. Do not edit."
    yield f"// Scanner: {comment_safe(content.scanner)}"
    yield ""
    yield f'pub const HASH: &str = "{content.hash}";'
    for name, value in scan_constants(content).items():
        yield f"pub const {name}: {'i64' if is_wide(name) else 'i32'} = {value};"
    for memory in memories(content):
        yield ""
        yield f"/// {memory.described(content)}"
        yield f"pub static {_NAMES[memory.name]}: [{_type(memory)}; {len(memory.words)}] = ["
        for first in range(0, len(memory.words), _WORDS_A_ROW):
            yield "    " + " ".join(f"{word}," for word in memory.words[first : first + _WORDS_A_ROW])
        yield "];"
    yield ""


def _type(memory: Memory) -> str:
    """The type of words of up to 32 bits; registers are unsigned."""
    return f"{'u' if memory.name == 'program' else 'i'}{8 * memory.word_bytes}"
