"""Build a scan from a scan file, or from values: its plan, certificate, arrays and files."""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from tablegen.api.result import Result
from tablegen.base.input_errors import Rejected
from tablegen.base.warnings import Finding
from tablegen.certificate.certificate import Certificate, EmittedPeriods
from tablegen.certificate.certificate import certify as certify_plan
from tablegen.certificate.certified_scan import CertifiedScan, certify_planned, certify_scan
from tablegen.certificate.error_answer import ErrorAnswer, duration, error_answers, first_lines
from tablegen.certificate.scan_notes import scan_findings
from tablegen.certificate.scan_text import scan_text
from tablegen.certificate.scan_warnings import brief_warnings, scan_warnings
from tablegen.certificate.summary import summary as summary_of
from tablegen.config.load import Setup, from_values
from tablegen.config.load import load as load_files
from tablegen.emit.format import Format
from tablegen.emit.formats import UnknownFormat, chosen
from tablegen.emit.render import format_rejected, render_scan, runtime_files
from tablegen.emit.write import leftover_files, outdated_files, write_files
from tablegen.manifest.format import MANIFEST, read_json
from tablegen.planning.line_plan import Plan, make_plan
from tablegen.planning.sine_setup import default_formats

if TYPE_CHECKING:
    from tablegen.api.samples import Samples
    from tablegen.charts.picture_file import PlottedCharts
    from tablegen.link.prepare import PreparedScan

Source = str | Path | Setup


class BrokenLimit(Rejected):
    """A certificate exceeds a limit of the scan file; ``problems`` names each, with a remedy."""


def load(path: str | Path) -> Setup:
    """Read a scan file and the scanner file that it names.

    Parameters
    ----------
    path : str or Path
        Scan file.

    Returns
    -------
    Setup
        Both files as checked values.

    Raises
    ------
    Rejected
        With every fault of both files, each at its file, line and key.

    Examples
    --------
    >>> tablegen.load("scan.toml").scan.name
    'annexin_200nm'
    """
    return load_files(path)


def plan(
    source: Source | None = None,
    *,
    scan: Mapping[str, Any] | None = None,
    scanner: Mapping[str, Any] | None = None,
) -> Plan:
    """Compensate, shape and quantise a scan: of a scan file, of a setup, or of values without any file.

    Parameters
    ----------
    source : path or Setup, optional
        Scan file, or a result of ``load``.
    scan, scanner : mapping, optional
        In place of ``source`` the keys of the two files, nested: ``scan={"x": {"size_nm": 200.0, ...}, ...}``.

    Returns
    -------
    Plan
        The integers of both axes, and the inputs of the plan.

    Raises
    ------
    Rejected
        With every contradiction.

    Examples
    --------
    >>> round(tablegen.plan("scan.toml").x.drive.v_amplitude, 2)  # V peak to peak at the piezo
    20.37
    """
    return make_plan(setup_of(source, scan, scanner), sines=True)


def certify(plan: Plan) -> dict[str, Certificate]:
    """Compute the certificate of a plan: the errors of its emitted integers, at every tick.

    Parameters
    ----------
    plan : Plan
        A result of ``plan``.

    Returns
    -------
    dict of str to Certificate
        By axis, "x" and "y": errors in LSB of the converter, scaling errors in percent.

    Raises
    ------
    Rejected
        The codes leave the range of the converter.

    Examples
    --------
    >>> tablegen.certify(tablegen.plan("scan.toml"))["x"].max_error_lsb < 0.6
    True
    """
    return certify_plan(plan)


def build(
    source: Source | None = None,
    out: str | Path | None = None,
    *,
    scan: Mapping[str, Any] | None = None,
    scanner: Mapping[str, Any] | None = None,
    formats: Sequence[str] | None = None,
    progress: Callable[[str], object] = lambda _: None,
) -> "Build":
    """Plan and certify a scan, and write it into the directory ``out`` if one is given.

    Parameters
    ----------
    source, scan, scanner
        As for ``plan``.
    out : str or Path, optional
        Directory; files of an earlier build there are removed.
    formats : sequence of str, optional
        Output formats; those of the scan file unless given.
    progress : callable
        Called with a text for each stage.

    Returns
    -------
    Build
        Arrays, certificate and files.

    Raises
    ------
    Rejected
        The input is wrong.
    BrokenLimit
        The certificate exceeds a limit of the scan.
    CannotWrite
        The directory cannot be written.

    Examples
    --------
    >>> scan = tablegen.build("scan.toml", "build")
    >>> scan.x.volts.shape  # a value a tick of one line
    (1250,)
    """
    setup = setup_of(source, scan, scanner)
    output_formats = _formats(setup, formats)
    built = _built(certify_scan(setup, progress), output_formats, explicit=formats is not None)
    if out is not None:
        progress("writing the files")
        built.write(out)
    return built


def build_planned(setup: Setup, periods: EmittedPeriods) -> "Build":
    """Certify the plan of some periods, which was made of a setup; errors as of ``build``."""
    return _built(certify_planned(setup, periods.plan, periods=periods), _formats(setup, None), explicit=False)


def _built(certified: CertifiedScan, formats: Sequence[Format], *, explicit: bool) -> "Build":
    if certified.broken:
        raise BrokenLimit(list(certified.broken))
    names = [each.name for each in formats]
    return Build(certified.setup, certified.plan, certified.certificates, names, explicit)


class Build(Result):
    """A certified scan: its plan, arrays, certificate and emitted files."""

    def __init__(
        self, setup: Setup, plan: Plan, certificates: dict[str, Certificate], formats: list[str], explicit: bool
    ) -> None:
        self.setup = setup
        self.plan = plan
        self.certificates = certificates
        """By axis, "x" and "y"."""
        self.formats = formats
        self._explicit = explicit

    @property
    def name(self) -> str:
        """The scan's name, which every emitted file and identifier begins with."""
        return self.plan.name

    @cached_property
    def x(self) -> "Samples":
        """One line of x, a value a tick."""
        return self.samples("x")

    @cached_property
    def y(self) -> "Samples":
        """One frame of y, a value a tick."""
        return self.samples("y")

    def samples(self, axis: Literal["x", "y"], first: int = 0, stop: int | None = None) -> "Samples":
        """Return ticks [first, stop) of the period of an axis: for frames that have too many of them.

        Raises
        ------
        ValueError
            If the ticks are outside of the period.
        """
        from tablegen.api.samples import samples

        return samples(self.plan, axis, first, stop)

    @cached_property
    def files(self) -> dict[str, bytes]:
        """Every file by its name, the manifest last.

        Raises
        ------
        Rejected
            If a format cannot hold the scan.
        """
        return render_scan(self.setup, self.plan, self.certificates, self.formats, explicit=self._explicit)

    @property
    def runtime(self) -> set[str]:
        """The names of those files that are the same in every build: sequencers and links."""
        with_z = self.plan.z is not None
        return {name for each in chosen(self.formats) for name in runtime_files(each, with_z)}

    @property
    def manifest(self) -> str:
        """``manifest.json`` as text."""
        return self.files["manifest.json"].decode("ascii")

    @property
    def record(self) -> dict[str, Any]:
        """The manifest as plain data."""
        plain: dict[str, Any] = read_json(self.files[MANIFEST])
        return plain

    def to_json(self) -> str:
        """Return ``manifest.json`` as text."""
        return self.manifest

    def charts(self) -> "PlottedCharts":
        """Return the drive of each axis, the error of the modelled piezo with and without compensation, and z."""
        from tablegen.charts.picture_file import PlottedCharts
        from tablegen.html_report.scan_charts import charts_of_tilts, drive_of, modelled_error

        pairs = [(drive_of(line, self.plan.schedule), modelled_error(self.plan, line)) for line in self.plan.moving]
        return PlottedCharts(self.name, (*(chart for pair in pairs for chart in pair), *charts_of_tilts(self.plan)))

    @property
    def answers(self) -> list[ErrorAnswer]:
        """The error of each axis in percent, nm and pixels, where it is from, and the next step; x is the first."""
        return error_answers(self.setup, self.plan, self.certificates)

    @property
    def duration(self) -> str:
        """The time of an image, such as ``9 min 28 s an image``."""
        return duration(self.plan.schedule)

    def brief(self) -> list[str]:
        """Return the lines that every output of the scan begins with: the error of each axis, and the time."""
        return first_lines(self.setup, self.plan, self.certificates)

    def overview(self) -> str:
        """Return what ``tablegen show`` prints above its plots: the errors, and the scan in the user's words."""
        title = f"{self.plan.name} on {self.plan.scanner!r}"
        return "\n".join([*self.brief(), "", title, *scan_text(self.plan, self.certificates)])

    def summary(self) -> str:
        """Return the error of each axis, and drive and certificate of both axes, as text."""
        title = f"{self.plan.name} on {self.plan.scanner!r}"
        return "\n".join([*self.brief(), "", title, *summary_of(self.plan, self.certificates)])

    @property
    def choices(self) -> tuple[str, ...]:
        """Settings that the build chose where the scan file leaves them open, in sentences; empty if there are none."""
        return self.setup.choices

    @property
    def notes(self) -> list[str]:
        """Advice to read before the image is trusted, in sentences: the most serious first."""
        return [one.full_text for one in self.findings]

    @property
    def findings(self) -> list[Finding]:
        """The notes with weights, percentages of the scan, codes and axes, the worst first."""
        return scan_findings(self.plan, self.certificates)

    @cached_property
    def warnings(self) -> list[str]:
        """Errors above 1 %, or above that of the uncompensated line; empty if there are none.

        Each names its key, the error, its cause (quantisation, band limit or model), and the remedies that were
        planned and measured: only a scan with a warning takes this time.
        """
        return [str(warning) for warning in scan_warnings(self.setup, self.plan, self.certificates)]

    @property
    def prepared(self) -> "PreparedScan":
        """The program that ``Device.upload`` sends: ``device.upload(scan.prepared.image("auto", device.info))``."""
        from tablegen.link.prepare import PreparedScan

        return PreparedScan.of_plan(self.plan)

    def write(self, folder: str | Path) -> list[str]:
        """Write the files that differ into a directory, remove outdated ones, and return the names that changed.

        Raises
        ------
        CannotWrite
            If the directory cannot be written; its files are then unchanged.
        """
        folder = Path(folder)
        return write_files(folder, self.files, lambda: self.outdated(folder))

    def outdated(self, folder: str | Path) -> list[str]:
        """Return the files of a directory that an earlier build made and this one does not: ``write`` removes them.

        The input is never among them, whatever another manifest lists.
        """
        names = outdated_files(Path(folder), self.files)
        if not names:
            return []
        read = {path.resolve() for path in self.setup.files}
        return [name for name in names if (Path(folder) / name).resolve() not in read]

    def leftovers(self, folder: str | Path) -> list[str]:
        """Return files of a directory that look like a build's and are not of this one: ``write`` leaves them there."""
        return leftover_files(Path(folder), self.files)

    def _lines(self) -> Sequence[str]:
        first, *_ = repr(self.plan).splitlines()
        warnings = [f"warning: {text}" for text in brief_warnings(self.plan, self.certificates)]
        head = first.removeprefix("<tablegen plan")
        return f"build{head}", *(answer.brief for answer in self.answers), *warnings

    def _repr_html_(self) -> str:
        """Return drive, error and certificate, for notebooks."""
        from tablegen.api.html import build_html

        return build_html(self.plan, self.certificates)


def setup_of(source: Source | None, scan: Mapping[str, Any] | None, scanner: Mapping[str, Any] | None) -> Setup:
    """Return the setup of a scan file, of a setup, or of values.

    Raises
    ------
    TypeError
        If it is none of these, or more than one.
    """
    if source is None and scan is not None and scanner is not None:
        return from_values(scan, scanner)
    if source is None or scan is not None or scanner is not None:
        raise TypeError("give a scan file or a setup, or the values of both: scan={...}, scanner={...}")
    return source if isinstance(source, Setup) else load_files(source)


def _formats(setup: Setup, names: Sequence[str] | None) -> list[Format]:
    try:
        return chosen(default_formats(setup.scan) if names is None else names)
    except UnknownFormat as error:
        raise format_rejected(setup, str(error), explicit=names is not None) from None
