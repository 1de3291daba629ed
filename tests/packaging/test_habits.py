"""What holds habits: hooks, editors, hosted CI, templates. They name what is there, and agree on widths."""

import json
import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml
from building import REPOSITORY

LONGEST = 120
HOOKS = yaml.safe_load((REPOSITORY / ".pre-commit-config.yaml").read_text("utf-8"))["repos"][0]["hooks"]


def text(name: str) -> str:
    return (REPOSITORY / name).read_text("utf-8")


@pytest.mark.parametrize("hook", HOOKS, ids=lambda hook: str(hook["id"]))
def test_a_hook_uses_what_is_here(hook: dict[str, Any]) -> None:
    """Nothing is downloaded: tools of the environment, of the system, or scripts of this repository."""
    assert hook["language"] == "system"
    program, *arguments = hook["entry"].split()
    if program.startswith(".venv/bin/"):
        assert program.rpartition("/")[2] in {"ruff", "mypy", "python"}
    else:
        assert (REPOSITORY / program).stat().st_mode & 0o100
    for name in arguments:
        assert not name.startswith("tests/") or (REPOSITORY / name).exists()


def test_hooks_are_what_make_check_runs() -> None:
    entries = " ".join(hook["entry"] for hook in HOOKS)
    rules = re.findall(r"^(?:style|types):.*\n((?:\t.*\n)+)", text("Makefile"), re.MULTILINE)
    commands = re.findall(r"\$\(BIN\)/(ruff \w+|mypy)", "".join(rules))
    assert sorted(commands) == ["mypy", "ruff check", "ruff format"]
    for command in commands:
        assert f".venv/bin/{command}" in entries


def test_widths_are_the_same_everywhere() -> None:
    ruff = tomllib.loads(text("pyproject.toml"))["tool"]["ruff"]
    assert ruff["line-length"] == LONGEST
    assert ruff["lint"]["mccabe"]["max-complexity"] == 12
    assert f"max_line_length = {LONGEST}\n" in text(".editorconfig")
    style = yaml.safe_load(text(".clang-format"))
    assert (style["ColumnLimit"], style["IndentWidth"]) == (LONGEST, 4)


def c_files() -> list[Path]:
    folders = ("benchmarks", "examples", "firmware_templates", "hdl_tests", "tablegen", "tests")
    files = [path for name in folders for end in ("c", "h", "ino") for path in (REPOSITORY / name).rglob(f"*.{end}")]
    return [*files, *(REPOSITORY / "firmware_templates" / "c").glob("*.j2")]


def test_lines_of_c_are_short() -> None:
    files = [path for path in c_files() if "build" not in path.relative_to(REPOSITORY).parts]
    assert len(files) > 60
    assert {"dac_sequencer.h", "dac_short.h", "tables.h.j2"} <= {path.name for path in files}
    long = [
        f"{path.relative_to(REPOSITORY)}:{number}"
        for path in files
        for number, line in enumerate(path.read_text("utf-8").splitlines(), 1)
        if len(line) > LONGEST
    ]
    assert long == []


def test_hosted_ci_runs_the_two_parts_of_ci() -> None:
    workflow = yaml.safe_load(text(".github/workflows/ci.yml"))
    (job,) = workflow["jobs"].values()
    parts = job["strategy"]["matrix"]["part"]
    assert [step["run"] for step in job["steps"] if "run" in step][-1] == ".ci/run ${{ matrix.part }}"
    script = text(".ci/run")
    assert sorted(parts) == ["rest", "test"]
    for other, target in (("rest", "test"), ("test", "test-rest")):
        assert f'[ "$part" = {other} ] || run {target} ' in script


def test_ci_takes_no_other_part() -> None:
    """It says what there is before it installs or runs anything."""
    done = subprocess.run([REPOSITORY / ".ci" / "run", "none"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (2, "usage: .ci/run [test|rest]\n")


def test_the_container_runs_make_check() -> None:
    container = json.loads(text(".devcontainer/devcontainer.json"))
    assert container["postCreateCommand"] == "make check"
    packages = text(".devcontainer/" + container["build"]["dockerfile"])
    assert all(name in packages.split() for name in ("make", "python3", "python3-venv", "git", "gpgv"))


@pytest.mark.parametrize("path", sorted((REPOSITORY / ".github" / "ISSUE_TEMPLATE").glob("*.md")), ids=lambda p: p.stem)
def test_a_template_has_a_name_and_a_purpose(path: Path) -> None:
    front = yaml.safe_load(path.read_text("utf-8").split("---\n")[1])
    assert {"name", "about", "labels"} <= front.keys()


def test_contributing_is_one_screen() -> None:
    assert len(text("CONTRIBUTING.md").splitlines()) <= 60


@pytest.mark.parametrize(
    ("message", "status"),
    [
        ("Add a format\n", 0),
        ("x" * 72 + "\n", 0),
        ("µ" * 72 + "\n", 0),
        ("x" * 73 + "\n", 1),
        ("# a comment of git\n\n" + "x" * 73 + "\n", 1),
        ("Add a format\n\n" + "x" * 100 + "\n", 0),
    ],
)
def test_a_long_subject_is_refused(tmp_path: Path, message: str, status: int) -> None:
    (tmp_path / "message").write_text(message, "utf-8")
    done = subprocess.run(
        [REPOSITORY / ".ci" / "check-subject", tmp_path / "message"],
        capture_output=True,
        check=False,
        env={"PATH": "/usr/bin:/bin", "LC_ALL": "C.UTF-8"},
    )
    assert done.returncode == status
