"""A notebook as a page: its text, its code, and what it printed and drew when it was saved."""

import json
from pathlib import Path
from typing import Any


def as_markdown(path: Path) -> str:
    """The whole notebook."""
    cells = json.loads(path.read_text("utf-8"))["cells"]
    return "\n\n".join(part for cell in cells for part in _cell(cell)) + "\n"


def _cell(cell: dict[str, Any]) -> list[str]:
    text = "".join(cell["source"]).strip()
    if cell["cell_type"] == "markdown":
        return [text]
    if cell["cell_type"] != "code" or not text:
        return []
    return [f"```python\n{text}\n```", *(_output(one) for one in cell.get("outputs", []))]


def _output(output: dict[str, Any]) -> str:
    if output["output_type"] == "stream":
        return _plain(output["text"])
    data = output.get("data", {})
    if "image/png" in data:
        return f'<img alt="What the cell draws" src="data:image/png;base64,{"".join(data["image/png"]).strip()}">'
    if "image/svg+xml" in data:
        return "".join(data["image/svg+xml"])
    return _plain(data.get("text/plain", ""))


def _plain(text: str | list[str]) -> str:
    shown = "".join(text).rstrip()
    return f"```text\n{shown}\n```" if shown else ""
