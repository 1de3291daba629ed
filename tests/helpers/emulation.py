"""Whole firmware under unicorn, in this process: boards made of hooks, interrupts made by hand.

Unicorn has neither the interrupt controller of a Cortex-M nor a return from an exception. An interrupt is therefore a
call: a frame of eight words is made on the stack as the processor does, the handler runs until it returns to an address
where nothing else is, and all registers are put back.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import unicorn
from numpy.random import Generator
from unicorn import arm_const

from tablegen.verification.c.elf import read_executable

_FLASH_SIZE = _RAM_SIZE = 1 << 22
_RAM, _DEVICES, _PRIVATE = 0x20000000, 0x40000000, 0xE000E000
_TRAP = _FLASH_SIZE - 16
_FRAME = 32  # bytes
_WHOLE = 1 << 20  # instructions: more than a handler has. Without a count unicorn would forget what it has translated
_SOON = 16  # interrupts in a handler: fewer than half a buffer lasts
_ICSR, _PENDSV, _SYST_CSR = 0xD04, 1 << 28, 0x010
PENDSV_VECTOR, SYSTICK_VECTOR = 14, 15
Device = tuple[Callable[[int], int], Callable[[int, int], None]]


class Uarts:
    """The two UARTs of a board: characters to the console, and what it and the log have put out."""

    def __init__(self) -> None:
        self.to_console = bytearray()
        self.console = bytearray()
        self.log = bytearray()


class Pl011Board:
    """LM3S6965: PL011 UARTs 0 and 1, SysTick."""

    machine, name, model = "lm3s6965evb", "lm3s6965evb", arm_const.UC_CPU_ARM_CORTEX_M3
    timer, uart = SYSTICK_VECTOR, 16 + 5

    def __init__(self) -> None:
        self.uarts = Uarts()
        self.timer_runs = False

    def read(self, offset: int) -> int:
        """A register of a device."""
        if offset == 0xC000 and self.uarts.to_console:
            return self.uarts.to_console.pop(0)
        if offset == 0xC018:
            return 0 if self.uarts.to_console else 1 << 4
        return 0

    def write(self, offset: int, value: int) -> None:
        """To a register of a device."""
        if offset == 0xC000:
            self.uarts.console.append(value)
        elif offset == 0xD000:
            self.uarts.log.append(value)


class CmsdkBoard:
    """MPS2 with AN386: CMSDK UARTs 0 and 1, timer 0."""

    machine, name, model = "mps2-an386", "mps2_an386", arm_const.UC_CPU_ARM_CORTEX_M4
    timer, uart = 16 + 8, 16

    def __init__(self) -> None:
        self.uarts = Uarts()
        self.timer_runs = False

    def read(self, offset: int) -> int:
        """A register of a device."""
        if offset == 0x4000 and self.uarts.to_console:
            return self.uarts.to_console.pop(0)
        if offset == 0x4004:
            return 2 if self.uarts.to_console else 0
        return 0

    def write(self, offset: int, value: int) -> None:
        """To a register of a device."""
        if offset == 0 and value & 1:
            self.timer_runs = True
        if offset == 0x4000:
            self.uarts.console.append(value)
        elif offset == 0x5000:
            self.uarts.log.append(value)


BOARDS = (Pl011Board, CmsdkBoard)


class Firmware:
    """An executable on a board, from reset on. ``rng`` decides after how many instructions each interrupt comes."""

    def __init__(self, board: Pl011Board | CmsdkBoard, executable: Path, rng: Generator) -> None:
        self.board, self._rng = board, rng
        self._uc = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self._uc.ctl_set_cpu_model(board.model)
        self._uc.mem_map(0, _FLASH_SIZE)
        self._uc.mem_map(_RAM, _RAM_SIZE)
        self._pended = False

        def private_write(uc: object, offset: int, size: int, value: int, data: object) -> None:
            self._pended |= offset == _ICSR and bool(value & _PENDSV)
            if offset == _SYST_CSR and value & 1:
                board.timer_runs = True

        self._uc.mmio_map(
            _DEVICES, 0x100000,
            lambda uc, offset, size, data: board.read(offset), None,
            lambda uc, offset, size, value, data: board.write(offset, value), None,
        )  # fmt: skip
        self._uc.mmio_map(_PRIVATE, 0x1000, lambda uc, offset, size, data: 0, None, private_write, None)
        for segment in read_executable(executable).segments:
            self._uc.mem_write(segment.load_address, segment.data)
        self._set(arm_const.UC_ARM_REG_SP, self._word(0))
        self._pc = self._word(4) & ~1

    def _word(self, address: int) -> int:
        return int.from_bytes(self._uc.mem_read(address, 4), "little")

    def _set(self, register: int, value: int) -> None:
        self._uc.reg_write(register, value)

    def run(self, instructions: int, until: int = _TRAP) -> bool:
        """So many instructions; True if it came to ``until`` instead."""
        self._uc.emu_start(self._pc | 1, until, count=instructions)
        self._pc = self._uc.reg_read(arm_const.UC_ARM_REG_PC)
        return bool(self._pc == until)

    def interrupt(self, vector: int, preempted: Callable[[], None] | None = None) -> None:
        """Run a handler; with ``preempted`` it is left alone for some instructions at a time."""
        before: Any = self._uc.context_save()
        pc, sp = self._pc, self._uc.reg_read(arm_const.UC_ARM_REG_SP)
        frame = (sp - _FRAME) & ~7
        self._uc.mem_write(frame, b"\xee" * _FRAME)
        self._set(arm_const.UC_ARM_REG_SP, frame)
        self._set(arm_const.UC_ARM_REG_LR, _TRAP | 1)
        self._set(arm_const.UC_ARM_REG_XPSR, 0x01000000)
        self._pc = self._word(4 * vector) & ~1
        times = 0
        while not self.run(int(self._rng.integers(300, 1500)) if preempted and times < _SOON else _WHOLE):
            if preempted:
                preempted()
            times += 1
        self._uc.context_restore(before)
        self._pc = pc

    def boot(self) -> None:
        """From reset until the timer runs."""
        while not self.board.timer_runs:
            self.run(1000)

    def tick(self, instructions: int) -> None:
        """Some of the main loop, a character if one waits for the console, and a sample."""
        self.run(instructions)
        if self.board.uarts.to_console:
            self.interrupt(self.board.uart)
        self.interrupt(self.board.timer)
        if self._pended:
            self._pended = False
            self.interrupt(PENDSV_VECTOR, lambda: self.interrupt(self.board.timer))

    def send(self, line: str) -> None:
        """A line to the console."""
        self.board.uarts.to_console += line.encode() + b"\n"

    @property
    def samples(self) -> list[str]:
        """The whole lines of the log so far."""
        return self.board.uarts.log.decode("ascii").split("\n")[:-1]

    @property
    def console(self) -> list[str]:
        """The whole lines of the console so far."""
        return self.board.uarts.console.decode("ascii").split("\n")[:-1]
