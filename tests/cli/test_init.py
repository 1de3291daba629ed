"""``tablegen init``: what its options make, that it builds without a warning, and what it refuses."""

import tomllib
from pathlib import Path

import pytest
from editing import run
from hypothesis import given
from hypothesis import strategies as st

import tablegen
from tablegen.cli.init_files import usual_image_nm


def made(folder: Path, *options: str) -> Path:
    """The scan file that init writes."""
    outcome = run("init", folder, *options)
    assert outcome.status == 0, outcome.err
    assert outcome.err == ""
    scanner, scan = outcome.out.splitlines()
    assert scanner == str(folder / "scanner.toml")
    return Path(scan)


OPTIONS: dict[tuple[str, ...], dict[str, object]] = {
    (): {"image_nm": 200.0, "pixels": 200, "image_lines": 200, "line_rate_hz": 500.0, "bits": 16, "clock": 500e3},
    ("--image-um", "2", "--pixels", "512", "--line-rate", "1"): {
        "image_nm": 2000.0, "pixels": 512, "image_lines": 512, "line_rate_hz": 1.0,
    },
    ("--bits", "18", "--tick", "2us", "--frame", "up-down", "--lines", "100"): {
        "bits": 18, "clock": 500e3, "frame": "up-down", "image_lines": 100, "pixels": 200,
    },
    ("--clock", "1MHz", "--frame-rate", "0.5", "--image-nm", "50", "--name", "mine"): {
        "clock": 1e6, "frame_rate_hz": 0.5, "image_nm": 50.0, "name": "mine",
    },
    ("--v-max", "3.6", "--nm-per-v", "12500"): {"image_nm": 10000.0, "name": "image_10000nm"},
    ("--v-max", "10", "--nm-per-v", "5"): {"image_nm": 10.0},
    ("--v-max", "100", "--nm-per-v", "10"): {"image_nm": 200.0},
    ("--bits", "14", "--clock", "100k", "--pixels", "128"): {"bits": 14, "clock": 100e3, "pixels": 128},
}  # fmt: skip


@pytest.mark.common
@pytest.mark.parametrize("options", OPTIONS, ids=" ".join)
def test_what_it_writes_says_what_was_asked_and_builds_without_a_warning(
    options: tuple[str, ...], tmp_path: Path
) -> None:
    path = made(tmp_path / "demo", *options)
    scan, scanner = (tomllib.loads(file.read_text("utf-8")) for file in (path, path.with_name("scanner.toml")))
    said = {**scan, **scan["timing"], "bits": scanner["dac"]["bits"], "clock": scanner["dac"]["update_rate_hz"]}
    for key, value in OPTIONS[options].items():
        assert said[key] == value, key
    checked = run("check", path, "--strict")
    assert (checked.status, checked.err) == (0, "")
    schedule = tablegen.plan(path).schedule
    assert schedule.up.count == said["image_lines"]
    assert schedule.pixels == said["pixels"]
    assert schedule.pixel_ticks.denominator == 1 or "frame_rate_hz" in said
    assert path.stem == scan["name"]


@given(v_max=st.floats(0.01, 2000.0), nm_per_v=st.floats(0.001, 1e5))
def test_the_usual_image_fits_the_scanner(v_max: float, nm_per_v: float) -> None:
    """200 nm where they fit; otherwise from a tenth to a quarter of the range."""
    size, whole = usual_image_nm((0.0, v_max), nm_per_v), v_max * nm_per_v
    if size == 200.0 and 0.02 <= 200.0 / whole <= 0.5:
        return
    assert 0.099 * whole <= size <= 0.2501 * whole
    assert f"{size:e}"[:2] in ("1.", "2.", "5.")


def test_nothing_is_said_twice(tmp_path: Path) -> None:
    """y says what it has of its own, and the scan what is no matter of the instrument."""
    path = made(tmp_path)
    scan, scanner = (tomllib.loads(file.read_text("utf-8")) for file in (path, path.with_name("scanner.toml")))
    assert scan["y"] == {"like": "x"}
    assert "dac" not in scan
    for name, table in scanner["y"].items():
        if isinstance(table, dict):
            assert all(scanner["x"][name].get(key) != value for key, value in table.items())


@pytest.mark.common
def test_few_bits_are_warned_of_with_what_would_be_enough(tmp_path: Path) -> None:
    outcome = run("init", tmp_path, "--bits", "12", "--clock", "100k", "--pixels", "128")
    assert outcome.status == 0
    assert all(line.startswith("warning: annexin_200nm.toml: image_nm: ") for line in outcome.messages)
    assert "dac.bits = 13 in scanner leaves" in outcome.err
    assert run("build", tmp_path / "annexin_200nm.toml", "-o", tmp_path / "out").status == 0


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--line-rate", "1e6"), "timing.line_rate_hz: a line of 1 ticks is outside 8..16777216; "),
        (("--bits", "30"), "dac.bits: 30 is above 24"),
        (("--pixels", "70000"), "timing.pixels: 70000 is above 65536"),
        (("--name", "1st"), "name: '1st' "),
        (("--image-um", "1", "--image-nm", "2"), "give --image-nm or --image-um, not both"),
        (("--line-rate", "1", "--frame-rate", "2"), "give --line-rate or --frame-rate, not both"),
        (("--clock", "1M", "--tick", "1us"), "give --clock or --tick, not both"),
        (("--clock", "fast"), "'fast' is not a number with a unit, such as 500k or 1MHz"),
        (("--tick", "2"), "'2' is not a number with a unit, such as 2us"),
        (("--image-um", "0"), "an image has a size above 0"),
        (("--image-um", "nan"), "not a finite number"),
    ],
)
def test_what_cannot_be_built_is_refused_and_nothing_written(
    options: tuple[str, ...], says: str, tmp_path: Path
) -> None:
    outcome = run("init", tmp_path / "demo", *options)
    assert outcome.status == 2
    assert says in " ".join(outcome.err.split()), outcome.err
    assert not (tmp_path / "demo").exists()


OWN_SCANNERS: dict[tuple[str, ...], tuple[float, float, float]] = {
    ("--v-max", "150", "--nm-per-v", "20", "--gain", "15"): (0.0, 150.0, 15.0),
    ("--v-min", "-20", "--v-max", "120"): (-20.0, 120.0, 14.0),
    ("--nm-per-v", "35", "--image-um", "1"): (0.0, 100.0, 10.0),
    ("--gain", "8", "--image-nm", "400"): (0.0, 100.0, 8.0),
}


@pytest.mark.common
@pytest.mark.parametrize("options", OWN_SCANNERS, ids=" ".join)
def test_an_own_scanner_has_no_hysteresis_of_the_example(options: tuple[str, ...], tmp_path: Path) -> None:
    path = made(tmp_path, *options)
    text = path.with_name("scanner.toml").read_text("utf-8")
    scanner, (low, high, gain) = tomllib.loads(text), OWN_SCANNERS[options]
    assert (scanner.get("v_min", 0.0), scanner["v_max"], scanner["amplifier"]["gain"]) == (low, high, gain)
    assert set(scanner["x"]) == {"size"}
    assert "tablegen calibrate images" in text
    if "--nm-per-v" in options:
        assert scanner["x"]["size"]["k_nm_per_v"] == float(options[options.index("--nm-per-v") + 1])
    checked = run("check", path, "--strict")
    assert (checked.status, checked.err) == (0, "")
    assert checked.out.startswith("x: not measured: hysteresis is not corrected")
    assert run("build", path, "-o", tmp_path / "out").status == 0


@pytest.mark.parametrize(
    "options",
    [
        ("--v-max", "-5"), ("--v-min", "10", "--v-max", "5"), ("--nm-per-v", "0"),
        ("--v-max", "1e308", "--nm-per-v", "1e308"), ("--v-max", "1e-10", "--nm-per-v", "1e-320"),
    ],
)  # fmt: skip
def test_an_own_scanner_that_cannot_be(options: tuple[str, ...], tmp_path: Path) -> None:
    outcome = run("init", tmp_path, *options)
    assert outcome.status == 2
    assert list(tmp_path.iterdir()) == []


def test_a_gain_without_range_is_refused(tmp_path: Path) -> None:
    """The builder has the reason: a scan of 200 nm does not fit what such an amplifier gives."""
    outcome = run("init", tmp_path, "--gain", "0.01")
    assert outcome.status == 2
    assert "nothing was written" in outcome.err
