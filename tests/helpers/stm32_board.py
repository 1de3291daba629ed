"""An STM32F407 with the firmware of ``examples/firmware/stm32``: unicorn, and a model of the peripherals that it uses.

These are RCC, TIM6, the DAC, USART 3, two streams of DMA 1, and interrupts by level, priority and enable, written from
ST's RM0090. What the firmware does not use is not there: a register without a meaning here keeps what is written.
QEMU has neither DMA nor DAC of this part. Instructions take ``CYCLES`` each, so that rates are those of a real one.
"""

from pathlib import Path
from typing import Any

import unicorn
from unicorn import arm_const

from tablegen.verification.c.elf import read_executable

CYCLES = 1.5  # of the processor, an instruction, with the wait states of its flash
_CORE_HZ, _TIMER_HZ, _UART_HZ = 168_000_000, 84_000_000, 42_000_000
_FLASH, _RAM, _DEVICES, _PRIVATE = 0x08000000, 0x20000000, 0x40000000, 0xE000E000
_SIZE = 1 << 20
_TRAP = _FLASH + _SIZE - 16
_FRAME = 32  # bytes that an interrupt puts on the stack
_SLICE = 40  # instructions between two looks at the peripherals
_THREAD = 256  # below every priority
# Offsets from _DEVICES.
_TIM6_CR1, _TIM6_ARR, _DAC_CR, _DHR12RD = 0x1000, 0x102C, 0x7400, 0x7420
_USART_SR, _USART_DR, _USART_BRR, _USART_CR1, _USART_CR3 = 0x4800, 0x4804, 0x4808, 0x480C, 0x4814
_RCC_CR, _RCC_CFGR = 0x23800, 0x23808
_LISR, _HISR, _LIFCR, _HIFCR = 0x26000, 0x26004, 0x26008, 0x2600C
_HALF, _COMPLETE = 1 << 10, 1 << 11  # of streams 1 and 5, in the status of their half
_IDLE, _RXNE, _TXE = 1 << 4, 1 << 5, 1 << 7


class _Stream:
    """A stream of DMA in circular mode; ``at`` is its CR, ``status`` the register that has its flags."""

    def __init__(self, board: "Stm32Board", at: int, status: int, channel: int, peripheral: int) -> None:
        self._board, self._at, self._status = board, at, status
        self._must = channel << 25 | 1 << 10 | 1 << 8  # the channel, memory counts up, circular
        self._peripheral = _DEVICES + peripheral
        self.size = 0

    def start(self) -> None:
        """CR was written with its enable."""
        registers = self._board.registers
        assert registers[self._at] & self._must == self._must
        assert registers[self._at] >> 25 & 7 == self._must >> 25
        assert registers[self._at + 8] == self._peripheral
        self.size = registers[self._at + 4]

    @property
    def runs(self) -> bool:
        return bool(self._board.registers.get(self._at, 0) & 1)

    def next_address(self, bytes_each: int) -> int:
        """Where the next item goes, or comes from; it is counted."""
        registers = self._board.registers
        left = registers[self._at + 4]
        address = registers[self._at + 12] + (self.size - left) * bytes_each
        left -= 1
        if left == self.size // 2:
            registers[self._status] = registers.get(self._status, 0) | _HALF
        if left == 0:
            registers[self._status] = registers.get(self._status, 0) | _COMPLETE
            left = self.size
        registers[self._at + 4] = left
        return address

    @property
    def asks(self) -> bool:
        """For its interrupt."""
        control, status = (self._board.registers.get(at, 0) for at in (self._at, self._status))
        return bool((control >> 3 & 1 and status & _HALF) or (control >> 4 & 1 and status & _COMPLETE))


class Stm32Board:
    """The far end of a ``link_line.Line``. ``words`` are what the DAC was given on each tick."""

    def __init__(self, executable: Path) -> None:
        self.words: list[tuple[int, int]] = []
        self.registers: dict[int, int] = {}
        self.longest = 0  # instructions of the interrupt that fills half a buffer
        self._to_play = _Stream(self, 0x26088, _HISR, 7, _DHR12RD)
        self._received = _Stream(self, 0x26028, _LISR, 4, _USART_DR)
        self._enabled = 0
        self._priority: dict[int, int] = {}
        self._active = _THREAD
        self._now = 0.0  # in cycles of the processor
        self._next_tick = self._next_byte = self._sent_at = self._rests_at = 0.0
        self._arriving = bytearray()
        self._sent = bytearray()
        self._status = 0  # of the USART, but for TXE
        self._status_read = False
        self._uc = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self._uc.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M4)
        self._uc.mem_map(_FLASH, _SIZE)
        self._uc.mem_map(_RAM, 112 << 10)
        self._uc.mmio_map(_DEVICES, 0x40000, self._read, None, self._write, None)
        self._uc.mmio_map(_PRIVATE, 0x1000, lambda *_: 0, None, self._write_private, None)
        for segment in read_executable(executable).segments:
            self._uc.mem_write(segment.load_address, segment.data)
        self._uc.reg_write(arm_const.UC_ARM_REG_SP, self._word(_FLASH))
        self._pc = self._word(_FLASH + 4) & ~1

    # FarEnd

    def receive(self, data: bytes) -> None:
        """Bytes that leave the host; they arrive one by one, at the board's baud rate."""
        if not self._arriving:
            self._next_byte = max(self._next_byte, self._now) + self._byte_cycles
        self._arriving += data

    def transmit(self) -> bytes:
        """What the USART has sent."""
        sent = bytes(self._sent)
        self._sent.clear()
        return sent

    def tick(self, ticks: int) -> None:
        """As many samples, once there are any."""
        until = len(self.words) + ticks
        while len(self.words) < until:
            assert not self._run(_SLICE), "main() has returned"
            self._pass()

    def reboot(self) -> None:
        """There is no reset in this emulation."""
        raise NotImplementedError

    # Registers

    @property
    def _byte_cycles(self) -> float:
        return self.registers[_USART_BRR] * 10 * _CORE_HZ / _UART_HZ

    def _read(self, uc: object, offset: int, size: int, data: object) -> int:
        value = self.registers.get(offset, 0)
        if offset == _RCC_CR:
            return value | (value & (1 << 16 | 1 << 24)) << 1
        if offset == _RCC_CFGR:
            return value | (value & 3) << 2
        if offset == _USART_SR:
            self._status_read = True
            return self._status | (_TXE if self._now >= self._sent_at else 0)
        if offset == _USART_DR and self._status_read:
            self._status &= ~(_IDLE | _RXNE)
        return value

    def _write(self, uc: object, offset: int, size: int, value: int, data: object) -> None:
        if offset in (_LIFCR, _HIFCR):
            self.registers[offset - 8] = self.registers.get(offset - 8, 0) & ~value
            return
        if offset == _USART_DR:
            assert self._now >= self._sent_at, "a byte was written while another one waited"
            self._sent.append(value & 0xFF)
            self._sent_at = self._now + self._byte_cycles
            return
        if offset == _DHR12RD:
            raise AssertionError("the processor writes to the DAC")
        self.registers[offset] = value
        for stream, at in ((self._to_play, 0x26088), (self._received, 0x26028)):
            if offset == at and value & 1:
                stream.start()
        if offset == _TIM6_CR1 and value & 1:
            assert self.registers[_DAC_CR] & 0x11005 == 0x11005  # both on, channel 1 triggered, its DMA
            self._next_tick = self._now + self._tick_cycles

    def _write_private(self, uc: object, offset: int, size: int, value: int, data: object) -> None:
        if 0x100 <= offset < 0x120:
            self._enabled |= value << 8 * (offset - 0x100)
        elif 0x400 <= offset < 0x500:
            assert size == 1
            self._priority[offset - 0x400] = value

    # Time

    @property
    def _tick_cycles(self) -> float:
        return (self.registers[_TIM6_ARR] + 1) * _CORE_HZ / _TIMER_HZ

    def _pass(self) -> None:
        """What the peripherals do in the time of a slice, and the interrupts that follow."""
        self._now += _SLICE * CYCLES
        while self._next_tick and self._now >= self._next_tick:
            self._next_tick += self._tick_cycles
            word = self._word(self._to_play.next_address(4))
            self.words.append((word & 0xFFFF, word >> 16))
        while self._arriving and self._now >= self._next_byte:
            self._rests_at = self._next_byte + self._byte_cycles
            self._take_byte(self._arriving.pop(0))
            self._next_byte += self._byte_cycles
        if self._rests_at and self._now >= self._rests_at:
            self._rests_at = 0.0
            self._status |= _IDLE
        while (found := self._asked()) is not None:
            self._interrupt(*found)

    def _take_byte(self, byte: int) -> None:
        assert self.registers[_USART_CR1] & 0x200C == 0x200C
        assert self.registers[_USART_CR3] & 1 << 6
        assert self._received.runs
        self._uc.mem_write(self._received.next_address(1), bytes([byte]))

    def _asked(self) -> tuple[int, int] | None:
        """The interrupt that comes now, and its priority."""
        idle = bool(self._status & _IDLE and self.registers.get(_USART_CR1, 0) >> 4 & 1)
        asking = {12: self._received.asks, 16: self._to_play.asks, 39: idle}
        found = [(self._priority.get(n, 0), n) for n, asks in asking.items() if asks and self._enabled >> n & 1]
        if not found or min(found)[0] >= self._active:
            return None
        priority, number = min(found)
        return number, priority

    def _interrupt(self, number: int, priority: int) -> None:
        before: Any = self._uc.context_save()
        pc, active = self._pc, self._active
        frame = (self._uc.reg_read(arm_const.UC_ARM_REG_SP) - _FRAME) & ~7
        self._uc.mem_write(frame, b"\xee" * _FRAME)
        self._uc.reg_write(arm_const.UC_ARM_REG_SP, frame)
        self._uc.reg_write(arm_const.UC_ARM_REG_LR, _TRAP | 1)
        self._uc.reg_write(arm_const.UC_ARM_REG_XPSR, 0x01000000)
        self._pc, self._active = self._word(_FLASH + 4 * (16 + number)) & ~1, priority
        instructions = _SLICE
        while not self._run(_SLICE):
            self._pass()
            instructions += _SLICE
        if number == 16:
            self.longest = max(self.longest, instructions)
        self._uc.context_restore(before)
        self._pc, self._active = pc, active

    def _run(self, instructions: int) -> bool:
        """So many instructions; True if a handler returned."""
        self._uc.emu_start(self._pc | 1, _TRAP, count=instructions)
        self._pc = self._uc.reg_read(arm_const.UC_ARM_REG_PC)
        return bool(self._pc == _TRAP)

    def _word(self, address: int) -> int:
        return int.from_bytes(self._uc.mem_read(address, 4), "little")
