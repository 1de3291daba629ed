"""The table of minimum-acceleration waveforms in docs/waveform.md, measured again where that is quick."""

import re
import runpy
from pathlib import Path

import pytest
from building import REPOSITORY
from variants import plan_of

from tablegen.certificate.certificate import certify
from tablegen.certificate.optimum import least_acceleration
from tablegen.waveform.minimum_acceleration import Straightness, least_percent, minimum_acceleration_series
from tablegen.waveform.window_fit import fit_window

PAGE = (REPOSITORY / "docs" / "waveform.md").read_text("utf-8")
LINES: dict[str, Straightness] = runpy.run_path(str(REPOSITORY / "benchmarks" / "gentle.py"))["LINES"]
ROWS = [
    [cell.strip() for cell in row.split("|")[1:-1]]
    for row in re.findall(r"^\| (?:both|forward), .*$", PAGE, re.M)
    if row.startswith(tuple(f"| {name} |" for name in LINES))
]


def test_the_table_has_every_line_harmonics_and_error() -> None:
    assert [tuple(row[:3]) for row in ROWS] == [
        (name, harmonics, percent)
        for name in LINES
        for harmonics in ("16", "32", "64")
        for percent in ("0.05", "0.3", "1")
    ]
    ratios = [float(row[6]) for row in ROWS if row[6]]
    assert len(ratios) >= 20
    assert max(ratios) <= 1.15


@pytest.mark.common
@pytest.mark.parametrize("name", LINES)
def test_rows_of_16_and_32_harmonics_are_measured(name: str) -> None:
    straight = LINES[name]
    for _, harmonics, percent, window, *figures in (row for row in ROWS if row[0] == name and row[1] != "64"):
        fitted = fit_window(straight.target, int(harmonics), straight.window, straight.both)
        assert window == f"{fitted.peak_acceleration():.1f}, {straight.error_percent(fitted):.2g} %"
        if figures[0].startswith("from"):
            assert figures[0] == f"from {least_percent(straight, int(harmonics)):.2g} % on"
            assert least_acceleration(straight, int(harmonics), float(percent)) is None
            continue
        peak = minimum_acceleration_series(straight, int(harmonics), float(percent)).peak_acceleration()
        assert figures[0] == f"{peak:.1f}"
        if percent == "1":
            optimum = least_acceleration(straight, int(harmonics), 1.0)
            assert optimum is not None
            assert float(figures[1]) == pytest.approx(optimum, abs=0.06)
            assert float(figures[2]) == pytest.approx(peak / optimum, abs=0.003)


def test_what_rounder_turns_do_to_a_line_by_laws_is_measured(tmp_path: Path) -> None:
    told = re.search(r"is (\S+) % of the line between trace and retrace with 32 harmonics,\sand (\S+) % with `E`", PAGE)
    assert told is not None
    for stated, edits in zip(told.groups(), ({}, {"x.band_limit.max_scaling_error_percent": "0.3"}), strict=True):
        expected = certify(plan_of(tmp_path, edits))["x"].expected
        assert expected is not None
        assert expected.mismatch is not None
        assert stated == f"{expected.mismatch.value:.2f}"
