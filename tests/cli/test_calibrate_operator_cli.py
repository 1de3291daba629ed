"""`tablegen calibrate operator` as a user runs it: options, the picture, what it writes; poor data by name."""

import json
from pathlib import Path

import numpy as np
import pytest
from editing import Outcome, run
from foreign_plants import SIX, BoucWen, Floats, ForeignPlant, record

DELAY_S = 3e-5
Columns = tuple[Floats, Floats, Floats]  # s, V, nm


@pytest.fixture(scope="module")
def traces(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Six, of a sensor that is late."""
    folder, plant, paths = tmp_path_factory.mktemp("traces"), ForeignPlant(BoucWen()), []
    for number, at in enumerate(SIX):
        time, volts, nm = record(plant, *at, seed=number, samples=400)
        paths.append(write(folder / f"t{number}.csv", (time, volts, np.interp(time - DELAY_S, time, nm))))
    return paths


def write(path: Path, columns: Columns, header: str = "time_s,drive_v,displacement_nm") -> Path:
    np.savetxt(path, np.column_stack(columns), "%.9g", ",", header=header, comments="")
    return path


def calibrated(*arguments: str | Path) -> Outcome:
    return run("calibrate", "operator", "--axis", "x", "--v-max", "100", *arguments)


@pytest.mark.rest
def test_a_fitted_delay_is_printed_and_written_and_the_picture_is_drawn(traces: list[Path], tmp_path: Path) -> None:
    scanner, picture = tmp_path / "s.toml", tmp_path / "fit.png"
    wanted = ("--for", "30", "60", "--for", "20", "85")
    done = calibrated(
        *traces, *wanted, "--delay-s", "fit", "--json", "--plot", picture, "--scanner", scanner, "--write"
    )
    assert done.status == 0, done.err
    found = json.loads(done.out)
    lag_s = 2e-6 + 1.0 / (2.0 * np.pi * 60e3 * 14.0)  # of the axis, which has no [x.resonance] here
    assert found["delay_s"]["value"] == pytest.approx(DELAY_S + lag_s, abs=3e-6)
    assert 1e-7 < found["delay_s"]["standard_error"] < 2e-6
    assert (found["next_trace"]["size_v"], found["next_trace"]["offset_v"]) == pytest.approx((20.0, 85.0))
    assert f"# delay of the sensor: {found['delay_s']['value']:.6g} s" in (tmp_path / "s_x_operator.toml").read_text()
    assert picture.read_bytes().startswith(b"\x89PNG")
    given = calibrated(*traces, "--delay-s", str(found["delay_s"]["value"]))
    assert f"delay    {1e6 * found['delay_s']['value']:.3g} us of the sensor, as given" in given.out


@pytest.mark.parametrize("text", ["soon", "nan", "inf"])
def test_a_delay_that_is_none_is_refused(text: str, traces: list[Path]) -> None:
    done = calibrated(*traces, "--delay-s", text)
    assert done.status == 2
    assert f"--delay-s {text}: seconds, or fit" in done.err


def test_a_scan_that_the_driver_does_not_reach_is_refused_before_the_fit(traces: list[Path]) -> None:
    done = calibrated(*traces, "--for", "200", "50")
    assert (done.status, done.out) == (2, "")
    assert "a scan of 200 V at 50 V is not within 0..100 V" in done.err


def test_a_trace_is_named_once_with_its_folder(traces: list[Path], tmp_path: Path) -> None:
    few = tmp_path / "few.csv"
    few.write_text("".join(traces[0].read_text("utf-8").splitlines(keepends=True)[:5]), "utf-8")
    assert calibrated(few).err.startswith(f"{few}: 4 samples")
