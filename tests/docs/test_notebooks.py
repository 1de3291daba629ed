"""The notebooks of examples/notebooks: what is stored is what a new run prints and draws, and what the words say."""

import ast
import base64
import io
import re
import sys
from functools import cache
from typing import Any

import nbformat
import numpy as np
import pytest
from building import REPOSITORY
from nbclient.exceptions import CellExecutionError
from PIL import Image
from sets import one_of

import tablegen

sys.path.insert(0, str(REPOSITORY / "docs"))
import make_notebooks

FOLDER = REPOSITORY / "examples" / "notebooks"
NAMES = ("plan_and_plot", "calibrate", "refine", "correct")
MOST_CELLS, MOST_WORDS, MOST_BYTES = 30, 800, 300_000


stored = cache(make_notebooks.read)


def code(name: str) -> list[str]:
    return [cell.source for cell in stored(name).cells if cell.cell_type == "code"]


def outputs(notebook: Any) -> list[Any]:
    return [output for cell in notebook.cells for output in cell.get("outputs", ())]


@cache
def again(name: str) -> list[Any]:
    """The outputs of a new run."""
    return outputs(make_notebooks.executed(make_notebooks.read(name)))


def texts(found: list[Any]) -> str:
    """All that is printed or shown as text."""
    return "\n".join(one.get("text", "") or one.get("data", {}).get("text/plain", "") for one in found)


def said(name: str) -> str:
    return texts(again(name))


def pictures(found: list[Any]) -> list[np.ndarray]:
    """The figures, (rows, columns, 3)."""
    data = [one.data["image/png"] for one in found if "image/png" in one.get("data", {})]
    return [np.asarray(Image.open(io.BytesIO(base64.b64decode(one))).convert("RGB"), dtype=np.float64) for one in data]


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """The mean difference of two pictures where both are, in shares of black to white."""
    rows, columns = (min(a, b) for a, b in zip(one.shape[:2], other.shape[:2], strict=True))
    return float(np.mean(np.abs(one[:rows, :columns] - other[:rows, :columns]))) / 255.0


DIFFERENT = 0.02
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
DIGEST = re.compile(r"\b[0-9a-f]{16}\b")


def alike(one: str, other: str) -> bool:
    """The same words, and numbers that are about the same: the last digits of a fit are those of a processor."""
    one, other = (DIGEST.sub("DIGEST", text) for text in (one, other))
    values = [np.array([float(number) for number in NUMBER.findall(text)]) for text in (one, other)]
    same = NUMBER.sub("#", one) == NUMBER.sub("#", other)
    return same and bool(np.allclose(*values, rtol=0.02, atol=2e-3))


def numbers(pattern: str, text: str) -> list[float]:
    return [float(one) for one in re.findall(pattern, text)]


def test_every_notebook_is_here() -> None:
    assert {path.stem for path in FOLDER.glob("*.ipynb")} == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_is_whole_and_short(name: str) -> None:
    notebook = stored(name)
    nbformat.validate(notebook)
    counts = [cell.execution_count for cell in notebook.cells if cell.cell_type == "code"]
    assert counts == list(range(1, len(counts) + 1))  # run from the first cell to the last
    assert len(nbformat.writes(notebook)) < MOST_BYTES
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


@pytest.mark.rest
@pytest.mark.parametrize("name", one_of(2, NAMES))
def test_what_is_stored_is_what_a_run_gives(name: str) -> None:
    """Words and numbers, and figures of the same look; without a warning."""
    found, kept = again(name), outputs(stored(name))
    assert [one.text for one in found if one.get("name") == "stderr"] == []
    assert len(found) == len(kept)
    for one, other in zip(found, kept, strict=True):
        assert alike(texts([one]), texts([other])), texts([other])
    drawn = [len(re.findall(r"^(?:fig, ax|show\()", source, re.MULTILINE)) for source in code(name)]
    new, old = pictures(found), pictures(kept)
    assert len(new) == len(old) == sum(drawn) > 0
    for one, other in zip(new, old, strict=True):
        assert one.shape == pytest.approx(other.shape, rel=0.02)  # margins are those of a version of matplotlib
        assert apart(one, other) < DIFFERENT


def test_stale_outputs_would_be_found() -> None:
    """Negative control: a word, a number, a picture of something else."""
    text = texts(outputs(stored("refine")))
    assert alike(text, text)
    assert not alike(text, text.replace("residual", "error", 1))
    assert not alike(text, text.replace("0.682", "0.782", 1))
    assert alike(text, DIGEST.sub("0123456789abcdef", text))
    first, *_ = pictures(outputs(stored("calibrate")))
    (other,) = pictures(outputs(stored("refine")))
    assert apart(first, other) > DIFFERENT


@pytest.mark.common
def test_a_cell_that_raises_is_found() -> None:
    """Negative control."""
    notebook = make_notebooks.read("correct")
    notebook.cells = [nbformat.v4.new_code_cell("import tablegen\ntablegen.correct('absent.gwy', fit=True)")]
    with pytest.raises(CellExecutionError, match=r"absent\.gwy: is not a file"):
        make_notebooks.executed(notebook)


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
    residuals = numbers(r"x: ([\d.]+) % of the line = ", said("refine"))
    assert len(residuals) == 3
    assert residuals[2] < 0.2 * residuals[0]
    assert "build, upload and record again" in said("refine")  # a trace is used once


@pytest.mark.rest
def test_images_are_straight_afterwards() -> None:
    """By the lattice only noise is left between trace and retrace; by the file of another scanner something is."""
    lattice, file = re.findall(r"differ by ([\d.]+) before, ([\d.]+) after", said("correct"))
    assert float(lattice[0]) > 1.0 > float(file[1]) > 2.0 * float(lattice[1])
    taken = numbers(r"as taken: ([\d.]+) %", said("correct"))[0]
    assert numbers(r"by the lattice: \[([\d.]+)", said("correct"))[0] < 0.1 * taken
