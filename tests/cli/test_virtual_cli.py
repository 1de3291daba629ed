"""``tablegen simulate``: what it prints and writes, labelled as a simulation, and what it refuses."""

import csv
import json
import sys
from importlib.resources import files
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from editing import SCAN, SCANNER, edited, run, write_pair
from operator_files import operator_file, write_operator_scan

from tablegen.base.input_errors import Rejected
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.virtual.parameters import load_truth

TRUTH, DUHEM = (
    (files("tablegen.virtual") / f"{name}.toml").read_text(encoding="utf-8") for name in ("default", "duhem")
)
SHORT = edited(SCAN, "timing.lines = 20", "y.band_limit.harmonics = 16")


def truth(folder: Path, *edits: str) -> Path:
    """The default virtual scanner with edits."""
    path = folder / "truth.toml"
    path.write_text(edited(TRUTH, *edits), encoding="utf-8")
    return path


def heading(text: str) -> str:
    """The first line after those of the error of each axis."""
    return text.split("\n\n")[1].splitlines()[0]


@pytest.mark.rest
def test_text_and_data_say_the_same(tmp_path: Path) -> None:
    scan = write_pair(tmp_path, SHORT)
    shown, plain = run("simulate", scan), run("simulate", scan, "--json")
    assert (shown.status, shown.err, plain.status, plain.err) == (0, "", 0, "")
    assert "simulation" in heading(shown.out)
    assert shown.out.splitlines()[-1].startswith("A simulation, not a measurement")
    data = json.loads(plain.out)
    assert data["simulation"] is True
    rows = [line for line in shown.out.splitlines() if line.startswith(("x  ", "y  "))]
    for stage in ("given", "calibrated"):
        models = data[stage]["models"]
        assert list(models) == ["triangle", "sinusoidal", "harmonic"]
        for axis in "xy":
            for model in models:
                row, found = rows.pop(0), models[model][axis]
                assert row.startswith(f"{axis}     {model}")
                assert ("*" in row) == (model == "harmonic") == (axis in models[model]["in_scanner_file"])
                assert f"{found['size_error_percent']:+6.2f}  forward" in row
                assert f"   {found['forward']['residual_peak_percent']:+6.3f}   " in row
                for name in ("residual_range_percent", "residual_about_image_line_percent"):
                    low, high = found["forward"][name]
                    assert f"{low:+6.3f} .. {high:+6.3f}" in row
                assert row.endswith(f"{found['forward']['scaling_error_peak_to_peak_percent']:6.3f}")
        # y images forward only.
        assert ["backward" in models["triangle"][axis] for axis in "xy"] == [True, False]
    assert not rows


@pytest.mark.common
def test_a_calibration_makes_the_scan_straighter(tmp_path: Path) -> None:
    """x at the example's 200 nm: the example's file is another scanner's, of the same kind."""
    data = json.loads(run("simulate", write_pair(tmp_path, SHORT), "--json").out)
    given, calibrated = (data[stage]["models"]["harmonic"]["x"] for stage in ("given", "calibrated"))
    for side in ("forward", "backward"):
        before, after = (one[side]["scaling_error_peak_to_peak_percent"] for one in (given, calibrated))
        assert after < 0.5 * before
    assert abs(calibrated["size_error_percent"]) < 1.0 < abs(given["size_error_percent"])


@pytest.mark.rest
def test_noise_and_seed_are_those_of_the_calibration(tmp_path: Path) -> None:
    scan = write_pair(tmp_path, SHORT)
    first, again, other, loud = (
        json.loads(run("simulate", scan, "--json", *extra).out)
        for extra in ((), ("--seed", "0"), ("--seed", "1"), ("--noise", "1"))
    )
    assert first == again
    for changed in (other, loud):
        assert changed["given"] == first["given"]
        assert changed["calibrated"] != first["calibrated"]


@pytest.mark.common
def test_without_a_calibration(tmp_path: Path) -> None:
    data = json.loads(run("simulate", write_pair(tmp_path, SHORT), "--json", "--no-calibration").out)
    assert "given" in data
    assert "calibrated" not in data


@pytest.mark.common
def test_a_calibration_needs_scipy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "scipy", None)
    scan = write_pair(tmp_path, SHORT)
    outcome = run("simulate", scan)
    assert outcome.status == ExitStatus.TOOL_MISSING
    assert "piezo-tablegen[calibrate]" in outcome.err
    assert "--no-calibration" in outcome.err
    assert run("simulate", scan, "--no-calibration").status == 0


@pytest.mark.common
def test_a_line_and_a_frame_as_csv(tmp_path: Path) -> None:
    scan = write_pair(tmp_path, SHORT)
    assert run("simulate", scan, "--csv", tmp_path / "out" / "ticks.csv").status == 0
    lines = (tmp_path / "out" / "ticks.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == "# simulation"
    rows = list(csv.DictReader(lines[1:]))
    stages, models = ("given", "calibrated"), ("triangle", "sinusoidal", "harmonic")
    for stage, model in product(stages, models):
        mine = [row for row in rows if (row["scanner"], row["model"]) == (stage, model)]
        x, y = ([row for row in mine if row["axis"] == axis] for axis in "xy")
        assert len(x) == 1250
        assert len(y) == 25_000 / 3 + 2 / 3  # every third tick of the frame
        volts = np.array([float(row["drive_v"]) for row in x])
        codes = np.array([float(row["code"]) for row in x])
        assert volts == pytest.approx(10.0 * (-5.0 + codes * 10.0 / 65536) + 50.0)
        moved = np.array([float(row["displacement_nm"]) for row in x])
        assert np.ptp(moved) == pytest.approx(190.0, rel=0.05)  # its turns are rounded


@pytest.mark.common
def test_a_figure(tmp_path: Path) -> None:
    scan = write_pair(tmp_path, SHORT)
    assert run("simulate", scan, "--plot", tmp_path / "figure.png").status == 0
    assert (tmp_path / "figure.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


@pytest.mark.common
def test_wrong_use(tmp_path: Path) -> None:
    scan = write_pair(tmp_path, SHORT)
    for arguments, why in (
        (("--plot", tmp_path / "figure.gif"), "the name has to end in .png, .svg or .pdf"),
        (("--noise", "nan"), "nan is not a finite number"),
    ):
        outcome = run("simulate", scan, *arguments)
        assert outcome.status == ExitStatus.WRONG_INPUT
        assert why in outcome.err
    assert not (tmp_path / "figure.gif").exists()


@pytest.mark.common
def test_a_figure_needs_matplotlib(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    outcome = run("simulate", write_pair(tmp_path, SHORT), "--plot", tmp_path / "figure.png")
    assert outcome.status == ExitStatus.TOOL_MISSING
    assert "piezo-tablegen[plot]" in outcome.err
    assert not (tmp_path / "figure.png").exists()


@pytest.mark.common
def test_a_scanner_of_another_range(tmp_path: Path) -> None:
    """150 V and 67 nm/V: the built-in one is scaled, which is said; before, sizes were 85 % too small."""
    edits = ["v_max = 150", *(f"{a}.size.{key}" for a in "xy" for key in ("k_nm_per_v = 67", "base_nm = 2000"))]
    scan = edited(SHORT, "dac.v_min = 0", "dac.v_max = 10", "amplifier.gain = 15", "amplifier.bias_v = 0")
    scan = edited(scan, *(f"{a}.{key}" for a in "xy" for key in ("size_nm = 2000", "offset_v = 75")))
    shown = run("simulate", write_pair(tmp_path, scan, edited(SCANNER, *edits)), "--json")
    assert (shown.status, shown.err) == (0, "")
    data = json.loads(shown.out)
    assert data["virtual_scanner"].endswith(", scaled to 0..150 V, 67 nm/V in x and 67 nm/V in y")
    for stage in ("given", "calibrated"):
        assert not data[stage]["rejected"]
        for model in data[stage]["models"].values():
            assert all(abs(model[axis]["size_error_percent"]) < 5.0 for axis in "xy")
    harmonic = data["calibrated"]["models"]["harmonic"]["x"]
    assert abs(harmonic["size_error_percent"]) < 1.0
    # What a file says is played as it says.
    given = run(
        "simulate", tmp_path / "scan.toml", "--no-calibration", "--scanner-truth", truth(tmp_path, "v_max = 150")
    )
    assert "virtual'" in heading(given.out)
    assert "scaled" not in given.out


@pytest.mark.common
def test_the_own_operator(tmp_path: Path) -> None:
    scan = write_operator_scan(tmp_path, operator_file())
    shown, plain, other = (run("simulate", scan, *extra) for extra in ((), ("--json",), ("--json", "--seed", "5")))
    assert (shown.status, shown.err, plain.status, plain.err) == (0, "", 0, "")
    assert "simulation on the scanner file's own operator; 200 nm in x requested" in heading(shown.out)
    assert shown.out.splitlines()[-1].startswith("A simulation, not a measurement")
    assert "y     has no operator; --scanner-truth default" in shown.out
    data = json.loads(plain.out)
    assert (data["simulation"], data["virtual_scanner"], data["without_operator"]) == (True, "own", ["y"])
    corrections = data["axes"]["x"]["corrections"]
    assert list(corrections) == ["uncompensated", "laws", "operator"]
    rows = [line for line in shown.out.splitlines() if line.startswith("x  ")]
    for row, (name, found) in zip(rows, corrections.items(), strict=True):
        assert row.startswith(f"x     {name}")
        for measure, figures in found["errors_percent"].items():
            sign = "+" if measure == "size" else ""
            assert f"{figures['mean']:{sign}.3f} ({figures['worst']:{sign}.3f})" in row
    rms = [found["errors_percent"]["rms"]["mean"] for found in corrections.values()]
    assert rms[0] > 3.0 * rms[2]
    assert rms[1] > 3.0 * rms[2]
    changed = json.loads(other.out)["axes"]["x"]["corrections"]["operator"]["errors_percent"]
    assert changed != corrections["operator"]["errors_percent"]
    asked = run("simulate", scan, "--json", "--scanner-truth", "own")
    assert asked.out == plain.out


@pytest.mark.common
def test_what_goes_with_the_own_operator(tmp_path: Path) -> None:
    scan = write_operator_scan(tmp_path, operator_file(), "x.offset_v = 60", branches=False)
    text = run("simulate", scan).out
    assert "x     laws              none: the scanner file has no branches for this axis" in text
    assert "the nearest trace is 10 % of v_max from this offset" in text
    for extra, name in (
        (("--csv", tmp_path / "a.csv"), "--csv"),
        (("--noise", "1"), "--noise"),
        (("--no-calibration",), "--calibration"),
    ):
        outcome = run("simulate", scan, *extra)
        assert outcome.status == ExitStatus.WRONG_INPUT
        assert f"{name} does not go with the scanner file's own operator; give --scanner-truth default" in outcome.err
    built_in = run("simulate", scan, "--scanner-truth", "default", "--no-calibration")
    assert (built_in.status, built_in.err) == (0, "")
    assert "its operator is that of the piezo on which it was measured" in built_in.out
    none = run("simulate", write_pair(tmp_path, SHORT), "--scanner-truth", "own")
    assert none.status == ExitStatus.WRONG_INPUT
    assert "scanner.toml has no operator; fit one with tablegen calibrate operator" in none.err


@pytest.mark.common
def test_an_own_operator_that_cannot_be_played(tmp_path: Path) -> None:
    large = run("simulate", write_operator_scan(tmp_path, operator_file(), "x.size_nm = 5000"))
    assert large.status == ExitStatus.WRONG_INPUT
    assert "x.size_nm" in large.err
    loose = run("simulate", write_operator_scan(tmp_path, operator_file(rms=60.0)))
    assert loose.status == ExitStatus.WRONG_INPUT
    assert "with a random departure of its own uncertainty" in loose.err


@pytest.mark.common
def test_an_uncalibrated_scanner_is_a_triangle(tmp_path: Path) -> None:
    scanner = edited(SCANNER, "- [x.hysteresis]", "- [[x.hysteresis.branches]]", "- [y.hysteresis]")
    scanner = edited(scanner, "- [[y.hysteresis.branches]]")
    outcome = run("simulate", write_pair(tmp_path, SHORT, scanner), "--json")
    assert outcome.status == 0
    data = json.loads(outcome.out)
    assert list(data["given"]["models"]) == ["triangle"]
    assert list(data["calibrated"]["models"]) == ["triangle", "sinusoidal", "harmonic"]


@pytest.mark.common
def test_a_calibrated_scan_that_cannot_be_played_leaves_the_given_one(tmp_path: Path) -> None:
    """98 V for k as given; this virtual scanner goes less far a volt than the file says, and takes more than 100 V."""
    scanner = edited(SCANNER, "x.size.k_nm_per_v = 15.0", "x.size.beta = 0.0")
    scan = write_pair(tmp_path, edited(SHORT, "x.size_nm = 1450.0"), scanner)
    outcome = run("simulate", scan, "--json", "--scanner-truth", truth(tmp_path))
    assert outcome.status == 0
    data = json.loads(outcome.out)
    assert data["given"]["models"]
    assert data["calibrated"]["models"] == {}
    assert "x.size_nm" in data["calibrated"]["rejected"]["harmonic"]


@pytest.mark.common
def test_another_truth(tmp_path: Path) -> None:
    """Without hysteresis, creep or resonance the triangle is straight, and compensation makes it worse."""
    scan = write_pair(tmp_path, SHORT)
    zero = ", ".join("[" + ", ".join(["0"] * (9 - i)) + "]" for i in range(9))
    straight = "\n".join(f"[{axis}.hysteresis]\nreversible_nm = [1000]\ndensity_nm = [{zero}]" for axis in "xy")
    (tmp_path / "straight.toml").write_text(f'name = "straight"\nv_max = 100\n{straight}\n', encoding="utf-8")
    outcome = run("simulate", scan, "--scanner-truth", tmp_path / "straight.toml", "--json")
    data = json.loads(outcome.out)
    assert data["virtual_scanner"] == "straight"
    # There is nothing to calibrate, which is said.
    assert data["calibrated"]["models"] == {}
    assert "no hysteresis" in data["calibrated"]["rejected"]["calibration"]
    plain, shaped = (data["given"]["models"][model]["x"]["forward"] for model in ("triangle", "harmonic"))
    assert abs(plain["residual_peak_percent"]) < 0.05
    assert shaped["residual_peak_percent"] == pytest.approx(2.08, abs=0.1)  # (22) at 0.2 of full scale


@pytest.mark.common
def test_the_scanner_of_another_family(tmp_path: Path) -> None:
    """By name; it says what it was identified on, and a calibration on it makes the scan straighter."""
    scan = write_pair(tmp_path, SHORT)
    outcome = run("simulate", scan, "--scanner-truth", "duhem", "--json")
    assert (outcome.status, outcome.err) == (0, "")
    data = json.loads(outcome.out)
    assert data["virtual_scanner"] == "virtual, Duhem"
    assert data["identified_on"] == "numbers that the paper prints"
    given, calibrated = (data[stage]["models"]["harmonic"]["x"] for stage in ("given", "calibrated"))
    for side in ("forward", "backward"):
        before, after = (one[side]["scaling_error_peak_to_peak_percent"] for one in (given, calibrated))
        assert after < 0.6 * before
    (tmp_path / "own.toml").write_text(edited(DUHEM, "- identified_on"), encoding="utf-8")
    shown = run("simulate", scan, "--scanner-truth", tmp_path / "own.toml", "--no-calibration")
    assert shown.out.splitlines()[-1].endswith("identified on nothing that its file names.")


@pytest.mark.common
@pytest.mark.parametrize(
    ("text", "edit", "key", "why"),
    [
        (DUHEM, "x.hysteresis.family = 'preisach'", "x.hysteresis.lags", "not of the family 'preisach'"),
        (DUHEM, "x.hysteresis.family = 'bouc-wen'", "x.hysteresis.family", "is not one of"),
        (DUHEM, "y.hysteresis.reversible_nm = [100]", "y.hysteresis.reversible_nm", "could run backwards"),
        (DUHEM, "x.second_resonance.share = 1", "x.second_resonance.share", "is not below 1"),
        (DUHEM, "- [x.resonance]", "x.second_resonance", "needs the first one"),
        (TRUTH, "x.hysteresis.family = 'duhem'", "x.hysteresis.density_nm", "not of the family 'duhem'"),
    ],
)
def test_faults_of_a_family(tmp_path: Path, text: str, edit: str, key: str, why: str) -> None:
    path = tmp_path / "truth.toml"
    path.write_text(edited(text, edit), encoding="utf-8")
    with pytest.raises(Rejected) as caught:
        load_truth(path)
    assert [(problem.key, why in problem.why) for problem in caught.value.problems] == [(key, True)]


@pytest.mark.common
@pytest.mark.parametrize(
    ("edit", "key", "why"),
    [
        ("v_max = -1", "v_max", "is below"),
        ("x.creep.loss_per_decade = 0.5", "x.creep.loss_per_decade", "is above"),
        ("x.creep.slowest_s = 1e-6", "x.creep.slowest_s", "is not above fastest_s"),
        ("x.sensitivity = [-1.5]", "x.sensitivity", "falls to"),
        ("y.resonance.quality = 0.1", "y.resonance.quality", "is below"),
        ("y.resonance.q = 3", "y.resonance.q", "unknown key"),
        ("x.hysteresis.reversible_nm = [0, 0]", "x.hysteresis.reversible_nm", "all 0"),
        ("x.hysteresis.reversible_nm = [-3]", "x.hysteresis.reversible_nm[0]", "is below 0"),
    ],
)
def test_faults_of_a_truth_file(tmp_path: Path, edit: str, key: str, why: str) -> None:
    path = truth(tmp_path, edit)
    with pytest.raises(Rejected) as caught:
        load_truth(path)
    assert [(problem.key, why in problem.why) for problem in caught.value.problems] == [(key, True)]
    outcome = run("simulate", write_pair(tmp_path, SHORT), "--scanner-truth", path)
    assert outcome.status == ExitStatus.WRONG_INPUT
    assert outcome.err.startswith(f"{path}:")


@pytest.mark.common
def test_density_is_a_triangle_of_numbers(tmp_path: Path) -> None:
    text = 'name = "a"\nv_max = 1\n' + "".join(
        f"[{axis}.hysteresis]\nreversible_nm = [1]\ndensity_nm = [[1, 2], [3, 4]]\n" for axis in "xy"
    )
    (tmp_path / "truth.toml").write_text(text, encoding="utf-8")
    with pytest.raises(Rejected, match="2 rows need 2"):
        load_truth(tmp_path / "truth.toml")


@pytest.mark.common
def test_what_cannot_be_played_is_said(tmp_path: Path) -> None:
    missing = run("simulate", write_pair(tmp_path, SHORT), "--scanner-truth", tmp_path / "none.toml")
    assert missing.status == ExitStatus.WRONG_INPUT
    small = run("simulate", write_pair(tmp_path, SHORT), "--scanner-truth", truth(tmp_path, "v_max = 55"))
    assert small.status == ExitStatus.WRONG_INPUT
    assert "leaves the 0..55 V" in small.err
    wrong = run("simulate", write_pair(tmp_path, edited(SHORT, "x.size_nm = 1e6")))
    assert wrong.status == ExitStatus.WRONG_INPUT
    assert "x.size_nm" in wrong.err


@pytest.mark.common
def test_a_model_that_is_rejected_leaves_the_others(tmp_path: Path) -> None:
    """A u_peak outside the poles of (20) rejects the harmonic model alone."""
    branch = "forward = { beta_max = 0.037, rho = 4.0, u_peak = 0.1 }"
    scanner = SCANNER.replace("forward = { beta_max = 0.037, rho = 4.0, u_peak = 0.37 }", branch, 1)
    outcome = run("simulate", write_pair(tmp_path, SHORT, scanner), "--json")
    assert outcome.status == 0
    data = json.loads(outcome.out)
    assert list(data["given"]["models"]) == ["triangle", "sinusoidal"]
    assert "u_peak" in data["given"]["rejected"]["harmonic"]
