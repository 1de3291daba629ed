"""The page of a scan or a build: its sections in order, and the verdict above them."""

from collections.abc import Callable

from tablegen.certificate.error_answer import first_lines
from tablegen.charts.chart import Chart
from tablegen.html_report.basis import basis
from tablegen.html_report.blocks import Charts, Section, TableCell
from tablegen.html_report.corrections import corrections
from tablegen.html_report.document import document
from tablegen.html_report.lattice import lattice
from tablegen.html_report.lines import lines
from tablegen.html_report.own_image import with_own_image
from tablegen.html_report.pixels import pixel_section
from tablegen.html_report.playing import played_axes
from tablegen.html_report.promises import certificate
from tablegen.html_report.ranking import Finding, ranked
from tablegen.html_report.request import files, request_section, verification
from tablegen.html_report.scan_errors import errors
from tablegen.html_report.spectrum import quantisation, spectrum
from tablegen.html_report.subject import Subject
from tablegen.html_report.tilt import shown_tilts, tilt_section
from tablegen.html_report.usable import usable

Tell = Callable[[str], object]


def sections(subject: Subject, tell: Tell = lambda _: None) -> list[Section]:
    """Return all sections of the page, the most important first."""
    planned = subject.planned
    if planned is None:
        own = with_own_image(subject, None)
        parts = [
            *([] if own is None else [own]),
            request_section(subject),
            certificate(subject),
            *_of_pixels(subject),
            *_of_tilts(subject),
            lines(subject, None),
            spectrum(subject),
            quantisation(subject),
        ]
        return [*parts, corrections(subject), verification(subject), files(subject)]
    tell("simulating the scan on the scanner of the scanner file")
    axes = played_axes(planned)
    tell("drawing")
    picture = with_own_image(subject, lattice(planned, axes))
    return [
        *([] if picture is None else [picture]),
        certificate(subject),
        *_of_pixels(subject),
        *_of_tilts(subject),
        request_section(subject),
        lines(subject, axes),
        errors(planned, axes),
        spectrum(subject),
        quantisation(subject),
        corrections(subject),
        usable(planned),
        basis(planned),
        verification(subject),
        files(subject),
    ]


def _of_pixels(subject: Subject) -> list[Section]:
    """Return the section of the pixels of a sine; empty without a sine."""
    section = pixel_section(subject)
    return [] if section is None else [section]


def _of_tilts(subject: Subject) -> list[Section]:
    """Return the sections of the outputs beside x and y; empty without any."""
    limit = None if subject.planned is None else subject.planned.plan.limits.max_error_lsb
    return [tilt_section(tilt, limit) for tilt in shown_tilts(subject)]


def charts_of(parts: list[Section]) -> dict[str, Chart]:
    """Return every chart of a page by its key."""
    blocks = (block for section in parts for block in section.blocks if isinstance(block, Charts))
    return {chart.key: chart for block in blocks for chart in block.charts}


def page(subject: Subject, parts: list[Section]) -> bytes:
    """Render the page of a scan, without a date or a folder of this machine: the same subject gives the same bytes."""
    manifest, planned = subject.manifest, subject.planned
    findings = ranked(subject)
    notice = ""
    if planned is None:
        notice = (
            "This page is made of a build alone. Give `tablegen report` the scan file to see limits, errors on the "
            "scanner, the usable area and the calibration as well."
        )
    title = manifest.name if planned is None else f"{manifest.name} on {planned.setup.scanner.name}"
    foot = (
        f"Plan {manifest.hash}, tablegen {manifest.tablegen}. All is computed from the scan and the scanner file; what "
        "is called measured stands in them."
    )
    return document(title, _verdict(subject, findings), findings, parts, notice, foot, answers(subject))


def answers(subject: Subject) -> list[str]:
    """Return the error of each axis and the time of an image; empty for a build, which has no scan file."""
    planned = subject.planned
    if planned is None:
        return []
    return first_lines(planned.setup, planned.plan, planned.certificates)


def _verdict(subject: Subject, findings: list[Finding]) -> TableCell:
    """Return the result of the page in a sentence."""
    broken, spoils = (sum(one.weight == weight for one in findings) for weight in ("limit", "spoils"))
    if broken:
        which = "the first point below is" if broken == 1 else f"the first {broken} points below are"
        return TableCell(f"\u2717 Do not use it before {which} corrected.", "bad")
    if spoils:
        what = "one thing spoils" if spoils == 1 else f"{spoils} things spoil"
        return TableCell(f"! It can be played, but {what} the image.", "warn")
    if subject.planned is None:
        return TableCell("\u2713 No warning.", "good")
    limits = "within all limits of the scan file" if subject.planned.limited else "the scan file sets no limits"
    return TableCell(f"\u2713 No warning; {limits}.", "good")
