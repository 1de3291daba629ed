"""`tablegen compare`: what differs, against the manifests themselves; what is the same; faults, names, the page."""

import copy
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from building import REPOSITORY
from editing import SCAN, SCANNER, edited, run, write_pair
from html_page import Page, well_formed
from hypothesis import given
from hypothesis import strategies as st
from operator_files import operator_file, write_operator_scan
from replacing import replace

from tablegen.comparison.charts import comparison_charts, differing_charts
from tablegen.comparison.comparison import compared
from tablegen.comparison.difference import _merged, pairs
from tablegen.comparison.quantity import ComparedQuantity
from tablegen.comparison.scans import scan_quantities
from tablegen.compensation.operator.file import operator_text
from tablegen.html_report.subject import Subject
from tablegen.manifest.fields import Manifest

LARGER = ("x.size_nm = 300.0", "timing.settle_lines = 4")


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example as scan.toml, a larger one as larger.toml, and a build of each."""
    folder = tmp_path_factory.mktemp("lab")
    scan = write_pair(folder)
    (folder / "larger.toml").write_text(edited(SCAN, *LARGER), "utf-8")
    assert run("build", scan, "-o", folder / "one", "-q").status == 0
    assert run("build", folder / "larger.toml", "-o", folder / "other", "-q").status == 0
    return folder


def record(*arguments: str | Path, status: int) -> dict[str, Any]:
    outcome = run("compare", *arguments, "--json")
    assert outcome.status == status, outcome.err
    found: dict[str, Any] = json.loads(outcome.out)
    return found


def rows(found: dict[str, Any]) -> dict[tuple[str, str], dict[str, Any]]:
    return {(row["section"], row["name"]): row for row in found["quantities"]}


@pytest.mark.parametrize("other", ["scan.toml", "one", "one/manifest.json"])
def test_a_scan_is_the_same_as_itself_and_as_its_build(lab: Path, other: str) -> None:
    outcome = run("compare", lab / "scan.toml", lab / other)
    assert (outcome.status, outcome.err) == (0, "")
    assert re.fullmatch(r"no difference in \d+ quantities", outcome.out.splitlines()[-1])


@pytest.mark.parametrize("sides", [("scan.toml", "larger.toml"), ("one", "other"), ("one", "larger.toml")])
def test_numbers_are_those_of_the_manifests(lab: Path, sides: tuple[str, str]) -> None:
    """Read from the builds by json alone, and the difference and its percentage worked out here."""
    found = rows(record(lab / sides[0], lab / sides[1], status=1))
    a, b = (json.loads((lab / name / "manifest.json").read_text("utf-8"))["axes"]["x"] for name in ("one", "other"))
    for name, path in (
        ("line", ("drive", "size_nm")),
        ("drive, peak to peak", ("drive", "v_amplitude")),
        ("beta backward", ("drive", "backward", "beta")),
        ("scaling error forward, uncompensated", ("certificate", "scaling_error_percent", "forward", "uncompensated")),
        ("scaling error backward, compensated", ("certificate", "scaling_error_percent", "backward", "total")),
        ("trace to retrace", ("certificate", "expected", "mismatch_percent", "value")),
        ("largest step", ("certificate", "largest_step")),
    ):
        first, second = a, b
        for key in path:
            first, second = first[key], second[key]
        row = next(row for (section, what), row in found.items() if what == name and section.startswith("x "))
        assert (row["a"], row["b"]) == (first, second), name
        assert row["difference"] == pytest.approx(second - first)
        assert row["percent"] == pytest.approx(100.0 * (second - first) / abs(first))
    assert not any(section.startswith("y ") for section, _ in found)  # nothing of y was changed
    asked = {key for key in found if key[0] == "asked for"}
    of_scans = {("asked for", "x.size_nm"), ("asked for", "timing.settle_lines")}
    assert asked == (of_scans if sides[0] == "scan.toml" else set())
    assert ("rates", "lines to settle") in found


def test_the_notes_have_codes_and_axes(tmp_path: Path, lab: Path) -> None:
    (tmp_path / "scanner.toml").write_text(edited(SCANNER), "utf-8")
    (tmp_path / "tight.toml").write_text(edited(SCAN, "limits.max_scaling_error_percent = 0.3"), "utf-8")
    found = record(lab / "one", tmp_path / "tight.toml", status=0)
    for one, note in zip(found["findings"], found["notes"], strict=True):
        assert note in (one["text"], f"{one['text']}; next: {one['remedy']}")
    codes = [(one["code"], one["axis"]) for one in found["findings"]]
    assert codes[0] == ("scaling-error", "x")
    assert codes[-1] == ("uncompared-inputs", "")


def test_the_text_has_what_differs_and_with_all_the_rest(lab: Path) -> None:
    outcome = run("compare", lab / "scan.toml", lab / "larger.toml")
    assert outcome.status == 1
    assert re.search(r"^  x\.size_nm \[nm\] +200 +300 +\+100 nm +\+50 %$", outcome.out, re.MULTILINE)
    assert "frame rate" not in outcome.out
    count, total = map(int, re.findall(r"(\d+) of (\d+) quantities differ", outcome.out)[0])
    everything = run("compare", lab / "scan.toml", lab / "larger.toml", "--all")
    assert re.search(r"^  frame rate \[Hz\] +2 +2$", everything.out, re.MULTILINE)
    told = [sum(line.startswith("  ") for line in text.out.splitlines()) - 1 for text in (outcome, everything)]
    assert told == [count, total]
    assert all(len(line) <= 120 for line in everything.out.splitlines())


def leaves(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The paths of all numbers of a manifest, of a list the first."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from leaves(inner, (*path, key))
    elif isinstance(value, list) and value:
        yield from leaves(value[0], (*path, 0))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


# What follows from numbers that are compared, or is in the digest of the plan, which a manifest cannot have wrong.
FOLLOW = {
    *("phase_step", "phase_remainder", "hold_ticks", "rate_hz", "requested_hz", "v_scan_normalised", "gain_q"),
    *("offset_code", "scale", "guard_bits", "held_factors", "held_harmonics", "target", "half_width_hz", "max_step"),
    *("ticks", "turn_tick", "turn_line", "size", "position", "settle_us", "p_offset", "position_nm", "rate_exact"),
}


@pytest.mark.common
def test_every_number_of_a_manifest_that_is_changed_is_found(lab: Path) -> None:
    """Negative control, number by number: none of them is compared with itself."""
    plain = json.loads((lab / "one" / "manifest.json").read_text("utf-8"))
    subject = Subject(msgspec.convert(plain, Manifest), "", ())
    before = scan_quantities(subject)
    assert all(pair.same for pair in pairs(before, scan_quantities(subject), of_scan=True))
    changed = 0
    for path in [("axes", *rest) for rest in leaves(plain["axes"])] + [
        ("sequence", *p) for p in leaves(plain["sequence"])
    ]:
        if FOLLOW & set(path):
            continue
        other = copy.deepcopy(plain)
        at = other
        for key in path[:-1]:
            at = at[key]
        at[path[-1]] = at[path[-1]] * 1.25 if isinstance(at[path[-1]], float) and at[path[-1]] else at[path[-1]] + 1
        try:
            manifest = msgspec.convert(other, Manifest)
        except msgspec.ValidationError:
            continue
        if msgspec.to_builtins(manifest) == msgspec.to_builtins(subject.manifest):
            continue  # a key that no reader of manifests has
        after = scan_quantities(replace(subject, manifest=manifest))
        assert any(not pair.same for pair in pairs(before, after, of_scan=True)), path
        changed += 1
    assert changed > 60


def test_damaged_files_of_a_build_are_told(lab: Path, tmp_path: Path) -> None:
    scan = write_pair(tmp_path)
    assert run("build", scan, "-o", tmp_path / "build", "-q", "-f", "bin").status == 0
    (tmp_path / "scan.toml").write_text(edited(SCAN, "+ [emit]\nformats = ['bin']"), "utf-8")
    assert run("compare", scan, tmp_path / "build").status == 0
    name = min(path.name for path in (tmp_path / "build").glob("*.bin"))
    with (tmp_path / "build" / name).open("a", encoding="utf-8") as file:
        file.write("\n")
    outcome = run("compare", scan, tmp_path / "build")
    assert outcome.status == 1
    assert f"does not agree with its manifest: {name}" in outcome.out
    assert outcome.out.splitlines()[-1].endswith("but files of a build do not agree with its manifest")


def test_a_limit_that_is_exceeded_is_told_and_compared(lab: Path) -> None:
    (lab / "tight.toml").write_text(edited(SCAN, "limits.max_error_lsb = 0.1"), "utf-8")
    outcome = run("compare", lab / "scan.toml", lab / "tight.toml")
    assert outcome.status == 1
    assert "limits.max_error_lsb [LSB]" in outcome.out
    assert re.search(
        r"^note: .*tight\.toml:\d+: limits\.max_error_lsb: the x axis errs by up to 0\.57", outcome.out, re.M
    )


@pytest.mark.parametrize(
    ("a", "b", "said"),
    [
        ("scan.toml", "scanner.toml", "scanner.toml: is a scanner file, and {}/scan.toml is a scan file; give two"),
        ("one", "scanner.toml", "scanner.toml: is a scanner file, and {}/one is a directory of a build; give two"),
        ("scan.toml", "absent.toml", "absent.toml: cannot be read: No such file"),
        ("scan.toml", "empty", "empty/manifest.json: cannot be read"),
        ("other.txt", "scan.toml", "other.txt: is none of these: a scan file, a scanner file, an operator file"),
        ("scan.toml", "wrong.toml", "wrong.toml:19: timing.lines: 0 is below 1"),
    ],
)
def test_what_cannot_be_compared_is_refused(lab: Path, a: str, b: str, said: str) -> None:
    (lab / "empty").mkdir(exist_ok=True)
    (lab / "other.txt").write_text("a = 1\n", "utf-8")
    (lab / "wrong.toml").write_text(edited(SCAN, "timing.lines = 0"), "utf-8")
    outcome = run("compare", lab / a, lab / b)
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err.startswith(f"{lab}/" + said.format(lab)), outcome.err


@pytest.mark.common
def test_the_page_is_one_file_without_a_network(lab: Path, tmp_path: Path) -> None:
    outcome = run("compare", lab / "scan.toml", lab / "larger.toml", "-o", tmp_path / "compare.html")
    assert outcome.status == 1
    content = (tmp_path / "compare.html").read_bytes()
    page = Page(content.decode("utf-8"))
    well_formed(content, page)
    assert {"sides", "differences", "charts", "all"} <= set(page.ids)
    assert {"chart-drive-x", "chart-apart-y", "chart-residual-x-forward", "chart-scaling-x-backward"} <= set(page.ids)
    assert str(lab) not in content.decode("utf-8")
    again = run("compare", lab / "scan.toml", lab / "larger.toml", "-o", tmp_path / "again.html")
    assert again.out == outcome.out
    assert (tmp_path / "again.html").read_bytes() == content


@pytest.mark.common
def test_a_plot_has_what_differs_first(lab: Path, tmp_path: Path) -> None:
    """In a file all charts, the same bytes each time; in the terminal those that differ."""
    sides = lab / "scan.toml", lab / "larger.toml"
    assert run("compare", *sides, "--plot", tmp_path / "compare.svg").status == 1
    content = (tmp_path / "compare.svg").read_text("utf-8")
    titles = re.findall(r">([xy] [^<]+)</text>", content)
    charts = [title for title in titles if "drive" in title or "simulated" in title]
    assert charts.index("x drive, B less A") < charts.index("y drive, B less A")  # nothing of y was changed
    assert charts.index("x scaling error backward, simulated") < charts.index("y drive, one frame")
    assert "A: scan.toml, B: larger.toml" in content  # both have one name
    assert run("compare", *sides, "--plot", tmp_path / "again.svg").status == 1
    assert (tmp_path / "again.svg").read_text("utf-8") == content
    shown = run("compare", *sides, "--plot").out
    assert "x drive, B less A" in shown
    assert "y drive" not in shown
    refused = run("compare", *sides, "--plot", "--json")
    assert refused.status == 2
    assert "--plot FILE" in refused.err


def test_a_pixel_of_each_side_is_where_its_drive_is(lab: Path) -> None:
    """The curves of the charts are those of the plans, A and B not exchanged."""
    both = compared(lab / "scan.toml", lab / "other")
    charts = {chart.key: chart for chart in comparison_charts(both)}
    assert "residual-x-forward" not in charts  # a build does not know the scanner
    a, b = charts["drive-x"].curves
    assert (a.name, b.name) == ("A", "B")
    for curve, folder in ((a, "one"), (b, "other")):
        stored = json.loads((lab / folder / "manifest.json").read_text("utf-8"))["axes"]["x"]
        assert np.ptp(curve.y) == pytest.approx(stored["drive"]["v_amplitude"], rel=0.06)  # turnarounds are rounded
        assert curve.x[-1] == pytest.approx(1e3 / stored["line"]["rate_hz"])
    (apart,) = charts["apart-x"].curves
    assert apart.y == pytest.approx(b.y - a.y)
    assert [chart.key for chart in differing_charts(list(charts.values()))] == ["drive-x", "apart-x", "spectrum-x"]


def test_a_line_scan_is_compared_with_a_frame(lab: Path) -> None:
    """Its y rests: it has an offset and no drive."""
    (lab / "line.toml").write_text(
        edited(SCAN, "y.motion = 'off'", "- y.size_nm", "- y.turn", "- [y.band_limit]", "- [y.table]"), "utf-8"
    )
    found = rows(record(lab / "scan.toml", lab / "line.toml", status=1))
    assert (found["y drive", "motion"]["a"], found["y drive", "motion"]["b"]) == ("moves", "rests")
    assert found["y drive", "line"]["b"] is None
    assert not any(section.startswith("x ") for section, _ in found)
    assert run("compare", lab / "line.toml", lab / "line.toml").status == 0
    assert run("compare", lab / "scan.toml", lab / "line.toml", "-o", lab / "line.html").status == 1
    assert "chart-residual-x-forward" in Page((lab / "line.html").read_text("utf-8")).ids


def test_names_of_others_are_text(tmp_path: Path) -> None:
    evil = "<script>alert(1)</script><img src=x onerror=f()>"
    write_pair(tmp_path)
    (tmp_path / "evil.toml").write_text(edited(SCANNER, f"name = {json.dumps(evil)}"), "utf-8")
    assert run("compare", tmp_path / "scanner.toml", tmp_path / "evil.toml", "-o", tmp_path / "c.html").status == 1
    content = (tmp_path / "c.html").read_bytes()
    page = Page(content.decode("utf-8"))
    well_formed(content, page)
    assert "img" not in page.tags
    assert "<img src=x" in page.said


def sizes(folder: Path, name: str, k: float, seed: int) -> None:
    """Forty measured sizes of a linear scanner with 0.2 % noise."""
    drives = np.linspace(5.0, 100.0, 40)
    nm = k * drives * (1.0 + 0.002 * np.random.default_rng(seed).standard_normal(40))
    text = "\n".join(f"{v:.6g},{one:.9g}" for v, one in zip(drives, nm, strict=True))
    (folder / name).write_text(f"drive_v,actual_nm\n{text}\n", "utf-8")


def calibrated(folder: Path, name: str, k: float, seed: int) -> Path:
    """A scanner file whose size was fitted to such a measurement, threshold as it is."""
    sizes(folder, f"{name}.csv", k, seed)
    path = folder / f"{name}.toml"
    path.write_text(SCANNER, "utf-8")
    outcome = run("calibrate", "size", "--axis", "x", folder / f"{name}.csv", "--scanner", path, "--write")
    assert outcome.status == 0, outcome.err
    return path


def test_a_parameter_has_changed_if_it_differs_by_more_than_its_errors(tmp_path: Path) -> None:
    first, again = calibrated(tmp_path, "first", 10.0, 1), calibrated(tmp_path, "again", 10.0, 2)
    other = calibrated(tmp_path, "other", 10.2, 3)
    key = ("scanner, x size", "k_nm_per_v")
    same = rows(record(first, again, status=1))[key]
    moved = rows(record(first, other, status=1))[key]
    error = np.hypot(same["a"]["error"], same["b"]["error"])
    assert same["standard_errors"] == pytest.approx(abs(same["difference"]) / error)
    assert same["standard_errors"] < 2.0 < moved["standard_errors"]
    outcome = run("compare", first, other)
    assert re.search(r"k_nm_per_v .*standard errors: more than the errors", outcome.out)
    assert re.search(r"note: [1-3] of \d quantities with known standard errors differ by more than 2", outcome.out)
    assert "within the errors" in run("compare", first, again).out


def test_the_error_of_a_value_that_was_edited_is_not_known(tmp_path: Path) -> None:
    first, other = calibrated(tmp_path, "first", 10.0, 1), calibrated(tmp_path, "other", 10.0, 2)
    text = other.read_text("utf-8")
    assert text.count("# standard errors: k_nm_per_v ") == 1
    other.write_text(edited(text, "x.size.k_nm_per_v = 10.0"), "utf-8")
    row = rows(record(first, other, status=1))["scanner, x size", "k_nm_per_v"]
    assert row["b"] == 10.0
    assert "standard_errors" not in row
    again = calibrated(tmp_path, "other", 10.0, 2)
    assert again.read_text("utf-8") == text  # a calibration replaces its own comment


def test_operators_are_compared_by_what_they_say_of_lines(tmp_path: Path) -> None:
    one, other = operator_file(), operator_file(weights=(24.0, 3.0, 5.0))
    for name, file in (("one.toml", one), ("again.toml", one), ("other.toml", other)):
        (tmp_path / name).write_text(operator_text(file, []), "utf-8")
    assert run("compare", tmp_path / "one.toml", tmp_path / "again.toml").status == 0
    found = rows(record(tmp_path / "one.toml", tmp_path / "other.toml", status=1))
    row = found["line of 95 V at 50 V", "rms residual forward"]
    assert row["b"]["value"] > row["a"]["value"] > 0.5  # more hysteresis
    assert row["standard_errors"] > 2.0
    # rms of left-out traces 0.05 % at all of them, all of it noise: one standard error at 90 %
    assert row["a"]["error"] == pytest.approx(0.05 / 1.645, rel=1e-3)


def test_operators_that_scanner_files_name_are_compared_too(tmp_path: Path) -> None:
    for name, weights in (("a", (12.0, 3.0, 5.0)), ("b", (15.0, 3.0, 5.0))):
        (tmp_path / name).mkdir()
        write_operator_scan(tmp_path / name, operator_file(weights=weights))
    found = rows(record(tmp_path / "a" / "scanner.toml", tmp_path / "b" / "scanner.toml", status=1))
    assert ("x line of 60 V at 50 V", "size") in found
    outcome = run("compare", tmp_path / "a/scanner.toml", tmp_path / "b/scanner.toml", "-o", tmp_path / "c.html")
    assert outcome.status == 1
    page = Page((tmp_path / "c.html").read_text("utf-8"))
    assert "chart-x-loop-1-forward" in page.ids
    assert "chart-size-y" in page.ids


@given(st.permutations("abcdef"), st.sets(st.sampled_from("abcdef")), st.sets(st.sampled_from("abcdef")))
def test_orders_that_agree_are_kept(order: list[str], a: set[str], b: set[str]) -> None:
    one, other = ([name for name in order if name in side] for side in (a, b))
    merged = _merged(one, other)
    assert sorted(merged) == sorted(a | b)
    assert [name for name in merged if name in a] == one
    assert [name for name in merged if name in b] == other


def test_words_zeros_and_decibels_have_no_percentage() -> None:
    values: list[tuple[float | str, float | str]] = [("a", "b"), (0.0, 1.0), (1.0, "b")]
    for first, second in values:
        (pair,) = pairs([ComparedQuantity("s", "n", first)], [ComparedQuantity("s", "n", second)], True)
        assert not pair.same
        assert pair.percent is None
    (pair,) = pairs([ComparedQuantity("s", "n", -80.0, "dB")], [ComparedQuantity("s", "n", -70.0, "dB")], True)
    assert (pair.difference, pair.percent) == (10.0, None)


def test_the_page_of_the_docs_shows_what_is_printed(lab: Path) -> None:
    """Line by line but for the room between columns; a calibration writes the comment that the page shows."""
    text = (REPOSITORY / "docs" / "compare.md").read_text("utf-8")
    block = text.split("```text\n")[1].split("```")[0].splitlines()[3:]
    (lab / "larger only.toml").write_text(edited(SCAN, "x.size_nm = 300.0"), "utf-8")
    printed = [line.split() for line in run("compare", lab / "scan.toml", lab / "larger only.toml").out.splitlines()]
    assert len(block) > 3
    assert all(line.split() in printed for line in block if line != "..."), block
    comment = text.split("```toml\n")[1].splitlines()[2]
    assert re.fullmatch(r"# standard errors: k_nm_per_v [\d.]+ \+- [\d.]+, beta [\d.]+ \+- [\d.]+", comment)
