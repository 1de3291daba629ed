"""``tablegen verify`` of the output z beside steps of y and a sine of x, and the plane of what the emitted C plays."""

import json
import subprocess
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
from building import run_clean
from sets import long
from tilted_scans import (
    NM_PER_V,
    OFFSET_V,
    SIZE_NM,
    SLOPE_X,
    SLOPE_Y,
    STEPS,
    UP_DOWN,
    fitted_plane,
    triangle,
    volts_of,
    wanted_y,
    write_sine,
    write_stepped,
    write_straight,
)

import tablegen
from tablegen.certificate.certified_scan import certify_scan
from tablegen.config.load import load
from tablegen.emit.runtime_config import options_of_builds
from tablegen.emit.stored import stored_content
from tablegen.emit.turned_content import content_beside
from tablegen.html_report.page import sections
from tablegen.html_report.subject import of_directory
from tablegen.manifest.read import StoredBuild, read_build
from tablegen.numerics.arrays import Floats, Ints
from tablegen.verification.play.stream import FLAGS
from tablegen.verification.run import verify
from tablegen.verification.verilog.turned_play import TurnedPlay

NAME, LSB_NM = "annexin_200nm", NM_PER_V * 100.0 / 65536.0
PIXEL, VALID = 1 << FLAGS.index("pixel"), 1 << FLAGS.index("valid")
BUILDS = ("stepped", "up and down", "sine", "stepped sine")
PART = 40  # ticks of the Verilog


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Builds of a line with steps of y, without an operator and with two, and of a sine with a ramp and with steps."""
    folder = {what: tmp_path_factory.mktemp(what.replace(" ", "_")) for what in BUILDS}
    scans = {
        "stepped": write_straight(folder["stepped"], *STEPS),
        "up and down": write_stepped(folder["up and down"], *UP_DOWN),
        "sine": write_sine(folder["sine"]),
        "stepped sine": write_sine(folder["stepped sine"], STEPS[0], STEPS[2]),
    }
    for what, scan in scans.items():
        tablegen.build(scan, folder[what] / "out", formats=["c", "verilog"])
    return {what: folder[what] / "out" for what in BUILDS}


@pytest.mark.common
@pytest.mark.parametrize("what", ["stepped", "up and down", "stepped sine"])
def test_a_build_is_verified(what: str, folders: dict[str, Path]) -> None:
    report = verify(folders[what], "c")
    assert report.failures == []
    assert {"z", "c z", "verilog z", "c, z, steps", "c, z, fills"} < {check.subject for check in report.checks}


@pytest.mark.common
def test_z_has_files_beside_tables_in_a_header(folders: dict[str, Path], tmp_path: Path) -> None:
    """The same as beside tables in a file; all of it is verified."""
    edits = (*STEPS, "+ [emit]\nheader_only = true\nformats = ['c']")
    tablegen.build(write_straight(tmp_path, *edits), tmp_path / "out")
    folder, own = folders["stepped"], {path.name for path in (tmp_path / "out").glob(f"{NAME}*")}
    assert own == {f"{NAME}{end}" for end in (".h", "_z.h", "_z.c", "_z_program.h", "_z_program.c")}
    words = [(each / f"{NAME}_z.c").read_text("ascii").split("{")[1:] for each in (folder, tmp_path / "out")]
    assert words[0] == words[1]
    report = verify(tmp_path / "out", "c")
    assert report.failures == []
    assert {"c, z, steps", "c, z, fills"} < {check.subject for check in report.checks}


@pytest.mark.common
@pytest.mark.parametrize(
    ("what", "key", "value", "says"),
    [
        ("stepped", ("axes", "y", "drive", "turn"), 0.94, "error_lsb of the certificate is"),
        ("stepped", ("z", "words", 100), 20000, "error_lsb of the certificate is"),
        ("sine", ("axes", "x", "fourier", "place", "b", 0), 0.1, "z: error_lsb of the certificate is"),
        ("sine", ("z", "certificate", "error_lsb"), 0.5, "z: error_lsb of the certificate is 0.5"),
    ],
)
def test_tampering_is_found(
    what: str, key: tuple[str | int, ...], value: float, says: str, folders: dict[str, Path], tmp_path: Path
) -> None:
    """Of the words of z, of what the certificate says of it, and of what it follows."""
    folder = copytree(folders[what], tmp_path / "out")
    path = folder / "manifest.json"
    plain = place = json.loads(path.read_text("ascii"))
    for step in key[:-1]:
        place = place[step]
    assert place[key[-1]] != value
    place[key[-1]] = value
    path.write_text(json.dumps(plain), "ascii")
    failures = verify(folder, "files").failures
    assert any(says in failure for failure in failures), failures


def played(folder: Path, work: Path) -> tuple[StoredBuild, Ints, Ints, Ints]:
    """Play two frames of both sequencers; return words of z and markers of both of the second frame, of ticks."""
    stored = read_build(folder)
    options = [f"-D{key}={value}" for key, value in options_of_builds([folder])[NAME].items()]
    code = Path(__file__).with_name("two_sequencers.c")
    own = [path for path in sorted(folder.glob("*.c")) if not path.name.startswith(("dac_link", "dac_store"))]
    program, frame = work / "two_sequencers", stored.program.schedule.frame_ticks
    run_clean(["gcc", "-std=c99", "-O1", "-Wall", "-Wextra", *options, f"-I{folder}", code, *own, "-o", program])
    done = subprocess.run([program, str(2 * frame)], capture_output=True, text=True, check=True)
    rows = np.array([line.split() for line in done.stdout.splitlines()], dtype=np.int64)[frame:]
    return stored, rows[:, 0], rows[:, 1], rows[:, 2]


def places(stored: StoredBuild, markers: Ints) -> tuple[Ints, Floats, Floats]:
    """Return the first ticks of the imaged pixels by the markers of x and y, and their places by the scan alone."""
    schedule = stored.program.schedule
    starts = np.flatnonzero((markers & PIXEL != 0) & (markers & VALID != 0))
    sweep = np.concatenate([np.arange(schedule.pixels), np.arange(schedule.pixels)[::-1]])
    pixel = np.resize(sweep, len(starts))
    x_nm = SIZE_NM * (0.1 + 0.8 * (pixel + 0.5) / schedule.pixels - 0.5)
    line = starts // schedule.ticks
    return starts, np.asarray(x_nm), np.asarray(line, dtype=np.float64)


@pytest.mark.common
@pytest.mark.parametrize("what", BUILDS)
def test_the_plane_of_what_the_c_plays(what: str, folders: dict[str, Path], tmp_path: Path) -> None:
    """Over pixels of the scan; both sequencers have the same markers, but those of pixels beside a sine."""
    stored, words, markers, of_z = played(folders[what], tmp_path)
    schedule = stored.program.schedule
    sine = schedule.pixel_table is not None
    own = VALID | PIXEL if sine else VALID
    assert np.array_equal(markers | own, of_z | own)
    assert np.array_equal(markers & PIXEL, of_z & PIXEL) != sine
    starts, x_nm, line = places(stored, markers)
    assert len(starts) == 2 * schedule.pixels * (schedule.up.count + schedule.down.count)
    stops = np.array([start + 1 + np.argmax((markers[start + 1 :] & PIXEL != 0) | (markers[start + 1 :] & VALID == 0))
                      for start in starts])  # fmt: skip
    heights = NM_PER_V * (volts_of(words) - OFFSET_V)
    z_nm = np.array([np.mean(heights[start:stop]) for start, stop in zip(starts, stops, strict=True)])
    middles = 0.5 * (starts + stops) / schedule.ticks % 1.0
    steps, turn = what != "sine", 0.5 if schedule.down.count else 0.95
    y_nm = wanted_y((line + (0.5 if steps else middles)) / schedule.lines, turn)
    if not sine:
        x_nm = SIZE_NM * (triangle(middles, 0.5) - 0.5)
    assert np.max(np.abs(z_nm - SLOPE_X * x_nm - SLOPE_Y * y_nm)) < (3.0 if sine else 1.0) * LSB_NM
    slopes = fitted_plane(x_nm, y_nm, z_nm)
    assert max(abs(slopes[0] - SLOPE_X), abs(slopes[1] - SLOPE_Y)) * SIZE_NM < (0.5 if sine else 0.2) * LSB_NM
    wrong = wanted_y((line + (middles if steps else 0.5)) / schedule.lines, turn)
    assert np.max(np.abs(z_nm - SLOPE_X * x_nm - SLOPE_Y * wrong)) > 20.0 * LSB_NM


@pytest.mark.rest
@pytest.mark.parametrize("what", long(["up and down"], ["up and down", "stepped", "stepped sine"]))
def test_the_top_of_z_plays_the_model(what: str, folders: dict[str, Path], tmp_path: Path) -> None:
    """Its modules have no table of pixels; a changed word is heard."""
    folder = copytree(folders[what], tmp_path / "out")
    beside = content_beside(stored_content(read_build(folder)))
    assert beside is not None
    said = [check.failure for check in TurnedPlay(beside, PART, ", z").checks(folder, tmp_path / "work", "icarus")]
    assert said == [None, None]


def test_the_page_states_the_steps(folders: dict[str, Path]) -> None:
    (part,) = (each for each in sections(of_directory(folders["stepped"])) if each.key == "z")
    text = str(part.blocks)
    assert "the level of each line, a smooth step between lines" in text


def test_a_limit_of_the_scan_file_holds_beside_a_sine(tmp_path: Path) -> None:
    path = write_sine(tmp_path, "+ [limits]\nmax_error_lsb = 0.9", "x.table.max_error_lsb = 0.8")
    (problem,) = certify_scan(load(path), remedies=False).broken
    assert problem.why.endswith("above 0.9; a smaller slope brings it closer to the plane"), problem
