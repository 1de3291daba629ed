"""`tablegen report`: the page against an HTML parser, hostile names, the certificate, and other ways to its figures."""

import json
import re
import subprocess
import sys
import zlib
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from building import FEW, VARIANTS, write_variant
from editing import SCAN, SCANNER, edited, run, write_pair
from html_page import Page, well_formed
from operator_files import operator_file, write_operator_scan
from replacing import replace
from sets import quick

from tablegen.base.input_errors import Problem
from tablegen.charts.png import grey_png
from tablegen.html_report.blocks import ScaleBar
from tablegen.html_report.own_image import image_remarks, own_picture
from tablegen.html_report.page import charts_of, page, sections
from tablegen.html_report.planned_scan import planned_scan
from tablegen.html_report.playing import played_axes
from tablegen.html_report.ranking import ranked
from tablegen.html_report.subject import OwnImage, Subject


def report(path: Path, *options: str | Path, status: int = 0) -> tuple[bytes, Page]:
    """The page of a scan or a directory."""
    out = path.parent / "report.html"
    outcome = run("report", path, "-o", out, *options)
    assert outcome.status == status, outcome.err
    content = out.read_bytes()
    return content, Page(content.decode("utf-8"))


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_pair(tmp_path_factory.mktemp("example"))


@pytest.fixture(scope="module")
def found(example: Path) -> tuple[bytes, Page]:
    return report(example)


@pytest.fixture(scope="module")
def subject(example: Path) -> Subject:
    return planned_scan(example)


def test_the_page_is_well_formed_and_needs_no_network(found: tuple[bytes, Page]) -> None:
    content, read = found
    well_formed(content, read)
    assert read.verdicts == ["good"]
    parts = (
        "ranked",
        "lattice",
        "certificate",
        "request",
        "lines",
        "errors",
        "spectrum",
        "quantisation",
        "corrections",
    )
    assert [*parts, "usable", "calibration", "verify", "files"] == [i for i in read.ids if not i.startswith("chart-")]


def test_faults_of_a_page_are_found() -> None:
    """Negative control of the parser."""
    assert Page("<div><p>x</div>").faults
    assert Page("<div>").faults
    assert Page('<a href="http://x/">y</a>').addresses == ["http://x/"]
    assert Page("<p onclick='x'>y</p>").handlers == ["onclick"]


@pytest.mark.common
def test_the_same_scan_gives_the_same_bytes(found: tuple[bytes, Page], tmp_path: Path) -> None:
    """From another folder and in another process; and nothing in it is of this machine."""
    content, _ = found
    path = write_pair(tmp_path)
    command = [sys.executable, "-m", "tablegen", "report", str(path), "-o", str(tmp_path / "other.html")]
    subprocess.run(command, check=True, capture_output=True, env={"PYTHONHASHSEED": "7", "TZ": "Asia/Tokyo"})
    assert (tmp_path / "other.html").read_bytes() == content
    text = content.decode("utf-8")
    assert str(tmp_path.parent) not in text
    assert "/tmp" not in text
    assert not re.search(r"\b20[2-9]\d-\d\d-\d\d|\b\d\d:\d\d:\d\d", re.sub(r"base64,[A-Za-z0-9+/=]+", "", text))


@pytest.mark.common
@pytest.mark.parametrize("name", quick(FEW[:3], [*VARIANTS]))
def test_every_kind_of_scan_has_a_page(name: str, tmp_path: Path) -> None:
    """Converters of all widths, steps, turns, a table a tick; with a limit of the example exceeded or not."""
    path = write_variant(tmp_path, VARIANTS[name])
    accepted = run("check", path).status
    content, read = report(path, status=accepted)
    well_formed(content, read)
    assert ("bad" in read.verdicts) == (accepted == 3)
    numbers = re.sub(r"<script>.*?</script>|<style>.*?</style>", "", content.decode("utf-8"), flags=re.DOTALL)
    assert not re.search(r"\b(nan|inf|None)\b", numbers)


EVIL = "<script>alert(1)</script>\"'&<img src=x onerror=f()>`\u202e{{7*7}}"


@pytest.mark.common
def test_names_of_others_are_text(tmp_path: Path) -> None:
    """In the scanner's name, a comment of calibrate, and the names of its files and traces."""
    scanner = edited(SCANNER, f"name = {json.dumps(EVIL)}")
    comment = f"# calibrate size: 3 points, {EVIL}\n# from {EVIL}.csv, sha256 0123456789abcdef\n[x.size]"
    path = write_pair(tmp_path, scanner=scanner.replace("[x.size]", comment))
    content, read = report(path)
    well_formed(content, read)
    text = content.decode("utf-8")
    assert "img" not in read.tags
    assert "<script>alert" not in text
    assert "\u202e" not in text
    assert "{{7*7}}" in text
    assert read.said.count("<script>alert(1)</script>") >= 4  # title, heading, comment, file


@pytest.mark.common
def test_an_operator_with_hostile_traces(tmp_path: Path) -> None:
    file = operator_file()
    lines = [*file.lines[:-1], type(file.lines[0])(**{**_fields(file.lines[-1]), "name": EVIL[:60]})]
    scan = write_operator_scan(tmp_path, type(file)(**{**_fields(file), "lines": lines}), "- [limits]")
    content, read = report(scan)
    well_formed(content, read)
    assert "img" not in read.tags
    assert "error of the operator on each trace" in read.said
    for name in ("x without correction", "x with the laws", "x with the operator", "y with the laws"):
        assert name in read.said


def _fields(struct: object) -> dict[str, object]:
    return {name: getattr(struct, name) for name in struct.__struct_fields__}  # type: ignore[attr-defined]


def test_the_certificate_is_that_of_the_build(found: tuple[bytes, Page], subject: Subject, example: Path) -> None:
    manifest = json.loads(run("show", example, "--json").out)
    said = found[1].said
    for axis in "xy":
        certificate = manifest["axes"][axis]["certificate"]
        assert f"largest error of a code {certificate['max_error_lsb']:.4g} LSB 1 LSB" in said
        for side, error in certificate["scaling_error_percent"].items():
            assert f"scaling error {side}, peak to peak {error['total']:.4g} % 0.5 % ✓ within" in said
    assert subject.manifest.hash == manifest["hash"]
    assert manifest["hash"] in said
    for name, digest in manifest["files"].items():
        assert f"{name} {digest}" in said


@pytest.mark.common
def test_a_broken_limit_is_shown_and_is_status_3(tmp_path: Path) -> None:
    path = write_pair(tmp_path, edited(SCAN, "limits.max_scaling_error_percent = 0.3"))
    content, read = report(path, status=3)
    well_formed(content, read)
    assert read.verdicts == ["bad"]
    assert "✗ exceeded" in read.said
    assert read.said.count("the x axis has a scaling error") == 1
    assert content.decode("utf-8").count('data-code="scaling-error" data-axis="x"') == 1
    assert "scan.toml:" in read.said
    assert str(tmp_path) not in content.decode("utf-8")


def test_a_finding_is_given_once_by_code_and_axis(tmp_path: Path) -> None:
    """Other words for the warning of a broken limit, or of the note of a warning, are still the same finding."""
    subject = planned_scan(write_pair(tmp_path), remedies=False)
    assert subject.planned is not None
    limit = Problem("scan.toml", 1, "limits", "too far out").coded("scaling-error", "x")
    warning = Problem("scan.toml", 2, "x.size_nm", "not straight").coded("scaling-error", "x")
    other = Problem("scan.toml", 3, "y.size_nm", "not straight").coded("scaling-error", "y")
    apart = Problem("scan.toml", 4, "timing", "places differ").coded("image-offset", "x")
    planned = replace(subject.planned, broken=(limit,), warnings=((9.0, warning), (5.0, other), (2.0, apart)))
    findings = ranked(replace(subject, planned=planned))
    weights = [(one.code, one.axis, one.weight) for one in findings]
    assert weights[:3] == [
        ("scaling-error", "x", "limit"),
        ("scaling-error", "y", "spoils"),
        ("image-offset", "x", "spoils"),
    ]
    assert len([one for one in weights if one[0] in ("scaling-error", "image-offset")]) == 3
    alone = [(one.code, one.axis) for one in ranked(replace(subject, planned=replace(subject.planned, broken=())))]
    assert ("image-offset", "x") in alone
    assert alone.count(("scaling-error", "x")) == 1


@pytest.mark.common
def test_what_spoils_an_image_comes_first(tmp_path: Path) -> None:
    """A coarse small scan whose y has no hysteresis model: what is not compensated, then the warnings, then notes."""
    scanner = edited(SCANNER, "- [y.hysteresis]", "- [[y.hysteresis.branches]]")
    path = write_pair(tmp_path, edited(SCAN, "- [limits]", "x.size_nm = 20.0"), scanner)
    content, read = report(path)
    well_formed(content, read)
    assert read.verdicts == ["warn"]
    order = [
        "hysteresis of y is not compensated",
        "the x axis has a scaling error of",
        "the laws expect",
        "a frame images",
    ]
    at = [read.said.index(words) for words in order]
    assert at == sorted(at)
    assert "scan.toml:23: x.size_nm:" in read.said


@pytest.mark.common
def test_of_a_directory_what_it_has(example: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert run("build", example, "-o", folder, "-q").status == 0
    content, read = report(folder)
    well_formed(content, read)
    assert read.verdicts == ["good"]
    assert "made of a build alone" in read.said
    assert "lattice" not in read.ids
    (folder / "annexin_200nm.h").write_text("changed", "utf-8")
    (folder / "annexin_200nm.c").unlink()
    _, read = report(folder)
    assert read.verdicts == ["bad"]
    assert "annexin_200nm.h differs from the manifest" in read.said
    assert "annexin_200nm.c cannot be read: No such file" in read.said


@pytest.mark.common
def test_what_verify_found(example: Path, tmp_path: Path) -> None:
    folder, record = tmp_path / "out", tmp_path / "verify.xml"
    assert run("build", example, "-o", folder, "-q").status == 0
    assert run("verify", folder, "--target", "files", "--junit", record).status == 0
    for source in (folder, write_pair(tmp_path)):
        _, read = report(source, "--verified", record)
        assert "The record is of this very build." in read.said
        assert read.verdicts == ["good"]
    other = write_pair(tmp_path, edited(SCAN, "x.size_nm = 210.0"))
    _, read = report(other, "--verified", record)
    assert "is of another build" in read.said
    assert read.verdicts == ["bad"]
    text = record.read_text("utf-8")
    record.write_text(
        text.replace(
            "<testcase", '<testcase name="a" classname="b.c"><failure message="&lt;b&gt; 1"/></testcase><testcase', 1
        )
    )
    _, read = report(folder, "--verified", record)
    assert read.verdicts == ["bad"]
    assert "✗ <b> 1" in read.said


ENTITY = "<?xml version='1.0'?><!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>"
OTHERS = [b"", b"<a/>", b"<testsuites><testsuite name='x'/></testsuites>", ENTITY.encode()]
OTHERS += [ENTITY.encode("utf-16"), ENTITY.encode("utf-16-le")]


@pytest.mark.parametrize("content", OTHERS)
def test_other_records_are_refused(example: Path, tmp_path: Path, content: bytes) -> None:
    record = tmp_path / "verify.xml"
    record.write_bytes(content)
    outcome = run("report", example, "-o", tmp_path / "r.html", "--verified", record)
    assert outcome.status == 2
    assert outcome.err.startswith(f"{record}: is no ")
    assert not (tmp_path / "r.html").exists()


@pytest.mark.common
def test_wrong_input(tmp_path: Path) -> None:
    assert run("report", tmp_path, "-o", tmp_path / "r.html").status == 2
    path = write_pair(tmp_path, edited(SCAN, "dac.bits = 30"))
    assert "dac.bits: 30 is above 24" in run("report", path, "-o", tmp_path / "r.html").err
    assert not (tmp_path / "r.html").exists()
    fine = write_pair(tmp_path)
    assert "would replace a scan" in run("report", fine, "-o", fine).err
    assert fine.read_text("utf-8") == SCAN
    assert "--figure needs" in run("report", fine, "--figure", "drive-x").err
    assert "no such chart" in run("report", fine, "--svg", tmp_path, "--figure", "none").err


@pytest.mark.common
def test_charts_as_files(example: Path, tmp_path: Path) -> None:
    assert run("report", example, "-o", tmp_path / "r.html", "--svg", tmp_path / "s", "--figure", "drive-x").status == 0
    (path,) = (tmp_path / "s").iterdir()
    root = ElementTree.fromstring(path.read_bytes())
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert "x drive, one line" in "".join(root.itertext())


@pytest.mark.common
def test_charts_as_pictures_and_documents(example: Path, tmp_path: Path) -> None:
    """Each twice: the same bytes, so no date."""
    seen = []
    for i in (1, 2):
        options = (
            "--png",
            tmp_path / f"p{i}",
            "--pdf",
            tmp_path / f"d{i}",
            "--figure",
            "spectrum-x",
            "--figure",
            "usable-x",
        )
        assert run("report", example, "-o", tmp_path / "r.html", *options).status == 0
        seen.append({p.name: p.read_bytes() for kind in "pd" for p in (tmp_path / f"{kind}{i}").iterdir()})
    assert seen[0] == seen[1]
    assert sorted(seen[0]) == ["spectrum-x.pdf", "spectrum-x.png", "usable-x.pdf", "usable-x.png"]
    assert seen[0]["usable-x.png"].startswith(b"\x89PNG")
    assert seen[0]["usable-x.pdf"].startswith(b"%PDF")


def test_a_curve_in_the_page_is_the_drive(found: tuple[bytes, Page], example: Path) -> None:
    """Read back from the positions in the drawing, as the script of the page does."""
    import tablegen

    text = found[0].decode("utf-8")
    figure = re.search(r'id="chart-drive-x".*?</figure>', text, re.DOTALL)
    assert figure
    chart = figure[0]
    (x0, x1), (y0, y1) = (map(float, re.search(rf'data-{name}="(\S+) (\S+)"', chart).groups()) for name in "xy")
    _, _, width, height = map(float, re.search(r'class="inner".*?viewBox="(\S+) (\S+) (\S+) (\S+)"', chart).groups())
    d = re.search(r'class="curve forward line"[^>]* d="M(\S+) (\S+)l([^"]+)"', chart)
    steps = np.array(list(map(float, d[3].split()))).reshape(-1, 2)
    at = np.vstack([[float(d[1]), float(d[2])], steps]).cumsum(axis=0)
    times, volts = x0 + (x1 - x0) * at[:, 0] / width, y1 - (y1 - y0) * at[:, 1] / height
    samples = tablegen.build(example).x
    played = np.interp(times, 1e3 * samples.time_s, samples.volts)
    assert len(times) > 200
    assert np.max(np.abs(volts - played)) < 2e-3 * (y1 - y0)


def test_the_simulated_mismatch_is_what_the_certificate_expects(subject: Subject) -> None:
    """Two ways to it: emitted codes on the loop of their stroke here, the float waveform on it there."""
    from tablegen.virtual.own_run import image_errors

    x, _ = played_axes(subject.planned)  # type: ignore[arg-type]
    expected = subject.manifest.axes.x.certificate.expected
    _, scaling, mismatch, _ = image_errors(x.emitted)  # type: ignore[arg-type]
    assert mismatch == pytest.approx(expected.mismatch_percent.value, abs=0.02)  # type: ignore[union-attr]
    assert scaling < 1.0
    before = image_errors(x.before)  # type: ignore[arg-type]
    worst = max(one["uncompensated"] for one in subject.manifest.axes.x.certificate.scaling_error_percent.values())  # type: ignore[union-attr]
    assert before[1] == pytest.approx(worst, rel=0.1)
    assert before[2] > 5.0 * mismatch


@pytest.mark.common
@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_usable_area_is_what_check_accepts(subject: Subject, tmp_path: Path, axis: str) -> None:
    """Just inside of the curve a scan is accepted, and outside it is not, on both slopes of the driver's range."""
    from tablegen.html_report.usable import largest_sizes

    planned = subject.planned
    assert planned is not None
    offsets, largest, _ = largest_sizes(planned, getattr(planned.plan, axis))
    for volts in (15.0, 30.0, 80.0):
        size = float(np.interp(volts, offsets, largest))
        for share, fits in ((0.97, True), (1.03, False)):
            key = f"{axis}.size_nm = {share * size:.5g}"
            text = edited(SCAN, key, f"{axis}.offset_v = {volts}", "- [limits]")
            refused = run("check", write_pair(tmp_path, text)).status == 2
            assert refused != fits, (volts, share)


@pytest.mark.common
def test_a_layer_of_refine_is_shown(tmp_path: Path) -> None:
    layer = """# refine 1: trace.csv, 5 periods
[x.refinement]
v_amplitude = 20.3679
v_offset = 50.0
rate_hz = 400.0
turn = 0.5
window = [0.1, 0.9]
directions = "both"
a = [1e-4, 0.0, 2e-4]
b = [0.0, 1e-4, 0.0]"""
    path = write_pair(tmp_path, edited(SCAN, f"+ {layer}"))
    content, read = report(path)
    well_formed(content, read)
    assert "chart-refinement-x" in read.ids
    assert "refine 1: trace.csv, 5 periods" in read.said
    assert read.said.count("the first lines of the page say what the image has") == 2  # below pictures, above residuals
    assert "computed over all 1250 ticks" in read.said


def test_an_own_image_stands_beside_the_prediction(example: Path, tmp_path: Path) -> None:
    """Levelled, with the scale of the scan file and the range of its heights; a large one does not enlarge the page."""
    y, x = np.mgrid[0:700, 0:900]
    heights = np.sin(x / 20.0) + 0.1 * y
    np.save(tmp_path / "mine.npy", heights)
    content, read = report(example, "--image", tmp_path / "mine.npy")
    well_formed(content, read)
    plain, _ = report(example)
    assert len(content) < len(plain) + 120_000
    assert "your image: mine.npy (measured, size of the scan file)" in read.said
    low, high = (float(re.search(rf'data-{name}="([^"]+)"', content.decode()).group(1)) for name in ("low", "high"))
    assert (low, high) == (pytest.approx(-1.0, abs=0.1), pytest.approx(1.0, abs=0.1))
    assert str(tmp_path) not in content.decode("utf-8")


def test_an_own_image_of_another_size_is_remarked() -> None:
    image = OwnImage("a.sxm", "Z", np.ones((4, 8)), "m", (50.0, 25.0), True)
    picture = own_picture(image, (180.0, 180.0))
    assert (picture.size_nm, picture.height) == ((50.0, 25.0), 0.5)
    assert picture.heights is not None
    assert picture.heights.unit == "nm"
    (_, warning) = image_remarks(image, (180.0, 180.0))
    assert "its file says 50 x 25 nm, and this scan images 180 x 180 nm" in warning.text
    assert len(image_remarks(image, (50.4, 25.0))) == 1
    unknown = own_picture(OwnImage("a.npy", "", np.full((4, 8), np.nan), "", None, False), None)
    assert (unknown.bar, unknown.size_nm, unknown.height) == (None, None, 0.5)


def test_an_own_image_is_shown_for_a_build_too(example: Path, tmp_path: Path) -> None:
    assert run("build", example, "-o", tmp_path / "build", "-q").status == 0
    np.save(tmp_path / "mine.npy", np.eye(32))
    assert run("report", tmp_path / "build", "-o", tmp_path / "r.html", "--image", tmp_path / "mine.npy").status == 0
    assert "<h2>Your image</h2>" in (tmp_path / "r.html").read_text("utf-8")


def test_an_own_image_that_cannot_be_read_is_named(example: Path, tmp_path: Path) -> None:
    (tmp_path / "no.npy").write_bytes(b"no image")
    outcome = run("report", example, "-o", tmp_path / "r.html", "--image", tmp_path / "no.npy")
    assert outcome.status == 2
    assert "no.npy" in outcome.err
    assert not (tmp_path / "r.html").exists()
    assert run("report", example, "-o", tmp_path / "r.html", "--channel", "Z").status == 2


def test_no_sentence_stands_four_times(found: tuple[bytes, Page]) -> None:
    sentences = [one for one in re.split(r"(?<=[.;:])\s+|\n|  +", found[1].said) if len(one.split()) > 4]
    assert sentences
    assert max(map(sentences.count, sentences)) <= 3


@pytest.mark.common
def test_the_least_acceleration_is_shown(tmp_path: Path) -> None:
    path = write_pair(tmp_path, edited(SCAN, "x.band_limit.max_scaling_error_percent = 0.3"))
    content, read = report(path)
    well_formed(content, read)
    assert read.said.count("least acceleration at 0.3 % of scaling error") == 1
    assert read.said.count("of the line a period squared") == 1


def test_a_picture_of_stored_blocks() -> None:
    """By the chunks of the format; the pixels come back, also where they fill more than a block."""
    heights = np.random.default_rng(0).random((300, 301))
    content = grey_png(heights, 0.0, 1.0)
    assert content[:8] == b"\x89PNG\r\n\x1a\n"
    at, chunks = 8, {}
    while at < len(content):
        size = int.from_bytes(content[at : at + 4], "big")
        name, data = content[at + 4 : at + 8], content[at + 8 : at + 8 + size]
        assert zlib.crc32(name + data) == int.from_bytes(content[at + 8 + size : at + 12 + size], "big")
        chunks[name], at = data, at + 12 + size
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(300, 302)
    assert not rows[:, 0].any()
    assert np.abs(rows[:, 1:] - 255.0 * heights).max() <= 0.5 + 1e-9


@pytest.mark.common
def test_every_chart_is_in_the_page_once(subject: Subject) -> None:
    made = sections(subject)
    read = Page(page(subject, made).decode("utf-8"))
    assert {f"chart-{key}" for key in charts_of(made)} == {name for name in read.ids if name.startswith("chart-")}
    assert len(charts_of(made)) >= 20


@pytest.mark.parametrize(
    ("width_nm", "length_nm", "text"),
    [(200.0, 50.0, "50 nm"), (0.9, 0.2, "0.2 nm"), (3400.0, 1000.0, "1 um"), (90000.0, 20000.0, "20 um")],
)
def test_a_scale_bar_is_a_round_part_of_the_width(width_nm: float, length_nm: float, text: str) -> None:
    bar = ScaleBar.of(width_nm)
    assert bar.share * width_nm == pytest.approx(length_nm, rel=1e-3)
    assert bar.text == text
    assert 0.1 < bar.share <= 0.3


def test_pictures_have_scale_bars(found: tuple[bytes, Page]) -> None:
    """A bar of 20 nm is an eighth of the window of 160 nm, in each of the four pictures."""
    page = found[0].decode("utf-8")
    bars = re.findall(r'<path class="bar" d="M40 \d+h(\d+)"/>\s*<text[^>]*>([^<]*)</text>', page)
    assert bars == [("125", "20 nm")] * 4


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("lines", [16, 100])
def test_an_axis_that_rests_in_the_middle_has_no_scaling_error(tmp_path: Path, lines: int) -> None:
    """A chord is shorter than a step of 16 lines; the way back of 100 has few. Both were divided by a slope of 0."""
    edits = ("y.motion = 'step'", f"timing.lines = {lines}", f"y.band_limit.harmonics = {7 if lines == 16 else 40}")
    slow = ("timing.line_rate_hz = 50", "amplifier.max_slew_v_per_s = 1e9", "- [limits]")
    path = write_pair(tmp_path, edited(SCAN, *edits, *slow))
    subject = planned_scan(path, remedies=False)
    assert subject.planned is not None
    run = played_axes(subject.planned)[1].emitted
    assert run is not None
    assert np.all(np.isnan(run.error.forward.scaling)) == (lines == 16)
    assert np.all(np.isnan(run.error.backward.scaling))
    assert np.max(np.abs(run.error.forward.residual)) > 0.3, "the residual has the steps"
    charts = charts_of(sections(subject))
    assert ("scaling-y-laws" in charts) == (lines == 100)
    assert "residual-y-laws" in charts
    for chart in charts.values():
        assert all(np.all(np.isfinite(curve.y)) for curve in chart.curves), chart.key
