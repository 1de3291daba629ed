"""Memory initialization files of Intel (Altera)."""

from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.memory import Memory, memories


class Mif(Format):
    """The format mif: ``NAME_x.mif`` and so on, words as wide as the table, in hexadecimal."""

    name = "mif"
    purpose = "MIF of each table for block memories of Intel (Altera): words in two's complement, radix 16"
    file_names = "NAME_*.mif"
    comment = "--"

    def files(self, content: Content) -> dict[str, bytes]:
        """Render one file a table."""
        return {f"{content.name}_{memory.name}.mif": _file(content, memory) for memory in memories(content)}


FORMAT = Mif()


def _file(content: Content, memory: Memory) -> bytes:
    words = "".join(f"{address:04X} : {word.upper()};\n" for address, word in enumerate(memory.hexadecimal()))
    return (
        f"-- {memory.described(content)}\n\n"
        f"WIDTH={memory.bits};\nDEPTH={len(memory.words)};\nADDRESS_RADIX=HEX;\nDATA_RADIX=HEX;\n"
        f"CONTENT BEGIN\n{words}END;\n".encode("ascii")
    )
