"""A displacement that its errors do not support is left out; one that they support is applied."""

from pathlib import Path

import numpy as np
import pytest
from correcting import off, old_frame, save_pair
from editing import run

from tablegen.correction.by_fit import by_fit
from tablegen.correction.old_scan import OldScan
from tablegen.correction.periodic_scan import PeriodicScan, periodic_scan
from tablegen.correction.scan_images import Choice, read_scan
from tablegen.numerics.arrays import Floats


def lattice(bow: float, seed: int) -> Floats:
    """A hexagonal lattice with noise, whose columns are off by a bow in pixels."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:128, :128].astype(np.float64)
    x = x + bow * np.sin(np.pi * x / 128.0)
    phases = x / 11.0 + y / 40.0, y / 12.0 - x / 60.0
    waves = [np.cos(2.0 * np.pi * phase) for phase in (*phases, phases[0] + phases[1])]
    return np.sum(waves, axis=0) + 0.3 * rng.normal(size=x.shape)


def fit(bow: float, seed: int) -> PeriodicScan:
    return periodic_scan(lattice(bow, seed), lattice(bow, seed + 100))


def moved(scan: PeriodicScan, axis: int) -> float:
    """The largest displacement along x or y, in pixels."""
    displacement = scan.distortion.displacement(True)[axis]
    return float(np.nanmax(np.abs(displacement - np.nanmean(displacement))))


@pytest.mark.common
@pytest.mark.parametrize("seed", range(3))
def test_noise_alone_moves_nothing(seed: int) -> None:
    scan = fit(0.0, seed)
    assert scan.straight_axes == "xy"
    assert moved(scan, 0) < 1e-6
    assert moved(scan, 1) < 0.01  # of the time within a row


@pytest.mark.common
@pytest.mark.parametrize("seed", range(3))
def test_a_fifth_of_a_pixel_is_supported_along_its_axis(seed: int) -> None:
    """The negative control: a bow of 0.2 pixels is applied, and moves no row."""
    scan = fit(0.2, seed)
    assert scan.straight_axes == "y"
    assert 0.1 < moved(scan, 0) < 0.3


@pytest.mark.common
def test_the_note_says_which_axis_is_not_displaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, seed in (("trace", 1), ("retrace", 101)):
        np.save(f"{name}.npy", lattice(0.0, seed))
    text = run("correct", "trace.npy", "retrace.npy", "--fit").out
    assert "note: the displacement along x and y is within its errors; it was not applied" in text


@pytest.mark.common
def test_the_displacement_of_a_piezo_is_supported(tmp_path: Path) -> None:
    frame = old_frame("paper", pixels=128, lines=96)
    scan, its_fit = by_fit(read_scan(*save_pair(frame, tmp_path), Choice()), OldScan(), lattice_nm=60.0)
    assert its_fit.straight_axes == ""
    assert "not_displaced" not in scan.record
    assert off(scan.distortion, frame).x < 0.3
