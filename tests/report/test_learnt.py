"""`tablegen refine ... --report`: the page of a round against what the command prints."""

import json
from pathlib import Path

import numpy as np
import pytest
from editing import run, write_pair
from html_page import Page, well_formed
from refining import play, scan_text, scanner, sensed

from tablegen.config.load import load


def record(folder: Path, name: str, seed: int) -> Path:
    """A trace of the scan in the folder as it stands."""
    virtual = scanner().x
    columns = sensed(play(load(folder / "scan.toml"), "x", virtual).line, virtual, seed, samples=1000, periods=6.3)
    path = folder / name
    rows = np.stack([*columns.values()], axis=1)
    np.savetxt(path, rows, fmt="%.9g", delimiter=",", header=",".join(columns), comments="")
    return path


@pytest.mark.common
def test_rounds_have_pages(tmp_path: Path) -> None:
    scan = write_pair(tmp_path, scan_text("- x.size_nm", "x.size_v = 60.0"))
    names = ("<script>first.csv", "second.csv")
    for seed, name in enumerate(names):
        trace = record(tmp_path, name, seed)
        options = ("--axis", "x", "--json", "--report", tmp_path / "round.html", "--write")
        outcome = run("refine", scan, trace, *options)
        assert outcome.status == 0, outcome.err
        content = (tmp_path / "round.html").read_bytes()
        read, told = Page(content.decode("utf-8")), json.loads(outcome.out)
        well_formed(content, read)
        assert read.verdicts == ["good"]
        for label in ("measured", "predicted"):
            for side in ("forward", "backward"):
                errors = told[label][side]
                figures = " ".join(f"{errors[key]:.3g}" for key in errors)
                assert f"{side}, {label} {figures}" in read.said
        assert f"From {name}, sha256 {told['source']['sha256']}" in read.said
        assert ("rounds" in read.ids) == (seed == 1)
    assert f"1 {names[0]}, sha256" in read.said
    outcome = run("refine", scan, trace, "--axis", "x", "--report", tmp_path / "round.html")
    assert outcome.status == 2
    read = Page((tmp_path / "round.html").read_text("utf-8"))
    assert read.verdicts == ["bad"]
    assert "was already refined by this trace" in read.said
