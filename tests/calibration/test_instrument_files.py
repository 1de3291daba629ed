"""Files of instruments: what is in them, by other readers of the same formats, and no damage that is not told."""

import random
import re
import struct
import tracemalloc
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path

import nanonispy2
import numpy as np
import pytest
from gwyfile.objects import GwyContainer, GwyDataField
from igor2 import binarywave
from image_writers import gwy, npy
from instrument_files import (
    asd,
    createc,
    gxsm,
    h5_jpk,
    h5_jpk_steps,
    ibw,
    iso28600,
    jpk,
    mdt,
    nid,
    park,
    spm,
    sxm,
    wsxm,
)
from mutating import damaged
from scipy.io import netcdf_file

import tablegen
from tablegen.api.image_input import sample_image
from tablegen.base.input_errors import Rejected
from tablegen.correction.scan_images import Choice, read_scan
from tablegen.images.files import ScanImage, channels_of, read_channels, read_image, read_pair
from tablegen.images.formats.asd import asd_channels
from tablegen.images.formats.channel import Channel, channel_of_array, choose, rotation_deg, split_direction
from tablegen.images.formats.createc import createc_channels
from tablegen.images.formats.gxsm import gxsm_channels
from tablegen.images.formats.h5_jpk import h5_jpk_channels
from tablegen.images.formats.hdf5 import Hdf5Object, hdf5_members, hdf5_object
from tablegen.images.formats.igor import ibw_channels
from tablegen.images.formats.iso28600 import iso_channels
from tablegen.images.formats.jpk import jpk_channels
from tablegen.images.formats.nanonis import sxm_channels
from tablegen.images.formats.nanoscope import spm_channels
from tablegen.images.formats.nanosurf import nid_channels
from tablegen.images.formats.ntmdt import mdt_channels
from tablegen.images.formats.park import park_channels
from tablegen.images.formats.wsxm import wsxm_channels

T, R, P, Q = np.random.default_rng(1).uniform(-20.0, 20.0, (4, 40, 48))  # nm
NOTE = {"ScanSize": "5e-07", "FastScanSize": "5e-07", "SlowScanSize": "2.5e-07", "ScanRate": "2.5", "ScanDown": "0"}
LABELS = {"HeightTrace": T, "HeightRetrace": R, "ZSensorTrace": P, "ZSensorRetrace": Q}
ASYLUM = {label: heights * 1e-9 for label, heights in LABELS.items()}
NANONIS = {"Z": (T * 1e-9, R * 1e-9), "Current": (P * 1e-9, Q * 1e-9)}
MOVIE = {"TP": np.stack([T, R, P]), "ER": np.stack([P, Q, T])}


def put(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def why(path: Path, *arguments: str | None, read: Callable[..., object] = read_image) -> str:
    with pytest.raises(Rejected) as caught:
        read(path, *arguments)
    (problem,) = caught.value.problems
    return str(problem)


# read

FILES: dict[str, tuple[bytes, str, float, float, str, str]] = {
    # name: content, signal, nm of a unit, the most that heights differ in nm, unit, where row 0 is
    "a.sxm": (sxm(NANONIS), "Z", 1e9, 1e-5, "m", "bottom"),
    "down.sxm": (sxm(NANONIS, scan_dir="down"), "Z", 1e9, 1e-5, "m", "top"),
    "a.ibw": (ibw(ASYLUM, NOTE), "Height", 1e9, 1e-5, "m", "bottom"),
    "big.ibw": (ibw(ASYLUM, NOTE, ">"), "Height", 1e9, 1e-5, "m", "bottom"),
    "down.ibw": (ibw(ASYLUM, NOTE | {"ScanDown": "1"}, turned=True), "Height", 1e9, 1e-5, "m", "top"),
    "a.spm": (spm({"Height S": (T, R), "Height": (P, Q)}, aspect="48:40"), "Height S", 1.0, 1e-3, "nm", "bottom"),
    "a.003": (spm({"Height": (T, R)}, stored=4, frame="Down", aspect="6:5"), "Height", 1.0, 1e-7, "nm", "top"),
    "a.jpk": (jpk({"measuredHeight": (T, R), "error": (P, Q)}), "measuredHeight", 1e9, 6e-3, "m", "bottom"),
    "a.JPK-QI-image": (jpk({"height": (T, R)}, big=True), "height", 1e9, 6e-3, "m", "bottom"),
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_trace_and_retrace_of_one_file(name: str, tmp_path: Path) -> None:
    """By the signal alone; the left end of the line at the left, the first row first in time, sizes and unit known."""
    content, signal, nm, near, unit, first = FILES[name]
    path = put(tmp_path, name, content)
    trace, retrace = read_pair(path, channel=signal)
    for image, heights, direction in ((trace, T, "trace"), (retrace, R, "retrace")):
        assert np.max(np.abs(image.heights * nm - heights)) < near
        assert (image.signal, image.direction, image.unit, image.first_row) == (signal, direction, unit, first)
        assert image.width_nm == pytest.approx(500.0)
        assert image.height_nm == pytest.approx(416.666667 if unit == "nm" else 250.0)
        assert image.line_rate_hz == pytest.approx({".sxm": 2.0, ".jpk": 4.0}.get(path.suffix[:4].lower(), 2.5))
        assert image.frames == 1
        assert np.array_equal(read_image(path, image.channel).heights, image.heights)
        assert np.array_equal(read_image(path, str(image.number)).heights, image.heights)
        assert np.array_equal(read_image(path, signal, image.direction).heights, image.heights)


def test_a_retrace_alone_is_the_mirror_image_of_the_sample_and_said(tmp_path: Path) -> None:
    path = put(tmp_path, "r.ibw", ibw({"HeightRetrace": ASYLUM["HeightRetrace"]}, NOTE))
    sample, _ = sample_image(50.0, None, path, None, {})
    assert np.array_equal(sample.trace, ASYLUM["HeightRetrace"][:, ::-1].astype("f4"))
    assert sample.retrace is None
    assert sample.name.endswith("r.ibw (the retrace alone, mirrored)")


def test_frames_and_facts_of_a_jpk_file_of_hdf5(tmp_path: Path) -> None:
    """Of the file that h5py has written, with and without chunks; of a stopped scan the height of its rows."""
    path = put(tmp_path, "a.h5-jpk", h5_jpk())
    channels = channels_of(path)
    assert [one.title for one in channels] == ["height trace", "measuredHeight trace", "height retrace"]
    for channel in channels:
        for frame in (0, 1):
            image = read_image(path, channel.title, frame=frame)
            assert np.array_equal(image.heights, h5_jpk_steps(channel.number, frame) * -2e-14 + 3e-7)
            assert (image.unit, image.frames, image.first_row, image.line_rate_hz) == ("m", 2, "bottom", 40.0)
            assert (image.width_nm, image.height_nm) == pytest.approx((150.0, 200.0 * 34 / 40))
            assert image.angle_deg == pytest.approx(90.0)
    trace, retrace = read_pair(path, channel="height", frame=1)
    assert (trace.number, retrace.number) == (0, 2)
    assert "choose one with --frame, 0 to 1" in why(path, "measuredHeight")


def test_other_scales_and_grids_of_a_jpk_file_of_hdf5() -> None:
    content = h5_jpk()
    unscaled, *_ = h5_jpk_channels(content.replace(b"linear\0", b"cubics\0"), "a")
    assert unscaled.unit == "LSB"
    assert np.array_equal(unscaled.load(1), h5_jpk_steps(0, 1))
    other, *_ = h5_jpk_channels(with_attribute(content, "theta", "<d", -0.0), "a")
    assert str(other.angle_deg) == "0.0"
    reflected = re.sub(rb"(grid\.reflect\0.{10,30}?)false", rb"\1true\0", content, flags=re.DOTALL)
    assert {one.first_row for one in h5_jpk_channels(reflected, "a")} == {"top"}


def chunk_tree(content: bytes, number: int) -> int:
    """Where a tree of chunks begins, by its order in the file."""
    return [found.start() for found in re.finditer(rb"TREE\x01\x00", content)][number]


@pytest.mark.parametrize(
    ("at", "layout", "value", "said"),
    [
        (24, "<I", 5, "has a packed chunk without its end"),
        (32, "<Q", 500, "has no values from row 0 of its array on"),
        (40, "<Q", 2, "has no values from row 0 of its array on"),
        (56, "<Q", 1 << 40, "refers to a place behind its end"),
        (6, "<H", 0, "has no values from row 0 of its array on"),
        (5, "<B", 1, "has a tree of another kind|whose levels do not fit"),
    ],
)
def test_chunks_that_are_not_whole_are_refused(at: int, layout: str, value: int, said: str) -> None:
    content = bytearray(h5_jpk())
    struct.pack_into(layout, content, chunk_tree(bytes(content), 0) + at, value)
    with pytest.raises(ValueError, match=said):
        h5_jpk_channels(bytes(content), "a")[0].load(0)


@pytest.mark.parametrize(
    ("leaves", "members", "said"),
    [
        (50, 50, "a group of more members than it has room for"),
        (60000, 1, "a tree of more entries than it has room for"),
    ],
)
def test_a_group_has_no_more_members_than_the_file_has_room_for(leaves: int, members: int, said: str) -> None:
    """Every leaf is the same one, so that few bytes would make many members."""
    heap = b"HEAP" + bytes(4) + struct.pack("<3Q", 8, 0, 24) + bytes(8)
    tree, leaf = len(heap), len(heap) + 24 + 16 * 50
    content = heap + b"TREE" + struct.pack("<BBHQQ", 0, 0, leaves, 0, 0) + struct.pack("<QQ", 0, leaf) * 50
    content += b"SNOD" + struct.pack("<BBH", 1, 0, members) + bytes(40 * members)
    with pytest.raises(ValueError, match=said):
        hdf5_members(content, Hdf5Object(((0x11, struct.pack("<QQ", tree, 0)),)))


def test_a_header_that_goes_on_in_itself_and_one_of_many_messages_are_refused() -> None:
    header = struct.pack("<BxHII4x", 1, 1, 1, 24)
    circle = header + struct.pack("<HHB3xQQ", 0x10, 16, 0, 16, 24)
    with pytest.raises(ValueError, match="has an object header that refers to itself"):
        hdf5_object(circle, 0)
    many = struct.pack("<BxHII4x", 1, 1, 1, 8 * 5000) + struct.pack("<HHB3x", 0, 0, 2) * 5000
    with pytest.raises(ValueError, match="has an object header of more than 4096 messages"):
        hdf5_object(many, 0)


def test_a_chunk_is_unpacked_as_far_as_its_shape_says() -> None:
    """A chunk of 16 MB in its place takes the memory of a chunk of 4000 bytes."""
    content = h5_jpk()
    tree = chunk_tree(content, 0)
    bomb = zlib.compress(bytes(1 << 24))
    longer = bytearray(content + bomb)
    struct.pack_into("<I", longer, tree + 24, len(bomb))
    struct.pack_into("<I", longer, tree + 28, 0b101)  # deflate alone: no shuffle, no checksum
    struct.pack_into("<Q", longer, tree + 56, len(content))
    channel = h5_jpk_channels(bytes(longer), "a")[0]
    tracemalloc.start()
    with pytest.raises(ValueError, match="has a chunk of 4004 bytes, not 4000"):
        channel.load(0)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 1 << 20


@pytest.mark.parametrize("version", [0, 1, 2])
def test_frames_of_a_movie(version: int, tmp_path: Path) -> None:
    path = put(tmp_path, "a.asd", asd(MOVIE, version))
    for signal, frames in MOVIE.items():
        for number, heights in enumerate(frames):
            image = read_image(path, signal, frame=number)
            assert np.max(np.abs(image.heights - heights)) < 0.026  # half a level of the converter
            assert (image.unit, image.frame, image.frames, image.direction) == ("nm", number, 3, None)
            assert (image.width_nm, image.height_nm, image.line_rate_hz) == (400.0, 200.0, 80.0)
    assert "is a movie of 3 frames; choose one with --frame, 0 to 2" in why(path, "TP")
    with pytest.raises(Rejected, match="has no frame 3; the last one is 2"):
        read_image(path, "TP", frame=3)
    assert [one.frames for one in channels_of(path)] == [3, 3]


def test_a_frame_without_contrast_is_named(tmp_path: Path) -> None:
    path = put(tmp_path, "a.asd", asd({"TP": np.stack([T, np.zeros_like(T)])}, 1))
    with pytest.raises(Rejected, match="frame 1: all pixels are"):
        read_image(path, "TP", frame=1)


def test_a_gwyddion_file_has_sizes_and_units(tmp_path: Path) -> None:
    gwy(tmp_path / "a.gwy", **{"Z (Forward)": T, "Z (Backward)": R})
    trace, retrace = read_pair(tmp_path / "a.gwy")
    assert np.array_equal(trace.heights, T)
    assert np.array_equal(retrace.heights, R)
    assert (trace.width_nm, trace.height_nm, trace.unit, trace.signal) == (None, None, "m", "Z")
    container = GwyContainer()
    container["/0/data"] = GwyDataField(T, xreal=3e-6, yreal=2e-6, si_unit_xy="m", si_unit_z="V")
    container.tofile(str(tmp_path / "b.gwy"))
    image = read_image(tmp_path / "b.gwy")
    assert (image.width_nm, image.height_nm, image.unit) == (pytest.approx(3000.0), pytest.approx(2000.0), "V")


def test_all_channels_of_a_file(tmp_path: Path) -> None:
    images = read_channels(put(tmp_path, "a.ibw", ibw(ASYLUM, NOTE)))
    assert [image.channel for image in images] == list(LABELS)
    for image, heights in zip(images, LABELS.values(), strict=True):
        assert np.max(np.abs(image.heights * 1e9 - heights)) < 1e-5


def test_another_reader_of_igor_agrees(tmp_path: Path) -> None:
    for order in "<>":
        wave = binarywave.load(put(tmp_path, "a.ibw", ibw(ASYLUM, NOTE, order)))["wave"]
        assert wave["labels"][2] == [b"", *(label.encode() for label in LABELS)]
        assert b"FastScanSize: 5e-07\r" in wave["note"]
        for number, image in enumerate(read_channels(tmp_path / "a.ibw")):
            assert np.array_equal(wave["wData"][:, :, number].T, image.heights)


def test_another_reader_of_nanonis_agrees(tmp_path: Path) -> None:
    path = put(tmp_path, "a.sxm", sxm(NANONIS))
    other = nanonispy2.read.Scan(str(path))
    assert other.header["scan_range"] == pytest.approx([5e-7, 2.5e-7])
    for signal in NANONIS:
        trace, retrace = read_pair(path, channel=signal)
        assert np.array_equal(other.signals[signal]["forward"], trace.heights)
        assert np.array_equal(other.signals[signal]["backward"][:, ::-1], retrace.heights)


def test_a_nanonis_file_of_one_direction_and_the_other_byte_order(tmp_path: Path) -> None:
    content = sxm({"Z": (T, R)}).replace(b"\tboth\t", b"\tbackward\t")
    image = read_image(put(tmp_path, "a.sxm", content))
    assert (image.channel, image.direction) == ("Z backward", "retrace")
    assert np.max(np.abs(image.heights - T[:, ::-1])) < 1e-5  # the first block, from right to left
    start = content.index(b"\x1a\x04") + 2
    turned = (
        content[:start].replace(b"MSBFIRST", b"LSBFIRST")
        + np.frombuffer(content, ">f4", offset=start).astype("<f4").tobytes()
    )
    assert np.array_equal(read_image(put(tmp_path, "b.sxm", turned)).heights, image.heights)


def test_a_nanonis_scan_that_was_stopped_ends_with_its_last_whole_line(tmp_path: Path) -> None:
    trace, retrace = T.copy(), R.copy()
    trace[36:], retrace[35, :20], retrace[36:] = np.nan, np.nan, np.nan  # backward, the right end comes first
    other = np.where(np.isnan(trace), np.nan, P)
    images = read_pair(put(tmp_path, "a.sxm", sxm({"Z": (trace, retrace), "Current": (other, other)})), channel="Z")
    for image, heights in zip(images, (T, R), strict=True):
        assert np.max(np.abs(image.heights - heights[:35])) < 1e-5
        assert image.height_nm == pytest.approx(250.0 * 35 / 40)
    trace[10, 10] = np.nan
    image = read_image(put(tmp_path, "b.sxm", sxm({"Z": (trace, retrace)})), "Z forward")
    assert np.argwhere(np.isnan(image.heights[:36])).tolist() == [[10, 10]]
    empty = put(tmp_path, "c.sxm", sxm({"Z": (T * np.nan, R * np.nan)}))
    assert "all pixels are NaN" in why(empty, "Z forward")


STOPPED = {
    # name: content of 40 rows that are the first of 160, and the height in nm of 160
    "lines.ibw": (ibw(ASYLUM, NOTE | {"ScanLines": "160"}), 250.0),
    "down.ibw": (ibw(ASYLUM, NOTE | {"ScanLines": "160", "ScanDown": "1"}, turned=True), 250.0),
    "scaled.ibw": (ibw(ASYLUM, NOTE, step_m=(5e-7 / 47, 2.5e-7 / 159)), 250.0),
    "lines.spm": (spm({"Height": (T, R)}, aspect="48:160", of_scan="\\Lines: 160\r\n"), 500.0 * 160 / 48),
    "grid.jpk": (jpk({"Height": (T, R)}, lines=160), 250.0),
}


@pytest.mark.parametrize("name", STOPPED)
def test_the_height_of_a_stopped_scan_is_that_of_its_rows(name: str, tmp_path: Path) -> None:
    content, height = STOPPED[name]
    trace = read_image(put(tmp_path, name, content), "Height", "trace")
    assert trace.heights.shape == T.shape
    assert trace.width_nm == pytest.approx(500.0)
    assert trace.height_nm == pytest.approx(height * 40 / 160)


@pytest.mark.parametrize("steps", [39, 40])
def test_n_or_n_minus_1_steps_of_a_wave_are_a_whole_scan(steps: int, tmp_path: Path) -> None:
    path = put(tmp_path, "a.ibw", ibw(ASYLUM, NOTE, step_m=(5e-7 / 47, 2.5e-7 / steps)))
    assert read_image(path, "HeightTrace").height_nm == pytest.approx(250.0)


@pytest.mark.parametrize("down", [False, True])
def test_rows_that_a_stopped_scan_lacks_are_left_out(down: bool, tmp_path: Path) -> None:
    """NaN in an Igor wave; rows outside the valid ones of a Nanoscope image, which begin at the bottom."""
    first = {label: np.where(np.arange(40)[:, None] < 35, heights, np.nan) for label, heights in ASYLUM.items()}
    note = NOTE | {"ScanLines": "40", "ScanDown": str(int(down))}
    igor = read_image(put(tmp_path, "a.ibw", ibw(first, note, turned=down)), "HeightTrace")
    assert np.array_equal(igor.heights, ASYLUM["HeightTrace"][:35].astype("f4"))
    assert igor.height_nm == pytest.approx(250.0 * 35 / 40)
    valid = f"\\Valid data start Y: {5 if down else 0}\r\n\\Valid data len Y: 35\r\n"
    content = spm({"Height": (T, R)}, frame="Down" if down else "Up", stored=4, aspect="48:40", of_image=valid)
    bruker = read_image(put(tmp_path, "a.spm", content), "Height", "trace")
    assert np.max(np.abs(bruker.heights - T[:35])) < 1e-6
    assert bruker.height_nm == pytest.approx(500.0 * 35 / 48)


@pytest.mark.parametrize("value", ["50", "-1", "x", "99999999"])
def test_valid_rows_that_cannot_be_are_not_believed(value: str, tmp_path: Path) -> None:
    valid = f"\\Valid data start Y: 0\r\n\\Valid data len Y: {value}\r\n"
    image = read_image(put(tmp_path, "a.spm", spm({"Height": (T, R)}, of_image=valid)), "Height", "trace")
    assert image.heights.shape == T.shape


TURNED = {
    "a.sxm": sxm(NANONIS, angle_deg=90.0),
    "a.ibw": ibw(ASYLUM, NOTE | {"ScanAngle": "90"}),
    "scan.spm": spm({"Height": (T, R)}, of_scan="\\Rotate Ang.: 1.5708\r\n"),
    "image.001": spm({"Height": (T, R)}, of_scan="\\Rotate Ang.: 0\r\n", of_image="\\Rotate Ang.: 90 deg\r\n"),
    "a.jpk": jpk({"Height": (T, R)}, angle_deg=90.0),
    "iso.spm": iso28600({"Z": T}, angle_deg=90.0),
    "a.stp": wsxm(T, angle_deg=90.0),
    "a.dat": createc([T]),
    "a.nid": nid({"Z-Axis": (T, R)}),
    "a.tiff": park(T, angle_deg=90.0),
    "a.nc": gxsm(T, angle_deg=90.0),
}


@pytest.mark.parametrize("name", TURNED)
def test_the_scan_angle_is_read(name: str, tmp_path: Path) -> None:
    channels = channels_of(put(tmp_path, name, TURNED[name]))
    assert [one.angle_deg for one in channels] == [pytest.approx(90.0, abs=1e-3)] * len(channels)
    assert read_image(tmp_path / name, "0").angle_deg == pytest.approx(90.0, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "angle"),
    [
        ("1.5708", 90.0),
        ("-0.785398", -45.0),
        ("6.28319", 360.0),
        ("90", 90.0),
        ("1.5 deg", 1.5),
        ("1 °", 1.0),
        ("?", None),
    ],
)
def test_a_rotation_of_nanoscope_is_in_radians_unless_it_cannot_be(text: str, angle: float | None) -> None:
    """As in a file of an instrument, version 9.3, whose ``Rotate Ang.`` is a right angle: 1.5708."""
    assert rotation_deg(text) == (None if angle is None else pytest.approx(angle, abs=1e-3))


@pytest.mark.parametrize(
    ("key", "text", "angle"),
    [
        *(
            ("ScanAngle", "90", 90.0),
            ("Scan angle", "-30 deg", -30.0),
            ("Rotate Ang.", "12.5 °", 12.5),
            ("Rotate Ang.", "1.5708", 90.00021),
        ),
        *(("NanonisRecord::Scan_angle", "45°", 45.0), ("Scan angle", "unknown", None), ("Scan angle", " ", None)),
        ("Phase angle", "90", None),
    ],
)
def test_the_scan_angle_of_a_gwyddion_file_is_in_its_metadata(
    key: str, text: str, angle: float | None, tmp_path: Path
) -> None:
    gwy(tmp_path / "a.gwy", {key: text}, Z=T)
    assert read_image(tmp_path / "a.gwy").angle_deg == (None if angle is None else pytest.approx(angle))


def test_without_an_angle_none_is_made_up(tmp_path: Path) -> None:
    for name, content in (("a.ibw", ibw(ASYLUM, NOTE)), ("a.spm", spm({"Height": (T, R)})), ("a.npy", npy(T))):
        assert channels_of(put(tmp_path, name, content))[0].angle_deg is None


@pytest.mark.parametrize("preview", [("thumbnail", (64, 64)), ("thumbnail", (40, 48)), ("", (16, 16))])
def test_a_preview_is_no_channel(preview: tuple[str, tuple[int, ...]], tmp_path: Path) -> None:
    path = put(tmp_path, "a.jpk", jpk({"height": (T, R)}, preview=preview))
    channels = channels_of(path)
    assert [(one.number, one.title) for one in channels] == [(0, "height trace"), (1, "height retrace")]
    assert {image.heights.shape for image in read_channels(path)} == {T.shape}


@pytest.mark.parametrize(
    ("title", "signal", "direction"),
    [
        *(("HeightTrace", "Height", "trace"), ("ZSensorRetrace", "ZSensor", "retrace")),
        *(("Z (Backward)", "Z", "retrace"), ("Height [Trace]", "Height", "trace")),
        *(("height_retrace", "height", "retrace"), ("Z forward", "Z", "trace")),
        *(("Height", "Height", None), ("Trace", "Trace", None), ("Retrace", "Retrace", None), ("", "", None)),
        ("Traces of gold", "Traces of gold", None),
    ],
)  # fmt: skip
def test_directions_in_titles(title: str, signal: str, direction: str | None) -> None:
    assert split_direction(title) == (signal, direction)


def test_a_title_without_end_is_not_looked_into() -> None:
    assert split_direction(" " * (1 << 20) + "Trac") == (" " * (1 << 20) + "Trac", None)


# chosen


def test_pairs_of_two_files_and_of_one(tmp_path: Path) -> None:
    both = put(tmp_path, "a.ibw", ibw(ASYLUM, NOTE))
    for channel in ("ZSensor", "ZSensorTrace", "2"):
        trace, retrace = read_pair(both, channel=channel)
        assert (trace.channel, retrace.channel) == ("ZSensorTrace", "ZSensorRetrace")
    trace, retrace = read_pair(both, both, "Height", "ZSensorRetrace")
    assert (trace.channel, retrace.channel) == ("HeightTrace", "ZSensorRetrace")
    one, other = (
        put(tmp_path, f"{d}.ibw", ibw({f"Height{d}": ASYLUM[f"Height{d}"]}, NOTE)) for d in ("Trace", "Retrace")
    )
    trace, retrace = read_pair(one, other)
    assert (trace.direction, retrace.direction) == ("trace", "retrace")
    assert (trace.source.name, retrace.source.name) == ("Trace.ibw", "Retrace.ibw")


def test_what_is_no_pair_is_said(tmp_path: Path) -> None:
    both = put(tmp_path, "a.ibw", ibw(ASYLUM, NOTE))
    one = put(tmp_path, "t.ibw", ibw({"HeightTrace": ASYLUM["HeightTrace"]}, NOTE))
    other = put(tmp_path, "r.ibw", ibw({"HeightRetrace": ASYLUM["HeightRetrace"]}, NOTE))
    plain = put(tmp_path, "a.npy", npy(T))
    there = "0 (HeightTrace), 1 (HeightRetrace), 2 (ZSensorTrace), 3 (ZSensorRetrace)"

    def refused(*arguments: Path | str | None) -> str:
        return why(*arguments, read=read_pair)  # type: ignore[arg-type]

    assert f"a.ibw: has no channel 'Phase'; there is {there}" in refused(both, None, "Phase")
    assert "t.ibw: channel 0 ('HeightTrace') is the trace by the file; the retrace is needed here" in refused(one)
    assert "r.ibw: channel 0 ('HeightRetrace') is the retrace by the file; the trace is needed" in refused(other, one)
    assert "a.npy: channel 0 ('') has no retrace in this file; give it too" in refused(plain)
    assert "has several channels" in why(
        put(tmp_path, "a.sxm", sxm({"Z": (T, R)}))
    )  # of an image, either could be meant


@pytest.mark.parametrize(
    ("titles", "chosen"),
    [
        (("AmplitudeTrace", "HeightTrace", "ZSensorTrace"), "HeightTrace"),  # the exact name before a longer one
        (("Current forward", "Z forward"), "Z forward"),
        (("Phase", "Height Sensor"), "Height Sensor"),
        (("Phase", "Height Sensor", "Topo raw"), None),  # two could be meant
        (("Phase", "Current"), None),
        (("Phase", "Zeta"), None),  # begins like a height
    ],
)
def test_the_height_is_the_channel_where_none_is_named(titles: tuple[str, ...], chosen: str | None) -> None:
    listed = [channel_of_array(number, title, T) for number, title in enumerate(titles)]
    if chosen is None:
        with pytest.raises(ValueError, match=r"has several channels, 0 .*; choose with --channel"):
            choose(listed, None, "trace")
    else:
        assert choose(listed, None, "trace").title == chosen
        assert choose(listed, "0", "trace").title == titles[0]  # a name or number goes first


OTHERS: dict[str, tuple[bytes, str, float, float, str, str | None]] = {
    # name: content of both directions or of the trace, signal, nm of a unit, the most in nm, unit, where row 0 is
    "a.spm": (iso28600({"Z (Forward)": T * 1e-9, "Z (Backward)": R * 1e-9}, mode="MAP_MC"), "Z", 1e9, 1e-5, "m", "top"),
    "up.spm": (iso28600({"Z forward": T * 1e-9}, slow="bottom to top"), "Z", 1e9, 1e-5, "m", None),
    "a.stp": (wsxm(T - np.min(T)), "Topography", 1.0, 1e-3, "nm", "bottom"),
    "down.TOP": (wsxm(T, "double", slow="Down"), "Topography", 1.0, 1e-9, "nm", "top"),
    "a.nid": (nid({"Z-Axis": (T, R), "Phase": (P, Q)}), "Z-Axis", 1e9, 1e-6, "m", None),
    "curves.nid": (nid({"Z-Axis": (T, R)}, bits=16, curves=True), "Z-Axis", 1e9, 2e-3, "m", None),
    "a.mdt": (mdt({"1F:Height": T, "1B:Height": R, "2F:Phase": P}), "Height", 1.0, 6e-3, "nm", None),
    "dots.mdt": (mdt({"1F:Height": T}, dots=2), "Height", 1.0, 6e-3, "nm", None),
    "a.nc": (gxsm(T), "Topography", 0.1, 1e-3, "Å", None),
    "a.tiff": (park(T), "Height", 1.0, 6e-3, "nm", "bottom"),
    "down.tif": (park(T, kind=2, up=False), "Height", 1.0, 1e-5, "nm", "top"),
    "long.tif": (park(T, kind=1), "Height", 1.0, 6e-3, "nm", "bottom"),
}


@pytest.mark.parametrize("name", OTHERS)
def test_further_formats(name: str, tmp_path: Path) -> None:
    content, signal, nm, near, unit, first = OTHERS[name]
    path = put(tmp_path, name, content)
    ways = [(T, "trace")] + [(R, "retrace")] * (len({one.direction for one in channels_of(path)}) - 1)
    for heights, direction in ways:
        image = read_image(path, signal, direction)  # type: ignore[arg-type]
        off = image.heights * nm - heights
        assert np.max(np.abs(off - (np.mean(off) if name == "a.stp" else 0.0))) < near  # 16 bits begin anywhere
        assert (image.signal, image.direction, image.unit, image.first_row) == (signal, direction, unit, first)
        assert (image.width_nm, image.height_nm) == (pytest.approx(500.0), pytest.approx(250.0))
        states_a_rate = path.suffix.lower() in (".spm", ".stp", ".top", ".tif", ".tiff")
        assert image.line_rate_hz == (pytest.approx(2.5) if states_a_rate else None)


@pytest.mark.parametrize("kind", ["Parameter", "Paramet32", "Paramco32"])
def test_channels_of_createc_with_rows_that_were_not_scanned(kind: str, tmp_path: Path) -> None:
    stopped = [np.where(np.arange(40)[:, None] < 33, heights, 0.0) for heights in (T, R)]
    path = put(tmp_path, "a.dat", createc(stopped, kind))
    for number, heights in enumerate((T, R)):
        image = read_image(path, str(number))
        assert np.max(np.abs(image.heights / 1000.0 - heights[:33])) < 6e-4
        assert (image.unit, image.direction, image.angle_deg) == ("LSB", None, 90.0)
        assert (image.width_nm, image.height_nm) == (pytest.approx(500.0), pytest.approx(250.0 * 33 / 40))


@pytest.mark.parametrize(("times", "turn"), [((12.5, 2.5), 0.83333333), ((0.25, 0.25), 0.5), ((0.0, 2.5), None)])
def test_the_turn_is_by_the_times_of_both_directions(
    times: tuple[float, float], turn: float | None, tmp_path: Path
) -> None:
    (trace, _) = read_pair(put(tmp_path, "a.sxm", sxm(NANONIS, times_s=times)), channel="Z")
    assert trace.turn == (None if turn is None else pytest.approx(turn))
    assert trace.line_rate_hz == (None if turn is None else pytest.approx(1.0 / sum(times)))


@pytest.mark.parametrize(
    ("speed", "window"),
    [("3.125e-06", (0.1, 0.9)), ("2.5e-06", (0.0, 1.0)), ("2e-06", None), ("1e-3", None), ("nan", None), (None, None)],
)
def test_the_window_is_by_the_speed_of_the_tip(
    speed: str | None, window: tuple[float, float] | None, tmp_path: Path
) -> None:
    note = NOTE if speed is None else NOTE | {"ScanSpeed": speed}
    image = read_image(put(tmp_path, "a.ibw", ibw(ASYLUM, note)), "HeightTrace")
    assert image.window == (None if window is None else pytest.approx(window))


def test_channels_of_one_name_are_chosen_by_number_and_pair_in_their_order(tmp_path: Path) -> None:
    info = sxm({"Z": (T * 1e-9, R * 1e-9), "I": (P * 1e-9, Q * 1e-9)}).replace(b"\tI\t", b"\tZ\t")
    path = put(tmp_path, "a.sxm", info)
    assert "has more than one channel 'Z': 0 (Z forward), 2 (Z forward); choose one by its number" in why(
        path, "Z", read=lambda path, channel: read_image(path, channel, "trace")
    )
    for number, heights in (("0", (T, R)), ("2", (P, Q))):
        for image, one in zip(read_pair(path, channel=number), heights, strict=True):
            assert np.max(np.abs(image.heights * 1e9 - one)) < 1e-5


def test_a_trace_with_two_retraces_is_refused_until_one_is_chosen(tmp_path: Path) -> None:
    labels = {"HeightTrace": T * 1e-9, "HeightRetrace": R * 1e-9, "OtherRetrace": P * 1e-9}
    content = ibw(labels, NOTE).replace(b"OtherRetrace" + bytes(20), b"HeightRetrace" + bytes(19))
    path = put(tmp_path, "a.ibw", content)
    said = "has 1 x the trace and 2 x the retrace of 'Height': 1 (HeightRetrace), 2 (HeightRetrace); choose one by its"
    assert said in why(path, None, "Height", read=read_pair)
    assert said in why(path, "Height", read=tablegen.read_image)
    assert said in why(path, "Height", read=lambda path, name: sample_image(1.0, None, path, None, {"channel": name}))
    assert said in why(path, read=lambda path: read_scan(path, None, Choice()))
    assert read_scan(path, None, Choice(retrace_channel="2")).reference == (0, 2)
    trace = tablegen.read_image(path, "Height", retrace_channel=1)
    assert trace.retrace is not None
    assert np.max(np.abs(trace.retrace.heights * 1e9 - R)) < 1e-5


def test_a_correction_of_two_channels_of_one_name_is_by_their_number(tmp_path: Path) -> None:
    two = sxm({"Z": (T * 1e-9, R * 1e-9), "I": (P * 1e-9, Q * 1e-9)}).replace(b"\tI\t", b"\tZ\t")
    path = put(tmp_path, "a.sxm", two)
    for number, reference in (("0", (0, 1)), ("2", (2, 3)), ("3", (3,))):
        assert read_scan(path, None, Choice(channel=number)).reference == reference
    for channel in (None, "Z"):
        said = why(path, channel, read=lambda path, name: read_scan(path, None, Choice(channel=name)))
        assert "a.sxm: has more than one channel 'Z" in said
        assert ": 0 (Z forward), 2 (Z forward); choose " in said


def test_files_of_gxsm_as_scipy_has_them(tmp_path: Path) -> None:
    """A backward line begins at its right end; the values are those that another reader of NetCDF finds."""
    pair = [put(tmp_path, f"{back}.nc", gxsm(heights, back)) for back, heights in ((False, T), (True, R))]
    for image, heights, path in zip(read_pair(*pair), (T, R), pair, strict=True):
        assert np.max(np.abs(0.1 * image.heights - heights)) < 1e-3
        with netcdf_file(str(path), mmap=False) as other:
            field, step = other.variables["FloatField"][0, 0], float(other.variables["dz"].getValue())
        stored = image.heights[:, ::-1] if image.direction == "retrace" else image.heights
        assert np.array_equal(stored, step * field.astype(float))
    movie = put(tmp_path, "movie.nc", gxsm(T, frames=3))
    assert [one.frames for one in channels_of(movie)] == [3]
    assert np.max(np.abs(0.1 * read_image(movie, frame=2).heights - T - 0.02)) < 1e-3


def test_files_of_gxsm_without_scale_or_unit_and_of_other_layouts(tmp_path: Path) -> None:
    content = gxsm(T)
    plain = read_image(put(tmp_path, "a.nc", content.replace(b"\0\0\0\x02dz", b"\0\0\0\x02dw")))
    assert (plain.unit, plain.width_nm) == ("LSB", pytest.approx(500.0))
    display = read_image(put(tmp_path, "b.nc", content.replace(b"var_unit", b"own_unit")))
    assert (display.unit, display.width_nm) == ("", None)  # a unit of the display says nothing about the number
    assert "is of NetCDF 4; convert it" in why(put(tmp_path, "c.nc", b"\x89HDF\r\n\x1a\n" + bytes(100)))
    assert "has no FloatField or H over" in why(put(tmp_path, "d.nc", content.replace(b"FloatField", b"WordsField")))


def test_files_of_an_electrochemical_cell(tmp_path: Path) -> None:
    content = spm({"Height": (T, R)}, aspect="48:40").replace(b"\\*File list\r", b"\\*EC File list\r", 1)
    content = content.replace(b"\x1a\0\0\0", b"\x1a", 1)  # the data stay where the header says
    assert np.max(np.abs(read_image(put(tmp_path, "a.001", content), "Height", "trace").heights - T)) < 1e-3


@pytest.mark.parametrize(
    ("unit", "nm"), [("nm", 1.0), ("\\u00B5m", 1e3), ("micron", 1e3), ("µm", 1e3), ("pixel", None), ("inch", None)]
)
def test_the_pixel_of_imagej(unit: str, nm: float | None, tmp_path: Path) -> None:
    import tifffile

    text = f"ImageJ=1.53t\nimages=1\nunit={unit}\nmin=0\n"
    tifffile.imwrite(
        tmp_path / "a.tif", T.astype("f4"), description=text.encode("latin-1"), metadata=None, resolution=(4.0, 8.0)
    )
    image = read_image(tmp_path / "a.tif")
    sides = (None, None) if nm is None else (pytest.approx(48 / 4.0 * nm), pytest.approx(40 / 8.0 * nm))
    assert (image.width_nm, image.height_nm) == sides
    tifffile.imwrite(tmp_path / "b.tif", T.astype("f4"), description="Other", metadata=None, resolution=(4.0, 8.0))
    assert read_image(tmp_path / "b.tif").width_nm is None  # dots per inch of a printer


def test_the_size_is_that_of_all_pixels_by_other_readers(tmp_path: Path) -> None:
    """N pixels in the width. Igor has N - 1 steps in it; the range of Nanonis and Gwyddion's size are of N."""
    igor = put(tmp_path, "a.ibw", ibw(ASYLUM, NOTE | {"ScanLines": "160"}, step_m=(5e-7 / 47, 2.5e-7 / 159)))
    step = binarywave.load(str(igor))["wave"]["wave_header"]["sfA"] * 1e9
    image = read_image(igor, "HeightTrace")
    assert image.width_nm == pytest.approx(step[0] * 47, rel=1e-3)
    assert image.height_nm == pytest.approx(40 * step[1] * 159 / 160, rel=1e-3)
    nanonis = put(tmp_path, "a.sxm", sxm(NANONIS))
    size = nanonispy2.read.Scan(str(nanonis)).header["scan_range"] * 1e9
    image = read_image(nanonis, "Z", "trace")
    assert (image.width_nm, image.height_nm) == pytest.approx(tuple(size), rel=1e-3)
    container = GwyContainer()
    container["/0/data"] = GwyDataField(T, xreal=5e-7, yreal=2.5e-7, si_unit_xy="m", si_unit_z="m")
    container.tofile(str(tmp_path / "size.gwy"))
    field = GwyContainer.fromfile(str(tmp_path / "size.gwy"))["/0/data"]
    image = read_image(tmp_path / "size.gwy")
    assert (image.width_nm, image.height_nm) == pytest.approx((field.xreal * 1e9, field.yreal * 1e9), rel=1e-3)


# damaged

SMALL = np.random.default_rng(2).uniform(-20.0, 20.0, (3, 4))
READERS: dict[str, tuple[bytes, Callable[[bytes, str], list[Channel]]]] = {
    "sxm": (sxm({"Z": (SMALL, SMALL)}), sxm_channels),
    "ibw": (ibw({"HeightTrace": SMALL, "HeightRetrace": SMALL}, NOTE), ibw_channels),
    "spm": (spm({"Height": (SMALL, SMALL)}), spm_channels),
    "jpk": (jpk({"height": (SMALL, SMALL)}), jpk_channels),
    "asd0": (asd({"TP": np.stack([SMALL] * 2)}, 0), asd_channels),
    "asd1": (asd({"TP": np.stack([SMALL] * 2)}, 1), asd_channels),
    "iso": (iso28600({"Z (Forward)": SMALL, "Z (Backward)": SMALL}, mode="MAP_MC"), iso_channels),
    "stp": (wsxm(SMALL), wsxm_channels),
    "top": (wsxm(SMALL, "double"), wsxm_channels),
    "dat": (createc([SMALL, SMALL]), createc_channels),
    "dat1": (createc([SMALL, SMALL], "Parameter"), createc_channels),
    "nid": (nid({"Z-Axis": (SMALL, SMALL)}, curves=True), nid_channels),
    "mdt": (mdt({"1F:Height": SMALL, "1B:Height": SMALL}), mdt_channels),
    "park": (park(SMALL), park_channels),
    "h5-jpk": (h5_jpk(), h5_jpk_channels),
    "nc": (gxsm(SMALL, frames=2), gxsm_channels),
}
NOT_NEEDED = {"iso": 1, "dat": 40, "dat1": 32, "mdt": 0}  # bytes behind the last pixel that may be missing


def read_or_refused(reader: Callable[[bytes, str], list[Channel]], content: bytes) -> bool:
    """Whether it was read, with all its pixels; ``ValueError`` is all that it may raise."""
    try:
        channels = reader(content, "a")
        with np.errstate(all="ignore"):
            for channel in channels[:10]:
                if len(channel.shape) == 2 and min(channel.shape) and np.prod(channel.shape, dtype=float) < 1e6:
                    assert channel.load(channel.frames - 1).shape == channel.shape
    except ValueError:
        return False
    return bool(channels)


@pytest.mark.parametrize("kind", READERS)
def test_a_file_that_ends_early_is_refused_wherever_it_ends(kind: str) -> None:
    content, reader = READERS[kind]
    whole = len(content)
    step = {"spm": 7, "dat": 41, "dat1": 41, "h5-jpk": 41}.get(kind, 1)  # headers most of which is empty
    assert read_or_refused(reader, content)
    needed = whole - NOT_NEEDED.get(kind, 0)
    assert [cut for cut in range(0, needed, step) if read_or_refused(reader, content[:cut])] == []


@pytest.mark.common
@pytest.mark.parametrize("kind", READERS)
def test_damage_is_refused_or_read_and_never_worse(kind: str) -> None:
    content, reader = READERS[kind]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        changed = [damaged(content, random.Random(seed)) for seed in range(300)]
        if kind == "ibw":  # a checksum that is right, so that more is looked at
            changed = [summed(one, "<i", 4, 320 + 96) if len(one) > 400 else one for one in changed]
        read = [read_or_refused(reader, one) for one in changed]
    assert 0 < sum(read) < len(read)


@pytest.mark.parametrize(("name", "content"), [("a.h5-jpk", h5_jpk()), ("a.nc", gxsm(T))])
def test_bits_that_flipped_are_refused_with_the_name_of_the_file(name: str, content: bytes, tmp_path: Path) -> None:
    """As a user meets it: a file that ends early or has other bits, all of whose channels are read."""
    path = tmp_path / name
    reasons: list[str] = []
    for seed in range(40):
        chance = random.Random(seed)
        changed = bytearray(content if seed % 2 else content[: chance.randrange(len(content))])
        for _ in range(min(chance.randrange(1, 20), len(changed))):
            changed[chance.randrange(len(changed))] ^= 1 << chance.randrange(8)
        path.write_bytes(changed)
        try:
            for one in channels_of(path)[:9]:
                read_image(path, str(one.number), frame=0)
        except Rejected as rejected:
            reasons += map(str, rejected.problems)
    assert 20 <= len(reasons) < 40
    assert all(name in reason for reason in reasons)


WORLD = 2_000_000_000
HUGE: dict[str, tuple[str, Callable[[bytes], bytes], str]] = {
    "sxm": ("sxm", lambda c: c.replace(b"       4       3\n", b" 999999 999999\n"), "ends in the middle of its images"),
    "sxm, digits": ("sxm", lambda c: c.replace(b"       4       3\n", b" 9" * 4000), "no two numbers as SCAN_PIXELS"),
    "sxm, nothing": ("sxm", lambda c: c.replace(b"       4       3\n", b"  0  3\n"), "has an image of 0 x 3 pixels"),
    "sxm, rows": ("sxm", lambda c: re.sub(rb"(\t14.*\n)", rb"\1" * 2000, c), "has 4000 images; at most 1000 are read"),
    "sxm, no end": ("sxm", lambda c: c.replace(b":SCANIT_END:", b":COMMENT2:"), "has no end of its header"),
    "sxm, no mark": ("sxm", lambda c: c.replace(b"\x1a\x04", b"\x1a\x1a"), "no data after it"),
    "sxm, integers": ("sxm", lambda c: c.replace(b"FLOAT  ", b"INT    "), "numbers of the kind 'INT MSBFIRST'"),
    "sxm, no table": ("sxm", lambda c: c.replace(b"\tUnit\t", b"\tEinheit\t"), "does not say Name, Unit and Direction"),
    "ibw": ("ibw", lambda c: summed(c, "<ii", 132, 40_000, 50_000), "2 images of 40000 x 50000 pixels have 96 bytes"),
    "ibw, negative": ("ibw", lambda c: summed(c, "<i", 12, -5), "says that 2 images of 4 x 3 pixels have 96 bytes"),
    "ibw, layers": ("ibw", lambda c: summed(c, "<i", 140, WORLD), "has 2000000000 channels; at most 1000"),
    "ibw, text": ("ibw", lambda c: summed(c, "<h", 80, 0), "is a wave of text or of complex numbers"),
    "ibw, curves": ("ibw", lambda c: summed(c, "<i", 136, 0), "does it hold force curves?"),
    "ibw, note": ("ibw", lambda c: summed(c, "<i", 12, WORLD), "ends in the middle of its images or texts"),
    "ibw, changed": ("ibw", lambda c: c[:200] + b"?" + c[201:], "has a header with a wrong checksum"),
    "spm": ("spm", lambda c: c.replace(b"Samps/line: 4", b"Samps/line: 999999999"), "image 0 of 999999999 x 3"),
    "spm, offset": ("spm", lambda c: c.replace(b"offset: 4096", b"offset: 9999999999"), "from byte 9999999999 of"),
    "spm, minus": ("spm", lambda c: c.replace(b"length: 24", b"length: -4"), "has no whole number as data length"),
    "spm, curves": ("spm", lambda c: c.replace(b"\\*File list\r", b"\\*Force file list\r"), "of force curves"),
    "jpk, curves": ("jpk", lambda _: b"PK\x03\x04" + bytes(100), "is an archive of curves, not of images"),
    "jpk, tags": ("jpk", lambda _: flood_of_tags(), "more than 100000 tags"),
    "h5-jpk, layout": ("h5-jpk", lambda c: c[:8] + b"\x02" + c[9:], "has a superblock of version 2"),
    "h5-jpk, sides": ("h5-jpk", lambda c: with_attribute(c, "ilength", "<i", WORLD), "image of 2000000000 x 40"),
    "h5-jpk, minus": ("h5-jpk", lambda c: with_attribute(c, "jlength", "<i", -40), "image of 40 x -40"),
    "h5-jpk, columns": ("h5-jpk", lambda c: with_attribute(c, "ilength", "<i", 41), "has 1360 values x 2 frames"),
    "h5-jpk, rows": ("h5-jpk", lambda c: with_attribute(c, "jlength", "<i", 33), "channel 'height' of 40 x 33"),
    "h5-jpk, no sides": ("h5-jpk", lambda c: c.replace(b"grid.ilength", b"grid.elength"), "no whole number as"),
    "h5-jpk, no array": ("h5-jpk", lambda c: c.replace(b"Height\0", b"Weight\0"), "no array of pixels x frames"),
    "h5-jpk, tree": ("h5-jpk", lambda c: with_child(c, 136), "has a group without members"),
    "h5-jpk, circle": ("h5-jpk", lambda c: with_child(c[:141] + b"\1" + c[142:], 136), "a tree that refers to itself"),
    "asd": ("asd1", lambda c: with_numbers(c, 36, WORLD), "2000000000 frames by its header and bytes for 2"),
    "asd, pixels": ("asd1", lambda c: with_numbers(c, 48, WORLD, WORLD), "has frames of 2000000000 x"),
    "asd, header": ("asd1", lambda c: with_numbers(c, 4, -4), "frames behind -4 bytes of header"),
    "asd, name": ("asd0", lambda c: with_numbers(c, 16, WORLD), "ends in its header"),
    "iso, pixels": ("iso", lambda c: c.replace(b"\n4\n3\n", b"\n999999\n999999\n"), "an image of 999999 x 999999"),
    "iso, more": ("iso", lambda c: c.replace(b"\n4\n3\n", b"\n2\n2\n"), "more lines of numbers than its 4 pixels"),
    "iso, word": ("iso", lambda c: c.replace(b"end of header\n", b"end of header\nx"), "something else than numbers"),
    "iso, fewer": ("iso", lambda c: c.replace(b"\n4\n3\n", b"\n4\n4\n"), "has 24 numbers for 2 images of 16"),
    "iso, lines": ("iso", lambda c: c.replace(b"MAP_MC\n", b"MAP_MC\n\n"), "has no header of 128 lines"),
    "iso, fast": ("iso", lambda c: c.replace(b"\nX\n", b"\nY\n"), "has 'Y' as its fast axis"),
    "iso, curves": ("iso", lambda c: c.replace(b"MAP_MC", b"SPEC_SC"), "holds 'SPEC_SC'"),
    "stp": ("stp", lambda c: c.replace(b"columns: 4", b"columns: 99"), "in the middle of its image of 99 x 3"),
    "stp, header": ("stp", lambda c: re.sub(rb"size: +\d+", b"size: 9999999", c), "has no end of its header"),
    "stp, kind": ("stp", lambda c: c.replace(b"Type: short", b"Type: quad"), "numbers of the kind 'quad'"),
    "dat": ("dat", lambda c: c.replace(b"Num.X=4", b"Num.X=9"), "in the middle of its 2 images of 9 x 3"),
    "dat, packed": ("dat", lambda c: c[: 1 << 14] + b"abc", "cannot be unpacked"),
    "dat, channels": ("dat", lambda c: c.replace(b"Channels=2", b"Channels=0"), "has 0 channels; 1 to 100"),
    "nid": ("nid", lambda c: c.replace(b"Points=4", b"Points=9999"), "in the middle of its data set 'DataSet-1:0'"),
    "nid, bits": ("nid", lambda c: c.replace(b"Bits=32", b"Bits=12"), "numbers of an unknown kind in 'DataSet-1:0'"),
    "mdt": ("mdt", lambda c: c[:33] + struct.pack("<I", WORLD) + c[37:], "ends in its frame 0 of 3"),
    "mdt, still": ("mdt", lambda c: c[:33] + struct.pack("<I", 0) + c[37:], "ends in its frame 0 of 3"),
    "park": ("park", lambda c: c.replace(struct.pack("<2i", 4, 3), struct.pack("<2i", WORLD, 3)), "of 2000000000 x 3"),
    "park, kind": ("park", lambda c: c[:-232] + b"\x07" + c[-231:], "pixels of the kind 7"),
    "park, swapped": ("park", lambda _: park(SMALL, swapped=True), "was scanned with x and y exchanged"),
    "nc, pixels": ("nc", lambda c: c.replace(b"dimx\0\0\0\4", b"dimx\x7f\0\0\0"), "has an image of 2130706432 x 3"),
    "nc, frames": ("nc", lambda c: c.replace(b"time\0\0\0\2", b"time\x7f\0\0\0"), "in the middle of 'FloatField'"),
    "nc, no frames": ("nc", lambda c: c.replace(b"time\0\0\0\2", b"time\0\0\0\0"), "has no frames"),
    "nc, header": ("nc", lambda c: c[:15] + b"\1\0\x50\0\0" + bytes(5 << 20), "a header of more than 4 MiB"),
    "nc, axis": ("nc", lambda c: c.replace(b"Field\0\0\0\0\0\4\0\0\0\0", b"Field\0\0\0\0\0\4\0\0\0\x63"), "not there"),
    "nc, records": ("nc", lambda c: c[:7] + b"\5" + c[8:], "has records of NetCDF"),
    "nc, list": ("nc", lambda c: c[:12] + b"\x7f" + c[13:], "has a header that is not one of NetCDF"),
    "asd, version": ("asd1", lambda c: with_numbers(c, 0, 9), "of version 0, 1 or 2"),
}  # fmt: skip


def with_numbers(content: bytes, at: int, *values: int) -> bytes:
    """Numbers of four bytes in a header."""
    return content[:at] + struct.pack(f"<{len(values)}i", *values) + content[at + 4 * len(values) :]


def with_attribute(content: bytes, name: str, layout: str, value: float) -> bytes:
    """Another number of the grid in a JPK file of HDF5, at the end of the attribute's message."""
    at = content.index(f"position-pattern.grid.{name}\0".encode())
    message = at - 16  # two headers of 8 bytes before the name
    (size,) = struct.unpack_from("<H", content, message + 2)
    start = message + 8 + size - 8  # numbers fill 8 bytes
    return content[:start] + struct.pack(layout, value) + content[start + struct.calcsize(layout) :]


def with_child(content: bytes, address: int) -> bytes:
    """Another address as the first child of the tree of the root group, which is at byte 136."""
    return content[:168] + struct.pack("<Q", address) + content[176:]


def summed(content: bytes, layout: str, at: int, *values: int) -> bytes:
    """Numbers in the headers of an Igor file, with the checksum put right."""
    made = bytearray(content)
    struct.pack_into(layout, made, at, *values)
    struct.pack_into("<H", made, 2, 0)
    struct.pack_into("<H", made, 2, -int(np.frombuffer(bytes(made[:384]), "<u2").sum()) & 0xFFFF)
    return bytes(made)


def flood_of_tags() -> bytes:
    """A few directories with more tags than any file has."""
    tags, pages = 30_000, 4
    size = 2 + 12 * tags + 4
    ends = [*(8 + size * (page + 1) for page in range(pages - 1)), 0]
    return b"II*\0\x08\0\0\0" + b"".join(
        struct.pack("<H", tags) + bytes(12 * tags) + struct.pack("<I", after) for after in ends
    )


@pytest.mark.parametrize("what", HUGE)
def test_numbers_that_the_file_cannot_have_are_refused(what: str) -> None:
    kind, change, said = HUGE[what]
    content, reader = READERS[kind]
    changed = change(content)
    assert changed != content
    with pytest.raises(ValueError, match=re.escape(said)):
        reader(changed, "a")


def test_scales_that_overflow_are_no_heights(tmp_path: Path) -> None:
    content = (
        spm({"Height": (T, R)})
        .replace(b"V/LSB) 20.00000 V", b"V/LSB) 1E+300000 V")
        .replace(b"5.000000 nm", b"5E+300000 nm")
    )
    image = read_image(put(tmp_path, "a.spm", content), "Height trace")
    assert image.unit == "LSB"  # a scale that is no number is none
    content = spm({"Height": (T, R)}).replace(b"20.00000 V\r", b"20.0E+300 V\r").replace(b"5.000000 nm", b"5.0E+300 nm")
    assert "pixels are infinite" in why(put(tmp_path, "b.spm", content), "Height trace")


def test_what_stands_in_other_lists_of_a_nanoscope_file_is_not_of_the_scan() -> None:
    """The list of force curves has a scan rate of its own; of sensitivities, the first is the scanner's."""
    content = spm({"Height": (SMALL, SMALL)})
    force = b"\\*Ciao force list\r\n\\Scan rate: 9.9\r\n\\@Sens. Zsens: V 7.0 m/V\r\n\\*Ciao image list"
    longer = content.replace(b"\\*Ciao image list", force, 1).replace(bytes(len(force) - 17), b"", 1)
    channel, _ = spm_channels(longer, "a")
    assert (channel.line_rate_hz, channel.unit) == (2.5, "nm")
    (channel, _) = spm_channels(content.replace(b"Scan Rate: 2.5", b"Scan Moth: 2.5"), "a")
    assert channel.line_rate_hz is None


def test_units_of_an_igor_file() -> None:
    labels = ("HeightTrace", "PhaseTrace", "FrequencyRetrace", "UserIn0Trace")
    channels = ibw_channels(ibw(dict.fromkeys(labels, SMALL), NOTE), "a")
    assert [channel.unit for channel in channels] == ["m", "deg", "Hz", ""]
    assert ibw_channels(ibw({"UserIn0Trace": SMALL}, NOTE), "a")[0].unit == "m"  # the wave's own


def test_another_scaling_of_jpk_is_not_taken_for_a_line() -> None:
    content = jpk({"height": (SMALL, SMALL)}).replace(b"LinearScaling", b"SquareScaling")
    channel = jpk_channels(content, "a")[0]
    assert channel.unit == "LSB"
    assert channel.load(0) == pytest.approx(np.round((SMALL + 100.0) / 0.01))


def test_an_image_says_what_it_has() -> None:
    """What a file does not say is None or empty, never a guess."""
    content = ibw({"HeightTrace": SMALL}, {})
    (channel,) = ibw_channels(content, "a")
    assert (channel.width_nm, channel.height_nm, channel.line_rate_hz) == (None, None, None)
    assert channel.first_row == "bottom"  # as the format stores it, whatever came first in time
    assert sxm_channels(sxm({"Z": (SMALL, SMALL)}, scan_dir="?"), "a")[0].first_row is None
    (trace, _) = spm_channels(spm({"Height": (SMALL, SMALL)}), "a")
    assert (trace.width_nm, trace.height_nm) == (500.0, None)  # pixels that are not square: readers differ
    content = spm({"Height": (SMALL, SMALL)}).replace(b"@Sens. Zsens", b"@Sens. Other")
    assert spm_channels(content, "a")[0].unit == "V"
    content = asd({"XX": np.stack([SMALL])})
    assert asd_channels(content, "a")[0].unit == "LSB"
    assert ScanImage.__dataclass_fields__["width_nm"].default is None
