"""Files without end, pipes, devices and small files with a large effect: a message and status 2, within 5 s and 500 MB.

Each is a process of its own, limited in CPU time, whose memory is measured.
"""

import json
import os
import re
import struct
import subprocess
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import measured
import numpy as np
import pytest
import tifffile
from editing import SCAN, SCANNER, edited, run, write_pair
from image_writers import npy
from instrument_files import sxm
from limits import PATIENCE_S, within
from sets import common, common_of, quick

CPU_S = 5
MOST_MEMORY_BYTES = 500 << 20
IMAGES = ("calibrate", "images", "--axis", "x", "--v-max", "100", "--pair", "50")


@pytest.fixture
def build(tmp_path: Path) -> Path:
    assert run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-q").status == 0
    return tmp_path / "out"


def refused(*arguments: str | Path, folder: Path) -> str:
    """The message of a command that ends with status 2, having taken little."""
    log, memory = folder / "stderr", folder / "memory"
    with log.open("wb") as err:
        done = subprocess.run(
            within(CPU_S, [*measured.command(memory), *map(str, arguments)]),
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=err,
            timeout=PATIENCE_S,
            check=False,
        )
    said = log.read_text("utf-8")
    assert done.returncode == 2, said[:2000]
    assert int(memory.read_text()) < MOST_MEMORY_BYTES
    assert len(said) < 20_000
    return said


def other_files(folder: Path) -> dict[str, Path]:
    """What is no regular file, by what messages call it."""
    os.mkfifo(folder / "pipe")
    (folder / "zero").symlink_to("/dev/zero")
    return {"a pipe": folder / "pipe", "a device": folder / "zero"}


READING: dict[str, Callable[[Path], tuple[str | Path, ...]]] = {
    "check": lambda path: ("check", path),
    "build": lambda path: ("build", path, "-q"),
    "show": lambda path: ("show", path),
    "simulate": lambda path: ("simulate", path),
    "truth": lambda path: ("simulate", "scan.toml", "--scanner-truth", path),
    "upload": lambda path: ("upload", path, "--dry-run"),
    "compared": lambda path: ("compare", path, "scan.toml"),
    "key": lambda path: ("status", "--port", "socket://127.0.0.1:9", "--key-file", path),
    "refined scan": lambda path: ("refine", path, "t.csv", "--axis", "x"),
    "trace": lambda path: ("refine", "scan.toml", path, "--axis", "x"),
    "table": lambda path: ("calibrate", "offset", path, "--axis", "x", "--v-max", "100"),
    "calibrated": lambda path: ("calibrate", "offset", "data.csv", "--axis", "x", "--scanner", path, "--write"),
    "image": lambda path: (*IMAGES, path, path),
    "old image": lambda path: ("correct", path, "--fit"),
}


@pytest.mark.common
@pytest.mark.parametrize("what", common_of(3, ["check"], READING))
def test_no_command_waits_at_a_pipe_or_reads_a_device(what: str, tmp_path: Path) -> None:
    write_pair(tmp_path)
    (tmp_path / "data.csv").write_text("offset_v,apparent_nm\n0,100\n50,120\n100,140\n")
    for other, path in other_files(tmp_path).items():
        named = path.rename(path.with_suffix(".npy")) if "image" in what else path
        said = refused(*READING[what](named), folder=tmp_path)
        assert str(named) in said
        assert other in said or "is not a file" in said


@pytest.mark.parametrize("name", quick([], ["manifest.json", "annexin_200nm.h", "_x.mem", "dac_axis.v"]))
def test_no_verification_waits_at_a_pipe(name: str, build: Path) -> None:
    (path,) = (path for path in build.iterdir() if path.name.endswith(name))
    path.unlink()
    os.mkfifo(path)
    for command in (("verify", build), ("upload", build, "--dry-run")):
        assert "a pipe, where" in refused(*command, folder=build.parent)


WRITING: dict[str, Callable[[Path], tuple[str | Path, ...]]] = {
    "build": lambda path: ("build", "scan.toml", "-o", path),
    "depfile": lambda path: ("build", "scan.toml", "--depfile", path),
    "plot": lambda path: ("calibrate", "offset", "data.csv", "--axis", "x", "--v-max", "100", "--plot", path),
    "simulated plot": lambda path: ("simulate", "scan.toml", "--plot", path),
    "csv": lambda path: ("simulate", "scan.toml", "--csv", path),
    "junit": lambda path: ("verify", "out", "--junit", path),
    "report": lambda path: ("report", "scan.toml", "-o", path),
    "comparison": lambda path: ("compare", "scan.toml", "scan.toml", "-o", path),
    "keep": lambda path: ("verify", "out", "--keep", path),
    "readback": lambda path: ("readback", "--port", "socket://127.0.0.1:9", "-o", path),
    "init": lambda path: ("init", path),
}


@pytest.mark.common
@pytest.mark.parametrize("what", common(["build"], WRITING))
def test_no_output_goes_into_a_pipe_or_over_a_device(what: str, build: Path) -> None:
    for other, path in other_files(build.parent).items():
        assert f"is {other}" in refused(*WRITING[what](path), folder=build.parent)
        assert path.exists()


@pytest.mark.common
def test_a_pipe_among_the_files_of_a_build(build: Path) -> None:
    header = build / "annexin_200nm.h"
    header.unlink()
    os.mkfifo(header)
    assert "annexin_200nm.h: is a pipe, where a file has to go" in refused(
        "build", "scan.toml", "-o", "out", folder=build.parent
    )


# Small files with a large effect.


def npy_saying(header: str) -> bytes:
    text = header.encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + bytes(100)


def unpacking(values: np.ndarray) -> bytes:
    """A TIFF file whose only strip unpacks into a gigabyte."""
    out = BytesIO()
    tifffile.imwrite(out, values)
    made = bytearray(out.getvalue())
    bomb = zlib.compress(bytes(1 << 30), 9)
    (first,) = struct.unpack_from("<I", made, 4)
    for i in range(struct.unpack_from("<H", made, first)[0]):
        at = first + 2 + 12 * i
        tag = struct.unpack_from("<H", made, at)[0]
        if tag == 259:
            struct.pack_into("<H", made, at + 8, 8)
        elif tag in (273, 279):
            struct.pack_into("<HII", made, at + 2, 4, 1, len(made) if tag == 273 else len(bomb))
    return bytes(made) + bomb


DAMAGED: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "directory of itself": ("a.tif", lambda: b"II*\0" + struct.pack("<IHI", 8, 0, 8), "comes again after itself"),
    "two directories in a ring": (
        "a.tif",
        lambda: b"II*\0" + struct.pack("<IHIHI", 8, 0, 14, 0, 8),
        "comes again after itself",
    ),
    "big directory of itself": (
        "a.tif",
        lambda: b"MM\0+\0\x08\0\0" + struct.pack(">QQQ", 16, 0, 16),
        "comes again after itself",
    ),
    "packed zeros": ("a.tif", lambda: unpacking(np.zeros((40, 40), np.uint16)), "unpacks into more than the image has"),
    "header of an array": ("a.npy", lambda: npy_saying("{'descr': '<f8', 'shape': (40, "), "is not a complete .npy"),
    "deep header": ("a.npy", lambda: npy_saying("(" * 110), "is not a complete .npy"),
    "header without keys": ("a.npy", lambda: npy_saying("{}"), "is not a complete .npy"),
    "array of the world": (
        "a.npy",
        lambda: npy_saying(f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({2**31}, {2**31})}}"),
        "bytes are fewer than those of",
    ),
    "array of nothing": (
        "a.npy",
        lambda: npy_saying(f"{{'descr': '|V0', 'fortran_order': False, 'shape': ({2**31}, {2**31})}}"),
        "is not a complete .npy",
    ),
    "list of texts": (
        "a.gwy",
        lambda: (
            b"GWYPGwyContainer\0" + struct.pack("<I", 99_999_995) + b"a\0S" + struct.pack("<I", 2**31) + bytes(10**8)
        ),
        "texts or objects in one",
    ),
    "scan of the world": (
        "a.sxm",
        lambda: re.sub(rb"(SCAN_PIXELS:\n).*", rb"\g<1>999999 999999", sxm({"Z": (np.eye(40), np.eye(40))})),
        "ends in the middle of its images (2 images of 999999 x 999999 pixels by its header)",
    ),
    "header without end": (
        "a.spm",
        lambda: b"\\*File list\r\n" + b"\\*Ciao image list\r\n" * (1 << 20),
        "has no end of its header",
    ),
    "a million tags": (
        "a.jpk",
        lambda: (
            b"II*\0\x08\0\0\0"
            + b"".join(
                struct.pack("<H", 50_000) + bytes(600_000) + struct.pack("<I", 8 + 600_006 * page)
                for page in range(1, 20)
            )
        ),
        "more than 100000 tags",
    ),
    "a row of commas": ("a.csv", lambda: b"1," * (4 << 20), "a line of 8388608 characters"),
}


@pytest.mark.common
@pytest.mark.parametrize("what", common_of(3, ["directory of itself", "deep header"], DAMAGED))
def test_a_damaged_image_is_told(what: str, tmp_path: Path) -> None:
    name, content, said = DAMAGED[what]
    (tmp_path / name).write_bytes(content())
    (tmp_path / "b.npy").write_bytes(npy(np.eye(40)))
    assert said in refused(*IMAGES, name, "b.npy", folder=tmp_path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda manifest: manifest["axes"].update(z=5), "unknown field `z`"),
        (lambda manifest: manifest["axes"]["x"]["output"].update(v_per_code=1e-320), "output.v_per_code is"),
        (lambda manifest: manifest["axes"]["x"]["output"].update(gain_word=2**70), "is damaged"),
        (lambda manifest: manifest["axes"]["x"]["drive"].update(v_offset=1e308), "is damaged"),
        (lambda manifest: manifest.update(name="dac_link"), "begins as the files and identifiers of the sequencer do"),
    ],
)
@pytest.mark.common
def test_a_damaged_manifest_is_told(change: Callable[[dict], None], said: str, build: Path) -> None:
    path = build / "manifest.json"
    manifest = json.loads(path.read_bytes())
    change(manifest)
    path.write_text(json.dumps(manifest))
    assert said in refused("verify", build, folder=build.parent)


@pytest.mark.parametrize(
    "content",
    ["[" * 100_000, '{"a":' * 100_000, '{"axes": ' + "[" * 900 + "]" * 900 + "}", " " * (9 << 20), "1" * 10**6, "NaN"],
    ids=["brackets", "objects", "depth", "length", "digits", "nan"],
)
@pytest.mark.common
def test_no_manifest_takes_more_than_a_message(content: str, build: Path) -> None:
    (build / "manifest.json").write_text(content)
    assert "manifest.json: " in refused("verify", build, folder=build.parent)
    assert run("build", build.parent / "scan.toml", "-o", build, "-q").status == 0  # and a build goes over it


@pytest.mark.parametrize(
    ("content", "most"),
    [
        ("a." * 20_000 + "a = 1", 1),
        ("x = " + "[" * 100_000, 1),
        ("".join(f"unknown{i} = 1\n" for i in range(60_000)), 51),
        ("x = '" + "x" * 10**6 + "'", 60),
        (f"'{'k' * 10**6}' = 1", 60),
    ],
    ids=["parts", "brackets", "unknown keys", "long value", "long key"],
)
@pytest.mark.rest
def test_no_scan_takes_more_than_some_lines(content: str, most: int, tmp_path: Path) -> None:
    scan = write_pair(tmp_path, content)
    said = refused("check", scan, folder=tmp_path).splitlines()
    assert len(said) <= most
    assert max(map(len, said)) < 1300 + len(str(scan))


@pytest.mark.parametrize("gain", ["1e-320", "-1e-320", "0", "1e999", "nan"])
@pytest.mark.rest
def test_no_gain_is_nothing(gain: str, tmp_path: Path) -> None:
    """Of the amplifier, of a response, and of a measurement."""
    scan = write_pair(tmp_path, edited(SCAN, f"amplifier.gain = {gain}"))
    assert re.search(r"amplifier\.gain: ", refused("check", scan, folder=tmp_path))
    rows = "".join(f"{f},{gain if f == 10 else 1},0\n" for f in (1, 10, 100))
    (tmp_path / "r.csv").write_text("hz,gain,phase_deg\n" + rows)
    write_pair(tmp_path, scanner=edited(SCANNER, "- [x.resonance]", "+ [x.resonance]\nresponse = 'r.csv'"))
    assert "r.csv:3: " in refused("check", scan, folder=tmp_path)
    (tmp_path / "r.csv").write_text("frequency_hz,gain,phase_deg\n" + rows)
    told = refused("calibrate", "resonance", "r.csv", "--axis", "x", "--v-max", "100", folder=tmp_path)
    assert "r.csv:3: gain: " in told
