"""A board with a Cortex-M in unicorn: its processor, interrupts by level, priority and enable, and its serial line.

A board of tests is one of these with a model of the peripherals that its firmware uses. Instructions take ``cycles`` of
the processor each; after ``SLICE`` of them the peripherals do what they do in that time.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import unicorn
from unicorn import arm_const

from tablegen.verification.c.elf import read_executable

SLICE = 40  # instructions between two looks at the peripherals
FLASH, PRIVATE = 0x08000000, 0xE000E000
_SIZE = 1 << 20
_FRAME = 32  # bytes that an interrupt puts on the stack
_THREAD = 256  # below every priority


class CortexBoard:
    """The far end of a ``link_line.Line``. ``words`` are what the converters were given on each tick."""

    def __init__(
        self,
        executable: Path,
        core: int,
        cycles: float,
        ram: tuple[int, int],
        devices: Mapping[int, int],
        flash: int = FLASH,
        vectors: int = 0,
    ) -> None:
        """Load firmware: RAM and devices are start and size; ``core`` is one of unicorn's numbers.

        The flash begins at ``flash``, and the vector table ``vectors`` bytes after that.
        """
        self.words: list[tuple[int, int]] = []
        self.registers: dict[int, int] = {}  # by address; one without a meaning here keeps what is written
        self.longest: dict[int, int] = {}  # instructions, by interrupt
        self.now = 0.0  # in cycles of the processor
        self.byte_cycles = 0.0
        self._vectors, self._trap = flash + vectors, flash + _SIZE - 16
        self._cycles = cycles
        self._enabled = 0
        self._priority: dict[int, int] = {}
        self._active = _THREAD
        self._arriving = bytearray()
        self._next_byte = 0.0
        self._sent = bytearray()
        self.uc = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self.uc.ctl_set_cpu_model(core)
        self.uc.mem_map(flash, _SIZE)
        self.uc.mem_map(*ram)
        for start, size in devices.items():
            self._map(start, size)
        for segment in read_executable(executable).segments:
            self.uc.mem_write(segment.load_address, segment.data)
        self.uc.reg_write(arm_const.UC_ARM_REG_SP, self.word(self._vectors))
        self._pc = self.word(self._vectors + 4) & ~1

    def _map(self, start: int, size: int) -> None:
        def read(uc: object, offset: int, size: int, data: object) -> int:
            return self.read(start + offset, size)

        def write(uc: object, offset: int, size: int, value: int, data: object) -> None:
            self.write(start + offset, size, value)

        self.uc.mmio_map(start, size, read, None, write, None)

    # FarEnd

    def receive(self, data: bytes) -> None:
        """Bytes that leave the host; they arrive one by one, at the board's baud rate."""
        if not self._arriving:
            self._next_byte = max(self._next_byte, self.now) + self.byte_cycles
        self._arriving += data

    def transmit(self) -> bytes:
        """What the UART has sent."""
        sent = bytes(self._sent)
        self._sent.clear()
        return sent

    def tick(self, ticks: int) -> None:
        """As many samples, once there are any."""
        until = len(self.words) + ticks
        while len(self.words) < until:
            assert not self._run(SLICE), "main() has returned"
            self._pass()

    def reboot(self) -> None:
        """There is no reset in this emulation."""
        raise NotImplementedError

    # What a board has of its own

    def read(self, address: int, size: int) -> int:
        """Read a register."""
        return self.registers.get(address, 0)

    def write(self, address: int, size: int, value: int) -> None:
        """Write a register."""
        self.registers[address] = value

    def pass_time(self) -> None:
        """Do what the peripherals do up to ``now``."""
        raise NotImplementedError

    def take_byte(self, byte: int, end: float) -> None:
        """Take a byte from the serial line, whose last bit came at ``end``."""
        raise NotImplementedError

    def asking(self) -> Mapping[int, bool]:
        """Return which interrupts are requested."""
        raise NotImplementedError

    # For boards

    def send(self, byte: int) -> None:
        """Send a byte on the serial line."""
        self._sent.append(byte)

    def write_private(self, address: int, size: int, value: int) -> None:
        """Write to the interrupt controller."""
        offset = address - PRIVATE
        if 0x100 <= offset < 0x120:
            self._enabled |= value << 8 * (offset - 0x100)
        elif 0x400 <= offset < 0x500:
            assert size == 1
            self._priority[offset - 0x400] = value

    def word(self, address: int) -> int:
        """Return a word that the processor sees in memory."""
        return int.from_bytes(self.uc.mem_read(address, 4), "little")

    # Time

    def _pass(self) -> None:
        """What the peripherals do in the time of a slice, and the interrupts that follow."""
        self.now += SLICE * self._cycles
        while self._arriving and self.now >= self._next_byte:
            self.take_byte(self._arriving.pop(0), self._next_byte)
            self._next_byte += self.byte_cycles
        self.pass_time()
        while (asked := self._asked()) is not None:
            self._interrupt(*asked)

    def _asked(self) -> tuple[int, int] | None:
        """The interrupt that comes now, and its priority."""
        asking = [(self._priority.get(n, 0), n) for n, asks in self.asking().items() if asks and self._enabled >> n & 1]
        if not asking or min(asking)[0] >= self._active:
            return None
        priority, number = min(asking)
        return number, priority

    def _interrupt(self, number: int, priority: int) -> None:
        before: Any = self.uc.context_save()
        pc, active = self._pc, self._active
        frame = (self.uc.reg_read(arm_const.UC_ARM_REG_SP) - _FRAME) & ~7
        self.uc.mem_write(frame, b"\xee" * _FRAME)
        self.uc.reg_write(arm_const.UC_ARM_REG_SP, frame)
        self.uc.reg_write(arm_const.UC_ARM_REG_LR, self._trap | 1)
        self.uc.reg_write(arm_const.UC_ARM_REG_XPSR, 0x01000000)
        self._pc, self._active = self.word(self._vectors + 4 * (16 + number)) & ~1, priority
        instructions = SLICE
        while not self._run(SLICE):
            self._pass()
            instructions += SLICE
        self.longest[number] = max(self.longest.get(number, 0), instructions)
        self.uc.context_restore(before)
        self._pc, self._active = pc, active

    def _run(self, instructions: int) -> bool:
        """So many instructions; True if a handler returned."""
        self.uc.emu_start(self._pc | 1, self._trap, count=instructions)
        self._pc = self.uc.reg_read(arm_const.UC_ARM_REG_PC)
        return bool(self._pc == self._trap)
