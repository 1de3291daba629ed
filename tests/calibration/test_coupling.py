"""Coupling of the axes from simulated images and records: within its errors, and none where there is none."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from editing import run
from hypothesis import given
from hypothesis import strategies as st

import tablegen
from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.calibration.laws.coupling import onto_earlier
from tablegen.fitting.estimate import Estimate
from tablegen.numerics.arrays import Floats
from tablegen.virtual.imaging import Conditions, Surface, hexagonal, triangle_frame
from tablegen.virtual.parameters import load_truth
from tablegen.virtual.scanner import VirtualScanner

CELL_NM, SIZE_NM, PIXELS = 17.7, 180.0, 128
Coupling = tuple[float, float]  # x_per_y, y_per_x
NONE = (0.0, 0.0)


def shear(coupling: Coupling) -> float:
    """x_per_y of axes at the same angle to each other, of which x moves along x alone."""
    return float(np.tan(np.arctan(coupling[0]) + np.arctan(coupling[1])))


def image(lies: float, coupling: Coupling, angle_deg: float, way: str, drift: Coupling = NONE, seed: int = 0) -> Floats:
    """Heights of a lattice at an angle ``lies`` by coupled axes; drift along x and y in sizes of the image, over it."""
    along, time = np.meshgrid(*2 * [(np.arange(PIXELS) + 0.5) / PIXELS])
    across = time if way == "up" else 1.0 - time
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    u, v = c * along - s * across, s * along + c * across
    x = SIZE_NM * (u + coupling[0] * v - drift[0] * time)
    y = SIZE_NM * (v + coupling[1] * u - drift[1] * time)
    heights = hexagonal(CELL_NM, lies)(x, y)
    return np.asarray(heights + 0.05 * np.ptp(heights) * np.random.default_rng(seed).standard_normal(heights.shape))


def trial(seed: int) -> tuple[float, Coupling, Coupling]:
    """Where the lattice lies, the coupling, and the drift of a seed."""
    random = np.random.default_rng(seed)
    (x, y), drift = random.uniform(-0.06, 0.06, 2).tolist(), random.uniform(-0.03, 0.03, 2).tolist()
    return random.uniform(0.0, 60.0), (x, y), (drift[0], drift[1])


def near(estimate: Estimate, truth: float) -> bool:
    """Within four standard errors, which are small."""
    assert estimate.standard_error < 0.003
    return abs(estimate.value - truth) < 4.0 * estimate.standard_error


@pytest.mark.common
@pytest.mark.parametrize("others", [[(0.0, "down")], [(90.0, "up")], [(180.0, "up")]], ids=["down", "90", "180"])
@pytest.mark.parametrize("seed", [1, 2])
def test_the_shear_is_told_from_drift(seed: int, others: list[tuple[float, str]]) -> None:
    lies, coupling, drift = trial(seed)
    scans = [(0.0, "up"), *others]
    images = [(at, way, image(lies, coupling, at, way, drift, 10 * seed + k)) for k, (at, way) in enumerate(scans)]
    fit = tablegen.calibrate_coupling(images=images, lattice_nm=CELL_NM)  # type: ignore[arg-type]
    assert near(fit.values["x_per_y"], shear(coupling))
    assert fit.values["y_per_x"].value == 0.0
    assert not fit.doubts
    assert fit.fit.drift is not None
    assert fit.fit.drift[0].value == pytest.approx(drift[0], abs=0.004)
    one = tablegen.calibrate_coupling(images=images[:1], lattice_nm=CELL_NM)  # type: ignore[arg-type]
    assert not near(one.values["x_per_y"], shear(coupling))
    assert "drift along the lines looks like coupling" in one.summary()


@pytest.mark.rest
def test_the_standard_errors_are_those_of_the_scatter() -> None:
    """Of frames up and down with drift and noise, six samples."""
    ratios = []
    for seed in range(6):
        lies, coupling, drift = trial(seed + 20)
        images = [
            (0.0, way, image(lies, coupling, 0.0, way, drift, 2 * seed + k)) for k, way in enumerate(("up", "down"))
        ]
        fit = tablegen.calibrate_coupling(images=images, lattice_nm=CELL_NM)  # type: ignore[arg-type]
        shown = fit.values["x_per_y"]
        ratios.append((shown.value - shear(coupling)) / shown.standard_error)
    assert 0.3 < np.sqrt(np.mean(np.square(ratios))) < 1.5


def test_a_known_direction_tells_both_values() -> None:
    lies, coupling, drift = trial(3)
    # The waves of the surface are at ``lies``, so the sides of its cell are 30 degrees further.
    images = [(0.0, way, image(lies, coupling, 0.0, way, drift)) for way in ("up", "down")]
    fit = tablegen.calibrate_coupling(
        images=images, lattice_nm=CELL_NM, lies_deg=(lies + 30.0, 0.02)  # type: ignore[arg-type]
    )  # fmt: skip
    assert near(fit.values["x_per_y"], coupling[0])
    assert near(fit.values["y_per_x"], coupling[1])
    vague = tablegen.calibrate_coupling(
        images=images, lattice_nm=CELL_NM, lies_deg=(lies + 30.5, 0.5)  # type: ignore[arg-type]
    )  # fmt: skip
    assert np.radians(0.5) < 1.1 * vague.values["y_per_x"].standard_error < 0.03


def test_without_coupling_there_is_none(tmp_path: Path) -> None:
    images = [(0.0, way, image(11.0, NONE, 0.0, way, (0.02, 0.0), seed)) for seed, way in enumerate(("up", "down"))]
    fit = tablegen.calibrate_coupling(images=images, lattice_nm=CELL_NM)  # type: ignore[arg-type]
    assert "no coupling is seen" in fit.doubts[0]
    with pytest.raises(Rejected, match="coupling: no coupling is seen"):
        fit.write(tmp_path / "scanner.toml")


def coupled(surface: Surface, coupling: Coupling, way: str) -> Surface:
    """The surface as axes see it that move along each other, y down or up."""
    sign = 1.0 if way == "up" else -1.0
    return lambda x, y: surface(x + coupling[0] * sign * y, sign * y + coupling[1] * x)


@pytest.mark.rest
@pytest.mark.parametrize("name", ["default", "duhem"])
def test_a_scanner_with_hysteresis(name: str) -> None:
    """Triangles on both axes of a virtual scanner: lines and rows are bowed, and differ in size."""
    scanner, coupling = VirtualScanner.of(load_truth(name)), (0.03, -0.012)
    images = []
    for seed, way in enumerate(("up", "down")):
        frame = triangle_frame(
            scanner.x, scanner.y, coupled(hexagonal(CELL_NM, 19.0), coupling, way), (16.0, 16.0), (40.0, 60.0), 5.0,
            Conditions(seed=seed), PIXELS, PIXELS,
        )  # fmt: skip
        images.append((0.0, way, frame.trace.heights))
    fit = tablegen.calibrate_coupling(images=images, lattice_nm=CELL_NM)  # type: ignore[arg-type]
    assert near(fit.values["x_per_y"], shear(coupling))


def test_an_angle_that_shows_no_coupling_is_refused() -> None:
    with pytest.raises(Unphysical, match="show the sizes of the axes, and not their coupling; scan at 0 or 90 degrees"):
        tablegen.calibrate_coupling(images=[(45.0, "up", image(11.0, NONE, 45.0, "up"))], lattice_nm=CELL_NM)


def test_another_lattice_is_refused() -> None:
    heights = image(11.0, NONE, 0.0, "up")
    with pytest.raises(Unphysical, match=r"trace: the cell differs from the sample's by a factor of 1\.7"):
        tablegen.calibrate_coupling(images=[(0.0, "up", heights)], lattice_nm=CELL_NM, lattice="square")


def test_a_sample_that_was_turned_is_told() -> None:
    images = [(at, "up", image(lies, NONE, at, "up")) for at, lies in ((0.0, 11.0), (180.0, 13.0))]
    fit = tablegen.calibrate_coupling(images=images, lattice_nm=CELL_NM)  # type: ignore[arg-type]
    assert "the sample was turned between them" in fit.summary()


def moving(axis: int, slope: float, drift_nm: float = 0.0, seed: int = 0) -> dict[str, Floats]:
    """Positions of both axes while one moves to and fro, with a drift of the other's sensor and noise of 0.2 nm."""
    time = np.arange(2000) / 2000
    moves = 500.0 * np.sin(2.0 * np.pi * 6.0 * time)
    rests = slope * moves + drift_nm * time
    noise = 0.2 * np.random.default_rng(seed).standard_normal((2, 2000))
    both = (moves, rests) if axis == 0 else (rests, moves)
    return {"time_s": time, "x_nm": both[0] + noise[0], "y_nm": both[1] + noise[1]}


@pytest.mark.parametrize("drift_nm", [0.0, 30.0])
def test_records_of_sensors(drift_nm: float) -> None:
    records = [moving(0, 0.021, drift_nm), moving(1, -0.013, drift_nm, 1)]
    fit = tablegen.calibrate_coupling(records)
    assert near(fit.values["y_per_x"], 0.021)
    assert near(fit.values["x_per_y"], -0.013)
    assert fit.values["x_per_y"].standard_error < 1e-4
    alone = tablegen.calibrate_coupling(records[:1])
    assert list(alone.values) == ["y_per_x"]
    assert "x_per_y is not measured, and stays as it is: record both sensors while y moves" in alone.summary()


def test_one_sweep_does_not_tell_drift() -> None:
    ramp = np.linspace(0.0, 500.0, 400)
    fit = tablegen.calibrate_coupling({"x_nm": ramp, "y_nm": 0.01 * ramp})
    assert fit.values["y_per_x"].value == pytest.approx(0.01)
    assert "one sweep does not tell drift of a sensor from coupling" in fit.summary()


@pytest.mark.parametrize(
    ("record", "says"),
    [
        (lambda x: {"x_nm": x, "y_nm": 0.8 * x}, "both axes move"),
        (lambda x: {"x_nm": 0.0 * x, "y_nm": 0.0 * x}, "neither axis moves"),
        (lambda x: {"x_nm": x[:20], "y_nm": 0.0 * x[:20]}, "20 samples are too few; 64 do"),
    ],
)
def test_records_that_show_nothing_are_refused(record: Callable[[Floats], dict[str, Floats]], says: str) -> None:
    with pytest.raises(Unphysical, match=says):
        tablegen.calibrate_coupling(record(np.tile(np.linspace(0.0, 500.0, 200), 2)))


couplings = st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))


@given(couplings, couplings)
def test_what_corrected_images_show_comes_on_top(true: Coupling, earlier: Coupling) -> None:
    """The map that is left, with 1 on its diagonal, times the earlier one is the true one."""
    whole, undone = (np.array([[1.0, one[0]], [one[1], 1.0]]) for one in (true, earlier))
    left = whole @ np.linalg.inv(undone)
    # Sizes of axes are calibrated apart, so columns of the true map have any length, and rows of what is left too.
    shown = {"x_per_y": Estimate(left[0, 1] / left[1, 1], 0.0), "y_per_x": Estimate(left[1, 0] / left[0, 0], 0.0)}
    values = onto_earlier(shown, earlier)
    assert values["x_per_y"].value == pytest.approx(true[0], abs=5e-3)
    assert values["y_per_x"].value == pytest.approx(true[1], abs=5e-3)
    alike = onto_earlier({key: Estimate(0.0, 0.0) for key in shown}, earlier)
    assert (alike["x_per_y"].value, alike["y_per_x"].value) == pytest.approx(earlier)


SCANNER = """name = "afm"
v_max = 100.0  # V

# calibrate size: 5 points
[x.size]
k_nm_per_v = 10.0  # by a grating
"""


def write_record(path: Path, axis: int, slope: float) -> Path:
    """A CSV of both sensors."""
    columns = moving(axis, slope)
    rows = "\n".join(",".join(f"{value:.9g}" for value in row) for row in zip(*columns.values(), strict=True))
    path.write_text(f"{','.join(columns)}\n{rows}\n", "utf-8")
    return path


def test_the_command_writes_the_scanner_file(tmp_path: Path) -> None:
    scanner = tmp_path / "scanner.toml"
    scanner.write_text(SCANNER, "utf-8")
    records = [write_record(tmp_path / "x.csv", 0, 0.021), write_record(tmp_path / "y.csv", 1, -0.013)]
    outcome = run("calibrate", "coupling", *records, "--scanner", scanner, "--write")
    assert outcome.status == 0, outcome.err
    assert outcome.out.splitlines()[-1] == f"{scanner}: coupling written"
    text = scanner.read_text("utf-8")
    assert text.startswith(SCANNER)
    assert "# calibrate coupling: 2 records\n# from x.csv, sha256 " in text
    assert "\n[coupling]\n" in text
    again = run("calibrate", "coupling", *records, "--scanner", scanner, "--write")
    assert again.out.splitlines()[-1] == f"{scanner}: coupling up to date"
    assert scanner.read_text("utf-8") == text
    none = write_record(tmp_path / "none.csv", 0, 0.0)
    refused = run("calibrate", "coupling", none, "--scanner", scanner, "--write")
    assert refused.status == 2
    assert f"{scanner}: coupling: no coupling is seen" in refused.err
    forced = run("calibrate", "coupling", none, "--scanner", scanner, "--write", "--force")
    assert forced.status == 0
    assert "# calibrate coupling: 1 record, meaningless, written by --force" in scanner.read_text("utf-8")
    assert "x_per_y = -0.01" in scanner.read_text("utf-8")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((), "give RECORD.CSV of both sensors, or --image"),
        (("--image", "0", "up", "a.npy"), "images need the lattice of their sample"),
        (("x.csv", "--lattice-nm", "17.7"), "--lattice-nm is for images"),
        (("x.csv", "--write"), "--write needs --scanner FILE"),
        (("--image", "nan", "up", "a.npy", "--lattice-nm", "17.7"), "nan is not a finite number"),
        (("--image", "0", "left", "a.npy", "--lattice-nm", "17.7"), "'left' is not one of 'up', 'down'"),
        (("missing.csv",), "missing.csv"),
    ],
)
def test_wrong_arguments_are_named(arguments: tuple[str, ...], says: str) -> None:
    outcome = run("calibrate", "coupling", *arguments)
    assert outcome.status == 2
    assert says in outcome.err


def test_what_a_file_says_of_its_scan_is_checked(tmp_path: Path) -> None:
    """A Gwyddion simple field has neither angle nor way; an image that was read may have both."""
    path = tmp_path / "a.npy"
    np.save(path, image(11.0, (0.03, 0.0), 0.0, "up"))
    read = tablegen.read_image(path)
    for values, says in (({"angle_deg": 90.0}, "a scan angle of 90 degrees"), ({"first_row": "top"}, "goes down")):
        stated = tablegen.Image(read.scan.__class__(**{**vars(read.scan), **values}))  # type: ignore[arg-type]
        with pytest.raises(Rejected, match=says):
            tablegen.calibrate_coupling(images=[(0.0, "up", stated)], lattice_nm=CELL_NM)
