"""dac_coding against ``Output.word``, and mutants of it."""

import random
from pathlib import Path

import pytest
from building import BENCHES
from spi_bench import AD5541A, CODING, Mutant, Spi

from tablegen.verification.verilog.simulate import Design, compile_design

pytestmark = pytest.mark.common


def codings() -> list[Spi]:
    """Every coding and alignment of 8 to 24 bits in words of their own width, of 16, of 24 and of 32."""
    return [
        Spi(bits=bits, word_bits=word_bits, twos_complement=twos_complement, left_aligned=left_aligned)
        for bits in (8, 10, 12, 14, 16, 18, 20, 24)
        for word_bits in sorted({width for width in (bits, 16, 24, 32) if width >= bits})
        for twos_complement in (0, 1)
        for left_aligned in (0, 1)
    ]


def codes_of(bits: int) -> list[int]:
    """All of them up to 12 bits, else the edges of every bit and some at random."""
    if bits <= 12:
        return list(range(2**bits))
    generator = random.Random(bits)
    edges = {code for bit in range(bits + 1) for code in (2**bit - 1, 2**bit, 2**bits - 2**bit) if code < 2**bits}
    return sorted(edges) + [generator.randrange(2**bits) for _ in range(300)]


def coded(folder: Path, module: Path) -> list[tuple[Spi, list[int]]]:
    """What the module makes of ``codes_of``, for all of ``codings``."""
    folder.mkdir(parents=True, exist_ok=True)
    instances = []
    for index, setup in enumerate(codings()):
        names = ("bits", "word_bits", "twos_complement", "left_aligned")
        given = "".join(f", .{name.upper()}({getattr(setup, name)})" for name in names)
        instances.append(
            f'    outputs_coding_bench #(.CODES("{setup.bits}.hex"), .WORDS("{index}.txt"),'
            f" .COUNT({len(codes_of(setup.bits))}){given}) bench_{index} (.done(done[{index}]));\n"
        )
    top = folder / "outputs_top.v"
    top.write_text(
        f"`timescale 1ns / 1ps\nmodule outputs_top;\n    wire [{len(instances) - 1}:0] done;\n"
        f"    wire all_done = &done;\n{''.join(instances)}endmodule\n",
        "ascii",
    )
    compiled = compile_design(
        "icarus", Design([top, BENCHES / "outputs_coding_bench.v", module], "outputs_top"), folder / "build"
    )
    for bits in {setup.bits for setup in codings()}:
        (compiled.folder / f"{bits}.hex").write_text("".join(f"{code:x}\n" for code in codes_of(bits)), "ascii")
    assert compiled.run("cocotb_outputs") == (1, 0)
    return [
        (setup, [int(line, 16) for line in (compiled.folder / f"{index}.txt").read_text("ascii").split()])
        for index, setup in enumerate(codings())
    ]


def differing(results: list[tuple[Spi, list[int]]]) -> list[Spi]:
    return [setup for setup, words in results if words != [setup.word(code) for code in codes_of(setup.bits)]]


def test_coding_equals_the_model(tmp_path: Path) -> None:
    results = coded(tmp_path, CODING)
    assert sum(len(words) for _, words in results) > 100_000
    assert differing(results) == []


@pytest.mark.rest
@pytest.mark.parametrize(
    ("old", "new", "touched"),
    [
        ("TWOS_COMPLEMENT != 0", "TWOS_COMPLEMENT == 0", lambda setup: True),
        ("(LEFT_ALIGNED != 0)", "(LEFT_ALIGNED == 0)", lambda setup: setup.word_bits > setup.bits),
        (
            "{{(WORD_BITS - BITS){1'b0}}, coded}",
            "{{(WORD_BITS - BITS){coded[BITS-1]}}, coded}",
            lambda setup: setup.word_bits > setup.bits and not setup.left_aligned,
        ),
    ],
)
def test_a_mutant_of_the_coding_is_found(tmp_path: Path, old: str, new: str, touched) -> None:
    (tmp_path / "dac_coding.v").write_text(Mutant(AD5541A, old, new, "", CODING).text(), "utf-8")
    results = coded(tmp_path / "coded", tmp_path / "dac_coding.v")
    assert differing(results) == [setup for setup in codings() if touched(setup)]
