"""Refine a scan at an angle: a trace of whole frames to a layer over the operator of an axis."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Literal

import msgspec
import numpy as np

from tablegen.api.measured import Measured, table_of
from tablegen.api.result import Result
from tablegen.base.blas_threads import one_blas_thread
from tablegen.base.data_files import Source
from tablegen.base.input_errors import Problem, Rejected
from tablegen.base.reading import CONFIGURATION, read_text
from tablegen.base.warnings import Finding, of_remarks, worst_first
from tablegen.calibration.tables.columns import DISPLACEMENT, TIME
from tablegen.calibration.tables.recorder import Columns, Recorder
from tablegen.charts.chart import Chart, DrawnCurve
from tablegen.charts.picture_file import PlottedCharts
from tablegen.config.load import Setup, load
from tablegen.emit.write import write_files
from tablegen.refinement.frame_round import FrameOptions, FrameRound, refine_frame
from tablegen.refinement.learning import DEFAULT_GAIN
from tablegen.refinement.scan_file import FRAME_KEY, rounds_of, with_layer

_POINTS = 400  # of a curve


@one_blas_thread
def refine_turned(
    scan: str | Path | Setup,
    trace: Measured,
    *,
    axis: Literal["x", "y"],
    columns: Columns | None = None,
    gain: float = DEFAULT_GAIN,
    harmonics: int | None = None,
    period_s: float | None = None,
    delay_s: float = 0.0,
    settle_periods: int | None = None,
) -> "RefinedTurned":
    """Correct what the operator of an axis leaves of a scan at an angle, from a trace of whole frames.

    Each axis learns a part of the line and one of the frame. The sizes are learnt too: the sensor has to be calibrated.

    Parameters
    ----------
    scan : path or Setup
        Scan whose build was recorded.
    trace : path or mapping of arrays
        One frame or more from a frame start: ``time_s`` in s and ``displacement_nm`` in nm of the axis, (n,) each.
    axis : {"x", "y"}
        Axis to correct.
    columns : str or mapping, optional
        Which column of ``trace`` is which: ``"time=3,position=1:um"``.
    gain : float
        Share of the error that this round corrects, above 0 and below 2.
    harmonics : int, optional
        Highest harmonic of the line; by default 16 at most.
    period_s : float, optional
        Period of a frame in s by the clock of the recorder.
    delay_s : float
        Delay of the sensor in s.
    settle_periods : int, optional
        Frames to leave out at the start; by default 1 of three or more.

    Returns
    -------
    RefinedTurned
        ``setup`` has the new layer; ``write`` puts it into the scan file.

    Raises
    ------
    Rejected
        A file is wrong, or a column is missing.
    Unphysical
        The measurement is not of this scan, or of no whole frame.

    Examples
    --------
    >>> try:
    ...     refined = tablegen.refine_turned("scan.toml", "frames.csv", axis="x")
    ... except tablegen.Rejected as rejected:  # a scan that `refine` refines
    ...     print(rejected.problems[0].why)
    this scan has no angle, coupling or drift; `refine` refines it
    """
    setup = scan if isinstance(scan, Setup) else load(scan)
    if not setup.mixes_motions:
        why = "this scan has no angle, coupling or drift; `refine` refines it"
        raise Rejected([setup.scan_file.problem("name", why)])
    path = None if isinstance(scan, Setup) else Path(scan)
    text = "" if path is None else read_text(path, CONFIGURATION)
    table = table_of(trace, [TIME, DISPLACEMENT], [], Recorder(columns, None, None))
    options = FrameOptions(gain, harmonics, period_s, delay_s, settle_periods)
    result = refine_frame(setup, axis, table[TIME], table[DISPLACEMENT], options)
    result = replace(result, remarks=(*table.remarks, *result.remarks))
    return RefinedTurned(result, options, table.source, path, text)


@dataclass(frozen=True, eq=False, repr=False)
class RefinedTurned(Result):
    """A round on a scan at an angle: ``setup`` is the scan with the new layer, ``refused`` why it must not be used.

    ``round`` has the errors; ``scan`` and ``text`` are the scan file and its text before the round.
    """

    round: FrameRound
    options: FrameOptions
    source: Source
    scan: Path | None = None
    text: str = ""
    key: ClassVar[str] = FRAME_KEY
    stopped: ClassVar[str] = ""

    @property
    def setup(self) -> Setup:
        """The scan with the new layer: ``tablegen.build_turned(refined.setup)`` needs no file."""
        return self.round.setup

    @property
    def before_percent(self) -> float:
        """The measured error, rms, in percent of the longer motion of the axis."""
        return self.round.before_percent

    @property
    def after_percent(self) -> float:
        """The error that is predicted for the next trace, rms, in percent of the longer motion of the axis."""
        return self.round.after_percent

    @property
    def earlier(self) -> list[str]:
        """The comments of the rounds before in the scan file."""
        axis = self.round.axis
        has_layer = axis.motion.layer is not None and self.text
        return rounds_of(self.text, str(self.scan), axis.axis, FRAME_KEY) if has_layer else []

    @property
    def refused(self) -> str:
        """The reason why the round must not be used: the error grew, or the trace was used before; or empty."""
        if self.round.worse or not any(self.source.sha256 in row for row in self.earlier):
            return self.round.worse
        return f"[{self.round.axis.axis}.{FRAME_KEY}] was already refined by this trace; build, upload and record again"

    def content(self, force: bool = False) -> bytes:
        """Return the scan file with the new layer; empty if the round changes nothing. ``force`` changes nothing here.

        Raises
        ------
        Rejected
            If the file cannot be edited.
        ValueError
            If the scan was given as a setup, without a file.
        """
        if self.scan is None:
            raise ValueError("the scan was given as a setup; give the path of its file to write into it")
        if self.round.refinement is None:
            return b""
        plain = msgspec.to_builtins(self.round.refinement)
        values = {key: list(value) if isinstance(value, tuple) else value for key, value in plain.items()}
        name = self.source.name if self.source.name.isprintable() else ascii(self.source.name)
        comment = (
            f"{name}, sha256 {self.source.sha256}, {self.round.frames:.4g} frames, error {self.before_percent:.3g} % "
            f"rms, gain {self.options.gain:g}"
        )
        axis = self.round.axis.axis
        return with_layer(self.text, str(self.scan), axis, values, comment, FRAME_KEY).encode("utf-8")

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
            raise Rejected([Problem(str(self.scan or ""), 0, self.round.axis.axis, self.refused)])
        content, path = self.content(force), Path() if self.scan is None else self.scan.resolve()
        return write_files(path.parent, {path.name: content}) if content else []

    @property
    def record(self) -> dict[str, Any]:
        """The round as plain data, as ``tablegen refine --json`` prints it."""
        one = self.round
        return {
            "scan": one.setup.scan.name,
            "axis": one.axis.axis,
            "angle_deg": one.setup.scan.angle_deg,
            "source": {"file": self.source.name, "sha256": self.source.sha256},
            "frames": one.frames,
            "samples": one.samples,
            "gain": self.options.gain,
            "line_nm": one.axis.motion.fast_nm,
            "frame_nm": one.axis.motion.slow_nm,
            "before_percent": one.before_percent,
            "after_percent": one.after_percent,
            "noise_percent": one.noise_percent,
            "beside_percent": one.beside_percent,
            "line_percent": one.line_percent,
            "frame_percent": one.frame_percent,
            "learnt": one.refinement is not None,
            "refused": self.refused or None,
            "remarks": [finding.line for finding in self.findings()],
        }

    def findings(self) -> list[Finding]:
        """Return warnings to read before the round is used, the worst first."""
        return worst_first(of_remarks(self.round.remarks))

    def table(self) -> list[str]:
        """Return the lines of ``summary`` without the findings."""
        one, motion = self.round, self.round.axis.motion
        lines = [
            f"{one.setup.scan.name} at {one.setup.scan.angle_deg:g} degrees: refinement of {one.axis.axis} from "
            f"{self.source.name}, {one.frames:.4g} frames, {one.samples} samples",
            f"{'error, rms [% of ' + format(motion.longest_nm, '.4g') + ' nm]':<34}{one.before_percent:8.3f}",
            f"{'  predicted after this round':<34}{one.after_percent:8.3f}",
            f"{'  its standard error':<34}{one.noise_percent:8.3f}",
            f"{'beside it, rms: noise and the rest':<34}{one.beside_percent:8.3f}",
        ]
        for name, nm, percent in (
            ("line", motion.fast_nm, one.line_percent),
            ("frame", motion.slow_nm, one.frame_percent),
        ):
            if percent is not None:
                lines.append(f"{f'share of the {name}, {nm:.4g} nm [%]':<34}{percent:+8.3f}")
        return lines

    def summary(self) -> str:
        """Return what ``tablegen refine`` prints: errors before and after, and warnings."""
        return "\n".join([*self.table(), *(finding.line for finding in self.findings())])

    def charts(self) -> PlottedCharts:
        """Return the charts that ``tablegen refine --plot`` draws: the error over the line, and over the frame."""
        motion = self.round.axis.motion
        t = np.arange(_POINTS) / _POINTS
        line, frame = t[motion.inside(t)], t[motion.imaged[(t * motion.lines).astype(np.int64)]]
        charts = []
        for key, at, label in (("line", line, "time [line periods]"), ("frame", frame, "time [frames]")):
            values = [getattr(layer, key).value(at) for layer in (self.round.error, self.round.rest)]
            before, after = (100.0 * (one - np.mean(one)) / motion.longest_nm for one in values)
            curves = (DrawnCurve("measured", "before", at, before), DrawnCurve("predicted", "forward", at, after))
            charts.append(Chart(f"error-{key}", f"error over the {key}", label, "error [% of the motion]", curves))
        heading = f"{self.round.setup.scan.name}: refinement of {self.round.axis.axis}"
        return PlottedCharts(heading, tuple(charts), 2)

    def _lines(self) -> Sequence[str]:
        third = f"not to be used: {self.refused}" if self.refused else f"from {self.source.name}"
        residual = f"error {self.before_percent:.2g} % rms, {self.after_percent:.2g} % predicted after the round"
        return f"refinement of {self.round.axis.axis} of {self.round.setup.scan.name!r} at an angle", residual, third
