"""A trace of the running scan to a layer over the model, and into the scan file: a round of iterative learning."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec

from tablegen.api.measured import Measured, table_of
from tablegen.base.data_files import Source
from tablegen.base.input_errors import Problem, Rejected
from tablegen.base.reading import CONFIGURATION, read_text
from tablegen.calibration.tables.columns import DISPLACEMENT, DRIVE, TIME
from tablegen.config.load import Setup, load
from tablegen.emit.write import write_files
from tablegen.refinement.comment import provenance
from tablegen.refinement.round import Options, Round, with_refinement
from tablegen.refinement.round import refine as learn_from
from tablegen.refinement.scan_file import rounds_of, with_layer


def refine(
    scan: str | Path | Setup,
    trace: Measured,
    *,
    axis: Literal["x", "y"],
    triggered: bool = False,
    **options: Any,
) -> "RefinedScan":
    """Learn from a trace of the running scan what the model leaves, as ``tablegen refine`` does.

    ``trace`` is a CSV file, or arrays ``time_s``, ``displacement_nm`` and ``drive_v`` (volts at the piezo) of several
    periods of the build of this very ``scan``. With ``triggered`` it needs no ``drive_v``: its time 0 is a line start,
    of y a frame start. ``options`` are ``gain`` (0.7 of what is measured is corrected), ``harmonics``, ``period_s``,
    ``delay_s``, ``settle_periods`` and ``drift_order``. Raises ``Rejected`` for wrong input, ``Unphysical`` for a trace
    that is not of this scan.
    """
    setup = scan if isinstance(scan, Setup) else load(scan)
    if axis == "y" and setup.scan.y.off:
        raise Rejected([setup.scan_file.problem("y.motion", "'off' keeps y where it is: it has nothing to refine")])
    path = None if isinstance(scan, Setup) else Path(scan)
    text = "" if path is None else read_text(path, CONFIGURATION)
    table = table_of(trace, [TIME, DISPLACEMENT], [DRIVE])
    if DRIVE not in table and not triggered:
        why = "missing; or give --triggered if time 0 is a line start"
        raise Rejected([Problem(table.file, max(int(table.lines[0]) - 1, 0), DRIVE.name, why)])
    drive = None if triggered else table[DRIVE]
    found = learn_from(setup, axis, table[TIME], table[DISPLACEMENT], drive, Options(**options))
    return RefinedScan(found, (table.source,), path, text)


@dataclass(frozen=True, eq=False)
class RefinedScan:
    """A round: ``setup`` is the scan with the new layer, ``refused`` why it must not be used, if so.

    ``round`` has residuals and remarks; ``scan`` and ``text`` are the scan file that was learnt for, and what it said.
    ``stopped`` is why learning ends here, if so: the scaling error rose, and the layer of the best round is kept.
    """

    round: Round
    sources: tuple[Source, ...]
    scan: Path | None = None
    text: str = ""

    @property
    def setup(self) -> Setup:
        """The scan with what was learnt, or the best layer: ``tablegen.build(refined.setup)`` needs no file."""
        found = self.round
        return found.setup if found.best is None else with_refinement(found.setup, found.line.axis, found.best)

    @property
    def stopped(self) -> str:
        """Why no further layer is to be played, empty where one is."""
        return self.round.stopped

    @property
    def before_percent(self) -> float:
        """The measured residual, rms, in percent of the line."""
        return self.round.update.before.rms_percent

    @property
    def after_percent(self) -> float:
        """The one that is predicted for the next trace."""
        return self.round.update.after.rms_percent

    @property
    def remarks(self) -> tuple[str, ...]:
        """What to know of the trace, in sentences."""
        return self.round.remarks

    @property
    def earlier(self) -> list[str]:
        """The comments of the rounds before in the scan file."""
        axis = self.round.line.axis
        return [] if self.round.line.layer is None or not self.text else rounds_of(self.text, str(self.scan), axis)

    @property
    def refused(self) -> str:
        """Why the round must not be used: an error grew, or the file was learnt from before. Empty where it may."""
        if self.round.worse:
            return self.round.worse
        if self.round.stopped and self.round.best is None:
            return self.round.stopped
        if not any(source.sha256 in row for row in self.earlier for source in self.sources):
            return ""
        what = "this trace" if len(self.sources) == 1 else "these images"
        return f"[{self.round.line.axis}.refinement] was already learnt from {what}; build, upload and record again"

    def content(self, force: bool = False) -> bytes:
        """The scan file with the new layer; empty where nothing was learnt. Raises ``Rejected``.

        Where the round stopped it is the file with the best layer, unless by ``force``.
        """
        if self.scan is None:
            raise ValueError("the scan was given as a setup; give the path of its file to write into it")
        found = self.round
        best = None if force else found.best
        if best is None and (found.refinement is None or not found.update.harmonics):
            return b""
        plain = msgspec.json.decode(msgspec.json.encode(best or found.refinement))
        values = {key: value for key, value in plain.items() if value is not None}  # as a file has it
        comment = provenance(found, self.sources, stopped=best is not None)
        return with_layer(self.text, str(self.scan), found.line.axis, values, comment).encode("utf-8")

    def write(self, force: bool = False) -> list[str]:
        """Put the layer into the scan file, as ``tablegen refine --write`` does; the names that changed.

        Raises ``Rejected`` for a round that is refused, unless by ``force``, and ``CannotWrite``.
        """
        if self.refused and not force:
            raise Rejected([Problem(str(self.scan or ""), 0, self.round.line.axis, self.refused)])
        content = self.content(force)
        path = Path() if self.scan is None else self.scan.resolve()
        return write_files(path.parent, {path.name: content}) if content else []

    def __repr__(self) -> str:
        axis, name = self.round.line.axis, self.round.setup.scan.name
        residual = f"residual {self.before_percent:.3g} % rms, {self.after_percent:.2g} % predicted after it"
        refused = f"\n  not to be used: {self.refused}" if self.refused else ""
        stopped = f"\n  stopped: {self.stopped}" if self.stopped and not self.refused else ""
        return f"<tablegen refinement of {axis} of {name!r}: {residual}{refused}{stopped}>"
