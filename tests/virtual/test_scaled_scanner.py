"""The built-in scanner in the volts and nanometres of another scanner file."""

from pathlib import Path

import numpy as np
import pytest
from editing import SCAN, SCANNER, edited, write_pair

from tablegen.config.load import Setup, load
from tablegen.virtual.calibration_day import calibrate
from tablegen.virtual.parameters import BUILT_IN, load_truth
from tablegen.virtual.scaling import scaled_to
from tablegen.virtual.scanner import VirtualAxis, VirtualScanner
from tablegen.virtual.simulation import simulate

EXAMPLES = Path(__file__).parents[2] / "examples"
# v_max, nm/V, and the converter's range with the amplifier's gain and bias.
SCANNERS = (
    (150.0, 67.0, (0.0, 10.0, 15.0, 0.0)),
    (150.0, 67.0, (-10.0, 10.0, -7.5, 75.0)),
    (75.0, 3.0, (0.0, 5.0, 15.0, 0.0)),
    (1000.0, 5000.0, (-10.0, 10.0, 50.0, 500.0)),
    (100.0, 15.0, (-5.0, 5.0, 10.0, 50.0)),
)


@pytest.fixture(scope="module", params=BUILT_IN)
def built_in(request: pytest.FixtureRequest) -> VirtualScanner:
    """As it is in the package."""
    return VirtualScanner.of(load_truth(str(request.param)))


def foreign(
    folder: Path,
    v_max: float,
    k: float,
    converter: tuple[float, ...],
    *edits: str,
    share: float = 0.2,
    linear: bool = False,
) -> Setup:
    """The example on a scanner of another range and size, its sizes and its base at this share of both."""
    low, high, gain, bias = converter
    size = share * k * v_max
    scanner = edited(SCANNER, f"v_max = {v_max}", *(f"{a}.size.k_nm_per_v = {k}" for a in "xy"))
    scanner = edited(scanner, *(f"{a}.size.base_nm = {0.2 * k * v_max}" for a in "xy"))
    if linear:
        scanner = edited(scanner, "x.size.beta = 0.0", "y.size.beta = 0.0")
    scan = edited(SCAN, "timing.lines = 20", "y.band_limit.harmonics = 16", "amplifier.max_slew_v_per_s = 1e9")
    scan = edited(scan, f"dac.v_min = {low}", f"dac.v_max = {high}", f"amplifier.gain = {gain}")
    scan = edited(scan, f"amplifier.bias_v = {bias}", *(f"{a}.size_nm = {size}" for a in "xy"))
    scan = edited(scan, *(f"{a}.offset_v = {0.5 * v_max}" for a in "xy"), *edits)
    return load(write_pair(folder, scan, scanner))


@pytest.mark.common
@pytest.mark.parametrize(("v_max", "k", "converter"), SCANNERS)
def test_sizes_are_right_without_compensation(
    tmp_path: Path, built_in: VirtualScanner, v_max: float, k: float, converter: tuple[float, ...]
) -> None:
    found = []
    for share, offset in ((0.2, 0.15), (0.6, 0.5)):
        setup = foreign(tmp_path, v_max, k, converter, f"x.offset_v = {offset * v_max}", share=share)
        scanner, how = scaled_to(built_in, setup.scanner)
        assert how == f"scaled to 0..{v_max:g} V, {k:g} nm/V in x and {k:g} nm/V in y"
        run = simulate(setup, scanner, "triangle")
        found += [run.x.size_error_percent, run.y.size_error_percent]
        assert 1.0 < abs(run.x.error.forward.peak[0]) < 10.0  # % of the line: hysteresis as it is on the built-in one
    assert np.max(np.abs(found)) < 3.0


def test_without_a_size_law_the_error_is_that_of_the_shape(tmp_path: Path, built_in: VirtualScanner) -> None:
    setup = foreign(tmp_path, *SCANNERS[0], share=0.65, linear=True)
    run = simulate(setup, scaled_to(built_in, setup.scanner)[0], "triangle")
    assert 10.0 < run.x.size_error_percent < 30.0


def test_the_scanner_that_it_is_like_plays_it_as_it_is(tmp_path: Path, built_in: VirtualScanner) -> None:
    setup = load(write_pair(tmp_path))
    scanner, how = scaled_to(built_in, setup.scanner)
    assert scanner is built_in
    assert how == ""


def test_a_scaled_axis_is_the_same_in_normalised_volts(tmp_path: Path, built_in: VirtualScanner) -> None:
    setup = foreign(tmp_path, *SCANNERS[0])
    axis = scaled_to(built_in, setup.scanner)[0].x
    share = 0.5 + 0.2 * np.sin(2.0 * np.pi * np.arange(500) / 500)
    before, after = built_in.x.settled(100.0 * share, 1e-5), axis.settled(150.0 * share, 1e-5)
    assert after / before == pytest.approx(after[0] / before[0])
    assert after[0] / before[0] == pytest.approx(10.05, rel=0.05)  # 150 V of 67 nm/V over 100 V of 10 nm/V
    assert axis.follow(150.0 * share, 1e-5) / built_in.x.follow(100.0 * share, 1e-5) == pytest.approx(
        after[0] / before[0]
    )
    assert np.array_equal(axis.response([10.0, 5e4]), built_in.x.response([10.0, 5e4]))


def peak_hz(axis: VirtualAxis) -> float:
    """Where its response is largest, to 1 %."""
    f = np.geomspace(100.0, 1e6, 2000)
    return float(f[np.argmax(np.abs(axis.response(f)))])


def test_a_low_resonance_is_that_of_the_file(tmp_path: Path, built_in: VirtualScanner) -> None:
    slow = edited(SCANNER, "x.resonance.frequency_hz = 1800.0", "x.resonance.quality = 25.0")
    scanner, how = scaled_to(built_in, load(write_pair(tmp_path, scanner=slow)).scanner)
    assert how.endswith(", a resonance of 1800 Hz in x")
    assert peak_hz(scanner.x) == pytest.approx(1800.0, rel=0.02)
    assert peak_hz(scanner.y) == pytest.approx(peak_hz(built_in.y))
    assert scanner.x.response(0.0) == pytest.approx(built_in.x.response(0.0), rel=1e-6)
    # The same form: as far above its resonance as the built-in one is above its own.
    asked = np.array([0.3, 0.7, 1.1, 3.0])
    moved, before = scanner.x.resonance.response(1800.0 * asked), built_in.x.resonance.response(5e4 * asked)
    assert moved == pytest.approx(before, rel=1e-9)


@pytest.mark.parametrize(("frequency_hz", "stays"), [(26e3, True), (99e3, True), (24e3, False), (101e3, False)])
def test_a_resonance_that_is_near_stays(
    tmp_path: Path, built_in: VirtualScanner, frequency_hz: float, stays: bool
) -> None:
    near = edited(SCANNER, f"x.resonance.frequency_hz = {frequency_hz}")
    scanner, how = scaled_to(built_in, load(write_pair(tmp_path, scanner=near)).scanner)
    assert (scanner is built_in, how == "") == (stays, stays)


@pytest.mark.common
def test_the_tube_of_the_examples_is_calibrated_through_its_resonance() -> None:
    """Its converter and its amplifiers stand in the scanner file, and go with the axes."""
    setup = load(EXAMPLES / "tube_5um.toml")
    scanner, _ = scaled_to(VirtualScanner.of(load_truth("default")), setup.scanner)
    calibrated = calibrate(setup, scanner).setup
    for name in ("x", "y"):
        before, after = getattr(setup.scanner, name), getattr(calibrated.scanner, name)
        assert (after.dac, after.amplifier) == (before.dac, before.amplifier)
    assert calibrated.scanner.x.resonance is not None
    assert calibrated.scanner.x.resonance.frequency_hz == pytest.approx(1800.0, rel=0.01)
    run = simulate(calibrated, scanner, "harmonic")
    assert max(abs(run.x.size_error_percent), abs(run.y.size_error_percent)) < 1.0
