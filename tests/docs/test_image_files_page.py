"""docs/image_files.md: its formats are those of the code, and its examples print what it says."""

import contextlib
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from building import REPOSITORY
from calibrating import Scanner, grating
from editing import run, write_pair
from instrument_files import asd, ibw, sxm

from tablegen.images.files import _READERS, MODULES
from tablegen.images.formats import channel, igor, nanonis, nanoscope
from tablegen.images.formats.tiff import _MAX_TAGS

PAGE = (REPOSITORY / "docs" / "image_files.md").read_text("utf-8")
WORDS = " ".join(PAGE.split())
NOTE = {"FastScanSize": "5e-07", "SlowScanSize": "2.5e-07", "ScanRate": "2.5", "ScanDown": "0"}


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    movie = np.random.default_rng(1).uniform(-20.0, 20.0, (20, 48, 64))
    labels = ("HeightTrace", "HeightRetrace", "ZSensorTrace", "ZSensorRetrace")
    (tmp_path / "scan.ibw").write_bytes(ibw(dict(zip(labels, movie, strict=False)), NOTE))
    (tmp_path / "movie.asd").write_bytes(asd({"TP": movie, "ER": movie}))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_format_is_in_the_table() -> None:
    rows = re.findall(r"^\| (`\..*?) \| .* \| (.*?) \| .* \|$", PAGE.partition("## What is in")[0], re.MULTILINE)
    told = {ending: by for endings, by in rows for ending in re.findall(r"`([^`]+)`", endings)}
    assert told.keys() - {".000", ".999"} == _READERS.keys()
    libraries = {"tifffile": "tifffile", "PIL": "Pillow"}
    assert {ending: by for ending, by in told.items() if by in libraries.values()} == {
        ending: libraries[module] for ending, module in MODULES.items()
    }


def test_the_list_of_channels_is_what_the_command_prints(files: Path) -> None:
    (shown,) = re.findall(r"```text\n\$ tablegen channels (.*?)\n(.*?)```", PAGE, re.DOTALL)
    assert run("channels", *shown[0].split()).out == shown[1]


@pytest.mark.common
def test_every_command_runs(files: Path) -> None:
    write_pair(files)
    sample = grating(16.0, pixels=128, lines=96)
    for volts in (30, 60):
        pair = Scanner().images(float(volts), sample, 0.05, np.random.default_rng(8))
        scale = 15.0 / np.max(np.abs([pair.trace, pair.retrace]))
        trace, retrace = pair.trace * scale, pair.retrace * scale
        (files / f"{volts}v.ibw").write_bytes(
            ibw({"HeightTrace": trace, "HeightRetrace": retrace, "Phase": trace}, NOTE)
        )
        if volts == 30:
            for name in ("t", "r"):
                (files / f"30v_{name}.sxm").write_bytes(sxm({"Z": (trace, retrace)}))
            for name, image in (("a", trace), ("b", retrace)):
                (files / f"{name}.asd").write_bytes(asd({"TP": np.stack([image[::-1]] * 7 + [image])}))
    (block,) = re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)
    assert len(block.splitlines()) == 3
    for line in block.splitlines():
        outcome = run(*line.split()[1:], "--json")
        assert (outcome.status, outcome.err) == (0, ""), line
        beta = json.loads(outcome.out)["branches"][0]["traces"][0]["forward"]["beta"]
        assert beta["value"] == pytest.approx(0.0264, abs=2e-3), line  # of the scanner, at 30 V


def test_the_python_runs(files: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(code, "image_files.md", "exec"), {})
    assert out.getvalue().splitlines() == [
        "['HeightTrace', 'HeightRetrace', 'ZSensorTrace', 'ZSensorRetrace']",
        "(48, 64) 500.0 m retrace",
    ]


def test_the_limits_are_those_of_the_code() -> None:
    assert channel.MAX_PIXELS == 1 << 25
    assert nanonis._MAX_BLOCKS == nanoscope._MAX_IMAGES == igor._MAX_CHANNELS == 1000
    assert (nanoscope._MAX_HEADER, nanonis._MAX_HEADER, igor._MAX_NOTE) == (4 << 20, 1 << 20, 1 << 20)
    assert "At most 1000 channels are read, 4 MiB of a Nanoscope header, 1 MiB of a Nanonis header or of an" in WORDS
    assert f"{_MAX_TAGS:,} tags" in WORDS
