"""Coefficient files of AMD (Xilinx), which initialise block memories."""

from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.memory import Memory, memories


class Coe(Format):
    """The format coe: ``NAME_x.coe`` and so on, words as wide as the table, in hexadecimal."""

    name = "coe"
    purpose = "COE of each table for block memories of AMD (Xilinx): words in two's complement, radix 16"
    file_names = "NAME_*.coe"
    comment = ";"

    def files(self, content: Content) -> dict[str, bytes]:
        """Render one file a table."""
        return {f"{content.name}_{memory.name}.coe": _file(content, memory) for memory in memories(content)}


FORMAT = Coe()


def _file(content: Content, memory: Memory) -> bytes:
    words = ",\n".join(memory.hexadecimal())
    return (
        f"; {memory.described(content)}\n"
        f"memory_initialization_radix=16;\nmemory_initialization_vector=\n{words};\n".encode("ascii")
    )
