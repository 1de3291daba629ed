"""The notebooks of examples/notebooks: run from their first cell to their last; stored without outputs; what they say.

The documentation site runs them too, so that outputs which could be out of date stand nowhere.
"""

import ast
import base64
import re
from functools import cache
from typing import Any

import nbformat
import pytest
from building import REPOSITORY
from limits import PATIENCE_S
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

import tablegen

FOLDER = REPOSITORY / "examples" / "notebooks"
NAMES = ("plan_and_plot", "calibrate", "refine", "correct")
MOST_CELLS, MOST_WORDS = 30, 800


def stored(name: str) -> Any:
    return nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)


def code(name: str) -> list[str]:
    return [cell.source for cell in stored(name).cells if cell.cell_type == "code"]


def run(notebook: Any) -> Any:
    """The notebook with its outputs; a cell that raises is an error, as is one that hangs."""
    NotebookClient(notebook, timeout=PATIENCE_S, resources={"metadata": {"path": str(FOLDER)}}).execute()
    return notebook


@cache
def outputs(name: str) -> list[Any]:
    return [output for cell in run(stored(name)).cells for output in cell.get("outputs", ())]


@cache
def said(name: str) -> str:
    """All texts that the cells of a notebook print or show."""
    return "\n".join(one.get("text", "") or one.get("data", {}).get("text/plain", "") for one in outputs(name))


def numbers(pattern: str, text: str) -> list[float]:
    return [float(one) for one in re.findall(pattern, text)]


def test_every_notebook_is_here() -> None:
    assert {path.stem for path in FOLDER.glob("*.ipynb")} == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_is_stored_without_outputs_and_is_short(name: str) -> None:
    notebook = stored(name)
    nbformat.validate(notebook)
    assert all(cell.outputs == [] and cell.execution_count is None for cell in notebook.cells if "outputs" in cell)
    words = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    assert notebook.cells[0].source.startswith("# ")
    assert len(notebook.cells) <= MOST_CELLS
    assert len(words.split()) <= MOST_WORDS
    assert max(map(len, words.splitlines())) <= 120
    links = re.findall(r"\]\(([^)#:]+)\)", words)
    assert all((FOLDER / link).exists() for link in links)


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_takes_the_public_interface_alone(name: str) -> None:
    used = set()
    for source in code(name):
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "tablegen":
                used.add(node.attr)
            if isinstance(node, ast.ImportFrom):
                assert not (node.module or "").startswith("tablegen")
    assert used
    assert used <= set(tablegen.__all__)


@pytest.mark.common
@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_runs(name: str) -> None:
    """Without a warning; every figure is a picture."""
    found = outputs(name)
    assert [one.text for one in found if one.get("name") == "stderr"] == []
    figures = [one.data["image/png"] for one in found if "image/png" in one.get("data", {})]
    drawn = [len(re.findall(r"^(?:fig, ax|show\()", source, re.MULTILINE)) for source in code(name)]
    assert len(figures) == sum(drawn) > 0
    assert all(base64.b64decode(one).startswith(b"\x89PNG") for one in figures)


@pytest.mark.common
def test_a_cell_that_raises_is_found() -> None:
    """Negative control."""
    notebook = stored("correct")
    notebook.cells = [nbformat.v4.new_code_cell("import tablegen\ntablegen.correct('absent.gwy', fit=True)")]
    with pytest.raises(CellExecutionError, match=r"absent\.gwy: is not a file"):
        run(notebook)


@pytest.mark.common
def test_the_plan_is_as_the_words_say() -> None:
    without, corrected = (numbers(rf"([\d.]+) % {word}", said("plan_and_plot")) for word in ("without", "with corr"))
    assert 15.0 < max(without) <= 16.0  # "up to 16 %"
    assert max(corrected) < 0.5
    assert numbers(r": ([\d.]+) times", said("plan_and_plot"))[0] < 2.0  # "the drive does not double"
    assert "x.size_nm: 2000 nm needs" in said("plan_and_plot")


@pytest.mark.common
def test_the_calibration_helps_and_says_where_it_is_from() -> None:
    before, *_, after = re.findall(
        r"forward ([\d.]+) % rms, backward ([\d.]+) % rms, size ([+-][\d.]+) %", said("calibrate")
    )
    assert all(abs(float(now)) < 0.5 * abs(float(then)) for then, now in zip(before, after, strict=True))
    assert "# standard errors: k_nm_per_v" in said("calibrate")


@pytest.mark.common
def test_three_rounds_take_the_error_away() -> None:
    residuals = numbers(r"residual ([\d.]+) % rms, [\d.]+ % predicted", said("refine"))
    assert len(residuals) == 3
    assert residuals[2] < 0.2 * residuals[0]
    assert "build, upload and record again" in said("refine")  # a trace is used once


@pytest.mark.common
def test_images_are_straight_afterwards() -> None:
    """By the lattice only noise is left between trace and retrace; by the file of another scanner something is."""
    lattice, file = re.findall(r"differ by ([\d.]+) before, ([\d.]+) after", said("correct"))
    assert float(lattice[0]) > 1.0 > float(file[1]) > 2.0 * float(lattice[1])
    taken = numbers(r"as taken: ([\d.]+) %", said("correct"))[0]
    assert numbers(r"by the lattice: \[([\d.]+)", said("correct"))[0] < 0.1 * taken
