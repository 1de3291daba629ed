"""Emitted C against real compilers, and against the integer model.

Every configuration has to compile without a warning with gcc and clang in three dialects, ``examples/c/play.c`` built
on it has to print the codes of ``play_line``, tick for tick, and a header that was damaged must not compile.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from building import IN_C, NAME, REPOSITORY, VARIANTS, Build, Variant, build, build_stressed, constants, run, run_clean
from sets import by_tool, common, in_pairs, one_of

from tablegen.device.played_lines import play_line
from tablegen.numerics.arrays import Ints

PLAYER = REPOSITORY / "examples" / "c" / "play.c"
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wdouble-promotion", "-Werror"]
SANITIZERS = ["-fsanitize=undefined,address", "-fno-sanitize-recover=all", "-g"]
DIALECTS = {
    "gcc-c99": ["gcc", "-std=c99"],
    "gcc-c11": ["gcc", "-std=c11"],
    "gcc-c++17": ["g++", "-std=c++17", "-x", "c++"],
    "clang-c99": ["clang", "-std=c99"],
    "clang-c11": ["clang", "-std=c11"],
    "clang-c++17": ["clang++", "-std=c++17", "-x", "c++"],
}
# Noise over the whole range of the words and the largest gains: bits of a word, gain word.
STRESS = [(8, 131071), (16, -131072), (21, 131071), (24, -131072), (24, 131071)]


QUICK = ("example", "header_only", "direct_steps", "cubic")
# With every dialect: these differ in what is emitted and how it is held. The others differ in numbers.
WHOLE = (*QUICK, "cubic_wide", "left_aligned")


@pytest.fixture(scope="module", params=common(QUICK, IN_C))
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Build:
    return build(tmp_path_factory.mktemp("variant"), IN_C[request.param])


def sources(built: Build) -> list[Path]:
    """What has to be compiled beside a program that includes the header."""
    return [built.folder / name for name in built.files if name == f"{NAME}.c"]


def compile_player(built: Build, options: list[str]) -> Path:
    program = built.folder / "play"
    run_clean([*options, *WARNINGS, f"-I{built.folder}", PLAYER, *sources(built), "-o", program])
    return program


def played(program: Path, lines: int) -> Ints:
    """Columns: x code, y code, x word, y word."""
    return np.array(run_clean([program, str(lines)]).split(), dtype=np.int64).reshape(-1, 4)


def model(built: Build, lines: int) -> Ints:
    """The same columns from the integer model; lines past the frame begin it again."""
    program = built.plan.program
    ticks = [play_line(program, line % built.plan.schedule.lines) for line in range(lines)]
    x, y = (np.concatenate([getattr(line, axis) for line in ticks]) for axis in "xy")
    x_word, y_word = (
        np.array([axis.output.word(code) for code in codes.tolist()], dtype=np.int64)
        for axis, codes in ((program.x, x), (program.y, y))
    )
    return np.stack([x, y, x_word, y_word], axis=1)


def two_units(built: Build) -> list[Path]:
    """A program of two units that both include the header, the first of them twice."""
    include, shown = f'#include "{NAME}.h"\n', f"{NAME}_x_table[1]"
    first, second = built.folder / "first.c", built.folder / "second.c"
    first.write_text(f"{include}{include}long second(void);\nint main(void) {{ return second() != {shown}; }}\n")
    second.write_text(f"{include}long second(void);\nlong second(void) {{ return {shown}; }}\n")
    return [first, second, *sources(built)]


def of_a_variant(pair: Any) -> Any:
    """Return a pair of variant and dialect with the mark of its variant."""
    return pytest.param(*pair.values, marks=pair.marks if pair.values[0] in QUICK else (*pair.marks, pytest.mark.rest))


@pytest.mark.parametrize(
    ("built", "dialect"),
    [of_a_variant(pair) for pair in in_pairs(list(IN_C), list(DIALECTS), WHOLE, "gcc-c99")],
    indirect=["built"],
)
def test_compiles_without_a_warning(built: Build, dialect: str) -> None:
    run_clean([*DIALECTS[dialect], *WARNINGS, "-fsyntax-only", f"-I{built.folder}", PLAYER, *two_units(built)])


def test_lines_of_the_header_have_at_most_120_characters(built: Build) -> None:
    """But for the warnings at its head, as the build words them, and for rows of numbers."""
    lines = built.files[f"{NAME}.h"].decode("ascii").partition("#ifndef ")[2].splitlines()
    assert [line for line in lines if len(line) > 120 and line.strip("-0123456789, ")] == []


@pytest.mark.common
@pytest.mark.parametrize("name", ["example", "header_only"])
@pytest.mark.parametrize("dialect", by_tool(DIALECTS))
def test_two_units_that_include_the_header_link(tmp_path: Path, name: str, dialect: str) -> None:
    built = build(tmp_path, VARIANTS[name])
    program = built.folder / "units"
    run_clean([*DIALECTS[dialect], f"-I{built.folder}", *two_units(built), "-o", program])
    run_clean([program])


def c_constants(manifest: Mapping[str, Any]) -> dict[str, int]:
    """Those that both languages have, and what C has for the sine: a period and a quarter of the longest table's."""
    found = constants(manifest)
    index_bits = max(found["X_INDEX_BITS"], found["Y_INDEX_BITS"])
    axes = manifest["axes"].values()
    for kind, part, key in (("TABLE", "table", "bits"), ("OUTPUT", "output", "word_bits")):
        found[f"{kind}_STORAGE_BITS"] = 16 if max(axis[part][key] for axis in axes) <= 16 else 32
    if any(axis["table"]["mode"] == "cubic" for axis in axes):
        found["SPLINE"] = 1
    return found | ({"SINE_INDEX_BITS": index_bits, "SINE_LENGTH": 5 << index_bits >> 2} if index_bits else {})


def sines(index_bits: int, count: int) -> list[int]:
    """round(2^30 sin(2 pi j / 2^index_bits)), by other means than the build's; no value but 0 and +-1 is near a tie."""
    with mpmath.workdps(30):
        return [
            int(mpmath.nint(mpmath.ldexp(mpmath.sinpi(mpmath.mpf(2 * j) / (1 << index_bits)), 30)))
            for j in range(count)
        ]


def test_constants_and_tables_equal_the_manifest(built: Build) -> None:
    """Every macro and every array element, printed by a program."""
    manifest, names = built.manifest, c_constants(built.manifest)
    arrays = [f"{NAME}_{axis}_{kind}" for axis in manifest["axes"] for kind in ("table", "fourier")]
    arrays += [f"{NAME}_sine"] if "SINE_LENGTH" in names else []
    print_constants = "".join(f'    printf("%lld\\n", (long long){NAME.upper()}_{name});\n' for name in names)
    print_arrays = "".join(
        f"    for (size_t i = 0; i < sizeof {array} / sizeof {array}[0]; i++)\n"
        f'        printf("%lld\\n", (long long){array}[i]);\n'
        for array in arrays
    )
    source = built.folder / "print.c"
    source.write_text(
        f'#include <stdio.h>\n#include "{NAME}.h"\nint main(void)\n{{\n    puts({NAME.upper()}_HASH);\n'
        f"{print_constants}{print_arrays}    return 0;\n}}\n"
    )
    program = built.folder / "print"
    run_clean(["gcc", "-std=c99", "-Wall", "-Werror", f"-I{built.folder}", source, *sources(built), "-o", program])
    digest, *numbers = run_clean([program]).split()
    expected = list(names.values())
    for axis in manifest["axes"].values():
        fourier = axis["fourier"]
        words = axis["table"]["words"]
        behind = 3 if axis["table"]["mode"] == "cubic" else 1
        expected += [*words, *words[:behind], fourier["a0_word"], *fourier["a_words"], *fourier["b_words"]]
    if "SINE_LENGTH" in names:
        expected += sines(names["SINE_INDEX_BITS"], names["SINE_LENGTH"])
    assert digest == manifest["hash"]
    assert list(map(int, numbers)) == expected


def test_the_header_defines_what_the_manifest_knows_and_no_more(built: Build) -> None:
    """Nothing in the header escapes the comparison above."""
    prefix = f"#define {NAME.upper()}_"
    header = built.files[f"{NAME}.h"].decode("ascii")
    defined = {line[len(prefix) :].split()[0] for line in header.splitlines() if line.startswith(prefix)}
    assert {name for name in defined if "(" not in name} == {*c_constants(built.manifest), "HASH", "H"}


@pytest.mark.common
def test_player_equals_the_model_over_a_whole_frame_and_into_the_next(built: Build) -> None:
    lines = built.plan.schedule.lines + 2
    assert np.array_equal(played(compile_player(built, ["gcc", "-std=c99", "-O1"]), lines), model(built, lines))


@pytest.mark.common
@pytest.mark.parametrize(("bits", "gain_word"), STRESS)
@pytest.mark.parametrize("compiler", [["gcc", "-std=c99"], ["clang", "-std=c11"]], ids=["gcc", "clang"])
def test_player_is_defined_at_the_ends_of_the_arithmetic(
    tmp_path: Path, compiler: list[str], bits: int, gain_word: int
) -> None:
    """With the sanitizers: no overflow, no shift out of range, nothing read outside a table."""
    stressed = build_stressed(tmp_path, bits, gain_word)
    lines = stressed.plan.schedule.lines + 1
    expected = model(stressed, lines)
    output = stressed.plan.x.program.output
    assert {output.code_min, output.code_max} <= set(expected[:, 0].tolist()), "the limits are meant to be reached"
    assert np.array_equal(played(compile_player(stressed, [*compiler, *SANITIZERS]), lines), expected)


@pytest.mark.common
@pytest.mark.parametrize("name", ["example", "direct_steps", "left_aligned", "bits_24", "prime_line", "cubic"])
@pytest.mark.parametrize("dialect", common(["clang-c99"], ["gcc-c++17", "clang-c99"]))
def test_player_is_defined_and_the_same_in_other_dialects(tmp_path: Path, name: str, dialect: str) -> None:
    built = build(tmp_path, IN_C[name])
    program = compile_player(built, [*DIALECTS[dialect], *SANITIZERS])
    assert np.array_equal(played(program, 4), model(built, 4))


@pytest.mark.common
@pytest.mark.parametrize("options", [["-O0"], ["-O3"], ["-Os"], ["-O3", "-march=native"]], ids=" ".join)
def test_player_does_not_depend_on_optimisation(tmp_path: Path, options: list[str]) -> None:
    built = build(tmp_path, VARIANTS["bits_18"])
    assert np.array_equal(played(compile_player(built, ["gcc", "-std=c99", *options]), 3), model(built, 3))


def defined_as(name: str, change: Callable[[int], int]) -> Callable[[str], str]:
    """A header in which a macro has another value."""

    def damage(header: str) -> str:
        start = header.index(f"#define {NAME.upper()}_{name} ")
        stop = header.index("\n", start)
        text = header[start:stop].split()[-1]
        value = int(text.removeprefix("INT32_C(").removeprefix("INT64_C(").strip("()"))
        return f"{header[:start]}#define {NAME.upper()}_{name} ({change(value)}){header[stop:]}"

    return damage


def without_a_word(array: str) -> Callable[[str], str]:
    """A header (or source) in which an array lost its first word."""

    def damage(text: str) -> str:
        start = text.index("{", text.index(f"{NAME}_{array}[")) + 1
        return text[:start] + text[text.index(",", start) + 1 :]

    return damage


DAMAGES: dict[str, tuple[str, Callable[[str], str]]] = {
    "a word is lost": ("x_table_length", without_a_word("x_table")),
    "a Fourier word is lost": ("y_fourier_length", without_a_word("y_fourier")),
    "harmonics": ("x_harmonics", defined_as("X_HARMONICS", lambda harmonics: harmonics - 1)),
    "length": ("x_table_length", defined_as("X_TABLE_LENGTH", lambda length: 2 * length)),
    "index bits": ("x_length_is_power_of_two", defined_as("X_INDEX_BITS", lambda bits: bits + 1)),
    "word bits": ("x_words_fit", defined_as("X_TABLE_BITS", lambda bits: 17)),
    "storage": ("x_words_fit", defined_as("TABLE_STORAGE_BITS", lambda bits: 48 - bits)),
    "phase step": ("y_phase_is_coherent", defined_as("Y_PHASE_STEP", lambda step: step + 1)),
    "phase remainder": ("x_phase_is_coherent", defined_as("X_PHASE_REMAINDER", lambda rest: rest - 1)),
    "period": ("y_period", defined_as("Y_HOLD_TICKS", lambda hold: 2)),
    "line": ("x_period", defined_as("LINE_TICKS", lambda ticks: ticks + 1)),
    "gain above": ("x_gain_word", defined_as("X_GAIN_WORD", lambda gain: 1 << 17)),
    "gain below": ("y_gain_word", defined_as("Y_GAIN_WORD", lambda gain: -(1 << 17) - 1)),
    "park below": ("x_park_code", defined_as("X_CODE_MIN", lambda code: 40000)),
    "park above": ("y_park_code", defined_as("Y_PARK_CODE", lambda code: 65536)),
    "code": ("x_codes", defined_as("X_CODE_MAX", lambda code: 65536)),
    "no step": ("x_codes", defined_as("X_MAX_STEP", lambda step: 0)),
    "forward": ("forward_window_inside_line", defined_as("FORWARD_TICKS", lambda ticks: 1250)),
    "backward": ("backward_window_inside_line", defined_as("BACKWARD_FIRST_TICK", lambda tick: 1200)),
    "up": ("up_window_inside_frame", defined_as("UP_LINES", lambda lines: 400)),
}


@pytest.fixture(scope="module")
def header_only(tmp_path_factory: pytest.TempPathFactory) -> Build:
    return build(tmp_path_factory.mktemp("damaged"), VARIANTS["header_only"])


@pytest.mark.common
@pytest.mark.parametrize("damage", one_of(2, DAMAGES))
def test_a_damaged_header_does_not_compile(header_only: Build, tmp_path: Path, damage: str) -> None:
    """Negative controls of the static asserts: each is named by every compiler in every dialect."""
    name, change = DAMAGES[damage]
    header = header_only.files[f"{NAME}.h"].decode("ascii")
    (tmp_path / f"{NAME}.h").write_text(change(header), "ascii")
    unit = tmp_path / "unit.c"
    unit.write_text(f'#include "{NAME}.h"\n')
    for compiler in DIALECTS.values():
        result = run([*compiler, "-fsyntax-only", unit])
        assert result.returncode != 0, f"{' '.join(compiler)} accepts a header in which {damage} is wrong"
        assert name in result.stderr


HOSTILE = ["*/ int broken; /*", "two\nlines", "back\\slash\\", "trigraph ??/", "/* /* */ */", "\u00b5-Scanner \u202e"]


def in_dialects(name: str) -> list[Any]:
    """Return a name with every dialect: in common use C99 of gcc, and one more, in turn."""
    turns = [dialect for dialect in DIALECTS if dialect != "gcc-c99"]
    few = {"gcc-c99", turns[HOSTILE.index(name) % len(turns)]}
    return [
        pytest.param(name, dialect, marks=pytest.mark.common if dialect in few else pytest.mark.rest)
        for dialect in DIALECTS
    ]


@pytest.mark.parametrize(("name", "dialect"), [pair for name in HOSTILE for pair in in_dialects(name)], ids=ascii)
def test_no_scanner_s_name_leaves_its_comment(tmp_path: Path, name: str, dialect: str) -> None:
    """The name of a scanner is free text, and the only free text that reaches an emitted file."""
    built = build(tmp_path, Variant({**VARIANTS["short_frame"].scan}, {"name": name}))
    header = built.files[f"{NAME}.h"].decode("ascii")
    assert " * Scanner: " in header
    run_clean([*DIALECTS[dialect], *WARNINGS, "-fsyntax-only", f"-I{built.folder}", PLAYER, *sources(built)])
