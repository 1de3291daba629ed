"""Start pages, tutorial and how-to pages: every command of them runs, and prints what they show."""

from pathlib import Path

import pytest
from building import REPOSITORY
from page_script import Shown, different, run_page, script_of

DOCS = REPOSITORY / "docs"
NEEDS = {"start/firmware.md": "rest"}  # a cross compiler and an emulator
PAGES = [
    "tutorial.md",
    "start/microscopist.md",
    "start/firmware.md",
    "start/fpga.md",
    "building.md",
    "gallery.md",
    "shell.md",
    "theory.md",
    *sorted(str(path.relative_to(DOCS)) for path in DOCS.glob("howto/*.md")),
]


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=getattr(pytest.mark, NEEDS.get(name, "common"))) for name in PAGES]
)
def test_every_command_of_the_page_runs(name: str, tmp_path: Path) -> None:
    assert run_page(DOCS / name, tmp_path) == []


def test_what_is_left_out_is_the_installation_and_what_other_tests_run() -> None:
    reasons = {reason for name in PAGES for reason in script_of((DOCS / name).read_text("utf-8")).left_out}
    assert reasons == {"not run: the tests have it installed", "tested: tests/docs/test_docs.py"}


# Negative controls


def test_a_block_that_nobody_runs_is_found() -> None:
    with pytest.raises(ValueError, match="a block in ruby"):
        script_of("```ruby\nprint(1)\n```\n")


@pytest.mark.parametrize("printed", ["", "size 3.0 nm\n", "size 2.0 V\n", "size 2.0 nm\nmore\n", "more\nsize 2.0 nm\n"])
def test_another_output_is_found(printed: str) -> None:
    assert different(Shown("measure", ["size 2.0 nm"]), printed)


def test_a_command_that_fails_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```sh\nfalse\ntrue\n```\n", "utf-8")
    with pytest.raises(AssertionError):
        run_page(page, tmp_path)


def test_the_same_output_is_accepted() -> None:
    assert different(Shown("measure", ["size 2.0 nm", "...", "end"]), "size 2.01 nm\na\nb\nend\n") == []
