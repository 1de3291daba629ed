"""docs/troubleshooting.md: its messages are those of the program, and so are its statuses."""

import ast
import re
from typing import get_args

import pytest
from building import REPOSITORY
from click.testing import CliRunner

from tablegen.base.remedies import IN_TEXT, REMEDIES, FindingCode
from tablegen.cli import cli
from tablegen.cli.shared.exit_status import ExitStatus

PAGE = (REPOSITORY / "docs" / "troubleshooting.md").read_text("utf-8")
SOURCES = {path: path.read_text("utf-8") for path in sorted((REPOSITORY / "tablegen").rglob("*.py"))}
TOLD = re.findall(r"^\| `([^`]+)`(?: and `[^`]+` refused| in a row of the table)? \|", PAGE, re.MULTILINE)


def joined(text: str) -> str:
    """A source with literals that go on in the next line put together."""
    return re.sub(r"[\"']\s*\n\s*f?[\"']", "", text)


ALL = "\n".join(map(joined, SOURCES.values()))


@pytest.mark.parametrize("message", TOLD)
def test_the_program_says_it(message: str) -> None:
    assert message in ALL


def test_a_message_that_nothing_says_is_found() -> None:
    assert len(TOLD) == len(re.findall(r"^\| `", PAGE, re.MULTILINE)) > 40
    assert "the flux capacitor is empty" not in ALL


def test_the_statuses_are_those_of_the_program() -> None:
    table = PAGE[PAGE.index("## Exit statuses") : PAGE.index("## The image")]
    found: set[int] = set()
    for low, high in re.findall(r"^\| (\d+)(?: to (\d+))? \|", table, re.MULTILINE):
        found |= set(range(int(low), int(high or low) + 1))
    assert found == {int(status) for status in ExitStatus}
    told = CliRunner().invoke(cli, ["--help"]).output
    rows = dict(re.findall(r"^\| (\d+) \| (.*?)(?:;.*)? \|$", table, re.MULTILINE))
    helped = dict(re.findall(r"^ +(\d+) (.*)$", told, re.MULTILINE))
    for status in ("0", "2", "3", "4", "6", "130"):
        assert rows[status].replace("the ", "") == helped[status].replace("the ", "")


def test_the_codes_of_findings_are_those_of_the_program() -> None:
    """Every code of the type is in the table of the page, in order, and somewhere in the program a finding has it."""
    table = PAGE[PAGE.index("### Codes of findings") : PAGE.index("## Messages of calibrate")]
    codes = [code for code in get_args(FindingCode) if code]
    assert re.findall(r"^\| `([a-z-]+)` \|", table, re.MULTILINE) == sorted(codes) == codes
    users = "\n".join(text for path, text in SOURCES.items() if path.name != "remedies.py")
    assert [code for code in codes if f'"{code}"' not in users] == []


def test_the_remedies_of_the_page_are_those_of_the_program() -> None:
    """Each code has a remedy, and the table has the same, at most with a link to its page."""
    table = PAGE[PAGE.index("### Codes of findings") : PAGE.index("## Messages of calibrate")]
    rows = dict(re.findall(r"^\| `([a-z-]+)` \| .* \| ([^|]+) \|$", table, re.MULTILINE))
    plain = {
        code: re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", re.sub(r": \[[^]]*\]\([^)]*\)$", "", rows[code])) for code in rows
    }
    assert plain == {code: remedy or "none is needed" for code, remedy in REMEDIES.items()}
    assert set(REMEDIES) == set(get_args(FindingCode)) - {""}
    assert [code for code, remedy in REMEDIES.items() if not remedy] == ["imaged-pixels", "standard-errors"]


def test_no_other_module_states_a_remedy() -> None:
    """A remedy that is appended stands in the list alone, not in a text of the program as well."""
    sources = {path: joined(text) for path, text in SOURCES.items() if path.name != "remedies.py"}
    appended = [one for code, one in REMEDIES.items() if code not in IN_TEXT and len(one.split()) > 2]
    copies = [
        (path.name, one)
        for one in appended
        for path, text in sources.items()
        if re.search(re.escape(one) + r"['\"]", text)
    ]
    assert len(appended) > 20
    assert copies == []


def test_every_remark_of_a_measurement_has_a_code() -> None:
    """A call that makes a remark gives its code: the last argument, or by name."""
    makers = {"Remark": 4, "spoils": 3}  # positions of all their arguments
    without = [
        f"{path.name}:{node.lineno}"
        for path, text in SOURCES.items()
        if path.name != "warnings.py" and any(f"{maker}(" in text for maker in makers)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in makers
        if len(node.args) < makers[node.func.id] and all(key.arg != "code" for key in node.keywords)
    ]
    assert without == []
