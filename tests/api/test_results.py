"""What every function gives: three lines, text, JSON and a picture, the same as the command's."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from building import EXAMPLE
from calibrating import Scanner, grating
from editing import run
from image_writers import npy

import tablegen


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The example, a trace of it, and images of a grating."""
    shutil.copy(EXAMPLE, tmp_path / "scan.toml")
    shutil.copy(EXAMPLE.parent / "scanner.toml", tmp_path)
    pair = Scanner().images(100.0, grating(16.0, pixels=128, lines=96), 0.05, np.random.default_rng(8))
    (tmp_path / "t.npy").write_bytes(npy(pair.trace))
    (tmp_path / "r.npy").write_bytes(npy(pair.retrace))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def check(result: tablegen.Result, command: str = "") -> None:
    """Three lines, a picture, and what the command prints."""
    assert len(repr(result).splitlines()) == 3, repr(result)
    assert repr(result).startswith("<tablegen ")
    assert json.loads(result.to_json()) == json.loads(json.dumps(result.record))
    assert "<svg" in result.plot()._repr_html_()
    assert result._repr_html_().startswith("<p")
    assert result.plot("picture.svg").charts.charts
    assert Path("picture.svg").read_text("utf-8").startswith("<?xml")
    if command:
        printed = json.loads(run(*command.split(), "--json").out)
        assert result.record == (printed[0] if isinstance(printed, list) else printed)
        assert result.summary().strip() in run(*command.split()).out


@pytest.mark.common
def test_images_are_calibrated_as_by_the_command(lab: Path) -> None:
    found = tablegen.calibrate_images([(100.0, "t.npy", "r.npy")], axis="x", v_max=100.0)
    check(found, "calibrate images --axis x --v-max 100 --no-plot --pair 100 t.npy r.npy")
    command = run("calibrate", "images", "--axis", "x", "--v-max", 100, "--pair", 100, "t.npy", "r.npy", "--no-plot",
                  "--scanner", "theirs.toml", "--write")  # fmt: skip
    assert command.status == 0, command.err
    assert found.write("ours.toml", v_max=100.0) == ["ours.toml"]
    assert Path("ours.toml").read_text().replace("ours", "theirs") == Path("theirs.toml").read_text()
    arrays = tuple(np.load(name) for name in ("t.npy", "r.npy"))
    image = tablegen.read_image("t.npy", retrace="r.npy")
    for given in (arrays, (image,)):
        other = tablegen.calibrate_images([(100.0, *given)], axis="x", v_max=100.0)
        assert other.parameters["forward.beta_max"] == found.parameters["forward.beta_max"]


def test_half_of_a_pair_is_refused(lab: Path) -> None:
    with pytest.raises(tablegen.Rejected, match="retrace: missing; both directions"):
        tablegen.calibrate_images([(100.0, np.load("t.npy"))], axis="x", v_max=100.0)
    with pytest.raises(tablegen.Rejected, match="another shape"):
        tablegen.calibrate_images([(100.0, np.load("t.npy"), np.ones((40, 40)))], axis="x", v_max=100.0)
    with pytest.raises(TypeError, match="windows is none of channel"):
        tablegen.calibrate_images([(100.0, "t.npy", "r.npy")], axis="x", v_max=100.0, windows=(0.0, 1.0))


def test_image_files_are_listed_and_read(lab: Path) -> None:
    check(tablegen.channels("t.npy"), "channels t.npy")
    image = tablegen.read_image("t.npy", retrace="r.npy")
    check(image)
    assert np.array_equal(image.heights, np.load("t.npy"))
    assert image.retrace is not None
    assert np.array_equal(image.retrace.heights, np.load("r.npy"))
    assert tablegen.read_image("t.npy").retrace is None


@pytest.mark.common
def test_a_scan_is_compared_and_its_tables_are_listed_as_by_the_commands(lab: Path) -> None:
    text = (lab / "scan.toml").read_text("utf-8").replace("size_nm = 200", "size_nm = 210", 1)
    (lab / "other.toml").write_text(text, "utf-8")
    compared = tablegen.compare("scan.toml", "other.toml")
    assert compared.differing
    check(compared, "compare scan.toml other.toml")
    check(tablegen.tables("scan.toml"), "tables scan.toml")
    with pytest.raises(tablegen.Rejected, match="is a scanner file, and"):
        tablegen.compare("scan.toml", "scanner.toml")


@pytest.mark.common
def test_a_page_and_a_library_are_those_of_the_commands(lab: Path) -> None:
    page = tablegen.report("scan.toml")
    check(page)
    assert run("report", "scan.toml", "-o", "theirs.html").status == 0
    assert page.content == Path("theirs.html").read_bytes()
    with pytest.raises(tablegen.Rejected, match="would replace a scan or a scanner file"):
        page.write("scan.toml")
    library = tablegen.sweep("scan.toml", {"x.size_nm": [200, 5000]}, "ours", jobs=1, formats=["csv"])
    check(library)
    command = run("sweep", "scan.toml", "--set", "x.size_nm=200,5000", "-o", "theirs", "-j", "1", "-f", "csv")
    assert command.out.strip() == library.verdict().replace("ours", "theirs")
    assert [one.variant.name for one in library.failed] == ["annexin_200nm_size_nm_5000"]
    ours, theirs = (sorted(path.relative_to(name) for path in Path(name).rglob("*")) for name in ("ours", "theirs"))
    assert ours == theirs


@pytest.mark.common
def test_a_scan_is_simulated_as_by_the_command(lab: Path) -> None:
    check(tablegen.simulate("scan.toml", calibrated=False), "simulate scan.toml --no-calibration")
    with pytest.raises(ValueError, match="has no operator; identify one with calibrate_operator"):
        tablegen.simulate("scan.toml", "own")


def test_a_build_and_a_round_are_results(lab: Path) -> None:
    scan = tablegen.build("scan.toml")
    check(scan)
    assert scan.to_json() == scan.manifest
    trace = tablegen.Laboratory(like="scanner.toml").running_trace("scan.toml", "x")
    check(tablegen.refine("scan.toml", trace, axis="x"))


@pytest.mark.parametrize("given", [{}, {"trace": {}, "images": [("t.npy",)]}])
def test_a_round_takes_a_trace_or_images(lab: Path, given: dict[str, object]) -> None:
    with pytest.raises(TypeError, match="give trace, of a sensor, or images"):
        tablegen.refine("scan.toml", axis="x", **given)  # type: ignore[arg-type]
