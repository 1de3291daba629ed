"""``tablegen verify`` of a library: its programs as builds, and its index against them."""

import json
import re
import shutil
import zlib
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import pytest
from editing import run
from libraries import NAMES, write_library, write_sines

from tablegen.verification.build_report import Report
from tablegen.verification.checks.played_checks import Check
from tablegen.verification.library_report import verify_library

pytestmark = pytest.mark.common

TABLES, FOURIER = "lines_library_tables.mem", "lines_library_fourier.mem"
OFFSET_WORD = 2 + 16 + 4  # of a record: two counts, the words of the scan, those of x


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library that was built once; tests copy it."""
    folder = tmp_path_factory.mktemp("stored")
    assert run("sweep", write_library(folder), "-o", folder / "out", "-j", "1").status == 0
    return folder / "out"


@pytest.fixture
def library(stored: Path, tmp_path: Path) -> Path:
    return shutil.copytree(stored, tmp_path / "out")


def verify(library: Path) -> tuple[int, str, str]:
    done = run("verify", library, "--target", "files")
    return done.status, done.out, done.err


def test_every_program_and_the_index_are_verified(stored: Path) -> None:
    status, out, err = verify(stored)
    assert (status, err) == (0, "")
    lines = out.splitlines()
    for name in NAMES:
        assert sum(line.startswith(f"{name}: ") and line.endswith("  ok") for line in lines) == 12
    assert [line.split()[:2] for line in lines if line.startswith("library ")] == [
        ["library", "records"],
        ["library", "index"],
    ]
    assert lines[-1] == f"{stored}: verified, 38 checks"


def test_formats_by_default_are_those_of_the_manifest_in_any_order(tmp_path: Path) -> None:
    """A manifest does not keep them; formats that it has are compared."""
    out = tmp_path / "out"
    assert run("sweep", write_library(tmp_path), "-o", out, "-j", "1", "-f", "verilog", "-f", "c").status == 0
    assert verify(out)[0] == 0
    edit_json(out / "broad" / "program.json", lambda record: record.update(formats=["verilog", "verilog"]))
    status, _, err = verify(out)
    assert status == 5
    assert "library records: broad/program.json: formats is not that of manifest.json" in err


def test_a_library_without_a_program_is_status_2(library: Path) -> None:
    edit_json(library / "library.json", lambda record: record.update(programs=[]))
    status, out, err = verify(library)
    assert (status, out) == (2, "")
    assert err == f"{library}/library.json: has no program; write the library again with `tablegen sweep`\n"


def edit_json(path: Path, change: Callable[[dict], object]) -> None:
    record = json.loads(path.read_text("ascii"))
    change(record)
    path.write_text(json.dumps(record, indent=1) + "\n", "ascii")


def write_listed(library: Path, name: str, text: str) -> None:
    """Write a file of the index, and its digest with it."""
    (library / name).write_text(text, "ascii")
    digest = sha256(text.encode("ascii")).hexdigest()
    edit_json(library / "library.json", lambda record: record["files"].update({name: digest}))


def edit_memory(library: Path, name: str, change: Callable[[list[int]], None]) -> None:
    words = [int(word, 16) for word in (library / name).read_text("ascii").split()]
    change(words)
    write_listed(library, name, "".join(f"{word:08x}\n" for word in words))


def change_offset(library: Path) -> None:
    """Change the offset word of x of the second program, and its CRC with it."""

    def change(words: list[int]) -> None:
        start, end = words[1], words[2] - 1
        words[start + OFFSET_WORD] ^= 1
        words[end] = zlib.crc32(b"".join(word.to_bytes(4, "little") for word in words[start:end]))

    edit_memory(library, TABLES, change)


def swap_addresses(library: Path) -> None:
    def change(words: list[int]) -> None:
        words[0], words[2] = words[2], words[0]

    edit_memory(library, FOURIER, change)


def spoil_sum(library: Path) -> None:
    def change(words: list[int]) -> None:
        words[-1] ^= 1

    edit_memory(library, TABLES, change)


def shorten(library: Path) -> None:
    edit_memory(library, TABLES, lambda words: words.pop())


def exchange_programs(library: Path) -> None:
    def change(record: dict) -> None:
        first, second, *_ = record["programs"]
        first["number"], second["number"] = second["number"], first["number"]

    edit_json(library / "library.json", change)


def edit_header(library: Path) -> None:
    text = (library / "lines_library.vh").read_text("ascii")
    changed = text.replace("BROAD_NUMBER = 32'sd1", "BROAD_NUMBER = 32'sd2")
    assert changed != text
    write_listed(library, "lines_library.vh", changed)


def edit_record(library: Path) -> None:
    edit_json(library / "broad" / "program.json", lambda record: record["x"].update(harmonics=23))


def edit_certificate(library: Path) -> None:
    edit_json(library / "library.json", lambda record: record["programs"][2]["y"].update(max_error_lsb=0.5))


def edit_module(library: Path) -> None:
    text = (library / "dac_library.v").read_text("utf-8")
    write_listed(library, "dac_library.v", text.replace("word != ~crc", "1'b0"))


CHANGES: dict[Callable[[Path], object], tuple[str, ...]] = {
    change_offset: (f"library index: {TABLES}: line ", f", word {OFFSET_WORD} of broad: is ", "`tablegen sweep`"),
    swap_addresses: (f"library index: {FOURIER}: line 1, the address of narrow: is ",),
    spoil_sum: (f"library index: {TABLES}: line ", ", the CRC of even: is "),
    shorten: (f"library index: {TABLES}: has ", " words, not "),
    exchange_programs: ("library records: library.json: its programs have other numbers than 0 to 2",),
    edit_header: ("library index: lines_library.vh: is not that of the programs",),
    edit_record: ("library records: broad/program.json: x is not that of manifest.json",),
    edit_certificate: ("library index: library.json: is not that of the programs",),
    edit_module: ("library index: dac_library.v: is not that of the programs",),
    lambda library: (library / "lines_library.c").unlink(): ("library index: lines_library.c: missing",),
    lambda library: shutil.rmtree(library / "even"): ("even/manifest.json: cannot be read", "even/program.json: is mi"),
    lambda library: (library / "even" / "even_x.mem").write_text("0\n"): (
        "even: files: even_x.mem: stale or edited",
        "library records: even/even_x.mem: is missing, or not as program.json has it",
    ),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_is_a_failed_check_that_names_it(library: Path, change: Callable[[Path], object]) -> None:
    change(library)
    status, _, err = verify(library)
    assert status == 5
    for part in CHANGES[change]:
        assert part in err
    assert err.splitlines()[-1].startswith(f"{library}: ")
    assert err.splitlines()[-1].endswith(" checks failed")


def test_a_program_beside_the_index_is_a_note(library: Path) -> None:
    shutil.copytree(library / "even", library / "odd")
    status, out, err = verify(library)
    assert (status, err) == (0, "")
    assert "note: odd: not in the index, and not verified\n" in out


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "is damaged: "),
        ("[]", "is damaged: Expected `object`"),
        ('{"tablegen": "0"}', "is damaged: Object missing required field"),
        ("../", "is damaged: ../x: "),
    ],
)
def test_a_damaged_index_is_status_2_with_its_remedy(library: Path, text: str, why: str) -> None:
    path = library / "library.json"
    if text == "../":
        edit_json(path, lambda record: record["programs"][1].update(name="../x"))
    else:
        path.write_text(text, "ascii")
    status, out, err = verify(library)
    assert (status, out) == (2, "")
    assert err.startswith(f"{path}: {why}")
    assert err.endswith("; write the library again with `tablegen sweep`\n")


def test_what_no_program_has_played_is_listed_once(stored: Path) -> None:
    """Modules of the runtime that one program plays are played; files of a program are its own."""

    def verify_program(program: Path) -> Report:
        unplayed = {"narrow": ["dac_spline.v", "narrow_top.v"], "broad": ["dac_spline.v", "dac_axis.v"]}
        return Report(program.name, [], None, [], unplayed=unplayed.get(program.name, ["dac_spline.v"]))

    def unplayed(*played: str) -> list[str]:
        checks = [Check(f"library {source}", "integer model", "3 programs") for source in played]
        return verify_library(stored, verify_program, lambda _record, _programs: checks).unplayed

    assert unplayed() == ["dac_library.v", "dac_spline.v", "narrow_top.v"]
    assert unplayed("dac_library.v") == ["dac_spline.v", "narrow_top.v"]


def verify_c(library: Path) -> tuple[int, str, str]:
    done = run("verify", library, "--target", "c", "--ticks", "1000")
    return done.status, done.out, done.err


def test_programs_of_the_index_in_c_are_played(library: Path) -> None:
    """Two programs have changed places: the compiler and the digests find nothing wrong in that."""
    status, out, err = verify_c(library)
    assert (status, err) == (0, "")
    row = "library lines_library.c  integer model  3 programs, 1400 ticks"
    assert [" ".join(line.split()) for line in out.splitlines() if "library lines_library.c" in line] == [
        " ".join(f"{row} ok".split())
    ]
    assert "lines_library.c" not in out[out.index("not played:") :]
    path = library / "lines_library.c"
    text = path.read_text("ascii")
    changed = text.replace("DAC_PROGRAM(BROAD, broad)", "DAC_PROGRAM(EVEN, even)")
    assert changed != text
    write_listed(library, "lines_library.c", changed)
    status, _, err = verify_c(library)
    assert status == 5
    assert re.search(r"^lines_library.c: tick \d+ after the pick of broad is ", err, re.MULTILINE)


def test_a_library_of_sines_in_c_has_their_pixels(tmp_path: Path) -> None:
    """Pixels of a program without its table have equal lengths."""
    done = run("sweep", write_sines(tmp_path), "-o", tmp_path / "out", "-j", "1", "-q")
    assert done.status == 0, done.err
    library = tmp_path / "out"
    assert verify_c(library)[0] == 0
    path = library / "dac_sequencer.h"
    text = path.read_text("ascii")
    changed = text.replace("DAC_PIXELS(NAME##_PIXEL_TABLE, name##_pixel_table)", "NULL")
    assert changed != text
    path.write_text(changed, "ascii")
    status, _, err = verify_c(library)
    assert status == 5
    assert "lines_library.c: tick " in err
    assert " after the pick of left is " in err
