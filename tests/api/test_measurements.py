"""Calibrate, refine and correct from Python: the same as the commands, from files and from arrays; the laboratory."""

import json
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from building import EXAMPLE
from editing import run

import tablegen


def csv(path: Path, columns: dict[str, np.ndarray]) -> Path:
    """Columns as a file, every bit of every number."""
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    text = "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)])
    path.write_text(text + "\n", "utf-8")
    return path


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    for name in ("annexin_200nm.toml", "scanner.toml"):
        shutil.copy(EXAMPLE.parent / name, tmp_path)
    return tmp_path


@pytest.fixture
def laboratory() -> tablegen.Laboratory:
    return tablegen.Laboratory(like=EXAMPLE.parent / "scanner.toml", seed=4)


def measured(laboratory: tablegen.Laboratory) -> dict[str, list[dict[str, np.ndarray]]]:
    """What each calibration takes; coarse, since only equality counts."""
    hz = np.geomspace(8e3, 120e3, 60)
    return {
        "size": [laboratory.sizes("x", [10.0, 20.0, 40.0, 60.0, 80.0, 100.0], 100.0)],
        "offset": [laboratory.apparent_sizes("x", [7.0, 28.0, 50.0, 72.0, 93.0], 13.0, 100.0)],
        "hysteresis": [laboratory.trace("x", volts, 50.0, 100.0) for volts in (30.0, 60.0, 100.0)],
        "frequency": [laboratory.response("x", np.geomspace(10.0, 1000.0, 9))],
        "resonance": [laboratory.response("x", hz)],
    }


@pytest.mark.common
def test_calibrations_are_those_of_the_command(lab: Path, laboratory: tablegen.Laboratory) -> None:
    """Numbers, and the scanner file, byte for byte; of arrays all but the name and the digest of the measurement."""
    for kind, columns in measured(laboratory).items():
        files = [csv(lab / f"{kind}{number}.csv", one) for number, one in enumerate(columns)]
        ours, theirs = (shutil.copy(lab / "scanner.toml", lab / name) for name in ("ours.toml", "theirs.toml"))
        points = ["--points"] if kind == "hysteresis" else []
        command = run("calibrate", kind, *files, "--axis", "x", "--scanner", theirs, "--json", "--write", *points)
        assert command.status == 0, command.err
        found = tablegen.calibrate(kind, files, axis="x", scanner=ours, points=bool(points))  # type: ignore[arg-type]
        assert found.record == json.loads(command.out)
        assert found.kind == kind
        assert found.write(ours) == ["ours.toml"]
        assert Path(ours).read_bytes() == Path(theirs).read_bytes()
        assert found.write(ours) == []
        of_arrays = tablegen.calibrate(kind, columns, axis="x", scanner=lab / "scanner.toml")  # type: ignore[arg-type]
        assert of_arrays.parameters.keys() == found.parameters.keys()
        for key, estimate in of_arrays.parameters.items():
            assert estimate.value == pytest.approx(found.parameters[key].value, rel=1e-9), key
        assert "± " in repr(found)


def test_a_scanner_file_is_begun(lab: Path, laboratory: tablegen.Laboratory) -> None:
    path = lab / "new.toml"
    found = tablegen.calibrate("size", laboratory.sizes("x", np.linspace(10, 100, 8), 100.0), axis="x", v_max=100.0)
    with pytest.raises(tablegen.Rejected, match=r"new\.toml: v_max: the file is not there; give v_max"):
        found.write(path)
    found.write(path, v_max=100.0)
    assert "[x.size]" in path.read_text("utf-8")


@pytest.mark.common
def test_a_measured_response_goes_beside_the_file(lab: Path, laboratory: tablegen.Laboratory) -> None:
    response = measured(laboratory)["resonance"][0]
    found = tablegen.calibrate("resonance", response, axis="x", scanner=lab / "scanner.toml", points=True)
    assert found.write(lab / "scanner.toml") == ["scanner_x_response.csv", "scanner.toml"]
    assert tablegen.build(lab / "annexin_200nm.toml").plan.x.drive.response is not None


def test_a_fit_that_means_nothing_is_not_written(lab: Path) -> None:
    volts = np.linspace(10.0, 100.0, 5)
    data = {"drive_v": volts, "actual_nm": 10.0 * volts * (1.0 + np.array([0.4, -0.3, 0.4, -0.3, 0.4]))}
    found = tablegen.calibrate("size", data, axis="x", scanner=lab / "scanner.toml")
    before = (lab / "scanner.toml").read_bytes()
    assert found.doubts
    with pytest.raises(tablegen.Rejected, match=r"scanner\.toml: x: "):
        found.write(lab / "scanner.toml")
    assert (lab / "scanner.toml").read_bytes() == before


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"drive_v": [1.0, 2.0]}, r"values: actual_nm: missing"),
        ({"drive_v": [1.0, 2.0], "actual_nm": [1.0]}, r"values: columns of different lengths: 1, 2"),
        ({"drive_v": [1.0, 2.0], "actual_nm": [1.0, -3.0]}, r"values: actual_nm\[1\]: -3 is no actual"),
        ({"drive_v": [1.0, float("nan")], "actual_nm": [1.0, 3.0]}, r"values: drive_v\[1\]: nan is no drive"),
        ({"drive_v": [[1.0, 2.0]], "actual_nm": [1.0, 3.0]}, r"values: drive_v: has the shape \(1, 2\)"),
        ("absent.csv", r"absent\.csv: is not a file"),
    ],
)
def test_wrong_columns_are_refused(data: object, said: str) -> None:
    with pytest.raises(tablegen.Rejected, match=said):
        tablegen.calibrate("size", data, axis="x", v_max=100.0)  # type: ignore[arg-type]


def test_without_a_full_scale_nothing_is_fitted(laboratory: tablegen.Laboratory) -> None:
    with pytest.raises(ValueError, match="give v_max"):
        tablegen.calibrate("size", {"drive_v": [1.0], "actual_nm": [1.0]}, axis="x")
    with pytest.raises(ValueError, match="'sizes' is none of size, offset"):
        tablegen.calibrate("sizes", {}, axis="x", v_max=100.0)  # type: ignore[arg-type]


@pytest.mark.common
def test_a_round_is_that_of_the_command(lab: Path, laboratory: tablegen.Laboratory) -> None:
    scan = lab / "annexin_200nm.toml"
    trace = laboratory.running_trace(scan, "x")
    path = csv(lab / "trace.csv", trace)
    found = tablegen.refine(scan, path, axis="x")
    of_arrays = tablegen.refine(tablegen.load(scan), trace, axis="x")
    assert of_arrays.before_percent == pytest.approx(found.before_percent, rel=1e-9)
    with pytest.raises(ValueError, match="the scan was given as a setup"):
        of_arrays.content()
    content = found.content()
    command = run("refine", scan, path, "--axis", "x", "--json", "--write")
    assert command.status == 0, command.err
    assert content == scan.read_bytes()
    assert found.write() == []  # it is there already
    built = tablegen.build(of_arrays.setup)
    assert built.plan.x.layer is not None
    assert f"\n  x: {found.before_percent:.2g} % of the line = " in repr(found)


@pytest.mark.common
def test_refining_stops_where_the_scaling_error_rises_and_keeps_the_best_layer(
    lab: Path, laboratory: tablegen.Laboratory
) -> None:
    scan = lab / "annexin_200nm.toml"
    first = tablegen.refine(scan, laboratory.running_trace(scan, "x"), axis="x")
    first.write()
    text = scan.read_text("utf-8")
    said = tomllib.loads(text)["x"]["refinement"]
    assert said["before_scaling_percent"] == pytest.approx(
        max(first.round.update.before.scaling_percent.values()), 0.01
    )
    assert "previous_a" not in said, "no layer was played before"
    trace = laboratory.running_trace(scan, "x")
    second = tablegen.refine(scan, trace, axis="x")
    assert second.stopped == ""
    second.write()
    assert tomllib.loads(scan.read_text("utf-8"))["x"]["refinement"]["previous_a"] == said["a"]

    # The same trace beside a round that had less of it: without a layer, then with one.
    better = text.replace(f"before_scaling_percent = {said['before_scaling_percent']}", "before_scaling_percent = 0.01")
    scan.write_text(better, "utf-8")
    without = tablegen.refine(scan, trace, axis="x")
    assert "the scaling error rose from 0.01 % to" in without.refused
    assert "which had no layer: remove [x.refinement]" in without.refused
    best = [1e-4, 2e-4]
    scan.write_text(
        better.replace("before_scaling", f"previous_a = {best}\nprevious_b = {best}\nbefore_scaling"), "utf-8"
    )
    stopped = tablegen.refine(scan, trace, axis="x")
    assert stopped.refused == ""
    assert stopped.stopped.endswith("the layer of that round is the best, and is kept")
    assert "stopped: the scaling error rose" in repr(stopped)
    played = tablegen.build(stopped.setup).plan.x.layer
    assert played is not None
    assert played.a.tolist() == best
    forced = stopped.content(force=True)
    command = run("refine", scan, csv(lab / "trace.csv", trace), "--axis", "x", "--json", "--write")
    assert command.status == 0, command.err
    assert "the scaling error rose from 0.01 % to" in command.err
    assert "x.refinement written, with the best layer; build and upload" in command.err
    kept = tomllib.loads(scan.read_text("utf-8"))["x"]["refinement"]
    assert (kept["a"], kept["b"], kept["best"]) == (best, best, True)
    assert "larger than before: the layer before it was kept" in scan.read_text("utf-8")
    assert tomllib.loads(forced.decode())["x"]["refinement"]["a"] == second.round.update.layer.a.tolist()

    again = tablegen.refine(scan, laboratory.running_trace(scan, "x"), axis="x")
    assert "is the best of its rounds" in again.refused
    again.write(force=True)
    assert "best" not in tomllib.loads(scan.read_text("utf-8"))["x"]["refinement"]


def test_a_round_from_the_trace_before_is_refused(lab: Path, laboratory: tablegen.Laboratory) -> None:
    scan = lab / "annexin_200nm.toml"
    with pytest.raises(tablegen.Rejected, match="drive_v: missing; or give --triggered"):
        tablegen.refine(scan, {"time_s": [0.0, 1.0], "displacement_nm": [0.0, 1.0]}, axis="x")
    trace = laboratory.running_trace(scan, "x")
    untimed = {key: trace[key] for key in ("time_s", "displacement_nm")}
    tablegen.refine(scan, untimed, axis="x", triggered=True).write()
    again = tablegen.refine(scan, untimed, axis="x", triggered=True, harmonics=4)
    assert "already refined by this trace" in again.refused or "the residual grew" in again.refused
    with pytest.raises(tablegen.Rejected, match=r"annexin_200nm\.toml: x: "):
        again.write()


@pytest.mark.common
def test_an_image_is_corrected_as_by_the_command(lab: Path, laboratory: tablegen.Laboratory) -> None:
    image = laboratory.image(laboratory.lattice(17.7), 20.0, 50.0, 2.0, pixels=96, slow_turn=0.95)
    both = image.trace.heights, image.retrace.heights
    files = [lab / "t.npy", lab / "r.npy"]
    for path, heights in zip(files, both, strict=True):
        np.save(path, heights)
    how = {"size_v": 20.0, "offset_v": 50.0, "rate_hz": 2.0, "slow_turn": 0.95}
    options = [f"--{key.replace('_', '-')}={value}" for key, value in how.items()]
    scanner = lab / "scanner.toml"
    command = run("correct", *files, "--scanner", scanner, *options, "-o", lab / "out.npy", "--json")
    assert command.status == 0, command.err
    expected = np.load(lab / "out.npy")
    found = tablegen.correct(*both, scanner=scanner, **how)
    of_files = tablegen.correct(*files, scanner=scanner, **how)
    assert np.array_equal(found.trace, expected[0], equal_nan=True)
    assert np.array_equal(of_files.trace, expected[0], equal_nan=True)
    assert found.retrace is not None
    assert np.array_equal(found.retrace, expected[1], equal_nan=True)
    assert of_files.record == json.loads(command.out)
    assert of_files.write(lab / "again.npy") == ["again.npy", "again.json"]
    assert (lab / "again.npy").read_bytes() == (lab / "out.npy").read_bytes()
    straight = tablegen.correct(*both, lattice_nm=17.7)
    assert straight.size_nm is not None
    assert straight.size_nm[0] == pytest.approx(np.ptp(image.trace.x_nm), rel=0.02)  # the truth
    assert straight.difference is not None
    assert straight.difference[1] < 0.3 * straight.difference[0]


def test_correct_wants_one_way(lab: Path) -> None:
    image = np.zeros((8, 8))
    for ways in ({}, {"fit": True, "scanner": lab / "scanner.toml"}):
        with pytest.raises(TypeError, match="one of the ways"):
            tablegen.correct(image, **ways)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="sizev is none of size_v"):
        tablegen.correct(image, fit=True, sizev=1.0)
    with pytest.raises(TypeError, match="both images as files, or both as arrays"):
        tablegen.correct(image, "retrace.npy", fit=True)
    with pytest.raises(tablegen.Rejected, match="retrace: has another shape"):
        tablegen.correct(image, np.zeros((8, 9)), fit=True)
    with pytest.raises(tablegen.Rejected, match=r"trace: has the shape \(8,\)"):
        tablegen.correct(np.zeros(8), fit=True)


def test_a_laboratory_repeats_itself_and_is_scaled(lab: Path) -> None:
    one, again, other = (tablegen.Laboratory(like=lab / "scanner.toml", seed=seed) for seed in (1, 1, 2))
    first, second, third = (each.sizes("x", [20.0, 50.0], 100.0)["actual_nm"] for each in (one, again, other))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, third)
    clean = tablegen.Laboratory(like=lab / "scanner.toml", noise=0.0)
    assert clean.sizes("x", [20.0], 100.0)["actual_nm"][0] == pytest.approx(200.0, rel=0.05)  # k is 10 nm/V at 200 nm
    (lab / "half.toml").write_text((lab / "scanner.toml").read_text().replace("k_nm_per_v = 10.0", "k_nm_per_v = 5.0"))
    half = tablegen.Laboratory(like=lab / "half.toml", noise=0.0)
    assert half.scaled == "scaled to 0..100 V, 5 nm/V in x and 5 nm/V in y"
    assert "simulated" in repr(half)
    frame = clean.frame(lab / "annexin_200nm.toml", clean.grating(40.0), pixels=16)
    assert frame.trace.heights.shape == (tablegen.plan(lab / "annexin_200nm.toml").schedule.up.count, 16)


@pytest.mark.common
def test_the_laboratory_plays_what_simulate_plays(lab: Path) -> None:
    scan = lab / "annexin_200nm.toml"
    outcome = run("simulate", scan, "--no-calibration", "--json")
    told = json.loads(outcome.out)
    laboratory = tablegen.Laboratory(like=lab / "scanner.toml")
    size = laboratory.play(scan, "x").size_error_percent
    assert round(size, 3) in {round(value, 3) for value in _numbers(told)}


def _numbers(value: object) -> list[float]:
    if isinstance(value, dict):
        return [one for inner in value.values() for one in _numbers(inner)]
    if isinstance(value, list):
        return [one for inner in value for one in _numbers(inner)]
    return [float(value)] if isinstance(value, int | float) else []
