"""Frames of examples/firmware/converters, read by models of the converters (``converter_chips``).

The models have the codes of the integer model: of a scan, and of any codes that hypothesis finds. Frames are made on
this machine and on MIPS, whose byte order is the other one, as bytes and as numbers of 16 or 32 bits.
"""

import re
import sys
import tomllib
from pathlib import Path
from subprocess import run as start

import pytest
from building import REPOSITORY, Variant, build, run_clean, tool
from converter_chips import CHIPS, Board, Codes
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tablegen.base.resources import c_runtime
from tablegen.device.played_lines import play_line
from tablegen.fixedpoint.output import Output

FOLDER = REPOSITORY / "examples" / "firmware" / "converters"
CONVERTERS = sorted(path.stem for path in FOLDER.glob("*.h") if path.stem != "spi_words")
RUNTIME = sorted({str(path.parent) for path in c_runtime()})
# Reads words of x and y, writes the frames of the start of each output and then those of all words: as bytes, and those
# of all words as numbers, x first.
PROGRAM = """
#include <stdio.h>
#include "NAME.h"

int main(void)
{
    static dac_output words[2 * 4096];
    static unsigned char frames[8192 * 4 + 32];
    static uint32_t wide[8192];
    static uint16_t narrow[8192];
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
    if (NAME.frame_bits == 16) {
        uint16_t *after = dac_spi_frames16(&NAME, 0, words, count, narrow);
        after = dac_spi_frames16(&NAME, 1, words + 1, count, after);
        fwrite(narrow, sizeof *narrow, (size_t)(after - narrow), stdout);
    } else {
        uint32_t *after = dac_spi_frames32(&NAME, 0, words, count, wide);
        after = dac_spi_frames32(&NAME, 1, words + 1, count, after);
        fwrite(wide, sizeof *wide, (size_t)(after - wide), stdout);
    }
    return 0;
}
"""


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


def compiled(folder: Path, name: str, text: str | None = None, compiler: str = "gcc") -> Path:
    """Compile the program for a converter; ``text`` replaces its file."""
    folder.mkdir(exist_ok=True)
    (folder / f"{name}.h").write_text(text or described(name)[0], "ascii")
    (folder / "main.c").write_text(PROGRAM.replace("NAME", name), "ascii")
    options = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Werror", "-static"]
    includes = [f"-I{folder}", f"-I{FOLDER}", *(f"-I{path}" for path in RUNTIME)]
    run_clean(
        [compiler, *options, "-DDAC_OUTPUT_STORAGE_BITS=32", *includes, folder / "main.c", "-o", folder / "frames"]
    )
    return folder / "frames"


def sent(
    program: Path, name: str, words: list[tuple[int, int]], emulator: str = "", order: str = sys.byteorder
) -> list[int]:
    """Return the frames that the C makes of words; those that it makes as numbers are the same."""
    typed = "".join(f"{x} {y}\n" for x, y in words).encode()
    command = [tool(emulator), program] if emulator else [program]
    octets = start(command, input=typed, capture_output=True, check=True, timeout=600).stdout
    bits, setups = values((program.parent / f"{name}.h").read_text("ascii"))[:7:6]
    size, each = bits // 8, 2 if bits == 16 else 4
    count = 2 * (2 + setups) + 2 * len(words)
    numbers = octets[count * size :]
    assert len(numbers) == 2 * len(words) * each
    frames = [int.from_bytes(octets[i : i + size], "big") for i in range(0, count * size, size)]
    whole = [int.from_bytes(numbers[i : i + each], order) for i in range(0, len(numbers), each)]  # type: ignore[arg-type]
    pairs = frames[-2 * len(words) :]
    assert whole == [*pairs[::2], *pairs[1::2]]
    return frames


def outputs(name: str, frames: list[int], ticks: int) -> list[Codes]:
    """Return the codes at the outputs after the start, and after each tick of two frames and LDAC."""
    return list(Board(name).play(frames, len(frames) // 2 - ticks - 2))


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
    frames = sent(compiled(tmp_path, name), name, words)
    assert outputs(name, frames, len(codes)) == [codes[0], *codes]


@pytest.mark.rest
def test_a_converter_has_the_codes_of_the_model_from_mips(
    played: tuple[str, list[Codes], list[tuple[int, int]]], tmp_path: Path
) -> None:
    """The other byte order: the same bytes, and numbers whose highest byte is in front."""
    name, codes, words = played
    program = compiled(tmp_path, name, compiler="mips-linux-gnu-gcc")
    frames = sent(program, name, words, "qemu-mips", "big")
    assert outputs(name, frames, len(codes)) == [codes[0], *codes]


def output_of(name: str) -> Output:
    """Return the output stage of the integer model with the [dac] table of a converter."""
    table = described(name)[1]
    bits = int(str(table["bits"]))
    word_bits, align = int(str(table.get("word_bits", bits))), str(table.get("align", "right"))
    return Output(0, 0, 0, 0, (1 << bits) - 1, 1, 0, bits, str(table["coding"]), align, word_bits)


@pytest.fixture(scope="module", params=CONVERTERS)
def program_of(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """A converter and its compiled program."""
    return request.param, compiled(tmp_path_factory.mktemp(request.param), request.param)


@pytest.mark.common
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(shares=st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), min_size=1, max_size=40))
@example(shares=[(0.0, 1.0), (1.0, 0.0), (0.5, 0.5), (0.499999, 0.500001), (0.0, 0.0), (1.0, 1.0)])
def test_any_codes_arrive(program_of: tuple[str, Path], shares: list[tuple[float, float]]) -> None:
    """Codes are given as shares of the range, so that the same example serves all widths."""
    name, program = program_of
    output = output_of(name)
    codes = [(int(x * output.code_max), int(y * output.code_max)) for x, y in shares]
    words = [(int(output.word(x)), int(output.word(y))) for x, y in codes]
    assert outputs(name, sent(program, name, words), len(codes)) == [codes[0], *codes]


@pytest.mark.common
def test_frames_of_32_bits(tmp_path: Path) -> None:
    """An LTC2668 takes them too: eight zeros in front."""
    text = described("ltc2668")[0]
    assert text.count("    24, 16,") == 1
    program = compiled(tmp_path, "ltc2668", text.replace("    24, 16,", "    32, 16,"))
    words = [(0, 0xFFFF), (0x8000, 0x7FFF), (0x1234, 0xEDCB)]
    frames = sent(program, "ltc2668", words)
    assert outputs("ltc2668", frames, 3) == [words[0], *words]


@pytest.mark.common
@pytest.mark.parametrize("name", ["ad5781", "ad5791"])
def test_an_output_is_switched_on_at_the_first_word(name: str, tmp_path: Path) -> None:
    words = [(0x81234, 0x7EDCC)]
    frames = sent(compiled(tmp_path, name), name, words)
    chip = CHIPS[name]()
    first = words[0][0] >> (2 if name == "ad5781" else 0)
    seen = []
    for frame in frames[:3]:
        chip.take(frame)
        chip.load()
        seen.append(chip.codes()[0])
    assert seen == [None, first, first]


# What may be wrong in a converter's file, and in what makes the frames.
FAULTS = [
    ("ad5541a", "16, 16, 0, 0,", "16, 15, 0, 0,"),
    ("ad5791", "UINT32_C(0x200312)", "UINT32_C(0x200302)"),  # two's complement
    ("ad5791", "UINT32_C(0x200312)", "UINT32_C(0x200316)"),  # clamped to ground
    ("ad5791", "UINT32_C(0x200312)", "UINT32_C(0x20031A)"),  # three-state
    ("ad5791", "UINT32_C(0x200312)", "UINT32_C(0x200012)"),  # for references 10 V apart
    ("ad5791", "1, {UINT32_C", "0, {UINT32_C"),
    ("ad5791", "{UINT32_C(0x100000),", "{UINT32_C(0x900000),"),  # a read
    ("ad5781", "24, 20, 0,", "24, 18, 0,"),
    ("ad5761", "UINT32_C(0x040208)", "UINT32_C(0x040288)"),  # two's complement
    ("ad5761", "UINT32_C(0x040208)", "UINT32_C(0x04020A)"),  # -5..+5 V
    ("ad5761", "UINT32_C(0x0F0000), UINT32_C(0x040208)", "UINT32_C(0x040208), UINT32_C(0x0F0000)"),
    ("ad5764", "UINT32_C(0x110000)", "UINT32_C(0x120000)"),  # output C
    ("ad5764", "24, 16, 0,", "24, 16, 4,"),
    ("dac8562", "UINT32_C(0x010000)", "UINT32_C(0x180000)"),  # write and update A
    ("dac8562", "UINT32_C(0x380001)", "UINT32_C(0x380000)"),  # the reference off
    ("ltc2668", "UINT32_C(0xE00003)", "UINT32_C(0xE00002)"),  # -5..+5 V
    ("ltc2668", "UINT32_C(0x000000), UINT32_C(0x010000)", "UINT32_C(0x010000), UINT32_C(0x000000)"),
    ("mcp4922", "16, 12, 0,", "16, 12, 1,"),
    ("mcp4922", "UINT32_C(0x3000)", "UINT32_C(0x1000)"),  # a gain of two
    ("mcp4922", "UINT32_C(0xB000)", "UINT32_C(0xA000)"),  # shut down
    ("spi_words", "(UINT32_C(1) << converter->word_bits) - 1", "UINT32_C(0xFFFFFFFF)"),
    ("spi_words", "(uint8_t)(frame >> bits)", "(uint8_t)(frame >> (converter->frame_bits - 8 - bits))"),
    ("spi_words", "dac_spi_frame(converter, 1, *b)", "dac_spi_frame(converter, 0, *b)"),
    ("spi_words", "*to++ = dac_spi_frame(converter, output, *words);",
     "*to++ = dac_spi_frame(converter, 0 & output, *words);"),
    ("spi_words", "done < converter->setups", "done < 1u"),
    ("spi_words", "        b += DAC_STRIDE;", "        b += 1;"),
    ("spi_words", "(uint16_t)dac_spi_frame(converter, output, *words)",
     "(uint16_t)dac_spi_frame(converter, output, *words << 8)"),
]  # fmt: skip


def right(name: str, program: Path) -> bool:
    """Whether the codes of some words arrive, of which those of two's complement have their sign above the word."""
    output = output_of(name)
    codes = [(output.code_max * 3 // 8, output.code_max * 5 // 8), (0, output.code_max), (output.code_max, 1)]
    words = [(int(output.word(x)), int(output.word(y))) for x, y in codes]
    if output.coding == "twos-complement":
        sign = 1 << output.word_bits - 1
        words = [(x | -(x & sign) & 0xFFFFFFFF, y | -(y & sign) & 0xFFFFFFFF) for x, y in words]
    try:
        return outputs(name, sent(program, name, words), len(codes)) == [codes[0], *codes]
    except AssertionError:
        return False  # the converter takes no such frame


@pytest.mark.common
@pytest.mark.parametrize(("place", "old", "new"), FAULTS)
def test_a_wrong_frame_is_seen(place: str, old: str, new: str, tmp_path: Path) -> None:
    text = (FOLDER / f"{place}.h").read_text("ascii")
    assert text.count(old) == 1
    (tmp_path / f"{place}.h").write_text(text.replace(old, new), "ascii")
    if place == "spi_words":
        assert any(not right(name, compiled(tmp_path, name)) for name in ("ad5764", "ad5761", "mcp4922"))
    else:
        assert not right(place, compiled(tmp_path, place, text.replace(old, new)))


@pytest.mark.common
def test_frames_without_a_fault_are_right(program_of: tuple[str, Path]) -> None:
    assert right(*program_of)


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


@pytest.mark.parametrize("name", CONVERTERS)
def test_constants_of_a_converter_are_those_of_its_table(name: str) -> None:
    text = described(name)[0]
    constants = dict(re.findall(rf"{name}_(\w+) = (\d+)", text))
    output = output_of(name)
    frame_bits, word_bits = values(text)[:2]
    assert constants == {
        "frame_bits": str(frame_bits),
        "bits": str(output.dac_bits),
        "word_bits": str(word_bits),
        "twos_complement": str(int(output.coding == "twos-complement")),
    }
    assert word_bits == output.word_bits


@pytest.mark.common
def test_a_scan_for_another_converter_is_known(tmp_path: Path) -> None:
    """The words fit or not: bits, bits of the word, two's complement, left-aligned."""
    cases = {
        "ad5781": [(18, 20, 0, 1, 1), (18, 20, 0, 0, 0), (20, 20, 0, 0, 0), (16, 20, 0, 1, 1), (18, 20, 1, 1, 0)],
        "ad5764": [(16, 16, 1, 0, 1), (16, 16, 0, 0, 0), (12, 12, 1, 0, 0), (12, 16, 1, 1, 1), (12, 16, 1, 0, 0)],
        "mcp4922": [(12, 12, 0, 0, 1), (16, 16, 0, 0, 0)],
    }
    names = ("DAC_BITS", "DAC_WORD_BITS", "DAC_TWOS_COMPLEMENT", "DAC_LEFT_ALIGNED")
    lines = [f'#include "{name}.h"' for name in cases]
    for name, rows in cases.items():
        for at, (*scan, fits) in enumerate(rows):
            axis = f"{name.upper()}_{at}"
            lines += [f"#define {axis}_{key} {value}" for key, value in zip(names, scan, strict=True)]
            lines.append(f"typedef char {name}_{at}[DAC_SPI_FITS({name}, {axis}) == {fits} ? 1 : -1];")
    (tmp_path / "fits.c").write_text("\n".join([*lines, "int main(void) { return 0; }", ""]), "ascii")
    includes = [f"-I{FOLDER}", *(f"-I{path}" for path in RUNTIME)]
    run_clean(["gcc", "-std=c99", *includes, "-fsyntax-only", tmp_path / "fits.c"])


def test_every_converter_is_modelled_and_listed() -> None:
    assert set(CHIPS) == set(CONVERTERS)
    table = (REPOSITORY / "docs" / "c.md").read_text("utf-8")
    assert all(f"`{name}.h`" in table for name in CONVERTERS)
