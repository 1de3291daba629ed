"""The Markdown files: lines of at most 120 characters, and links to files and headings that exist."""

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from building import REPOSITORY

LONGEST = 120
FOLDERS = ("benchmarks", "docs", "examples", "firmware_templates", "hdl_tests", "tests")
LINK = re.compile(r"\[[^\]]+\]\(([^)\s]+)\)")


def pages() -> list[Path]:
    """Every tracked Markdown file; in an unpacked sdist, every Markdown file that it has."""
    if not (REPOSITORY / ".git").exists():
        places = (REPOSITORY.glob("*.md"), *(REPOSITORY.glob(f"{name}/**/*.md") for name in FOLDERS))
        return sorted(page for place in places for page in place)
    listed = subprocess.run(
        ["git", "ls-files", "-z", "*.md"], cwd=REPOSITORY, capture_output=True, check=True, encoding="utf-8"
    )
    return [REPOSITORY / name for name in sorted(listed.stdout.split("\0")) if name]


def prose(text: str) -> Iterator[tuple[int, str]]:
    """Number and text of each line outside tables, fenced code, and indented code after a blank line."""
    fenced, indented, before = False, False, ""
    for number, line in enumerate(text.splitlines(), 1):
        fence = line.lstrip().startswith("```")
        indented = line.startswith("    ") and (indented or not before.strip())
        if not (fence or fenced or indented or line.startswith("|")):
            yield number, line
        fenced ^= fence
        before = line


def too_long(text: str) -> list[int]:
    """The numbers of the lines of prose that have more than 120 characters."""
    return [number for number, line in prose(text) if len(line) > LONGEST]


def headings(text: str) -> set[str]:
    """The anchors of the headings, in the way of GitHub."""
    titles = [line.lstrip("#").strip() for _, line in prose(text) if re.match(r"#+ ", line)]
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


def without_code(text: str) -> str:
    """The text without fenced code and code spans, in which brackets are no links."""
    return re.sub(r"`[^`\n]+`", "", re.sub(r"^ *```.*?^ *```", "", text, flags=re.DOTALL | re.MULTILINE))


def broken_links(text: str, folder: Path, own: Path) -> list[str]:
    """The relative links that lead to no file, or to no heading of a Markdown file."""
    broken = []
    for link in LINK.findall(without_code(text)):
        if re.match(r"[a-z]+:", link):
            continue
        name, _, anchor = link.partition("#")
        path = folder / name if name else own
        target = text if path == own else path.read_text("utf-8") if path.suffix == ".md" and path.exists() else ""
        if not path.exists() or (anchor and anchor not in headings(target)):
            broken.append(link)
    return broken


def names(page: Path) -> str:
    return str(page.relative_to(REPOSITORY))


@pytest.mark.parametrize("page", pages(), ids=names)
def test_lines_are_short(page: Path) -> None:
    assert too_long(page.read_text("utf-8")) == []


@pytest.mark.parametrize("page", pages(), ids=names)
def test_links_lead_somewhere(page: Path) -> None:
    assert broken_links(page.read_text("utf-8"), page.parent, page) == []


def test_all_pages_are_found() -> None:
    found = {names(page) for page in pages()}
    assert {"README.md", "docs/c.md", "docs/paper/README.md", "examples/firmware/stm32/README.md"} <= found


# Negative controls


@pytest.mark.parametrize("before", ["", "```\ncode\n```\n", "| a |\n|---|\n", "- item\n", "text\n    ", "    code\n"])
def test_a_long_line_is_found(before: str) -> None:
    text = before + "x" * (LONGEST + 1)
    assert too_long(text) == [text.count("\n") + 1]


def test_a_line_of_120_characters_is_not_long() -> None:
    assert too_long("x" * LONGEST + "\n") == []


@pytest.mark.parametrize("text", ["| {} |", "```sh\n{}\n```", "text\n\n    {}", "- item\n\n      {}", "    a\n    {}"])
def test_tables_and_code_may_be_longer(text: str) -> None:
    assert too_long(text.format("x" * LONGEST)) == []


@pytest.mark.parametrize("link", ["gone.md", "../c.md", "c.md#gone", "#gone", "c.md#Quick-start", "folder"])
def test_a_broken_link_is_found(tmp_path: Path, link: str) -> None:
    (tmp_path / "c.md").write_text("# C\n\n## Quick start\n\n```sh\n# gone\n```\n", "utf-8")
    own = tmp_path / "own.md"
    own.write_text(f"# Own page, with `code`\n\nSee [it]({link}).\n", "utf-8")
    assert broken_links(own.read_text("utf-8"), tmp_path, own) == [link]


@pytest.mark.parametrize(
    "link", ["c.md", "c.md#quick-start", "#own-page-with-code", "https://example.org/gone.md", "."]
)
def test_a_good_link_is_accepted(tmp_path: Path, link: str) -> None:
    (tmp_path / "c.md").write_text("# C\n\n## Quick start\n", "utf-8")
    own = tmp_path / "own.md"
    own.write_text(f"# Own page, with `code`\n\n![See it]({link}) or `[no link](gone.md)`.\n", "utf-8")
    assert broken_links(own.read_text("utf-8"), tmp_path, own) == []
