"""``tablegen predict`` as a user runs it: a foreign piezo's own record, and bad input by name."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from editing import run
from foreign_plants import SIX, BoucWen, ForeignPlant, record
from replacing import replace

from tablegen.planning.known_axis import KnownAxis


@pytest.fixture(scope="module")
def scanner(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scanner file with an operator of x, and the largest record beside it."""
    folder, plant, paths = tmp_path_factory.mktemp("predict"), ForeignPlant(BoucWen()), []
    for number, at in enumerate(SIX):
        columns = record(plant, *at, seed=number, samples=400)
        paths.append(folder / f"t{number}.csv")
        np.savetxt(
            paths[-1], np.column_stack(columns), "%.9g", ",", header="time_s,drive_v,displacement_nm", comments=""
        )
    assert run("init", folder / "demo").status == 0
    path = folder / "demo" / "scanner.toml"
    done = run("calibrate", "operator", "--axis", "x", *paths, "--scanner", path, "--write")
    assert done.status == 0, done.err
    return path


def with_points(scanner: Path, path: Path) -> None:
    """Write the scanner file again, with the response of the piezo in points."""
    f_hz = np.geomspace(100.0, 8e4, 200)
    h = ForeignPlant(BoucWen()).dynamics(f_hz)
    rows = np.column_stack([f_hz, np.abs(h) / np.abs(h[0]), np.degrees(np.unwrap(np.angle(h)))])
    np.savetxt(path.parent / "response.csv", rows, "%.9g", ",", header="hz,gain,phase_deg", comments="")
    text = re.sub(r"(?s)\[x\.resonance\].*?\n\n", "", scanner.read_text("utf-8"))
    text = text.replace("[x.hysteresis]", '[x.resonance]\nresponse = "response.csv"\n\n[x.hysteresis]')
    path.write_text(text, "utf-8")
    for own in scanner.parent.glob("*_operator.toml"):
        (path.parent / own.name).write_bytes(own.read_bytes())


@pytest.mark.common
def test_record_is_predicted_and_bad_input_is_named(scanner: Path, tmp_path: Path) -> None:
    trace, out = scanner.parent.parent / "t3.csv", tmp_path / "p.csv"
    done = run("predict", scanner, trace, "--axis", "x", "--against", trace, "--start", "settled", "-o", out)
    assert done.status == 0, done.err
    rows = np.genfromtxt(out, delimiter=",", names=True)
    error = rows["error_nm"]
    assert float(np.std(error)) < 0.01 * float(np.ptp(rows["measured_nm"]))
    assert "rms error below" in done.out
    rest = run("predict", scanner, trace, "--axis", "x", "--against", trace, "--json")
    figures = json.loads(rest.out)
    assert figures["start"] == "rest"
    assert figures["uncertainty_nm"] > 2.0 * float(np.max(rows["uncertainty_nm"])) > 0.0
    assert figures["rms_error_percent"] > 100.0 * float(np.std(error)) / float(np.ptp(rows["measured_nm"]))
    time, volts = rows["time_s"], rows["drive_v"]
    with_points(scanner, tmp_path / "points.toml")
    options = ("--axis", "x", "--against", trace, "--start", "line", "--json")
    swept = run("predict", tmp_path / "points.toml", trace, *options)
    assert swept.status == 0, swept.err
    assert json.loads(swept.out)["rms_error_percent"] < 1.0
    for name, bad_time, bad_volts, why in (
        ("time", time[::-1], volts, "line 3|:3:"),
        ("beyond", time, 3.0 * volts, "--drive-gain"),
        ("still", time, 0.0 * volts + 50.0, "moves by 0 V"),
    ):
        path = tmp_path / f"{name}.csv"
        np.savetxt(path, np.column_stack([bad_time, bad_volts]), "%.9g", ",", header="time_s,drive_v", comments="")
        refused = run("predict", scanner, path, "--axis", "x")
        assert refused.status == 2
        assert any(part in refused.err for part in why.split("|")), refused.err
    assert "calibrate operator --axis y" in run("predict", scanner, trace, "--axis", "y").err


@pytest.mark.common
def test_loops_are_those_of_the_mean_rate_of_a_record(scanner: Path) -> None:
    known = KnownAxis.read(scanner, "x")
    plays = replace(known.operator.family.plays, growth=0.05)
    growing = replace(known.operator, family=replace(known.operator.family, plays=plays))
    known = replace(known, operator=growing)
    phase = np.arange(401) / 100.0
    triangle = 0.2 + 0.6 * np.abs(2.0 * (phase % 1.0) - 1.0)
    for rate_hz in (50.0, 900.0):
        found = known.operator_of(phase / rate_hz, triangle)
        assert found.family.plays.stretch == pytest.approx(growing.at_rate(rate_hz).family.plays.stretch)
    assert known.operator_of(phase / 50.0, triangle).family.plays.stretch < 1.0
