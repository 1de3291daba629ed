"""`tablegen calibrate ... --report`: the page of a fit against what the command prints, outliers, hostile names."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibrating import AMPLITUDES, DRIVES, RESPONSE, Scanner, actual
from editing import run
from foreign_plants import SIX, ForeignPlant, ManyPlays, record
from html_page import Page, well_formed

from tablegen.fitting.estimate import Curve
from tablegen.html_report.fitted import drawn_curves

NOISE = 1.0 + 0.002 * np.random.default_rng(11).standard_normal(100)


def write_csv(path: Path, **columns: Any) -> Path:
    rows = zip(*([repr(float(v)) for v in values] for values in columns.values()), strict=True)
    path.write_text("\n".join([",".join(columns), *map(",".join, rows)]) + "\n", "utf-8")
    return path


def fitted(folder: Path, kind: str, *arguments: str | Path) -> tuple[Page, dict[str, Any]]:
    """The page of a calibration, and what it prints for programs."""
    out = folder / "fit.html"
    outcome = run("calibrate", kind, *arguments, "--axis", "x", "--v-max", "100", "--report", out, "--json")
    assert outcome.status == 0, outcome.err
    content = out.read_bytes()
    read = Page(content.decode("utf-8"))
    well_formed(content, read)
    assert str(folder) not in content.decode("utf-8")
    return read, json.loads(outcome.out)


def test_an_outlier_comes_first_and_names_are_text(tmp_path: Path) -> None:
    sizes = actual(DRIVES, 11.0, 0.6, 0.5, 200.0) * NOISE[:11]
    sizes[4] *= 1.2
    name = "<script>alert(1)<&script>.csv"
    read, told = fitted(tmp_path, "size", write_csv(tmp_path / name, drive_v=DRIVES, actual_nm=sizes))
    assert told["outliers"] == [4]
    assert read.verdicts == ["warn"]
    assert f"! outlier {name}:6: far from the other points" in read.said
    for key in ("k_nm_per_v", "beta"):
        one = told["parameters"][key]
        assert f"{key} {one['value']:.6g} ± {one['standard_error']:.2g}" in read.said
    assert told["sources"][0]["sha256"] in read.said


def test_traces_of_hysteresis(tmp_path: Path) -> None:
    scanner = Scanner(forward=(0.04, 3.0, 0.4), backward=(0.07, 1.2, 0.46))
    noise = np.random.default_rng(12).standard_normal((3, 2, 800)) * 0.002
    paths = []
    for v, one in zip(AMPLITUDES, noise, strict=True):
        trace = scanner.trace(v, 3.3, 800, one)
        columns = {"time_s": trace.time_s, "drive_v": trace.drive_v, "displacement_nm": trace.displacement_nm}
        paths.append(write_csv(tmp_path / f"{v:g}.csv", **columns))
    read, told = fitted(tmp_path, "hysteresis", *paths)
    assert read.verdicts == ["good"]
    (branch,) = told["branches"]
    one = branch["backward"]["beta_max"]
    assert f"backward.beta_max {one['value']:.6g} ± {one['standard_error']:.2g}" in read.said
    for trace in branch["traces"]:
        quality = f"{trace['v_scan']:.4g} {trace['noise_percent']:.2g} {trace['drift_percent']:.2g}"
        assert read.said.count(f" {quality} ") == 2  # forward and backward
    assert len([name for name in read.ids if name.startswith("chart-fit-")]) >= 3


def test_what_means_nothing_is_said(tmp_path: Path) -> None:
    gain = 1.0 + 0.05 * np.random.default_rng(3).standard_normal(15)
    path = write_csv(tmp_path / "f.csv", frequency_hz=np.geomspace(1.0, 3000.0, 15), gain=gain)
    read, told = fitted(tmp_path, "frequency", path)
    assert told["doubts"]
    assert read.verdicts == ["bad"]
    assert all(doubt in read.said for doubt in told["doubts"])


def test_a_resonance(tmp_path: Path) -> None:
    r = RESPONSE / 41e3
    gain = np.abs(1.0 / (1.0 - r**2 + 1j * r / 15.0)) * NOISE[:58]
    read, told = fitted(tmp_path, "resonance", write_csv(tmp_path / "r.csv", frequency_hz=RESPONSE, gain=gain))
    assert f"frequency_hz {told['parameters']['frequency_hz']['value']:.6g} ±" in read.said


def test_both_directions_of_a_curve_are_drawn_by_themselves() -> None:
    """Measured and fitted have other numbers of points; a curve without a direction has none in its picture."""
    x = np.array([0.0, 1.0, 2.0, 1.5, 0.5])
    both = Curve("t", "x [V]", "y [nm]", (x, x), (x[1:], x[1:]), (3, 2))
    drawn = drawn_curves(both)
    assert [(one.name, one.role, one.kind) for one in drawn] == [
        ("forward, measured", "forward", "points"),
        ("backward, measured", "backward", "points"),
        ("forward, fit", "forward", "line"),
        ("backward, fit", "backward", "line"),
    ]
    assert [one.x.tolist() for one in drawn] == [[0.0, 1.0, 2.0], [1.5, 0.5], [1.0, 2.0], [1.5, 0.5]]
    plain = Curve("t", "x [V]", "y [nm]", (x, x), (x, x))
    assert [(one.name, one.role) for one in drawn_curves(plain)] == [("measured", "other"), ("fit", "other")]


@pytest.mark.common
def test_an_operator(tmp_path: Path) -> None:
    paths = []
    for number, (centre, stroke) in enumerate(SIX[1::2]):
        time_s, drive_v, nm = record(ForeignPlant(ManyPlays()), centre, stroke, seed=number)
        paths.append(write_csv(tmp_path / f"t{number}.csv", time_s=time_s, drive_v=drive_v, displacement_nm=nm))
    read, told = fitted(tmp_path, "operator", *paths)
    for trace in told["traces"]:
        shown = (f"{trace['left_out'][f'{name}_percent']:.3g}" for name in ("rms", "scaling", "mismatch", "size"))
        assert " ".join(shown) in read.said
    assert told["family"] in read.said
    assert "would help most" in read.said
