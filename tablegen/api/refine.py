"""Refine a scan: a trace or images of the running scan to a layer over the model, a round of learning."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Literal

import msgspec

from tablegen.api.image_input import ImageSource, check_names, read_trace_and_retrace, sample_of
from tablegen.api.measured import Measured, table_of
from tablegen.api.result import Result
from tablegen.base.blas_threads import one_blas_thread
from tablegen.base.data_files import Source
from tablegen.base.input_errors import Problem, Rejected
from tablegen.base.reading import CONFIGURATION, read_text
from tablegen.base.warnings import Finding, of_remarks, worst_first
from tablegen.calibration.record_checks import WrongRecord
from tablegen.calibration.tables.columns import DISPLACEMENT, DRIVE, TIME
from tablegen.calibration.tables.recorder import AS_WRITTEN, Columns, Recorder
from tablegen.certificate.error_answer import ErrorAnswer
from tablegen.charts.picture_file import PlottedCharts
from tablegen.config.load import Setup, load
from tablegen.emit.write import write_files
from tablegen.images.scan_angle import running_scan_remarks
from tablegen.refinement.comment import provenance
from tablegen.refinement.image_round import refine_images, refine_mismatch
from tablegen.refinement.lattice_line import ImageOptions
from tablegen.refinement.round import Options, Round, with_refinement
from tablegen.refinement.round import refine as learn_from
from tablegen.refinement.round_text import refine_record, refine_text, round_answer
from tablegen.refinement.scan_file import KEY, rounds_of, with_layer


@one_blas_thread
def refine(
    scan: str | Path | Setup,
    trace: Measured | None = None,
    *,
    axis: Literal["x", "y"],
    images: Sequence[tuple[ImageSource, ...]] = (),
    triggered: bool = False,
    mismatch: bool = False,
    columns: Columns | None = None,
    drive_gain: float | None = None,
    drive_offset: float | None = None,
    **how: Any,
) -> "RefinedScan":
    """Correct the remaining error of the scanner's model, from a trace or from images of the running scan.

    Parameters
    ----------
    scan : path or Setup
        Scan whose build was recorded.
    trace : path or mapping of arrays, optional
        Several periods of ``time_s`` in s, ``displacement_nm`` in nm and ``drive_v`` in V at the piezo, (n,) each.
    axis : {"x", "y"}
        Axis to correct.
    images : sequence of (trace,) or (trace, retrace)
        In place of ``trace``, frames of a grating or a lattice: files, or heights of shape (rows, columns).
    triggered : bool
        True if time 0 of the trace is a line start, of y a frame start; ``drive_v`` is not needed then.
    mismatch : bool
        True if the sample of ``images`` has no period: only the difference of trace and retrace is corrected.
    columns : str or mapping, optional
        Which column of ``trace`` is which, by number from 1 or by name: ``"time=3,drive=2,position=1:um"``.
    drive_gain, drive_offset : float, optional
        V at the piezo for a recorded V, and V at the piezo for 0 V: of a recorder at the controller's output.
    **how : optional
        ``gain``, ``harmonics``; of a trace ``period_s``, ``delay_s``, ``settle_periods``, ``drift_order``; of images
        ``lattice_nm``, ``lattice``, ``cell``, ``pitch_nm``, ``angle_deg``, ``retrace_mirrored``, ``delay_pixels``,
        ``channel``, ``retrace_channel``, ``frame``.

    Returns
    -------
    RefinedScan
        ``setup`` has the new layer; ``write`` puts it into the scan file.

    Raises
    ------
    Rejected
        A file is wrong, a column is missing, or images do not show which periods of trace and retrace belong together;
        where their delay is known, ``delay_pixels`` decides, 0 if they are not late.
    Unphysical
        The measurement is not of this scan.

    Examples
    --------
    >>> trace = tablegen.Laboratory(like="scanner.toml").running_trace("scan.toml", "x")
    >>> refined = tablegen.refine("scan.toml", trace, axis="x")
    >>> refined.after_percent < refined.before_percent  # rms, percent of the line
    True
    """
    if (trace is None) == (not images):
        raise TypeError("give trace, of a sensor, or images; one of them")
    check_names(how, (*_LEARNING, *(_OF_IMAGES if images else _OF_TRACES)))
    setup = scan if isinstance(scan, Setup) else load(scan)
    if setup.mixes_motions:
        why = "a scan at an angle, on coupled axes or with drift is refined by `refine_turned`"
        raise Rejected([setup.scan_file.problem("name", why)])
    path = None if isinstance(scan, Setup) else Path(scan)
    text = "" if path is None else read_text(path, CONFIGURATION)
    options = Options(**{name: how[name] for name in (*_LEARNING, *_OF_TRACES) if name in how})
    recorder = Recorder(columns, drive_gain, drive_offset)
    if trace is None:
        if recorder != AS_WRITTEN:
            raise TypeError("columns, drive_gain and drive_offset are for trace")
        result, sources = _of_images(setup, axis, images, options, mismatch, how)
        return RefinedScan(result, sources, path, text)
    if axis == "y" and setup.scan.y.off:
        raise Rejected([setup.scan_file.problem("y.motion", "'off' keeps y where it is: it has nothing to refine")])
    table = table_of(trace, [TIME, DISPLACEMENT], [DRIVE], recorder)
    if DRIVE not in table and not triggered:
        why = "missing; or give --triggered if time 0 is a line start"
        raise Rejected([Problem(table.file, max(int(table.lines[0]) - 1, 0), DRIVE.name, why)])
    drive = None if triggered else table[DRIVE]
    try:
        result = learn_from(setup, axis, table[TIME], table[DISPLACEMENT], drive, options, recorder.states_gain)
    except WrongRecord as fault:
        raise Rejected([Problem(table.file, 0, "", str(fault)).coded(fault.code, axis)]) from None
    result = replace(result, remarks=(*table.remarks, *result.remarks))
    return RefinedScan(result, (table.source,), path, text)


_LEARNING = ("gain", "harmonics")
_OF_TRACES = ("period_s", "delay_s", "settle_periods", "drift_order")
_CONSTANTS = ("lattice_nm", "cell", "pitch_nm", "angle_deg")
_OF_IMAGES = (*_CONSTANTS, "lattice", "retrace_mirrored", "delay_pixels", "channel", "retrace_channel", "frame")


def _of_images(
    setup: Setup,
    axis: Literal["x", "y"],
    images: Sequence[tuple[ImageSource, ...]],
    options: Options,
    mismatch: bool,
    how: dict[str, Any],
) -> tuple[Round, tuple[Source, ...]]:
    if setup.scan.y.off:
        raise Rejected([setup.scan_file.problem("y.motion", "'off' makes a line scan, which takes no images")])
    has_constant = any(how.get(name) is not None for name in _CONSTANTS)
    if mismatch and has_constant:
        raise TypeError("mismatch is for a sample without a period; it has no constant")
    pairs = [read_trace_and_retrace(pair[0], pair[1] if pair[1:] else None, how) for pair in images]
    heights = [(one.heights, other.heights) for one, other in pairs]
    delay = how.get("delay_pixels")
    stored = ImageOptions(bool(how.get("retrace_mirrored", False)), None if delay is None else float(delay))
    sources = tuple(image.source for pair in pairs for image in pair)
    result: Round
    if mismatch:
        result = refine_mismatch(setup, axis, heights, options, stored)
    else:
        try:
            result = refine_images(setup, axis, heights, options, stored, sample_of(how) if has_constant else None)
        except WrongRecord as fault:
            names = " and ".join(dict.fromkeys(image.file for pair in pairs for image in pair))
            raise Rejected([Problem(names, 0, "", str(fault)).coded(fault.code, axis)]) from None
    remarks = running_scan_remarks(image for pair in pairs for image in pair)
    return replace(result, remarks=(*remarks, *result.remarks)), sources


@dataclass(frozen=True, eq=False, repr=False)
class RefinedScan(Result):
    """A round: ``setup`` is the scan with the new layer, ``refused`` the reason if it must not be used.

    ``round`` has residuals and remarks; ``scan`` and ``text`` are the scan file and its text before the round.
    ``stopped`` is the reason if learning ends here: the scaling error rose, and the layer of the best round is used.
    """

    round: Round
    sources: tuple[Source, ...]
    scan: Path | None = None
    text: str = ""
    key: ClassVar[str] = KEY

    @property
    def setup(self) -> Setup:
        """The scan with the new layer, or the best one: ``tablegen.build(refined.setup)`` needs no file."""
        result = self.round
        return result.setup if result.best is None else with_refinement(result.setup, result.line.axis, result.best)

    @property
    def stopped(self) -> str:
        """The reason why no further layer is to be played, empty where one is."""
        return self.round.stopped

    @property
    def before_percent(self) -> float:
        """The measured residual, rms, in percent of the line."""
        return self.round.update.before.rms_percent

    @property
    def after_percent(self) -> float:
        """The residual that is predicted for the next trace, rms, in percent of the line."""
        return self.round.update.after.rms_percent

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on the trace or the images, in sentences."""
        return self.round.remarks

    @property
    def earlier(self) -> list[str]:
        """The comments of the rounds before in the scan file."""
        axis = self.round.line.axis
        return [] if self.round.line.layer is None or not self.text else rounds_of(self.text, str(self.scan), axis)

    @property
    def refused(self) -> str:
        """The reason why the round must not be used: an error grew, or the measurement was used before; or empty."""
        if self.round.worse:
            return self.round.worse
        if self.round.stopped and self.round.best is None:
            return self.round.stopped
        if not any(source.sha256 in row for row in self.earlier for source in self.sources):
            return ""
        what = "this trace" if len(self.sources) == 1 else "these images"
        return f"[{self.round.line.axis}.refinement] was already refined by {what}; build, upload and record again"

    def content(self, force: bool = False) -> bytes:
        """Return the scan file with the new layer; empty if the round changes nothing.

        Where the round stopped it is the file with the best layer, unless by ``force``.

        Raises
        ------
        Rejected
            If the file cannot be edited.
        ValueError
            If the scan was given as a setup, without a file.
        """
        if self.scan is None:
            raise ValueError("the scan was given as a setup; give the path of its file to write into it")
        result = self.round
        best = None if force else result.best
        if best is None and (result.refinement is None or not result.update.harmonics):
            return b""
        plain = msgspec.json.decode(msgspec.json.encode(best or result.refinement))
        values = {key: value for key, value in plain.items() if value is not None}  # as a file has it
        comment = provenance(result, self.sources, stopped=best is not None)
        return with_layer(self.text, str(self.scan), result.line.axis, values, comment).encode("utf-8")

    def write(self, force: bool = False) -> list[str]:
        """Put the layer into the scan file, as ``tablegen refine --write`` does, and return the names that changed.

        Raises
        ------
        Rejected
            If the round is refused, unless by ``force``, or the file cannot be edited.
        CannotWrite
            If the file cannot be written.
        """
        if self.refused and not force:
            raise Rejected([Problem(str(self.scan or ""), 0, self.round.line.axis, self.refused)])
        content = self.content(force)
        path = Path() if self.scan is None else self.scan.resolve()
        return write_files(path.parent, {path.name: content}) if content else []

    @property
    def record(self) -> dict[str, Any]:
        """The round as plain data, as ``tablegen refine --json`` prints it."""
        return refine_record(self.round, self._name, list(self.sources))

    @property
    def _name(self) -> str:
        return self.round.setup.scan.name

    def findings(self) -> list[Finding]:
        """Return warnings to read before the round is used, the worst first."""
        return worst_first(of_remarks(self.round.remarks))

    @property
    def answer(self) -> ErrorAnswer:
        """The error of the axis that this measurement shows, in percent, nm and pixels, and the next step."""
        return round_answer(self.round)

    def table(self) -> list[str]:
        """Return the lines of ``summary`` without the findings."""
        return refine_text(self.round, self._name, list(self.sources))

    def summary(self) -> str:
        """Return what ``tablegen refine`` prints: errors before and after, and warnings."""
        return "\n".join([*self.table(), *(finding.line for finding in self.findings())])

    def charts(self) -> PlottedCharts:
        """Return the charts that ``tablegen refine --plot`` draws."""
        from tablegen.html_report.round_page import round_charts

        return round_charts(self.round, self._name)

    def page(self) -> bytes:
        """Return the HTML page that ``tablegen refine --report`` writes."""
        from tablegen.html_report.round_page import round_page

        return round_page(self.round, self._name, list(self.sources), self.earlier, self.refused)

    def _lines(self) -> Sequence[str]:
        third = f"from {', '.join(dict.fromkeys(one.name for one in self.sources))}"
        if self.refused:
            third = f"not to be used: {self.refused}"
        elif self.stopped:
            third = f"stopped: {self.stopped}"
        residual = f"{self.after_percent:.2g} % rms predicted after it"
        title = f"refinement of {self.round.line.axis} of {self._name!r}"
        return title, str(self.answer), f"{residual}, {third}"
