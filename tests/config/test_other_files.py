"""A scan file where a scanner file belongs, and the other way round: that is said, and not that every key is wrong."""

from pathlib import Path

import pytest
from editing import run

EXAMPLES = ("annexin_200nm.toml", "scanner.toml")


@pytest.fixture
def pair(tmp_path: Path) -> Path:
    """The folder of a scan and its scanner."""
    assert run("init", tmp_path / "demo").status == 0
    return tmp_path / "demo"


@pytest.mark.parametrize("command", ["check", "show", "build"])
def test_a_scanner_file_is_no_scan(pair: Path, command: str) -> None:
    path = pair / "scanner.toml"
    outcome = run(command, path)
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err == (
        f"{path}:1: this is a scanner file; give the scan file that names it, scanner = 'scanner.toml'\n"
    )


def test_a_scan_file_is_no_scanner(pair: Path) -> None:
    path = pair / "annexin_200nm.toml"
    path.write_text(path.read_text("utf-8").replace('"scanner.toml"', '"annexin_200nm.toml"'), "utf-8")
    outcome = run("check", path)
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err == f"{path}:4: scanner: {path} is a scan file, not a scanner file\n"
