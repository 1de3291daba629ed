"""Old frames of piezos that are known put straight: 0.3 % of the width, half a pixel, and no more noise."""

from pathlib import Path

import numpy as np
import pytest
from correcting import LATTICE, LAWS, OFFSET_V, PLANTS, RATE_HZ, V, off, old_frame, save_pair, scanner_file
from replacing import replace
from sets import common, long

from tablegen.base.input_errors import Unphysical
from tablegen.correction.by_fit import by_fit
from tablegen.correction.by_scanner import by_scanner
from tablegen.correction.distortion import Resampler
from tablegen.correction.old_scan import OldAxis, OldScan
from tablegen.correction.scan_images import Choice, Images, read_scan
from tablegen.correction.straight import StraightScan
from tablegen.virtual.imaging import FrameImages, grating

REACH_PERCENT = 0.3
TAKEN = OldScan(x=OldAxis(size_v=V, offset_v=OFFSET_V), rate_hz=RATE_HZ)
DRIFT = {"drift": (0.02, 0.01), "tilt": (0.5, 0.3)}


def check_noise(scan: StraightScan) -> None:
    """White noise of the same scan: nowhere more than 5 % more, up to what 4,000 pixels tell."""
    distortion = scan.distortion
    random = np.random.default_rng(5)
    for forward in (True, False):
        noise = random.standard_normal((distortion.rows, distortion.columns))
        found = Resampler.of(distortion, forward)(noise)
        assert np.nanstd(found) < 1.05
        for part in np.array_split(found, 16, axis=1):
            assert np.nanstd(part) < 1.05


def check_agreement(scan: StraightScan) -> None:
    """Half a pixel of 512; what is left of the difference is the noise, 7 % rms of two images of 0.36 rms."""
    assert scan.agreement is not None
    assert scan.agreement.worst is not None
    before, after = scan.agreement.worst
    columns = scan.distortion.columns
    assert before > 0.05 * columns
    assert after < 0.5 * columns / 512.0
    assert scan.agreement.difference[0] > 0.7
    assert scan.agreement.difference[1] < 0.2


@pytest.mark.common
@pytest.mark.parametrize("plant", PLANTS)
def test_a_lattice_by_a_fit(plant: str, tmp_path: Path) -> None:
    """Noise of 5 %, drift of 2 % and tilt; both axes, their sizes, and the shear of the drift."""
    frame = old_frame(plant, **DRIFT)
    scan, fit = by_fit(read_scan(*save_pair(frame, tmp_path), Choice()), OldScan(), lattice_nm=60.0)
    assert fit.tells_y
    found = off(scan.distortion, frame)
    assert found.x < REACH_PERCENT
    assert found.y < REACH_PERCENT
    assert found.size == pytest.approx((0.0, 0.0), abs=0.1)
    check_agreement(scan)
    check_noise(scan)
    assert scan.lattice is not None
    assert max(scan.lattice.worst) < 0.01 * REACH_PERCENT * 256


@pytest.mark.rest
@pytest.mark.parametrize("plant", long(["duhem"], PLANTS))
def test_any_sample_by_the_operator(plant: str, tmp_path: Path) -> None:
    """Of six traces at 100 Hz; the slow axis by its own operator, of traces at 100 Hz too."""
    frame = old_frame(plant)
    images = read_scan(*save_pair(frame, tmp_path), Choice())
    scan = by_scanner(images, scanner_file(plant, tmp_path), TAKEN)
    found = off(scan.distortion, frame)
    assert found.x < REACH_PERCENT
    assert found.y < REACH_PERCENT
    assert found.size[0] == pytest.approx(0.0, abs=0.5)
    check_agreement(scan)
    check_noise(scan)


@pytest.mark.common
@pytest.mark.parametrize("plant", common(["duhem"], ["duhem", "bouc-wen"]))
def test_512_pixels_of_a_window_and_a_fast_flyback(plant: str, tmp_path: Path) -> None:
    """A part of each sweep, and frames that fly back in a twentieth of their time: by the operator and by a fit."""
    shape = {"pixels": 512, "lines": 152, "turn": (0.5, 0.95), "window": (0.05, 0.95)}
    frame = old_frame(plant, **shape)
    images = read_scan(*save_pair(frame, tmp_path), Choice())
    x = OldAxis(size_v=V, offset_v=OFFSET_V, window=(0.05, 0.95))
    taken = OldScan(x=x, y=OldAxis(turn=0.95), rate_hz=RATE_HZ)
    fitted, _ = by_fit(images, taken, lattice_nm=60.0)
    operator = by_scanner(images, scanner_file(plant, tmp_path), taken)
    for scan in (fitted, operator):
        found = off(scan.distortion, frame)
        assert found.x < REACH_PERCENT
        check_agreement(scan)
        assert np.isfinite(scan.pictures[0].heights).mean() > 0.94
    assert off(fitted.distortion, frame).y < REACH_PERCENT


def test_the_laws_are_inverted_and_not_expanded(tmp_path: Path) -> None:
    """An axis that obeys (17) and (22) as printed, by bisection: off by a thousandth of the first order's 0.8 %."""
    frame = old_frame("paper", pixels=128, lines=96, noise=0.0)
    (tmp_path / "scanner.toml").write_text(LAWS, "utf-8")
    scan = by_scanner(read_scan(*save_pair(frame, tmp_path), Choice()), tmp_path / "scanner.toml", TAKEN)
    found = off(scan.distortion, frame)
    assert found.x < 0.003
    assert found.y < 0.003
    assert found.size == pytest.approx((0.0, 0.0), abs=0.01)
    assert scan.agreement is not None
    assert scan.agreement.difference[1] < 0.05  # nine pixels a period, interpolated


@pytest.mark.common
def test_a_trace_alone_by_a_fit(tmp_path: Path) -> None:
    frame = old_frame("bouc-wen", **DRIFT)
    scan, fit = by_fit(read_scan(save_pair(frame, tmp_path)[0], None, Choice()), OldScan(), lattice_nm=60.0)
    assert fit.tells_y
    assert scan.agreement is None
    both = replace(scan.distortion, backward=scan.distortion.forward)  # judged as if the retrace were another trace
    found = off(both, FrameImages(frame.trace, frame.trace))
    assert found.x < REACH_PERCENT
    assert found.y < REACH_PERCENT


@pytest.mark.common
def test_a_retrace_alone_is_fitted_as_the_trace_of_the_mirror_image(tmp_path: Path) -> None:
    """Each pixel of the retrace is where it was, with neither trace nor scanner file."""
    frame = old_frame("bouc-wen", **DRIFT)
    _, retrace = save_pair(frame, tmp_path)
    both = read_scan(retrace, None, Choice())
    alone = replace(both, channels=(replace(both.channels[0], direction="retrace"),), forward=(False,))
    scan, fit = by_fit(alone, OldScan(), lattice_nm=60.0)
    assert fit.tells_y
    assert scan.record["retrace_alone"]
    assert scan.distortion.forward is None
    twice = replace(scan.distortion, forward=scan.distortion.backward)
    found = off(twice, FrameImages(frame.retrace, frame.retrace))
    assert found.x < REACH_PERCENT
    assert found.y < REACH_PERCENT


@pytest.mark.common
def test_a_grating_tells_the_fast_axis_alone(tmp_path: Path) -> None:
    frame = old_frame("plays", surface=grating(50.0))
    scan, fit = by_fit(read_scan(*save_pair(frame, tmp_path), Choice()), OldScan(), pitch_nm=50.0)
    found = off(scan.distortion, frame)
    assert not fit.tells_y
    assert found.x < REACH_PERCENT
    assert found.size[0] == pytest.approx(0.0, abs=0.5)
    assert found.y > 3.0  # what its y was, it is
    assert scan.record["slow_axis"].startswith("as taken")
    assert np.array_equal(scan.distortion.y, np.linspace(0.0, scan.distortion.y[-1], 129))


@pytest.mark.common
def test_a_wrong_drive_is_seen_without_the_truth(tmp_path: Path) -> None:
    """What trace against retrace is printed for: at half the drive they stay apart, where the noise is 17 %."""
    images, scanner = by_laws(tmp_path)
    right = by_scanner(images, scanner, TAKEN)
    wrong = by_scanner(images, scanner, OldScan(x=OldAxis(size_v=45.0), rate_hz=RATE_HZ))
    assert right.agreement is not None
    assert wrong.agreement is not None
    assert right.agreement.difference[1] < 0.2
    assert wrong.agreement.difference[1] > 2.5 * right.agreement.difference[1]


def by_laws(folder: Path) -> tuple[Images, Path]:
    """A frame of an axis that obeys the laws, and its scanner file."""
    (folder / "scanner.toml").write_text(LAWS, "utf-8")
    return read_scan(*save_pair(old_frame("paper"), folder), Choice()), folder / "scanner.toml"


@pytest.mark.common
def test_mirrored_and_exchanged_images_are_named(tmp_path: Path) -> None:
    _, scanner = by_laws(tmp_path)
    trace, retrace = tmp_path / "trace.npy", tmp_path / "retrace.npy"
    with pytest.raises(Unphysical, match="exchanged"):
        by_scanner(read_scan(retrace, trace, Choice()), scanner, TAKEN)
    mirrored = tmp_path / "mirrored.npy"
    np.save(mirrored, np.load(retrace)[:, ::-1])
    with pytest.raises(Unphysical, match="give --retrace-mirrored"):
        by_scanner(read_scan(trace, mirrored, Choice()), scanner, TAKEN)
    as_stored = by_scanner(read_scan(trace, mirrored, Choice(retrace_mirrored=True)), scanner, TAKEN)
    as_seen = by_scanner(read_scan(trace, retrace, Choice()), scanner, TAKEN)
    assert np.array_equal(as_stored.pictures[1].heights, as_seen.pictures[1].heights, equal_nan=True)
    with pytest.raises(Unphysical, match="leave --retrace-mirrored out"):
        by_scanner(read_scan(trace, retrace, Choice(retrace_mirrored=True)), scanner, TAKEN)


def test_the_lattice_is_the_one_of_the_frames() -> None:
    """A negative control of the measure: a frame as it was taken is off by percents."""
    from tablegen.correction.distortion import Distortion, Sweep1D

    frame = old_frame("default", surface=LATTICE, pixels=64, lines=64)
    even = (np.arange(64) + 0.5) / 64
    taken = Distortion(
        64,
        64,
        Sweep1D(even, 0.5 * even),
        Sweep1D(even, 1.0 - 0.5 * even),
        np.arange(65) / 64,
        np.zeros(65),
    )
    found = off(taken, frame)
    assert found.x > 3.0
    assert found.y > 1.0
