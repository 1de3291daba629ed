"""Edits of the emitted Verilog: each is found by what is played, as that of a build of another version has to be."""

import re
from pathlib import Path

import pytest
from building import Build
from heard_edits import OUTPUT, SEQUENCER, Edit, PreparedPlay, judge_output
from sets import long, one_of

from tablegen.base.resources import resource_folder

pytestmark = pytest.mark.rest


# One of a module or a kind, each heard early in the session.
SOON = (
    "no second swap", "no upper clamp", "park leaves it armed", "always writable", "max_step a tick early",
    "offset of y too wide", "never refused",
)  # fmt: skip


@pytest.fixture(scope="module")
def prepared(short: Build, tmp_path_factory: pytest.TempPathFactory) -> PreparedPlay:
    return PreparedPlay(short.folder, tmp_path_factory.mktemp("prepared"))


def test_the_build_as_it_is_passes(prepared: PreparedPlay, tmp_path: Path) -> None:
    assert prepared.judge(None, tmp_path) is None


@pytest.mark.parametrize(
    "edit",
    long([edit for edit in SEQUENCER if edit.breaks in SOON], SEQUENCER),
    ids=[edit.breaks for edit in SEQUENCER],
)
def test_an_edit_of_the_sequencer_is_heard(edit: Edit, prepared: PreparedPlay, tmp_path: Path) -> None:
    assert prepared.judge(edit, tmp_path) is not None


def test_outputs_as_they_are_pass(tmp_path: Path) -> None:
    assert judge_output(None, tmp_path, Path(str(resource_folder("firmware_templates") / "verilog"))) is None


@pytest.mark.parametrize("edit", one_of(2, OUTPUT), ids=[edit.breaks for edit in OUTPUT])
def test_an_edit_of_an_output_is_found(edit: Edit, tmp_path: Path) -> None:
    failure = judge_output(edit, tmp_path, Path(str(resource_folder("firmware_templates") / "verilog")))
    assert failure is not None
    assert re.match(rf"{edit.file}: wrong on \d+ clocks", failure)
