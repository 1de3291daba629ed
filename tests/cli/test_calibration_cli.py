"""``tablegen calibrate`` as its users meet it: from CSV files to a scanner file that builds."""

import hashlib
import importlib.util
import json
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from building import REPOSITORY
from calibrating import AMPLITUDES, CASES, DRIVES, FREQUENCIES, OFFSETS, RESPONSE, Scanner, actual, apparent, trials
from editing import SCANNER, Outcome, run, write_pair

from tablegen.calibration.fit_text import figures
from tablegen.compensation.offset import OffsetLaw
from tablegen.compensation.size import SizeLaw
from tablegen.fitting.estimate import Estimate

NOISE = 1.0 + 0.002 * np.random.default_rng(11).standard_normal(100)


def write_csv(path: Path, **columns: Any) -> Path:
    rows = zip(*([repr(float(v)) for v in values] for values in columns.values()), strict=True)
    path.write_text("\n".join([",".join(columns), *map(",".join, rows)]) + "\n", "utf-8")
    return path


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the shipped pair and a measurement of each kind."""
    write_pair(tmp_path)
    write_csv(tmp_path / "offset.csv", offset_v=OFFSETS, apparent_nm=apparent(OFFSETS, 0.93, 1.22, 17.7) * NOISE[:5])
    sizes = actual(DRIVES, 11.0, 0.6, 0.5, 200.0) * NOISE[:11]
    write_csv(tmp_path / "size.csv", nominal_nm=10.0 * DRIVES, actual_nm=sizes)
    gain = (1.0 - 0.025 * np.log10(FREQUENCIES / 100.0)) * NOISE[:15]
    write_csv(tmp_path / "frequency.csv", frequency_hz=FREQUENCIES, gain=gain)
    r = RESPONSE / 41e3
    h = np.exp(-2j * np.pi * RESPONSE * 2e-6) / (1.0 - r**2 + 1j * r / 15.0)
    write_csv(
        tmp_path / "resonance.csv",
        frequency_hz=RESPONSE,
        gain=np.abs(h) * NOISE[:58],
        phase_deg=np.degrees(np.angle(h)) + 0.1 * (NOISE[42:] - 1.0) / 0.002,
    )
    scanner = Scanner(forward=(0.04, 3.0, 0.4), backward=(0.07, 1.2, 0.46))
    noise = np.random.default_rng(12).standard_normal((3, 2, 800)) * 0.002
    for v, one in zip(AMPLITUDES, noise, strict=True):
        trace = scanner.trace(v, 3.3, 800, one)
        write_csv(
            tmp_path / f"trace{v:g}.csv",
            time_s=trace.time_s,
            drive_v=trace.drive_v,
            displacement_nm=trace.displacement_nm,
        )
    monkeypatch.chdir(tmp_path)
    return tmp_path


TRACES = [f"trace{v:g}.csv" for v in AMPLITUDES]
CALIBRATIONS: dict[str, tuple[list[str], dict[str, Any]]] = {
    "offset": (["offset.csv"], {"m_minus": 0.93, "m_plus": 1.22}),
    "size": (["size.csv", "--k", "10"], {"k_nm_per_v": 11.0, "beta": 0.6, "v_threshold": 0.5}),
    "hysteresis": (TRACES, {"model": "harmonic"}),
    "frequency": (["frequency.csv"], {"alpha": 0.025, "reference_hz": 100.0}),
    "resonance": (["resonance.csv"], {"frequency_hz": 41e3, "quality": 15.0, "delay_s": 2e-6}),
}


def calibrate(kind: str, *more: str, axis: str = "x", scanner: str = "scanner.toml") -> Outcome:
    return run("calibrate", kind, "--axis", axis, *CALIBRATIONS[kind][0], "--scanner", scanner, *more)


@pytest.mark.common
def test_a_whole_calibration_is_accepted_by_check_and_builds(lab: Path) -> None:
    for kind in CALIBRATIONS:
        outcome = calibrate(kind, "--write")
        assert (outcome.status, outcome.err) == (0, ""), kind
        assert outcome.out.splitlines()[-1] == f"scanner.toml: x.{kind} written"
    written = tomllib.loads((lab / "scanner.toml").read_text("utf-8"))
    for kind, (_, truth) in CALIBRATIONS.items():
        for key, value in truth.items():
            assert written["x"][kind][key] == (value if isinstance(value, str) else pytest.approx(value, rel=0.03)), key
    (branch,) = written["x"]["hysteresis"]["branches"]
    assert branch["turn"] == 0.5
    assert branch["forward"] == pytest.approx({"beta_max": 0.04, "rho": 3.0, "u_peak": 0.4}, rel=0.1)
    assert branch["backward"] == pytest.approx({"beta_max": 0.07, "rho": 1.2, "u_peak": 0.46}, rel=0.1)
    assert written["y"] == tomllib.loads(SCANNER)["y"]
    assert written["x"]["resonance"]["max_boost_db"] == 6.0
    checked = run("check", "scan.toml")
    assert (checked.status, checked.err) == (0, "")
    assert checked.out.endswith("\nscan.toml: correct\n")
    assert run("build", "scan.toml", "-o", "out", "-q").status == 0


def test_the_file_says_from_which_bytes_and_no_date(lab: Path) -> None:
    calibrate("hysteresis", "--write")
    text = (lab / "scanner.toml").read_text("utf-8")
    for name in TRACES:
        digits = hashlib.sha256((lab / name).read_bytes()).hexdigest()[:16]
        assert f"# from {name}, sha256 {digits}\n" in text
    assert "# calibrate hysteresis, turn 0.5: 3 traces, 1" in text
    assert str(lab) not in text
    before = text
    assert calibrate("hysteresis", "--write").out.splitlines()[-1] == "scanner.toml: x.hysteresis up to date"
    assert (lab / "scanner.toml").read_text("utf-8") == before


@pytest.mark.parametrize("kind", CALIBRATIONS)
def test_without_write_nothing_is_written(kind: str, lab: Path) -> None:
    before = {path.name: path.read_bytes() for path in lab.iterdir()}
    outcome = calibrate(kind)
    assert (outcome.status, outcome.err) == (0, "")
    assert {path.name: path.read_bytes() for path in lab.iterdir()} == before
    lines = outcome.out.splitlines()
    assert lines[0].startswith(f"{kind} of x, ")
    for name in CALIBRATIONS[kind][1]:
        if name != "model":
            assert any(line.startswith(f"{name} ") for line in lines), name
    assert any("without correction; with it" in line for line in lines)
    assert max(map(len, (line for line in lines if not line.startswith(("note", "outlier"))))) <= 120


@pytest.mark.parametrize("kind", CALIBRATIONS)
def test_json_has_what_the_text_has(kind: str, lab: Path) -> None:
    record = json.loads(calibrate(kind, "--json").out)
    assert (record["kind"], record["axis"]) == (kind, "x")
    assert [source["name"] for source in record["sources"]] == [n for n in CALIBRATIONS[kind][0] if n.endswith(".csv")]
    assert record["residual_percent"]["largest"] == max(map(abs, record["residual_percent"]["each"]))
    if kind == "hysteresis":
        assert record["branches"][0]["forward"]["beta_max"]["value"] == pytest.approx(0.04, rel=0.05)
        assert len(record["branches"][0]["traces"]) == 3
    else:
        for key, value in CALIBRATIONS[kind][1].items():
            assert record["parameters"][key]["value"] == pytest.approx(value, rel=0.03)


def test_json_and_write_keep_stdout_for_the_data(lab: Path) -> None:
    outcome = calibrate("offset", "--json", "--write")
    json.loads(outcome.out)
    assert outcome.messages == ["scanner.toml: x.offset written"]


def test_a_new_file_is_made_with_v_max(lab: Path) -> None:
    assert calibrate("size", "--write", "--v-max", "100", scanner="new.toml").status == 0
    assert calibrate("offset", "--write", axis="y", scanner="new.toml").status == 0
    values = tomllib.loads((lab / "new.toml").read_text("utf-8"))
    assert (values["name"], values["v_max"]) == ("new", 100.0)
    assert sorted(values) == ["name", "v_max", "x", "y"]


def test_a_link_stays_a_link(lab: Path) -> None:
    (lab / "shared").mkdir()
    (lab / "scanner.toml").rename(lab / "shared" / "scanner.toml")
    (lab / "scanner.toml").symlink_to("shared/scanner.toml")
    assert calibrate("offset", "--write").status == 0
    assert (lab / "scanner.toml").is_symlink()
    assert "# calibrate offset" in (lab / "shared" / "scanner.toml").read_text("utf-8")


@pytest.mark.common
@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_a_plot_is_drawn_and_the_same_twice(ending: str, lab: Path) -> None:
    begins = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
    drawn = []
    for name in ("a", "b"):
        assert calibrate("offset", "--plot", f"{name}.{ending}").status == 0
        drawn.append((lab / f"{name}.{ending}").read_bytes())
    assert drawn[0].startswith(begins[ending])
    assert drawn[0] == drawn[1]


def test_the_base_and_the_reference_of_the_file_are_kept(lab: Path) -> None:
    text = SCANNER.replace("base_nm = 200.0", "base_nm = 300.0", 1).replace(
        "reference_hz = 100.0", "reference_hz = 50.0"
    )
    (lab / "scanner.toml").write_text(text, "utf-8")
    assert "at base_nm = 300" in calibrate("size").out
    assert json.loads(calibrate("frequency", "--json").out)["parameters"]["reference_hz"]["value"] == 50.0
    assert "at base_nm = 250" in calibrate("size", "--base-nm", "250").out


def test_the_size_law_of_the_file_makes_offsets_exact(lab: Path) -> None:
    """m of a drive, from images at 13 V; without the law it is what the images show."""
    plain, exact = (
        json.loads(
            run("calibrate", "offset", "--axis", "x", "offset.csv", "--scanner", "scanner.toml", "--json", *extra).out
        )
        for extra in ((), ("--size-v", "13"))
    )
    shown, m = (one["parameters"]["m_plus"]["value"] for one in (plain, exact))
    # beta = 0.53 of the file: R(V) / R(V / m) is what the object looks like.
    v = 0.13
    assert shown == pytest.approx(m * (1.0 + 0.53 * v) / (1.0 + 0.53 * v / m), rel=2e-3)
    assert m < shown - 0.008
    assert (plain["size_v"], exact["size_v"]) == (None, 13.0)
    kept = run(
        "calibrate", "offset", "--axis", "x", "offset.csv", "--scanner", "scanner.toml", "--size-v", "13", "--write"
    )
    assert kept.status == 0
    assert "rms, drive factors of 13 V by the size law\n" in (lab / "scanner.toml").read_text("utf-8")
    missing = run("calibrate", "offset", "--axis", "x", "offset.csv", "--v-max", "100", "--size-v", "13")
    assert (missing.status, "calibrate the size first" in missing.err) == (2, True)
    for volts in ("130", "nan"):
        large = run("calibrate", "offset", "--axis", "x", "offset.csv", "--scanner", "scanner.toml", "--size-v", volts)
        assert (large.status, "above v_max" in large.err) == (2, True)


@pytest.mark.parametrize(
    ("beta", "said"),
    [
        ("-3", "-3 is not above -0.5"),
        ("nan", "nan"),
        ("true", "true"),
        ('"0.53"', "'0.53'"),
        ("0.53\nbeat = 1", "beat"),
    ],
)
def test_a_size_law_that_cannot_be_is_refused(beta: str, said: str, lab: Path) -> None:
    """With its line; y is missing, and does not matter."""
    (lab / "s.toml").write_text(f'name = "a"\nv_max = 100.0\n[x.size]\nk_nm_per_v = 10.0\nbeta = {beta}\n', "utf-8")
    words = ("calibrate", "offset", "--axis", "x", "offset.csv", "--scanner", "s.toml", "--size-v", "13")
    outcome = run(*words)
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err.startswith(f"s.toml:{6 if 'beat' in beta else 5}: x.size.be")
    assert said in outcome.err
    (lab / "s.toml").write_text('name = "a"\nv_max = 100.0\n[x.size]\nk_nm_per_v = 10.0\n', "utf-8")
    assert run(*words).status == 0


@pytest.mark.common
def test_points_stand_in_for_the_law_and_back(lab: Path) -> None:
    """As measured at each amplitude; the file builds, and keeps all else; another calibration takes them out again."""
    before = (lab / "scanner.toml").read_text("utf-8")
    law = ("calibrate", "hysteresis", "--axis", "x", *TRACES, "--scanner", "scanner.toml", "--write")
    fit = json.loads(run(*law, "--points", "--json").out)
    text = (lab / "scanner.toml").read_text("utf-8")
    branch = tomllib.loads(text)["x"]["hysteresis"]["branches"][0]
    for side in ("forward", "backward"):
        assert list(branch[side]) == ["points"]
        for point, trace in zip(branch[side]["points"], fit["branches"][0]["traces"], strict=True):
            assert point["size_v"] == pytest.approx(trace["v_scan"], rel=1e-4)
            assert point["beta"] == pytest.approx(trace[side]["beta"]["value"], rel=1e-3)
            assert point["u_peak"] == pytest.approx(trace[side]["u_peak"]["value"], rel=1e-3)
    for line in before.splitlines():
        if not line.startswith(("forward", "backward")):
            assert line in text.splitlines()
    assert run("check", "scan.toml").status == 0
    assert run(*law, "--points").err == ""
    assert (lab / "scanner.toml").read_text("utf-8") == text
    assert run(*law).status == 0
    back = tomllib.loads((lab / "scanner.toml").read_text("utf-8"))["x"]["hysteresis"]["branches"][0]
    assert {*back["forward"]} == {*back["backward"]} == {"beta_max", "rho", "u_peak"}
    assert run("check", "scan.toml").status == 0


def test_the_same_amplitude_twice_makes_no_points(lab: Path) -> None:
    before = (lab / "scanner.toml").read_bytes()
    twice = [TRACES[0], TRACES[0], *TRACES[1:]]
    outcome = run("calibrate", "hysteresis", "--axis", "x", *twice, "--scanner", "scanner.toml", "--write", "--points")
    assert (outcome.status, "measured twice" in outcome.err) == (2, True)
    assert (lab / "scanner.toml").read_bytes() == before


def test_volts_and_lattice_constants_do_as_well(lab: Path) -> None:
    sizes = actual(DRIVES, 11.0, 0.6, 0.5, 200.0)
    write_csv(lab / "v.csv", drive_v=DRIVES, actual_um=sizes / 1000.0)
    nominal = 10.0 * DRIVES
    write_csv(lab / "l.csv", nominal_nm=nominal, apparent_nm=17.7 * nominal / sizes, true_nm=np.full(11, 17.7))
    for name, more in (("v.csv", []), ("l.csv", ["--k", "10"])):
        outcome = run("calibrate", "size", "--axis", "x", name, "--v-max", "100", "--json", *more)
        found = json.loads(outcome.out)["parameters"]
        assert [found[key]["value"] for key in ("k_nm_per_v", "beta", "v_threshold")] == pytest.approx([11.0, 0.6, 0.5])


@pytest.mark.common
def test_several_traces_may_stand_in_one_file(lab: Path) -> None:
    separate = json.loads(calibrate("hysteresis", "--json").out)["branches"]
    bodies = [(lab / name).read_text("utf-8").splitlines() for name in TRACES]
    head = bodies[0][0]
    (lab / "anew.csv").write_text("\n".join([head, *(row for body in bodies for row in body[1:])]), "utf-8")
    rows = [f"{i},{row}" for i, body in enumerate(bodies) for row in body[1:]]
    mixed = [row for part in range(800) for row in rows[part::800]]
    (lab / "numbered.csv").write_text("\n".join([f"trace,{head}", *mixed]), "utf-8")
    for name in ("anew.csv", "numbered.csv"):
        outcome = run("calibrate", "hysteresis", "--axis", "x", name, "--v-max", "100", "--json")
        assert json.loads(outcome.out)["branches"] == separate


def test_an_outlier_is_named_by_its_line(lab: Path) -> None:
    sizes = actual(DRIVES, 11.0, 0.6, 0.5, 200.0) * NOISE[:11]
    sizes[3] *= 1.04
    path = write_csv(lab / "size.csv", drive_v=DRIVES, actual_nm=sizes)
    path.write_text("# Monday\n" + path.read_text("utf-8"), "utf-8")
    outcome = run("calibrate", "size", "--axis", "x", "size.csv", "--v-max", "100")
    assert "outlier: size.csv:6: far from the other points, but used; next: " in outcome.out


@pytest.mark.parametrize(
    ("arguments", "status", "why"),
    [
        (("offset", "--axis", "x", "offset.csv"), 2, "give --scanner FILE, or --v-max V"),
        (("offset", "offset.csv", "--v-max", "100"), 2, "Missing option '--axis'"),
        (("offset", "--axis", "x", "offset.csv", "--v-max", "100", "--write"), 2, "--write needs --scanner"),
        (("offset", "--axis", "x", "absent.csv", "--v-max", "100"), 2, "absent.csv: is not a file"),
        (("offset", "--axis", "x", "size.csv", "--v-max", "100"), 2, "size.csv:1: offset_v: missing"),
        (("offset", "--axis", "x", "offset.csv", "--v-max", "20"), 2, "offset.csv: an offset of 25 V is outside"),
        (("offset", "--axis", "x", "offset.csv", "--scanner", "absent.toml"), 2, "absent.toml: cannot be read"),
        (("offset", "--axis", "x", "offset.csv", "--scanner", "offset.csv"), 2, "offset.csv:1: not TOML"),
        (
            ("offset", "--axis", "x", "offset.csv", "--scanner", "scanner.toml", "--v-max", "90"),
            2,
            "scanner.toml: v_max: 100 there, and --v-max 90",
        ),
        (("offset", "--axis", "x", "offset.csv", "--v-max", "100", "--plot", "a.gif"), 2, "has to end in .png"),
        (("size", "--axis", "x", "size.csv", "--v-max", "100"), 2, "drive_v is missing; or give nominal_nm, and --k"),
        (("size", "--axis", "x", "offset.csv", "--v-max", "100"), 2, "drive_v is missing"),
        (("hysteresis", "--axis", "x", "--v-max", "100"), 2, "Missing argument 'DATA.CSV...'"),
        (("hysteresis", "--axis", "x", "trace30.csv", "--v-max", "100", "--delay-s", "x"), 2, "seconds, or fit"),
        (("frequency", "--axis", "x", "frequency.csv", "--from-hz", "1e6"), 2, "no row is between 1e+06 and inf Hz"),
        (("frequency", "--axis", "x", "frequency.csv", "--to-hz", "1"), 2, "one frequency does not determine alpha"),
    ],
)
def test_what_is_refused(arguments: tuple[str, ...], status: int, why: str, lab: Path) -> None:
    outcome = run("calibrate", *arguments)
    assert outcome.status == status
    assert why in outcome.err
    assert outcome.out == ""


def test_an_unphysical_result_leaves_the_file(lab: Path) -> None:
    write_csv(lab / "offset.csv", offset_v=[0.0, 50.0, 100.0], apparent_nm=[0.5, 17.7, 22.0])
    before = (lab / "scanner.toml").read_bytes()
    outcome = calibrate("offset", "--write")
    assert outcome.status == 2
    assert "x.offset.m_minus: 0.0282" in outcome.err
    assert "is below 0.1; nothing was written" in outcome.err
    assert (lab / "scanner.toml").read_bytes() == before


def test_a_folder_that_cannot_be_written_is_status_4(lab: Path) -> None:
    outcome = calibrate("offset", "--plot", "offset.csv/a.png")
    assert outcome.status == 4
    assert "offset.csv" in outcome.err


@pytest.mark.parametrize(
    ("module", "more", "extra"),
    [("scipy", (), "calibrate"), ("tomlkit", ("--write",), "calibrate"), ("matplotlib", ("--plot", "a.png"), "plot")],
)
def test_a_missing_extra_is_status_6(
    module: str, more: tuple[str, ...], extra: str, lab: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *rest: None if name == module else there(name, *rest))
    outcome = calibrate("offset", *more)
    assert outcome.status == 6
    otherwise = "; or give a FILE.svg, which needs nothing" if extra == "plot" else ""
    assert outcome.err == f"{module} is missing; install it with: pip install 'piezo-tablegen[{extra}]'{otherwise}\n"


def test_help_teaches(lab: Path) -> None:
    shown = run("calibrate", "--help").out
    for kind in CALIBRATIONS:
        assert f"\n  {kind} " in shown
        page = run("calibrate", kind, "--help")
        assert page.status == 0
        assert max(map(len, page.out.splitlines())) <= 100
        for word in ("--axis", "--scanner", "--v-max", "--write", "--plot", "--json", "Columns: "):
            assert word in page.out, (kind, word)


@pytest.mark.parametrize(
    ("value", "error", "shown"),
    [
        (0.92034, 0.0012, ("0.9203", "± 0.0012")),
        (40000.26, 12.3, ("40000", "± 12")),
        (3.00022e-06, 9.8e-10, ("3.00022e-06", "± 9.8e-10")),
        (123456.0, 1234.0, ("1.235e+05", "± 1.2e+03")),
        (1.5, float("nan"), ("1.5", "")),
        (1.0 / 3.0, 0.0, ("0.333333333", "± 0")),
        (0.0, 0.02, ("0.000", "± 0.020")),
    ],
)
def test_figures_have_two_digits_of_their_error(value: float, error: float, shown: tuple[str, str]) -> None:
    assert figures(Estimate(value, error)) == shown


PAGE = (REPOSITORY / "docs" / "calibration.md").read_text("utf-8")


def test_the_page_shows_what_is_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = re.search(r"```csv\n(.*?)```", PAGE, re.DOTALL)
    shown = re.search(r"```text\n\$ tablegen (.*?)\n(.*?)```", PAGE, re.DOTALL)
    assert data is not None
    assert shown is not None
    monkeypatch.chdir(tmp_path)
    Path("offsets.csv").write_text(data[1], "utf-8")
    assert run(*shown[1].split()).out == shown[2]


@pytest.mark.common
def test_the_measured_table_is_whole_and_within_chance() -> None:
    """A row a parameter; the shares are those of 1,000 trials, whose standard deviation is 0.66 %."""
    rows = re.findall(r"^\| (\w+) \| `([\w.]+)` \| [^|]+\|[^|]+\|[^|]+\| ([\d.]+) % \|$", PAGE, re.MULTILINE)
    expected = [(kind, name) for kind in CASES for name in next(trials(kind, 1))]
    assert [(kind, name) for kind, name, _ in rows] == expected
    assert all(93.4 <= float(share) <= 97.5 for _, _, share in rows)
    assert np.mean([float(share) for _, _, share in rows]) >= 95.0


def images_of_sizes(path: Path) -> None:
    """m_minus and m_plus of 10 V and of 40 V, seen through the size law of the scanner file."""
    size = SizeLaw.calibrated(10.0, 100.0, 0.53, 200.0, 0.5)
    rows: list[tuple[float, float, float]] = []
    for volts, ends in ((40.0, (0.9, 1.3)), (10.0, (0.94, 1.2))):
        law, v = OffsetLaw.from_ends(*ends), volts / 100.0
        at = 50.0 + 0.9 * (50.0 - 0.6 * volts) * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
        looks = [size.size_nm(v) / size.size_nm(v / law.factor(one / 50.0 - 1.0)) for one in at.tolist()]
        rows += zip(at.tolist(), 17.7 * np.array(looks) * (1.0 + 0.1 * (NOISE[:5] - 1.0)), [volts] * 5, strict=True)
    write_csv(path, **dict(zip(("offset_v", "apparent_nm", "size_v"), zip(*rows, strict=True), strict=True)))


def test_images_of_several_sizes_give_m_of_each(lab: Path) -> None:
    images_of_sizes(lab / "sizes.csv")
    command = ("calibrate", "offset", "--axis", "x", "sizes.csv", "--scanner", "scanner.toml")
    fit = json.loads(run(*command, "--json").out)
    assert [one["size_v"] for one in fit["sizes"]] == [10.0, 40.0]
    for one, (m_minus, m_plus) in zip(fit["sizes"], ((0.94, 1.2), (0.9, 1.3)), strict=True):
        for key, truth in (("m_minus", m_minus), ("m_plus", m_plus)):
            assert abs(one[key]["value"] - truth) < 4.0 * one[key]["standard_error"] < 0.04
    shown = run(*command, "--write")
    assert (shown.status, shown.err) == (0, "")
    assert shown.out.count("scan voltage of 5 images") == 2
    assert "± " in next(line for line in shown.out.splitlines() if line.startswith("m_plus"))
    text = (lab / "scanner.toml").read_text("utf-8")
    written = tomllib.loads(text)["x"]["offset"]
    assert list(written) == ["sizes"]
    assert written["sizes"][1] == pytest.approx({"size_v": 40.0, "m_minus": 0.9, "m_plus": 1.3}, abs=0.02)
    assert "# calibrate offset: 10 points, residual" in text
    assert run("check", "scan.toml").status == 0
    assert run(*command, "--write").out.endswith("x.offset up to date\n")
    assert calibrate("offset", "--write").status == 0  # and back
    assert list(tomllib.loads((lab / "scanner.toml").read_text("utf-8"))["x"]["offset"]) == ["m_minus", "m_plus"]


def test_a_column_of_sizes_takes_the_size_law_and_no_option(lab: Path) -> None:
    images_of_sizes(lab / "sizes.csv")
    command = ("calibrate", "offset", "--axis", "x", "sizes.csv")
    missing = run(*command, "--v-max", "100")
    assert (missing.status, "the column size_v of sizes.csv takes x.size of" in missing.err) == (2, True)
    both = run(*command, "--scanner", "scanner.toml", "--size-v", "13")
    assert (both.status, "--size-v is for files without the column size_v" in both.err) == (2, True)
    rows = (lab / "sizes.csv").read_text("utf-8").splitlines()
    (lab / "sizes.csv").write_text("\n".join(rows[:4] + rows[6:]), "utf-8")
    few = run(*command, "--scanner", "scanner.toml")
    assert few.status == 0
    assert "images of 40 V: three points fit exactly" in few.out
    (lab / "sizes.csv").write_text("\n".join(rows[:3] + rows[6:]), "utf-8")
    fewer = run(*command, "--scanner", "scanner.toml")
    assert (fewer.status, "images of 40 V: 2 different offsets do not" in fewer.err) == (2, True)


@pytest.mark.common
def test_traces_at_several_offsets_make_points_of_each(lab: Path) -> None:
    """40 and 80 V at 50 V, 40 V once more at 72 V with another branch: the scan between has what lies between."""
    noise = 0.002 * np.random.default_rng(13).standard_normal((2, 800))
    there = Scanner(forward=(0.06, 3.0, 0.45), backward=(0.09, 1.2, 0.42)).trace(40.0, 3.3, 800, noise)
    write_csv(
        lab / "there.csv", time_s=there.time_s, drive_v=there.drive_v + 22.0, displacement_nm=there.displacement_nm
    )
    command = ("calibrate", "hysteresis", "--axis", "x", *TRACES, "there.csv", "--scanner", "scanner.toml")
    outcome = run(*command, "--points", "--write")
    assert (outcome.status, outcome.err) == (0, "")
    assert "offset [V]" in outcome.out
    assert "(22) is one for the offsets of 50, 72 V; next: `--points` writes them by offset" in outcome.out
    (branch,) = tomllib.loads((lab / "scanner.toml").read_text("utf-8"))["x"]["hysteresis"]["branches"]
    points = branch["forward"]["points"]
    assert [point["offset_v"] for point in points] == pytest.approx([50.0] * len(TRACES) + [72.0], abs=0.1)
    assert points[-1]["size_v"] == pytest.approx(40.0, rel=0.01)
    assert points[-1]["u_peak"] == pytest.approx(0.45, abs=0.01)
    assert run("check", "scan.toml").status == 0
    # Traces that all begin at 0 V have a size an offset each, and do not tell one from the other.
    for v in (40.0, 80.0):
        trace = Scanner().trace(v, 3.3, 800, noise)
        drive = trace.drive_v - 50.0 + 0.5 * v
        write_csv(lab / f"low{v:g}.csv", time_s=trace.time_s, drive_v=drive, displacement_nm=trace.displacement_nm)
    lows = ("calibrate", "hysteresis", "--axis", "x", "low40.csv", "low80.csv", "--scanner", "scanner.toml")
    assert run(*lows, "--points", "--write").status == 0
    (branch,) = tomllib.loads((lab / "scanner.toml").read_text("utf-8"))["x"]["hysteresis"]["branches"]
    assert not any("offset_v" in point for point in branch["forward"]["points"])


def of_a_scope(lab: Path, gain: float = 20.0) -> list[Path]:
    """The traces as a scope has them: the controller's volts, micrometres, other names and another order."""
    paths = []
    for name in TRACES:
        t, v, x = np.loadtxt(lab / name, delimiter=",", skiprows=1, unpack=True)
        path = lab / f"scope_{name}"
        rows = [f"{1e-3 * nm:.9g};{volts / gain:.9g};{1e3 * s:.9g}" for s, volts, nm in zip(t, v, x, strict=True)]
        text = "\n".join(["Position (\u00b5m);DAC out [V];Time / ms", *rows]).replace(".", ",")
        path.write_text(f"\ufeff{text}\n", "utf-8")
        paths.append(path)
    return paths


def numbers(tree: Any) -> list[float]:
    """All numbers of a JSON tree, in order."""
    if isinstance(tree, dict | list):
        return [number for one in (tree.values() if isinstance(tree, dict) else tree) for number in numbers(one)]
    return [float(tree)] if isinstance(tree, int | float) else []


@pytest.mark.common
def test_traces_of_a_scope_give_what_traces_at_the_piezo_give(lab: Path) -> None:
    def parameters(*arguments: str | Path) -> dict[str, Any]:
        outcome = run("calibrate", "hysteresis", "--axis", "x", "--v-max", "100", "--json", *arguments)
        assert outcome.status == 0, outcome.err
        return json.loads(outcome.out)  # type: ignore[no-any-return]

    plain = parameters(*TRACES)
    scope = of_a_scope(lab)
    for choice in ([], ["--columns", "time=3,drive=2,position=1"]):
        by_gain = parameters(*scope, "--drive-gain", "20", *choice)
        assert by_gain["remarks"] == plain["remarks"]
        for own, other in zip(numbers(by_gain["branches"]), numbers(plain["branches"]), strict=True):
            assert own == pytest.approx(other, rel=1e-4)
    noted = parameters(*scope)
    assert any("are these volts at the piezo? Give --drive-gain G" in remark for remark in noted["remarks"])


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--columns", "speed=1"], "--columns: 'speed' is none of time, drive, displacement, trace"),
        (["--drive-gain", "0"], "--drive-gain, --drive-offset: a drive gain of 0 is not within"),
        (["--columns", "drive=9"], "drive_v: --columns drive=9: the file has 3 columns"),
    ],
)
def test_options_of_a_recorder_that_are_wrong(arguments: list[str], reason: str, lab: Path) -> None:
    outcome = run("calibrate", "hysteresis", "--axis", "x", "--v-max", "100", TRACES[0], *arguments)
    assert outcome.status == 2
    assert reason in outcome.err


def test_remarks_have_codes_in_json(lab: Path) -> None:
    """`remarks` are the sentences as before, `findings` the same with codes, the worst first."""
    write_csv(lab / "offset.csv", offset_v=[25.0, 50.0, 75.0], apparent_nm=[16.0, 17.7, 16.5])
    data = json.loads(calibrate("offset", "--json").out)
    assert {one["code"] for one in data["findings"]} >= {"few-points", "extrapolated-parameter"}
    assert {one["text"] for one in data["findings"]} >= set(data["remarks"]) > set()
    assert all(set(one) == {"code", "axis", "text", "remedy"} and one["code"] for one in data["findings"])
