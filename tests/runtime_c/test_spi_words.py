"""Frames of examples/firmware/converters, as models of the converters, written from their data sheets, read them."""

import re
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from subprocess import run as start

import pytest
from building import REPOSITORY, Variant, build, run_clean

from tablegen.base.resources import c_runtime
from tablegen.device.played_lines import play_line

FOLDER = REPOSITORY / "examples" / "firmware" / "converters"
CONVERTERS = sorted(path.stem for path in FOLDER.glob("*.h") if path.stem != "spi_words")
RUNTIME = sorted({str(path.parent) for path in c_runtime()})
# Reads words of x and y, writes the frames of the start of each output and then those of all words.
PROGRAM = """
#include <stdio.h>
#include "NAME.h"

int main(void)
{
    static dac_output words[2 * 4096];
    static unsigned char frames[8192 * 3 + 24];
    unsigned char *end = frames;
    unsigned count = 0;
    unsigned long x, y;

    while (count < 4096 && scanf("%lu %lu", &x, &y) == 2) {
        words[2 * count] = (dac_output)x;
        words[2 * count++ + 1] = (dac_output)y;
    }
    end = dac_spi_start(&NAME, 0, words[0], end);
    end = dac_spi_start(&NAME, 1, words[1], end);
    end = dac_spi_pairs(&NAME, words, words + 1, count, end);
    fwrite(frames, 1, (size_t)(end - frames), stdout);
    return 0;
}
"""
Codes = tuple[int | None, int | None]


class Chip:
    """A converter, or two with one output each: takes frames, and has a code at each output; None where it is off."""

    def __init__(self, bits: int) -> None:
        self.bits = bits
        self.input, self.dac = [0] * 16, [0] * 16
        self.control: int | None = None

    def load(self) -> None:
        """Take the pin LDAC to low."""
        self.dac = list(self.input)

    def codes(self) -> Codes:
        return self.dac[0], self.dac[1]


class Bare(Chip):
    def take(self, output: int, frame: int) -> None:
        self.input[output] = frame & 0xFFFF


class Ad57x1(Chip):
    """AD5791, AD5781: R/W, three bits of register, 20 of data."""

    def take(self, output: int, frame: int) -> None:
        register, data = frame >> 20, frame & 0xFFFFF
        assert register in (1, 2)  # no read, no other register
        if register == 1:
            self.input[output] = data
        else:
            assert data == data & 0b11_1111_1110
            self.control = data

    def codes(self) -> Codes:
        if self.control is None or self.control & 0b1100:  # OPGND, DACTRI
            return None, None
        coded = [data if self.control & 0b1_0000 else data ^ 1 << 19 for data in self.dac[:2]]
        return coded[0] >> 20 - self.bits, coded[1] >> 20 - self.bits


class Ad5761(Chip):
    """Three bits that are ignored, a zero, four of command, 16 of data."""

    def take(self, output: int, frame: int) -> None:
        command, data = frame >> 16 & 15, frame & 0xFFFF
        assert not frame >> 20 & 1
        assert command in (1, 4)
        if command == 1:
            self.input[output] = data
        else:
            assert data & 7 == 0  # -10..+10 V
            self.control = data

    def codes(self) -> Codes:
        if self.control is None:
            return None, None
        turned = 1 << 15 if self.control & 0x80 else 0  # B2C
        return self.dac[0] ^ turned, self.dac[1] ^ turned


class Ad5764(Chip):
    """R/W, a zero, three bits of register, three of channel, 16 of data; BIN/2sCOMP is low."""

    def take(self, output: int, frame: int) -> None:
        assert frame >> 19 == 2
        assert frame >> 16 & 7 == output
        self.input[frame >> 16 & 7] = frame & 0xFFFF

    def codes(self) -> Codes:
        return self.dac[0] ^ 1 << 15, self.dac[1] ^ 1 << 15


class Dac8562(Chip):
    """Two bits that are ignored, three of command, three of address, 16 of data."""

    def take(self, output: int, frame: int) -> None:
        command, channel, data = frame >> 19 & 7, frame >> 16 & 7, frame & 0xFFFF
        if command == 7:
            assert (command, channel, data) == (7, 0, 1)  # the inner reference is on
            self.control = data
            return
        assert (command, channel) == (0, output)
        self.input[channel] = data

    def codes(self) -> Codes:
        return (None, None) if self.control is None else (self.dac[0], self.dac[1])


class Ltc2668(Chip):
    """Four bits of command, four of address, 16 of data."""

    def take(self, output: int, frame: int) -> None:
        command, channel, data = frame >> 20, frame >> 16 & 15, frame & 0xFFFF
        if command == 14:
            self.control = data
            return
        assert (command, channel) == (0, output)
        self.input[channel] = data

    def codes(self) -> Codes:
        return (None, None) if self.control != 3 else (self.dac[0], self.dac[1])  # -10..+10 V


class Mcp4922(Chip):
    """Output, input buffer, gain of one, output on, 12 of data."""

    def take(self, output: int, frame: int) -> None:
        assert frame >> 12 == 0b0011 | output << 3
        self.input[output] = frame & 0xFFF


CHIPS: dict[str, Callable[[], Chip]] = {
    "ad5541a": lambda: Bare(16),
    "ad5761": lambda: Ad5761(16),
    "ad5764": lambda: Ad5764(16),
    "ad5781": lambda: Ad57x1(18),
    "ad5791": lambda: Ad57x1(20),
    "dac8562": lambda: Dac8562(16),
    "ltc2668": lambda: Ltc2668(16),
    "mcp4922": lambda: Mcp4922(12),
}


def described(name: str) -> tuple[str, dict[str, object]]:
    """Return the text of a converter's file, and the [dac] table that its comment gives."""
    text = (FOLDER / f"{name}.h").read_text("ascii")
    comment = text.partition("*/")[0]
    toml = "\n".join(line.removeprefix(" *     ") for line in comment.splitlines() if line.startswith(" *     "))
    return text, tomllib.loads(toml)["dac"]


def values(text: str) -> list[int]:
    """Return the numbers of the converter's structure, in its order."""
    body = re.sub(r"/\*.*?\*/", "", text.partition("= {")[2], flags=re.S)
    return [int(number, 0) for number in re.findall(r"0x[0-9A-F]+|\b\d+\b", body)]


def sent(folder: Path, name: str, words: list[tuple[int, int]], text: str | None = None) -> tuple[int, list[int]]:
    """Return how many bytes a frame has, and the frames that the C makes of words; ``text`` replaces its file."""
    folder.mkdir()
    (folder / f"{name}.h").write_text(text or described(name)[0], "ascii")
    (folder / "main.c").write_text(PROGRAM.replace("NAME", name), "ascii")
    options = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Werror"]
    widths = ["-DDAC_OUTPUT_STORAGE_BITS=32"]
    includes = [f"-I{folder}", f"-I{FOLDER}", *(f"-I{path}" for path in RUNTIME)]
    run_clean(["gcc", *options, *widths, *includes, folder / "main.c", "-o", folder / "frames"])
    typed = "".join(f"{x} {y}\n" for x, y in words).encode()
    octets = start([folder / "frames"], input=typed, capture_output=True, check=True, timeout=600).stdout
    size = values(described(name)[0])[0] // 8
    assert len(octets) % size == 0
    return size, [int.from_bytes(octets[i : i + size], "big") for i in range(0, len(octets), size)]


def outputs(name: str, frames: list[int], ticks: int) -> Iterator[Codes]:
    """Yield the codes at the outputs after the start, and after each tick of two frames and LDAC."""
    chip = CHIPS[name]()
    setups = values(described(name)[0])[6]
    begun, begin = frames[: -2 * ticks], 2 + setups
    assert len(begun) == 2 * begin
    for index, frame in enumerate(begun):
        chip.take(index // begin, frame)
        chip.load()
    yield chip.codes()
    for tick in range(ticks):
        for output in (0, 1):
            chip.take(output, frames[2 * begin + 2 * tick + output])
        chip.load()
        yield chip.codes()


@pytest.fixture(scope="module", params=CONVERTERS)
def played(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, list[Codes], list[tuple[int, int]]]:
    """A converter, and codes and words of a line of the example with the [dac] table of its file."""
    name = request.param
    table = described(name)[1]
    changes = {f"dac.{key}": value for key, value in table.items()}
    if table.get("v_min", -10.0) == 0:  # the example's amplifier is for a converter of both signs
        changes |= {"amplifier.gain": 20.0, "amplifier.bias_v": 0.0}
    program = build(tmp_path_factory.mktemp(name), Variant({**changes, "timing.lines": 8})).plan.program
    line = play_line(program, 3)
    codes: list[Codes] = list(zip(line.x.tolist(), line.y.tolist(), strict=True))
    words = [(program.x.output.word(x), program.y.output.word(y)) for x, y in codes]  # type: ignore[arg-type]
    return name, codes, words


@pytest.mark.common
def test_a_converter_has_the_codes_of_the_model(
    played: tuple[str, list[Codes], list[tuple[int, int]]], tmp_path: Path
) -> None:
    name, codes, words = played
    size, frames = sent(tmp_path / "own", name, words)
    assert size == (2 if name in ("ad5541a", "mcp4922") else 3)
    assert list(outputs(name, frames, len(codes))) == [codes[0], *codes]


@pytest.mark.common
@pytest.mark.parametrize("name", ["ad5781", "ad5791"])
def test_an_output_is_switched_on_at_the_first_word(name: str, tmp_path: Path) -> None:
    words = [(0x81234, 0x7EDCC)]
    frames = sent(tmp_path / "own", name, words)[1]
    chip = CHIPS[name]()
    first = words[0][0] >> 20 - chip.bits
    seen = []
    for frame in frames[:3]:
        chip.take(0, frame)
        chip.load()
        seen.append(chip.codes()[0])
    assert seen == [None, first, first]


@pytest.mark.common
@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("ad5791", "UINT32_C(0x200012)", "UINT32_C(0x200002)"),  # two's complement
        ("ad5781", "24, 20, 0,", "24, 18, 0,"),
        ("dac8562", "UINT32_C(0x010000)", "UINT32_C(0x180000)"),  # write and update A
        ("mcp4922", "16, 12, 0,", "16, 12, 1,"),
    ],
)
def test_a_wrong_frame_is_seen(name: str, old: str, new: str, tmp_path: Path) -> None:
    text, table = described(name)
    assert text.count(old) == 1
    bits = int(str(table.get("word_bits", table["bits"])))
    words = [(3 << bits - 3, 5 << bits - 3)] * 2
    right = list(outputs(name, sent(tmp_path / "own", name, words)[1], 2))
    frames = sent(tmp_path / "wrong", name, words, text.replace(old, new))[1]
    try:
        wrong = list(outputs(name, frames, 2))
    except AssertionError:
        wrong = []  # the converter takes no such frame
    assert wrong != right


def test_the_verilog_takes_the_same_frames() -> None:
    """The table of docs/verilog.md has the parameters of ``dac_spi`` for each converter that is here."""
    rows = {}
    for line in (REPOSITORY / "docs" / "verilog.md").read_text("utf-8").splitlines():
        cells = [cell.strip() for cell in line.split("|")]
        if len(cells) > 4 and "FRAME_BITS = " in cells[3]:
            stated = dict(re.findall(r"(\w+) = (?:\w+ = )?(?:24'h)?([0-9A-Fa-f]+)", cells[3]))
            rows[cells[1].split(",")[0].lower()] = cells[3], stated
    assert set(rows) >= set(CONVERTERS) - {"ad5781"}  # "as AD5791"
    for name in set(CONVERTERS) - {"ad5781"}:
        frame_bits, word_bits, lsb, mode, a, b = values(described(name)[0])[:6]
        text, stated = rows[name]
        assert (int(stated["FRAME_BITS"]), int(stated["WORD_BITS"])) == (frame_bits, word_bits), name
        assert int(stated.get("DATA_LSB", "0")) == lsb
        assert int(stated.get("CPHA", "0")) == mode, name
        first = re.search(r"X_PREFIX = (?:Y_PREFIX = )?\d+'h([0-9A-F]+)", text)
        second = re.search(r"Y_PREFIX = \d+'h([0-9A-F]+)", text)
        assert int(first[1] if first else "0", 16) == a, name
        assert int(second[1] if second else "0", 16) == b, name


def test_every_converter_is_modelled_and_listed() -> None:
    assert set(CHIPS) == set(CONVERTERS)
    table = (REPOSITORY / "docs" / "c.md").read_text("utf-8")
    assert all(f"`{name}.h`" in table for name in CONVERTERS)
