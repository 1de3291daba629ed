"""``tablegen verify``: what is right is found right, and every way of being wrong is found, told, and where it is.

The builds are small and few ticks are played: that a whole frame equals the model is for one of them, and for
the tests of the sequencer in ``hdl_tests/``.
"""

import json
import re
import signal
import sys
from contextlib import nullcontext
from hashlib import sha256
from itertools import product
from pathlib import Path

import pytest
from building import NAME, VARIANTS, Build, Variant, build
from editing import Outcome, run
from kept_plays import kept_plays, own_program_alone
from sets import LONG_TEST, long, quick
from verifying import (
    check_first_difference,
    check_interruption,
    command,
    command_after,
    command_without,
    differing,
    edit,
    edit_manifest,
    failed,
    first_heard,
    read_report,
    verdicts,
    with_a_long_table,
)

from tablegen.emit.memory import memory_file
from tablegen.fixedpoint.program import Program
from tablegen.manifest.read import read_build
from tablegen.version import __version__

TICKS = 2000
CHECKS = 34
INSTALLED = ("files", f"tablegen {__version__}")
FILES = {("files", "SHA-256 in the manifest"), INSTALLED, ("verilog memories", "manifest")}
MODES = (
    "example",
    "bits_8",
    "bits_12",
    "bits_18",
    "bits_20",
    "bits_24",
    "narrow_table_wide_dac",
    "wide_table_narrow_dac",
    "direct",
    "direct_steps",
    "steps",
    "turn_0.7",
    "turn_0.95",
    "left_aligned",
    "prime_line",
    "inverting",
)


# Sessions with requests; the own programs of more are verified below. Of two only on multiplier blocks; widths are what
# the look-up tables go by.
ON_BLOCKS = ("left_aligned", "narrow_table_wide_dac")
PLACED = [
    ("direct_steps", "pipelined"),
    *(pytest.param((name, "pipelined"), marks=LONG_TEST) for name in ("example", "bits_24")),
    *(pytest.param((name, "blocks"), marks=LONG_TEST) for name in ON_BLOCKS),
]
# A frame that is soon played.
FEW_TICKS = Variant(
    {
        "timing": {"pixels": 20, "lines": 8, "line_rate_hz": 3100.0, "ticks_per_line": 160},
        "x.size_nm": 20.0,
        "x.band_limit.harmonics": 8,
        "y.band_limit.harmonics": 8,
    }
)

# One edit for two tests, which share its play; what is in the comment ends a text of XML.
ROUNDED_DOWN = ("1'b1} + step", "1'b0} + step  /* <&]]> */")


def verify(folder: Path, *arguments: str | Path | int, ticks: int = TICKS, requests: bool = True) -> Outcome:
    """Verify with multiplier blocks, which play twice as fast, unless the placement is given; a play is kept.

    With ``--keep`` it is not, since the test is of what a play leaves. Without ``requests`` the build's own program is
    played alone.
    """
    placed = () if {"--axis", "--fourier", "--target"} & set(map(str, arguments)) else ("--axis", "blocks")
    kept = nullcontext() if "--keep" in arguments else kept_plays()
    with kept, nullcontext() if requests else own_program_alone():
        return run("verify", folder, "--ticks", str(ticks), *placed, *map(str, arguments))


def verify_alone(folder: Path, *arguments: str | Path | int) -> Outcome:
    """Verify without requests: for damage that a play of the build's own program shows."""
    return verify(folder, *arguments, requests=False)


def flip(path: Path, line: int, bit: int) -> None:
    """Flip one bit of one word of a memory file."""
    words = path.read_text("ascii").split()
    words[line] = f"{int(words[line], 16) ^ (1 << bit):0{len(words[line])}x}"
    path.write_text("\n".join(words) + "\n", "ascii")


# What is right


@pytest.mark.parametrize("placed", PLACED, ids="-".join)
def test_a_build_verifies(placed: tuple[str, str], tmp_path: Path) -> None:
    """Both modes of tables, steps, all widths of words and codes, turns."""
    name, axis = placed
    built = build(tmp_path, VARIANTS[name])
    outcome = verify(built.folder, "--axis", axis)
    assert (outcome.status, outcome.err) == (0, "")
    assert set(verdicts(outcome).values()) == {"ok"}
    checks = CHECKS - (f"{NAME}.c" not in built.files)  # a header-only build has no files of its program
    assert len(verdicts(outcome)) == checks
    assert outcome.out.splitlines()[-1] == f"{built.folder}: verified, {checks} checks"
    assert not list(built.folder.glob("*.vvp")), "nothing is written into the build"


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("example", marks=pytest.mark.common),
        *(pytest.param(name, marks=pytest.mark.rest) for name in ("bits_8", "turn_0.7")),
        *long((), (name for name in MODES if name not in ("example", "bits_8", "turn_0.7", "direct_steps"))),
    ],
)
def test_the_own_program_of_a_build_verifies(name: str, tmp_path: Path) -> None:
    """The same of the others, without requests, which are the same for all."""
    built = build(tmp_path, VARIANTS[name])
    outcome = verify_alone(built.folder, "--axis", "pipelined")
    assert (outcome.status, outcome.err) == (0, "")
    assert set(verdicts(outcome).values()) <= {"ok", "not exercised"}
    assert {verdicts(outcome)[axis, "integer model"] for axis in "xy"} == {"ok"}


@pytest.mark.long
@pytest.mark.timeout(86_400)
@pytest.mark.parametrize(("seed", "placed"), [(1, "pipelined"), (2, "blocks")], ids=str)
def test_a_whole_frame_verifies(short: Build, seed: int, placed: str) -> None:
    """Codes of all of a line and of a frame, frames that follow, a swap in mid-frame; by any seed."""
    outcome = verify(short.folder, "--seed", seed, "--axis", placed, ticks=300000)
    assert (outcome.status, outcome.err) == (0, "")
    assert "note:" not in outcome.out
    table = " ".join(outcome.out.split())
    for axis, period in (("x", "line"), ("y", "frame")):
        promised = short.manifest["axes"][axis]["certificate"]["max_error_lsb"]
        found = re.search(rf"{axis} float waveform \d+ codes, 100 % of the {period} ([\d.]+) LSB ([\d.]+) LSB", table)
        assert found
        # The certificate is the worst of the period, and the whole period was played.
        assert float(found[1]) == pytest.approx(promised, abs=0.001)
        assert float(found[2]) == pytest.approx(promised, abs=0.001)


@pytest.mark.rest
def test_a_build_verifies_on_verilator(folder: Path, tmp_path: Path) -> None:
    """Also after the same build was compiled and kept."""
    for kept, made in ("first", True), ("second", False):
        assert verify_alone(folder, "--sim", "verilator", "--keep", tmp_path / kept).status == 0
        assert (tmp_path / kept / "verilator" / "build.log").is_file() == made


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_verilator_finds_a_wrong_rounding_as_icarus_does(folder: Path) -> None:
    """It is the same first tick, and nothing else."""
    edit(folder / "dac_interpolator.v", "1'b1} + step", "1'b0} + step")
    outcome = verify(folder, "--sim", "verilator")
    assert outcome.status == 5
    on_icarus = verify(folder, "--axis", "pipelined")
    assert differing(outcome) == differing(on_icarus)
    assert verdicts(outcome) == verdicts(on_icarus)


@pytest.mark.rest
def test_what_was_not_played_is_said(short: Build, tmp_path: Path) -> None:
    few = build(tmp_path, FEW_TICKS)
    outcome = verify(few.folder, ticks=1000, requests=False)
    assert outcome.status == 0
    notes = [line for line in outcome.out.splitlines() if line.startswith("note: ")]
    needed = re.fullmatch(r"note: not a whole frame of 1280 ticks was played; --ticks (\d+) plays one", notes[0])
    assert needed
    assert notes[1:] == [f"note: too few ticks for a program change within a frame; --ticks {needed[1]} has one"]
    assert "note:" not in verify(few.folder, ticks=int(needed[1])).out
    short_of_both = verify(short.folder, "--target", "c", ticks=1000).out
    assert "note: too few ticks for a program change within a frame; --ticks" in short_of_both


# What is wrong in the directory


@pytest.mark.common
@pytest.mark.parametrize(
    ("axis", "at", "bit"),
    [pytest.param("x", 70, 6, marks=LONG_TEST), pytest.param("x", 250, 15, marks=pytest.mark.rest), ("y", 100, 8)],
)
def test_a_flipped_bit_of_a_table_is_found_at_its_first_tick(folder: Path, axis: str, at: int, bit: int) -> None:
    """A bit of the word of that tick."""
    program: Program = getattr(read_build(folder).program, axis)
    word = at * len(program.words) // program.ticks
    flip(folder / f"{NAME}_{axis}.mem", word, bit)
    raw = int((folder / f"{NAME}_{axis}.mem").read_text("ascii").split()[word], 16)
    heard = first_heard(program, word, raw - (raw >> (program.bits - 1) << program.bits))

    outcome = verify_alone(folder)
    assert outcome.status == 5
    assert {*FILES, (axis, "integer model")} <= failed(outcome)
    assert ("x" if axis == "y" else "y", "integer model") not in failed(outcome)
    assert f"files: {NAME}_{axis}.mem: stale or edited" in outcome.err
    check_first_difference(outcome, axis, heard, 331)
    assert f"expected {heard.wanted}, got {heard.got}" in outcome.err


@pytest.mark.common
@pytest.mark.parametrize(
    ("register", "bit", "fails"),
    [
        (0, 0, ("markers", "integer model")),  # line_ticks
        (16 + 3, 2, ("x", "integer model")),  # gain of x
        (32 + 9, 0, ("y", "integer model")),  # park code of y
    ],
)
def test_a_flipped_bit_of_the_program_is_found(folder: Path, register: int, bit: int, fails: tuple[str, str]) -> None:
    flip(folder / f"{NAME}_program.mem", register, bit)
    outcome = verify_alone(folder)
    assert outcome.status == 5
    assert {fails, *FILES} <= failed(outcome)
    assert f"files: {NAME}_program.mem: stale or edited" in outcome.err
    assert "first difference: tick " in outcome.err


@pytest.mark.rest
@pytest.mark.parametrize("suffix", long(["x_fourier.mem"], ["sine.mem", "x_fourier.mem", "y_fourier.mem"]))
def test_a_flipped_bit_of_what_the_session_does_not_play_is_found(folder: Path, suffix: str) -> None:
    flip(folder / f"{NAME}_{suffix}", 3, 0)
    outcome = verify_alone(folder)
    assert outcome.status == 5
    booted = (
        {("top", "integer model")} if suffix != "sine.mem" else set()
    )  # the top boots Fourier words, not their sine
    assert failed(outcome) == FILES | booted
    assert re.search(
        rf"verilog memories: {NAME}_{suffix}: word 3 is [0-9a-f]{{8}}, it is [0-9a-f]{{8}} in the manifest", outcome.err
    )
    assert "first difference" not in outcome.err


@pytest.mark.common
def test_an_edited_constant_is_found(folder: Path) -> None:
    edit(folder / f"{NAME}.vh", f"{NAME.upper()}_PIXELS = 32'sd50;", f"{NAME.upper()}_PIXELS = 32'sd51;")
    edit(folder / f"{NAME}.vh", f'{NAME.upper()}_X_TABLE_FILE = "{NAME}_x.mem";', f'{NAME.upper()}_X_TABLE_FILE = "";')
    outcome = verify_alone(folder)
    assert outcome.status == 5
    by_simulator = ("verilog header", "manifest, by the simulator")
    assert failed(outcome) == {
        ("files", "SHA-256 in the manifest"),
        INSTALLED,
        ("verilog header", "manifest"),
        by_simulator,
    }
    assert f"{NAME.upper()}_PIXELS is 51 to the simulator, it is 50 in the manifest" in outcome.err
    assert f"{NAME}.vh: {NAME.upper()}_PIXELS is 51, it is 50 in the manifest" in outcome.err
    assert f"{NAME}.vh: {NAME.upper()}_X_TABLE_FILE is '', it is '{NAME}_x.mem' in the manifest" in outcome.err


@pytest.mark.common
def test_a_constant_that_is_missing_or_new_is_found(folder: Path) -> None:
    edit(folder / f"{NAME}.vh", f"localparam signed [31:0] {NAME.upper()}_SETTLE_LINES", "localparam OTHER")
    outcome = verify_alone(folder)
    assert f"{NAME}.vh: {NAME.upper()}_SETTLE_LINES is missing, it is 2 in the manifest" in outcome.err
    assert f"{NAME}.vh: OTHER is not in the manifest" in outcome.err


@pytest.mark.common
@pytest.mark.parametrize("variant", ["direct", "direct_steps", "bits_24", "left_aligned", "inverting"])
def test_the_header_of_other_builds_is_read_right(variant: str, tmp_path: Path) -> None:
    """Also where no table is interpolated, and where numbers are negative or have 64 bits; nothing is simulated."""
    from tablegen.emit.formats.verilog import wrong_constants
    from tablegen.emit.stored import stored_content

    built = build(tmp_path, VARIANTS[variant])
    assert wrong_constants(built.folder, stored_content(read_build(built.folder)))[1] == []


@pytest.mark.rest
def test_an_edited_runtime_is_played_and_found(folder: Path) -> None:
    """Rounding down in place of to the nearest: one code too low here and there, told with tick, expected and got."""
    edit(folder / "dac_interpolator.v", *ROUNDED_DOWN)
    outcome = verify_alone(folder)
    assert outcome.status == 5
    assert {("files", "SHA-256 in the manifest"), ("y", "integer model")} <= failed(outcome)
    assert "files: dac_interpolator.v: stale or edited" in outcome.err
    *_, expected, got = differing(outcome)
    codes = [re.findall(r"[xy] (\d+)", text) for text in (expected, got)]
    assert 0 < max(abs(int(a) - int(b)) for a, b in zip(*codes, strict=True)) <= 1


@pytest.mark.common
def test_a_runtime_that_does_not_compile_is_told_by_its_log(folder: Path) -> None:
    edit(folder / "dac_slew.v", "endmodule", "endmodul")
    outcome = verify_alone(folder)
    assert outcome.status == 5
    assert ("simulation", "icarus") in failed(outcome)
    assert "dac_slew.v" in outcome.err
    assert "syntax error" in outcome.err


@pytest.mark.common
def test_samples_that_never_come_are_found(folder: Path) -> None:
    edit(folder / "dac_verdict.v", "strobe <= tick;", "strobe <= 1'b0;")
    outcome = verify_alone(folder)
    assert outcome.status == 5
    models = {(subject, "integer model") for subject in ("x", "y", "markers")}
    assert {*models, ("timing", "constant delay")} <= failed(outcome)
    assert "ticks are missing or too many" in outcome.err


@pytest.mark.common
def test_unknown_codes_are_found(folder: Path) -> None:
    """A register without a power-up value, in a simulator that knows what that means."""
    text = (folder / "dac_interpolator.v").read_text("ascii")
    (folder / "dac_interpolator.v").write_text(text.replace("1'b1} + step", "1'bx} + step"), "ascii")
    outcome = verify_alone(folder)
    assert outcome.status == 5
    assert "got       undefined" in outcome.err


@pytest.mark.rest
@pytest.mark.parametrize(
    ("name", "also"),
    [(f"{NAME}.h", None), ("dac_spi.v", "dac_spi.v is missing"), (f"{NAME}_x.mem", f"{NAME}_x.mem is missing")],
)
def test_a_missing_file_is_named(folder: Path, name: str, also: str | None) -> None:
    (folder / name).unlink()
    outcome = verify_alone(folder)
    assert outcome.status == 5
    assert f"files: {name}: missing" in outcome.err
    simulated = ("x", "integer model") in verdicts(outcome)
    assert simulated == (also is None)
    assert also is None or f"simulation: {also}" in outcome.err


@pytest.mark.common
@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"0000\n" * 7, "has 7 words in place of 2048"),
        (b"a table\n", "does not hold one hexadecimal word a line"),
        (b"\xff\xfe", "does not hold one hexadecimal word a line"),
    ],
)
def test_a_memory_that_cannot_be_read_is_named(folder: Path, content: bytes, why: str) -> None:
    (folder / f"{NAME}_y.mem").write_bytes(content)
    outcome = verify(folder)
    assert outcome.status == 5
    assert f"simulation: {NAME}_y.mem {why}" in outcome.err


@pytest.mark.common
def test_all_that_is_wrong_is_told_at_once(folder: Path) -> None:
    (folder / f"{NAME}.h").unlink()
    edit(folder / f"{NAME}.vh", f"{NAME.upper()}_PIXELS = 32'sd50;", f"{NAME.upper()}_PIXELS = 32'sd51;")
    flip(folder / f"{NAME}_x.mem", 70 * 2048 // 331, 7)
    outcome = verify_alone(folder)
    for text in (f"{NAME}.h: missing", f"{NAME}.vh: stale", f"{NAME}_x.mem: stale", "PIXELS is 51", "first difference"):
        assert text in outcome.err
    assert outcome.err.splitlines()[-1] == f"{folder}: {len(failed(outcome))} of {CHECKS} checks failed"


# What is wrong in the manifest


@pytest.mark.common
@pytest.mark.parametrize("by", [-0.001, 99.0])
def test_an_error_that_the_words_do_not_make_is_found(folder: Path, by: float) -> None:
    """A promise that is a little too good, and one that allows everything: neither is the limit that is applied."""
    promised = json.loads((folder / "manifest.json").read_bytes())["axes"]["x"]["certificate"]["max_error_lsb"]
    edit_manifest(folder, "axes", "x", "certificate", "max_error_lsb", value=promised + by)
    outcome = verify_alone(folder)
    assert failed(outcome) == {("x", "its certificate")}
    assert re.search(r"x: axes\.x\.certificate\.max_error_lsb is [\d.]+, the words make it 0\.\d+", outcome.err)


@pytest.mark.common
def test_a_manifest_that_was_edited_is_found(folder: Path) -> None:
    axis = json.loads((folder / "manifest.json").read_bytes())["axes"]["y"]
    edit_manifest(folder, "axes", "y", "fourier", "a0", value=axis["fourier"]["a0"] + 1e-4)
    edit_manifest(folder, "axes", "x", "output", "max_step", value=1)
    outcome = verify(folder, "--target", "c")
    assert outcome.status == 5
    found = failed(outcome)
    assert {
        ("manifest", "its own hash"),
        ("y", "float waveform"),
        ("y", "its certificate"),
        ("manifest", "its own numbers"),
        ("x", "slew guard"),
        ("verilog header", "manifest"),
    } <= found


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (None, "cannot be read: No such file or directory; the directory is the one of `tablegen build -o DIR`"),
        (b'{"tablegen": "0.1', "is damaged: "),
        (b'{"name": "npm", "version": "1.0"}', "is not a manifest of tablegen"),
        (b"[1, 2]", "is not a manifest of tablegen"),
        (b"\xff\x00", "is damaged: "),
    ],
)
def test_a_directory_without_a_manifest_is_wrong_input(folder: Path, content: bytes | None, why: str) -> None:
    (folder / "manifest.json").unlink()
    if content is not None:
        (folder / "manifest.json").write_bytes(content)
    outcome = verify(folder)
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err.startswith(f"{folder}/manifest.json: {why}")


@pytest.mark.common
@pytest.mark.parametrize(
    ("path", "value", "why"),
    [
        (("axes", "x", "table", "bits"), 30, "Expected `int` <= 24 - at `$.axes.x.table.bits`"),
        (("axes", "y", "table", "words", 3), "7", "Expected `int`, got `str` - at `$.axes.y.table.words[3]`"),
        (("axes", "y", "table", "words"), [1, 2, 3], "axes.y.table.words are 3"),
        (("axes", "x", "table", "words", 3), 1 << 20, "axes.x.table.words do not fit 16 bits"),
        (("axes", "x", "output", "gain_word"), 1 << 17, "axes.x.output.gain_word is 131072"),
        (("axes", "x", "output", "dac_bits"), 12, "axes.x and axes.y differ in output.dac_bits"),
        (("axes", "x", "line", "ticks"), 332, "axes.x.line.ticks is 332, the schedule has 331"),
        (("axes", "y", "line", "hold_ticks"), 0, "Expected `int` >= 1 - at `$.axes.y.line.hold_ticks`"),
        (("axes", "y", "fourier", "a"), [], "axes.y.fourier has not 16 harmonics"),
        (("sequence", "forward_ticks"), [300, 100], "sequence.forward_ticks ends at 400, beyond 331"),
        (("files", "../../etc/passwd"), "0" * 64, "Expected `str` matching regex"),
        (("name",), "../x", "Expected `str` matching regex"),
        (("hash",), 5, "Expected `str`, got `int` - at `$.hash`"),
    ],
)
def test_a_damaged_manifest_is_wrong_input(folder: Path, path: tuple[str | int, ...], value: object, why: str) -> None:
    edit_manifest(folder, *path, value=value)
    outcome = verify(folder)
    assert (outcome.status, outcome.out) == (2, "")
    assert "manifest.json: is damaged: " in outcome.err
    assert why in outcome.err


def test_a_build_of_another_version_fails_unless_that_is_asked_for(folder: Path) -> None:
    """Nothing of its runtime is compared, so that nothing but the play can vouch for it."""
    edit_manifest(folder, "tablegen", value="0.0.7")
    outcome = verify(folder, "--target", "files")
    assert (outcome.status, failed(outcome)) == (5, {INSTALLED})
    assert f"files: built by tablegen 0.0.7, and this is {__version__}: its runtime cannot be compared" in outcome.err
    assert "--other-version" in outcome.err
    assert "note: built by" not in outcome.out
    outcome = verify(folder, "--target", "files", "--other-version")
    assert (outcome.status, outcome.err) == (0, "")
    assert f"note: built by tablegen 0.0.7, verified by {__version__}: its runtime was not compared" in outcome.out


def test_the_option_hides_nothing_of_a_build_of_this_version(folder: Path) -> None:
    edit(folder / "dac_slew.v", "endmodule", "endmodule // and more")
    outcome = verify(folder, "--target", "files", "--other-version")
    assert failed(outcome) == {("files", "SHA-256 in the manifest"), INSTALLED}


@pytest.mark.common
def test_a_build_of_another_version_is_played(folder: Path) -> None:
    edit_manifest(folder, "tablegen", value="0.0.7")
    outcome = verify_alone(folder, "--other-version")
    assert (outcome.status, outcome.err) == (0, "")
    assert ("x", "integer model") in verdicts(outcome)
    assert failed(outcome) == set()


@pytest.mark.common
def test_a_table_that_no_sequencer_can_address_is_wrong_input(tmp_path: Path) -> None:
    outcome = verify(with_a_long_table(tmp_path, 40))
    assert outcome.status == 2
    assert "the table of y has 80000 words, dac_sequencer.v plays at most 65536" in outcome.err


# Reports


@pytest.mark.common
def test_junit_has_a_case_a_check(short: Build, tmp_path: Path) -> None:
    report = tmp_path / "reports" / "verify.xml"
    outcome = verify_alone(short.folder, "--junit", report)
    assert outcome.status == 0
    told = read_report(report)
    assert told.counts == (str(CHECKS), "0", "0")
    assert 0.0 < told.seconds == pytest.approx(sum(told.times), abs=0.02 * CHECKS)
    assert list(told.cases) == list(verdicts(outcome))
    assert told.failed == {case for case, verdict in verdicts(outcome).items() if verdict == "not exercised"}
    assert {child.tag for children in told.cases.values() for child in children} == {"skipped"}
    assert told.manifest_sha256 == sha256((short.folder / "manifest.json").read_bytes()).hexdigest()


@pytest.mark.rest
def test_junit_tells_failures(folder: Path, tmp_path: Path) -> None:
    edit(folder / "dac_interpolator.v", *ROUNDED_DOWN)
    report = tmp_path / "verify.xml"
    outcome = verify_alone(folder, "--junit", report)
    told = read_report(report)
    wrong = {case for case, children in told.cases.items() if [child.tag for child in children] == ["failure"]}
    assert wrong == failed(outcome)
    assert told.counts == (str(CHECKS), str(len(wrong)), "0")
    (model,) = told.cases["y", "integer model"]
    assert model.text == model.get("message")
    assert re.search(r"the first at tick \d+ \(line \d+.*, tick \d+ of it\): expected \d+, got \d+$", str(model.text))


@pytest.mark.common
def test_junit_that_cannot_be_written_is_status_4(short: Build, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    outcome = verify(short.folder, "--junit", tmp_path / "file" / "x.xml")
    assert outcome.status == 4
    assert outcome.out == ""  # it is known before the work
    assert outcome.messages == [f"{tmp_path}/file/x.xml: {tmp_path}/file is no directory"]


@pytest.mark.common
def test_what_is_simulated_is_kept_on_request(short: Build, tmp_path: Path) -> None:
    assert verify_alone(short.folder, "--keep", tmp_path / "kept").status == 0
    assert {"script.hex", "capture.hex", "rtl", "icarus"} <= {path.name for path in (tmp_path / "kept").iterdir()}


@pytest.mark.common
def test_memories_are_what_a_build_writes(short: Build) -> None:
    """The reader of memory files against their writer, signed words included."""
    from tablegen.verification.checks.directory import memory_words

    words = short.plan.x.program.words
    read = memory_words(short.folder / f"{NAME}_x.mem", len(words))
    assert memory_file(read, 16) == short.files[f"{NAME}_x.mem"]
    assert [word - (word >> 15 << 16) for word in read] == words.tolist()


# Tools, interruptions


@pytest.mark.common
@pytest.mark.parametrize("simulator", ["icarus", "verilator"])
def test_a_missing_simulator_is_status_6_with_its_remedy(short: Build, tmp_path: Path, simulator: str) -> None:
    done = command(short.folder, "--sim", simulator, PATH=str(tmp_path))
    assert (done.returncode, done.stdout) == (6, "")
    assert "apt-get install" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_missing_cocotb_is_status_6_with_its_remedy(short: Build) -> None:
    done = command_without(["cocotb_tools"], short.folder)
    assert (done.returncode, done.stdout) == (6, "")
    assert done.stderr == "cocotb is not installed: pip install 'piezo-tablegen[hdl]'\n"


@pytest.mark.parametrize("simulator", quick(["icarus"], ["icarus", "verilator"]))
def test_a_python_without_its_shared_library_is_status_6_with_its_remedy(short: Build, simulator: str) -> None:
    """As Debian's own is; cocotb loads it into the simulator."""
    absent = "import find_libpython; find_libpython.find_libpython = lambda: None"
    done = command_after(absent, short.folder, "--sim", simulator)
    version = "{}.{}".format(*sys.version_info)
    assert (done.returncode, done.stdout) == (6, "")
    assert done.stderr == (
        f"the shared library of Python {version} is not installed: apt-get install libpython{version}, "
        "or a Python built with --enable-shared\n"
    )


@pytest.mark.rest
@pytest.mark.parametrize(
    "interruption",
    long(
        [("job.json", signal.SIGTERM), ("capture.hex", signal.SIGINT)],
        product(["job.json", "capture.hex"], [signal.SIGINT, signal.SIGTERM]),
    ),
    ids=lambda interruption: "-".join(map(str, interruption)),
)
def test_an_interruption_leaves_nothing_behind(tmp_path: Path, interruption: tuple[str, signal.Signals]) -> None:
    """Before or while the simulator plays."""
    begun, number = interruption
    built = build(tmp_path / "built", VARIANTS["header_only"])
    check_interruption(built.folder, tmp_path / "temporary", number, begun, "--ticks", "40000")


@pytest.mark.common
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_waits_until_there_is_a_process_to_end(tmp_path: Path, number: signal.Signals) -> None:
    """One that comes while the worker is being started, and would have left it to play for nobody."""
    built = build(tmp_path / "built", VARIANTS["header_only"])
    check_interruption(built.folder, tmp_path / "temporary", number, "icarus", "--ticks", "40000", within_popen=True)


PLACES = [
    (["--axis", "blocks"], 24),
    (["--axis", "serial"], 41),
    (["--axis", "alternate"], 48),
    (["--axis", "blocks", "--fourier"], 24),
    (["--axis", "serial", "--fourier"], 41),
    (["--fourier"], 36),
]


def build_small(folder: Path, arguments: list[str]) -> Build:
    """Build what a way of placing plays soon."""
    y_bits = 20 if "alternate" in arguments else 18
    tables = {"x.table": {"length": 128, "bits": 20}, "y.table": {"length": 64, "bits": y_bits}}
    return build(folder, Variant({**VARIANTS["short_frame"].scan, **tables}))


@pytest.mark.rest
@pytest.mark.parametrize(("arguments", "late"), PLACES[1:3], ids=["serial", "alternate"])
def test_a_way_of_placing_plays_the_own_program(tmp_path: Path, arguments: list[str], late: int) -> None:
    outcome = verify(build_small(tmp_path / "out", arguments).folder, *arguments, requests=False)
    assert outcome.status == 0, outcome.out + outcome.err
    assert f" samples, {late} clocks late" in outcome.out


@pytest.mark.rest
@pytest.mark.parametrize(
    ("arguments", "late"),
    [each if each[0] == ["--axis", "blocks", "--fourier"] else pytest.param(*each, marks=LONG_TEST) for each in PLACES],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_every_way_of_placing_the_sequencer(tmp_path: Path, arguments: list[str], late: int) -> None:
    built = build_small(tmp_path / "out", arguments)
    outcome = verify(built.folder, *arguments)
    assert outcome.status == 0, outcome.out + outcome.err
    assert f" samples, {late} clocks late" in outcome.out

    # What a device renders comes from the Fourier words, what it plays otherwise from the table.
    flip(built.folder / f"{NAME}_x_fourier.mem", 1, 27)
    outcome = verify(built.folder, *arguments, requests="--fourier" in arguments)
    assert outcome.status == 5
    assert (("markers", "integer model") in failed(outcome) or ("x", "integer model") in failed(outcome)) == (
        "--fourier" in arguments
    )


@pytest.mark.common
def test_by_turns_nothing_is_rendered_and_both_words_have_the_same_bits(tmp_path: Path) -> None:
    scan = VARIANTS["short_frame"].scan
    built = build(tmp_path / "out", Variant({**scan, "y.table": {"bits": 18}}))
    outcome = verify(built.folder, "--axis", "alternate")
    assert outcome.status == 2
    assert "ALTERNATE plays table words of the same bits: give both tables 18 bits; or verify it with" in outcome.err
    outcome = verify(built.folder, "--axis", "alternate", "--fourier")
    assert outcome.status == 2
    assert "verify it without --fourier, or with --axis serial" in outcome.err


@pytest.mark.common
def test_direct_tables_are_not_rendered(tmp_path: Path) -> None:
    built = build(tmp_path / "out", VARIANTS["direct_steps"])
    outcome = verify(built.folder, "--fourier")
    assert outcome.status == 2
    assert "both tables are direct" in outcome.err
