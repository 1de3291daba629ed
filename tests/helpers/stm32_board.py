"""An STM32F407 with the firmware of ``examples/firmware/stm32``: unicorn, and a model of the peripherals that it uses.

These are RCC, TIM6, the DAC, USART 3, two streams of DMA 1, and interrupts by level, priority and enable, written from
ST's RM0090. What the firmware does not use is not there: a register without a meaning here keeps what is written.
QEMU has neither DMA nor DAC of this part. Instructions take ``CYCLES`` each, so that rates are those of a real one.
"""

from collections.abc import Mapping
from pathlib import Path

from cortex_board import PRIVATE, CortexBoard
from unicorn import arm_const

CYCLES = 1.5  # of the processor, an instruction, with the wait states of its flash
_CORE_HZ, _TIMER_HZ, _UART_HZ = 168_000_000, 84_000_000, 42_000_000
_TIM6_CR1, _TIM6_ARR, _DAC_CR, _DHR12RD = 0x40001000, 0x4000102C, 0x40007400, 0x40007420
_USART_SR, _USART_DR, _USART_BRR, _USART_CR1, _USART_CR3 = (0x40004800 + at for at in (0, 4, 8, 0xC, 0x14))
_RCC_CR, _RCC_CFGR = 0x40023800, 0x40023808
_LISR, _HISR, _LIFCR, _HIFCR = 0x40026000, 0x40026004, 0x40026008, 0x4002600C
_TO_PLAY, _RECEIVED = 0x40026088, 0x40026028
_HALF, _COMPLETE = 1 << 10, 1 << 11  # of streams 1 and 5, in the status of their half
_IDLE, _RXNE, _TXE = 1 << 4, 1 << 5, 1 << 7


class _Stream:
    """A stream of DMA in circular mode; ``at`` is its CR, ``status`` the register that has its flags."""

    def __init__(self, board: "Stm32Board", at: int, status: int, channel: int, peripheral: int) -> None:
        self._board, self._at, self._status = board, at, status
        self._must = channel << 25 | 1 << 10 | 1 << 8  # the channel, memory counts up, circular
        self._peripheral = peripheral
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


class Stm32Board(CortexBoard):
    """The far end of a ``link_line.Line``. ``words`` are what the DAC was given on each tick."""

    def __init__(self, executable: Path) -> None:
        devices = {0x40000000: 0x40000, PRIVATE: 0x1000}
        super().__init__(executable, arm_const.UC_CPU_ARM_CORTEX_M4, CYCLES, (0x20000000, 112 << 10), devices)
        self._to_play = _Stream(self, _TO_PLAY, _HISR, 7, _DHR12RD)
        self._received = _Stream(self, _RECEIVED, _LISR, 4, _USART_DR)
        self._next_tick = self._sent_at = self._rests_at = 0.0
        self._status = 0  # of the USART, but for TXE
        self._status_read = False

    def read(self, address: int, size: int) -> int:
        """Read a register."""
        value = self.registers.get(address, 0)
        if address == _RCC_CR:
            return value | (value & (1 << 16 | 1 << 24)) << 1
        if address == _RCC_CFGR:
            return value | (value & 3) << 2
        if address == _USART_SR:
            self._status_read = True
            return self._status | (_TXE if self.now >= self._sent_at else 0)
        if address == _USART_DR and self._status_read:
            self._status &= ~(_IDLE | _RXNE)
        return value

    def write(self, address: int, size: int, value: int) -> None:
        """Write a register."""
        if address >= PRIVATE:
            self.write_private(address, size, value)
            return
        if address in (_LIFCR, _HIFCR):
            self.registers[address - 8] = self.registers.get(address - 8, 0) & ~value
            return
        if address == _USART_DR:
            assert self.now >= self._sent_at, "a byte was written while another one waited"
            self.send(value & 0xFF)
            self._sent_at = self.now + self.byte_cycles
            return
        if address == _DHR12RD:
            raise AssertionError("the processor writes to the DAC")
        self.registers[address] = value
        if address == _USART_BRR:
            self.byte_cycles = value * 10 * _CORE_HZ / _UART_HZ
        for stream, at in ((self._to_play, _TO_PLAY), (self._received, _RECEIVED)):
            if address == at and value & 1:
                stream.start()
        if address == _TIM6_CR1 and value & 1:
            assert self.registers[_DAC_CR] & 0x11005 == 0x11005  # both on, channel 1 triggered, its DMA
            self._next_tick = self.now + self._tick_cycles

    @property
    def _tick_cycles(self) -> float:
        return (self.registers[_TIM6_ARR] + 1) * _CORE_HZ / _TIMER_HZ

    def pass_time(self) -> None:
        """Do what the peripherals do up to ``now``."""
        while self._next_tick and self.now >= self._next_tick:
            self._next_tick += self._tick_cycles
            word = self.word(self._to_play.next_address(4))
            self.words.append((word & 0xFFFF, word >> 16))
        if self._rests_at and self.now >= self._rests_at:
            self._rests_at = 0.0
            self._status |= _IDLE

    def take_byte(self, byte: int, end: float) -> None:
        """Take a byte from the serial line, whose last bit came at ``end``."""
        assert self.registers[_USART_CR1] & 0x200C == 0x200C
        assert self.registers[_USART_CR3] & 1 << 6
        assert self._received.runs
        self.uc.mem_write(self._received.next_address(1), bytes([byte]))
        self._rests_at = end + self.byte_cycles

    def asking(self) -> Mapping[int, bool]:
        """Return which interrupts are requested."""
        idle = bool(self._status & _IDLE and self.registers.get(_USART_CR1, 0) >> 4 & 1)
        return {12: self._received.asks, 16: self._to_play.asks, 39: idle}
