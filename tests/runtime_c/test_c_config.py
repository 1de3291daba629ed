"""The options of the runtime are one header, and objects that were compiled with different ones do not link."""

import re
from pathlib import Path

import pytest
from building import NAME, REPOSITORY, VARIANTS, build, run, run_clean

from tablegen.base.resources import c_runtime

FOLDER = c_runtime()[0].parent
CONFIG = FOLDER / "dac_config.h"
# Of each option on which types or calls between files depend another value than the default.
OTHER_VALUES = {
    "DAC_TABLE_STORAGE_BITS": 32,
    "DAC_OUTPUT_STORAGE_BITS": 32,
    "DAC_STRIDE": 1,
    "DAC_SHAPING": 3,
    "DAC_SPLINE": 1,
    "DAC_COMMIT_MODES": 1,
    "DAC_SLOW_PART": 1,
    "DAC_PIXEL_TABLE": 1,
    "DAC_STORE": 1,
    "DAC_MOVE": 1,
    "DAC_LIBRARY": 2,
    "DAC_REQUESTS": 128,
    "DAC_LONG_MULTIPLY": 0,
    "DAC_LINK_RING": 512,
}
# Functions that only the producer calls.
PRODUCER = {
    "power_up", "request", "settled", "dac_axis_serves", "dac_sequencer_init", "dac_sequencer_writable",
    "dac_sequencer_idle", "dac_sequencer_commit", "dac_sequencer_commit_at", "dac_sequencer_withdraw",
    "dac_sequencer_arm", "dac_sequencer_trigger", "dac_sequencer_park", "dac_sequencer_reset",
    "dac_sequencer_clear_faults", "dac_sequencer_status",
}  # fmt: skip
MAIN = '#include "dac_sequencer.h"\nint main(void)\n{\n    return 0;\n}\n'
CC = ["cc", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{FOLDER}"]


@pytest.fixture(scope="module")
def main_object(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a program that was compiled with the defaults."""
    folder = tmp_path_factory.mktemp("main")
    (folder / "main.c").write_text(MAIN, "ascii")
    run_clean([*CC, "-c", "main.c"], folder)
    return folder / "main.o"


def link(folder: Path, main_object: Path, *options: str) -> str:
    """Compile a file of the runtime with these options and link it with the program; return what the linker says."""
    run_clean([*CC, *options, "-c", FOLDER / "dac_fourier.c", "-o", folder / "other.o"], folder)
    done = run(["cc", "-Wl,--gc-sections", main_object, folder / "other.o", "-o", folder / "main"])
    assert (done.returncode == 0) == (done.stderr == "")
    return done.stderr


@pytest.mark.common
@pytest.mark.parametrize("option", OTHER_VALUES)
def test_objects_of_different_options_do_not_link(option: str, main_object: Path, tmp_path: Path) -> None:
    """Whether they call each other or not; and the control: they do where the options are written out the same."""
    given = link(tmp_path, main_object, f"-D{option}={OTHER_VALUES[option]}")
    assert "multiple definition of `dac_objects_need_the_same_" in given
    text = run_clean(["cc", "-E", "-dM", CONFIG], tmp_path)
    default = re.search(rf"^#define {option} (\d+)$", text, re.MULTILINE)
    assert default
    assert link(tmp_path, main_object, f"-D{option}={default[1]}") == ""


def test_options_of_one_file_alone_may_differ(main_object: Path, tmp_path: Path) -> None:
    assert link(tmp_path, main_object, "-DDAC_SMALL=1", "-DDAC_WAIT=1", "-DDAC_LINK_SLICE=8") == ""


def test_what_the_linker_compares_takes_no_memory(main_object: Path) -> None:
    symbols = run_clean(["nm", main_object], main_object.parent).splitlines()
    kinds = {line.split()[-1]: line.split()[-2] for line in symbols if "dac_" in line}
    assert set(kinds) == {"dac_objects_need_the_same_options", "dac_objects_need_the_same_link_ring"}
    assert set("".join(kinds.values()).lower()) == {"a"}, "absolute: a number, of no section"


def test_a_header_of_the_firmware_has_the_widths_of_the_scan(tmp_path: Path) -> None:
    """The example of the header, with a scan of 16 bits and one of 18: no -D of a width."""
    example = re.findall(r"^ \*     (#.*)$", CONFIG.read_text("ascii"), re.MULTILINE)
    assert len(example) == 2
    (tmp_path / "my_dac_config.h").write_text("\n".join(example) + "\n", "ascii")
    unit = f'#include "dac_sequencer.h"\n#include "{NAME}.h"\nextern const dac_program scan;\n'
    unit += f"const dac_program scan = DAC_PROGRAM({NAME.upper()}, {NAME});\n"
    (tmp_path / "unit.c").write_text(unit, "ascii")
    for name in ("example", "bits_18"):
        folder = tmp_path / name
        build(folder, VARIANTS[name])
        options = [f"-I{folder / 'out'}", f"-I{tmp_path}", '-DDAC_CONFIG_FILE="my_dac_config.h"']
        run_clean([*CC, *options, "-c", "unit.c"], tmp_path)


def test_the_page_has_all_options() -> None:
    page = (REPOSITORY / "docs" / "c.md").read_text("utf-8")
    listed = set(re.findall(r"^\| `(DAC_[A-Z_]+)` \|", page, re.MULTILINE))
    options = set(re.findall(r"^#ifn?def (DAC_[A-Z_]+)$", CONFIG.read_text("ascii"), re.MULTILINE))
    assert listed == (options | {"DAC_LONG_MULTIPLY"}) - {"DAC_CONFIG_H"}
    guarded = re.findall(
        r"^#ifndef (DAC_[A-Z_]+)$",
        "".join(path.read_text("ascii") for path in FOLDER.glob("dac_*.[ch]") if path != CONFIG),
        re.MULTILINE,
    )
    # What the compiler decides, and the fences, which are no numbers.
    assert {name for name in guarded if not name.endswith("_H")} == {"DAC_FEW_REGISTERS", "DAC_RELEASE"}


SECTION = '__attribute__((section("{}")))'


def test_tables_and_the_functions_of_the_consumer_go_where_the_firmware_wants_them(tmp_path: Path) -> None:
    """A header of the firmware names two sections; no function of the consumer is left in another one."""
    build(tmp_path, VARIANTS["example"])
    (tmp_path / "my_dac_config.h").write_text(
        f"#define DAC_TABLE_ATTR {SECTION.format('.tables')}\n#define DAC_CODE_ATTR {SECTION.format('.fast')}\n",
        "ascii",
    )
    options = [f"-I{tmp_path}", "-ffunction-sections", '-DDAC_CONFIG_FILE="my_dac_config.h"']
    sections: dict[str, str] = {}
    for source in (
        tmp_path / "out" / f"{NAME}.c",
        *(FOLDER / f"dac_{name}.c" for name in ("axis", "shaping", "slow", "sequencer")),
    ):
        for order, slow in ((0, 0), (3, 0), (0, 1)):
            chosen = [f"-DDAC_SHAPING={order}", f"-DDAC_SLOW_PART={slow}", f"-DDAC_PIXEL_TABLE={slow}"]
            run_clean([*CC, *options, *chosen, "-c", source, "-o", "unit.o"], tmp_path)
            symbols = run_clean(["objdump", "--syms", "unit.o"], tmp_path)
            sections |= {
                name: where for where, name in re.findall(r" [FO] (\S+)\s+\S+ (?:\.hidden )?(\w+)$", symbols, re.M)
            }
    assert {sections[f"{NAME}_{table}"] for table in ("x_table", "y_table", "x_fourier", "y_fourier", "sine")} == {
        ".tables"
    }
    elsewhere = {name for name, section in sections.items() if section.startswith(".text")}
    assert elsewhere <= PRODUCER, "functions that the consumer calls, outside the section"
    assert sections["dac_sequencer_fill"] == sections["dac_axis_run"] == sections["dac_shaping_play"] == ".fast"
    assert sections["dac_slow_begin_line"] == sections["dac_slow_play"] == ".fast"


def test_a_program_is_an_object_whose_names_may_come_from_the_build(tmp_path: Path) -> None:
    """``NAME_program`` equals what the macro makes, also where the macro gets its names from macros."""
    build(tmp_path, VARIANTS["example"])
    main = f"""#include <string.h>
#include "{NAME}.h"
#include "{NAME}_program.h"
static const dac_program macro = DAC_PROGRAM(UPPER, LOWER);
static const dac_converter x = DAC_CONVERTER(UPPER_X, 0);
int main(void)
{{
    const dac_axis_program *a = &macro.y, *b = &{NAME}_program.y;
    return !(a->table == b->table && a->offset_word == b->offset_word && a->max_step == b->max_step
             && memcmp(&macro.schedule, &{NAME}_program.schedule, sizeof macro.schedule) == 0
             && x.bits == {NAME}_x_converter.bits && x.word_bits == {NAME}_x_converter.word_bits);
}}
"""
    (tmp_path / "main.c").write_text(main, "ascii")
    names = [f"-DUPPER={NAME.upper()}", f"-DUPPER_X={NAME.upper()}_X", f"-DLOWER={NAME}", f"-I{tmp_path / 'out'}"]
    own = [tmp_path / "out" / f"{NAME}{suffix}.c" for suffix in ("", "_program")]
    run_clean([*CC, *names, "main.c", *own, "-o", "main"], tmp_path)
    run_clean([tmp_path / "main"], tmp_path)


def test_the_object_of_another_width_does_not_compile(tmp_path: Path) -> None:
    build(tmp_path, VARIANTS["bits_18"])
    unit = tmp_path / "out" / f"{NAME}_program.c"
    assert "compile_with_the_DAC_TABLE_STORAGE_BITS_of_the_table" in run([*CC, "-c", unit, "-o", tmp_path / "o"]).stderr
    wide = [f"-DDAC_{name}_STORAGE_BITS=32" for name in ("TABLE", "OUTPUT")]
    run_clean([*CC, *wide, "-c", unit, "-o", tmp_path / "o"], tmp_path)


def test_the_slow_part_of_the_page_compiles(tmp_path: Path) -> None:
    """As an axis of a build, which the page calls SCAN; and not without the option."""
    page = (REPOSITORY / "docs" / "c.md").read_text("utf-8")
    (code,) = re.findall(r"^```c\n(static const int32_t gains.*?)^```$", page, re.MULTILINE | re.DOTALL)
    build(tmp_path, VARIANTS["example"])
    code = code.replace("SCAN", NAME.upper()).replace("scan_x_table", f"{NAME}_x_table")
    includes = f'#include "dac_sequencer.h"\n#include "{NAME}.h"\n'
    main = f"{includes}{code}int main(void)\n{{\n    return x.slow != &slow_x;\n}}\n"
    (tmp_path / "main.c").write_text(main, "ascii")
    command = [*CC, f"-I{tmp_path / 'out'}", "main.c", tmp_path / "out" / f"{NAME}.c", "-o", "main"]
    run_clean([*command, "-DDAC_SLOW_PART=1"], tmp_path)
    run_clean([tmp_path / "main"], tmp_path)
    assert run(command, tmp_path).returncode != 0
