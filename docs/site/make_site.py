"""Build the documentation site. Usage: python docs/site/make_site.py [FOLDER], by default build/site

The site has the pages of docs/, the notebooks, and a page for each file of the repository that a page links to: a link
from docs/c.md to ../examples/c/play.c leads to the file where the repository is read, and to a page that shows it here.
The contents are those of docs/index.md: its headings and the pages that they list. Decisions are listed on their own
page alone: a hundred entries more beside every page would hide the others, and take most of the time of a build.
"""

import os
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from sphinx.cmd.build import main as sphinx

sys.path.insert(0, str(Path(__file__).parent))
from notebook import as_markdown

SITE = Path(__file__).resolve().parent
REPOSITORY = SITE.parents[1]
DOCS = REPOSITORY / "docs"
NOTEBOOKS = sorted((REPOSITORY / "examples" / "notebooks").glob("*.ipynb"))
DECISIONS = DOCS / "decisions"
PICTURES = {".png", ".svg"}
LINK = re.compile(r"(?<=\]\()(?![a-z]+:)([^)\s#]+)(?=[)#])")
PAGE = re.compile(r"^(?:- |\| )\[(.*?)\]\((?![a-z]+:)([^)\s#]+\.md)\)", re.MULTILINE)
SECTION = re.MULTILINE | re.DOTALL
ORPHAN = "---\norphan: true\n---\n"
LANGUAGES = {".h": "c", ".vh": "verilog", ".v": "verilog", ".c": "c", ".py": "python", ".toml": "toml", ".md": "text"}


def assemble(folder: Path) -> None:
    """Write what Sphinx reads: pages and pictures, with links to each other."""
    waiting = sorted(path for path in DOCS.rglob("*") if path.suffix in {".md", *PICTURES} and SITE not in path.parents)
    waiting += NOTEBOOKS
    listed = {path for path in waiting if path.parent != DECISIONS or path.name == "README.md"}
    seen = set(waiting)
    while waiting:
        target = waiting.pop()
        written = folder / place(target)
        written.parent.mkdir(parents=True, exist_ok=True)
        if target.suffix in PICTURES:
            shutil.copyfile(target, written)
            continue
        text = shown(target)
        if target == DOCS / "index.md":
            text += contents(text)
        elif target.name == "README.md" and DOCS in target.parents and target.parent != DECISIONS:
            text += contents_of_folder(text)
        written.write_text(("" if target in listed else ORPHAN) + relinked(target, text), "utf-8")
        new = {one for one in targets(target, text) if one not in seen and one.exists()}
        seen |= new
        waiting += sorted(new)


def relinked(source: Path, text: str) -> str:
    """A page with its links as the site has them."""

    def changed(match: re.Match[str]) -> str:
        target = normal(source, match[1])
        return os.path.relpath(place(target), os.path.dirname(place(source)) or ".") if target.exists() else match[1]

    return LINK.sub(changed, text)


def place(target: Path) -> str:
    """Where the site has a file or a folder of the repository."""
    if target.is_relative_to(DOCS) and target.suffix in {".md", *PICTURES}:
        return target.relative_to(DOCS).as_posix()
    if target.suffix == ".ipynb":
        return f"notebooks/{target.stem}.md"
    name = target.relative_to(REPOSITORY).as_posix()
    if target.is_dir():
        return f"repository/{name}/README.md"
    return f"repository/{name}" if target.suffix in {".md", *PICTURES} else f"repository/{name}.md"


def normal(source: Path, link: str) -> Path:
    """What a link of a page leads to; a folder's README.md is the folder."""
    path = Path(os.path.normpath((source if source.is_dir() else source.parent) / link))
    return path.parent if path.name == "README.md" and DOCS not in path.parents else path


def targets(source: Path, text: str) -> Iterator[Path]:
    """What a page links to; code links to nothing."""
    if source.is_dir() or source.suffix == ".md":
        for link in LINK.findall(text):
            yield normal(source, link)


def shown(target: Path) -> str:
    """A file or a folder as a page."""
    if target.suffix == ".ipynb":
        return as_markdown(target)
    if target.is_dir():
        readme = target / "README.md"
        return readme.read_text("utf-8") if readme.exists() else listing(target)
    text = target.read_text("utf-8")
    if target.suffix == ".md":
        return text
    longest = max((len(run) for run in re.findall(r"`+", text)), default=0)
    fence = "`" * max(3, longest + 1)
    name = target.relative_to(REPOSITORY).as_posix()
    return f"# {name}\n\nA file of the repository.\n\n{fence}{LANGUAGES.get(target.suffix, 'text')}\n{text}{fence}\n"


def listing(folder: Path) -> str:
    """The files of a folder."""
    names = sorted(path.name for path in folder.iterdir() if path.name not in {"__pycache__", "__init__.py", "build"})
    rows = "".join(f"- [{name}]({name})\n" for name in names if not name.startswith("."))
    return f"# {folder.relative_to(REPOSITORY).as_posix()}\n\nA folder of the repository.\n\n{rows}"


def contents(index: str) -> str:
    """The table of contents: a caption for each heading of the index, with the pages that it lists."""
    sections = {title: PAGE.findall(rest) for title, rest in re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", index, SECTION)}
    if NOTEBOOKS:
        sections["Notebooks"] = [(notebook.stem.replace("_", " "), place(notebook)) for notebook in NOTEBOOKS]
    return "".join(toctree(pages, f":caption: {title}\n") for title, pages in sections.items())


def contents_of_folder(readme: str) -> str:
    """The pages of a folder, under the one that lists them."""
    pages = [(title, page) for title, page in PAGE.findall(readme) if "/" not in page]
    return toctree(pages) if pages else ""


def toctree(pages: list[tuple[str, str]], caption: str = "") -> str:
    """For Sphinx."""
    rows = "".join(f"{title} <{page}>\n" for title, page in pages)
    return f"\n```{{toctree}}\n:hidden:\n{caption}\n{rows}```\n"


def main(site: Path) -> int:
    """Build into a folder; every warning is an error."""
    with TemporaryDirectory() as source:
        assemble(Path(source))
        options = ["-q", "-E", "-W", "--keep-going", "-b", "html", "-c", str(SITE), "-d", f"{source}/.doctrees"]
        return sphinx([*options, source, str(site)])


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else REPOSITORY / "build" / "site"))
