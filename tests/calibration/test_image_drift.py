"""Drift between images: generated ones with a known drift, and what has to be refused."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from editing import run
from turned_scans import turned_setup

import tablegen
from tablegen.api.image_input import read_trace_and_perhaps_retrace
from tablegen.api.read_image import Image
from tablegen.base.input_errors import Rejected
from tablegen.cli import cli
from tablegen.images.frame_drift import drift_intervals
from tablegen.images.image_shift import ImagePair, image_shift
from tablegen.planning.turned_plan import FrameGeometry

SIDE = 80
NOISE = 0.2


def sample(seed: int, width: float = 4.0):
    """Smooth islands without a period: heights over x and y in pixels."""
    rng = np.random.default_rng(seed)
    waves, phases = rng.standard_normal((60, 2)) / width, rng.uniform(0.0, 2.0 * np.pi, 60)

    def heights(x, y):
        terms = (np.cos(u * x + v * y + phase) for (u, v), phase in zip(waves, phases, strict=True))
        return np.tanh(sum(terms) / 30.0**0.5)

    return heights


def lattice(x, y):
    return np.cos(2 * np.pi * x / 9.0) + np.cos(2 * np.pi * (0.3 * x + y) / 11.0)


def images(heights, shifts, seed: int = 0, noise: float = NOISE, jumps: float = 0.3) -> list[np.ndarray]:
    """Images of a sample that has moved by each shift x, y in pixels; rows have offsets of their own."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:SIDE, :SIDE].astype(float)
    return [
        heights(x - sx, y - sy)
        + noise * rng.standard_normal(x.shape)
        + jumps * rng.standard_normal((SIDE, 1))
        + 1e-4 * (x - SIDE / 2) ** 2  # a bow of the scanner, which does not move with the sample
        for sx, sy in shifts
    ]


@pytest.mark.common
def test_the_drift_is_within_its_errors() -> None:
    """Of 20 samples and shifts up to 8 pixels, each within three standard errors, and these are no excuse."""
    ratios, errors = [], []
    for seed in range(20):
        shift = np.random.default_rng(seed).uniform(-8.0, 8.0, 2)
        pair = images(sample(seed + 100), [(0.0, 0.0), shift], seed)
        drift = tablegen.drift(*pair, seconds_apart=4.0)
        for one, true in ((drift.x, shift[0] / 4.0), (drift.y, shift[1] / 4.0)):
            ratios.append((one.value - true) / one.standard_error)
            errors.append(4.0 * one.standard_error)
    assert np.max(np.abs(ratios)) < 3.0
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 1.5
    assert np.median(errors) < 0.06  # pixels


def test_a_wrong_drift_is_outside_of_the_errors() -> None:
    drift = tablegen.drift(*images(sample(1), [(0.0, 0.0), (3.3, -2.4)]), seconds_apart=1.0)
    assert abs(drift.x.value - 3.3) < 3.0 * drift.x.standard_error
    assert abs(drift.y.value + 2.4) < 3.0 * drift.y.standard_error
    assert abs(drift.x.value - 3.8) > 3.0 * drift.x.standard_error
    assert drift.unit == "pixels/s"
    assert json.loads(drift.to_json())["time"] == "given"


def refused(*pair: np.ndarray, **how: float) -> tuple[str, str]:
    with pytest.raises(Rejected) as caught:
        tablegen.drift(*pair, seconds_apart=1.0, **how)
    (problem,) = caught.value.problems
    return problem.code, problem.why


def test_another_place_is_refused() -> None:
    first, second = images(sample(2), [(0.0, 0.0)])[0], images(sample(52), [(0.0, 0.0)])[0]
    assert refused(first, second)[0] in ("weak-registration", "ambiguous-shift")


def test_a_place_with_few_features_is_refused() -> None:
    """Two places whose few islands agree somewhere, and nowhere else: no other check sees it."""
    first, second = (images(sample(seed, 12.0), [(0.0, 0.0)], at)[0] for seed, at in ((11, 11), (5011, 12)))
    code, why = refused(first, second)
    assert (code, why[:21]) == ("weak-registration", "have too few features")
    shift = image_shift([ImagePair(first, second)])
    assert shift.correlation > 0.4
    assert not len(shift.rivals)
    assert not shift.open_ended


@pytest.mark.common
def test_both_directions_count() -> None:
    """Trace and retrace have one shift, and noise of their own: on average the error falls; each alone is stored."""
    variances = []
    for seed in range(4, 9):
        ways = [ImagePair(*images(sample(seed), [(0.0, 0.0), (3.0, -2.0)], way, noise=1.0)) for way in (0, 1)]
        one, both = image_shift(ways[:1]), image_shift(ways)
        assert np.all(np.abs(both.pixels - [3.0, -2.0]) < 3.0 * both.errors)
        assert np.allclose(both.directions[0], one.pixels, atol=0.2)
        assert both.directions.shape == (2, 2)
        variances.append((np.sum(one.errors**2), np.sum(both.errors**2)))
    alone, together = np.mean(variances, axis=0)
    assert together < 0.8 * alone


def test_other_pixels_are_refused() -> None:
    first, second = images(sample(1), [(0.0, 0.0), (1.0, 0.0)])
    assert refused(first, second[:, :-4])[0] == "unlike-images"


def test_the_drift_of_a_lattice_is_ambiguous_unless_it_is_bounded() -> None:
    first, second = images(lattice, [(0.0, 0.0), (2.0, 1.0)])
    code, why = refused(first, second)
    assert code == "ambiguous-shift"
    assert "(2, 1)" in why
    bounded = image_shift([ImagePair(first, second)], np.array([4.0, 4.0]))
    assert np.all(np.abs(bounded.pixels - [2.0, 1.0]) < 3.0 * bounded.errors)
    assert not len(bounded.rivals)
    assert len(image_shift([ImagePair(first, second)]).rivals) > 2


def scans(*heights: np.ndarray, **facts: float) -> list[list]:
    """Images with the facts of a file, each in one direction."""
    read = [read_trace_and_perhaps_retrace(one, None, {})[0] for one in heights]
    return [[replace(one, width_nm=160.0, height_nm=160.0, **facts)] for one in read]


def test_files_with_a_size_have_a_bound_and_the_time_of_the_row() -> None:
    """The same place is imaged a row later in the second image if the sample has moved by a row."""
    pair = scans(*images(lattice, [(0.0, 0.0), (1.0, 2.0)]), line_rate_hz=10.0)
    (interval,) = drift_intervals(pair, 8.0, 8.0)
    assert abs(interval.seconds - 8.2) < 0.02
    with pytest.raises(Rejected, match="do not show the same place within 2 nm"):
        drift_intervals(pair, 8.0, 2.0)
    beside = scans(*images(lattice, [(0.0, 0.0), (1.0, 0.0)]))
    with pytest.raises(Rejected, match="nm apart, further than --within 1"):
        drift_intervals(beside, 8.0, 1.0)


def test_scans_that_are_not_alike_are_refused() -> None:
    first, second = scans(*images(sample(3), [(0.0, 0.0), (1.0, 0.0)]), angle_deg=0.0)
    for other in (
        replace(second[0], angle_deg=30.0),
        replace(second[0], width_nm=200.0),
        replace(second[0], first_row="top"),
    ):
        start = [replace(first[0], first_row="bottom")]
        with pytest.raises(Rejected) as caught:
            drift_intervals([start, [other]], 1.0, None)
        assert caught.value.problems[0].code == "unlike-images"
    assert len(drift_intervals([first, second], 1.0, None)) == 1


def test_the_command_prints_it_and_asks_for_the_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for number, heights in enumerate(images(sample(1), [(0.0, 0.0), (2.0, 1.0), (4.0, 2.0)])):
        np.save(f"{number}.npy", heights)
    words = ["drift", "0.npy", "1.npy", "2.npy"]
    outcome = run(*words)
    assert outcome.status == 2
    assert "the time between the images is unknown" in outcome.err
    timed = [*words, "--seconds-apart", "2"]
    text = CliRunner().invoke(cli, timed, catch_exceptions=False).output
    assert "over 4 s as given, by one direction" in text
    record = json.loads(CliRunner().invoke(cli, [*timed, "--json"], catch_exceptions=False).output)
    assert len(record["intervals"]) == 2
    assert abs(record["drift"]["x"]["value"] - 1.0) < 3.0 * record["drift"]["x"]["standard_error"]


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 200.0])
def test_a_scan_that_follows_the_drift_sees_the_sample_at_rest(angle_deg: float, tmp_path: Path) -> None:
    """Its own map from the axes to the sample takes the motion of the sample away, also where it followed some."""
    before, along, across = (0.4, -0.2), 1.5, -0.7
    setup = turned_setup(tmp_path, angle_deg, f"drift_nm_per_s = {list(before)}")
    pair = [
        Image(
            replace(read_trace_and_perhaps_retrace(heights, None, {})[0], width_nm=float(SIDE), height_nm=float(SIDE))
        )
        for heights in images(sample(1), [(0.0, 0.0), (4.0 * along, 4.0 * across)], noise=0.0, jumps=0.0)
    ]
    drift = tablegen.drift(*pair, seconds_apart=4.0, scan=setup)
    assert drift.drift_nm_per_s is not None
    geometry = FrameGeometry(angle_deg, (100.0, 100.0), 0.0, 0.0, before, 1.0)
    after = FrameGeometry(angle_deg, (100.0, 100.0), 0.0, 0.0, drift.drift_nm_per_s, 1.0)
    for seconds in (0.0, 10.0):
        at = np.array(3.0), np.array(5.0), np.array(seconds)
        seen, rest = geometry.on_the_sample(*at), after.on_the_sample(*at)
        # A feature moves in the image as much as the place of the axes moves back on the sample.
        assert float(seen[0] - rest[0]) == pytest.approx(along * seconds, abs=0.3)
        assert float(seen[1] - rest[1]) == pytest.approx(across * seconds, abs=0.3)
    assert "drift_nm_per_s = [" in drift.summary()


def test_images_without_a_size_have_no_drift_for_a_scan(tmp_path: Path) -> None:
    pair = images(sample(1), [(0.0, 0.0), (2.0, 1.0)])
    with pytest.raises(Rejected, match="has no size in nm, which the drift of a scan file needs"):
        tablegen.drift(*pair, seconds_apart=1.0, scan=turned_setup(tmp_path, 30.0))
