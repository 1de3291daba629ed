"""Models of the converters of ``examples/firmware/converters``: what a chip does with a frame, from its data sheet.

They share nothing with the C: each takes the bits of its input shift register apart, refuses a frame that no scan
should send, and has a code at each output, straight binary, or None while the output is off. Sources stand in the
headers.
"""

from collections.abc import Callable, Iterator, Sequence

Codes = tuple[int | None, ...]


class Chip:
    """A chip with input registers, which LDAC copies to the outputs."""

    outputs = 1
    frame_bits = 24

    def __init__(self) -> None:
        self.input = [0] * self.outputs
        self.dac = [0] * self.outputs

    def take(self, frame: int) -> None:
        """Take a frame, as SYNC rises after its last bit."""
        assert 0 <= frame < 1 << self.frame_bits
        self.take_bits(frame)

    def take_bits(self, frame: int) -> None:
        """Do what the fields of the frame say."""
        raise NotImplementedError

    def load(self) -> None:
        """Take the pin LDAC to low."""
        self.dac = list(self.input)

    def codes(self) -> Codes:
        """Return the code of each output."""
        return tuple(self.dac)


class Ad5541a(Chip):
    """Sixteen bits of data and nothing else."""

    frame_bits = 16

    def take_bits(self, frame: int) -> None:
        self.input[0] = frame


class Ad5791(Chip):
    """R/W, three bits of register, 20 of data; register 1 is the DAC, 2 the control."""

    bits = 20

    def __init__(self) -> None:
        super().__init__()
        self.control = 0b1110  # after power-up: clamped to ground, three-state, RBUF

    def take_bits(self, frame: int) -> None:
        assert not frame >> 23, "a read"
        register, data = frame >> 20 & 7, frame & 0xFFFFF
        assert register in (1, 2), f"register {register}"
        if register == 1:
            self.input[0] = data
        else:
            assert data & ~0x3FE == 0, "a reserved bit"
            assert data >> 6 & 15 == 0b1100, "LIN COMP is not that of references 20 V apart"
            self.control = data

    def codes(self) -> Codes:
        if self.control & 0b1100:  # DACTRI, OPGND
            return (None,)
        straight = self.dac[0] if self.control & 0b1_0000 else self.dac[0] ^ 1 << 19  # BIN/2sC
        return (straight >> 20 - self.bits,)


class Ad5781(Ad5791):
    """The same with 18 bits: the lowest two of the data are ignored."""

    bits = 18


class Ad5761(Chip):
    """Three bits that are ignored, a zero, four of command, 16 of data."""

    def __init__(self) -> None:
        super().__init__()
        self.control: int | None = None

    def take_bits(self, frame: int) -> None:
        command, data = frame >> 16 & 15, frame & 0xFFFF
        assert not frame >> 20 & 1
        assert command in (1, 4, 15), f"command {command}"
        if command == 1:
            self.input[0] = data
        elif command == 4:
            assert self.control is None, "a range without a reset before it"
            assert data >> 11 == 0, "a reserved bit"
            assert data & 7 == 0, "not -10..+10 V"
            self.control = data
        else:
            self.__init__()  # type: ignore[misc]

    def codes(self) -> Codes:
        if self.control is None:
            return (None,)
        return (self.dac[0] ^ (1 << 15 if self.control & 0x80 else 0),)  # B2C


class Ad5764(Chip):
    """R/W, a zero, three bits of register, three of channel, 16 of data; BIN/2sCOMP is low."""

    outputs = 4

    def take_bits(self, frame: int) -> None:
        assert frame >> 22 == 0
        assert frame >> 19 & 7 == 2, "not the data register"
        assert frame >> 16 & 7 < 4
        self.input[frame >> 16 & 7] = frame & 0xFFFF

    def codes(self) -> Codes:
        return tuple(data ^ 1 << 15 for data in self.dac)


class Dac8562(Chip):
    """Two bits that are ignored, three of command, three of address, 16 of data."""

    outputs = 2

    def __init__(self) -> None:
        super().__init__()
        self.reference = False

    def take_bits(self, frame: int) -> None:
        command, address, data = frame >> 19 & 7, frame >> 16 & 7, frame & 0xFFFF
        if command == 7:
            assert (address, data) == (0, 1), "not the inner reference"
            self.reference = True
            return
        assert command == 0, f"command {command}"
        assert address < 2, f"address {address}"
        self.input[address] = data

    def codes(self) -> Codes:
        return tuple(self.dac) if self.reference else (None, None)


class Ltc2668(Chip):
    """Four bits of command, four of address, 16 of data; a frame of 32 bits has eight in front that are ignored."""

    outputs = 16

    def __init__(self) -> None:
        super().__init__()
        self.span = 0

    def take_bits(self, frame: int) -> None:
        command, address, data = frame >> 20, frame >> 16 & 15, frame & 0xFFFF
        if command == 14:
            self.span = data
            return
        assert command == 0, f"command {command}"
        self.input[address] = data

    def codes(self) -> Codes:
        return tuple(self.dac) if self.span == 3 else (None,) * 16  # -10..+10 V


class Mcp4922(Chip):
    """Output, BUF, GA, SHDN, 12 of data."""

    outputs = 2
    frame_bits = 16

    def take_bits(self, frame: int) -> None:
        output, buffered, gain_of_one, on = (frame >> bit & 1 for bit in (15, 14, 13, 12))
        assert (buffered, gain_of_one, on) == (0, 1, 1)
        self.input[output] = frame & 0xFFF


CHIPS: dict[str, Callable[[], Chip]] = {
    "ad5541a": Ad5541a,
    "ad5761": Ad5761,
    "ad5764": Ad5764,
    "ad5781": Ad5781,
    "ad5791": Ad5791,
    "dac8562": Dac8562,
    "ltc2668": Ltc2668,
    "mcp4922": Mcp4922,
}


class Board:
    """Outputs for x and y: of one chip with two, or of two chips with one each."""

    def __init__(self, name: str) -> None:
        first = CHIPS[name]()
        self.chips: Sequence[Chip] = (first,) if first.outputs > 1 else (first, CHIPS[name]())

    def take(self, output: int, frame: int) -> None:
        """Send a frame of output 0 or 1."""
        self.chips[output % len(self.chips)].take(frame)

    def load(self) -> None:
        """Take LDAC of all chips to low."""
        for chip in self.chips:
            chip.load()

    def play(self, frames: Sequence[int], setups: int) -> Iterator[Codes]:
        """Yield the codes of x and y after ``dac_spi_start`` of both outputs, and after each pair of frames."""
        begin = 2 + setups
        for index, frame in enumerate(frames[: 2 * begin]):
            self.take(index // begin, frame)
            self.load()
        yield self.codes()
        for at in range(2 * begin, len(frames) - 1, 2):
            self.take(0, frames[at])
            self.take(1, frames[at + 1])
            self.load()
            yield self.codes()

    def codes(self) -> Codes:
        """Return the codes of x and y."""
        return tuple(code for chip in self.chips for code in chip.codes())[:2]
