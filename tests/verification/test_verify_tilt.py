"""``tablegen verify`` of a scan with the output z, what its C plays beside x and y, and commands that refuse it."""

import hashlib
import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
from building import run_clean
from editing import run
from tilted_scans import (
    LINES,
    NM_PER_V,
    OFFSET_V,
    SIZE_NM,
    SLOPE_X,
    SLOPE_Y,
    fitted_plane,
    volts_of,
    wanted_places,
    write_straight,
    write_tilted,
)

import tablegen
from tablegen.api.turned import TurnedBuild, build_turned
from tablegen.comparison.charts import comparison_charts, differing_charts
from tablegen.comparison.comparison import compared
from tablegen.emit.runtime_config import options_of_builds
from tablegen.emit.turned import turned_options
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.html_report.blocks import Grid, Section
from tablegen.html_report.page import charts_of, sections
from tablegen.html_report.subject import of_directory
from tablegen.html_report.tilt import ShownTilt, tilt_section
from tablegen.html_report.turned_page import turned_sections
from tablegen.html_report.turned_subject import turned_directory
from tablegen.manifest.format import content_hash
from tablegen.manifest.read import read_build
from tablegen.manifest.turned import parse_any, read_turned
from tablegen.verification.run import verify

ANGLE, NAME = 30.0, "annexin_200nm"
VALID = 16  # of the markers


@pytest.fixture(scope="module")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short frame at 30 degrees, with z."""
    return write_tilted(tmp_path_factory.mktemp("tilted"), ANGLE)


@pytest.fixture(scope="module")
def built(scan: Path) -> TurnedBuild:
    """Its build, written beside the scan."""
    return build_turned(scan, scan.parent / "out")


@pytest.fixture(scope="module")
def build(scan: Path, built: TurnedBuild) -> Path:
    """The folder of its build."""
    return scan.parent / ("out" if built.name == NAME else "")


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The build of the same frame at 0 degrees, without an operator."""
    folder = tmp_path_factory.mktemp("straight")
    tablegen.build(write_straight(folder), folder / "out")
    return folder / "out"


def edit(folder: Path, name: str, old: str, new: str) -> None:
    """Replace a pattern that stands once in a file, and make hash and digests of the manifest right again."""
    text = (folder / name).read_text("ascii")
    changed, count = re.subn(old, new, text)
    assert count == 1, (name, old, count)
    (folder / name).write_text(changed, "ascii")
    path = folder / "manifest.json"
    plain = json.loads(path.read_text("ascii"))
    plain["hash"] = content_hash({key: plain[key] for key in ("name", "scanner", "sequence", "turned")})
    plain["files"] = {each: hashlib.sha256((folder / each).read_bytes()).hexdigest() for each in plain["files"]}
    path.write_text(json.dumps(plain), "ascii")


@pytest.mark.common
def test_a_build_is_verified(build: Path) -> None:
    report = verify(build)
    assert report.failures == []
    assert [check.subject for check in report.checks][-4:] == ["c, steps", "c, fills", "c, z, steps", "c, z, fills"]
    stored = read_turned(build)
    assert stored.z is not None
    assert options_of_builds([build]) == {NAME: turned_options(stored.program, stored.z)}
    certificate = stored.plain["certificate"]
    assert certificate["z"]["error_lsb"] < 1.5
    assert set(certificate["codes"]) == {"x", "y", "z"}


@pytest.mark.rest
@pytest.mark.parametrize(
    ("file", "old", "new", "says"),
    [
        (f"{NAME}_z.c", r"(_z_x_slow\[\] = \{\n    (?:-?\d+, ){5})3", r"\g<1>2", "c, z, steps: x of tick"),
        (f"{NAME}_z_program.c", f"{NAME}_z_x_gains, ", f"{NAME}_x_gains, ", "c, z"),
        (f"{NAME}_program.c", f"{NAME}_x_gains, ", f"{NAME}_y_gains, ", "c, steps: x of tick"),
    ],
)
def test_a_changed_word_is_heard(file: str, old: str, new: str, says: str, build: Path, tmp_path: Path) -> None:
    """Both in the files and in what is played, and of z where it is in z."""
    copytree(build, tmp_path / "out")
    edit(tmp_path / "out", file, old, new)
    failures = verify(tmp_path / "out").failures
    assert any(failure.startswith(f"c files: {file}: a line is") for failure in failures), failures
    assert any(failure.startswith(says) for failure in failures), failures
    assert any(failure.startswith("c, z") for failure in failures) == says.startswith("c, z")


def change(*keys: str | int, by: float = 1) -> Callable[[Path], None]:
    """Change a number of the manifest."""

    def do(folder: Path) -> None:
        path = folder / "manifest.json"
        plain = place = json.loads(path.read_text("ascii"))
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] += by
        path.write_text(json.dumps(plain), "ascii")

    return do


@pytest.mark.parametrize(
    ("tampering", "says"),
    [
        (change("turned", "z", "slow", "words", 3), "its plan does not match its hash"),
        (change("turned", "z", "slow", "words", 3), f"{NAME}_z.c: a line is"),
        (change("certificate", "codes", "z", "most"), "z: codes"),
    ],
)
def test_tampering_is_found_in_the_files(
    tampering: Callable[[Path], None], says: str, build: Path, tmp_path: Path
) -> None:
    copytree(build, tmp_path / "out")
    tampering(tmp_path / "out")
    failures = verify(tmp_path / "out", "files").failures
    assert any(says in failure for failure in failures), failures


@pytest.mark.common
@pytest.mark.parametrize("angle_deg", [ANGLE, 0.0])
def test_two_sequencers_stay_together_and_z_is_on_the_plane(
    angle_deg: float, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    """Markers are on the same ticks; the plane through the words of the imaged ticks has the slopes."""
    build: Path = request.getfixturevalue("build" if angle_deg else "straight")
    schedule, sources = parse_any((build / "manifest.json").read_bytes()).program.schedule, sorted(build.glob("*.c"))
    options = [f"-D{key}={value}" for key, value in options_of_builds([build])[NAME].items()]
    program = tmp_path / "two_sequencers"
    code = Path(__file__).with_name("two_sequencers.c")
    own = [path for path in sources if not path.name.startswith(("dac_link", "dac_store"))]
    run_clean(["gcc", "-std=c99", "-O1", "-Wall", "-Wextra", *options, f"-I{build}", code, *own, "-o", program])
    frame = schedule.frame_ticks
    done = subprocess.run([program, str(2 * frame)], capture_output=True, text=True, check=True)
    rows = np.array([line.split() for line in done.stdout.splitlines()], dtype=np.int64)
    assert np.array_equal(rows[:, 1] | VALID, rows[:, 2] | VALID)
    valid = (rows[frame:, 1] & rows[frame:, 2] & VALID).reshape(LINES, -1) != 0
    assert np.count_nonzero(valid) > 0.5 * frame
    line, tick = np.nonzero(valid)
    x_nm, y_nm = wanted_places(angle_deg, line, (tick + 0.5) / schedule.ticks)
    z_nm, lsb_nm = NM_PER_V * volts_of(rows[frame:, 0].reshape(LINES, -1)[valid]), NM_PER_V * 100.0 / 65536.0
    assert np.max(np.abs(z_nm - NM_PER_V * OFFSET_V - SLOPE_X * x_nm - SLOPE_Y * y_nm)) < 1.5 * lsb_nm
    slope_x, slope_y, centre = fitted_plane(x_nm, y_nm, z_nm)
    assert max(abs(slope_x - SLOPE_X), abs(slope_y - SLOPE_Y)) * SIZE_NM < 0.2 * lsb_nm
    assert abs(centre - NM_PER_V * OFFSET_V) < 0.2 * lsb_nm


@pytest.mark.common
def test_the_summary_has_a_row_of_z(built: TurnedBuild) -> None:
    assert "z is +0.02 of x and -0.05 of y, by 5 nm/V; within " in built.summary()
    assert any(line.startswith("z:") and "words for the line" in line for line in built.choices)
    assert [chart.key for chart in built.charts().charts][-1] == "z_frame"


@pytest.mark.common
def test_what_does_not_take_z_says_so(scan: Path, built: TurnedBuild, build: Path, tmp_path: Path) -> None:
    refusals = {
        ("verify", build, "--target", "cortex-m"): "which no emulator plays",
    }
    assert run("tables", scan).out.startswith("x: ")
    for command, says in refusals.items():
        outcome = run(*command)
        assert outcome.status == 2, (command, outcome)
        assert says in outcome.err, (command, outcome.err)
    assert not list(tmp_path.iterdir())
    assert built.prepared.image().second is not None


@pytest.mark.common
def test_a_build_without_an_operator_is_verified(straight: Path) -> None:
    report = verify(straight)
    assert report.failures == []
    assert {"z", "c z", "c, z, steps", "c, z, fills"} < {check.subject for check in report.checks}
    stored = read_build(straight)
    assert stored.z is not None
    assert stored.z.certificate.error_lsb < 1.5
    assert {"DAC_SLOW_PART": 1, "DAC_SPLINE": 1}.items() <= options_of_builds([straight])[NAME].items()


@pytest.mark.common
@pytest.mark.parametrize(
    ("keys", "by", "says"),
    [
        (("z", "slow", "words", 3), 1, "its plan does not match its hash"),
        (("z", "slow", "words", 3), 1, f"{NAME}_z.c: a line is"),
        (("z", "words", 10), 300, "z: error_lsb of the certificate is"),
        (("z", "certificate", "codes", "most"), 1, "z: codes"),
        (("z", "certificate", "error_lsb"), 0.001, "z: error_lsb of the certificate is"),
        (("z", "slope_x"), 0.001, "z: fast_nm is"),
    ],
)
def test_tampering_without_an_operator_is_found(
    keys: tuple[str | int, ...], by: float, says: str, straight: Path, tmp_path: Path
) -> None:
    copytree(straight, tmp_path / "out")
    change(*keys, by=by)(tmp_path / "out")
    failures = verify(tmp_path / "out", "files").failures
    assert any(says in failure for failure in failures), failures


@pytest.mark.rest
def test_a_changed_word_of_z_is_heard_without_an_operator(straight: Path, tmp_path: Path) -> None:
    """In what is played, and of z alone."""
    copytree(straight, tmp_path / "out")
    path = tmp_path / "out" / f"{NAME}_z.c"
    text, count = re.subn(r"(_z_x_table\[\] = \{\n    (?:-?\d+, ){5})-?\d+", r"\g<1>77", path.read_text("ascii"))
    assert count == 1
    path.write_text(text, "ascii")
    failures = verify(tmp_path / "out").failures
    assert any(failure.startswith("c, z, steps: x of tick") for failure in failures), failures
    assert not any(failure.startswith(("x:", "y:", "fill:", "program:")) for failure in failures), failures


@pytest.mark.common
def test_what_does_not_take_z_without_an_operator_says_so(straight: Path, tmp_path: Path) -> None:
    scan = straight.parent / "scan.toml"
    refusals = {
        (
            "build",
            scan,
            "-o",
            tmp_path / "out",
            "-f",
            "vhdl",
        ): "formats: 'vhdl' plays no output z; leave [z] out, or take one of c, verilog, arduino",
        ("verify", straight, "--target", "cortex-m"): "which no emulator plays",
    }
    for command, says in refusals.items():
        outcome = run(*command)
        assert outcome.status == 2, (command, outcome)
        assert says in outcome.err, (command, outcome.err)
    assert not list(tmp_path.iterdir())
    built = tablegen.build(scan)
    assert built.prepared.image().second is not None
    for text in (built.summary(), built.overview()):
        assert "+0.02 of x and -0.05 of y, by 5 nm/V" in text
    assert [chart.key for chart in built.charts().charts][-1] == "z_frame"


@pytest.mark.common
@pytest.mark.parametrize("operators", [True, False])
def test_compare_states_what_differs_in_z(operators: bool, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    """A build is the same as itself; beside another plane rows and chart of z differ, and none of x and y."""
    folder: Path = request.getfixturevalue("build" if operators else "straight")
    assert run("compare", folder, folder).status == 0
    copytree(folder, tmp_path / "other")
    z = ("turned", "z") if operators else ("z",)
    change(*z, "slope_x", by=0.01)(tmp_path / "other")
    change(*z, "slow", "words", 3, by=40)(tmp_path / "other")
    outcome = run("compare", folder, tmp_path / "other", "--json")
    assert outcome.status == 1
    differing = {(row["section"], row["name"]): row for row in json.loads(outcome.out)["quantities"]}
    assert {one for one in differing if one[0] != "build"} == {
        ("z drive", "slope along x"), ("z tables", "slow part, content"),
    }  # fmt: skip
    slope = differing["z drive", "slope along x"]
    assert (slope["a"], slope["b"]) == (SLOPE_X, pytest.approx(SLOPE_X + 0.01))
    both = compared(folder, tmp_path / "other")
    assert [chart.key for chart in differing_charts(comparison_charts(both))] == ["drive-z"]


@pytest.mark.common
def test_compare_of_a_scan_without_z_has_one_side_of_it(straight: Path, tmp_path: Path) -> None:
    plain = write_straight(tmp_path, "- [z]")
    outcome = run("compare", straight.parent / "scan.toml", plain)
    assert outcome.status == 1
    assert re.search(rf"\n  slope along y +{SLOPE_Y} +-\n", outcome.out), outcome.out
    both = compared(straight.parent / "scan.toml", plain)
    assert "drive-z" not in {chart.key for chart in comparison_charts(both)}


def rows_of(section: Section) -> dict[str, list[str]]:
    """The rows of a section's table by their names."""
    (grid,) = (block for block in section.blocks if isinstance(block, Grid))
    return {cells[0].text: [cell.text for cell in cells[1:]] for cells in grid.rows}


@pytest.mark.common
@pytest.mark.parametrize("operators", [True, False])
def test_the_page_of_a_build_states_z(operators: bool, request: pytest.FixtureRequest) -> None:
    """Its figures are those of a frame of the model, in volts by a formula of the tests."""
    folder: Path = request.getfixturevalue("build" if operators else "straight")
    if operators:
        parts, beside = turned_sections(turned_directory(folder)), read_turned(folder).z
    else:
        parts, beside = sections(of_directory(folder)), read_build(folder).program_of_z
    assert beside is not None
    assert isinstance(beside.x, FrameProgram)
    volts = volts_of(beside.x.frame())
    below, above = float(np.min(volts)), 100.0 * 65535.0 / 65536.0 - float(np.max(volts))
    rows = rows_of(next(part for part in parts if part.key == "z"))
    assert rows["slope along x"][0] == "+0.02, +1.15 degrees"
    assert rows["slope along y"][0] == "-0.05, -2.86 degrees"
    assert rows["drive at the piezo"][0] == f"{np.min(volts):.6g}..{np.max(volts):.6g} V"
    room = f"{above:.4g} V, {NM_PER_V * above:.4g} nm, from the highest voltage"
    assert rows["room above"] == [room, "99.9985 V", "\u2713 within"]
    room = f"{below:.4g} V, {NM_PER_V * below:.4g} nm, from the lowest voltage"
    assert rows["room below"] == [room, "0 V", "\u2713 within"]
    error, unit = rows["largest error at imaged ticks"][0].split()
    assert 0.5 < float(error) < 1.5
    assert unit == "LSB"
    assert "z_frame" in charts_of(parts)


@pytest.mark.common
def test_the_page_shows_a_limit_that_z_exceeds(straight: Path) -> None:
    stored = read_build(straight)
    assert stored.z is not None
    program, stated = stored.z.program(stored.manifest.sequence), stored.z.certificate
    shown = ShownTilt("z", stored.z, program, stated.codes, stated.error_lsb, stated.error_nm)
    for limit, says in ((1.5, "\u2713 within"), (0.5, "\u2717 exceeded")):
        assert rows_of(tilt_section(shown, limit))["largest error at imaged ticks"][1:] == [f"{limit} LSB", says]
