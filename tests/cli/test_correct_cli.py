"""``tablegen correct`` as its users meet it: files in, straight files out, what it prints and what it refuses."""

import hashlib
import json
from pathlib import Path

import gwyfile
import numpy as np
import pytest
import tifffile
from correcting import LAWS, old_frame, save_pair
from editing import Outcome, run
from image_writers import gwy
from PIL import Image as Pillow

from tablegen.images.files import read_channels
from tablegen.numerics.arrays import Floats

DRIVE = ("--scanner", "scanner.toml", "--size-v", "90", "--offset-v", "50", "--rate-hz", "100")
FIT = ("--fit", "--lattice-nm", "60")
SHAPE = {"pixels": 128, "lines": 96}


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a scanner file of laws, and a frame of what obeys them as trace.npy and retrace.npy."""
    (tmp_path / "scanner.toml").write_text(LAWS, "utf-8")
    save_pair(old_frame("paper", **SHAPE), tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def correct(*words: str, images: tuple[str, ...] = ("trace.npy", "retrace.npy")) -> Outcome:
    return run("correct", *images, *words)


def refused(outcome: Outcome, *parts: str) -> None:
    """Exit 2, one message with these parts, nothing printed."""
    assert (outcome.status, outcome.out) == (2, "")
    for part in parts:
        assert part in outcome.err


@pytest.mark.common
def test_what_it_prints_and_that_it_writes_nothing(lab: Path) -> None:
    before = sorted(lab.iterdir())
    outcome = correct(*FIT)
    assert (outcome.status, outcome.err) == (0, "")
    lines = outcome.out.splitlines()
    assert lines[0] == "trace.npy, retrace.npy: 128 x 96 pixels, 2 channels"
    assert [line[:14].strip() for line in lines[1:]] == [
        "fit",
        "slow axis",
        "size",
        "moved",
        "trace-retrace",
        "",
        "lattice",
    ]
    assert lines[3].endswith("; the file has no size")
    assert max(map(len, lines)) <= 120
    assert sorted(lab.iterdir()) == before


@pytest.mark.common
def test_a_picture_and_json(lab: Path) -> None:
    outcome = correct(*DRIVE, "--json", "--plot", "a.svg")
    record = json.loads(outcome.out)
    assert outcome.status == 0
    assert record["by"] == "scanner file"
    digest = hashlib.sha256((lab / "scanner.toml").read_bytes()).hexdigest()
    assert record["scanner"] == {"file": "scanner.toml", "sha256": digest}
    names = [("trace.npy", (lab / "trace.npy").read_bytes()), ("retrace.npy", (lab / "retrace.npy").read_bytes())]
    assert record["sources"] == [
        {"file": name, "sha256": hashlib.sha256(content).hexdigest()[:16]} for name, content in names
    ]
    assert (record["x"]["drive_v"], record["x"]["offset_v"], record["x"]["rate_hz"]) == (90.0, 50.0, 100.0)
    assert (record["y"]["rate_hz"], record["lines"]) == (pytest.approx(100.0 / 192.0), 192)
    assert record["trace_retrace"]["difference"]["after"] < 0.5 * record["trace_retrace"]["difference"]["before"]
    text = (lab / "a.svg").read_text("utf-8")
    assert "<svg" in text
    assert correct(*DRIVE, "--json", "--plot", "b.svg").status == 0
    assert (lab / "b.svg").read_text("utf-8") == text


def written(lab: Path, suffix: str) -> tuple[list[Floats], str]:
    """Pictures of what a command wrote, by another reader each, and its provenance as text."""
    if suffix == ".npy":
        return list(np.load(lab / "o.npy")), (lab / "o.json").read_text("utf-8")
    if suffix == ".tif":
        with tifffile.TiffFile(lab / "o.tif") as file:
            return [page.asarray() for page in file.pages], file.pages[0].description
    if suffix == ".gwy":
        content = (lab / "o.gwy").read_bytes()
        return [one.heights for one in read_channels(lab / "o.gwy")], content.decode("utf-8", "ignore")
    pictures = [Pillow.open(lab / f"o_{name}.png") for name in ("trace", "retrace")]
    return [np.asarray(one) for one in pictures], pictures[0].text["tablegen correct"]


@pytest.mark.common
@pytest.mark.parametrize("suffix", [".npy", ".tif", ".gwy", ".png"])
def test_every_format_has_both_pictures_their_mask_and_what_was_done(lab: Path, suffix: str) -> None:
    assert correct(*DRIVE, "--window", "0.1", "0.9", "-o", f"o{suffix}").status == 0
    pictures, provenance = written(lab, suffix)
    assert correct(*DRIVE, "--window", "0.1", "0.9", "-o", "plain.npy").status == 0
    plain = np.load(lab / "plain.npy")
    hole = np.isnan(plain[0])
    assert 0.01 < hole.mean() < 0.2
    assert np.array_equal(hole, hole[[0]].repeat(96, axis=0) | np.isnan(plain[0]))
    for picture, expected in zip(pictures, plain, strict=True):
        there = np.isfinite(expected)
        assert picture.shape == expected.shape == (96, 128)
        if suffix in (".npy", ".tif"):
            assert np.array_equal(np.isfinite(picture), there)
            assert picture[there] == pytest.approx(expected[there], rel=1e-6, abs=1e-6)
        elif suffix == ".gwy":
            assert picture[there] == pytest.approx(expected[there], rel=1e-12)
            assert np.ptp(picture[~there]) == 0.0
        else:
            assert np.all((picture > 0) == there)
            slope, offset = np.polyfit(expected[there], picture[there].astype(float), 1)
            assert picture[there] == pytest.approx(slope * expected[there] + offset, abs=1.0)
    digest = hashlib.sha256((lab / "scanner.toml").read_bytes()).hexdigest()
    assert digest in provenance
    assert "tablegen 0" in provenance
    assert '"size_nm": [' in provenance


@pytest.mark.common
def test_the_size_is_in_the_file(lab: Path) -> None:
    """Of Gwyddion's in metres, of TIFF's as its resolution."""
    assert correct(*DRIVE, "-o", "o.gwy").status == 0
    assert correct(*DRIVE, "-o", "o.tif").status == 0
    size = json.loads(correct(*DRIVE, "--json").out)["size_nm"]
    fields = gwyfile.util.get_datafields(gwyfile.load(str(lab / "o.gwy")))
    assert [*fields] == ["trace", "retrace"]
    for field in fields.values():
        assert (field.xreal, field.yreal) == (pytest.approx(1e-9 * size[0]), pytest.approx(1e-9 * size[1]))
        assert field.si_unit_xy.unitstr == "m"
    with tifffile.TiffFile(lab / "o.tif") as file:
        count, of = file.pages[0].tags["XResolution"].value
        assert 128 / (count / of) * 1e7 == pytest.approx(size[0], rel=1e-4)


@pytest.mark.common
def test_all_channels_of_one_file_by_their_names(lab: Path) -> None:
    trace, retrace = (np.load(lab / f"{name}.npy") for name in ("trace", "retrace"))
    phase = np.cumsum(trace, axis=1)
    channels = {"Height (Trace)": trace, "Height (Retrace)": retrace, "Phase (Trace)": phase}
    gwy(lab / "all.gwy", **channels)
    outcome = correct(*DRIVE, "-o", "o.gwy", images=("all.gwy",))
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out.splitlines()[0] == "all.gwy: 128 x 96 pixels, 3 channels"
    found = read_channels(lab / "o.gwy")
    assert [one.channel for one in found] == [*channels]
    assert correct(*DRIVE, "-o", "pair.npy").status == 0
    pair = np.load(lab / "pair.npy")
    for one, expected in zip(found[:2], pair, strict=True):
        there = np.isfinite(expected)
        assert one.heights[there] == pytest.approx(expected[there], rel=1e-9, abs=1e-12)


def test_a_file_that_is_there_stays(lab: Path) -> None:
    assert correct(*DRIVE, "-o", "o.npy").status == 0
    content = (lab / "o.npy").read_bytes()
    refused(correct(*DRIVE, "--window", "0.1", "0.9", "-o", "o.npy"), "o.npy", "--force")
    assert (lab / "o.npy").read_bytes() == content
    assert correct(*DRIVE, "--window", "0.1", "0.9", "-o", "o.npy", "--force").status == 0
    assert (lab / "o.npy").read_bytes() != content


def test_batches(lab: Path) -> None:
    """Each by itself, or by pairs; one that cannot be read hinders no other."""
    outcome = correct(*DRIVE, "--pairs", "-o", "pairs", "--format", "npy")
    assert outcome.status == 0
    assert sorted(path.name for path in (lab / "pairs").iterdir()) == ["trace.json", "trace.npy"]
    (lab / "broken.npy").write_bytes(b"no image")
    outcome = correct(*DRIVE, "--each", "-o", "each", images=("broken.npy", "trace.npy"))
    assert outcome.status == 2
    assert outcome.messages[0].startswith("broken.npy: ")
    assert [path.name for path in (lab / "each").iterdir()] == ["trace.gwy"]
    (lab / "a").mkdir()
    np.save(lab / "a" / "trace.npy", np.load(lab / "trace.npy"))
    outcome = correct(*DRIVE, "--each", "-o", "twice", images=("trace.npy", "a/trace.npy"))
    assert outcome.status == 2
    assert not (lab / "twice").exists()


@pytest.mark.parametrize(
    ("words", "part"),
    [
        ((), "give --scanner FILE"),
        (("--fit", "--scanner", "scanner.toml"), "keep one of the two"),
        (("--scanner", "scanner.toml", "--lattice-nm", "5"), "are for --fit"),
        (("--fit", "--lattice-nm", "5", "--pitch-nm", "5"), "keep one of the two"),
        (("--fit", "-o", "o.jpg"), "the name has to end in .gwy"),
        (("--fit", "--plot", "o.gif"), "the name has to end in .png"),
        (("--fit", "--each"), "need a directory"),
        (("--fit", "--each", "--pairs", "-o", "d"), "keep one of the two"),
        ((*DRIVE, "--size-nm", "5"), "keep one of the two"),
    ],
)
def test_wrong_usage(lab: Path, words: tuple[str, ...], part: str) -> None:
    refused(correct(*words), part)


@pytest.mark.common
def test_wrong_input_is_named_and_nothing_is_written(lab: Path) -> None:
    trace = np.load(lab / "trace.npy")
    np.save(lab / "noise.npy", np.random.default_rng(0).standard_normal((96, 128)))
    np.save(lab / "other.npy", trace[:, ::2])
    np.save(lab / "flat.npy", np.ones((96, 128)))
    np.save(lab / "clipped.npy", np.minimum(trace, np.percentile(trace, 80)))
    np.save(lab / "mirrored.npy", np.load(lab / "retrace.npy")[:, ::-1])
    (lab / "scan.toml").write_text('dac = 1\nname = "x"\n', "utf-8")
    before = sorted(lab.iterdir())
    cases: list[tuple[tuple[str, ...], tuple[str, ...], str]] = [
        (("trace.npy", "retrace.npy"), DRIVE[:-2], "give --rate-hz"),
        (("trace.npy", "retrace.npy"), (*DRIVE[:2], *DRIVE[-2:]), "give --size-v"),
        (("trace.npy", "retrace.npy"), ("--scanner", "gone.toml", *DRIVE[2:]), "gone.toml"),
        (("trace.npy", "retrace.npy"), ("--scanner", "scan.toml", *DRIVE[2:]), "this is a scan file"),
        (("trace.npy", "retrace.npy"), (*DRIVE, "--offset-v", "20"), "is outside the driver's 0..100 V"),
        (("trace.npy", "retrace.npy"), (*DRIVE, "--offset-v", "-5"), "x: -50 V is outside the driver's 0..100 V"),
        (("trace.npy", "retrace.npy"), (*DRIVE, "--slow-offset-v", "-5"), "V is outside the driver's 0..100 V"),
        (("trace.npy", "retrace.npy"), (*DRIVE, "--turn", "0.9"), "the image: x.turn: 0.9 is 0.4 from the nearest"),
        (("trace.npy", "retrace.npy"), (*DRIVE, "--window", "0.9", "0.1"), "window"),
        (("retrace.npy", "trace.npy"), DRIVE, "exchanged"),
        (("trace.npy", "mirrored.npy"), DRIVE, "give --retrace-mirrored"),
        (("trace.npy", "mirrored.npy"), FIT, "--retrace-mirrored"),
        (("retrace.npy", "trace.npy"), FIT, "exchanged"),
        (("trace.npy", "other.npy"), DRIVE, "all channels must be of one scan"),
        (("flat.npy",), DRIVE, "all pixels are 1"),
        (("noise.npy", "retrace.npy"), FIT, "no period stands out"),
        (("trace.npy", "retrace.npy"), (*FIT, "--channel", "Phase"), "has no channel 'Phase'"),
        (("trace.npy", "trace.npy"), FIT, "the same image"),
        (("trace.npy", "trace.npy"), DRIVE, "the same image"),
        (("clipped.npy", "retrace.npy"), DRIVE, "is saturated"),
        (("clipped.npy", "retrace.npy"), FIT, "is saturated"),
        (("gone.npy",), DRIVE, "gone.npy"),
    ]
    for images, words, part in cases:
        refused(correct(*words, "-o", "o.gwy", images=images), part)
    assert sorted(lab.iterdir()) == before


@pytest.mark.common
def test_a_lattice_that_is_none(lab: Path) -> None:
    """A grating has waves of one direction: a lattice constant is not what its size comes from."""
    from tablegen.virtual.imaging import grating

    save_pair(old_frame("paper", surface=grating(80.0), **SHAPE), lab)
    refused(correct(*FIT, "-o", "o.gwy"), "for a grating give its pitch")
    assert correct("--fit", "--pitch-nm", "80", "-o", "o.gwy").status == 0
