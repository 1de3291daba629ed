"""`report` and `compare` of scans at an angle: the page, its charts, and what a changed build shows."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from editing import run
from html_page import Page, well_formed
from turned_scans import write_turned

import tablegen
from tablegen.html_report.turned_codes import axes_of, frame_volts
from tablegen.html_report.turned_subject import TurnedSubject
from tablegen.manifest.format import MANIFEST

SHORT = ("timing.lines = 16", "x.band_limit.harmonics = 12", "timing.line_rate_hz = 400")


@pytest.fixture(scope="module")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short frame at 30 degrees on coupled axes."""
    path = write_turned(tmp_path_factory.mktemp("turned"), 30.0, *SHORT)
    scanner = path.parent / "scanner.toml"
    scanner.write_text(scanner.read_text("utf-8") + "\n[coupling]\nx_per_y = 0.02\n", "utf-8")
    return path


@pytest.fixture(scope="module")
def page(scan: Path) -> tablegen.ReportPage:
    """Its page."""
    return tablegen.report(scan)


@pytest.fixture(scope="module")
def build(scan: Path, page: tablegen.ReportPage) -> Path:
    """Its build, as files."""
    folder = scan.parent / "build"
    planned = turned_subject(page).planned
    assert planned is not None
    tablegen.TurnedBuild(planned.setup, planned.plan, planned.certificate).write(folder)
    return folder


def turned_subject(page: tablegen.ReportPage) -> TurnedSubject:
    assert isinstance(page.subject, TurnedSubject)
    return page.subject


def tampered(build: Path, folder: Path) -> Path:
    """The build with a slow table of x whose gain is 5 % larger, in its manifest."""
    folder.mkdir()
    for path in build.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    plain = json.loads((build / MANIFEST).read_text("ascii"))
    slow = plain["turned"]["axes"]["x"]["slow"]
    slow["gain_word"] = round(1.05 * slow["gain_word"])
    (folder / MANIFEST).write_text(json.dumps(plain), "ascii")
    return folder


def test_the_page_is_well_formed_and_has_its_sections(page: tablegen.ReportPage) -> None:
    read = Page(page.content.decode("utf-8"))
    well_formed(page.content, read)
    assert read.verdicts == ["good"]
    sections = ["image", "certificate", "request", "codes", "tables", "verify", "files"]
    assert [one for one in read.ids if not one.startswith("chart-")] == ["ranked", *sections]
    assert {"path", "image-operators", "map-along-operators", "slow-x", "gains", "ratios"} <= set(page.figures)
    text = page.content.decode("utf-8")
    for words in ("30 degrees, counterclockwise from x", "+2 % of y along x", "shear of lines and slow direction"):
        assert words in text
    assert page.answers[0].startswith("residual 0.1")
    assert not page.broken
    assert page.findings[0].text.startswith("by the operators the residual is 0.1")


def test_the_charts_have_the_codes_of_the_program(page: tablegen.ReportPage) -> None:
    """Path and frame against the codes of the whole frame, which the integer model gives without a chart."""
    stored = turned_subject(page).stored
    for axis, fields, program in axes_of(stored):
        codes = program.frame()
        volts = frame_volts(fields, program)
        low, high = (fields.output.v_zero + fields.output.v_per_code * one for one in (codes.min(), codes.max()))
        assert np.min(volts) == pytest.approx(low, abs=0.2)
        assert np.max(volts) == pytest.approx(high, abs=0.2)
        frame = page.figures[f"frame-{axis}"].curves[0]
        assert np.array_equal(frame.y, volts.ravel())
    # Imaged lines of the path go in the direction of the scan, by the sensitivities of both axes.
    line = page.figures["path"].curves[1]
    way = np.argmax(line.x)
    assert np.degrees(np.arctan2(line.y[way] - line.y[0], line.x[way] - line.x[0])) == pytest.approx(30.0, abs=5.0)


def test_limits_that_are_exceeded_are_on_the_page(scan: Path, tmp_path: Path) -> None:
    limited = scan.parent / "limited.toml"
    limited.write_text(scan.read_text("utf-8") + "\n[limits]\nmax_error_lsb = 0.01\n", "utf-8")
    outcome = run("report", limited, "-o", tmp_path / "r.html")
    assert outcome.status == 3
    assert "limited.toml:" in outcome.err
    assert "\u2717 exceeded" in (tmp_path / "r.html").read_text("utf-8")


def test_the_page_of_a_build_names_what_was_changed(build: Path, tmp_path: Path) -> None:
    outcome = run("report", build, "-o", tmp_path / "good.html")
    assert outcome.status == 0, outcome.err
    assert Page((tmp_path / "good.html").read_text("utf-8")).verdicts == ["good"]
    changed = tablegen.report(tampered(build, tmp_path / "changed"))
    assert Page(changed.content.decode("utf-8")).verdicts == ["bad"]
    assert [one.text for one in changed.findings] == ["manifest.json has a hash that is not that of its plan"]
    (tmp_path / "changed" / "annexin_200nm_program.c").write_text("int none;\n", "ascii")
    more = tablegen.report(tmp_path / "changed")
    assert "annexin_200nm_program.c differs from the manifest" in [one.text for one in more.findings]
    (tmp_path / "x.npy").write_bytes(b"")
    with pytest.raises(tablegen.Rejected):
        tablegen.report(build, image=tmp_path / "x.npy")


def test_the_page_of_a_build_names_its_formats(build: Path, tmp_path: Path) -> None:
    folder = tmp_path / "build"
    shutil.copytree(build, folder)
    plain = json.loads((folder / MANIFEST).read_text("ascii"))
    for formats in (["c"], ["c", "verilog"]):
        (folder / MANIFEST).write_text(json.dumps({**plain, "formats": formats}), "ascii")
        assert f"; formats {', '.join(formats)}<" in tablegen.report(folder).content.decode("utf-8")


def test_a_build_is_compared_with_a_changed_one(build: Path, tmp_path: Path) -> None:
    assert tablegen.compare(build, build).same
    compared = tablegen.compare(build, tampered(build, tmp_path / "changed"))
    assert not compared.same
    # The gain of the slow part, and nothing else of the tables.
    names = {(pair.section, pair.name) for pair in compared.differing}
    assert names == {("x tables", "slow part, gain word")}
    assert "does not agree with its manifest: manifest.json" in compared.summary()
    differing = [chart.key for chart in compared.charts().brief]
    assert differing == ["line-x", "slow-x"]


@pytest.mark.common
def test_scans_at_two_angles_are_compared(scan: Path, build: Path, tmp_path: Path) -> None:
    other = scan.parent / "other.toml"
    other.write_text(scan.read_text("utf-8").replace("angle_deg = 30.0", "angle_deg = 60.0"), "utf-8")
    outcome = run("compare", scan, other, "-o", tmp_path / "c.html", "--json")
    assert outcome.status == 1, outcome.err
    rows = {(one["section"], one["name"]): one for one in json.loads(outcome.out)["quantities"]}
    assert (rows["frame", "scan angle"]["a"], rows["frame", "scan angle"]["b"]) == (30.0, 60.0)
    assert rows["y drive", "of the line"]["b"] == pytest.approx(300.0 * np.sin(np.pi / 3.0), rel=1e-9)
    well_formed((tmp_path / "c.html").read_bytes(), Page((tmp_path / "c.html").read_text("utf-8")))
    assert run("compare", scan, build).status == 0
