"""Run the notebooks of examples/notebooks and store what their cells print and draw.

Usage: python docs/make_notebooks.py [NAME...], by default all of them
"""

import re
import sys
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

FOLDER = Path(__file__).resolve().parents[1] / "examples" / "notebooks"
_TIMEOUT_S = 1200
_STEERING = re.compile("\x1b\\[[0-9;]*m")


def read(name: str) -> Any:
    """A notebook as it is stored."""
    return nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)


def executed(notebook: Any) -> Any:
    """The notebook with the outputs of a new run, and without its times. Raises where a cell does."""
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    folder = {"metadata": {"path": str(FOLDER)}}
    # What a cell prints comes in pieces, whose number is the machine's affair.
    NotebookClient(notebook, timeout=_TIMEOUT_S, coalesce_streams=True, resources=folder).execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", ()):
            if "text" in output:
                output.text = _STEERING.sub("", output.text)
    notebook.metadata.language_info = {"name": "python"}  # without the version that it was run with
    return notebook


def main(names: list[str]) -> None:
    """Run and store them."""
    for name in names or sorted(path.stem for path in FOLDER.glob("*.ipynb")):
        notebook = executed(read(name))
        (FOLDER / f"{name}.ipynb").write_text(nbformat.writes(notebook, indent=1) + "\n", "utf-8")
        print(f"{name}: {(FOLDER / f'{name}.ipynb').stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
