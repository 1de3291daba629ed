"""Intel HEX: one file a table, for programmers of flash and EEPROM, and for loaders of memory."""

from collections.abc import Iterator

from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.memory import memories

_DATA, _END, _UPPER_ADDRESS = 0, 1, 4
_RECORD_BYTES = 16


class IntelHex(Format):
    """The format hex: ``NAME_x.hex`` and so on, every file from address 0."""

    name = "intel-hex"
    purpose = "Intel HEX of each table: words of 1, 2 or 4 bytes, the least significant first"
    file_names = "NAME_*.hex"

    def files(self, content: Content) -> dict[str, bytes]:
        """Render one file a table."""
        return {
            f"{content.name}_{memory.name}.hex": "".join(_records(memory.raw())).encode("ascii")
            for memory in memories(content)
        }


FORMAT = IntelHex()


def _records(data: bytes) -> Iterator[str]:
    """Yield the lines of a file: data with addresses from 0, a record for each further 64 KiB, the end."""
    for address in range(0, len(data), _RECORD_BYTES):
        if address and address % 0x10000 == 0:
            yield _record(_UPPER_ADDRESS, 0, (address >> 16).to_bytes(2, "big"))
        yield _record(_DATA, address & 0xFFFF, data[address : address + _RECORD_BYTES])
    yield _record(_END, 0, b"")


def _record(kind: int, address: int, data: bytes) -> str:
    """Write a line: length, address, kind, data, and the byte that makes the sum of all 0."""
    content = bytes([len(data)]) + address.to_bytes(2, "big") + bytes([kind]) + data
    return f":{content.hex().upper()}{-sum(content) & 0xFF:02X}\n"
