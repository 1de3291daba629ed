"""The mean of the frames of a movie is corrected as one image."""

import json
from pathlib import Path

import numpy as np
import pytest
from editing import run
from instrument_files import asd

from tablegen.correction.scan_images import Choice, read_scan
from tablegen.images.frame_registration import registered
from tablegen.numerics.arrays import Floats


def movie() -> tuple[Floats, Floats]:
    """Four frames of a lattice with noise that drifts by whole pixels, and the first one without noise."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[:96, :96].astype(np.float64)
    frames = []
    for left, up in ((0, 0), (1, 0), (2, -1), (3, -1)):
        phases = (x + left) / 11.0 + (y + up) / 40.0, (y + up) / 12.0 - (x + left) / 60.0
        frames.append(np.sum([np.cos(2.0 * np.pi * phase) for phase in (*phases, phases[0] + phases[1])], axis=0))
    return np.array(frames) + 0.6 * rng.normal(size=(4, 96, 96)), frames[0]


def test_frames_are_registered_and_averaged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise of 0.6 falls by the root of four frames, and no pixel is missing at the edges."""
    monkeypatch.chdir(tmp_path)
    frames, clean = movie()
    Path("a.asd").write_bytes(asd({"TP": frames, "ER": frames[:, ::-1]}))
    images = read_scan(Path("a.asd"), None, Choice(frames=(0, 4)))
    assert images.frames == (0, 4)
    assert np.all(np.isfinite([one.heights for one in images.channels]))
    noise = (images.first.heights - clean)[2:-2, 4:-4]
    assert np.std(noise - np.mean(noise, axis=1, keepdims=True)) < 1.1 * 0.6 / 2.0
    outcome = run("correct", "a.asd", "--fit", "--channel", "TP", "--frames", "0:4", "--json")
    assert outcome.status == 0
    assert json.loads(outcome.out)["frames"] == [0, 4]


def test_noise_moves_no_frame_by_a_pixel() -> None:
    """Noise of half the rms of the lattice; the phases alone put two frames a pixel beside."""
    assert registered([*movie()[0]]).shifts.tolist() == [[0, 0], [-1, 0], [-2, 1], [-3, 1]]


def test_frames_are_those_of_one_movie(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.asd").write_bytes(asd({"TP": movie()[0]}))
    for more in (("--frame", "1"), ("a.asd",)):
        outcome = run("correct", "a.asd", *more, "--fit", "--frames", "0:4")
        assert outcome.status == 2
        assert "--frames is for one movie, without --frame, --each and --pairs" in outcome.err
    assert "has no frame 4; the last one is 3" in run("correct", "a.asd", "--fit", "--frames", "0:5").err
