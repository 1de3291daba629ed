"""docs/sweep.md: its commands print what it shows, its files are read, its C and Verilog are taken by compilers."""

import re
import shlex
import tomllib
from pathlib import Path

import pytest
from building import REPOSITORY, run_clean
from editing import SCAN, SCANNER, edited, run

from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.config.settings import parse_setting
from tablegen.config.variants import variants

PAGE = (REPOSITORY / "docs" / "sweep.md").read_text("utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


def blocks(language: str) -> list[str]:
    return [code for kind, code in BLOCKS if kind == language]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the first two commands of the page were run."""
    folder = tmp_path_factory.mktemp("page")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        commands = [shlex.split(line)[1:] for line in blocks("sh")[0].splitlines()]
        assert run(*commands[0]).status == 0
        done = run(*commands[1], "--jobs", "1")
    assert (done.status, done.out, done.err) == (0, blocks("text")[0], "")
    return folder


def test_the_list_has_the_name_that_the_page_says(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    done = run(*shlex.split(blocks("sh")[1])[1:])
    assert done.out.count(": up to date") == 6
    (name,) = re.findall(r"named after what was set: `(\w+)`", PAGE)
    assert done.out.startswith(name)


@pytest.mark.common
def test_the_c_of_the_page_compiles_with_the_library(folder: Path) -> None:
    (code,) = blocks("c")
    (folder / "page.c").write_text(code, "utf-8")
    out = folder / "out"
    options = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", f"-I{out}"]
    run_clean(["gcc", *options, folder / "page.c", *sorted(out.glob("*.c")), *sorted(out.glob("*/*.c"))])


def test_the_verilog_of_the_page_elaborates(folder: Path) -> None:
    (code,) = blocks("verilog")
    (folder / "page.v").write_text(code, "utf-8")
    out = folder / "out"
    run_clean(["iverilog", "-g2005", f"-I{out}", "-o", folder / "page.vvp", folder / "page.v", out / "dac_library.v"])


@pytest.mark.common
def test_the_failure_is_what_the_page_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("scan.toml").write_text(SCAN, "utf-8")
    Path("scanner.toml").write_text(SCANNER, "utf-8")
    done = run("sweep", "scan.toml", "--set", "x.size_nm=200,1400", "-o", "out", "-f", "csv", "-j", "1")
    assert done.err + done.out == blocks("text")[1]
    assert done.status == 11


def test_the_scans_of_the_page_are_built(tmp_path: Path) -> None:
    (text,) = blocks("toml")
    head, scans = text.split("# [dac]", 1)
    base = edited(SCAN, 'name = "lab"', "- x.size_nm", "- y.size_nm", "- [limits]")
    assert head.startswith('name = "lab"')
    (tmp_path / "scanner.toml").write_text(SCANNER, "utf-8")
    (tmp_path / "lab.toml").write_text(base + scans.split("\n", 1)[1], "utf-8")
    library, found = variants(tmp_path / "lab.toml")
    assert (library, [one.name for one in found]) == ("lab", ["overview", "close"])
    setups = [one.setup.scan for one in found]
    assert [scan.x.size_nm for scan in setups] == [900.0, 200.0]
    assert [scan.x.table.length for scan in setups] == [2048, 4096]
    done = run("sweep", tmp_path / "lab.toml", "-o", tmp_path / "out", "-f", "c", "-j", "1")
    assert done.status == 0
    assert tomllib.loads(text)["scans"][0]["name"] == "overview"


@pytest.mark.parametrize(
    ("values", "count"),
    [("10,50,90", 3), ("50:1000:50", 20), ("0.1:0.5:0.1", 5), ("1:2:0.3", 4), ("90:10:-40", 3), ("10,20:40:10,90", 5)],
)
def test_the_values_of_the_page_are_taken(values: str, count: int) -> None:
    (told,) = re.findall(rf"^\| `{re.escape(values)}` \| (.*) \|$", PAGE, re.MULTILINE)
    found = parse_setting(f"x.key={values}").values
    assert len(found) == count
    assert not re.search(r"\d", told) or str(found[0]).removesuffix(".0") in told or "lists" in told


def test_the_page_has_every_status_of_the_command() -> None:
    statuses = {int(number) for number in re.findall(r"^\| (\d+) \| ", PAGE, re.MULTILINE)}
    used = ("OK", "STALE", "WRONG_INPUT", "BROKEN_LIMIT", "CANNOT_WRITE", "PARTIAL", "INTERRUPTED")
    assert statuses == {int(ExitStatus[name]) for name in used}
