"""Every public function: its docstring has all sections, its example runs, and its help fits a screen."""

import doctest
import inspect
import pydoc
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from building import EXAMPLE

import tablegen

FUNCTIONS = [name for name in tablegen.__all__ if inspect.isfunction(getattr(tablegen, name))]
SCREEN = 60  # lines
SLOW = ("calibrate_operator", "predict")


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scan, its scanner, two images of a lattice, and two of a rough sample that drifts."""
    folder = tmp_path_factory.mktemp("samples")
    shutil.copy(EXAMPLE, folder / "scan.toml")
    shutil.copy(EXAMPLE.parent / "scanner.toml", folder)
    laboratory = tablegen.Laboratory(like=folder / "scanner.toml", seed=1)
    image = laboratory.image(laboratory.lattice(17.7), size_v=20.0, offset_v=50.0, rate_hz=2.0, pixels=96)
    np.save(folder / "trace.npy", image.trace.heights)
    np.save(folder / "retrace.npy", image.retrace.heights)
    rough = np.cumsum(np.random.default_rng(15).standard_normal((40, 64)), axis=1)
    np.save(folder / "first.npy", rough[:, :60])
    np.save(folder / "second.npy", rough[:, 3:63])
    return folder


def broken_example(text: str, names: dict[str, object]) -> str:
    """What an example prints that it does not show; empty where it runs as written."""
    test = doctest.DocTestParser().get_doctest(text, names, "example", None, None)
    assert test.examples
    lines: list[str] = []
    doctest.DocTestRunner(verbose=False, optionflags=doctest.ELLIPSIS).run(test, out=lines.append)
    return "".join(lines)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.common] * (name in SLOW)) for name in FUNCTIONS]
)
def test_the_example_runs(name: str, samples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(samples, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    assert broken_example(inspect.getdoc(getattr(tablegen, name)) or "", {"tablegen": tablegen}) == ""


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_docstring_has_every_section_and_fits_a_screen(name: str) -> None:
    function = getattr(tablegen, name)
    text = inspect.getdoc(function) or ""
    sections = re.findall(r"^(\w+)\n-+$", text, re.MULTILINE)
    assert [section.replace("Yields", "Returns") for section in sections] == [
        "Parameters",
        "Returns",
        "Raises",
        "Examples",
    ]
    for parameter in inspect.signature(function).parameters:
        assert re.search(rf"^(?:\w+, )*\**{parameter}\b.*$", text, re.MULTILINE), parameter
    assert len(pydoc.plain(pydoc.render_doc(function)).splitlines()) <= SCREEN


def test_an_example_that_prints_something_else_is_found() -> None:
    assert "Got" in broken_example(">>> 1 + 1\n3\n", {})
