"""A sine on a page and side by side, as a build and as a scan file: pixels on the predicted position, their errors."""

import json
from pathlib import Path

import numpy as np
import pytest
from editing import run
from foreign_plants import ForeignPlant, ManyPlays
from operator_files import operator_file
from replacing import replace
from sine_scans import response_csv, sine_scan, text_of
from tilted_scans import write_sine

import tablegen
from tablegen.comparison.charts import comparison_charts
from tablegen.comparison.comparison import compared
from tablegen.comparison.scans import scan_quantities
from tablegen.config.load import load
from tablegen.html_report.blocks import Grid, Pictures, Section, TableCell
from tablegen.html_report.lattice import _sine_pixels
from tablegen.html_report.page import charts_of, sections
from tablegen.html_report.pixels import pixel_section
from tablegen.html_report.planned_scan import planned_scan
from tablegen.html_report.playing import played_axes
from tablegen.html_report.ranking import ranked
from tablegen.html_report.scan_charts import scan_charts
from tablegen.html_report.scan_errors import SIDES
from tablegen.html_report.subject import Subject, of_directory
from tablegen.numerics.arrays import Floats

SHORT = (
    "timing.line_rate_hz = 5e3", "dac.update_rate_hz = 2e6", "timing.pixels = 48", "timing.lines = 16",
    "y.band_limit.harmonics = 4",
)  # fmt: skip
SINE = (*SHORT, "- x.band_limit.harmonics", "x.motion = 'sine'")
AUTO = (*SHORT, "x.motion = 'auto'", "x.band_limit.harmonics = 3")


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Directories of builds beside their scan files: a sine, "auto" that takes it, and a straight line of the axis."""
    response, found = response_csv(ForeignPlant(ManyPlays()), 150e3), {}
    for name, edits in (("sine", SINE), ("auto", AUTO), ("line", (*SHORT, "x.band_limit.harmonics = 9"))):
        folder = tmp_path_factory.mktemp(name)
        sine_scan(folder, text_of(operator_file("x")), response, *edits)
        found[name] = folder / "build"
        assert run("build", folder / "scan.toml", "-o", found[name], "-q").status == 0
    return found


def subject_of(build: Path, kind: str) -> Subject:
    """A build, or the scan file beside it."""
    return of_directory(build) if kind == "build" else planned_scan(build.parent / "scan.toml")


def off_the_grid(subject: Subject, shifted_ticks: int = 0) -> float:
    """The largest distance of the position at a pixel's middle tick from its stated place, in percent of the line.

    The mean is of the edges on the page, on the series of the manifest, summed here by its definition.
    """
    charts, ticks, worst = charts_of(sections(subject)), subject.manifest.sequence.line_ticks, 0.0
    grid = grid_of(subject)
    for edges, errors in zip(charts["pixels-position"].curves[1:], charts["pixels-error"].curves, strict=True):
        middle = place_at(subject, ((edges.x[:-1] + edges.x[1:]) / 2 + shifted_ticks) / ticks)
        along = middle if edges.role == "forward" else middle[::-1]
        worst = max(worst, float(np.max(np.abs(100.0 * (along - grid) - errors.y))))
    return worst


def grid_of(subject: Subject) -> Floats:
    """The places that pixels should have, in shares of the line."""
    imaged, count = subject.manifest.axes.x.fourier.imaged, subject.manifest.sequence.pixels
    assert imaged is not None
    return imaged[0] + (imaged[1] - imaged[0]) * (np.arange(count) + 0.5) / count


def place_at(subject: Subject, times: Floats) -> Floats:
    """The predicted position at times in lines, from the harmonics of the manifest by their definition."""
    place = subject.manifest.axes.x.fourier.place
    assert place is not None
    angle = 2.0 * np.pi * np.outer(times, np.arange(1, len(place.a) + 1))
    return place.a0 + np.cos(angle) @ np.array(place.a) + np.sin(angle) @ np.array(place.b)


@pytest.mark.parametrize(("name", "kind"), [("sine", "build"), ("sine", "file"), ("auto", "file")])
def test_pixels_of_the_page_are_where_it_says(folders: dict[str, Path], name: str, kind: str) -> None:
    subject = subject_of(folders[name], kind)
    pixels = subject.manifest.axes.x.certificate.pixels
    assert pixels is not None
    stated = max(max(map(abs, side)) for side in pixels.errors_percent.values())
    assert off_the_grid(subject) < 0.25 * stated
    assert off_the_grid(subject, shifted_ticks=1) > stated, "a tick is seen"


@pytest.mark.parametrize("name", ["sine", "auto"])
def test_a_scan_file_has_the_figures_of_its_build(folders: dict[str, Path], name: str) -> None:
    file, build = (subject_of(folders[name], kind) for kind in ("file", "build"))
    assert file.manifest == build.manifest
    assert [(one.name, one.sha256) for one in file.files] == [(one.name, one.sha256) for one in build.files]
    pages = [{part.key: part for part in sections(subject)} for subject in (file, build)]
    for key in ("certificate", "pixels", "spectrum", "quantisation"):
        its, other = (figures(page[key]) for page in pages)
        assert its == other
        for one, same in zip(charts_of([pages[0][key]]).values(), charts_of([pages[1][key]]).values(), strict=True):
            assert one.bands == same.bands
            for curve, equal in zip(one.curves, same.curves, strict=True):
                assert np.array_equal(curve.x, equal.x)
                assert np.array_equal(curve.y, equal.y)
    outcome = run("compare", folders[name].parent / "scan.toml", folders[name], "--json", "--all")
    shown = {(one["section"], one["name"]): one for one in json.loads(outcome.out)["quantities"]}
    pixels = build.manifest.axes.x.certificate.pixels
    assert pixels is not None
    assert (outcome.status, shown["x drive", "motion"]["a"]) == (0, "moves as a sine")
    scaling = shown["x pixels", "scaling error backward"]
    assert scaling["a"] == scaling["b"] == pixels.scaling_percent["backward"]
    # Control: another scan file is not this build.
    line = run("compare", folders["line"].parent / "scan.toml", folders[name])
    assert (line.status, "moves as a sine" in line.out) == (1, True)


def figures(section: Section) -> list[tuple[TableCell, ...]]:
    """All rows of tables; of the certificate without limits, which a build has not."""
    return [cells[:2] if len(cells) == 4 else cells for grid in grids(section) for cells in grid.rows]


def grids(section: Section) -> list[Grid]:
    return [block for block in section.blocks if isinstance(block, Grid)]


def test_the_simulated_sine_is_that_of_its_pixels(folders: dict[str, Path]) -> None:
    """The codes of every tick move the operator; the certificate has the position in harmonics."""
    subject = subject_of(folders["sine"], "file")
    assert subject.planned is not None
    charts, sequence = charts_of(sections(subject)), subject.manifest.sequence
    pixels, table = subject.manifest.axes.x.certificate.pixels, sequence.pixel_table
    assert pixels is not None
    assert table is not None
    scale = 1e3 / float(sequence.schedule.update_rate_hz)
    for at, (side, window) in enumerate(zip(SIDES, (sequence.forward_ticks, sequence.backward_ticks), strict=True)):
        residual, over_time = (charts[key].curves[at] for key in ("residual-x-operator", "error-x-as-built"))
        certified = np.array(pixels.errors_percent[side])
        assert np.allclose(residual.x, grid_of(subject))
        assert np.max(np.abs(residual.y - certified)) < 0.02
        assert np.max(np.abs(residual.y - np.roll(certified, 1))) > 0.2, "a pixel beside it is seen"
        edges = window[0] + np.concatenate([[0], np.cumsum(table[at])])
        assert np.allclose(over_time.x, scale * (edges[1:] + edges[:-1]) / 2)
        size_nm = subject.planned.plan.x.drive.size_nm
        in_time = residual.y if side == "forward" else residual.y[::-1]
        assert np.allclose(over_time.y, 0.01 * in_time * size_nm, rtol=1e-9, atol=1e-9)
        band = charts["drive-x"].bands[at]
        assert np.allclose((band.low, band.high), (scale * edges[0], scale * edges[-1]))
    assert "plain triangle" not in [curve.name for curve in charts["drive-x"].curves]


def test_without_correction_pixels_are_where_no_hysteresis_would_have_them(folders: dict[str, Path]) -> None:
    """A piezo without hysteresis is at sin^2(pi t); there the operator is by its harmonics, about one straight line."""
    subject = subject_of(folders["sine"], "file")
    charts, grid = charts_of(sections(subject)), grid_of(subject)
    rising = np.arccos(1.0 - 2.0 * grid) / (2.0 * np.pi)
    sides = [place_at(subject, times) for times in (rising, 1.0 - rising)]
    slope, start = np.polyfit(np.concatenate([grid, grid]), np.concatenate(sides), 1)
    tick_percent = 100.0 * np.pi / subject.manifest.sequence.line_ticks
    for at, place in enumerate(sides):
        expected = 100.0 * ((place - start) / slope - grid)
        before, built = (charts[key].curves[at].y for key in ("residual-x-uncompensated", "residual-x-operator"))
        assert np.max(np.abs(before - expected)) < 0.6 * tick_percent < 0.5 < 4.0 < np.max(np.abs(expected))
        assert np.max(np.abs(built - expected)) > 4.0, "the loop is seen"


def test_the_lattice_of_a_sine_is_straight_with_its_own_pixels_alone(folders: dict[str, Path]) -> None:
    subject = subject_of(folders["sine"], "file")
    assert subject.planned is not None
    x, y = played_axes(subject.planned)
    assert x.emitted is not None
    assert x.before is not None
    assert y.emitted is not None
    sine = subject.planned.plan.x
    for run_of_x, low, high in ((x.emitted, 0.1, 0.35), (x.before, 4.0, 8.0)):
        assert run_of_x.pixels is not None
        for _, times, at_nm, ideal_nm in _sine_pixels(run_of_x.pixels, run_of_x, sine):
            off = 100.0 * np.max(np.abs(at_nm - ideal_nm)) / sine.drive.window_nm
            assert low < off < high
            assert np.array_equal(np.sort(times)[:: 1 if times[0] < times[-1] else -1], times)
    pictures = [block for part in sections(subject) for block in part.blocks if isinstance(block, Pictures)]
    assert len(pictures[0].pictures) == 4


def test_charts_of_show_and_of_a_notebook_have_the_pixels(folders: dict[str, Path]) -> None:
    build = tablegen.build(folders["sine"].parent / "scan.toml")
    charts = {chart.key: chart for chart in build.charts().charts}
    pixels = of_directory(folders["sine"]).manifest.axes.x.certificate.pixels
    assert pixels is not None
    assert np.allclose(charts["modelled-x"].curves[0].y, pixels.errors_percent["forward"], rtol=1e-5, atol=1e-9)
    drawn = {chart.key: chart for chart in scan_charts(build.setup, build.plan, build.certificates, False).charts}
    assert drawn["drive-x"].bands == charts["drive-x"].bands
    assert np.max(np.abs(drawn["residual-x-operator"].curves[0].y - pixels.errors_percent["forward"])) < 0.02
    # The loop of the operator: the position lags behind the sine on both ways.
    forward, backward = drawn["shape-x"].curves
    assert np.max(forward.y) < 0.05 < 3.0 < np.max(backward.y)


def test_findings_of_a_sine_are_those_of_its_pixels(folders: dict[str, Path]) -> None:
    """They named `refine`, which takes no sine, and the distance of the sine from a straight line."""
    for kind in ("file", "build"):
        (finding,) = [one for one in ranked(subject_of(folders["sine"], kind)) if one.axis == "x"]
        pixels = of_directory(folders["sine"]).manifest.axes.x.certificate.pixels
        assert pixels is not None
        assert finding.code == "rounded-pixels"
        assert f"up to {max(pixels.worst_percent.values()):.3g} % of the line" in finding.text
        assert "trace and retrace" in finding.text
    codes = {one.code for one in tablegen.build(folders["sine"].parent / "scan.toml").findings if one.axis == "x"}
    assert codes == {"rounded-pixels"}


def test_a_limit_of_the_scaling_error_is_shown_beside_the_pixels(folders: dict[str, Path]) -> None:
    setup = load(folders["sine"].parent / "scan.toml")
    for limit, sign in ((5.0, "\u2717 exceeded"), (20.0, "\u2713 within")):
        limits = replace(setup.scan.limits, max_scaling_error_percent=limit)
        subject = planned_scan(replace(setup, scan=replace(setup.scan, limits=limits)), remedies=False)
        section = pixel_section(subject)
        assert section is not None
        assert [cells[-1].text for cells in grids(section)[0].rows] == [sign, sign, ""]


def test_two_sines_are_compared_pixel_by_pixel(folders: dict[str, Path]) -> None:
    sine, line = folders["sine"].parent / "scan.toml", folders["line"].parent / "scan.toml"
    pixels = of_directory(folders["sine"]).manifest.axes.x.certificate.pixels
    assert pixels is not None
    charts = {chart.key: chart for chart in comparison_charts(compared(sine, folders["auto"]))}
    for curve in charts["pixels-x-backward"].curves:
        assert curve.y.tolist() == pixels.errors_percent["backward"]
    both = {chart.key: chart for chart in comparison_charts(compared(sine, line))}
    assert "pixels-x-backward" not in both
    assert len(both["residual-x-forward"].curves[0].x) == len(grid_of(of_directory(folders["sine"])))


def test_a_line_has_no_such_section(folders: dict[str, Path]) -> None:
    assert pixel_section(of_directory(folders["line"])) is None


def test_a_sine_beside_a_line_has_the_pixels_of_its_own(folders: dict[str, Path]) -> None:
    sine, line = (scan_quantities(of_directory(folders[name])) for name in ("sine", "line"))
    shown = {one.name: one.value for one in sine if one.section == "x pixels"}
    pixels = of_directory(folders["sine"]).manifest.axes.x.certificate.pixels
    assert pixels is not None
    assert shown["rms error forward"] == pixels.rms_percent["forward"]
    assert shown["trace to retrace"] == pixels.mismatch_percent
    assert not [one for one in line if one.section == "x pixels"]
    assert run("compare", folders["sine"], folders["line"]).status == 1


def test_a_sine_with_z_has_both_sections_and_the_figures_of_its_build(tmp_path: Path) -> None:
    path = write_sine(tmp_path)
    assert run("build", path, "-o", tmp_path / "build", "-q").status == 0
    keys = [part.key for part in sections(planned_scan(path, remedies=False))]
    assert keys[:4] == ["lattice", "certificate", "pixels", "z"]
    assert run("compare", path, tmp_path / "build").status == 0
