"""Emitted Verilog and memory files against Icarus Verilog, and against the integer model.

Every configuration has to pass ``iverilog -g2005 -Wall``; its constants and its memories, as a simulator reads them,
have to equal the manifest; ``examples/verilog/play.v`` has to put out the codes of ``play_line``, tick for tick.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from building import (
    BENCHES,
    FEW,
    IN_C,
    NAME,
    REPOSITORY,
    VARIANTS,
    Build,
    Variant,
    build,
    build_stressed,
    constants,
    fourier_words,
    run_clean,
)
from sets import quick

from tablegen.device.played_lines import play_line
from tablegen.numerics.arrays import Ints

PLAYER = REPOSITORY / "examples" / "verilog" / "play.v"
LINES = 2  # of configurations whose frame is too long to be played whole


@pytest.fixture(
    scope="module",
    params=quick(FEW, VARIANTS),
)
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Build:
    return build(tmp_path_factory.mktemp("variant"), VARIANTS[request.param])


def compile_verilog(built: Build, *sources: Path, dialect: str = "-g2005") -> Path:
    program = built.folder / f"{sources[0].stem}.vvp"
    run_clean(["iverilog", dialect, "-Wall", f"-I{built.folder}", "-o", program, *sources])
    return program


def simulate(built: Build, program: Path, *arguments: str) -> list[str]:
    """What a simulation prints; Icarus warns on stdout of files that are missing or too short."""
    lines = run_clean(["vvp", "-n", program, *arguments], built.folder).splitlines()
    assert not [line for line in lines if "WARNING" in line or "ERROR" in line]
    return lines


def simulated_codes(built: Build, ticks: int, gap: int = 0) -> Ints:
    """Columns: x, y."""
    program = compile_verilog(built, BENCHES / "play_bench.v", PLAYER)
    lines = simulate(built, program, f"+ticks={ticks}", f"+gap={gap}")
    return np.array([line.split() for line in lines]).astype(np.int64)


def model_codes(built: Build, lines: int) -> Ints:
    """The same columns from the integer model; lines past the frame begin it again."""
    program = built.plan.program
    ticks = [play_line(program, line % built.plan.schedule.lines) for line in range(lines)]
    return np.concatenate([np.stack([line.x, line.y], axis=1) for line in ticks])


def memories(built: Build) -> list[int]:
    """Every word of the memory files, as a simulator has them: tables of x and y, then their Fourier words."""
    return [int(line) for line in simulate(built, compile_verilog(built, BENCHES / "memory_bench.v"))]


def manifest_words(built: Build) -> list[int]:
    axes = [built.manifest["axes"][axis] for axis in "xy"]
    return [word for axis in axes for word in [*axis["table"]["words"], *fourier_words(axis)]]


def verilog_constants(manifest: dict[str, Any]) -> dict[str, int]:
    """All constants but names of files; those of shaping are 0 in these scans, a direct table has address bits."""
    numbers = constants(manifest) | widths(manifest) | {"SHAPING": 0, "PIXEL_INDEX_BITS": 0, "CLOCKS_PER_TICK": 0}
    for axis in "XY":
        numbers |= {f"{axis}_SHAPING_ORDER": 0, f"{axis}_SHAPING_ZERO": 0}
        if not numbers[f"{axis}_INTERPOLATED"]:
            length = numbers[f"{axis}_TABLE_LENGTH"]
            numbers[f"{axis}_INDEX_BITS"] = next(n for n in range(2, 32) if length <= 2**n)
    return numbers


def widths(manifest: dict[str, Any]) -> dict[str, int]:
    """The least widths of the counters, from the definitions of their parameters."""
    scan = constants(manifest)
    period, bits = scan["Y_PHASE_PERIOD"], range(32)
    return {
        "TICK_BITS": next(n for n in bits if scan["LINE_TICKS"] <= 2**n and n >= 3),
        "LINE_BITS": next(n for n in bits if scan["FRAME_LINES"] <= 2**n and n >= 1),
        "PERIOD_BITS": next(n for n in bits if period < 2**n),
    }


def flip(path: Path, line: int, bit: int) -> None:
    """Flip one bit of one word of a memory file."""
    words = path.read_text("ascii").split()
    words[line] = f"{int(words[line], 16) ^ (1 << bit):0{len(words[line])}x}"
    path.write_text("\n".join(words) + "\n", "ascii")


@pytest.mark.parametrize("dialect", ["-g2005", "-g2009", "-g2012"])
def test_header_parses_inside_a_module(built: Build, dialect: str) -> None:
    module = built.folder / "module.v"
    module.write_text(f'module m;\n`include "{NAME}.vh"\nendmodule\n', "ascii")
    run_clean(["iverilog", dialect, "-Wall", "-t", "null", f"-I{built.folder}", module])


def test_constants_equal_the_manifest(built: Build) -> None:
    """Every localparam but the file names, printed by a simulation; the header defines no others."""
    manifest, names = built.manifest, verilog_constants(built.manifest)
    header = built.files[f"{NAME}.vh"].decode("ascii")
    defined = [line.split("=")[0].split()[-1] for line in header.splitlines() if line.startswith("localparam")]
    prefix = f"{NAME.upper()}_"
    files = {f"{prefix}{axis}_{kind}_FILE" for axis in "XY" for kind in ("TABLE", "FOURIER")}
    files |= {prefix + "PROGRAM_FILE", prefix + "SINE_FILE"}
    assert set(defined) == {prefix + name for name in names} | files | {prefix + "HASH"}
    assert len(defined) == len(set(defined))

    bench = built.folder / "constants_bench.v"
    shown = "".join(f'        $display("%0d", {prefix}{name});\n' for name in names)
    bench.write_text(
        f'module constants_bench;\n    `include "{NAME}.vh"\n    initial begin\n{shown}'
        f'        $display("%h", {prefix}HASH);\n    end\nendmodule\n',
        "ascii",
    )
    *numbers, digest = simulate(built, compile_verilog(built, bench))
    assert list(map(int, numbers)) == list(names.values())
    assert digest == manifest["hash"]


def test_memories_equal_the_manifest(built: Build) -> None:
    assert memories(built) == manifest_words(built)


def test_memory_words_have_their_full_width(built: Build) -> None:
    """One word a line, of as many digits as the widest, in two's complement."""
    for axis, content in built.manifest["axes"].items():
        for name, bits, words in (
            (f"{NAME}_{axis}.mem", content["table"]["bits"], content["table"]["words"]),
            (f"{NAME}_{axis}_fourier.mem", 32, fourier_words(content)),
        ):
            lines = built.files[name].decode("ascii").splitlines()
            assert {len(line) for line in lines} == {-(-bits // 4)}
            assert [int(line, 16) - (int(line, 16) >> (bits - 1) << bits) for line in lines] == words


@pytest.mark.common
def test_player_equals_the_model(built: Build) -> None:
    schedule = built.plan.schedule
    lines = schedule.lines + 1 if schedule.lines <= 8 else LINES
    assert np.array_equal(simulated_codes(built, lines * schedule.ticks), model_codes(built, lines))


@pytest.mark.parametrize("name", ["cubic", "cubic_wide"])
@pytest.mark.parametrize("gap", [0, 2])
def test_player_of_a_cubic_table_equals_the_model(tmp_path: Path, name: str, gap: int) -> None:
    """Words of 14 bits on both axes; of 21 bits on x, with lines on y."""
    cubic = IN_C[name]
    built = build(tmp_path, Variant({**cubic.scan, "emit.formats": ["verilog"]}, cubic.scanner))
    expected = model_codes(built, LINES)
    assert np.array_equal(simulated_codes(built, len(expected), gap), expected)


@pytest.mark.parametrize("gap", [1, 6])
def test_player_keeps_its_place_between_ticks(tmp_path: Path, gap: int) -> None:
    built = build(tmp_path, VARIANTS["short_frame"])
    assert np.array_equal(simulated_codes(built, 2 * built.plan.schedule.ticks, gap), model_codes(built, 2))


@pytest.mark.common
@pytest.mark.parametrize(("bits", "gain_word"), [(8, 131071), (16, -131072), (21, 131071), (24, -131072), (24, 131071)])
def test_player_does_not_wrap_at_the_ends_of_the_arithmetic(tmp_path: Path, bits: int, gain_word: int) -> None:
    """Noise over the whole range of the words, the largest gains, and limits that clamp."""
    stressed = build_stressed(tmp_path, bits, gain_word)
    lines = stressed.plan.schedule.lines
    expected = model_codes(stressed, lines)
    assert {1000, 60000} <= set(expected[:, 0].tolist()), "the limits are meant to be reached"
    assert np.array_equal(simulated_codes(stressed, len(expected)), expected)


@pytest.mark.common
@pytest.mark.parametrize(
    ("name", "bits", "line", "bit"),
    [("x.mem", 16, 100, 0), ("y.mem", 16, 2047, 15), ("x_fourier.mem", 32, 0, 31), ("y_fourier.mem", 32, 128, 0)],
)
def test_a_flipped_bit_in_a_memory_is_found(tmp_path: Path, name: str, bits: int, line: int, bit: int) -> None:
    """Negative control of the comparison of memories."""
    built = build(tmp_path, VARIANTS["example"])
    flip(built.folder / f"{NAME}_{name}", line, bit)
    pairs = zip(memories(built), manifest_words(built), strict=True)
    mask = (1 << bits) - 1
    assert [(read ^ written) & mask for read, written in pairs if read != written] == [1 << bit]


def test_a_flipped_bit_in_a_memory_is_heard(tmp_path: Path) -> None:
    """Negative control of the comparison of codes: one bit of a word is seen at the ticks that use the word."""
    built = build(tmp_path, VARIANTS["example"])
    flip(built.folder / f"{NAME}_x.mem", 1000, 6)
    differs = np.flatnonzero(simulated_codes(built, 1250)[:, 0] != model_codes(built, 1)[:, 0])
    assert set(differs.tolist()) <= {k for k in range(1250) if (k * 2048 // 1250) in (999, 1000)}
    assert len(differs) >= 1


@pytest.mark.common
@pytest.mark.parametrize(
    "name", ["two\nlines", "back\\slash\\", '`include "x"', "*/ /* */", "\u00b5-Scanner"], ids=ascii
)
def test_no_scanner_s_name_leaves_its_comment(tmp_path: Path, name: str) -> None:
    """The name of a scanner is free text, and the only free text that reaches an emitted file."""
    built = build(tmp_path, Variant({**VARIANTS["short_frame"].scan}, {"name": name}))
    compile_verilog(built, PLAYER)
