"""Measurements with numbers that no instrument gives: a fit, or a message with the file; never a traceback."""

from pathlib import Path

import numpy as np
import pytest
from editing import run
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tablegen.calibration.spans import LEAST_SPAN

T = np.arange(120) / 120 * 0.02
TRIANGLE = 50.0 + 40.0 * (2.0 / np.pi) * np.arcsin(np.sin(200.0 * np.pi * T))
F = np.geomspace(1e3, 1e5, 40)
TABLES: dict[str, dict[str, np.ndarray]] = {
    "size": {"drive_v": np.linspace(10.0, 90.0, 8), "actual_nm": np.linspace(100.0, 1000.0, 8)},
    "offset": {"offset_v": np.linspace(5.0, 95.0, 8), "apparent_nm": np.linspace(15.0, 21.0, 8)},
    "frequency": {"frequency_hz": np.geomspace(1.0, 1e3, 8), "gain": np.linspace(1.0, 0.9, 8)},
    "resonance": {"frequency_hz": F, "gain": 1.0 / np.abs(1.0 - (F / 4e4) ** 2 + 1j * F / 8e5)},
    "hysteresis": {
        "time_s": T,
        "drive_v": TRIANGLE,
        "displacement_nm": 10.0 * TRIANGLE + 5.0 * np.sin(200 * np.pi * T),
    },
}
TABLES["operator"] = TABLES["hysteresis"]
VALUES = st.sampled_from([0.0, 5e-324, 1e-300, 1e-160, 1e-13, -1.0, 1e160, 1e300, np.nan, np.inf, -np.inf])


def calibrated(folder: Path, kind: str, columns: dict[str, np.ndarray]) -> tuple[int, str]:
    """Status and messages of the command."""
    path = folder / "table.csv"
    rows = "\n".join(",".join(map(repr, row)) for row in zip(*(one.tolist() for one in columns.values()), strict=True))
    path.write_text(f"{','.join(columns)}\n{rows}\n", "utf-8")
    done = run("calibrate", kind, "--axis", "x", "--v-max", "100", "--json", path)
    return done.status, done.err


@pytest.mark.common
@pytest.mark.filterwarnings("error")
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(sorted(TABLES)), st.data())
def test_a_column_of_strange_numbers_is_fitted_or_refused(tmp_path: Path, kind: str, data: st.DataObject) -> None:
    columns = {name: values.copy() for name, values in TABLES[kind].items()}
    for name in data.draw(st.sets(st.sampled_from(sorted(columns)), min_size=1)):
        value, where = data.draw(VALUES), data.draw(st.sampled_from(["all", "one", "times"]))
        if where == "one":
            columns[name][data.draw(st.integers(0, len(columns[name]) - 1))] = value
        else:
            with np.errstate(all="ignore"):
                columns[name] = columns[name] * value if where == "times" else np.full_like(columns[name], value)
    status, err = calibrated(tmp_path, kind, columns)
    assert status in (0, 2)
    assert status == 0 or "table.csv" in err


@pytest.mark.parametrize("kind", ["hysteresis", "operator"])
@pytest.mark.parametrize(("name", "unit"), [("time", "s"), ("drive", "V"), ("displacement", "nm")])
def test_a_record_that_hardly_changes_is_refused(tmp_path: Path, kind: str, name: str, unit: str) -> None:
    columns = dict(TABLES[kind])
    column = next(one for one in columns if one.startswith(name))
    columns[column] = columns[column] * 1e-300
    status, err = calibrated(tmp_path, kind, columns)
    assert status == 2
    assert f"{unit} in all, less than {LEAST_SPAN:g} {unit}: is its unit right?" in err
