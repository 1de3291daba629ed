"""An STM32H743 with the firmware of ``examples/firmware/stm32h7``, two converters at its pins, and its data cache.

unicorn has the processor; the model has RCC, PWR, TIM1, SPI 1 and 2, USART 3, four streams of DMA 1 with their
multiplexer, a line of EXTI, and interrupts, as ST's RM0433 names them. What the firmware does not use is not there: a
register without a meaning here keeps what is written.
"""

from collections.abc import Mapping
from pathlib import Path

from converter_chips import Board as Converters
from cortex_board import PRIVATE, CortexBoard
from cortex_m7_cache import DataCache
from unicorn import arm_const

from tablegen.verification.c.elf import read_executable

CYCLES = 1.0  # of the processor, an instruction
OFF = -1  # the code of an output that is off
_CORE_HZ, _TIMER_HZ, _SPI_HZ, _UART_HZ = 400_000_000, 200_000_000, 100_000_000, 100_000_000
_RAM = 0x24000000, 512 << 10
ITCM = range(64 << 10)
_TIM1, _SPI, _USART, _DMA, _DMAMUX = 0x40010000, (0x40013000, 0x40003800), 0x40004800, 0x40020000, 0x40020800
_CR1, _DIER, _SR, _CCMR1, _CCMR2, _CCER, _CNT, _ARR = (
    _TIM1 + at for at in (0, 0xC, 0x10, 0x18, 0x1C, 0x20, 0x24, 0x2C)
)
_CCR1, _CCR2, _CCR3, _CCR4, _BDTR = (_TIM1 + at for at in (0x34, 0x38, 0x3C, 0x40, 0x44))
_TXDR = tuple(unit + 0x20 for unit in _SPI)
_USART_CR1, _USART_CR3, _USART_BRR, _USART_ISR, _USART_ICR, _RDR, _TDR = (
    _USART + at for at in (0, 8, 0xC, 0x1C, 0x20, 0x24, 0x28)
)
_LISR, _LIFCR = _DMA, _DMA + 8
_RCC_CR, _RCC_CFGR, _PWR_CSR1, _PWR_D3CR = 0x58024400, 0x58024410, 0x58024804, 0x58024818
_EXTICR2, _RTSR1, _CPUIMR1, _CPUPR1 = 0x5800040C, 0x58000000, 0x58000080, 0x58000088
_IDLE, _TXE = 1 << 4, 1 << 7
_FLAGS = (0, 6, 16, 22)  # of streams 0 to 3, in LISR
_REQUESTS = {"update": 15, "compare 1": 11, "compare 4": 14}


class _Stream:
    """A stream of DMA 1 in circular mode."""

    def __init__(self, board: "Stm32h7Board", number: int) -> None:
        self._board, self._number = board, number
        self.at = _DMA + 0x10 + 0x18 * number
        self.size = 0

    def start(self) -> None:
        """CR was written with its enable."""
        control = self._board.registers[self.at]
        assert control & (1 << 10 | 1 << 8) == 1 << 10 | 1 << 8  # memory counts up, circular
        assert control >> 11 & 3 == control >> 13 & 3  # items of one width
        self.size = self._board.registers[self.at + 4]

    @property
    def runs(self) -> bool:
        return bool(self._board.registers.get(self.at, 0) & 1)

    @property
    def request(self) -> int:
        return self._board.registers.get(_DMAMUX + 4 * self._number, 0)

    def next_address(self) -> tuple[int, int]:
        """Where the next item goes, or comes from, and its bytes; it is counted."""
        registers = self._board.registers
        width = 1 << (registers[self.at] >> 13 & 3)
        left = registers[self.at + 4]
        address = registers[self.at + 12] + (self.size - left) * width
        left -= 1
        flags = (left == self.size // 2) << 4 | (left == 0) << 5
        registers[_LISR] = registers.get(_LISR, 0) | flags << _FLAGS[self._number]
        registers[self.at + 4] = left or self.size
        return address, width

    def move(self) -> None:
        """Move an item from memory to the peripheral."""
        assert self._board.registers[self.at] >> 6 & 3 == 1
        address, width = self.next_address()
        self._board.give(self._board.registers[self.at + 8], self._board.cache.shared(address, width))

    @property
    def asks(self) -> bool:
        """For its interrupt."""
        control, status = self._board.registers.get(self.at, 0), self._board.registers.get(_LISR, 0)
        flags = status >> _FLAGS[self._number]
        return bool((control >> 3 & 1 and flags >> 4 & 1) or (control >> 4 & 1 and flags >> 5 & 1))


class Stm32h7Board(CortexBoard):
    """The far end of a ``link_line.Line``. ``words`` are the codes at the converters after each LDAC.

    ``pixels`` says for each of them whether the pixel clock rose at the update of the timer that follows.
    """

    def __init__(self, executable: Path, converter: str) -> None:
        devices = {0x40000000: 0x30000, 0x52000000: 0x3000, 0x58000000: 0x30000, PRIVATE: 0x1000}
        super().__init__(executable, arm_const.UC_CPU_ARM_CORTEX_M7, CYCLES, _RAM, devices)
        self.uc.mem_map(ITCM.start, len(ITCM))
        self.cache = DataCache(self.uc, _RAM, 16, read_executable(executable).segments)
        self.converters = Converters(converter)
        self.pixels: list[bool] = []
        self._streams = tuple(_Stream(self, number) for number in range(4))
        self._period = 0.0  # of the timer, in cycles; 0 until it runs
        self._update = 0.0
        self._events: list[tuple[float, str]] = []
        self._frames: list[tuple[int, float] | None] = [None, None]  # of this tick, and when the last bit is out
        self._at = 0.0  # of the event that happens
        self._sent_at = self._rests_at = 0.0
        self._status = 0  # of the USART, but for TXE

    def raise_trigger(self) -> None:
        """Let the pin of the trigger rise."""
        line = 1 << 7
        if self.registers.get(_EXTICR2, 0) >> 12 == 4 and self.registers.get(_RTSR1, 0) & line:
            self.registers[_CPUPR1] = self.registers.get(_CPUPR1, 0) | line

    # Registers

    def read(self, address: int, size: int) -> int:
        """Read a register."""
        value = self.registers.get(address, 0)
        if address == _RCC_CR:  # what is switched on is ready
            return value | (value & (1 << 16 | 1 << 24)) << 1
        if address == _RCC_CFGR:
            return value | (value & 7) << 3
        if address in (_PWR_CSR1, _PWR_D3CR):
            return value | 1 << 13
        if (of_cache := self.cache.read(address)) is not None:
            return of_cache
        if address == _USART_ISR:
            return self._status | (_TXE if self.now >= self._sent_at else 0)
        return value

    def write(self, address: int, size: int, value: int) -> None:
        """Write a register."""
        if self.cache.write(address, value):
            return
        if address == _LIFCR:
            self.registers[_LISR] = self.registers.get(_LISR, 0) & ~value
        elif address == _CPUPR1:
            self.registers[_CPUPR1] = self.registers.get(_CPUPR1, 0) & ~value
        elif address == _USART_ICR:
            self._status &= ~value
        elif address == _TDR:
            assert self.now >= self._sent_at, "a byte was written while another one waited"
            self.send(value & 0xFF)
            self._sent_at = self.now + self.byte_cycles
        elif address in _TXDR:
            raise AssertionError("the processor writes to SPI")
        else:
            self.registers[address] = value
            self._written(address, size, value)

    def _written(self, address: int, size: int, value: int) -> None:
        """See to what a register starts."""
        if PRIVATE <= address < PRIVATE + 0x500:
            self.write_private(address, size, value)
        elif address == _USART_BRR:
            self.byte_cycles = value * 10 * _CORE_HZ / _UART_HZ
        elif address == _CR1 and value & 1 and not self._period:
            self._start_timer()
        for stream in self._streams:
            if address == stream.at and value & 1:
                stream.start()

    def _start_timer(self) -> None:
        registers = self.registers
        assert registers[_CCMR1] == 0b0_110_1_0_00_0_111_1_0_00  # LDAC high, SYNC low until its count, preloaded
        assert registers[_CCMR2] == 0b0_110_1_0_00  # pixel clock high until its count, preloaded
        assert registers[_CCER] == 0x111
        assert registers[_BDTR] >> 15 & 1
        assert registers[_DIER] == 0x1300
        count, each = _CORE_HZ / _TIMER_HZ, registers[_ARR] + 1
        self._period = each * count
        self._update = self.now + (each - registers[_CNT]) * count
        compares = {"compare 4": _CCR4, "compare 1": _CCR1, "compare 2": _CCR2}
        # A compare whose count is still to come happens before the first update.
        early = [
            (self._update - self._period + registers[at] * count, name)
            for name, at in compares.items()
            if registers[at] > registers[_CNT]
        ]
        self._events = sorted(early)

    # Time

    def pass_time(self) -> None:
        """Do what the peripherals do up to ``now``."""
        while self._period:
            if not self._events:
                count = _CORE_HZ / _TIMER_HZ
                at = {"compare 4": _CCR4, "compare 1": _CCR1, "compare 2": _CCR2}
                later = [(self._update + self.registers[where] * count, name) for name, where in at.items()]
                self._events = sorted([(self._update, "update"), *later])
                self._update += self._period
            if self._events[0][0] > self.now:
                break
            self._at, event = self._events.pop(0)
            self._happen(event)
        if self._rests_at and self.now >= self._rests_at:
            self._rests_at = 0.0
            self._status |= _IDLE

    def _happen(self, event: str) -> None:
        match event:
            case "update":
                if self.words:
                    self.pixels.append(self.registers.get(_CCR3, 0) > 0)
            case "compare 1":  # SYNC rises
                for axis, frame in enumerate(self._frames):
                    assert frame is not None, f"no frame in {len(self.words)}"
                    assert frame[1] <= self._at, "SYNC rises within a frame"
                    self.converters.take(axis, frame[0])
                self._frames = [None, None]
            case "compare 2":  # LDAC falls
                self.converters.load()
                x, y = (OFF if code is None else code for code in self.converters.codes())
                self.words.append((x, y))
        for stream in self._streams:
            if stream.runs and stream.request == _REQUESTS.get(event):
                stream.move()

    def give(self, peripheral: int, value: int) -> None:
        """Take an item that DMA writes to a peripheral."""
        if peripheral == _CCR3:
            self.registers[_CCR3] = value
            return
        axis = _TXDR.index(peripheral)
        unit = _SPI[axis]
        assert self.registers[unit] & 0x1201 == 0x1201  # SSI, started, on
        assert self.registers[unit + 0xC] >> 24 & 3 == 1  # samples on the falling edge, the clock rests low
        assert self.registers[unit + 0xC] & 0x8446_0000 == 0x8442_0000  # keeps pins, no SS, master, only transmits
        assert self._frames[axis] is None, "two frames while SYNC is low"
        bits = (self.registers[unit + 8] & 31) + 1
        assert value >> bits == 0
        bit_cycles = _CORE_HZ * (2 << (self.registers[unit + 8] >> 28 & 7)) / _SPI_HZ
        self._frames[axis] = value, self._at + bits * bit_cycles

    def take_byte(self, byte: int, end: float) -> None:
        """Take a byte from the serial line, whose last bit came at ``end``."""
        stream = self._streams[3]
        assert self.registers[_USART_CR1] & 0xD == 0xD
        assert self.registers[_USART_CR3] & 1 << 6
        assert stream.runs
        assert stream.request == 45
        assert self.registers[stream.at + 8] == _RDR
        address, width = stream.next_address()
        assert width == 1
        self.cache.store(address, byte, width)
        self._rests_at = end + self.byte_cycles

    def asking(self) -> Mapping[int, bool]:
        """Return which interrupts are requested."""
        idle = bool(self._status & _IDLE and self.registers.get(_USART_CR1, 0) >> 4 & 1)
        trigger = bool(self.registers.get(_CPUPR1, 0) & self.registers.get(_CPUIMR1, 0))
        return {13: self._streams[2].asks, 14: self._streams[3].asks, 23: trigger, 39: idle}
