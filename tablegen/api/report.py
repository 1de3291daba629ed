"""A scan or a build as one HTML page, and its charts."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from tablegen.api.result import Result
from tablegen.base.input_errors import Problem, Rejected
from tablegen.base.warnings import Finding
from tablegen.charts.chart import Chart
from tablegen.charts.picture_file import PlottedCharts
from tablegen.config.load import load
from tablegen.emit.write import write_files
from tablegen.html_report.page import answers, charts_of, page, sections
from tablegen.html_report.planned_scan import planned_scan
from tablegen.html_report.ranking import ranked
from tablegen.html_report.subject import OwnImage, Subject, of_directory
from tablegen.html_report.turned_page import turned_answers, turned_findings, turned_page, turned_sections
from tablegen.html_report.turned_subject import TurnedSubject, turned_directory, turned_scan
from tablegen.html_report.verify_record import VerifyRecord, read_record
from tablegen.manifest.turned import is_turned


def report(
    source: str | Path,
    *,
    verified: str | Path | None = None,
    image: str | Path | None = None,
    channel: str | int | None = None,
    progress: Callable[[str], object] = lambda _: None,
) -> "ReportPage":
    """Make the HTML page of a scan or of a build: findings, certificate, charts, calibration and files.

    Parameters
    ----------
    source : str or Path
        Scan file, or directory of a build; of a build the page has neither limits nor errors on the scanner.
    verified : str or Path, optional
        File that ``tablegen verify DIR --junit FILE`` wrote, to show it too.
    image : str or Path, optional
        Image file of your own, to show beside the prediction; at most 256 pixels of a side are taken into the page.
    channel : str or int, optional
        Title or number of its channel, in a file that has several.
    progress : callable
        Called with a text for each stage.

    Returns
    -------
    ReportPage
        ``content`` is the page, ``findings`` the warnings, the worst first, ``broken`` the limits that are exceeded.

    Raises
    ------
    Rejected
        The scan, ``verified`` or ``image`` is wrong.
    NotABuild
        The directory holds no build.

    Examples
    --------
    >>> page = tablegen.report("scan.toml")
    >>> page.write("report.html")
    ['report.html']
    """
    source, record = Path(source), None
    if verified is not None:
        try:
            record = read_record(Path(verified))
        except OSError as error:
            raise Rejected([Problem(str(verified), 0, "", f"cannot be read: {error.strerror or error}")]) from None
        except ValueError as error:
            raise Rejected([Problem(str(verified), 0, "", str(error))]) from None
    own = None if image is None else _own_image(Path(image), channel)
    subject = _subject(source, record, progress)
    if isinstance(subject, TurnedSubject):
        if own is not None:
            why = "an image of yours is shown beside scans at 0 degrees alone; leave --image out"
            raise Rejected([Problem(own.name, 0, "", why)])
        return ReportPage(subject, progress)
    return ReportPage(replace(subject, image=own), progress)


def _subject(source: Path, record: VerifyRecord | None, progress: Callable[[str], object]) -> Subject | TurnedSubject:
    if source.is_dir():
        return turned_directory(source, record) if is_turned(source) else of_directory(source, record)
    setup = load(source)
    return turned_scan(setup, record, progress) if setup.mixes_motions else planned_scan(setup, record, progress)


def _own_image(path: Path, channel: str | int | None) -> OwnImage:
    from tablegen.images.files import read_image

    read = read_image(path, None if channel is None else str(channel), "trace")
    size_nm = None if read.width_nm is None or read.height_nm is None else (read.width_nm, read.height_nm)
    return OwnImage(path.name, read.channel, read.heights, read.unit, size_nm, read.first_row == "bottom")


class ReportPage(Result):
    """The page of a scan or of a build: ``content`` in HTML, and every chart by its name in ``figures``."""

    def __init__(self, subject: Subject | TurnedSubject, progress: Callable[[str], object] = lambda _: None) -> None:
        self.subject = subject
        if isinstance(subject, TurnedSubject):
            parts = turned_sections(subject, progress)
            self.content = turned_page(subject, parts)
        else:
            parts = sections(subject, progress)
            self.content = page(subject, parts)
        """The page: one file that needs no network and no other file."""
        self.figures: dict[str, Chart] = charts_of(parts)

    @property
    def answers(self) -> list[str]:
        """The lines that the page begins with: the error of each axis, and the time; empty for a build."""
        return turned_answers(self.subject) if isinstance(self.subject, TurnedSubject) else answers(self.subject)

    @property
    def findings(self) -> list[Finding]:
        """Warnings to read before the image is trusted, the worst first."""
        return turned_findings(self.subject) if isinstance(self.subject, TurnedSubject) else ranked(self.subject)

    @property
    def broken(self) -> tuple[str, ...]:
        """Limits of the scan file that the certificate exceeds; empty for a build, which has none."""
        return () if self.subject.planned is None else tuple(map(str, self.subject.planned.broken))

    @property
    def record(self) -> dict[str, Any]:
        """Name and hash of the plan, the findings, the limits that are exceeded, and the names of the charts."""
        manifest = self.subject.manifest
        return {
            "name": manifest.name,
            "hash": manifest.hash,
            "findings": [{"weight": one.weight, **one.record()} for one in self.findings],
            "broken": list(self.broken),
            "figures": list(self.figures),
        }

    def summary(self) -> str:
        """Return the findings of the page, the worst first."""
        findings = [one.line for one in self.findings] or ["no findings"]
        return "\n".join([*self.answers, *findings])

    def charts(self) -> PlottedCharts:
        """Return all charts of the page."""
        return PlottedCharts(self.subject.manifest.name, tuple(self.figures.values()))

    def write(self, path: str | Path) -> list[str]:
        """Write the page, and return the name if the file changed.

        Raises
        ------
        Rejected
            If the name ends in .toml, as that of a scan or scanner file.
        CannotWrite
            If the file cannot be written.
        """
        path = Path(path)
        if path.suffix == ".toml":
            why = "the page would replace a scan or a scanner file; give a name in .html"
            raise Rejected([Problem(str(path), 0, "", why)])
        return write_files(path.parent, {path.name: self.content})

    def _lines(self) -> Sequence[str]:
        first = self.findings[0].text if self.findings else "no findings"
        size = f"{len(self.content) / 1000:.0f} kB, {len(self.figures)} charts"
        return f"report of {self.subject.manifest.name!r}: {size}", f"{len(self.findings)} findings, the first:", first
