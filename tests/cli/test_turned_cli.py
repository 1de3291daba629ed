"""Commands of a scan at an angle: those that take it, those that refuse it, and their messages."""

import json
from pathlib import Path

import pytest
from editing import SCANNER, run
from turned_scans import turned_setup, write_turned

import tablegen

SHORT = ("timing.lines = 16", "x.band_limit.harmonics = 12", "timing.line_rate_hz = 400")


@pytest.fixture(scope="module")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short frame at 30 degrees."""
    return write_turned(tmp_path_factory.mktemp("turned"), 30.0, *SHORT)


def test_check_says_correct(scan: Path) -> None:
    outcome = run("check", scan)
    assert outcome.status == 0
    residual, duration, verdict = outcome.out.splitlines()
    assert residual.startswith("residual 0.")
    assert duration.endswith("s an image")
    assert verdict == f"{scan}: correct"


def test_show_prints_the_errors_and_draws_lines(scan: Path) -> None:
    outcome = run("show", scan)
    assert outcome.status == 0
    assert "annexin_200nm on 'hs-afm' at 30 degrees: 400 Hz lines of 1250 ticks, 16 lines a frame" in outcome.out
    assert "x: lines" in outcome.out
    assert "chosen: y: cubic tables of 64 words for the line and 64 for the frame" in outcome.out
    plain = run("show", scan, "--no-plot")
    assert "x: lines" not in plain.out


def test_show_json_is_the_manifest(scan: Path, tmp_path: Path) -> None:
    plain = json.loads(run("show", scan, "--json", "--no-plot").out)
    assert run("build", scan, "-o", tmp_path / "out", "-q").status == 0
    assert plain == json.loads((tmp_path / "out" / "manifest.json").read_text("ascii"))
    assert plain["turned"]["angle_deg"] == 30.0


@pytest.mark.common
def test_build_check_and_verify(scan: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert (
        run("build", scan, "-o", folder).out.splitlines()[-1] == f"{folder}: 5 of 5 files and the runtime dac_* written"
    )
    assert run("build", scan, "-o", folder, "--check").status == 0
    outcome = run("verify", folder)
    assert outcome.status == 0, outcome.err
    assert outcome.out.splitlines()[-1] == f"{folder}: verified, 7 checks"
    other = write_turned(tmp_path, 31.0, *SHORT)
    stale = run("build", other, "-o", folder, "--check")
    assert stale.status == 1
    assert "is stale; run: tablegen build" in stale.err


def test_a_straight_build_takes_the_place_of_a_turned_one(scan: Path, tmp_path: Path) -> None:
    """And the other way round: files of the earlier build that the later one has not are removed."""
    folder = tmp_path / "out"
    straight = write_turned(tmp_path, 0.0, *SHORT)
    assert run("build", straight, "-o", folder, "-q").status == 0
    assert (folder / "dac_sequencer.v").is_file()
    assert run("build", scan, "-o", folder, "-q").status == 0
    assert not (folder / "dac_sequencer.v").exists()
    assert run("build", straight, "-o", folder, "-q", "-f", "verilog").status == 0
    assert not (folder / "annexin_200nm_program.c").exists()


@pytest.mark.parametrize(
    "command",
    [("report",), ("simulate",), ("tables",)],
)
def test_other_commands_refuse_it(command: tuple[str, ...], scan: Path) -> None:
    name, *options = command
    outcome = run(name, scan, *options)
    assert outcome.status == 2
    assert "scan.toml:1: angle_deg: a scan at an angle, on coupled axes or with drift is for" in outcome.err


def test_another_format_is_refused(scan: Path, tmp_path: Path) -> None:
    outcome = run("build", scan, "-o", tmp_path / "out", "-f", "csv")
    assert outcome.status == 2
    assert outcome.err.splitlines() == [
        "formats: a scan at an angle, on coupled axes or with drift has the formats c and verilog"
    ]
    path = write_turned(tmp_path, 30.0, *SHORT, "+ [emit]\nformats = ['c', 'csv']")
    outcome = run("check", path)
    assert outcome.status == 2
    assert (
        "emit.formats: a scan at an angle, on coupled axes or with drift has the formats c and verilog" in outcome.err
    )


def test_a_limit_that_is_exceeded_ends_with_its_status(tmp_path: Path) -> None:
    path = write_turned(tmp_path, 30.0, *SHORT, "+ [limits]\nmax_error_lsb = 0.01")
    outcome = run("check", path)
    assert outcome.status == 3
    assert "limits.max_error_lsb: a code is off by " in outcome.err


def test_an_axis_without_an_operator_is_named(tmp_path: Path) -> None:
    path = write_turned(tmp_path, 30.0, *SHORT)
    (tmp_path / "scanner.toml").write_text(SCANNER, "utf-8")
    outcome = run("check", path)
    assert outcome.status == 2
    assert [line.split(": ", 1)[1] for line in outcome.err.splitlines()] == [
        "x.hysteresis: is no operator; `calibrate operator --axis x` makes one",
        "y.hysteresis: is no operator; `calibrate operator --axis y` makes one",
    ]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("angle_deg = 30.0", "angle_deg = 400", "angle_deg: 400 is above 360"),
        ("angle_deg = 30.0", "drift_nm_per_s = [1]", "drift_nm_per_s: "),
        ("angle_deg = 30.0", "angle_deg = 'north'", "angle_deg: "),
    ],
)
def test_wrong_values_are_named(old: str, new: str, says: str, tmp_path: Path) -> None:
    path = write_turned(tmp_path, 30.0, *SHORT)
    path.write_text(path.read_text("utf-8").replace(old, new), "utf-8")
    outcome = run("check", path)
    assert outcome.status == 2
    assert f"scan.toml:1: {says}" in outcome.err


def test_a_coupling_that_is_too_large_is_refused(tmp_path: Path) -> None:
    path = write_turned(tmp_path, 0.0, *SHORT)
    scanner = tmp_path / "scanner.toml"
    scanner.write_text(scanner.read_text("utf-8") + "\n[coupling]\nx_per_y = 0.7\n", "utf-8")
    outcome = run("check", path)
    assert outcome.status == 2
    assert "coupling.x_per_y: 0.7 is above 0.5" in outcome.err


def test_python_has_the_same(scan: Path, tmp_path: Path) -> None:
    built = tablegen.build_turned(scan, tmp_path / "out")
    assert repr(built).startswith("<tablegen build 'annexin_200nm' on 'hs-afm' at 30 degrees")
    assert sorted(built.files) == sorted(path.name for path in (tmp_path / "out").iterdir())
    assert built.write(tmp_path / "out") == []
    assert built.record["turned"]["angle_deg"] == 30.0
    assert len(built.charts().charts) == 4
    with pytest.raises(tablegen.Rejected, match="this scan has no angle, coupling or drift"):
        tablegen.build_turned(turned_setup(tmp_path, 360.0, *SHORT))
