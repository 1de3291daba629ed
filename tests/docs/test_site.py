"""The documentation site: built without a warning, whole, searched and read without a request to anybody."""

import json
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest
from browser import loaded, seen
from building import REPOSITORY
from limits import PATIENCE_S

pytestmark = pytest.mark.rest


def built(folder: Path, repository: Path = REPOSITORY) -> subprocess.CompletedProcess[str]:
    """Make the site of a repository; Sphinx may ask nobody."""
    return subprocess.run(
        [sys.executable, repository / "docs" / "site" / "make_site.py", folder],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        env={**os.environ, "https_proxy": "http://127.0.0.1:9", "http_proxy": "http://127.0.0.1:9"},
        check=False,
    )


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    done = built(folder)
    assert (done.returncode, done.stderr) == (0, "")
    return folder


class Links(HTMLParser):
    """Where a page leads, what it loads, and its anchors."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.leads: list[str] = []
        self.loads: list[str] = []
        self.anchors: set[str] = set()
        self.feed(page.read_text("utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.anchors |= {values[name] or "" for name in ("id", "name") if name in values}
        if tag == "a" and values.get("href"):
            self.leads.append(values["href"] or "")
        elif tag == "link" and values.get("rel") in {"stylesheet", "icon", "preconnect", "preload"}:
            self.loads.append(values["href"] or "")
        elif values.get("src"):
            self.loads.append(values["src"] or "")


def broken(site: Path) -> list[str]:
    """Links that lead nowhere, and what is loaded from elsewhere."""
    pages = {page: Links(page) for page in sorted(site.rglob("*.html"))}
    found = []
    for page, links in pages.items():
        for address in [*links.leads, *links.loads]:
            outside = re.match(r"[a-z]+:|//", address)
            if outside:
                if address in links.loads and not address.startswith("data:"):
                    found.append(f"{page.relative_to(site)} loads {address}")
                continue
            name, _, anchor = unquote(address).partition("#")
            target = (page.parent / name.partition("?")[0]).resolve() if name else page
            known = pages.get(target)
            if not target.exists() or (anchor and known is not None and anchor not in known.anchors):
                found.append(f"{page.relative_to(site)}: {address}")
    return found


def test_all_links_and_anchors_lead_somewhere(site: Path) -> None:
    assert broken(site) == []


def test_every_page_of_the_docs_is_there(site: Path) -> None:
    pages = [path.relative_to(REPOSITORY / "docs") for path in (REPOSITORY / "docs").rglob("*.md")]
    assert len(pages) > 35
    assert [page for page in pages if not (site / page.with_suffix(".html")).exists()] == []
    contents = Links(site / "index.html").leads
    assert {"tutorial.html", "start/microscopist.html", "glossary.html"} <= set(contents)


def test_files_that_pages_link_to_are_shown(site: Path) -> None:
    page = (site / "repository" / "examples" / "verilog" / "scanner.v.html").read_text("utf-8")
    assert "CLOCKS_PER_TICK" in page
    assert "repository/examples/verilog/scanner.v.html" in (site / "verilog.html").read_text("utf-8")


@pytest.mark.parametrize("name", ["index.html", "tutorial.html", "waveform.html"])
def test_a_page_makes_no_request_outside(site: Path, tmp_path: Path, name: str) -> None:
    found = seen(site / name, tmp_path)
    assert found.console == []
    assert [address for address in found.requests if not address.startswith("file:")] == []


@pytest.mark.parametrize(("word", "there"), [("flyback", True), ("qwertzuiop", False)])
def test_the_search_finds_a_word_without_a_network(site: Path, tmp_path: Path, word: str, there: bool) -> None:
    done = loaded(tmp_path, (site / "search.html").as_uri() + f"?q={word}", "--dump-dom")
    (results,) = re.findall(r'<div id="search-results">(.*?)</div>', done.stdout, re.DOTALL)
    assert ("glossary.html" in results) == there


def test_a_notebook_becomes_a_page(tmp_path: Path) -> None:
    """Its text, its code, and what was stored of its outputs."""
    sys.path.insert(0, str(REPOSITORY / "docs" / "site"))
    try:
        from notebook import as_markdown
    finally:
        sys.path.pop(0)
    outputs = [
        {"output_type": "stream", "name": "stdout", "text": ["4\n"]},
        {"output_type": "display_data", "data": {"image/png": "iVBORw0KGgo=\n", "text/plain": ["<Figure>"]}},
        {"output_type": "execute_result", "data": {"text/plain": ["5"]}},
    ]
    cells = [
        {"cell_type": "markdown", "source": ["# Title\n", "Text."]},
        {"cell_type": "code", "source": ["print(2 + 2)"], "outputs": outputs},
        {"cell_type": "code", "source": [], "outputs": []},
    ]
    path = tmp_path / "a.ipynb"
    path.write_text(json.dumps({"cells": cells}), "utf-8")
    shown = as_markdown(path)
    assert shown.startswith("# Title\nText.\n\n```python\nprint(2 + 2)\n```\n\n```text\n4\n```\n\n<img alt=")
    assert "data:image/png;base64,iVBORw0KGgo=" in shown
    assert shown.endswith("```text\n5\n```\n")


# Negative controls


def test_a_broken_link_is_found(site: Path, tmp_path: Path) -> None:
    copy = tmp_path / "site"
    shutil.copytree(site, copy)
    page = copy / "glossary.html"
    wrong = '<a href="gone.html">a</a><a href="index.html#gone">b</a><script src="https://example.org/a.js"></script></body>'
    page.write_text(page.read_text("utf-8").replace("</body>", wrong), "utf-8")
    assert broken(copy) == [
        "glossary.html: gone.html",
        "glossary.html: index.html#gone",
        "glossary.html loads https://example.org/a.js",
    ]


def test_a_warning_is_an_error(tmp_path: Path) -> None:
    """A link to no heading, and a page that is in no contents."""
    ignored = shutil.ignore_patterns(".git", ".venv*", "build", "hdl_tests", "tests", "benchmarks", "*.png", "releases")
    shutil.copytree(REPOSITORY, tmp_path / "copy", ignore=ignored)
    docs = tmp_path / "copy" / "docs"
    for page in docs.rglob("*.md"):
        if page.name not in {"index.md", "glossary.md"}:
            page.unlink()
    index = "# tablegen\n\n## Start\n\n- [Glossary](glossary.md)\n- [Waveform](glossary.md#gone)\n"
    (docs / "index.md").write_text(index, "utf-8")
    (docs / "glossary.md").write_text("# Glossary\n", "utf-8")
    (docs / "lonely.md").write_text("# Lonely\n", "utf-8")
    done = built(tmp_path / "site", tmp_path / "copy")
    assert done.returncode != 0
    assert "gone" in done.stderr
    assert "lonely.md: WARNING: document isn't included in any toctree" in done.stderr
