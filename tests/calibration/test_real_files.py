"""Files of instruments that others took: each is read with the size, angle, directions and channels that it has.

They are outside the tree. Where the folder is absent the run says so at its end.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from igor2 import binarywave
from nanonispy2.read import Scan
from real_files import real_folder

import tablegen
from tablegen.base.input_errors import Unphysical
from tablegen.images.files import channels_of, read_image

FOLDER = real_folder()  # conftest.py leaves this module out where there is none
_OTHER = (".md", ".csv", ".txt", ".toml", ".json")  # no images, or not of an instrument
THERE = sorted(path.name for path in FOLDER.iterdir() if path.suffix not in _OTHER) if FOLDER else []


@dataclass(frozen=True)
class Facts:
    """What a file holds: pixels as columns x rows, and the heights of its first channel from the least to the most."""

    channels: tuple[str, ...]
    pixels: tuple[int, int]
    nm: tuple[float, float]
    unit: str
    first_row: str | None
    heights: tuple[float, float]
    angle_deg: float | None = None
    rate_hz: float | None = None
    turn: float | None = None
    window: tuple[float, float] | None = None
    frames: int = 1


_ASYLUM = tuple(f"{signal}Retrace" for signal in ("Height", "Amplitude", "Phase", "ZSensor"))
_NANONIS = tuple(f"{signal} {way}" for signal in ("Z", "Current") for way in ("forward", "backward"))
_JPK = tuple(
    f"{signal} {way}"
    for way in ("retrace", "trace")
    for signal in ("height", "measuredHeight", "amplitude", "phase", "error")
)
FILES = {
    "angle_90.ibw": Facts(
        *(_ASYLUM, (256, 256), (10e3, 10e3), "m", "top", (-6.59240e-8, 2.152944e-7)),
        angle_deg=90.0,
        rate_hz=2.0032,
        window=(0.1, 0.9),
    ),
    "stopped_scan.ibw": Facts(
        *(_ASYLUM, (256, 64), (20e3, 5e3), "m", "top", (-6.819323e-7, 1.191395e-6)),
        angle_deg=90.0,
        rate_hz=1.0016,
        window=(0.1, 0.9),
    ),
    "si7x7_50nm.sxm": Facts(
        *(_NANONIS, (256, 256), (50.0, 50.0), "m", "top", (-5.922709e-8, -5.857037e-8)),
        angle_deg=0.0,
        rate_hz=1.0 / 0.512,
        turn=0.5,
    ),
    "moire_10nm.sxm": Facts(
        *(_NANONIS, (160, 160), (10.0, 10.0), "m", "top", (1.0537996e-7, 1.0574908e-7)),
        angle_deg=0.0,
        rate_hz=1.0 / 2.592,
        turn=0.5,
    ),
    "hopg_11nm_iso28600.spm": Facts(
        ("Z (Forward)",), (512, 512), (11.4807, 11.4807), "m", "top", (0.0, 1.3396783e-9), angle_deg=0.0
    ),
    "old_bruker.002": Facts(
        *(("Height trace",), (256, 256), (15e3, 15e3), "nm", "bottom", (52.30048, 757.09244)),
        angle_deg=0.0,
        rate_hz=1.50498,
    ),
    "protein_lattice_100nm.asd": Facts(
        ("TP",), (200, 200), (100.0, 100.0), "nm", None, (-219.5818, -217.8163), rate_hz=200.0, frames=32
    ),
    "with_thumbnail.jpk": Facts(
        *(_JPK, (256, 256), (326.91651, 326.91651), "m", "bottom", (3.3031139e-6, 3.3597597e-6)),
        angle_deg=90.0,
        rate_hz=4.0,
    ),
}


@pytest.mark.parametrize("name", [name for name in THERE if name in FILES])
def test_what_is_in_a_real_file(name: str) -> None:
    assert FOLDER is not None, "TABLEGEN_REAL names no folder"
    facts = FILES[name]
    channels = channels_of(FOLDER / name)
    assert tuple(one.title for one in channels) == facts.channels
    ways = [next((way for way in ("retrace", "trace") if one.title.lower().endswith(way)), None) for one in channels]
    if name.endswith(".sxm"):
        ways = ["trace", "retrace"] * 2
    assert [one.direction for one in channels] == (["trace"] if name.endswith("iso28600.spm") else ways)
    for one in channels:
        assert one.shape == facts.pixels[::-1]
        assert (one.width_nm, one.height_nm) == pytest.approx(facts.nm, rel=1e-6)
        assert (one.first_row, one.frames) == (facts.first_row, facts.frames)
        for value, fact in ((one.angle_deg, facts.angle_deg), (one.line_rate_hz, facts.rate_hz)):
            assert value == (None if fact is None else pytest.approx(fact))
        assert one.turn == (None if facts.turn is None else pytest.approx(facts.turn))
        assert one.window == (None if facts.window is None else pytest.approx(facts.window))
        image = read_image(FOLDER / name, str(one.number), frame=facts.frames - 1 if facts.frames > 1 else None)
        assert image.heights.shape == one.shape
    first = read_image(FOLDER / name, "0", frame=0 if facts.frames > 1 else None)
    assert first.unit == facts.unit
    assert (np.min(first.heights), np.max(first.heights)) == pytest.approx(facts.heights, rel=1e-5)


@pytest.mark.common
@pytest.mark.parametrize("name", [name for name in THERE if name in FILES and name.endswith(".ibw")])
def test_real_waves_by_igor2(name: str) -> None:
    """Each pixel; and the step of the columns, of which N - 1 make the width."""
    assert FOLDER is not None, "TABLEGEN_REAL names no folder"
    wave = binarywave.load(str(FOLDER / name))["wave"]
    values, steps = wave["wData"], wave["wave_header"]["sfA"] * 1e9
    planned = 256
    for one in channels_of(FOLDER / name):
        image = read_image(FOLDER / name, str(one.number))
        assert np.array_equal(image.heights, values[:, ::-1, one.number].T)  # both went down: the last row is first
        assert image.width_nm == pytest.approx(steps[0] * (len(values) - 1), rel=1e-3)
        assert image.height_nm == pytest.approx(one.shape[0] * steps[1] * (planned - 1) / planned, rel=1e-3)


@pytest.mark.parametrize("name", [name for name in THERE if name in FILES and name.endswith(".sxm")])
def test_real_scans_by_nanonispy2(name: str) -> None:
    assert FOLDER is not None, "TABLEGEN_REAL names no folder"
    scan = Scan(str(FOLDER / name))
    for one in channels_of(FOLDER / name):
        way = "forward" if one.direction == "trace" else "backward"
        image = read_image(FOLDER / name, str(one.number))
        stored = scan.signals[one.signal][way]
        assert np.array_equal(image.heights, stored if way == "forward" else stored[:, ::-1])
        sides = tuple(scan.header["scan_range"] * 1e9)
        assert (image.width_nm, image.height_nm) == pytest.approx(sides, rel=1e-3)


def test_every_other_image_of_the_folder_is_read() -> None:
    """What this table does not know, as in a folder that the environment names, has at least channels and pixels."""
    assert FOLDER is not None, "TABLEGEN_REAL names no folder"
    for name in THERE:
        if name not in FILES:
            for one in channels_of(FOLDER / name):
                image = read_image(FOLDER / name, str(one.number), frame=0 if one.frames > 1 else None)
                assert image.heights.shape == one.shape, name


@pytest.mark.common
@pytest.mark.parametrize(
    ("name", "channel"),
    [
        pair
        for pair in (("with_thumbnail.jpk", "height"), ("stopped_scan.ibw", "HeightRetrace"))
        if FOLDER and (FOLDER / pair[0]).is_file()
    ],
)
def test_a_real_image_without_a_period_is_refused_for_that(name: str, channel: str) -> None:
    """It was refused as one of two periods, and for a fit that does not converge."""
    assert FOLDER is not None
    with pytest.raises(Unphysical, match="no period stands out of the image"):
        tablegen.correct(FOLDER / name, channel=channel, fit=True)
