"""Raw bytes: one file a table."""

from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.memory import memories


class Bin(Format):
    """The format bin: ``NAME_x.bin`` and so on, words and nothing else."""

    name = "bin"
    purpose = "raw bytes of each table: words of 1, 2 or 4 bytes, the least significant first"
    file_names = "NAME_*.bin"

    def files(self, content: Content) -> dict[str, bytes]:
        """Render one file a table."""
        return {f"{content.name}_{memory.name}.bin": memory.raw() for memory in memories(content)}


FORMAT = Bin()
