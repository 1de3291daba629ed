"""The memory and the product that the ECP5 has in its own cells: they are those of every other part, on every clock.

The cells are models of ours by the maker's notes; yosys has their pins alone. ``benchmarks/resources.py`` places them.
"""

from pathlib import Path

import pytest
from building import BENCHES, run_clean
from sets import one_of
from stream_benches import equal
from stream_configurations import CONFIGURATIONS
from test_lint import MODULES

from tablegen.base.resources import verilog_runtime
from tablegen.verification.verilog.sequencer_bench import SequencerBench

CELLS = MODULES / "ecp5"
MODELS = [BENCHES / "dp16kd.v", BENCHES / "mult18x18d.v"]
LATENCY = 2  # clocks
# Bits of a word and of an address: each width of a block, alone and beside others, and more words than blocks have.
MEMORIES = [(16, 4), (18, 10), (24, 10), (8, 11), (16, 11), (21, 12), (16, 13), (9, 14), (16, 15)]
FACTORS = [(18, 18), (17, 16), (2, 18), (18, 2)]


def played(folder: Path, sources: list[Path], **parameters: int) -> list[tuple[str, ...]]:
    """The lines of the bench."""
    options = [f"-Pcells_bench.{name}={value}" for name, value in parameters.items()]
    program = folder / "cells.vvp"
    run_clean(
        ["iverilog", "-g2005", "-Wall", "-Wno-timescale", *options, "-o", program, BENCHES / "cells_bench.v", *sources]
    )
    return [
        tuple(line.split()) for line in run_clean(["vvp", "-n", program], folder).splitlines() if "finish" not in line
    ]


def wrong_words(lines: list[tuple[str, ...]]) -> tuple[int, int]:
    """How many words were compared, and how many are others than those of the address two clocks before."""
    words: dict[int, int] = {}
    written: list[int | None] = []
    reads: list[tuple[int, int | None]] = []
    compared = wrong = 0
    for write, write_address, data, address, word, *_ in lines:
        if len(reads) >= LATENCY - 1:
            at, expected = reads[1 - LATENCY]
            # A word that is written on the clock of the address, or on the one after, may be the old or the new one.
            if expected is not None and at not in (written[-1], int(write_address) if write == "1" else None):
                compared += 1
                wrong += word != str(expected)
        reads.append((int(address), words.get(int(address))))
        written.append(int(write_address) if write == "1" else None)
        if write == "1":
            words[int(write_address)] = int(data)
    return compared, wrong


def wrong_products(lines: list[tuple[str, ...]]) -> int:
    factors = [(int(a), int(b)) for *_, a, b, _ in lines]
    products = [product for *_, product in lines]
    return sum(
        product != str(a * b) for (a, b), product in zip(factors[: 1 - LATENCY], products[LATENCY - 1 :], strict=True)
    )


@pytest.mark.parametrize("part", ["", "ecp5"])
@pytest.mark.parametrize(("bits", "address_bits"), MEMORIES)
def test_a_word_comes_two_clocks_after_its_address(tmp_path: Path, part: str, bits: int, address_bits: int) -> None:
    sources = [MODULES / part / "dac_memory.v", MODULES / "dac_product.v", *(MODELS[:1] if part else [])]
    compared, wrong = wrong_words(played(tmp_path, sources, BITS=bits, ADDRESS_BITS=address_bits))
    assert wrong == 0
    assert compared > 1000


@pytest.mark.parametrize("part", ["", "ecp5"])
@pytest.mark.parametrize(("a_bits", "b_bits"), FACTORS)
def test_a_product_comes_two_clocks_after_its_factors(tmp_path: Path, part: str, a_bits: int, b_bits: int) -> None:
    sources = [MODULES / "dac_memory.v", MODULES / part / "dac_product.v", *(MODELS[1:] if part else [])]
    assert wrong_products(played(tmp_path, sources, A_BITS=a_bits, B_BITS=b_bits)) == 0


MUTANTS = [
    ("dac_memory", '.REGMODE_B("OUTREG")', '.REGMODE_B("NOREG")'),
    ("dac_memory", "? 4 : 14 - ADDRESS_BITS", "? 4 : 13 - ADDRESS_BITS"),
    ("dac_memory", "32'd3 : 32'd0", "32'd1 : 32'd0"),
    ("dac_memory", "ADDRESS_BITS == 12 ? 4", "ADDRESS_BITS == 12 ? 9"),
    ("dac_product", '.REG_OUTPUT_CLK("CLK0")', '.REG_OUTPUT_CLK("NONE")'),
    ("dac_product", '.REG_INPUTA_CLK("CLK0")', '.REG_INPUTA_CLK("NONE")'),
    ("dac_product", "b_wide = b_long[17:0]", "b_wide = {2'd0, b_long[15:0]}"),
]


@pytest.mark.parametrize(("module", "right", "wrong"), MUTANTS)
def test_a_fault_in_the_cells_is_found(tmp_path: Path, module: str, right: str, wrong: str) -> None:
    text = (CELLS / f"{module}.v").read_text("ascii")
    assert text.count(right) == 1
    changed = tmp_path / f"{module}.v"
    changed.write_text(text.replace(right, wrong), "ascii")
    other = "dac_product" if module == "dac_memory" else "dac_memory"
    found = 0
    for address_bits in (10, 12) if module == "dac_memory" else (4,):
        sources = [changed, MODULES / f"{other}.v", MODELS[module == "dac_product"]]
        lines = played(tmp_path, sources, BITS=18, ADDRESS_BITS=address_bits, A_BITS=17, B_BITS=16)
        found += wrong_words(lines)[1] + wrong_products(lines)
    assert found


@pytest.mark.rest
@pytest.mark.parametrize("name", one_of(2, ["bits_18_plain", "bits_24_plain", "dac_8_words_24_plain", "cubic"]))
def test_the_sequencer_plays_the_model_with_them(tmp_path: Path, name: str) -> None:
    """Direct, interpolated and cubic tables, and words wider than a block."""
    own = {path.name for path in CELLS.glob("*.v")}
    sources = [path for path in verilog_runtime() if path.name not in own] + sorted(CELLS.glob("*.v")) + MODELS
    configuration = CONFIGURATIONS[name]
    bench = SequencerBench("icarus", configuration.shape, tmp_path, configuration.parameters, sources)
    script = configuration.script(name)
    assert equal(bench, script).samples == len(script.expected)
