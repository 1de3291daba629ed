"""Builds of a sine on a page and side by side: pixels on the predicted position, their lengths and errors."""

from pathlib import Path

import numpy as np
import pytest
from editing import run
from foreign_plants import ForeignPlant, ManyPlays
from operator_files import operator_file
from sine_scans import response_csv, sine_scan, text_of

from tablegen.comparison.scans import scan_quantities
from tablegen.html_report.page import charts_of, sections
from tablegen.html_report.pixels import pixel_section
from tablegen.html_report.subject import Subject, of_directory

SHORT = (
    "timing.line_rate_hz = 5e3", "dac.update_rate_hz = 2e6", "timing.pixels = 48", "timing.lines = 16",
    "y.band_limit.harmonics = 4",
)  # fmt: skip
SINE = (*SHORT, "- x.band_limit.harmonics", "x.motion = 'sine'")


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Directories of builds: a sine, and a straight line of the same axis."""
    response, found = response_csv(ForeignPlant(ManyPlays()), 150e3), {}
    for name, edits in (("sine", SINE), ("line", (*SHORT, "x.band_limit.harmonics = 9"))):
        folder = tmp_path_factory.mktemp(name)
        sine_scan(folder, text_of(operator_file("x")), response, *edits)
        found[name] = folder / "build"
        assert run("build", folder / "scan.toml", "-o", found[name], "-q").status == 0
    return found


def off_the_grid(subject: Subject, shifted_ticks: int = 0) -> float:
    """The largest distance of the position at a pixel's middle tick from its stated place, in percent of the line.

    The mean is of the edges on the page, on the series of the manifest, summed here by its definition.
    """
    charts, x = charts_of(sections(subject)), subject.manifest.axes.x
    place, imaged, ticks = x.fourier.place, x.fourier.imaged, subject.manifest.sequence.line_ticks
    assert place is not None
    assert imaged is not None
    count = subject.manifest.sequence.pixels
    grid = imaged[0] + (imaged[1] - imaged[0]) * (np.arange(count) + 0.5) / count
    n, worst = np.arange(1, len(place.a) + 1), 0.0
    for edges, errors in zip(charts["pixels-position"].curves[1:], charts["pixels-error"].curves, strict=True):
        angle = 2.0 * np.pi * np.outer((edges.x[:-1] + edges.x[1:]) / 2 + shifted_ticks, n) / ticks
        middle = place.a0 + np.cos(angle) @ np.array(place.a) + np.sin(angle) @ np.array(place.b)
        along = middle if edges.role == "forward" else middle[::-1]
        worst = max(worst, float(np.max(np.abs(100.0 * (along - grid) - errors.y))))
    return worst


def test_pixels_of_the_page_are_where_it_says(folders: dict[str, Path]) -> None:
    subject = of_directory(folders["sine"])
    pixels = subject.manifest.axes.x.certificate.pixels
    assert pixels is not None
    stated = max(max(map(abs, side)) for side in pixels.errors_percent.values())
    assert off_the_grid(subject) < 0.25 * stated
    assert off_the_grid(subject, shifted_ticks=1) > stated, "a tick is seen"


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
