"""``tablegen verify --target c`` and ``cortex-m``: what a user of C compiles is what is played.

Frames are played whole here, by steps and by fills. Damage is done to the emitted header, to the arrays and to the
runtime; each kind has to be found, and told with what was expected and what came.
"""

import re
import shutil
import signal
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from building import IN_C, NAME, VARIANTS, Build, Variant, build
from editing import Outcome, run
from hypothesis import given, settings
from hypothesis import strategies as st
from replacing import replace
from sets import LONG_TEST, common, common_of, long, one_of
from verifying import (
    check_first_difference,
    check_interruption,
    command,
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

from tablegen.device.registers import program_words
from tablegen.emit.formats.c import arrays_file, wrong_arrays, wrong_constants
from tablegen.emit.stored import stored_content
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.shaping import Shaping
from tablegen.manifest.read import StoredBuild, read_build
from tablegen.verification.c.bench import CBench, script_words
from tablegen.verification.c.program import c_program
from tablegen.verification.checks.played_checks import check_states
from tablegen.verification.failures import SimulationFailed
from tablegen.verification.play.capture import make_capture
from tablegen.verification.play.converter_words import codes_of, pack_captures
from tablegen.verification.play.placement import Placement
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.session import make_session
from tablegen.verification.play.stream import OUTPUTS, Script, read_states
from tablegen.verification.play.variation import variation
from tablegen.version import __version__

CAPITAL = NAME.upper()
CHECKS = 28
OF_VERILOG = 2  # its header and its memories, in builds that have them
FILES = ("files", "SHA-256 in the manifest")
INSTALLED = ("files", f"tablegen {__version__}")
COMPILED = ("c header", "manifest, by the compiler")
HEADER, ARRAYS, FILL = ("c header", "manifest"), ("c arrays", "manifest"), ("fill", "integer model")
PROGRAM = ("program", "cc")
# Words that are wider than their codes, of the widest that converters have.
WIDE = Variant({**VARIANTS["short_frame"].scan, "dac.bits": 12, "dac.word_bits": 32, "dac.align": "left"})
TWOS = Variant({**VARIANTS["short_frame"].scan, "dac.coding": "twos-complement", "dac.word_bits": 24})
MIXED = Variant({**VARIANTS["short_frame"].scan, "x.table": {"mode": "direct", "bits": 12}})


def verify(folder: Path, *arguments: str | Path | int, target: str = "c") -> Outcome:
    return run("verify", folder, "--target", target, *map(str, arguments))


def define(folder: Path, constant: str, change: Callable[[int], int]) -> tuple[int, int]:
    """Put another number behind a #define; both numbers."""
    path = folder / f"{NAME}.h"
    text = path.read_text("ascii")
    found = re.findall(rf"^#define {CAPITAL}_{constant} (.*)$", text, re.MULTILINE)
    assert len(found) == 1
    old = int(re.sub(r"U?INT\d+_C|[()]", "", found[0]))
    line = f"#define {CAPITAL}_{constant} "
    path.write_text(text.replace(f"{line}{found[0]}\n", f"{line}INT64_C({change(old)})\n"), "ascii")
    return old, change(old)


def put_word(folder: Path, array: str, at: int, change: Callable[[int], int]) -> tuple[int, int]:
    """Put another number into an array of NAME.c; both numbers."""
    path = folder / f"{NAME}.c"
    text = path.read_text("ascii")
    begin = text.index("{", text.index(f" {NAME}_{array}[]")) + 1
    end = text.index("}", begin)
    words = text[begin:end].split(",")
    old = int(words[at])
    words[at] = f"\n    {change(old)}"
    path.write_text(text[:begin] + ",".join(words) + text[end:], "ascii")
    return old, change(old)


def substitute(path: Path, pattern: str, new: str) -> None:
    """Put other text in the one place where a pattern matches."""
    text, count = re.subn(pattern, new, path.read_text("ascii"))
    assert count == 1, f"{path.name} has {count} of {pattern!r}"
    path.write_text(text, "ascii")


# What is right


@pytest.mark.common
@pytest.mark.parametrize("name", common_of(6, ["short_frame", "cubic"], IN_C))
def test_a_whole_frame_of_every_build_verifies(name: str, tmp_path: Path) -> None:
    """Every mode, width, coding and alignment, header-only builds, with arrays of 16 and of 32 bits."""
    built = build(tmp_path, IN_C[name])
    outcome = verify(built.folder)
    assert (outcome.status, outcome.err) == (0, "")
    assert set(verdicts(outcome).values()) == {"ok"}
    checks = CHECKS - (OF_VERILOG if "cubic" in name else 0) - (f"{NAME}.c" not in built.files)
    assert len(verdicts(outcome)) == checks
    assert "note:" not in outcome.out
    assert outcome.out.splitlines()[-1] == f"{built.folder}: verified, {checks} checks"
    table = " ".join(outcome.out.split())
    for axis, period in (("x", "line"), ("y", "frame")):
        promised = built.manifest["axes"][axis]["certificate"]["max_error_lsb"]
        found = re.search(rf"{axis} float waveform \d+ codes, 100 % of the {period} ([\d.]+) LSB", table)
        assert found
        # The certificate is the worst of the period, and the whole period was played.
        assert float(found[1]) == pytest.approx(promised, rel=1e-5, abs=0.001)
    assert sorted(path.name for path in built.folder.iterdir()) == sorted(built.files), "nothing is written into it"


@pytest.mark.common
@pytest.mark.parametrize("variant", [WIDE, TWOS], ids=["32-bit words", "24-bit words"])
def test_words_that_are_wider_than_their_codes(variant: Variant, tmp_path: Path) -> None:
    outcome = verify(build(tmp_path, variant).folder)
    assert outcome.status == 0, outcome.err


@pytest.mark.common
@pytest.mark.parametrize("seed", long((2, 3), range(2, 6)))
def test_every_seed_verifies(short: Build, seed: int) -> None:
    outcome = verify(short.folder, "--seed", seed)
    assert outcome.status == 0, outcome.err


class Benches:
    """A build, and what plays it by steps and by fills; of few words where a test fails."""

    def __init__(self, stored: StoredBuild, step: CBench, fill: CBench) -> None:
        self.stored, self.step, self.fill = stored, step, fill


@pytest.fixture(scope="module")
def benches(short: Build, tmp_path_factory: pytest.TempPathFactory) -> Benches:
    """Those of the short build."""
    folder, stored = tmp_path_factory.mktemp("benches"), read_build(short.folder)
    program, absent = c_program(short.folder, folder, stored, fourier=False)
    assert not absent
    sources, macro_values = program.sources, program.defines
    shape = SequencerShape.of((stored.program.x, stored.program.y))
    step = CBench(shape, folder / "step", options=["-std=c99", "-O2"], sources=sources, macro_values=macro_values)
    macro_values["BENCH_FILL"] = 600
    fill = CBench(shape, folder / "fill", options=["-std=c99", "-O2"], sources=sources, macro_values=macro_values)
    return Benches(stored, step, fill)


@pytest.mark.rest
@pytest.mark.parametrize("examples", long([12], [12, 200]))
def test_sessions_of_any_seed_and_length_equal_the_model(benches: Benches, examples: int) -> None:
    """By steps and by fills; the ticks suffice for a whole session or end anywhere in it."""

    @settings(deadline=None, max_examples=examples)
    @given(st.integers(0, 1 << 32), st.integers(1000, 6000))
    def check(seed: int, ticks: int) -> None:
        check_session(benches, seed, ticks)

    check()


def check_session(benches: Benches, seed: int, ticks: int) -> None:
    stored = benches.stored
    session = make_session(stored.program, None, ticks, seed, Placement())
    text = script_words(session.script, benches.step.shape)
    wanted = np.array(session.script.expected, dtype=np.uint64)
    own = make_capture(stored, session.script, wanted).own
    assert not np.any(wanted[own] >> np.uint64(56)), "the program of the build raises no fault"
    for bench, mask in ((benches.step, (1 << 64) - 1), (benches.fill, (1 << 56) - 1)):  # fills do not record faults
        played = bench.run(text)
        assert np.array_equal(pack_captures(played.capture, stored), wanted & np.uint64(mask))
        assert played.counts == session.script.all_counts
        told = check_states(
            session.script.states, read_states(played.states), (1 << 32) - 1, ("armed", "running", OUTPUTS)
        )
        assert told.failure is None


@pytest.mark.rest
@pytest.mark.parametrize(
    "variant",
    long(["bits_24", "mixed", "cubic"], ["short_frame", "bits_8", "bits_24", "longest_table", "mixed", "cubic"]),
)
def test_tables_that_are_rendered_verify(variant: str, tmp_path: Path) -> None:
    """dac_synthesize makes the words that were emitted; a direct table is played as it is."""
    built = build(tmp_path, MIXED if variant == "mixed" else IN_C[variant])
    outcome = verify(built.folder, "--fourier")
    assert outcome.status == 0, outcome.err


@pytest.mark.common
def test_what_is_rendered_comes_from_the_fourier_words(folder: Path) -> None:
    """And what is not comes from the table: a damage of either plays with the one, and not with the other."""
    put_word(folder, "x_fourier", 1, lambda word: word ^ 1 << 27)
    put_word(folder, "y_table", 100, lambda word: word ^ 1 << 9)
    assert differs(verify(folder, "--fourier")) == {"x"}
    assert differs(verify(folder)) == {"y"}


def differs(outcome: Outcome) -> set[str]:
    """Axes that differ from the model."""
    return {subject for subject, against in failed(outcome) if against == "integer model" and subject in "xy"}


@pytest.mark.common
def test_direct_tables_are_not_rendered(tmp_path: Path) -> None:
    outcome = verify(build(tmp_path / "out", VARIANTS["direct_steps"]).folder, "--fourier")
    assert outcome.status == 2
    assert "both tables are direct" in outcome.err


@pytest.mark.common
def test_what_was_not_played_is_said(short: Build) -> None:
    outcome = verify(short.folder, "--ticks", 2000)
    assert outcome.status == 0
    (note,) = (line for line in outcome.out.splitlines() if line.startswith("note: "))
    assert note.startswith("note: not a whole frame of 2648 ticks was played; --ticks ")


@given(
    st.integers(8, 24).flatmap(lambda bits: st.tuples(st.just(bits), st.integers(bits, 32))),
    st.sampled_from(["straight-binary", "twos-complement"]),
    st.sampled_from(["left", "right"]),
    st.integers(0, (1 << 24) - 1),
)
def test_codes_come_back_from_converter_words(bits: tuple[int, int], coding: str, align: str, code: int) -> None:
    dac_bits, word_bits = bits
    code &= (1 << dac_bits) - 1
    output = Output(1, 20, 0, 0, (1 << dac_bits) - 1, 1, 0, dac_bits, coding, align, word_bits)
    assert codes_of(np.array([output.word(code)], dtype=np.uint64), output).tolist() == [code]


@pytest.mark.parametrize("name", common(["short_frame"], VARIANTS))
def test_variations_do_what_they_are_for(name: str, tmp_path: Path) -> None:
    """Otherwise a missing limit, or a guard that is off in one direction, would go unseen; and each differs."""
    program = read_build(build(tmp_path, VARIANTS[name]).folder).program
    for longer in (0, 2000):
        for bank in (0, 1):
            made = {kind: variation(program, kind, bank, longer) for kind in ("free", "clamped", "held")}
            for kind, one in made.items():
                for own, other in ((program.x, one.x), (program.y, one.y)):
                    check_variation(own, other, kind)
            registers = [program_words(one.schedule, one.x, one.y) for one in made.values()]
            assert len({tuple(words) for words in registers}) == 3


@pytest.mark.parametrize("order", [1, 2, 3])
def test_variations_have_every_order_of_a_device(order: int, tmp_path: Path) -> None:
    program = read_build(build(tmp_path, VARIANTS["short_frame"]).folder).program
    shaping = Shaping(order, 100 if order == 3 else 0)
    program = replace(program, x=replace(program.x, output=replace(program.x.output, shaping=shaping)))
    seen = set()
    for bank in (0, 1):
        for kind in ("free", "clamped", "held"):
            made = variation(program, kind, bank)
            for own, other in ((program.x, made.x), (program.y, made.y)):
                check_variation(own, other, kind)
                seen.add(other.output.shaping)
    assert {one.order for one in seen} == set(range(order + 1))
    assert len(seen) == order + 1 + (order == 3)  # two zeros


def check_variation(own: Program, other: Program, kind: str) -> None:
    output = other.output
    remainders = output.begin()
    wanted = np.concatenate(
        [other.unclamped(0, other.ticks, remainders) for _ in range(8 if output.shaping.order else 1)]
    )
    codes = output.clamp(wanted)
    steps = np.diff(codes, append=other.played(len(codes), len(codes) + 1))
    outside = np.any(wanted < output.code_min), np.any(wanted > output.code_max)
    too_large = np.any(steps > output.max_step), np.any(steps < -output.max_step)
    assert outside == ((True, True) if kind == "clamped" else (False, False))
    if kind != "held":
        assert too_large == (False, False)
    elif output.max_step > 1 or other.hold > 1:
        assert too_large == (True, True)
    assert 0 <= output.code_min <= output.park_code <= output.code_max < 1 << output.dac_bits
    assert output.gain_word != own.output.gain_word
    assert len(other.words) <= 1 << max((len(own.words) - 1).bit_length(), 3)


# What is wrong in the header


def defined(folder: Path) -> list[str]:
    """What the header defines, without the prefix."""
    text = (folder / f"{NAME}.h").read_text("ascii")
    return re.findall(rf"^#define {CAPITAL}_(\w+) .", text, re.MULTILINE)


@pytest.mark.common
def test_every_constant_is_held_against_the_manifest(short: Build, tmp_path: Path) -> None:
    """One by one, with what it is and what it is in the manifest; nothing is compiled."""
    content = stored_content(read_build(short.folder))
    count, wrong = wrong_constants(short.folder, content)
    names = defined(short.folder)
    assert (count, wrong) == (len(names), [])
    for name in set(names) - {"HASH"}:
        shutil.copy(short.folder / f"{NAME}.h", tmp_path)
        old, new = define(tmp_path, name, lambda value: value + 1)
        assert wrong_constants(tmp_path, content)[1] == [
            f"{NAME}.h: {CAPITAL}_{name} is {new}, it is {old} in the manifest"
        ]


@pytest.mark.common
@pytest.mark.parametrize("variant", ["direct_steps", "bits_24", "left_aligned", "inverting", "header_only", "example"])
def test_headers_and_arrays_of_other_builds_are_read_right(variant: str, tmp_path: Path) -> None:
    """Also where no table is interpolated, where numbers have 64 bits, and where arrays stand in the header."""
    built = build(tmp_path, VARIANTS[variant])
    content = stored_content(read_build(built.folder))
    assert wrong_constants(built.folder, content) == (len(defined(built.folder)), [])
    assert wrong_arrays(built.folder, content)[1] == []
    assert arrays_file(content).endswith(".h") == ("header_only" in str(VARIANTS[variant].scan))


# What each constant of a program does when it is wrong: which check beside header and files fails first.
PLAYED = [
    ("SETTLE_LINES", lambda value: value + 1, ("markers", "integer model")),
    ("PIXELS", lambda value: value - 1, ("markers", "integer model")),
    ("TURN_TICK", lambda value: value + 1, ("markers", "integer model")),
    ("FORWARD_FIRST_TICK", lambda value: value + 1, ("markers", "integer model")),
    ("BACKWARD_TICKS", lambda value: value - 1, ("markers", "integer model")),
    ("UP_LINES", lambda value: value - 1, ("markers", "integer model")),
    ("X_GAIN_WORD", lambda value: value + 40, ("x", "integer model")),
    ("Y_OFFSET_WORD", lambda value: value + (1 << 21), ("y", "integer model")),
    ("X_OFFSET_CODE", lambda value: value + 1, None),  # for people: no device needs it
    ("Y_MAX_STEP", lambda value: value - 1000, ("y", "integer model")),
    ("X_MAX_STEP", lambda value: value + 1000, ("x", "integer model")),
    ("X_PARK_CODE", lambda value: value + 1, ("x", "integer model")),
    ("Y_CODE_MAX", lambda value: value // 2 + 1000, ("y", "integer model")),
    ("X_DAC_TWOS_COMPLEMENT", lambda value: 1 - value, ("x", "converter word")),
    ("LINE_TICKS", lambda value: value + 1, PROGRAM),  # the header's own assertions
    ("X_GAIN_Q", lambda value: value + 1, PROGRAM),  # refused by dac_sequencer_load
    ("Y_TABLE_BITS", lambda value: value - 1, PROGRAM),
]


@pytest.mark.rest
@pytest.mark.parametrize(("constant", "change", "fails"), one_of(2, PLAYED, 3), ids=[row[0] for row in PLAYED])
def test_a_damaged_constant_is_played_and_found(
    folder: Path, constant: str, change: Callable[[int], int], fails: tuple[str, str] | None
) -> None:
    """The numbers that are played are those of the header, not those of the manifest."""
    old, new = define(folder, constant, change)
    outcome = verify(folder)
    assert outcome.status == 5
    assert f"{NAME}.h: {CAPITAL}_{constant} is {new}, it is {old} in the manifest" in outcome.err
    assert f"files: {NAME}.h: stale or edited" in outcome.err
    static = {HEADER, FILES, INSTALLED}
    assert static <= failed(outcome)
    assert failed(outcome) == {*static, COMPILED} if fails is None else fails in failed(outcome)
    if fails == PROGRAM:
        assert "static assertion" in outcome.err or "size of array" in outcome.err or "DAC_BAD_" in outcome.err
    elif fails is not None:
        assert "first difference: tick " in outcome.err


@pytest.mark.common
def test_a_constant_that_is_missing_or_new_is_found(folder: Path) -> None:
    edit(folder / f"{NAME}.h", f"#define {CAPITAL}_SETTLE_LINES ", f"#define {CAPITAL}_OTHER ")
    outcome = verify(folder)
    assert f"{NAME}.h: {CAPITAL}_SETTLE_LINES is missing, it is 2 in the manifest" in outcome.err
    assert f"{NAME}.h: {CAPITAL}_OTHER is not in the manifest" in outcome.err
    assert f"{CAPITAL}_SETTLE_LINES" in outcome.err.split("program: ")[1], "and by the compiler"


@pytest.mark.common
def test_the_hash_in_the_header_is_held_against_the_manifest(folder: Path, short: Build) -> None:
    digest = short.manifest["hash"]
    edit(folder / f"{NAME}.h", f'"{digest}"', f'"{digest[::-1]}"')
    outcome = verify(folder)
    assert failed(outcome) == {HEADER, FILES, INSTALLED, COMPILED}
    assert f"{CAPITAL}_HASH is '{digest[::-1]}', it is '{digest}' in the manifest" in outcome.err


# What is wrong in the arrays


@pytest.mark.common
@pytest.mark.parametrize(("axis", "at", "bit"), [("x", 70, 6), ("x", 250, 14), ("y", 100, 8)])
def test_a_damaged_table_is_found_at_its_first_tick(folder: Path, axis: str, at: int, bit: int) -> None:
    program: Program = getattr(read_build(folder).program, axis)
    word = at * len(program.words) // program.ticks
    old, new = put_word(folder, f"{axis}_table", word, lambda value: value ^ 1 << bit)
    heard = first_heard(program, word, new)

    outcome = verify(folder)
    assert outcome.status == 5
    assert {FILES, ARRAYS, FILL, (axis, "integer model"), (axis, "converter word")} <= failed(outcome)
    assert differs(outcome) == {axis}
    assert f"{NAME}.c: {NAME}_{axis}_table[{word}] is {new}, it is {old} in the manifest" in outcome.err
    check_first_difference(outcome, axis, heard, 331)


@pytest.mark.common
@pytest.mark.parametrize("array", ["x_fourier", "y_fourier", "sine"])
def test_a_damaged_array_that_is_not_played_is_found(folder: Path, array: str) -> None:
    old, new = put_word(folder, array, 3, lambda value: value + 1)
    outcome = verify(folder)
    assert failed(outcome) == {FILES, INSTALLED, ARRAYS}
    assert f"{NAME}.c: {NAME}_{array}[3] is {new}, it is {old} in the manifest" in outcome.err


@pytest.mark.common
def test_an_array_of_another_length_or_name_or_content_is_found(folder: Path) -> None:
    path = folder / f"{NAME}.c"
    substitute(path, rf"({NAME}_x_table\[\] = {{\n    )-?\d+, ", r"\1")
    substitute(path, rf"({NAME}_y_fourier\[\] = {{\n    )-?\d+", r"\1one")  # no C either
    substitute(path, rf"{NAME}_x_fourier\[\]", f"{NAME}_x_series[]")
    outcome = verify(folder)
    assert outcome.status == 5
    for text in (
        f"{NAME}_x_table has 2048 words, it takes 2049",
        f"{NAME}_y_fourier[0] is one, it is ",
        f"{NAME}_x_fourier is missing",
        "program: cc ",
    ):
        assert text in outcome.err


# What is wrong in the runtime

MUTANTS = [
    # name, file, pattern, replacement, what fails
    ("swap in mid-line", "sequencer.c", r"\(s->running && s->tick != 0\)", "false", ("markers", "integer model")),
    ("rounding", "arithmetic.h", r"\(int32_t\)1 << \(14u - \(?guard\)?\)", "(int32_t)0", ("y", "integer model")),
    ("no lower limit", "program.c", r"b->code_min = p->code_min;", "b->code_min = 0;", ("faults", "integer model")),
    ("no slew guard", "program.c", r"b->max_step = p->max_step;", "b->max_step = 1 << 23;", ("y", "slew guard")),
    ("gain of x", "program.c", r"b->gain = p->gain_word;", "b->gain = p->gain_word + 40;", ("x", "integer model")),
    (
        "settled early",
        "sequencer.c",
        r"settle_left = [^;]*settle_lines;",
        "settle_left = 1;",
        ("markers", "integer model"),
    ),
    ("unsticky faults", "sequencer.c", r"s->faults = [^;]*\| \(?fault\b[^;]*;", ";", ("faults", "integer model")),
    ("no coding", "arithmetic.h", r"\(uint32_t\)code \^ axis->flip", "(uint32_t)code", ("x", "converter word")),
    ("other alignment", "arithmetic.h", r"<< axis->shift\)", "<< axis->shift | 1u)", ("y", "converter word")),
    ("fills", "sequencer.c", r"(void dac_sequencer_fill\([^)]*\)\n{\n)", r"\1    dac_sequencer_report(s, 2);\n", FILL),
    (
        "no program taken",
        "sequencer.c",
        r"s->waiting = argument == [^;]*;",
        "s->waiting = 0;",
        ("x", "float waveform"),
    ),
]


# Found by others too: the same edit of the short build below, of a header's constant above, in test_tampering.py.
ELSEWHERE = (
    "rounding",
    "gain of x",
    "swap in mid-line",
    "no slew guard",
    "settled early",
    "unsticky faults",
    "other alignment",
)


@pytest.fixture(scope="module")
def coded(tmp_path_factory: pytest.TempPathFactory) -> Build:
    """A short build whose converters want codes inverted and shifted, and whose park code is above its middle."""
    scan = {**TWOS.scan, "dac.align": "left", "x.park_v": 60.0}
    return build(tmp_path_factory.mktemp("coded"), Variant(scan))


@pytest.mark.rest
@pytest.mark.parametrize(
    ("file", "pattern", "new", "fails"),
    [pytest.param(*row[1:], marks=LONG_TEST if row[0] in ELSEWHERE else (), id=row[0]) for row in MUTANTS],
)
def test_an_edited_runtime_is_played_and_found(
    coded: Build, tmp_path: Path, file: str, pattern: str, new: str, fails: tuple[str, str]
) -> None:
    folder = tmp_path / "out"
    shutil.copytree(coded.folder, folder)
    substitute(folder / f"dac_{file}", pattern, new)
    outcome = verify(folder)
    assert outcome.status == 5
    assert {FILES, fails} <= failed(outcome)
    assert f"files: dac_{file}: stale or edited" in outcome.err
    if fails == FILL:
        assert failed(outcome) == {FILES, INSTALLED, FILL}, "what only fills do wrong"


@pytest.mark.common
def test_a_rounding_is_told_with_its_first_tick(folder: Path) -> None:
    """One code too low here and there, with tick, expected and got."""
    substitute(folder / "dac_arithmetic.h", r"\(int32_t\)1 << \(14u - \(?guard\)?\)", "(int32_t)0")
    outcome = verify(folder)
    *_, expected, got = differing(outcome)
    codes = [re.findall(r"[xy] (\d+)", text) for text in (expected, got)]
    assert 0 < max(abs(int(a) - int(b)) for a, b in zip(*codes, strict=True)) <= 1


@pytest.mark.common
def test_a_runtime_that_does_not_compile_is_told_by_the_compiler(folder: Path) -> None:
    path = folder / "dac_program.c"
    path.write_text(path.read_text("ascii") + '#error "spoilt"\n', "ascii")
    outcome = verify(folder)
    assert PROGRAM in failed(outcome)
    assert re.search(r"dac_program.c:\d+:\d+: error: #error \"spoilt\"", outcome.err.split("program: ")[1])


@pytest.mark.common
def test_a_runtime_that_crashes_is_a_failed_check(folder: Path) -> None:
    substitute(folder / "dac_sequencer.c", r"(void dac_sequencer_step\(.*\)\n{\n)", r"\1    __builtin_trap();\n")
    outcome = verify(folder)
    assert outcome.status == 5
    assert re.search(r"program: the bench ended with status -\d+", outcome.err)


@pytest.mark.common
def test_a_runtime_that_writes_without_end_is_ended(folder: Path) -> None:
    """Before it has filled the disk."""
    substitute(folder / "dac_sequencer.c", r"(void dac_sequencer_step\(.*\)\n{\n)", r"\1    for (;;) putchar(0);\n")
    substitute(folder / "dac_sequencer.c", r"\A", "#include <stdio.h>\n")
    outcome = verify(folder)
    assert outcome.status == 5
    assert re.search(r"program: the bench ended with status -\d+", outcome.err)


@pytest.mark.common
def test_a_record_too_many_is_found(folder: Path) -> None:
    """The first tick is written twice, so that those after it come late."""
    substitute(
        folder / "dac_sequencer.c",
        r"(void dac_sequencer_step\(.*\)\n{\n)",
        r"\1    static int more = 16; for (; more > 0; more--) putchar(0);\n",
    )
    substitute(folder / "dac_sequencer.c", r"\A", "#include <stdio.h>\n")
    outcome = verify(folder)
    assert outcome.status == 5
    assert {("x", "integer model"), ("y", "integer model")} <= failed(outcome)


def endless(folder: Path) -> None:
    """Let no tick ever end."""
    substitute(
        folder / "dac_sequencer.c", r"(void dac_sequencer_step\(.*\)\n{\n)", r"\1    for (volatile int i = 0; !i;) {}\n"
    )


@pytest.mark.common
def test_a_runtime_that_does_not_end_is_ended(folder: Path, tmp_path: Path) -> None:
    endless(folder)
    sources = sorted(folder.glob("dac_*.[ch]"))
    bench = CBench(SequencerShape(16, 1, 3, 16, 1, 3, 16), tmp_path / "bench", options=["-w"], sources=sources)
    script = Script()
    script.tick_every(1)
    with pytest.raises(SimulationFailed, match="did not end in 1 s"):
        bench.run(f"{0:016x}\n{0:016x}\n{script.text()}", timeout=1.0)


@pytest.mark.common
@pytest.mark.parametrize(
    ("name", "played"),
    [
        (f"{NAME}.vh", True),
        ("dac_slew.v", True),
        (f"{NAME}.h", False),
        (f"{NAME}.c", False),
        ("dac_sequencer.h", False),
        ("dac_axis.c", False),
    ],
)
def test_a_missing_file_is_named(folder: Path, name: str, played: bool) -> None:
    (folder / name).unlink()
    outcome = verify(folder)
    assert outcome.status == 5
    assert f"files: {name}: missing" in outcome.err
    assert (("x", "integer model") in verdicts(outcome)) == played
    assert played or f"program: {name} is missing" in outcome.err


@pytest.mark.common
def test_a_build_without_the_runtime_is_told(folder: Path, short: Build) -> None:
    files = {name: digest for name, digest in short.manifest["files"].items() if not re.match(r"dac_.*\.[ch]", name)}
    edit_manifest(folder, "files", value=files)
    assert "program: the build holds no dac_*.c" in verify(folder).err


@pytest.mark.common
def test_codes_beyond_the_certificate_are_found(folder: Path, short: Build) -> None:
    promised = short.manifest["axes"]["x"]["certificate"]["max_error_lsb"]
    edit_manifest(folder, "axes", "x", "certificate", "max_error_lsb", value=promised - 0.001)
    assert failed(verify(folder)) == {("x", "its certificate")}


@pytest.mark.common
def test_a_table_that_no_runtime_takes_is_wrong_input(tmp_path: Path) -> None:
    outcome = verify(with_a_long_table(tmp_path, 70))
    assert outcome.status == 2
    assert "the table of y has 140000 words, the C sequencer plays at most 131072" in outcome.err


# Reports, options, tools, interruptions


@pytest.mark.common
def test_junit_has_a_case_a_check(folder: Path, tmp_path: Path) -> None:
    define(folder, "PIXELS", lambda value: value - 1)
    outcome = verify(folder, "--junit", tmp_path / "verify.xml")
    assert outcome.status == 5, outcome.err
    told = read_report(tmp_path / "verify.xml")
    assert list(told.cases) == list(verdicts(outcome))
    assert told.failed == failed(outcome)
    assert told.counts == (str(CHECKS), str(len(told.failed)), "0")


@pytest.mark.common
def test_what_is_played_is_kept_on_request(short: Build, tmp_path: Path) -> None:
    assert verify(short.folder, "--keep", tmp_path / "kept").status == 0
    kept = {path.name for path in (tmp_path / "kept").iterdir()}
    assert {"script.hex", "step_capture.bin", "fill_capture.bin", "c", "runtime", "bench", "objects", "step"} <= kept


@pytest.mark.parametrize("target", ["c", "cortex-m"])
@pytest.mark.parametrize("option", [("--sim", "icarus"), ("--axis", "pipelined")])
def test_options_of_verilog_are_refused(short: Build, target: str, option: tuple[str, str]) -> None:
    """Also those that say what is the default."""
    outcome = verify(short.folder, *option, target=target)
    assert (outcome.status, outcome.out) == (2, "")
    assert f"{option[0]} is for Verilog; --target {target} has no choice of it" in outcome.err


@pytest.mark.common
@pytest.mark.parametrize("compiler", ["no-such-cc", "no-such-cc -m32", "'unbalanced"])
def test_a_missing_compiler_is_status_6_with_its_remedy(short: Build, compiler: str) -> None:
    done = command(short.folder, "--target", "c", CC=compiler)
    assert (done.returncode, done.stdout) == (6, "")
    assert done.stderr == f"{compiler.split(' ')[0]} is not installed: apt-get install gcc, or set CC\n"


@pytest.mark.common
def test_a_compiler_without_a_c_library_is_status_6_with_its_remedy(short: Build, tmp_path: Path) -> None:
    """As Debian's gcc is where recommended packages are left out."""
    compiler = tmp_path / "bare-cc"
    compiler.write_text("#!/bin/sh\necho 'fatal error: stdint.h: No such file or directory' >&2\nexit 1\n", "ascii")
    compiler.chmod(0o755)
    done = command(short.folder, "--target", "c", CC=str(compiler))
    assert (done.returncode, done.stdout) == (6, "")
    assert done.stderr == f"{compiler} finds no headers of the C library: apt-get install libc6-dev\n"


@pytest.mark.rest
@pytest.mark.parametrize("compiler", long(["clang"], ["gcc", "clang"]))
def test_the_compiler_and_its_options_are_the_environments(short: Build, compiler: str) -> None:
    """Sanitizers have nothing to say either; an option that no compiler knows shows that options arrive."""
    sanitizers = "-fsanitize=undefined,address -fno-sanitize-recover=all"
    done = command(short.folder, "--target", "c", CC=compiler, CFLAGS=sanitizers)
    assert (done.returncode, done.stderr) == (0, "")
    done = command(short.folder, "--target", "c", CC=compiler, CFLAGS="--no-such-option")
    assert done.returncode == 5
    assert "no-such-option" in done.stderr


@pytest.mark.common
def test_options_that_cannot_be_read_are_a_failed_check(short: Build) -> None:
    done = command(short.folder, "--target", "c", CFLAGS="-DX='")
    assert done.returncode == 5
    assert "program: CFLAGS cannot be read: No closing quotation" in done.stderr


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_those_options_are_not_for_a_cortex_m4(short: Build) -> None:
    done = command(short.folder, "--target", "cortex-m", CFLAGS="-fsanitize=address")
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.common
def test_nothing_of_cocotb_is_needed(short: Build) -> None:
    done = command_without(["cocotb", "cocotb_tools"], short.folder, "--target", "c")
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.rest
@pytest.mark.parametrize(
    "interruption",
    long(
        [("job.json", signal.SIGINT), ("step/stream_bench", signal.SIGTERM), ("step", signal.SIGINT)],
        product(["job.json", "step/stream_bench", "step"], [signal.SIGINT, signal.SIGTERM]),
    ),
    ids=lambda interruption: "-".join(map(str, interruption)),
)
def test_an_interruption_leaves_nothing_behind(
    folder: Path, tmp_path: Path, interruption: tuple[str, signal.Signals]
) -> None:
    """Before or while a program that never ends plays, and while the process that plays is being started."""
    begun, number = interruption
    endless(folder)
    arguments = ("--target", "c")
    check_interruption(folder, tmp_path / "temporary", number, begun, *arguments, within_popen=begun == "step")


# On an emulated Cortex-M4


@pytest.mark.rest
@pytest.mark.parametrize(
    "name",
    long(
        ["left_aligned"],
        ["example", "bits_18", "bits_24", "direct_steps", "left_aligned", "short_frame", "cubic"],
    ),
)
def test_a_build_verifies_on_a_cortex_m4(name: str, tmp_path: Path) -> None:
    """Whole frames as well; both sizes of words, and tables that are played as they are."""
    outcome = verify(build(tmp_path, IN_C[name]).folder, target="cortex-m")
    assert (outcome.status, outcome.err) == (0, "")
    assert set(verdicts(outcome).values()) == {"ok"}
    header_only = "header_only" in str(IN_C[name].scan)
    assert len(verdicts(outcome)) == CHECKS - (OF_VERILOG if name == "cubic" else 0) - header_only
    assert "note:" not in outcome.out


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_tables_are_rendered_on_a_cortex_m4(short: Build) -> None:
    outcome = verify(short.folder, "--fourier", target="cortex-m")
    assert outcome.status == 0, outcome.err


@pytest.mark.rest
def test_both_targets_find_the_same(folder: Path) -> None:
    """The same checks, the same first tick, expected and got."""
    put_word(folder, "y_table", 100, lambda word: word ^ 1 << 9)
    emulated, here = verify(folder, target="cortex-m"), verify(folder)
    assert emulated.status == here.status == 5
    assert verdicts(emulated) == verdicts(here)
    assert differing(emulated) == differing(here)


@pytest.mark.rest
def test_what_is_refused_on_a_cortex_m4_is_told(folder: Path) -> None:
    define(folder, "X_GAIN_Q", lambda value: value + 1)
    outcome = verify(folder, target="cortex-m")
    assert ("program", "arm-none-eabi-gcc, Cortex-M4") in failed(outcome)
    assert "program: refused: load: DAC_BAD_OUTPUT" in outcome.err


@pytest.mark.rest
@pytest.mark.parametrize(("number", "begun"), [(signal.SIGINT, "step/stream_bench.elf"), (signal.SIGTERM, "step")])
def test_an_interruption_ends_the_emulation(folder: Path, tmp_path: Path, number: signal.Signals, begun: str) -> None:
    endless(folder)
    check_interruption(
        folder, tmp_path / "temporary", number, begun, "--target", "cortex-m", within_popen=begun == "step"
    )


def test_a_missing_cross_compiler_is_status_6_with_its_remedy(short: Build, tmp_path: Path) -> None:
    done = command(short.folder, "--target", "cortex-m", PATH=str(tmp_path))
    assert (done.returncode, done.stdout) == (6, "")
    assert done.stderr == "arm-none-eabi-gcc is not installed: apt-get install gcc-arm-none-eabi\n"


def test_a_missing_emulator_is_status_6_with_its_remedy(short: Build) -> None:
    done = command_without(["unicorn"], short.folder, "--target", "cortex-m")
    assert (done.returncode, done.stdout) == (6, "")
    assert done.stderr == "unicorn is not installed: pip install 'piezo-tablegen[cortex-m]'\n"
