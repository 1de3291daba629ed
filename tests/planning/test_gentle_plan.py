"""Scaling errors that are asked for: what a plan makes of the keys, what it refuses, and that its advice holds."""

import re
import shutil
from pathlib import Path

import pytest
from editing import SCAN, edited, run, write_pair
from operator_files import operator_file, write_operator_scan
from variants import plan_of, setup_of
from verifying import edit_manifest, make_right

from tablegen.base.input_errors import Rejected
from tablegen.certificate.certificate import certify
from tablegen.certificate.line_errors import CHORD
from tablegen.certificate.optimum import with_optimum
from tablegen.config.load import load
from tablegen.manifest.read import read_build
from tablegen.planning import allowed_error
from tablegen.planning.line_plan import LinePlan, Plan, make_plan

E = "x.band_limit.max_scaling_error_percent"
H = "x.band_limit.harmonics"
LIMIT = {"limits.max_scaling_error_percent": ""}


@pytest.mark.parametrize(("asked", "harmonics"), [("0.1", "32"), ("1.0", "16"), ("0.004", "40")])
def test_an_error_is_kept_with_less_acceleration(tmp_path: Path, asked: str, harmonics: str) -> None:
    plan = plan_of(tmp_path, {E: asked, H: harmonics, **LIMIT})
    certificates = certify(plan)
    before = plan_of(tmp_path, {H: harmonics, **LIMIT})
    assert plan.x.series.harmonics == int(harmonics)
    assert plan.x.kept_percent == float(asked)
    assert all(one.band_limit <= float(asked) for one in certificates["x"].scaling.values())
    assert all(abs(one.size) <= 0.5 * float(asked) + one.quantisation for one in certificates["x"].scaling.values())
    assert certificates["x"].peak_acceleration == plan.x.target.peak_acceleration()
    assert plan.x.target.peak_acceleration() < before.x.target.peak_acceleration()
    assert certificates["y"].peak_acceleration is None
    assert plan.y.target.a.tolist() == before.y.target.a.tolist()


def test_an_error_alone_takes_32_harmonics_or_as_many_as_it_needs(tmp_path: Path) -> None:
    assert plan_of(tmp_path, {E: "0.1", H: ""}).x.series.harmonics == 32
    few = plan_of(tmp_path, {E: "0.002", H: ""}).x
    assert 32 < few.series.harmonics <= 36
    with pytest.raises(Rejected, match=f"harmonics leave .* take {few.series.harmonics} harmonics"):
        plan_of(tmp_path, {E: "0.002", H: str(few.series.harmonics - 1)})


def test_the_fewest_harmonics_are_found_and_one_less_is_refused(tmp_path: Path) -> None:
    line = plan_of(tmp_path, {E: "0.3", H: '"fewest"'}).x
    assert line.series.harmonics == 19
    with pytest.raises(Rejected, match=r"18 harmonics leave .* take 19 harmonics"):
        plan_of(tmp_path, {E: "0.3", H: "18"})


def test_the_fewest_harmonics_are_at_least_those_of_a_layer(tmp_path: Path) -> None:
    layer = (
        f"+ [x.refinement]\na = {[0.0] * 21}\nb = {[0.0001] * 21}\nv_amplitude = 20.4\nv_offset = 50.0\n"
        "rate_hz = 400.0\nturn = 0.5\nwindow = [0.1, 0.9]\ndirections = 'both'"
    )
    plan = make_plan(load(write_pair(tmp_path, edited(SCAN, f"{E} = 0.3", f'{H} = "fewest"', layer))))
    assert plan.x.series.harmonics >= 21  # as many as the layer has
    assert all(one.band_limit <= 0.3 for one in certify(plan)["x"].scaling.values())


def test_by_laws_no_error_is_allowed_that_was_not_asked_for(tmp_path: Path) -> None:
    """Their line is that of sharp turns: the default is the fit of the window."""
    given, free = (plan_of(tmp_path, {H: harmonics}).x for harmonics in ("32", ""))
    assert free.kept_percent is None
    assert free.target.a.tolist() == given.target.a.tolist()


@pytest.mark.common
def test_the_fewest_harmonics_alone_keep_what_the_converter_leaves(tmp_path: Path) -> None:
    """And at most half of what the limits of the scan leave."""
    fewest = {H: '"fewest"'}
    plan = plan_of(tmp_path, {**fewest, **LIMIT})
    scaling = certify(plan)["x"].scaling.values()
    assert plan.x.kept_percent == pytest.approx(max(one.quantisation for one in scaling), rel=0.15)
    assert plan.x.kept_percent == pytest.approx(200.0 / CHORD / abs(plan.x.codes_per_unit))
    assert plan_of(tmp_path, fewest).x.kept_percent == 0.25  # the example's limit is 0.5 %
    coarse = plan_of(tmp_path, {**fewest, "dac.bits": "12", "limits.max_error_lsb": "", **LIMIT}).x
    assert coarse.kept_percent == 0.5
    assert allowed_error.CHORD == CHORD


@pytest.mark.common
def test_on_an_operator_the_default_is_what_the_converter_leaves(tmp_path: Path) -> None:
    """With a damped resonance: one of quality 20 rings by more, since the loop has harmonics up there."""
    edits = ("x.band_limit.window = [0.25, 0.75]", "- limits.max_scaling_error_percent")

    def planned(harmonics: str) -> LinePlan:
        scan = write_operator_scan(tmp_path, operator_file(), *edits, harmonics)
        scanner = tmp_path / "scanner.toml"
        scanner.write_text(edited(scanner.read_text("utf-8"), "x.resonance.quality = 2.0"), "utf-8")
        return make_plan(load(scan)).x

    given, line = planned(f"{H} = 32"), planned(f"- {H}")
    assert line.kept_percent == pytest.approx(200.0 / CHORD / abs(line.codes_per_unit))
    assert line.series.harmonics == 32
    assert line.target.peak_acceleration() < given.target.peak_acceleration()


def test_what_the_converter_leaves_is_given_up_where_32_harmonics_cannot_keep_it(tmp_path: Path) -> None:
    """No scan is refused for an error that nobody asked for: it is the fit of the window, as with 32 harmonics."""
    window = "x.band_limit.window = [0.04, 0.96]"
    given, free = (
        make_plan(load(write_operator_scan(tmp_path, operator_file(), window, harmonics))).x
        for harmonics in (f"{H} = 32", f"- {H}")
    )
    assert free.kept_percent is None
    assert free.target.a.tolist() == given.target.a.tolist()


@pytest.mark.parametrize("key", [H, "x.band_limit.cutoff_hz"])
def test_a_limit_of_the_band_is_what_it_was(tmp_path: Path, key: str) -> None:
    edits = {H: "24"} if key == H else {H: "", key: "9700.0"}
    line = plan_of(tmp_path, edits).x
    assert (line.kept_percent, line.series.harmonics) == (None, 24)


def test_what_is_refused_says_what_would_fit_and_it_does(tmp_path: Path) -> None:
    edits = {E: "0.3", H: "16", **LIMIT}
    with pytest.raises(Rejected) as caught:
        plan_of(tmp_path, edits)
    (problem,) = caught.value.problems
    assert problem.key == E
    said = re.fullmatch(
        r"16 harmonics leave (\S+) % of scaling error in this window; allow that much, or take (\d+) harmonics",
        problem.why,
    )
    assert said is not None, problem.why
    for change in ({E: said[1]}, {H: said[2]}):
        again = plan_of(tmp_path, {**edits, **change})
        assert all(one.band_limit <= float({**edits, **change}[E]) for one in certify(again)["x"].scaling.values())


def test_a_cutoff_that_is_too_low_says_which_is_not(tmp_path: Path) -> None:
    edits = {E: "0.3", H: "", "x.band_limit.cutoff_hz": "6400.0"}
    with pytest.raises(Rejected, match=r"16 harmonics leave \S+ % .*, or take cutoff_hz = (\d+)") as caught:
        plan_of(tmp_path, edits)
    cutoff = re.search(r"cutoff_hz = (\d+)", str(caught.value))
    assert cutoff is not None
    line = plan_of(tmp_path, {**edits, "x.band_limit.cutoff_hz": f"{cutoff[1]}.0"}).x
    assert line.kept_percent == 0.3


def test_what_no_number_of_harmonics_keeps_is_refused(tmp_path: Path) -> None:
    """Of a period of few ticks, and of a table of few words."""
    with pytest.raises(Rejected, match=r"15 harmonics, the most there can be here, leave \S+ % .*; allow that much"):
        plan_of(tmp_path, {E: "0.3", H: "", "x.table.length": "32"})


@pytest.mark.common
def test_it_is_near_the_optimum_in_the_build_too(tmp_path: Path) -> None:
    plan = plan_of(
        tmp_path, {E: "0.1", "y.band_limit.max_scaling_error_percent": "0.3", "y.band_limit.harmonics": "32"}
    )
    for line in plan.lines:
        certificate = with_optimum(line, certify(plan)[line.axis])
        assert certificate.optimum is not None
        assert 0.99 < line.target.peak_acceleration() / certificate.optimum < 1.15


@pytest.mark.common
@pytest.mark.parametrize("percent", [0.5, 2.0])
def test_an_operator_s_line_keeps_its_error_with_less_acceleration(tmp_path: Path, percent: float) -> None:
    """What the operator expects of the played waveform, by chords, is at most the error that was asked for."""

    def planned(*edits: str) -> Plan:
        return make_plan(load(write_operator_scan(tmp_path, operator_file(creep=0.02), *edits)))

    learnt, plan = planned().x, planned(f"{E} = {percent}")
    gentle = plan.x
    expected = gentle.drive.shape.identification.expectation
    assert expected is not None
    assert expected.mismatch is not None
    assert gentle.kept_percent == percent
    assert max(figure.value for figure in expected.scaling.values()) <= percent
    assert expected.mismatch.value <= 0.5 * percent
    assert gentle.target.peak_acceleration() < 0.8 * learnt.target.peak_acceleration()
    certificate = with_optimum(gentle, certify(plan)["x"])
    assert certificate.optimum is not None
    assert gentle.target.peak_acceleration() < 1.15 * certificate.optimum


@pytest.mark.common
@pytest.mark.parametrize(("asked", "harmonics"), [(0.33, 32), (1.0, 12)])
def test_what_an_operator_s_line_cannot_keep_says_what_it_can(tmp_path: Path, asked: float, harmonics: int) -> None:
    def planned(percent: str) -> LinePlan:
        edits = (f"{E} = {percent}", f"{H} = {harmonics}")
        return make_plan(load(write_operator_scan(tmp_path, operator_file(creep=0.02), *edits))).x

    said = rf"{re.escape(E)}: {harmonics} harmonics do not .* on the operator; allow at least (\S+) %, or take more"
    with pytest.raises(Rejected, match=said) as caught:
        planned(str(asked))
    again = re.search(said, str(caught.value))
    assert again is not None
    assert planned(again[1]).kept_percent == float(again[1])


@pytest.mark.common
def test_show_prints_the_ratio_to_the_optimum(tmp_path: Path) -> None:
    setup = setup_of(tmp_path, {E: "0.3"})
    shown = run("show", setup.scan_file.name, "--optimum", "--no-plot").out
    assert "window 0.1..0.9 both, minimum acceleration at 0.3 %" in shown
    ratios = re.findall(r"acceleration +at most (\S+) of the line a period squared, (\S+) of the optimum (\S+)", shown)
    assert len(ratios) == 2
    peak, ratio, optimum = map(float, ratios[0])
    assert ratio == pytest.approx(peak / optimum, abs=2e-3)
    assert 1.0 <= ratio <= 1.15
    assert "optimum" not in run("show", setup.scan_file.name, "--no-plot").out
    assert run("show", setup.scan_file.name, "--optimum", "--json").status == 2


@pytest.mark.common
def test_the_manifest_says_what_was_kept_and_verify_holds_it(tmp_path: Path) -> None:
    setup = setup_of(tmp_path, {E: "0.3"})
    folder = tmp_path / "out"
    assert run("build", setup.scan_file.name, "-o", folder).status == 0
    x, y = (axis for _, axis in read_build(folder).axes)
    assert (x.fourier.max_scaling_error_percent, y.fourier.max_scaling_error_percent) == (0.3, None)
    assert x.certificate.peak_acceleration == pytest.approx(
        plan_of(tmp_path, {E: "0.3"}).x.target.peak_acceleration(), rel=2e-6
    )
    assert y.certificate.peak_acceleration is None
    assert run("verify", folder, "--target", "files").status == 0
    for path, value, says in (
        (("fourier", "max_scaling_error_percent"), 0.2, "fourier.max_scaling_error_percent is 0.2, "),
        (("certificate", "peak_acceleration"), 40.0, "certificate.peak_acceleration is 40"),
    ):
        changed = tmp_path / path[1]
        shutil.copytree(folder, changed)
        edit_manifest(changed, "axes", "x", *path, value=value)
        make_right(changed)
        found = run("verify", changed, "--target", "files")
        assert found.status != 0
        assert says in found.out + found.err
