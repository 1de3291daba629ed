"""The C runtime as text and as symbols: warnings, static analysers, what it exports and what it asks for."""

import re
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from building import run, run_clean
from sets import LONG_TEST, by_tool, in_pairs

from tablegen.base.resources import c_link, c_runtime, c_store

EVERYTHING = [*c_runtime(), *c_link(), *c_store()]
SOURCES = [path for path in EVERYTHING if path.suffix == ".c"]
HEADERS = {path.name: path for path in EVERYTHING if path.suffix == ".h"}
WARNINGS = [
    "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Wcast-qual", "-Wundef",
    "-Wstrict-prototypes", "-Wmissing-prototypes", "-Wdouble-promotion", "-Werror",
]  # fmt: skip
CHOICES = {
    "default": [],
    "wide": ["-DDAC_TABLE_STORAGE_BITS=32", "-DDAC_OUTPUT_STORAGE_BITS=32", "-DDAC_STRIDE=1"],
    "narrow_words_wide_codes": ["-DDAC_OUTPUT_STORAGE_BITS=32", "-DDAC_REQUESTS=128"],
    "no_long_multiplication": ["-DDAC_LONG_MULTIPLY=0"],
    "small": ["-DDAC_SMALL=1", "-Os"],
    "spline": ["-DDAC_SPLINE=1", "-DDAC_STORE=1", "-DDAC_LIBRARY=1"],
    "library": ["-DDAC_LIBRARY=1", "-DDAC_COMMIT_MODES=1"],
    "library_of_hosts": ["-DDAC_LIBRARY=2", "-DDAC_STORE=1", "-DDAC_SLOW_PART=1"],
    "spline_wide": ["-DDAC_SPLINE=1", "-DDAC_TABLE_STORAGE_BITS=32", "-DDAC_OUTPUT_STORAGE_BITS=32"],
    "spline_shaped": ["-DDAC_SPLINE=1", "-DDAC_SHAPING=3"],
    "spline_shaped_no_long_multiplication": ["-DDAC_SPLINE=1", "-DDAC_SHAPING=3", "-DDAC_LONG_MULTIPLY=0"],
    "commit_modes": ["-DDAC_COMMIT_MODES=1"],
    "moves": ["-DDAC_MOVE=1", "-DDAC_COMMIT_MODES=1"],
    "slow_part": ["-DDAC_SLOW_PART=1", "-DDAC_COMMIT_MODES=1"],
    "pixel_table": ["-DDAC_PIXEL_TABLE=1"],
    "z": ["-DDAC_LINK_Z=1", "-DDAC_COMMIT_MODES=1", "-DDAC_SLOW_PART=1"],
    "z_alone": ["-DDAC_LINK_Z=1", "-DDAC_PIXEL_TABLE=1"],
    "slow_part_wide": [
        "-DDAC_SLOW_PART=1",
        "-DDAC_SPLINE=1",
        "-DDAC_TABLE_STORAGE_BITS=32",
        "-DDAC_OUTPUT_STORAGE_BITS=32",
    ],
    "wide_no_long_multiplication": [
        "-DDAC_SPLINE=1",
        "-DDAC_SHAPING=3",
        "-DDAC_SLOW_PART=1",
        "-DDAC_LONG_MULTIPLY=0",
        "-DDAC_TABLE_STORAGE_BITS=32",
        "-DDAC_OUTPUT_STORAGE_BITS=32",
    ],
    "slow_part_no_long_multiplication": ["-DDAC_SLOW_PART=1", "-DDAC_SPLINE=1", "-DDAC_LONG_MULTIPLY=0"],
    "slow_part_shaped": ["-DDAC_SLOW_PART=1", "-DDAC_SHAPING=3"],
    "first_order": ["-DDAC_SHAPING=1"],
    "shaped": ["-DDAC_SHAPING=3"],
    "shaped_wide": ["-DDAC_SHAPING=3", "-DDAC_TABLE_STORAGE_BITS=32", "-DDAC_OUTPUT_STORAGE_BITS=32"],
    "shaped_no_long_multiplication": ["-DDAC_SHAPING=3", "-DDAC_LONG_MULTIPLY=0"],
    "shaped_small": ["-DDAC_SHAPING=2", "-DDAC_SMALL=1", "-Os"],
}
# 32 bits without a C library for them: the runtime is freestanding, and so are these.
COMPILERS = {
    "gcc-c99": ["gcc", "-std=c99"],
    "gcc-c11": ["gcc", "-std=c11"],
    "gcc-c99-32": ["gcc", "-std=c99", "-m32", "-ffreestanding"],
    "clang-c99": ["clang", "-std=c99"],
    "clang-c11": ["clang", "-std=c11"],
    "clang-c99-32": ["clang", "-std=c99", "-m32", "-ffreestanding"],
}
QUICK = ("default", "small")
# Each alternative of each #if is in one of these; the others are combinations of them.
ANALYSED = (*QUICK, "wide", "spline_shaped_no_long_multiplication", "commit_modes", "slow_part", "z")
# An analyser reports what it finds in a file that is wrong in this way.
FAULTY = "int faulty(void);\nint faulty(void)\n{\n    int *nothing = 0;\n    return *nothing;\n}\n"
ANALYSERS = {
    "gcc": ["gcc", "-std=c99", "-O2", "-fanalyzer", "-Werror", "-c", "-o", "/dev/null"],
    "clang": ["clang", "--analyze", "-Xclang", "-analyzer-werror", "-std=c99", "-o", "/dev/null"],
    "cppcheck": [
        "cppcheck",
        "--enable=warning,style,performance,portability",
        "--error-exitcode=1",
        "--std=c99",
        "-q",
        "-D__GNUC__=12",
    ],
}


def of_a_choice(pair: Any) -> Any:
    """Return a pair of choice and compiler with the mark of its choice; all but the quick ones have one compiler."""
    choice, compiler = pair.values
    if choice in QUICK:
        return pair
    return pytest.param(
        choice, compiler, marks=(*pair.marks, *(LONG_TEST if compiler == "gcc-c99" else ()), pytest.mark.rest)
    )


@pytest.mark.parametrize(
    ("choice", "compiler"),
    [of_a_choice(pair) for pair in in_pairs(list(CHOICES), list(COMPILERS), QUICK, "gcc-c99")],
)
def test_no_warnings(choice: str, compiler: str, tmp_path: Path) -> None:
    run_clean([*COMPILERS[compiler], "-O2", *WARNINGS, *CHOICES[choice], "-c", *SOURCES], tmp_path)


# clang's takes its time.
@pytest.mark.rest
@pytest.mark.parametrize(
    ("analyser", "choice"),
    [
        each if each[1] in ANALYSED else pytest.param(*each, marks=LONG_TEST)
        for each in product(ANALYSERS, CHOICES)
        if each[0] != "clang" or each[1] == "default"
    ],
)
def test_analysers_find_nothing(analyser: str, choice: str) -> None:
    definitions = [each for each in CHOICES[choice] if each.startswith("-D")]
    for source in SOURCES:
        run_clean([*ANALYSERS[analyser], *definitions, source])


@pytest.mark.rest
@pytest.mark.parametrize("analyser", ANALYSERS)
def test_analysers_find_a_fault(analyser: str, tmp_path: Path) -> None:
    source = tmp_path / "faulty.c"
    source.write_text(FAULTY)
    assert run([*ANALYSERS[analyser], source]).returncode != 0


OF_THE_LINK = ("-DDAC_STORE=1", "-DDAC_LIBRARY=2", "-DDAC_MOVE=1", "-DDAC_COMMIT_MODES=1")  # a move has a mode
ALL_FUNCTIONS = ("-DDAC_SHAPING=3", *OF_THE_LINK)


def declared(*headers: str, options: Sequence[str] = ALL_FUNCTIONS) -> set[str]:
    """Functions that headers declare with these options, but for those that they define themselves."""
    text = "".join(HEADERS[name].read_text("utf-8") for name in headers)
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    for option, given in (
        ("DAC_SHAPING", "-DDAC_SHAPING=3"),
        ("DAC_COMMIT_MODES", "-DDAC_COMMIT_MODES=1"),
        ("DAC_SLOW_PART", "-DDAC_SLOW_PART=1"),
        ("DAC_STORE", "-DDAC_STORE=1"),
        ("DAC_MOVE", "-DDAC_MOVE=1"),
        ("DAC_LIBRARY", "-DDAC_LIBRARY=2"),
        ("DAC_LINK_Z", "-DDAC_LINK_Z=1"),
    ):
        if given not in options:
            text = re.sub(rf"^#if {option}\n.*?^#endif$", "", text, flags=re.DOTALL | re.MULTILINE)
    return set(re.findall(r"^(?!static|#)\w[\w ]*?[ *](dac_\w+)\([^;{]*\);", text, flags=re.MULTILINE))


@pytest.mark.rest
@pytest.mark.parametrize(
    "options",
    [
        ["-O0"],
        ["-O2"],
        ["-Os"],
        *(["-O2", *CHOICES[choice]] for choice in ("wide", "shaped", "commit_modes", "moves", "slow_part")),
    ],
    ids=" ".join,
)
@pytest.mark.parametrize("compiler", by_tool(["gcc", "clang"]))
def test_symbols(compiler: str, options: list[str], tmp_path: Path) -> None:
    """Exported is what headers declare, asked for are their own functions, memcpy and memset; no variables."""
    run_clean([compiler, "-std=c99", "-ffreestanding", "-fno-pic", *OF_THE_LINK, *options, "-c", *SOURCES], tmp_path)
    found: dict[str, set[str]] = {}
    for path in sorted(tmp_path.glob("*.o")):
        for line in run_clean(["nm", path]).splitlines():
            *_, kind, name = line.split()
            found.setdefault(kind, set()).add(name)
    own = declared(*HEADERS, options=[*options, *OF_THE_LINK])
    assert found.pop("T") == own >= {"dac_sequencer_step", "dac_axis_run", "dac_link_work"}
    assert found.pop("U", set()) <= own | {"memcpy", "memset"}
    # Of absolute value, for the linker to compare: they are in no memory.
    assert found.pop("A") == {"dac_objects_need_the_same_options", "dac_objects_need_the_same_link_ring"}
    assert set(found) <= {"t", "r"}, found


@pytest.mark.rest
def test_a_link_with_z_exports_what_its_headers_declare_for_it(tmp_path: Path) -> None:
    """z goes without kept programs, moves and libraries, so this is the difference that its option makes."""
    exported = []
    for name, options in (("without", []), ("with", ["-DDAC_LINK_Z=1"])):
        folder = tmp_path / name
        folder.mkdir()
        run_clean(["gcc", "-std=c99", "-ffreestanding", "-O2", *options, "-c", *SOURCES], folder)
        lines = [run_clean(["nm", path]).splitlines() for path in sorted(folder.glob("*.o"))]
        exported.append({line.split()[-1] for each in lines for line in each if " T " in line})
    own = declared(*HEADERS, options=[*ALL_FUNCTIONS, "-DDAC_LINK_Z=1"]) - declared(*HEADERS)
    assert exported[1] - exported[0] == own | {"dac_sequencer_starts"}
    assert own >= {"dac_link_init_z", "dac_link_arm", "dac_link_trigger", "dac_link_park"}
    assert not exported[0] - exported[1]


def test_public_names_have_the_prefix_of_the_sequencer() -> None:
    public = declared("dac_sequencer.h")
    assert len(public) >= 17
    assert {name for name in public if not name.startswith("dac_sequencer_")} == {"dac_synthesize"}
    assert all(name.startswith("dac_axis_") for name in declared("dac_axis.h"))
    link = [name for name in HEADERS if name.startswith("dac_link")]
    assert len(declared("dac_link.h")) == 10
    assert all(name.startswith("dac_link_") for name in declared(*link))


@pytest.mark.common
@pytest.mark.parametrize("header", ["dac_link.h", "dac_link_parts.h"])
def test_headers_of_the_link_stand_alone(header: str, tmp_path: Path) -> None:
    """As C, and what an application includes as C++."""
    unit = tmp_path / "unit.c"
    unit.write_text(f'#include "{header}"\ntypedef int unit;\n')
    folder = f"-I{HEADERS[header].parent}"
    run_clean(["gcc", "-std=c99", *WARNINGS, folder, "-c", unit, "-o", tmp_path / "unit.o"])
    if header == "dac_link.h":
        warnings = [each for each in WARNINGS if "prototypes" not in each]
        run_clean(["g++", "-std=c++17", "-x", "c++", *warnings, folder, "-c", unit, "-o", tmp_path / "unit.o"])


def test_a_ring_that_is_no_power_of_two_does_not_compile(tmp_path: Path) -> None:
    source = next(path for path in SOURCES if path.name == "dac_link.c")
    for size in (500, 256, 65536):
        done = run(["gcc", "-std=c99", f"-DDAC_LINK_RING={size}", "-c", source, "-o", tmp_path / "link.o"])
        assert done.returncode != 0
        assert "a power of two" in done.stderr
