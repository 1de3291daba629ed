"""Figures of docs/evidence.md on real images, by the commands that print them."""

import json
import re

import pytest
from building import REPOSITORY
from editing import run
from real_files import real_folder

pytestmark = pytest.mark.rest

FOLDER = real_folder()  # conftest.py leaves this module out where there is none
PAGE = " ".join((REPOSITORY / "docs" / "evidence.md").read_text("utf-8").split())


def printed(*words: str) -> str:
    assert FOLDER is not None
    done = run(*(FOLDER / word if "." in word and (FOLDER / word).is_file() else word for word in words))
    assert done.status == 0, done.err
    return done.out


def affine(*words: str) -> tuple[str, str]:
    """The height over that of the file, and by how much the last row moves in nm, as the page writes both."""
    text = printed("correct", *words, "--fit", "--affine")
    height, its, row, rows = map(
        float, re.findall(r"height x ([\d.]+) \+- ([\d.]+), last row (-?[\d.]+) \+- ([\d.]+) nm", text)[0]
    )
    return f"{height:.3f} +- {its:.3f}", f"{row:.2f} +- {rows:.2f}" if rows < 0.2 else f"{row:.1f} +- {rows:.1f}"


def cell(*words: str) -> tuple[float, ...]:
    """Sides and angle with their errors."""
    pattern = r"cell: ([\d.]+) \+- ([\d.]+) x ([\d.]+) \+- ([\d.]+) nm, angle ([\d.]+) \+- ([\d.]+) degrees"
    return tuple(map(float, re.findall(pattern, printed("lattice", *words))[0]))


def test_silicon_has_trace_and_retrace_together() -> None:
    fit = json.loads(printed("correct", "si7x7_50nm.sxm", "--fit", "--lattice-nm", "2.688", "--json"))
    apart = fit["trace_retrace"]["apart_pixels"]
    assert f"from {apart['before']:.1f} pixels to {apart['after']:.2f} pixels" in PAGE


def test_a_protein_crystal_has_its_cell_and_height() -> None:
    a, da, b, db, angle, error = cell("protein_lattice_100nm.asd", "--frames", "0:8")
    assert f"finds {a:.2f} +- " in PAGE
    assert f" x {b:.2f} +- {db:.2f} nm at {angle:.1f} +- {error:.1f} degrees" in PAGE
    assert 0.06 < da < 0.08
    words = ("protein_lattice_100nm.asd", "--lattice", "hexagonal", "--frames")
    height, row = affine(*words, "0:8")
    assert f"{height} times that of the file, and the last row moves by {row} nm. Frames 8 to 15" in PAGE
    height, row = affine(*words, "8:16")
    assert f"give {height} and {row} nm." in PAGE


def test_a_moire_has_its_height() -> None:
    height, row = affine("moire_10nm.sxm", "--lattice", "hexagonal")
    assert f"height becomes {height} times that of the file, and the last row moves by {row} nm of 10 nm" in PAGE


def test_an_instrument_of_the_nineties_has_its_cell_and_height() -> None:
    a, da, b, db, angle, error = cell("old_bruker.002")
    assert f"the cell of {a:.1f} +- {da:.1f} x {b:.1f} +- {db:.1f} nm at {angle:.1f} +- {error:.1f} degrees" in PAGE
    height, _ = affine("old_bruker.002", "--lattice", "hexagonal")
    assert f"after the height is {height} times that of the file" in PAGE
