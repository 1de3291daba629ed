"""``tablegen calibrate size``, ``offset`` and ``operator`` from images, as their users meet them."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from calibrating import LATTICE_NM, PITCH_NM, actual, apparent, scan_of
from editing import Outcome, run
from image_writers import gwy

pytestmark = pytest.mark.common

DRIVES = (10.0, 30.0, 60.0, 100.0)
OFFSETS = (10.0, 30.0, 50.0, 70.0, 90.0)
SAMPLE = ["--lattice-nm", f"{LATTICE_NM}", "--pitch-nm", f"{PITCH_NM}"]


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Images of both kinds."""
    folder = tmp_path_factory.mktemp("images")
    random = np.random.default_rng(6)
    sizes = actual(np.array(DRIVES), 10.0, 0.53, 0.5, 200.0)
    at_13 = float(actual(np.array([13.0]), 10.0, 0.53, 0.5, 200.0)[0])
    looks = apparent(np.array(OFFSETS), 0.92, 1.25, 1.0)
    taken = [(f"{v:g}", scan_of(nm, v, random, 0.05, 128)) for nm, v in zip(sizes.tolist(), DRIVES, strict=True)]
    taken += [
        (f"at{at:g}", scan_of(at_13 / look, 13.0, random, 0.05, 128))
        for look, at in zip(looks.tolist(), OFFSETS, strict=True)
    ]
    for name, image in taken:
        np.save(folder / f"t{name}.npy", image.trace)
        np.save(folder / f"r{name}.npy", image.retrace)
    return folder


@pytest.fixture(autouse=True)
def here(images: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for path in images.iterdir():
        (tmp_path / path.name).symlink_to(path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def of_sizes(option: str = "--image") -> list[str]:
    return [word for v in DRIVES for word in (option, f"{v:g}", f"t{v:g}.npy", f"r{v:g}.npy")]


def size(*words: str) -> Outcome:
    return run("calibrate", "size", "--axis", "x", "--v-max", "100", *words)


def written() -> dict[str, object]:
    found: dict[str, object] = tomllib.loads(Path("s.toml").read_text("utf-8"))["x"]
    return found


def test_size_then_offset_from_images_alone() -> None:
    """From two commands, a scanner file with the constants that the images were made with."""
    done = size(*SAMPLE, *of_sizes(), "--scanner", "s.toml", "--write")
    assert done.status == 0
    assert "size of x, 4 images of t10.npy, r10.npy" in done.out
    table = written()["size"]
    assert table == pytest.approx({"k_nm_per_v": 10.0, "beta": 0.53, "v_threshold": 0.5, "base_nm": 200.0}, rel=0.03)
    words = [word for at in OFFSETS for word in ("--image", "13", f"{at:g}", f"tat{at:g}.npy", f"rat{at:g}.npy")]
    done = run("calibrate", "offset", "--axis", "x", *SAMPLE, *words, "--scanner", "s.toml", "--write", "--json")
    assert done.status == 0
    data = json.loads(done.out)
    assert [one["v_offset"] for one in data["images"]] == list(OFFSETS)
    assert data["parameters"]["centre_nm"]["value"] == pytest.approx(LATTICE_NM, rel=0.02)
    # The images were made with m as a factor of the size; the drive's is less, by the size law.
    assert written()["offset"] == pytest.approx({"m_minus": 0.925, "m_plus": 1.235}, abs=0.01)
    assert "# calibrate offset: 5 images" in Path("s.toml").read_text("utf-8")


def test_a_trace_alone_and_a_file_with_both() -> None:
    alone = size(*SAMPLE[:2], "--image", "10", "t10.npy", "--image", "30", "t30.npy", "r30.npy", "--json")
    assert alone.status in (0, 2)
    gwy(Path("both.gwy"), **{"Height trace": np.load("t10.npy"), "Height retrace": np.load("r10.npy")})
    found = [
        json.loads(size(*SAMPLE, *words, "--image", "100", "t100.npy", "r100.npy", "--json").out)["images"][0]
        for words in (
            ["--image", "10", "both.gwy"],
            ["--images", "10", "t10.npy", "r10.npy"],
            ["--image", "10", "t10.npy"],
        )
    ]
    assert found[0]["size_nm"] == found[1]["size_nm"]
    assert found[0]["open_percent"] is not None
    assert found[2]["open_percent"] is None
    assert found[2]["size_nm"]["standard_error"] > found[1]["size_nm"]["standard_error"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([*of_sizes()], "images need the constant of their sample"),
        ([*SAMPLE, "--cell", "10", "10", "90", *of_sizes()], "--lattice-nm and --cell are two lattices"),
        ([*SAMPLE[:2], "--angle-deg", "3", "1", *of_sizes()], "--angle-deg is for a grating"),
        ([*SAMPLE], "give DATA.CSV, or images"),
        ([*SAMPLE, *of_sizes(), "sizes.csv"], "DATA.CSV, --k and --noise are for sizes in a table"),
        (["--pitch-nm", "50", "sizes.csv"], "--pitch-nm is for images"),
        ([*SAMPLE, "--image", "10", "r10.npy", "t10.npy"], "r10.npy and t10.npy: both sweeps lead the drive"),
        ([*SAMPLE, *of_sizes(), "--image", "90", "t60.npy", "r60.npy"], "the image is that of t60.npy and r60.npy"),
        ([*SAMPLE, "--lattice", "square", *of_sizes()], "not those of a square lattice"),
        ([*SAMPLE, *of_sizes()[8:], "--retrace-mirrored"], "leave --retrace-mirrored out"),
        ([*SAMPLE, *of_sizes()[4:], "--image", "20", "t10.npy", "r10.npy"], "nm per volt, and "),
        ([*SAMPLE, "--image", "10", "missing.npy"], "missing.npy"),
    ],
)
def test_wrong_input_is_named_and_nothing_is_written(words: list[str], said: str) -> None:
    done = size(*words, "--scanner", "s.toml", "--write")
    assert done.status == 2
    assert said in done.err
    assert not Path("s.toml").exists()


def test_an_operator_from_pairs() -> None:
    """Images made by (17), of which the fit need not know; a pair is worth a trace."""
    pairs = [w for v in DRIVES for w in ("--pair", f"{v:g}", "50", "20", f"t{v:g}.npy", f"r{v:g}.npy")]
    done = run(
        "calibrate", "operator", "--axis", "x", "--v-max", "100", *SAMPLE, *pairs, "--scanner", "s.toml", "--write"
    )
    assert done.status == 0, done.err
    assert "operator of x from 4 traces" in done.out
    assert written()["hysteresis"] == {"model": "operator", "file": "s_x_operator.toml"}
    assert "from t100.npy" in Path("s_x_operator.toml").read_text("utf-8")
    for words, said in (
        ([], "give traces, DATA.CSV..., or images with --pair"),
        ([*SAMPLE, "--pair", "60", "90", "20", "t60.npy", "r60.npy"], "outside the driver's 0..100 V"),
        ([*SAMPLE, "--pair", "60", "50", "20", "t60.npy"], "the retrace is missing"),
        (pairs, "images need the constant of their sample"),
    ):
        done = run("calibrate", "operator", "--axis", "x", "--v-max", "100", *words)
        assert done.status == 2
        assert said in done.err
