"""The data cache of a Cortex-M7, for boards in unicorn, which has none.

Processor and DMA see memories of their own from the moment that the cache is on; a line goes from one to the other only
when the firmware cleans or invalidates it, and a cleaned line arrives with the barrier (DSB) that follows. A real cache
writes lines back by itself at times, and does not wait for the barrier, neither of which can be relied upon.
"""

from typing import Any

import unicorn

from tablegen.verification.c.elf import Segment

LINE = 32
_CCR, _CCSIDR, _DCIMVAC, _DCISW, _DCCMVAC = 0xE000ED14, 0xE000ED80, 0xE000EF5C, 0xE000EF60, 0xE000EF68
_WAYS = 4
_DSB = bytes.fromhex("bff34f8f")


class DataCache:
    """A data cache of ``kilobytes`` in front of a RAM: its registers, and the memory that DMA sees."""

    def __init__(self, uc: Any, ram: tuple[int, int], kilobytes: int, segments: list[Segment]) -> None:
        """Watch the barriers in the segments of a program."""
        self._uc, (self._ram, self._size) = uc, ram
        self._sets = kilobytes * 1024 // LINE // _WAYS
        self._invalidated: set[int] = set()
        self._cleaned: dict[int, bytes] = {}  # lines that no barrier has followed
        self._seen_by_dma: bytearray | None = None  # from when the cache is on
        for segment in segments:
            at = segment.data.find(_DSB)
            while at >= 0:
                place = segment.load_address + at
                uc.hook_add(unicorn.UC_HOOK_CODE, self._barrier, begin=place, end=place)
                at = segment.data.find(_DSB, at + 1)

    def _barrier(self, *_: object) -> None:
        for line, data in self._cleaned.items():
            self._put(line, data)
        self._cleaned.clear()

    def _put(self, address: int, data: bytes) -> None:
        assert self._seen_by_dma is not None
        self._seen_by_dma[address - self._ram : address - self._ram + len(data)] = data

    def read(self, address: int) -> int | None:
        """Return the value of a register of the cache; None if it is none."""
        # Sets, ways, lines of 32 bytes.
        return (self._sets - 1) << 13 | (_WAYS - 1) << 3 | 1 if address == _CCSIDR else None

    def write(self, address: int, value: int) -> bool:
        """Write a register; True if it belongs to the maintenance of lines."""
        if address == _DCCMVAC:
            line = value & ~(LINE - 1)
            self._cleaned[line] = bytes(self._uc.mem_read(line, LINE))
        elif address == _DCIMVAC:
            line = value & ~(LINE - 1)
            assert self._seen_by_dma is not None
            self._uc.mem_write(line, bytes(self._seen_by_dma[line - self._ram : line - self._ram + LINE]))
        elif address == _DCISW:
            self._invalidated.add(value)
        else:
            if address == _CCR and value >> 16 & 1 and self._seen_by_dma is None:
                ways = {way << 30 | number << 5 for way in range(_WAYS) for number in range(self._sets)}
                assert self._invalidated == ways, "the data cache is not invalidated before it is on"
                self._seen_by_dma = bytearray(self._uc.mem_read(self._ram, self._size))
            return False
        return True

    def shared(self, address: int, size: int) -> int:
        """Return what DMA reads."""
        memory = self._seen_by_dma
        assert memory is not None, "the cache is off"
        assert self._ram <= address <= self._ram + self._size - size, "DMA reads outside of the RAM"
        return int.from_bytes(memory[address - self._ram : address - self._ram + size], "little")

    def store(self, address: int, value: int, size: int) -> None:
        """Write what DMA writes."""
        self._put(address, value.to_bytes(size, "little"))
