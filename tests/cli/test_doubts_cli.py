"""Calibrations that say nothing are printed and not written, unless forced; a response is written as measured."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from calibrating import RESPONSE, Scanner
from editing import SCAN, edited, run, write_pair
from test_calibration_cli import write_csv

from tablegen.compensation.response_file import read_response
from tablegen.config.load import load
from tablegen.planning.line_plan import make_plan

WILD = ("30.csv", "60.csv", "100.csv")


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The shipped pair, traces whose residuals no law joins, and a response with two resonances."""
    write_pair(tmp_path, edited(SCAN, "- [limits]"))
    noise = np.random.default_rng(3).standard_normal((3, 2, 800)) * 0.002
    for name, v, beta, one in zip(WILD, (30.0, 60.0, 100.0), (0.09, 0.004, 0.07), noise, strict=True):
        # rho is nearly 0, so that beta is what this amplitude shows.
        branch = (beta * 100.0 / v, 1e-6, 0.4)
        trace = Scanner(forward=branch).trace(v, 3.3, 800, one)
        write_csv(tmp_path / name, time_s=trace.time_s, drive_v=trace.drive_v, displacement_nm=trace.displacement_nm)
    h = response(RESPONSE)
    write_csv(
        tmp_path / "response.csv",
        frequency_khz=RESPONSE[::-1] / 1e3,
        gain=25.0 * np.abs(h)[::-1],
        phase_rad=np.angle(-h)[::-1],  # an inverting sensor, wrapped, from high to low
    )
    monkeypatch.chdir(tmp_path)
    return tmp_path


def response(f: np.ndarray) -> np.ndarray:
    parts = [share / (1.0 - (f / at) ** 2 + 1j * f / at / q) for at, q, share in ((4e4, 20.0, 0.9), (38e3, 30.0, 0.1))]
    found: np.ndarray = sum(parts) * np.exp(-2j * np.pi * f * 5e-6)
    return found


def calibrate(kind: str, *more: str) -> tuple[int, str, str]:
    files = WILD if kind == "hysteresis" else ("response.csv",)
    found = run("calibrate", kind, "--axis", "x", *files, "--scanner", "scanner.toml", *more)
    return found.status, found.out, found.err


@pytest.mark.common
def test_a_meaningless_fit_is_printed_and_not_written(lab: Path) -> None:
    before = (lab / "scanner.toml").read_bytes()
    status, printed, errors = calibrate("hysteresis")
    assert (status, errors) == (0, "")
    warnings = [line for line in printed.splitlines() if line.startswith("warning: ")]
    assert any("turn 0.5, forward: (22) misses the measured residuals by " in line for line in warnings)
    refused = calibrate("hysteresis", "--write")
    assert refused[:2] == (2, printed)
    *reasons, advice = refused[2].splitlines()
    assert reasons == [line.replace("warning: ", "scanner.toml: x: ", 1) for line in warnings]
    assert advice.startswith("scanner.toml: x: nothing was written; ")
    assert advice.endswith("with --force")
    assert (lab / "scanner.toml").read_bytes() == before
    assert json.loads(calibrate("hysteresis", "--json")[1])["doubts"] == [line[len("warning: ") :] for line in warnings]


@pytest.mark.common
def test_force_writes_it_and_says_so_in_the_file(lab: Path) -> None:
    status, _, errors = calibrate("hysteresis", "--write", "--force")
    assert (status, errors) == (0, "")
    text = (lab / "scanner.toml").read_text("utf-8")
    assert "% rms, meaningless, written by --force\n" in text
    assert "hysteresis up to date" in calibrate("hysteresis", "--write", "--force")[1]
    assert calibrate("hysteresis", "--force")[0] == 2  # without --write there is nothing to force


def test_the_points_of_it_are_written(lab: Path) -> None:
    """What was measured at each amplitude is well known; only the law is not."""
    status, printed, errors = calibrate("hysteresis", "--write", "--points")
    assert (status, errors) == (0, "")
    assert "warning" not in printed
    text = (lab / "scanner.toml").read_text("utf-8")
    assert "--force" not in text
    betas = [point["beta"] for point in tomllib.loads(text)["x"]["hysteresis"]["branches"][0]["forward"]["points"]]
    assert betas == pytest.approx([0.09, 0.004, 0.07], abs=0.002)


def test_a_response_is_written_named_and_built_from(lab: Path) -> None:
    """Without a conversion by hand: units, order, inversion and turns of the phase are those of the build."""
    status, printed, errors = calibrate("resonance", "--write", "--points")
    assert (status, errors) == (0, "")
    assert printed.splitlines()[-1] == "scanner.toml: x.resonance written"
    named = tomllib.loads((lab / "scanner.toml").read_text("utf-8"))["x"]["resonance"]
    assert named == {"response": "scanner_x_response.csv", "max_boost_db": 6.0}
    measured = read_response(lab / "scanner_x_response.csv")
    f = np.linspace(200.0, 58e3, 300)
    real, imaginary = measured.inverse(RESPONSE)
    true = response(RESPONSE[:1])[0] / np.abs(response(RESPONSE[:1])[0])
    assert np.abs((real + 1j * imaginary) * response(RESPONSE) / np.abs(response(RESPONSE[:1])) - 1.0).max() < 1e-6
    assert abs(true - 1.0) < 0.01
    assert np.all(np.abs(np.diff(np.interp(f, measured.f_hz, measured.phase_turns))) < 0.1)  # no jump of a turn
    assert run("check", "scan.toml").status == 0
    series = make_plan(load("scan.toml")).x.series
    target = make_plan(load("scan.toml")).x.target
    n = np.arange(1, 33)
    held = np.sinc(n / 1250.0) * np.exp(-1j * np.pi * n / 1250.0)  # by the converter, for a tick
    h = held * response(n * 400.0) / np.abs(response(RESPONSE[:1]))
    assert series.a - 1j * series.b == pytest.approx((target.a - 1j * target.b) / h, abs=2e-4 * abs(target.a[0]))


def test_a_response_and_a_resonance_take_turns(lab: Path) -> None:
    calibrate("resonance", "--write", "--points")
    first = (lab / "scanner_x_response.csv").read_bytes()
    assert first.splitlines()[1].startswith(b"# from response.csv, sha256 ")
    assert "x.resonance up to date" in calibrate("resonance", "--write", "--points")[1]
    calibrate("resonance", "--write", "--force")
    named = tomllib.loads((lab / "scanner.toml").read_text("utf-8"))["x"]["resonance"]
    assert sorted(named) == ["delay_s", "frequency_hz", "max_boost_db", "quality"]
    calibrate("resonance", "--write", "--points")
    assert (lab / "scanner_x_response.csv").read_bytes() == first


def test_what_is_no_response_is_refused(lab: Path) -> None:
    before = (lab / "scanner.toml").read_bytes()
    own = lab / "scanner_x_response.csv"
    own.write_text("hz,gain,phase_deg\n1,1,0\n2,1,0\n", "utf-8")
    status, _, errors = calibrate("resonance", "--write", "--points")
    assert (status, errors) == (2, "scanner_x_response.csv: was not written by tablegen calibrate; move it away\n")
    own.unlink()
    rows = (lab / "response.csv").read_text("utf-8").splitlines()
    (lab / "response.csv").write_text("\n".join([*rows, rows[5]]) + "\n", "utf-8")
    assert "Hz was measured twice" in calibrate("resonance", "--write", "--points")[2]
    (lab / "response.csv").write_text("\n".join(row.rpartition(",")[0] for row in rows) + "\n", "utf-8")
    assert "takes phase_deg or phase_rad" in calibrate("resonance", "--write", "--points")[2]
    assert (lab / "scanner.toml").read_bytes() == before
    assert not own.exists()
