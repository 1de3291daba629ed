"""Commands of a scan at an angle: those that take it, those that refuse it, and their messages."""

import json
from importlib.resources import files
from pathlib import Path

import pytest
from editing import SCANNER, run
from turned_scans import turned_setup, write_turned

import tablegen
from tablegen.config.schema import SEQUENCER_FORMATS

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


def test_a_sweep_refuses_it(scan: Path, tmp_path: Path) -> None:
    outcome = run("sweep", scan, "-o", tmp_path / "library")
    assert outcome.status == 2
    assert "scan.toml:1: angle_deg: a scan at an angle, on coupled axes or with drift is for" in outcome.err


@pytest.mark.common
def test_simulate_plays_the_frame_on_its_own_operators(scan: Path) -> None:
    """The same numbers in text and JSON, below the lines of `show`."""
    outcome, simulated = run("simulate", scan), tablegen.simulate_turned(scan)
    plain = simulated.record
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out == simulated.summary() + "\n"
    assert outcome.out.splitlines()[:2] == simulated.built.brief() == [plain["answer"], plain["duration"]]
    assert "at 30 degrees: simulation on the scanner file's own operator; 300 nm along the lines" in outcome.out
    straight, built = (plain["own"]["corrections"][name]["errors"] for name in ("uncompensated", "operator"))
    across = next(line for line in outcome.out.splitlines() if line.startswith("size across the lines"))
    cells = [f"{one['slow_size']['mean']:+.3f} ({one['slow_size']['worst']:+.3f})" for one in (straight, built)]
    assert across.split("%]")[1].split() == " ".join(cells).split()
    assert straight["slow_size"]["mean"] > 5.0 > abs(built["slow_size"]["worst"])
    assert outcome.out.splitlines()[-1].startswith("A simulation, not a measurement")
    refused = run("simulate", scan, "--csv", "f.csv")
    assert refused.status == 2
    assert "--csv does not go with the scanner file's own operator" in refused.err


@pytest.mark.common
def test_simulate_plays_it_on_a_virtual_scanner(scan: Path, tmp_path: Path) -> None:
    """With its coupling, if a file of one has any, which a scan that is not turned does not play."""
    default = files("tablegen.virtual").joinpath("default.toml").read_text("utf-8")
    (tmp_path / "coupled.toml").write_text(default + "\n[coupling]\ny_per_x = 0.1\n", "utf-8")
    (tmp_path / "default.toml").write_text(default, "utf-8")
    shears = []
    for name in ("default.toml", "coupled.toml"):
        options = ("--scanner-truth", tmp_path / name, "--no-calibration")
        csv_file, plot = tmp_path / "frame.csv", tmp_path / "frame.svg"
        outcome = run("simulate", scan, *options, "--csv", csv_file, "--plot", plot, "--json")
        assert outcome.status == 0, outcome.err
        plain = json.loads(outcome.out)["given"]["corrections"]["operator"]["errors"]
        shears.append(plain["shear"]["mean"])
        rows = [line.split(",") for line in csv_file.read_text("utf-8").splitlines()[1:]]
        assert rows[0][-3:] == ["along_nm", "across_nm", "imaged"]
        assert {row[1] for row in rows[1:]} == {"uncompensated", "operator"}
        assert 8000 < len(rows) < 20010
        assert "error across the lines" in plot.read_text("utf-8")
    # y_per_x = 0.1 in the directions of the scan, by its rotated matrix.
    assert shears[1] - shears[0] == pytest.approx(100.0 * (0.075 / 1.0433 - 0.025 / 0.9567), abs=0.3)
    straight = write_turned(tmp_path, 0.0, *SHORT)
    refused = run("simulate", straight, "--scanner-truth", tmp_path / "coupled.toml", "--no-calibration")
    assert refused.status == 2
    assert "coupled.toml: " in refused.err


@pytest.mark.parametrize("command", ["check", "build", "report"])
def test_tables_in_the_header_are_refused_at_their_key(tmp_path: Path, command: str) -> None:
    """The key was ignored: the build had NAME.c all the same."""
    path = write_turned(tmp_path, 30.0, *SHORT, "+ [emit]\nheader_only = true")
    line = path.read_text("utf-8").splitlines().index("header_only = true") + 1
    outcome = run(command, path, *([] if command == "check" else ["-o", tmp_path / "out"]))
    assert outcome.status == 2
    assert outcome.err.splitlines() == [
        f"{path}:{line}: emit.header_only: true: the tables of a scan at an angle, on coupled axes or with drift are "
        "in NAME.c and NAME_program.c, not in the header; leave this out"
    ]
    assert not (tmp_path / "out").exists()


def test_tables_in_the_header_are_of_c_alone(tmp_path: Path) -> None:
    path = write_turned(tmp_path, 30.0, *SHORT, "+ [emit]\nheader_only = true\nformats = ['verilog']")
    assert run("check", path).status == 0
    assert run("build", path, "-o", tmp_path / "out", "-f", "cargo").status == 2
    straight = write_turned(tmp_path, 0.0, *SHORT, "+ [emit]\nheader_only = true\nformats = ['c']")
    assert run("build", straight, "-o", tmp_path / "straight", "-q").status == 0
    assert not (tmp_path / "straight" / "annexin_200nm.c").exists()


def test_another_format_is_refused(scan: Path, tmp_path: Path) -> None:
    outcome = run("build", scan, "-o", tmp_path / "out", "-f", "csv")
    assert outcome.status == 2
    assert outcome.err.splitlines() == [
        "formats: 'csv' holds no scan at an angle, on coupled axes or with drift; formats of one are "
        + ", ".join(SEQUENCER_FORMATS)
    ]
    outcome = run("build", scan, "-o", tmp_path / "out", "-f", "cargos")
    assert outcome.status == 2
    assert "formats: 'cargos' is not a format; formats are arduino, " in outcome.err
    path = write_turned(tmp_path, 30.0, *SHORT, "+ [emit]\nformats = ['c', 'csv']")
    outcome = run("check", path)
    assert outcome.status == 2
    assert "emit.formats: 'csv' holds no scan at an angle, on coupled axes or with drift; formats" in outcome.err


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
    straight = turned_setup(tmp_path, 360.0, *SHORT)
    for function in (tablegen.build_turned, tablegen.simulate_turned):
        with pytest.raises(tablegen.Rejected, match="this scan has no angle, coupling or drift"):
            function(straight)
