"""Width, height and shear of a picture by the cell of its lattice, where no displacement can be fitted."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from distorted_lattices import images_of, without_period
from editing import run
from instrument_files import sxm
from real_files import real_folder

from tablegen.base.input_errors import Unphysical
from tablegen.correction.by_affine_map import by_affine_map
from tablegen.correction.by_fit import by_fit
from tablegen.correction.lattice_bow import lattice_bows
from tablegen.correction.old_scan import OldScan
from tablegen.correction.scan_images import Choice, Images, read_scan
from tablegen.numerics.arrays import Floats

pytestmark = pytest.mark.common

REAL = real_folder()
SIDE_NM = 10.0
ROWS, COLUMNS = 120, 128


def lattice(x: Floats, y: Floats, degrees: float = 60.0, turn: float = 0.3) -> Floats:
    """Return heights of a lattice at x and y in nm: both base waves, and for 60 degrees the third one of a star."""
    cell = SIDE_NM * np.array([[np.cos(turn + a), np.sin(turn + a)] for a in (0.0, np.radians(degrees))])
    waves = np.linalg.inv(cell).T
    star = [waves[0], waves[1], waves[0] + waves[1]][: 3 if degrees == 60.0 else 2]
    return np.sum([np.cos(2.0 * np.pi * (u * x + v * y)) for u, v in star], axis=0)


def picture(
    width_nm: float = 100.0,
    height_nm: float = 100.0,
    shear_nm: float = 0.0,
    bow: float = 0.0,
    wave: float = 0.0,
    moved_pixels: float = 0.0,
    degrees: float = 60.0,
    noise: float = 0.3,
    seed: int = 1,
) -> Floats:
    """Return an image of a frame of this size, its last row further right by ``shear_nm``.

    Its lines are bent by a parabola with the sagitta ``bow``, and by a ``wave``, both as shares of the width.
    """
    row, column = np.mgrid[:ROWS, :COLUMNS].astype(np.float64)
    across, along = (column - moved_pixels + 0.5) / COLUMNS, (row + 0.5) / ROWS
    bent = 4.0 * bow * across * (1.0 - across) + wave * np.sin(2.0 * np.pi * across)
    x = width_nm * (across + bent) + shear_nm * (along - 0.5)
    return lattice(x, height_nm * along, degrees) + noise * np.random.default_rng(seed).normal(size=x.shape)


def file_of(
    trace: Floats, retrace: Floats | None = None, size_nm: tuple[float, float] | None = (100.0, 100.0)
) -> Images:
    images = images_of(trace, trace if retrace is None else retrace, size_nm)
    return (
        images
        if retrace is not None
        else replace(images, channels=images.channels[:1], forward=(True,), reference=(0,))
    )


@pytest.mark.parametrize("degrees", [60.0, 90.0])
def test_width_height_and_shear_by_the_constant(degrees: float) -> None:
    """The file says 100 x 100 nm, the frame was 92 x 108 nm, and its last row 9 nm further right than its first."""
    kind = {60.0: "hexagonal", 90.0: "square"}[degrees]
    scan = by_affine_map(file_of(picture(92.0, 108.0, 9.0, degrees=degrees)), SIDE_NM, kind)
    affine = scan.record["affine"]
    for name, truth in (("width_factor", 0.92), ("height_factor", 1.08), ("shear_nm", 9.0)):
        measured = affine[name]
        assert measured["value"] == pytest.approx(truth, abs=3.0 * measured["standard_error"] + 1e-3 * truth), name
        assert measured["standard_error"] < 0.01 * (100.0 if name == "shear_nm" else 1.0)
    assert scan.size_nm == pytest.approx((92.0, 108.0), rel=0.01)
    assert scan.record["not_corrected"] == "displacement within lines and between rows"


def test_the_corrected_picture_is_that_of_the_straight_frame() -> None:
    """Every pixel shows the lattice where the sample has it, the rotation and the place aside."""
    scan = by_affine_map(file_of(picture(92.0, 108.0, 9.0, noise=0.0)), SIDE_NM, "hexagonal")
    x, y = scan.distortion.grid
    middle = x[0] - 0.5 * (x[1] - x[0]), y[0] - 0.5 * (y[1] - y[0])
    truth = lattice(*np.meshgrid(x - middle[0], y - middle[1]))
    heights = scan.pictures[0].heights
    imaged = np.isfinite(heights)
    assert 0.85 < np.mean(imaged) < 1.0
    assert np.corrcoef(heights[imaged], truth[imaged])[0, 1] > 0.98


def test_shape_alone_where_the_constant_is_unknown() -> None:
    """The width of the file stands: height and shear follow in its proportion."""
    scan = by_affine_map(file_of(picture(92.0, 108.0, 9.2)), None, "hexagonal")
    assert scan.size_nm == pytest.approx((100.0, 100.0 * 108.0 / 92.0), rel=0.01)
    assert scan.record["affine"]["width_factor"] == {"value": 1.0, "standard_error": 0.0}
    assert scan.record["affine"]["shear_nm"]["value"] == pytest.approx(10.0, abs=1.0)


def test_levelled_rows_do_not_shift_the_cell() -> None:
    """A wave of 1.4 periods along the rows loses power when they are levelled: the shear was off by 2 %."""
    frame = picture(0.95 * 43.0, 1.0355 * 43.0, -0.1276 * 0.95 * 43.0, noise=0.1)
    affine = by_affine_map(file_of(frame, size_nm=(43.0, 43.0)), SIDE_NM, "hexagonal").record["affine"]
    assert affine["shear_nm"]["value"] == pytest.approx(-0.1276 * 0.95 * 43.0, abs=0.006 * 43.0)


def test_some_three_periods_in_both_directions() -> None:
    """Trace and retrace are 5 pixels apart: each is moved by half of it."""
    frame = {"width_nm": 28.0, "height_nm": 30.0, "shear_nm": 2.2, "noise": 0.3}
    images = file_of(picture(**frame), picture(**frame, moved_pixels=-5.0, seed=2), (28.0, 28.0))
    with pytest.raises(Unphysical, match=r"periods.*; --affine --lattice hexagonal corrects width, height and shear"):
        by_fit(images, OldScan(), lattice_nm=SIDE_NM, kind="hexagonal")
    scan = by_affine_map(images, SIDE_NM, "hexagonal")
    assert scan.record["affine"]["height_factor"]["value"] == pytest.approx(30.0 / 28.0, rel=0.02)
    assert scan.record["affine"]["shear_nm"]["value"] == pytest.approx(2.2, abs=0.4)
    assert scan.record["affine"]["retrace_shift_pixels"] == pytest.approx([-5.0, 0.0], abs=0.3)
    assert scan.agreement is not None
    assert scan.agreement.worst is not None
    before, after = scan.agreement.worst
    assert before > 4.5
    assert after < 1.0


def test_the_retrace_alone() -> None:
    images = replace(file_of(picture(92.0, 108.0, 9.0)), forward=(False,))
    scan = by_affine_map(images, SIDE_NM, "hexagonal")
    assert scan.distortion.forward is None
    assert list(scan.record["affine"]["bows_percent"]) == ["retrace"]


@pytest.mark.parametrize("bow", [-0.03, 0.0, 0.03])
def test_a_bow_is_measured(bow: float) -> None:
    turn = 0.3
    cell = SIDE_NM * np.array([[np.cos(turn + a), np.sin(turn + a)] for a in (0.0, np.pi / 3.0)])
    bows = lattice_bows(picture(bow=bow), cell * [COLUMNS / 100.0, ROWS / 100.0])
    assert bows is not None
    for measured, truth in ((bows.line, bow), (bows.rows_x, 0.0), (bows.rows_y, 0.0)):
        assert measured.value == pytest.approx(truth, abs=3.0 * measured.standard_error + 2e-3)
        assert 0.0 < measured.standard_error < 0.01


@pytest.mark.parametrize(
    ("image", "constant", "reason"),
    [
        (
            picture(bow=0.04),
            SIDE_NM,
            r"the lines along x are bent by 4.* % of the picture, which an affine",
        ),
        (picture(shear_nm=22.0), SIDE_NM, r"as a hexagonal lattice the frame would be .* are plausible"),
        (picture(92.0, 108.0), 1.5 * SIDE_NM, "the lattice is ambiguous: the cell may be "),
        (picture(100.0, 100.0), None, "the cell is hexagonal within its errors: there is no affine"),
        (np.random.default_rng(1).normal(size=(128, 128)), SIDE_NM, "no lattice stands out of the noise"),
    ],
)
def test_what_is_refused(image: Floats, constant: float | None, reason: str) -> None:
    with pytest.raises(Unphysical, match=reason):
        by_affine_map(file_of(image), constant, "hexagonal")


def test_directions_that_remain_apart_are_refused() -> None:
    """A wave in the lines is no bow, and leaves trace and retrace apart by more than a pixel."""
    images = file_of(
        picture(92.0, 108.0, 9.0, wave=0.01), picture(92.0, 108.0, 9.0, wave=-0.01, moved_pixels=4.0, seed=2)
    )
    with pytest.raises(Unphysical, match=r"trace and retrace are .* pixels apart after the affine map, and at most"):
        by_affine_map(images, SIDE_NM, "hexagonal")


def test_a_file_without_a_size_is_refused() -> None:
    with pytest.raises(Unphysical, match="--affine needs a file that has its size"):
        by_affine_map(file_of(picture(), size_nm=None), SIDE_NM, "hexagonal")


@pytest.mark.parametrize("seed", range(6))
def test_a_sample_without_a_lattice_has_no_affine_map(seed: int) -> None:
    for constant in (None, 100.0):
        with pytest.raises(Unphysical):
            by_affine_map(without_period(seed), constant, "hexagonal")


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    frame = {"width_nm": 46.0, "height_nm": 54.0, "shear_nm": 4.5, "noise": 0.1}
    trace, retrace = picture(**frame), picture(**frame, moved_pixels=2.0, seed=2)
    Path("a.sxm").write_bytes(sxm({"Z": (trace, retrace)}, (50.0, 50.0), times_s=(5e-3, 5e-3)))
    words = ("correct", "a.sxm", "--fit", "--affine", "--lattice-nm", "10", "--lattice", "hexagonal")
    outcome = run(*words, "-o", "b.npy")
    assert (outcome.status, outcome.err) == (0, "")
    for part in (
        "sample        hexagonal, 10 nm",
        "affine map    width x 0.9",
        "bow left      retrace: lines ",
        "along y\nsize          46",
        "note: the affine map leaves the displacement within lines and between rows",
    ):
        assert part in outcome.out
    assert Path("b.json").exists()


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("--fit", "--affine"), "--affine needs --lattice, the kind of the lattice"),
        (("--fit", "--affine", "--lattice", "square", "--pitch-nm", "9"), "and no --pitch-nm"),
        (("--affine", "--scanner", "s.toml"), "--affine are for --fit"),
        (("--fit", "--lattice", "square"), "without it, --affine corrects the shape alone"),
    ],
)
def test_contradictions_of_options(words: tuple[str, ...], reason: str) -> None:
    outcome = run("correct", "a.npy", *words)
    assert outcome.status == 2
    assert reason in " ".join(outcome.err.split())


if REAL is not None:  # else the run says so at its end

    def test_graphite_by_its_constant() -> None:
        images = read_scan(REAL / "hopg_11nm_iso28600.spm", None, Choice())
        scan = by_affine_map(images, 0.246, "hexagonal")
        assert scan.size_nm == pytest.approx((10.59, 12.66), rel=0.01)

    def test_a_moire_of_fewer_than_three_periods_is_hexagonal_afterwards() -> None:
        """Both directions have the same map by themselves."""
        images = read_scan(REAL / "moire_10nm.sxm", None, Choice())
        scan = by_affine_map(images, None, "hexagonal")
        assert scan.record["affine"]["shear_nm"]["value"] == pytest.approx(0.68, abs=0.1)
        assert scan.agreement is not None
        assert scan.agreement.worst == pytest.approx((5.77, 0.47), abs=0.05)

    def test_frames_of_a_movie_have_one_map() -> None:
        maps = []
        for frames in ((0, 8), (8, 16)):
            images = read_scan(REAL / "protein_lattice_100nm.asd", None, Choice(frames=frames))
            maps.append(by_affine_map(images, None, "hexagonal").record["affine"])
        for name in ("height_factor", "shear_nm"):
            first, second = (one[name] for one in maps)
            error = np.hypot(first["standard_error"], second["standard_error"])
            assert abs(first["value"] - second["value"]) < 2.5 * error, name

    def test_bent_rows_of_silicon_are_left_to_the_fit() -> None:
        images = read_scan(REAL / "si7x7_50nm.sxm", None, Choice())
        with pytest.raises(Unphysical, match=r"the rows along y are bent by -2\.1 \+- 0\.18 %"):
            by_affine_map(images, 2.688, "hexagonal")
