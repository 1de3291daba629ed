"""A Teensy 4.1 with the firmware of ``examples/firmware/teensy41``, two converters at its pins, and its data cache.

unicorn has the processor, ``cortex_m7_cache`` the cache; the model here has clocks and their gates, submodule 0 of
FlexPWM 2, LPSPI 3 and 4, LPUART 6, two channels of eDMA with their multiplexer, pins, and interrupts, as NXP's
IMXRT1060RM names them. What the firmware does not use is not there: a register without a meaning here keeps what is
written.
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
_CORE_HZ, _TIMER_HZ, _SPI_HZ, _UART_HZ = 528_000_000, 132_000_000, 66_000_000, 24_000_000
_FLASH, _VECTORS, _RAM = 0x60000000, 0x2000, (0x20200000, 512 << 10)
_CCM, _PLL_SYS = 0x400FC000, 0x400D8030
_CBCDR, _CBCMR, _CSCDR1 = _CCM + 0x14, _CCM + 0x18, _CCM + 0x24
_LPSPI = (0x403A0000, 0x4039C000)  # x, y
_TDR = tuple(unit + 0x64 for unit in _LPSPI)
_PWM, _MCTRL = 0x403E0000, 0x403E0188
_DMA, _TCD, _DMAMUX = 0x400E8000, 0x400E9000, 0x400EC000
_SERQ, _CINT, _INT = _DMA + 0x1B, _DMA + 0x1F, _DMA + 0x24
_UART = 0x40198000
_BAUD, _STAT, _CTRL, _DATA = (_UART + at for at in (0x10, 0x14, 0x18, 0x1C))
_IDLE, _TDRE = 1 << 20, 1 << 23
_GATES = {  # by the beginning of a peripheral: the register of its gate, and the bit
    **{_TCD: (0x7C, 6), _DMA: (0x7C, 6), _DMAMUX: (0x7C, 6), _UART: (0x74, 6), _PWM: (0x78, 18)},
    **{_LPSPI[0]: (0x6C, 6), _LPSPI[1]: (0x6C, 4), 0x401F8000: (0x78, 2)},
}
_PLAY_PINS = {0x2C: 1, 0x13C: 3, 0x144: 3, 0x148: 3, 0x12C: 2, 0x134: 2, 0x138: 2}  # pad: function
_UART_PINS = {0xC4: 2, 0xC8: 2, 0x550: 1}
_RELOAD, _RECEIVED = 100, 71  # requests


class _Channel:
    """A channel of eDMA, from its transfer control descriptor."""

    def __init__(self, board: "Teensy41Board", number: int) -> None:
        self._board, self.number = board, number
        self._at = _TCD + 0x20 * number
        self.on = False

    def _get(self, offset: int, bits: int = 32, signed: bool = False) -> int:
        value = self._board.registers.get(self._at + offset, 0)
        return value - (1 << bits) if signed and value >> bits - 1 else value

    def _add(self, offset: int, value: int) -> None:
        self._board.registers[self._at + offset] = (self._get(offset) + value) & 0xFFFFFFFF

    @property
    def request(self) -> int:
        """The request that starts it; 0 if none does."""
        select = self._board.registers.get(_DMAMUX + 4 * self.number, 0)
        return select & 127 if self.on and select >> 31 else 0

    def serve(self) -> None:
        """Serve a request: a minor loop."""
        sizes = self._get(6)
        assert sizes >> 8 == sizes & 0xFF, "reads and writes of different width"
        width = 1 << (sizes & 7)
        loop = self._get(8)
        offset = 0
        if self._board.registers.get(_DMA, 0) >> 7 & 1 and loop >> 30:  # EMLM
            assert loop >> 30 == 1  # of the destination
            offset = (loop >> 10 & 0xFFFFF ^ 1 << 19) - (1 << 19)
            loop &= 0x3FF
        assert loop < 1 << 30
        assert loop % width == 0
        for _ in range(loop // width):
            self._board.put(self._get(0x10), self._board.get(self._get(0), width), width)
            self._add(0, self._get(4, 16, True))
            self._add(0x10, self._get(0x14, 16, True))
        left, size, control = self._get(0x16) - 1, self._get(0x1E), self._get(0x1C)
        assert left < size
        if left == 0:  # the last adjustments replace the offset
            self._add(0, self._get(0xC))
            self._add(0x10, self._get(0x18))
        else:
            self._add(0x10, offset)
        self._board.registers[self._at + 0x16] = left or size
        if (left == 0 and control >> 1 & 1) or (left == size // 2 and control >> 2 & 1):
            self._board.registers[_INT] = self._board.registers.get(_INT, 0) | 1 << self.number


class Teensy41Board(CortexBoard):
    """The far end of a ``link_line.Line``. ``words`` are the codes at the converters after each LDAC."""

    def __init__(self, executable: Path, converter: str) -> None:
        devices = {0x40000000: 0x400000, PRIVATE: 0x1000}
        super().__init__(executable, arm_const.UC_CPU_ARM_CORTEX_M7, CYCLES, _RAM, devices, _FLASH, _VECTORS)
        self.cache = DataCache(self.uc, _RAM, 32, read_executable(executable).segments)
        self.converters = Converters(converter)
        # As nobody has to rely upon: PLL 2 bypassed and off, the processor and SPI on other clocks, gates closed.
        self.registers |= {_PLL_SYS: 1 << 16 | 1 << 12, _CBCDR: 0x000A8200, _CBCMR: 0x2DAE8324}
        self._channels = (_Channel(self, 0), _Channel(self, 1))
        self._period = 0.0  # of the timer, in cycles; 0 until it runs
        self._reload = 0.0
        self._fall = 0.0  # of LDAC, after a reload
        self._events: list[tuple[float, str]] = []
        self._frames: list[tuple[int, float] | None] = [None, None]  # of this tick, and when SYNC rises
        self._at = 0.0  # of the event that happens
        self._byte: int | None = None  # that was received
        self._sent_at = self._rests_at = 0.0
        self._status = 0  # of the UART, but for TDRE

    # Registers

    def read(self, address: int, size: int) -> int:
        """Read a register."""
        if (of_cache := self.cache.read(address)) is not None:
            return of_cache
        value = self.registers.get(address, 0)
        if address == _PLL_SYS:  # what is on, and has power, locks
            return value | (value >> 13 & 1 & ~(value >> 12)) << 31
        if address == _STAT:
            return self._status | (_TDRE if self.now >= self._sent_at else 0)
        return value

    def write(self, address: int, size: int, value: int) -> None:
        """Write a register."""
        if self.cache.write(address, value):
            return
        gate = _GATES.get(address & ~0xFFF)
        if gate is not None:
            assert self.registers.get(_CCM + gate[0], 0) >> gate[1] & 3 == 3, f"no clock at {address:#x}"
        if address in (_PLL_SYS + 4, _PLL_SYS + 8):
            old = self.registers[_PLL_SYS]
            self.registers[_PLL_SYS] = old | value if address == _PLL_SYS + 4 else old & ~value
        elif address == _SERQ:
            self._channels[value].on = True
        elif address == _CINT:
            self.registers[_INT] = self.registers.get(_INT, 0) & ~(1 << value)
        elif address == _STAT:
            self._status &= ~value
        elif address == _DATA:
            assert self.now >= self._sent_at, "a byte was written while another one waited"
            self.send(value & 0xFF)
            self._sent_at = self.now + self.byte_cycles
        else:
            assert address not in _TDR, "the processor writes to SPI"
            self.registers[address] = value
            if PRIVATE <= address < PRIVATE + 0x500:
                self.write_private(address, size, value)
            elif address == _BAUD:
                clock = self.registers.get(_CSCDR1, 0)
                assert clock & 127 == 64, "the UART is not clocked by the crystal"
                self.byte_cycles = ((value >> 24 & 31) + 1) * (value & 0x1FFF) * 10 * _CORE_HZ / _UART_HZ
            elif address == _MCTRL and value >> 8 & 1 and not self._period:
                self._start_timer()

    def _start_timer(self) -> None:
        registers = self.registers
        assert registers[_PLL_SYS] & 0x13001 == 0x2001, "PLL 2 is bypassed or off"
        assert registers[_CBCDR] >> 25 & 1 == 0
        assert registers[_CBCDR] >> 8 & 0b11111 == 3, "not 528 MHz and a quarter"
        assert registers[_CBCMR] >> 18 & 3 == 0, "the processor is not clocked by PLL 2"
        assert registers[_CBCMR] >> 26 & 7 == 7, "SPI is not clocked by an eighth of PLL 2"
        assert registers[_CBCMR] >> 4 & 3 == 2, "SPI is not clocked by an eighth of PLL 2"
        assert registers[_MCTRL] & 1  # LDOK
        assert registers[_PWM + 4] == 1 << 13
        assert registers[_PWM + 6] == 1 << 10
        assert registers[_PWM + 0x2C] & 15 == 0
        assert registers[_PWM + 2] == registers[_PWM + 0x12] == 0
        assert registers[_PWM + 0x180] == 1 << 8
        count = _CORE_HZ / _TIMER_HZ
        self._period = (registers[_PWM + 0xE] + 1) * count
        self._fall = registers[_PWM + 0x16] * count
        assert self._fall < self._period
        self._reload = self.now + self._period

    # Time

    def pass_time(self) -> None:
        """Do what the peripherals do up to ``now``."""
        while self._period:
            if not self._events:
                self._events = [(self._reload, "reload"), (self._reload + self._fall, "LDAC falls")]
                self._reload += self._period
            if self._events[0][0] > self.now:
                break
            self._at, event = self._events.pop(0)
            self._happen(event)
        if self._rests_at and self.now >= self._rests_at:
            self._rests_at = 0.0
            self._status |= _IDLE

    def _happen(self, event: str) -> None:
        if event == "reload":
            self._pins(_PLAY_PINS)
            if self.registers.get(_PWM + 0x28, 0) >> 9 & 1:
                self._ask(_RELOAD)
            return
        for axis, frame in enumerate(self._frames):
            assert frame is not None, f"no frame in {len(self.words)}"
            assert frame[1] <= self._at, "LDAC falls within a frame"
            self.converters.take(axis, frame[0])
        self._frames = [None, None]
        self.converters.load()
        x, y = (OFF if code is None else code for code in self.converters.codes())
        self.words.append((x, y))

    def _pins(self, pins: Mapping[int, int]) -> None:
        for pad, function in pins.items():
            assert self.registers.get(0x401F8000 + pad, 0) == function, f"pad {pad:#x}"

    def _ask(self, request: int) -> None:
        for channel in self._channels:
            if channel.request == request:
                channel.serve()

    # What DMA reads and writes

    def get(self, address: int, width: int) -> int:
        """Return what DMA reads."""
        if address == _DATA:
            assert self._byte is not None
            byte, self._byte = self._byte, None
            return byte
        return self.cache.shared(address, width)

    def put(self, address: int, value: int, width: int) -> None:
        """Write what DMA writes."""
        if address not in _TDR:
            self.cache.store(address, value, width)
            return
        axis = _TDR.index(address)
        control, configuration, clock, command = (
            self.registers.get(_LPSPI[axis] + at, 0) for at in (0x10, 0x24, 0x40, 0x60)
        )
        assert control == 1
        assert configuration == 1  # a master that makes SYNC, active low
        assert command & ~0xFFF == 1 << 30 | 1 << 19, "not mode 1, or it receives"
        assert self._frames[axis] is None, "two frames in a tick"
        bits = (command & 0xFFF) + 1
        assert bits == self.converters.chips[axis].frame_bits, f"a frame of {bits} bits"
        cycles = (clock >> 24) + 1 + (clock >> 16 & 255) + 1 + bits * ((clock & 255) + 2)
        self._frames[axis] = value, self._at + cycles * _CORE_HZ / _SPI_HZ

    def take_byte(self, byte: int, end: float) -> None:
        """Take a byte from the serial line, whose last bit came at ``end``."""
        self._pins(_UART_PINS)
        assert self.registers[_CTRL] >> 18 & 3 == 3
        assert self.registers[_BAUD] >> 21 & 1
        self._byte = byte
        self._ask(_RECEIVED)
        assert self._byte is None, "nobody takes a byte"
        self._rests_at = end + self.byte_cycles

    def asking(self) -> Mapping[int, bool]:
        """Return which interrupts are requested."""
        flags = self.registers.get(_INT, 0)
        idle = bool(self._status & _IDLE and self.registers.get(_CTRL, 0) >> 20 & 1)
        return {0: bool(flags & 1), 1: bool(flags & 2), 25: idle}
