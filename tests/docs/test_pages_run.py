"""Start pages, tutorial and how-to pages: every command of them runs, and prints what they show."""

import re
from pathlib import Path

import pytest
from building import REPOSITORY
from page_script import Shown, different, run_page, script_of

DOCS = REPOSITORY / "docs"
# A cross compiler and an emulator; the longest simulation of a page, where the tutorial has a shorter one.
NEEDS = {"start/firmware.md": "rest", "start/fpga.md": "rest"}
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
# Pages whose commands are not run here, and where they are, or why none runs them: tests/README.md has the same list.
ELSEWHERE = {
    "build_step.md": "tests/packaging/test_build_step.py",
    "calibration.md": "tests/cli/test_calibration_cli.py",
    "compare.md": "tests/comparison/test_compare.py",
    "correct.md": "tests/docs/test_correct_page.py",
    "image_files.md": "tests/docs/test_image_files_page.py",
    "images.md": "tests/docs/test_images_page.py",
    "lattice.md": "not run",
    "live.md": "tests/cli/test_live_cli.py",
    "operator.md": "tests/docs/test_operator_page.py",
    "python.md": "tests/api/test_python_page.py",
    "report.md": "not run",
    "start/projects.md": "tests/docs/test_firmware_projects.py",
    "sweep.md": "tests/docs/test_sweep_page.py",
    "tables.md": "tests/docs/test_tables_page.py",
    "upload.md": "tests/docs/test_link_docs.py",
    "verify.md": "not run",
    "virtual.md": "not run",
}
COMMANDS = re.compile(r"^```(?:sh|python)$|^\$ ", re.MULTILINE)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=getattr(pytest.mark, NEEDS.get(name, "common"))) for name in PAGES]
)
def test_every_command_of_the_page_runs(name: str, tmp_path: Path) -> None:
    assert run_page(DOCS / name, tmp_path) == []


def test_what_is_left_out_is_the_installation_and_what_other_tests_run() -> None:
    reasons = {reason for name in PAGES for reason in script_of((DOCS / name).read_text("utf-8")).left_out}
    assert reasons == {"not run: the tests have it installed", "tested: tests/docs/test_docs.py"}


def test_every_page_that_shows_commands_is_run_or_in_the_list() -> None:
    pages = {
        str(path.relative_to(DOCS)): path for folder in ("", "start/", "howto/") for path in DOCS.glob(f"{folder}*.md")
    }
    with_commands = {name for name, path in pages.items() if COMMANDS.search(path.read_text("utf-8"))}
    assert with_commands - {*PAGES} == {*ELSEWHERE}
    listed = (REPOSITORY / "tests" / "README.md").read_text("utf-8").partition("**Pages.**")[2].partition("\n\n")[0]
    assert {*re.findall(r"`([\w/]+\.md)`", listed)} == {*ELSEWHERE}
    for name, where in ELSEWHERE.items():
        if where != "not run":
            assert Path(name).name in (REPOSITORY / where).read_text("utf-8"), where


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
