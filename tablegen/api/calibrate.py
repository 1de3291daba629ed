"""Calibrate: measurements to parameters of a scanner file with their standard errors, and into the file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tablegen.api.image_input import (
    IMAGE_OPTIONS,
    acquisition_of,
    check_names,
    read_trace_and_retrace,
    sample_image,
    sample_of,
)
from tablegen.api.known_scanner import KnownScanner
from tablegen.api.measured import Measured, measured_list, table_of
from tablegen.api.result import Result
from tablegen.base.blas_threads import one_blas_thread
from tablegen.base.data_files import Source
from tablegen.base.input_errors import Problem, Rejected, Unphysical
from tablegen.base.reading import CONFIGURATION, RESPONSE, read_bytes, read_text
from tablegen.base.warnings import Finding, Remark
from tablegen.calibration.fit_checks import doubts
from tablegen.calibration.fit_text import calibration_text
from tablegen.calibration.fit_warnings import fit_findings
from tablegen.calibration.laws.frequency import fit_frequency
from tablegen.calibration.laws.hysteresis import fit_hysteresis
from tablegen.calibration.laws.image_sizes import apparent_of, sizes_of
from tablegen.calibration.laws.images import Pair, fit_images
from tablegen.calibration.laws.offset import fit_offset
from tablegen.calibration.laws.offset_sizes import fit_offset_sizes
from tablegen.calibration.laws.resonance import ResonanceFit, fit_resonance
from tablegen.calibration.laws.size import fit_size
from tablegen.calibration.record_checks import table_remarks, trace_remarks
from tablegen.calibration.scanner_file import new_file, updated
from tablegen.calibration.summary import change, parameters, record
from tablegen.calibration.tables.columns import (
    ACTUAL,
    APPARENT,
    DISPLACEMENT,
    DRIVE,
    FREQUENCY,
    GAIN,
    OFFSET,
    PHASE,
    SIZE,
    TIME,
    TRACE,
)
from tablegen.calibration.tables.recorder import Columns, Recorder
from tablegen.calibration.tables.response_csv import MARK, response_csv
from tablegen.calibration.tables.table import MeasuredTable
from tablegen.calibration.tables.traces import split_traces
from tablegen.charts.picture_file import PlottedCharts
from tablegen.emit.write import write_files
from tablegen.fitting.estimate import Estimate, Fit
from tablegen.images.files import ScanImage
from tablegen.images.line_timing import timing_remarks
from tablegen.images.scan_angle import angle_remarks, require_fast_axis
from tablegen.numerics.driver import Driver

Axis = Literal["x", "y"]
Kind = Literal["size", "offset", "hysteresis", "frequency", "resonance"]
_IMAGE_FIT = ("rho", "turn", "window", "retrace_mirrored", "delay_pixels")
_BASE_NM = 200.0
_OF_IMAGES: dict[str, tuple[str, ...]] = {"size": ("base_nm", "threshold"), "offset": ()}
_COLUMNS = {
    "size": ([DRIVE, ACTUAL], []),
    "offset": ([OFFSET, APPARENT], [SIZE]),
    "hysteresis": ([TIME, DRIVE, DISPLACEMENT], [TRACE]),
    "frequency": ([FREQUENCY, GAIN], []),
    "resonance": ([FREQUENCY, GAIN], [PHASE]),
}


@one_blas_thread
def calibrate(
    kind: Kind,
    data: Measured | Sequence[Measured] = (),
    *,
    axis: Axis,
    images: Sequence[tuple[Any, ...]] = (),
    scanner: str | Path | None = None,
    v_max: float | None = None,
    v_min: float = 0.0,
    points: bool = False,
    columns: Columns | None = None,
    drive_gain: float | None = None,
    drive_offset: float | None = None,
    **options: Any,
) -> "Calibrated":
    """Fit a law of the scanner to measurements: CSV files, or arrays by the names of their columns.

    Parameters
    ----------
    kind : {"size", "offset", "hysteresis", "frequency", "resonance"}
        Law to fit; docs/python.md lists the columns and options of each.
    data : path, mapping of arrays, or a sequence of them
        CSV file or arrays (n,) by column: ``drive_v`` and ``actual_nm`` of sizes; ``offset_v``, ``apparent_nm`` and
        perhaps ``size_v`` of offsets; ``time_s``, ``drive_v``, ``displacement_nm`` of hysteresis; ``frequency_hz``,
        ``gain`` and perhaps ``phase_deg`` of frequency and resonance. Volts at the piezo, drives peak to peak.
    axis : {"x", "y"}
        Axis that was measured.
    images : sequence of (volts, trace[, retrace]), of offsets (volts, offset_v, trace[, retrace])
        In place of ``data``, images of a sample of known constant: files, or heights of shape (rows, columns).
    scanner, v_max, v_min : optional
        Scanner file, which has the range of the driver and other calibrations that a fit needs; or the range in V.
    points : bool
        True to write hysteresis, or a response, as measured, in place of a law.
    columns : str or mapping, optional
        Which column is which, by number from 1 or by name: ``"time=3,drive=2,position=1:um"``, or such a mapping.
    drive_gain, drive_offset : float, optional
        V at the piezo for a recorded V, and V at the piezo for 0 V: of a recorder at the controller's output.
    **options : optional
        ``base_nm``, ``threshold``, ``noise`` of sizes, ``size_v`` of offsets, ``reference_hz`` of frequency; ``rho``,
        ``settle_periods``, ``drift_order``, ``delay_s`` of hysteresis; of ``images`` those of ``calibrate_operator``.

    Returns
    -------
    Calibrated
        Parameters with standard errors; ``write`` puts them into the scanner file.

    Raises
    ------
    Rejected
        A file or a column is wrong.
    Unphysical
        No scanner makes such data.

    Examples
    --------
    >>> sizes = tablegen.Laboratory().sizes("x", drives_v=[10, 20, 40, 60, 80, 100], rate_hz=100.0)
    >>> fit = tablegen.calibrate("size", sizes, axis="x", v_max=100.0)
    >>> fit.parameters["k_nm_per_v"].value > 0.0
    True
    """
    if kind not in _COLUMNS:
        raise ValueError(f"{kind!r} is none of {', '.join(_COLUMNS)}")
    measured = measured_list(data)
    if bool(measured) == bool(images):
        raise TypeError("give data, or images of a sample of known constant")
    if images:
        if columns is not None or drive_gain is not None or drive_offset is not None:
            raise TypeError("columns, drive_gain and drive_offset are for data; images have volts at the piezo")
        if kind not in _OF_IMAGES:
            raise TypeError(f"{kind} takes no images of a sample of known constant; calibrate_images fits hysteresis")
        check_names(options, (*IMAGE_OPTIONS, *_OF_IMAGES[kind]))
        return _of_images(kind, images, known_scanner(scanner, axis, v_max, v_min), options)
    recorder = Recorder(columns, drive_gain, drive_offset)
    tables = [table_of(one, *_COLUMNS[kind], recorder, peak_to_peak=kind == "size") for one in measured]
    if len(tables) > 1 and kind != "hysteresis":
        raise ValueError(f"{kind} takes one table; hysteresis alone takes several")
    prior = known_scanner(scanner, axis, v_max, v_min)
    remarks = measurement_remarks(kind, tables, prior, recorder, options.get("delay_s", 0.0))
    return Calibrated(with_remarks(_fit(kind, tables, prior, options), remarks), axis, tuple(tables), points)


def measurement_remarks(
    kind: Kind, tables: Sequence[MeasuredTable], scanner: KnownScanner, recorder: Recorder, delay_s: float | None = 0.0
) -> tuple[Remark, ...]:
    """Return remarks on measurements that look wrong, and on what their headers leave open.

    Raises
    ------
    Rejected
        If a fit to them would be wrong.
    """
    if kind == "hysteresis":
        return trace_remarks(tables, scanner.known(recorder, delay_s), scanner.axis)
    if kind in ("size", "offset"):
        return table_remarks(tables[0], scanner.known(recorder, own_size=kind != "size"))
    return tables[0].remarks


def with_remarks(fit: Fit, remarks: Sequence[Remark]) -> Fit:
    """Return the fit with remarks on its measurements before its own."""
    if not remarks:
        return fit
    own = [one for one in fit.remarks if not any(first.code and _same_cause(first, one) for first in remarks)]
    return replace(fit, remarks=(*remarks, *own))


def _same_cause(first: str, second: str) -> bool:
    """Return True if both say that the sensor is inverted: the check of the record says it with the remedy."""
    return all("its sign was inverted" in text for text in (first, second))


def _of_images(kind: Kind, images: Sequence[tuple[Any, ...]], prior: KnownScanner, how: dict[str, Any]) -> "Calibrated":
    """Fit sizes, or sizes at several offsets, to images of a sample of known constant."""
    sample, acquisition = sample_of(how), acquisition_of(how)
    rows = [row if kind == "offset" else (row[0], None, *row[1:]) for row in images]
    read = [sample_image(size, at, pair[0], pair[1] if pair[1:] else None, how) for size, at, *pair in rows]
    files = tuple(one for _, both in read for one in both)
    driver, size_v = prior.driver, np.array([row[0] for row in rows], dtype=np.float64)
    law = prior.size_law("the calibration of offsets by images") if kind == "offset" else None
    fit: Fit
    try:
        sizes = sizes_of([image for image, _ in read], driver, sample, acquisition)
        if law is not None:
            apparent, errors = apparent_of(sizes, law, driver, sample)
            offset_v = np.array([row[1] for row in rows], dtype=np.float64)
            offsets = fit_offset_sizes(offset_v, apparent, size_v, driver, law, errors)
            fit = replace(offsets, images=sizes.images, remarks=sizes.remarks + offsets.remarks)
        else:
            base, threshold = how.get("base_nm") or prior.number("size", "base_nm") or _BASE_NM, how.get("threshold")
            size = fit_size(size_v, sizes.nm, driver, base, threshold, errors_nm=sizes.errors_nm, shared=sizes.shared)
            fit = replace(size, images=sizes.images, remarks=sizes.remarks + size.remarks)
    except Unphysical as reason:
        raise Unphysical(f"{', '.join(dict.fromkeys(one.file for one in files))}: {reason}") from None
    return Calibrated(_with_scan_remarks(fit, files, prior.axis, how), prior.axis, files)


def known_scanner(scanner: str | Path | None, axis: str, v_max: float | None, v_min: float) -> KnownScanner:
    """Return the contents of the scanner file; with ``v_max`` it may be missing.

    Raises
    ------
    Rejected
        If the file cannot be read.
    """
    return KnownScanner.read(None if scanner is None else Path(scanner), axis, v_max, v_min, new=v_max is not None)


_PAIR_OPTIONS = ("channel", "retrace_channel", "frame", *_IMAGE_FIT)


@one_blas_thread
def calibrate_images(
    pairs: Sequence[tuple[Any, ...]],
    *,
    axis: Axis,
    scanner: str | Path | None = None,
    v_max: float | None = None,
    v_min: float = 0.0,
    points: bool = False,
    **how: Any,
) -> "Calibrated":
    """Fit hysteresis, equations (17) to (22), to trace and retrace images of a grating or a lattice.

    Parameters
    ----------
    pairs : sequence of (volts, trace) or (volts, trace, retrace)
        Scan voltage at the piezo in V, peak to peak, of a triangle; and images: files, results of ``read_image``, or
        heights of shape (rows, columns), rows in order of time, the left end of the line at the left. A file may have
        both directions.
    axis : {"x", "y"}
        Fast axis of the images.
    scanner, v_max, v_min : optional
        Scanner file, which has the range of the driver in V; or that range.
    points : bool
        True to write the hysteresis of each voltage, in place of the law (22).
    **how : optional
        ``rho``, ``turn``, ``window``, ``retrace_mirrored``, ``delay_pixels``; ``channel``, ``retrace_channel``,
        ``frame`` of files: the options of ``tablegen calibrate images``.

    Returns
    -------
    Calibrated
        Parameters with standard errors; ``write`` puts them into the scanner file.

    Raises
    ------
    Rejected
        A file cannot be read, an image has the wrong shape, or a file states a scan angle at which ``axis`` is not the
        fast axis.
    Unphysical
        No scanner makes such images, or they are not of one scan.

    Examples
    --------
    >>> fit = tablegen.calibrate_images([(20.0, "trace.npy", "retrace.npy")], axis="x", v_max=100.0)
    >>> 0.0 < fit.parameters["forward.beta_max"].value < 0.2
    True
    """
    check_names(how, _PAIR_OPTIONS)
    images = [read_trace_and_retrace(pair[1], pair[2] if len(pair) > 2 else None, how) for pair in pairs]
    files = tuple(image for both in images for image in both)
    require_fast_axis(files, axis)
    driver = known_scanner(scanner, axis, v_max, v_min).driver
    scans = [
        Pair(" and ".join(dict.fromkeys(one.source.name for one in both)), pair[0], *(one.heights for one in both))
        for pair, both in zip(pairs, images, strict=True)
    ]
    try:
        fit = fit_images(scans, driver, **{name: how[name] for name in _IMAGE_FIT if name in how})
    except Unphysical as reason:
        raise Unphysical(f"{', '.join(dict.fromkeys(one.file for one in files))}: {reason}") from None
    return Calibrated(_with_scan_remarks(fit, files, axis, how), axis, files, points)


def _with_scan_remarks(fit: Fit, images: Sequence[ScanImage], axis: str, how: dict[str, Any]) -> Fit:
    """Return the fit with remarks on scan angle, turn and window of its images before its own."""
    remarks = angle_remarks(images, axis)
    remarks += timing_remarks(images, how.get("turn", 0.5), how.get("window", (0.0, 1.0)))
    return replace(fit, remarks=(*remarks, *fit.remarks)) if remarks else fit


@dataclass(frozen=True, eq=False, repr=False)
class Calibrated(Result):
    """A fit of one kind to an axis: ``parameters`` with standard errors, ``doubts``, and changes of the scanner file.

    ``fit`` has residuals, outliers and remarks, ``measured`` the tables or images that were fitted; ``points`` is True
    if measured values are written in place of a law.
    """

    fit: Fit
    axis: str
    measured: tuple[MeasuredTable | ScanImage, ...]
    points: bool = False

    @property
    def sources(self) -> tuple[Source, ...]:
        """Names of the files with their SHA-256, each once."""
        return tuple(dict.fromkeys(one.source for one in self.measured))

    @property
    def kind(self) -> str:
        """Table of the scanner file: "size", "offset", "hysteresis", "frequency", "resonance"."""
        return change(self.fit, ()).kind

    @property
    def parameters(self) -> dict[str, Estimate]:
        """Each parameter by its key: ``value`` and ``standard_error``; twice the error covers the truth in 95 %.

        Of hysteresis at several turns the keys of the second one begin with "2: ", and so on.
        """
        estimates: dict[str, Estimate] = {}
        number = 0
        for key, estimate, _ in parameters(self.fit):
            number += key in ("turn", "size_v")
            estimates[f"{number}: {key}" if number > 1 else key] = estimate
        return estimates

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons why the fit is meaningless, in sentences with what to do; empty for one that ``write`` takes."""
        return doubts(self.fit, self.points)

    @property
    def record(self) -> dict[str, Any]:
        """The fit as plain data, as ``tablegen calibrate --json`` prints it."""
        data = record(self.fit, self.axis, self.sources)
        return data | {"findings": [one.record() for one in self.findings()]}

    def content(self, scanner: Path, driver: Driver | float | None = None, force: bool = False) -> dict[str, bytes]:
        """Return names and contents of the files that change beside ``scanner``, its own the last; nothing is written.

        A file that is missing is begun, and needs the range of the driver, or a number for ``v_max``.

        Raises
        ------
        Rejected
            If the file cannot take the values, or the fit is meaningless, unless by ``force``.
        Unphysical
            If there are no ``points``.
        """
        meaningless = self.doubts
        if meaningless and not force:
            raise Rejected([Problem(str(scanner), 0, self.axis, doubt) for doubt in meaningless])
        path, files, response = scanner.resolve(), dict[str, bytes](), ""
        if self.points and isinstance(self.fit, ResonanceFit):
            beside = scanner.with_name(f"{scanner.stem}_{self.axis}_response.csv")
            if beside.exists() and not read_bytes(beside, RESPONSE).startswith(MARK.encode("ascii")):
                raise Rejected([Problem(str(beside), 0, "", "was not written by tablegen calibrate; move it away")])
            response = beside.name
            files[response] = response_csv(self.fit, self.sources)
        if not path.exists() and driver is None:
            raise Rejected([Problem(str(scanner), 0, "v_max", "the file is not there; give v_max to begin it")])
        text = read_text(path, CONFIGURATION) if driver is None or path.exists() else new_file(path.stem, driver)
        file_change = change(self.fit, self.sources, self.points, response, bool(meaningless))
        files[path.name] = updated(text, str(scanner), self.axis, file_change).encode("utf-8")
        return files

    def write(
        self, scanner: str | Path, v_max: float | None = None, force: bool = False, v_min: float = 0.0
    ) -> list[str]:
        """Put the parameters into a scanner file, as ``tablegen calibrate --write``; return the names that changed.

        Raises
        ------
        Rejected
            As ``content``.
        Unphysical
            As ``content``.
        CannotWrite
            If a file cannot be written.
        """
        path = Path(scanner)
        files = self.content(path, None if v_max is None else Driver(v_max, v_min), force)
        *beside, own = files
        changed = write_files(path.parent, {name: files[name] for name in beside}) if beside else []
        return changed + write_files(path.resolve().parent, {own: files[own]})

    def places(self, path: bool = True) -> list[str]:
        """Return the file and line of each outlier, or its image; without ``path`` the name of the file alone."""
        if self.fit.images:
            return [self.fit.images[at].name for at in self.fit.outliers]
        first = self.measured[0]
        name = first.file if path else first.source.name
        lines = first.lines if isinstance(first, MeasuredTable) else None
        return [name if lines is None else f"{name}:{lines[at]}" for at in self.fit.outliers]

    def findings(self) -> list[Finding]:
        """Return warnings to read before the fit is trusted, the worst first."""
        return fit_findings(self.fit, self.places(), self.points)

    def summary(self) -> str:
        """Return what ``tablegen calibrate`` prints: parameters with standard errors, residuals, and warnings."""
        return "\n".join([*self.table(), *(finding.line for finding in self.findings())])

    def table(self) -> list[str]:
        """Return the lines of ``summary`` without the findings."""
        return calibration_text(self.fit, self.axis, self.measured)

    def page(self) -> bytes:
        """Return the HTML page that ``tablegen calibrate --report`` writes."""
        from tablegen.html_report.fitted import fit_page

        return fit_page(self.fit, self.axis, list(self.sources), self.places(path=False), self.points)

    def charts(self) -> PlottedCharts:
        """Return the charts that ``tablegen calibrate --plot`` draws."""
        from tablegen.html_report.fitted import fit_charts

        return fit_charts(self.fit, self.axis)

    def _lines(self) -> Sequence[str]:
        values = ", ".join(f"{key} {_estimate_text(one)}" for key, one in list(self.parameters.items())[:4])
        residual = f"residual {self.fit.rms_percent:.2g} % rms of {self.fit.before_percent:.3g} %"
        what = f"{self.axis}.{self.kind} from {self.fit.points} points"
        files = f"from {', '.join(one.name for one in self.sources)}"
        third = f"means nothing: {self.doubts[0]}" if self.doubts else files
        return f"calibration of {what}: {residual}", values, third


def _fit(kind: Kind, tables: list[MeasuredTable], scanner: KnownScanner, options: dict[str, Any]) -> Fit:
    table = tables[0]
    match kind:
        case "size":
            base = options.pop("base_nm", None) or scanner.number("size", "base_nm") or _BASE_NM
            return fit_size(table[DRIVE], table[ACTUAL], scanner.driver, base, **options)
        case "offset" if SIZE in table:
            sizes = scanner.size_law("the column size_v")
            return fit_offset_sizes(table[OFFSET], table[APPARENT], table[SIZE], scanner.driver, sizes, **options)
        case "offset":
            size_v = options.pop("size_v", None)
            law = None if size_v is None else scanner.size_law("size_v")
            return fit_offset(table[OFFSET], table[APPARENT], scanner.driver, law, size_v, **options)
        case "hysteresis":
            return fit_hysteresis([trace for one in tables for trace in split_traces(one)], scanner.driver, **options)
        case "frequency":
            reference = options.pop("reference_hz", None) or scanner.number("frequency", "reference_hz")
            return fit_frequency(table[FREQUENCY], table[GAIN], reference, **options)
        case "resonance":
            return fit_resonance(table[FREQUENCY], table[GAIN], table.columns.get(PHASE.name), **options)


def _estimate_text(estimate: Estimate) -> str:
    significant = estimate.standard_error > 1e-9 * abs(estimate.value)  # not nan, nor of a turn, which is as it was set
    return f"{estimate.value:.5g}" + (f" \u00b1 {estimate.standard_error:.2g}" if significant else "")
