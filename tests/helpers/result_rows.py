"""The rows of benchmarks/results.md."""

from pathlib import Path

from building import REPOSITORY

BENCHMARKS = REPOSITORY / "benchmarks"
PAGE = BENCHMARKS / "results.md"


def tables(name: str, page: Path = PAGE) -> list[dict[str, str]]:
    """The rows of a section of the page of results, by the head of its table."""
    text = page.read_text("utf-8").partition(f"<!-- {name} -->\n")[2].partition(f"<!-- /{name} -->\n")[0]
    lines = [[cell.strip() for cell in line[1:-1].split("|")] for line in text.splitlines() if line.startswith("|")]
    head, _, *rows = lines
    return [dict(zip(head, row, strict=True)) for row in rows]
