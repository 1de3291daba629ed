"""All formats of a build at once: names, bytes, verification, and what none of them may do."""

import os
import re
from collections import Counter
from pathlib import Path

import pytest
from building import NAME, VARIANTS, write_variant
from editing import Outcome, run
from formatted import BUILDS, FEW, Formatted, formatted
from replacing import replace
from sets import quick
from verifying import verdicts

from tablegen.base.input_errors import Unphysical
from tablegen.emit.format import Format
from tablegen.emit.formats import get, own_names
from tablegen.emit.package_options import OPTIONS_HEADER
from tablegen.emit.stored import stored_content
from tablegen.emit.waveforms import MOST_TICKS
from tablegen.emit.write import names_of_build
from tablegen.manifest.read import read_build

OF_SAMPLES = ("csv", "npz", "pwl", "wav")


@pytest.fixture(scope="module")
def together(tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("together"), "short", *own_names())


def test_each_file_is_a_format_and_has_a_test() -> None:
    tested = {path.stem for path in Path(__file__).parent.glob("test_format_*.py")}
    covered = {"c", "verilog"}  # played in test_emitted_c.py and hdl_tests/test_emitted_verilog.py
    assert {f"test_format_{name.replace('-', '_')}" for name in set(own_names()) - covered} <= tested


def test_no_two_formats_write_a_file(together: Formatted) -> None:
    """But for the options of packages, which are the same in all of them."""
    content = stored_content(read_build(together.folder))
    written = [file for each in own_names() for file in get(each).files(content).items()]
    assert {name for (name, _), count in Counter(written).items() if count > 1} == {OPTIONS_HEADER}
    names = [name for name, _ in set(written)]
    names += [path.name for each in own_names() for path in get(each).runtime()]
    assert len({name.lower() for name in names}) == len(names)  # on file systems that do not tell cases apart either
    assert {*names, "manifest.json"} == together.files.keys()


def test_the_next_build_knows_each_file_as_one_of_a_build(together: Formatted) -> None:
    """So that it removes those of a format that is no longer chosen."""
    names = together.files.keys() - {"manifest.json"}
    assert set(names_of_build(NAME, names)) == names


@pytest.mark.parametrize("name", own_names())
def test_the_names_of_files_are_those_that_it_says(together: Formatted, name: str) -> None:
    found = get(name)
    said = re.sub(r" \(.*?\)", "", found.file_names).replace("NAME", NAME).split(", ")
    patterns = [re.escape(each).replace(r"\*", r"\w*") for each in said]
    files = [*found.files(stored_content(read_build(together.folder))), *(path.name for path in found.runtime())]
    for file in files:
        assert any(re.fullmatch(pattern, file) for pattern in patterns), file
    for pattern in patterns:
        assert any(re.fullmatch(pattern, file) for file in files), pattern


@pytest.mark.common
@pytest.mark.parametrize("build", quick(FEW, BUILDS))
@pytest.mark.parametrize("name", own_names())
def test_a_build_and_its_manifest_make_the_same_bytes(
    tmp_path_factory: pytest.TempPathFactory, together: Formatted, build: str, name: str
) -> None:
    """Twice from the plan, and once from the manifest alone but for the comment at the beginning of a file."""
    folder = together.folder.parent
    first, second = (formatted(folder, build, name).files for _ in range(2))
    assert first == second
    found = get(name)
    content = stored_content(read_build(folder / f"{build}-{name}"))
    made, others = found.files(content), [get(each) for each in found.needs]
    beside = {path.name for each in (found, *others) for path in each.runtime()} | {"manifest.json"}
    assert made.keys() == first.keys() - beside.union(*(each.files(content) for each in others))
    for file, content in made.items():
        if name not in ("c", "verilog"):  # which have their own checks
            assert found._after_comment(content)[1] == found._after_comment(first[file])[1], file
            assert len(found._after_comment(content)[1]) > 0


def all_at_once(folder: Path) -> Outcome:
    """All formats by the command line, into ``out``."""
    scan = write_variant(folder, replace(VARIANTS["short_frame"], scan={**BUILDS["short"].scan, "limits": {}}))
    options = [option for name in own_names() for option in ("-f", name)]
    return run("build", scan, "-o", folder / "out", *options)


@pytest.mark.common
def test_the_command_line_builds_and_verifies_all(tmp_path: Path) -> None:
    assert all_at_once(tmp_path).status == 0
    outcome = run("verify", "--target", "files", tmp_path / "out")
    assert outcome.status == 0, outcome.err
    told = verdicts(outcome)
    assert set(told.values()) == {"ok"}
    assert {row.split()[0] for row, against in told if against == "manifest"} == set(own_names())


@pytest.mark.rest
def test_the_default_target_verifies_all(tmp_path: Path) -> None:
    assert all_at_once(tmp_path).status == 0
    outcome = run("verify", "--ticks", "2000", "--axis", "blocks", tmp_path / "out")
    assert outcome.status == 0, outcome.err
    assert len(verdicts(outcome)) > 15


@pytest.mark.parametrize("name", OF_SAMPLES)
def test_a_frame_that_is_too_long_is_refused(tmp_path: Path, name: str) -> None:
    content = stored_content(read_build(formatted(tmp_path, "short", name).folder))
    lines = MOST_TICKS // content.schedule.ticks + 1
    schedule = replace(content.schedule, lines=lines)
    with pytest.raises(Unphysical) as caught:
        get(name).files(replace(content, program=replace(content.program, schedule=schedule)))
    said = str(caught.value)
    above = schedule.frame_ticks - MOST_TICKS
    assert said.startswith(
        f"a frame of {schedule.frame_ticks} ticks is {above} ticks too long for a file of its samples"
    )
    for remedy in ("dac.update_rate_hz", "timing.lines", "timing.line_rate_hz"):
        assert remedy in said


def test_a_manifest_that_a_format_cannot_hold_fails_the_check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    built = formatted(tmp_path, "short", "npz")
    monkeypatch.setattr("tablegen.emit.waveforms.MOST_TICKS", 1000)
    outcome = run("verify", "--target", "files", built.folder)
    assert outcome.status == 5
    assert "npz files: a frame of 2648 ticks is 1648 ticks too long" in outcome.err


@pytest.mark.common
@pytest.mark.parametrize("name", own_names())
def test_a_missing_file_is_told(tmp_path: Path, name: str) -> None:
    built = formatted(tmp_path, "short", name)
    gone = next(iter(get(name).files(stored_content(read_build(built.folder)))))
    os.remove(built.folder / gone)
    outcome = run("verify", "--target", "files", built.folder)
    assert outcome.status == 5
    assert any(line.startswith(name) and gone in line and "cannot be read" in line for line in outcome.messages)


def test_every_format_says_what_it_is_for() -> None:
    for name in own_names():
        found = get(name)
        assert isinstance(found, Format)
        assert found.name == name
        assert found.purpose
        assert len(found.purpose) <= 104  # `tablegen formats` puts 16 characters before it
