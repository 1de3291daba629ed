"""Edits of the emitted Verilog: each is found by what is played, as that of a build of another version has to be."""

import re
from pathlib import Path

import pytest
from building import Build
from heard_edits import OUTPUT, SEQUENCER, Edit, PreparedPlay, judge_output

from tablegen.base.resources import resource_folder

QUICK = ("settling ends a line short", "a trigger does not see the program of its tick")
COMMON = (
    "the sign of a negative offset",
    "valid between ticks in spite of a fault",
    "any order of shaping",
    "pixels are loaded a clock late",
    "an empty window images",
)


@pytest.fixture(scope="module")
def prepared(short: Build, tmp_path_factory: pytest.TempPathFactory) -> PreparedPlay:
    return PreparedPlay(short.folder, tmp_path_factory.mktemp("prepared"))


@pytest.mark.common
def test_the_build_as_it_is_passes(prepared: PreparedPlay, tmp_path: Path) -> None:
    assert prepared.judge(None, tmp_path) is None


def marks(edit: Edit) -> list[pytest.MarkDecorator]:
    return [] if edit.breaks in QUICK else [pytest.mark.common if edit.breaks in COMMON else pytest.mark.rest]


@pytest.mark.common
@pytest.mark.parametrize("edit", [pytest.param(edit, id=edit.breaks, marks=marks(edit)) for edit in SEQUENCER])
def test_an_edit_of_the_sequencer_is_heard(edit: Edit, prepared: PreparedPlay, tmp_path: Path) -> None:
    assert prepared.judge(edit, tmp_path) is not None


@pytest.mark.common
def test_outputs_as_they_are_pass(tmp_path: Path) -> None:
    assert judge_output(None, tmp_path, Path(str(resource_folder("firmware_templates") / "verilog"))) is None


@pytest.mark.common
@pytest.mark.parametrize("edit", OUTPUT, ids=[edit.breaks for edit in OUTPUT])
def test_an_edit_of_an_output_is_found(edit: Edit, tmp_path: Path) -> None:
    failure = judge_output(edit, tmp_path, Path(str(resource_folder("firmware_templates") / "verilog")))
    assert failure is not None
    assert re.match(rf"{edit.file}: wrong on \d+ clocks", failure)
