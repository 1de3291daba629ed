"""Files of images, each written by another hand than reads it; and every damage said with its file."""

import hashlib
import struct
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from gwyfile.objects import GwyContainer, GwyDataField, GwyObject
from hypothesis import given, settings
from hypothesis import strategies as st
from image_writers import ascii_of, gwy, npy, png
from PIL import Image as Pillow

from tablegen.base.input_errors import Rejected
from tablegen.images.files import read_image
from tablegen.images.formats.gwyddion import data_fields
from tablegen.numerics.arrays import Floats

HEIGHTS = np.random.default_rng(1).uniform(-5.0, 5.0, (40, 48))
STEPS = np.round((HEIGHTS + 5.0) * 6000.0)  # what 16 bits hold


def put(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def why(path: Path, channel: str | None = None) -> str:
    with pytest.raises(Rejected) as caught:
        read_image(path, channel)
    (problem,) = caught.value.problems
    assert problem.file == str(path)
    return str(problem)


# read


def test_npy_and_gwyddion_are_exact(tmp_path: Path) -> None:
    gwy(tmp_path / "a.gwy", Height=HEIGHTS)
    for path in (put(tmp_path, "a.npy", npy(HEIGHTS)), tmp_path / "a.gwy"):
        image = read_image(path)
        assert np.array_equal(image.heights, HEIGHTS)
        assert image.heights.dtype == np.float64
        assert image.source.name == path.name
        assert image.source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()[:16]


@pytest.mark.parametrize("ending", ["txt", "asc", "csv", "dat", "TXT"])
@pytest.mark.parametrize(
    ("separator", "comma"),
    [
        *((" ", False), ("   ", False), (" ", True), ("\t", False), ("\t", True), (";", True), ("; ", False)),
        *((",", False), (", ", False)),
    ],
)
def test_matrices_of_numbers(separator: str, comma: bool, ending: str, tmp_path: Path) -> None:
    path = put(tmp_path, f"a.{ending}", ascii_of(HEIGHTS, separator, comma))
    assert np.array_equal(read_image(path).heights, HEIGHTS)


def test_a_first_row_of_whole_numbers_leaves_the_comma_a_separator(tmp_path: Path) -> None:
    rows = np.vstack([np.arange(HEIGHTS.shape[1]), HEIGHTS])
    text = "\n".join(", ".join(f"{value:g}" for value in row) for row in rows)
    assert read_image(put(tmp_path, "a.csv", text.encode())).heights == pytest.approx(rows, rel=1e-4)


def test_whole_numbers_lines_of_windows_and_a_last_separator(tmp_path: Path) -> None:
    rows = "\r\n".join("\t".join(f"{v:.0f}" for v in row) + "\t" for row in STEPS)
    assert np.array_equal(read_image(put(tmp_path, "a.txt", rows.encode())).heights, STEPS)


@pytest.mark.parametrize(("bits", "top"), [(8, 255.0), (16, 65535.0)])
def test_grey_pictures(bits: int, top: float, tmp_path: Path) -> None:
    values = np.round(STEPS / 60000.0 * top)
    assert np.array_equal(read_image(put(tmp_path, "a.png", png(values, bits))).heights, values)


def test_grey_that_is_stored_as_colour(tmp_path: Path) -> None:
    values = np.round(STEPS / 60000.0 * 255.0)
    path = put(tmp_path, "a.png", coloured(values, values))
    assert np.array_equal(read_image(path).heights, values)
    assert "is in colour, not heights" in why(put(tmp_path, "b.png", coloured(values, 255.0 - values)))


def coloured(red: Floats, others: Floats) -> bytes:
    out = BytesIO()
    Pillow.fromarray(np.stack([red, others, others], axis=-1).astype(np.uint8)).save(out, "PNG")
    return out.getvalue()


@pytest.mark.parametrize("kind", ["uint8", "uint16", "int32", "float32"])
def test_tiff(kind: str, tmp_path: Path) -> None:
    values = (STEPS / 256.0 if kind == "uint8" else STEPS).astype(kind)
    Pillow.fromarray(values).save(tmp_path / "a.tif")
    assert np.array_equal(read_image(tmp_path / "a.tif").heights, values)


def test_channels_by_title_and_by_number(tmp_path: Path) -> None:
    other = HEIGHTS[::-1]
    gwy(tmp_path / "a.gwy", Current=HEIGHTS, Phase=other)
    put(tmp_path, "a.npy", npy(np.stack([HEIGHTS, other]).reshape(2, 40, 48)))
    pages = [Pillow.fromarray(one.astype(np.float32)) for one in (HEIGHTS, other)]
    pages[0].save(tmp_path / "a.tiff", save_all=True, append_images=pages[1:])
    for name in ("a.gwy", "a.npy", "a.tiff"):
        assert np.array_equal(read_image(tmp_path / name, "1").heights.astype(np.float32), other.astype(np.float32))
        assert "has several channels, 0" in why(tmp_path / name)
        assert "choose with --channel" in why(tmp_path / name)
        assert "has no channel '7'; there is 0" in why(tmp_path / name, "7")
    assert np.array_equal(read_image(tmp_path / "a.gwy", "Phase").heights, other)
    gwy_twice = GwyContainer()
    for number in (0, 3):
        gwy_twice[f"/{number}/data/title"] = "Height"
        gwy_twice[f"/{number}/data"] = GwyDataField(HEIGHTS)
    gwy_twice.tofile(str(tmp_path / "b.gwy"))
    twice = "has more than one channel 'Height': 0 (Height), 3 (Height); choose one by its number"
    assert twice in why(tmp_path / "b.gwy", "Height")


# refused


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.npy", b"", "is empty"),
        ("a.jpg", b"x", ".jpg is not one of .npy, .tif, .tiff, .png, .gwy, .txt"),
        ("a", b"x", "no ending is not one of"),
        ("a.npy", npy(HEIGHTS)[:-9], "is not a complete .npy file of numbers"),
        ("a.npy", b"\x93NUMPY\x01\x00\xff\xff" + b"{" * 100, "is not a complete .npy file of numbers"),
        ("a.npy", npy(HEIGHTS.reshape(-1)), "has the shape 1920; rows x columns are needed"),
        ("a.npy", npy(HEIGHTS[:20]), "has 20 x 48 pixels; at least 32 x 32"),
        (
            "a.npy",
            npy(np.where(HEIGHTS > 4.9, np.inf, HEIGHTS)),
            "pixels are infinite; if they are missing, save them as NaN",
        ),
        ("a.npy", npy(np.full((40, 48), np.nan)), "all pixels are NaN; was a different channel saved?"),
        ("a.npy", npy(np.full((40, 48), 7.0)), "all pixels are 7; was a different channel saved?"),
        ("a.png", png(STEPS)[:-30], "is not a complete PNG file"),
        ("a.png", b"GIF89a" + bytes(100), "is not a complete PNG file"),
        ("a.png", png(STEPS).replace(b"IDAT", b"JDAT"), "is not a complete PNG file"),
        ("a.tif", b"II*\x00" + bytes(3), "is not a readable TIFF file"),
        ("a.tif", b"hello" * 20, "is not a readable TIFF file"),
        ("a.gwy", b"hello" * 20, "does not begin as a Gwyddion file does"),
        ("a.gwy", b"GWYP" + b"GwyContainer\0" + struct.pack("<I", 0), "contains no image"),
        ("a.gwy", b"GWYP" + b"GwyContainer\0" + struct.pack("<I", 99), "ends in the middle of an object"),
        ("a.gwy", b"GWYP" + b"GwyContainer\0" + struct.pack("<I", 3) + b"a\0z", "has a component of the unknown type"),
        ("a.txt", b"# nothing\n\n", "has no numbers"),
        ("a.txt", ascii_of(HEIGHTS, " ") + b"1 2 3\n", "a.txt:44: 3 numbers where the first row has 48"),
        ("a.txt", b"Height [nm]\n" + ascii_of(HEIGHTS, " "), "a.txt:1: 'Height' is not a number"),
        ("a.txt", ascii_of(HEIGHTS, ",").replace(b",", b",nan,", 1), "numbers where the first row has"),
        ("a.txt", b"\xff\xfe1\x00", "is UTF-16; save it as UTF-8"),
    ],
)
def test_what_is_wrong_is_said(name: str, content: bytes, said: str, tmp_path: Path) -> None:
    assert said in why(put(tmp_path, name, content))


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    (tmp_path / "a.npy").mkdir()
    assert "is not a file" in why(tmp_path / "a.npy")
    assert "is not a file" in why(tmp_path / "absent.npy")


def test_objects_in_a_npy_file_are_never_made(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([[object()] * 40] * 40), allow_pickle=True)
    assert "is not a complete .npy file of numbers" in why(tmp_path / "a.npy")


@given(st.data())
@settings(max_examples=150, deadline=None)
def test_a_damaged_gwyddion_file_is_refused_or_read_and_never_worse(data: st.DataObject) -> None:
    container = GwyContainer()
    container["/0/data/title"] = "Height"
    container["/0/data"] = GwyDataField(np.arange(6.0).reshape(2, 3))
    container["/0/names"] = GwyObject("Other", {"n": 3})
    content = bytearray(b"GWYP" + container.serialize())
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(4, len(content) - 1))
        content[at] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(content)))
    for damaged in (bytes(content), bytes(content[:cut])):
        try:
            fields = data_fields(damaged)
        except ValueError:
            continue
        assert all(matrix.ndim == 2 for matrix in (field.values for field in fields))
