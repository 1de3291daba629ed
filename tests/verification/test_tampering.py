"""Tamperings of a build whose hashes were made right again: each is found by what is played, measured or listed.

Those of the sequencer pretend to be of another version, so that its files are not compared with those installed: what
finds them is the session. That comparison has tests of its own.
"""

import copy
import json
import re
from collections.abc import Iterator
from contextlib import nullcontext
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
from building import NAME, Variant, build
from editing import Outcome, run
from kept_plays import own_program_alone
from sets import LONG_TEST, long, one_of
from verifying import edit_manifest, failed, make_right

from tablegen.manifest.read import NotABuild
from tablegen.verification.run import verify as verify_build
from tablegen.version import __version__

OTHER = "0.0.7"
CAPITAL = NAME.upper()
REQUESTS, MARKERS, FAULTS = (("requests", "integer model"), ("markers", "integer model"), ("faults", "integer model"))
X = ("x", "integer model")
WORDS = ("x", "converter word")


def substitute(path: Path, pattern: str, new: str) -> None:
    """Put other text in the one place where a pattern matches."""
    text, count = re.subn(pattern, new, path.read_text("ascii"))
    assert count == 1, f"{path.name} has {count} of {pattern!r}"
    path.write_text(text, "ascii")


def verify(folder: Path, *arguments: str) -> Outcome:
    return run("verify", folder, *arguments)


# What the Verilog does

VERILOG = [
    # what, file, pattern, replacement, what finds it; heard_edits.py has many more
    ("no lower clamp", "dac_output", r"over_min\[CODE_BITS-1\] \? \{CODE_BITS\{1'b1\}\} : ~over_min", "~over_min", X),
    ("swap in mid-line", "dac_scan", r"committed && \(!running \|\| first\)", "committed", MARKERS),
    ("never refused", "dac_sequencer", r"refused <= 1'b1", "refused <= 1'b0", REQUESTS),
    ("coding inverted", "dac_coding", r"\^ INVERTED", "^ !INVERTED", WORDS),
]  # fmt: skip


@pytest.mark.parametrize(
    ("file", "pattern", "new", "finds"),
    [pytest.param(*row[1:], marks=() if row[0] == "coding inverted" else LONG_TEST) for row in VERILOG],
    ids=[row[0] for row in VERILOG],
)
@pytest.mark.rest
def test_a_sequencer_that_is_tampered_with_is_heard(
    folder: Path, file: str, pattern: str, new: str, finds: tuple[str, str]
) -> None:
    substitute(folder / f"{file}.v", pattern, new)
    make_right(folder, OTHER)
    with own_program_alone() if finds == WORDS else nullcontext():
        outcome = verify(folder, "--ticks", "2000", "--axis", "blocks", "--other-version")
    assert outcome.status == 5
    assert finds in failed(outcome), outcome.out
    assert ("files", "SHA-256 in the manifest") not in failed(outcome)
    assert f"note: built by tablegen {OTHER}, verified by {__version__}: its runtime was not compared" in outcome.out


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_an_overrun_that_is_not_told_is_found(folder: Path) -> None:
    """A tick that comes while the low-area axis is busy is lost."""
    faults = r"\{underrun, overrun, clamp_fault, slew_fault\}"
    substitute(folder / "dac_verdict.v", faults, "{underrun, 1'b0, clamp_fault, slew_fault}")
    make_right(folder, OTHER)
    outcome = verify(folder, "--axis", "serial", "--ticks", "1000", "--other-version")
    assert FAULTS in failed(outcome), outcome.out


@pytest.mark.rest
def test_a_serial_output_that_is_tampered_with_is_found(folder: Path) -> None:
    """The words are right, what leaves on the wires is not."""
    substitute(folder / "dac_spi.v", r"(mosi_x *(?:<=|=) *)", r"\1!")
    make_right(folder, OTHER)
    with own_program_alone():
        outcome = verify(folder, "--ticks", "2000", "--axis", "blocks", "--other-version")
    assert failed(outcome) == {
        ("serial", "converter word"),
        ("dac_spi", "its options"),
    }


# What the C does

C = [
    ("no second swap", "sequencer.c", r"s->playing = s->playing == 0 \? 1 : 0;", "s->playing = 0;"),
    ("frames without end", "sequencer.c", r"!s->endless && --s->frames_left == 0", "0"),
    ("withdraw ignored", "sequencer.c", r"(case WITHDRAW:\n *)s->waiting = 0;", r"\1;"),
    ("swap in mid-line", "sequencer.c", r"\(s->running && s->tick != 0\)", "false"),
    ("begins settled", "sequencer.c", r"settle_left = [^;]*settle_lines;", "settle_left = 0;"),
    ("faults not sticky", "sequencer.c", r"s->faults = [^;]*\| \(?fault\b[^;]*;", ";"),
    ("busy is no reason", "program.c", r"if \(!dac_sequencer_writable\(s\)\)", "if (0)"),
    ("no lower limit", "program.c", r"b->code_min = p->code_min;", "b->code_min = 0;"),
    ("no upper limit", "program.c", r"b->code_max = p->code_max;", "b->code_max = (1 << p->dac_bits) - 1;"),
    ("no slew guard", "program.c", r"b->max_step = p->max_step;", "b->max_step = 1 << 23;"),
    ("settling ends early", "sequencer.c", r"clean && s->settle_left == 0", "clean && s->settle_left <= 1"),
    (
        "a window one too long",
        "sequencer.c",
        r"at - window->first < window->count",
        "at - window->first <= window->count",
    ),
    ("a window beyond its line", "program.c", r" && window->count <= length - window->first", ""),
    ("a window behind its line", "program.c", r"window->first <= length && ", ""),
    ("a gain too wide", "program.c", r"p->gain_word < INT32_C\(1\) << 17", "p->gain_word < INT32_C(1) << 18"),
    ("an offset too wide", "program.c", r"&& p->offset_word < INT64_C\(2\)", "&& p->offset_word < INT64_C(8)"),
    ("a park code beyond", "program.c", r" && p->park_code <= p->code_max", ""),
    ("a step of 0", "program.c", r"p->max_step >= 1", "p->max_step >= 0"),
    ("more pixels than ticks", "program.c", r" && p->pixels <= p->line_ticks", ""),
    ("a period of its own", "program.c", r" && p->x.phase_period == ticks", ""),
    ("a park code of its own", "program.c", r"b->park_code = p->park_code;", "b->park_code = p->code_min;"),
]


@pytest.mark.rest
@pytest.mark.parametrize(("file", "pattern", "new"), one_of(5, (row[1:] for row in C), 3), ids=[row[0] for row in C])
def test_c_that_is_tampered_with_is_heard(folder: Path, file: str, pattern: str, new: str) -> None:
    substitute(folder / f"dac_{file}", pattern, new)
    make_right(folder, OTHER)
    outcome = verify(folder, "--target", "c", "--ticks", "2000", "--other-version")
    assert outcome.status == 5
    assert {against for _, against in failed(outcome)} & {"integer model", "slew guard", "clamp"}


# What stands in the manifest


def leaves(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[tuple[str | int, ...], Any]]:
    """Every number and string of a manifest; of long arrays the second and the last."""
    if isinstance(value, dict):
        for key, below in value.items():
            yield from leaves(below, (*path, key))
    elif isinstance(value, list):
        chosen = range(len(value)) if len(value) <= 4 else (1, len(value) - 1)
        for at in chosen:
            yield from leaves(value[at], (*path, at))
    else:
        yield path, value


CHOICES = (("offset-binary", "twos-complement"), ("right", "left"), ("forward", "both"), ("interpolated", "direct"))


def changed(value: Any) -> Any:
    """A little more of it, or another choice."""
    if isinstance(value, str):
        return next((pair[value == pair[0]] for pair in CHOICES if value in pair), value + "x")
    if value is None:
        return 1.0
    return value + 1 if isinstance(value, int) else value * 1.0001 + 1e-6


# What nothing else in a directory depends on: names, and what of the scanner's model a scan does not use.
STATED_ONLY = {
    "tablegen", "hash", "scanner", "formats",
    "axes.x.drive.position_nm", "axes.y.drive.position_nm",
    "axes.x.drive.resonance.hz", "axes.x.drive.resonance.half_width_hz",  # beyond all ticks of so short a line
    "axes.y.drive.backward.beta", "axes.y.drive.backward.u_peak",  # not imaged
}  # fmt: skip


@pytest.mark.rest
@pytest.mark.parametrize("stride", long([4], [4, 1]))
def test_every_number_of_a_manifest_follows_from_others(stride: int, folder: Path) -> None:
    """Each, or one of so many, is changed by itself, its hash made right; nothing is played."""
    manifest = json.loads((folder / "manifest.json").read_bytes())
    unseen, count = set(), 0
    every = leaves({key: below for key, below in manifest.items() if key != "files"})
    for path, value in islice(every, 0, None, stride):
        altered = copy.deepcopy(manifest)
        place: Any = altered
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = changed(value)
        (folder / "manifest.json").write_text(json.dumps(altered), "ascii")
        make_right(folder)
        count += 1
        try:
            found = bool(verify_build(folder, "files").failures)
        except NotABuild:
            found = True
        if not found:
            unseen.add(".".join(str(key) for key in path))
    assert unseen <= STATED_ONLY
    assert count > 150 // stride


@pytest.mark.common
@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("certificate", "max_error_lsb"), 99.0),
        (("certificate", "max_error_lsb"), None),
        (("certificate", "largest_step"), 3),
        (("certificate", "lowest_code"), 0),
        (("certificate", "scaling_error_percent", "forward", "total"), 0.01),
        (("certificate", "scaling_error_percent", "forward", "model"), 0.2),
        (("certificate", "scaling_error_percent"), {}),
        (("certificate", "beyond_cutoff_db"), -120.0),
        (("output", "v_per_code"), float("nan")),
        (("fourier", "a0"), float("inf")),
    ],
    ids=lambda value: str(value) if isinstance(value, tuple) else "",
)
def test_a_certificate_is_worked_out_again(folder: Path, path: tuple[str, ...], value: object) -> None:
    edit_manifest(folder, "axes", "x", *path, value=value)
    make_hash_right = path[0] == "certificate"
    if make_hash_right:
        make_right(folder)
    outcome = verify(folder, "--target", "files")
    if value is None or path[0] != "certificate":
        assert outcome.status == 2
        assert "is damaged" in outcome.err
    else:
        assert failed(outcome) == {("x", "its certificate")}
        assert f"certificate.{path[1]}" in outcome.err


@pytest.mark.common
def test_the_certificate_of_a_layer_is_worked_out_again(tmp_path: Path) -> None:
    """And one whose period is too long to look at every tick."""
    long = Variant({"timing.lines": 4000, "timing.line_rate_hz": 100.0})
    folder = build(tmp_path, long).folder
    assert json.loads((folder / "manifest.json").read_bytes())["axes"]["y"]["certificate"]["ticks"] > 1 << 22
    assert verify(folder, "--target", "files").status == 0
    edit_manifest(folder, "axes", "y", "certificate", "rms_error_lsb", value=0.2)
    assert failed(verify(folder, "--target", "files")) == {("y", "its certificate")}


# Which files there are


@pytest.mark.parametrize("names", [["dac_link.c", "program_loader.v"], [f"{NAME}.vh"], [f"{NAME}.c"]])
def test_a_file_that_the_manifest_does_not_list_is_missed(folder: Path, names: list[str]) -> None:
    manifest = json.loads((folder / "manifest.json").read_bytes())
    for name in names:
        (folder / name).unlink()
        del manifest["files"][name]
    (folder / "manifest.json").write_text(json.dumps(manifest), "ascii")
    outcome = verify(folder, "--target", "files")
    if names == [f"{NAME}.c"]:  # without it the arrays are to be in the header
        assert ("c arrays", "manifest") in failed(outcome)
    else:
        assert ("files", "its formats") in failed(outcome)
        assert all(f"{name}: a build of" in outcome.err for name in names)


def test_a_file_that_no_such_build_has_is_found(folder: Path) -> None:
    """One that the manifest lists, and one that only a command line with a pattern takes in."""
    (folder / "other.bin").write_bytes(b"x")
    (folder / "dac_more.v").write_text("module dac_more; endmodule\n", "ascii")
    edit_manifest(folder, "files", "other.bin", value="0" * 64)
    make_right(folder)
    outcome = verify(folder, "--target", "files")
    assert failed(outcome) == {("files", "its formats")}
    assert "other.bin: the manifest lists it, no build of c, verilog has it" in outcome.err
    assert "dac_more.v: not a file of the build, but compilers that are given a pattern take it in" in outcome.err


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("dac_uart_tx.v", "endmodule", "endmodule // and more"),
        ("dac_link_mac.c", "#include", "  #include"),
        (f"{NAME}.h", f"#define {CAPITAL}_PIXELS 50", f"#define {CAPITAL}_PIXELS 50\n#undef {CAPITAL}_PIXELS"),
        (f"{NAME}.h", " */\n#ifndef", " */ int x; /* */\n#ifndef"),
        (f"{NAME}.vh", "Do not edit", "`define X"),
        (f"{NAME}_top.v", ".TWOS_COMPLEMENT(0)", ".TWOS_COMPLEMENT(1)"),
    ],
)
def test_a_file_is_compared_with_that_of_the_version(folder: Path, name: str, old: str, new: str) -> None:
    """Byte for byte, or line for line after the comment at its beginning, whose words no manifest has."""
    path = folder / name
    path.write_text(path.read_text("ascii").replace(old, new, 1), "ascii")
    make_right(folder)
    outcome = verify(folder, "--target", "files")
    assert failed(outcome) == (set() if "Do not" in old else {("files", f"tablegen {__version__}")})
    assert "was not compared" not in outcome.out
    make_right(folder, OTHER)
    outcome = verify(folder, "--target", "files", "--other-version")
    assert outcome.status == 0
    assert f"note: built by tablegen {OTHER}, verified by {__version__}: its runtime was not compared" in outcome.out
