"""The line that every output begins with: its figures are those of the certificate, and each branch has its words."""

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from building import EXAMPLE, Variant, build
from editing import run
from msgspec.structs import replace

import tablegen
from tablegen.base.remedies import REMEDIES
from tablegen.certificate.certificate import certify
from tablegen.certificate.error_answer import (
    converter_percent,
    error_answers,
    short,
    time_text,
)
from tablegen.certificate.scan_text import scan_text
from tablegen.compensation.expectation import Expectation, Figure
from tablegen.config.schema import Refinement
from tablegen.html_report.planned_scan import planned_scan
from tablegen.html_report.playing import played_axes
from tablegen.virtual.own_run import image_errors


@pytest.fixture(scope="module")
def built() -> tablegen.Build:
    return tablegen.build(EXAMPLE)


def answer(built: tablegen.Build, *, layer: bool = False, **changes: Any) -> Any:
    """Return the answer of x with another certificate, or with a layer that the scan file describes so."""
    x = replace(built.plan.x, layer=built.plan.x.target) if layer else built.plan.x
    certificates = built.certificates
    if "expected" in changes:
        certificates = {**certificates, "x": replace(certificates["x"], expected=changes["expected"])}
    scan = built.setup.scan
    if "refinement" in changes:
        scan = replace(scan, x=replace(scan.x, refinement=changes["refinement"]))
    setup = replace(built.setup, scan=scan)
    return error_answers(setup, replace(built.plan, x=x), certificates)[0]


def learnt(**measured: Any) -> Refinement:
    """Return a layer of zeros with what was measured when it was learnt."""
    played: dict[str, Any] = {"v_amplitude": 20.0, "v_offset": 50.0, "rate_hz": 400.0, "turn": 0.5}
    return Refinement(a=(0.0,), b=(0.0,), window=(0.1, 0.9), directions="both", **played, **measured)


def test_laws_alone_are_not_measured(built: tablegen.Build) -> None:
    one, mismatch = answer(built), built.certificates["x"].expected
    assert mismatch is not None
    assert mismatch.mismatch is not None
    assert one.basis == "laws"
    assert one.percent == mismatch.mismatch.value
    assert str(one).startswith("x: not measured; by laws alone ")
    assert one.nm == pytest.approx(0.01 * one.percent * built.plan.x.drive.size_nm)
    assert one.pixels == pytest.approx(one.nm / (built.plan.x.drive.window_nm / built.plan.schedule.pixels))


def test_a_slow_axis_has_a_figure_of_its_one_way_by_the_laws(built: tablegen.Build) -> None:
    """The figure is that of the integers on a scanner that follows the laws."""
    y = built.answers[1]
    planned = planned_scan(Path(EXAMPLE)).planned
    assert planned is not None
    played = played_axes(planned)[1].emitted
    assert played is not None
    assert y.of == "rms of one way, at least"
    assert y.percent == pytest.approx(image_errors(played)[0], rel=0.1)
    assert y.nm == pytest.approx(0.01 * y.percent * built.plan.y.drive.size_nm)


def test_a_stroke_without_branches_has_its_reason(built: tablegen.Build, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tablegen.certificate.error_answer.forward_residual", lambda line: None)
    y = built.answers[1]
    assert y.percent is None
    assert "no branches for the stroke that is played, so the size of the error is unknown" in str(y)


def test_y_counts_image_lines(built: tablegen.Build) -> None:
    expected = Expectation("traces", rms={"forward": Figure(0.3)})
    certificates = {**built.certificates, "y": replace(built.certificates["y"], expected=expected)}
    y = error_answers(built.setup, built.plan, certificates)[1]
    assert y.nm == pytest.approx(0.6)
    assert y.pixels == pytest.approx(0.6 / (180.0 / 170))


def test_traces_predict(built: tablegen.Build) -> None:
    one = answer(
        built, expected=Expectation("traces", rms={"forward": Figure(0.2, 0.05), "backward": Figure(0.3, 0.1)})
    )
    assert (one.basis, one.percent, one.limit) == ("predicted", 0.3, "the piezo")
    assert "predicted by the operator +- 0.1 % for 90 % of scans" in str(one)
    assert one.next_step == "refine"


def test_a_measurement_goes_before_a_prediction(built: tablegen.Build) -> None:
    layer = learnt(before_percent=0.12)
    expected = Expectation("traces", rms={"forward": Figure(0.9)})
    one = answer(built, layer=True, refinement=layer, expected=expected)
    assert (one.basis, one.of, one.percent) == ("measured", "rms", 0.12)
    assert one.source.endswith("before the layer of the last round")
    predicted = answer(built, layer=True, refinement=replace(layer, after_percent=0.034), expected=expected)
    assert predicted.source == f"{one.source}, with which refine predicts 0.034 %"
    assert predicted.percent == 0.12
    assert answer(built, layer=True, refinement=replace(layer, before_of="mismatch")).of == "trace to retrace, rms"
    best = answer(built, layer=True, refinement=replace(layer, best=True))
    assert "best round" in best.source
    assert best.next_step.startswith("nothing")
    assert answer(built, layer=True, refinement=learnt()).percent is None


def test_the_converter_limits_what_is_small(built: tablegen.Build) -> None:
    own = converter_percent(built.plan.x, built.certificates["x"])
    small, large = (answer(built, layer=True, refinement=learnt(before_percent=own * by)) for by in (1.5, 3.0))
    assert (small.limit, small.next_step) == ("the converter", REMEDIES["converter-limit"])
    assert large.limit == "the piezo"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (1.0 / 0.00176056, "9 min 28 s"), (0.5, "0.5 s"), (59.7, "1 min"), (60.0, "1 min"), (3600.0, "1 h"),
        (7500.0, "2 h 5 min"), (3599.6, "1 h"), (0.0025, "2.5 ms"), (9.4, "9.4 s"),
    ],
)  # fmt: skip
def test_times(seconds: float, text: str) -> None:
    assert time_text(seconds) == text


def test_every_output_begins_with_it(built: tablegen.Build, tmp_path: Path) -> None:
    lines = built.brief()
    assert lines[-1] == "0.5 s an image"
    assert Fraction(1, 2) == 1 / built.plan.schedule.frame_rate
    for command in (
        ["show", EXAMPLE, "--no-plot"],
        ["check", EXAMPLE],
        ["build", EXAMPLE, "-o", tmp_path / "b"],
        ["report", EXAMPLE, "-o", tmp_path / "r.html"],
        ["simulate", EXAMPLE, "--no-calibration"],
    ):
        assert run(*command).out.splitlines()[:3] == lines, command
    page = (tmp_path / "r.html").read_text("utf-8")
    assert all(page.index(line) < page.index('class="verdict') for line in lines)
    assert f"{repr(built).splitlines()[1].strip()}; next: refine" == lines[0]


def test_json_has_the_first_lines_as_data(built: tablegen.Build) -> None:
    plain = json.loads(run("simulate", EXAMPLE, "--no-calibration", "--json").out)
    assert [one["text"] for one in plain["answers"].values()] == built.brief()[:-1]
    assert plain["duration"] == built.duration
    x, own = plain["answers"]["x"], built.answers[0]
    assert (x["basis"], x["of"], x["source"], x["next"]) == (own.basis, own.of, own.source, own.next_step)
    assert (x["code"], x["next"]) == ("model-mismatch", REMEDIES["model-mismatch"])
    assert (x["percent"], x["nm"], x["pixels"]) == (own.percent, own.nm, own.pixels)


def test_show_is_brief_and_all_has_the_rest(built: tablegen.Build) -> None:
    brief, complete = (run("show", EXAMPLE, "--no-plot", *more).out for more in ((), ("--all",)))
    assert len(brief.splitlines()) <= 40
    assert brief.startswith(built.overview())
    assert complete.startswith(built.summary())
    assert "m g V_scan" in complete
    assert "m g V_scan" not in brief
    scaling = max(one.scaling_error_percent for one in built.certificates.values())
    assert f"it varies by {scaling:.3g} %" in brief
    assert run("show", EXAMPLE, "--json").out == run("show", EXAMPLE, "--json", "--all").out


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.01234, "0.012"), (4.56, "4.6"), (99.4, "99"), (99.6, "100"), (-99.6, "-100"), (1234.5, "1234")],
)
def test_errors_have_two_digits_and_no_exponent(value: float, text: str) -> None:
    assert short(value) == text


@pytest.mark.common
@pytest.mark.parametrize(("rate_hz", "text"), [(400.0, "; 5 us a pixel; "), (1.0, "; 2 ms a pixel; ")])
def test_a_slow_pixel_is_told_in_milliseconds(rate_hz: float, text: str, tmp_path: Path) -> None:
    plan = build(tmp_path, Variant({"timing.line_rate_hz": rate_hz, "timing.lines": 8})).plan
    assert text in scan_text(plan, certify(plan))[0]
