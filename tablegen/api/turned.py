"""Build a scan at an angle: its plan, certificate and files."""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tablegen.api.build import BrokenLimit, Source, setup_of
from tablegen.api.result import Result
from tablegen.base.input_errors import Rejected
from tablegen.certificate.turned_errors import TurnedCertificate, certify_turned
from tablegen.certificate.turned_summary import broken_limits, turned_brief, turned_summary, turned_warnings
from tablegen.config.load import Setup
from tablegen.emit.turned import turned_runtime
from tablegen.emit.turned_scan import formats_of_turned, render_turned, turned_clocks
from tablegen.emit.write import leftover_files, outdated_files, write_files
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.manifest.format import MANIFEST, read_json
from tablegen.planning.turned_plan import TurnedPlan, make_turned_plan

if TYPE_CHECKING:
    from tablegen.charts.picture_file import PlottedCharts
    from tablegen.link.prepare import PreparedScan

_POINTS = 200  # of a line in a chart


def build_turned(
    source: Source | None = None,
    out: str | Path | None = None,
    *,
    scan: Mapping[str, Any] | None = None,
    scanner: Mapping[str, Any] | None = None,
    formats: Sequence[str] | None = None,
    progress: Callable[[str], object] = lambda _: None,
) -> "TurnedBuild":
    """Plan and certify a scan at an angle, on coupled axes or with drift, and write it into ``out`` if one is given.

    So is a scan with the output z whose axes have operators, at any angle; ``build`` takes the others.

    Parameters
    ----------
    source, scan, scanner
        As for ``plan``.
    out : str or Path, optional
        Directory; files of an earlier build there are removed.
    formats : sequence of str, optional
        "c", "verilog" and packages of them; by default those of the scan, or "c" alone.
    progress : callable
        Called with a text for each stage.

    Returns
    -------
    TurnedBuild
        Plan, certificate and files: C99 or Verilog, and the manifest.

    Raises
    ------
    Rejected
        The input is wrong, an axis has no operator, or a format cannot hold the scan.
    BrokenLimit
        The certificate exceeds a limit of the scan.
    CannotWrite
        The directory cannot be written.

    Examples
    --------
    >>> try:
    ...     built = tablegen.build_turned("scan.toml", "turned")
    ... except tablegen.Rejected as rejected:  # a scan that `build` builds
    ...     print(rejected.problems[0].why)
    this scan has no angle, coupling or drift; `build` builds it
    """
    setup = setup_of(source, scan, scanner)
    if not setup.mixes_motions:
        why = "this scan has no angle, coupling or drift; `build` builds it"
        raise Rejected([setup.scan_file.problem("name", why)])
    names = formats_of_turned(setup, formats)
    plan = make_turned_plan(setup, progress)
    clocks = turned_clocks(setup, plan, names)
    certificate = certify_turned(plan, progress)
    if broken := broken_limits(setup, plan, certificate):
        raise BrokenLimit(broken)
    built = TurnedBuild(setup, plan, certificate, names, clocks)
    if out is not None:
        progress("writing the files")
        built.write(out)
    return built


class TurnedBuild(Result):
    """A certified scan at an angle: its plan, certificate and emitted files."""

    def __init__(
        self,
        setup: Setup,
        plan: TurnedPlan,
        certificate: TurnedCertificate,
        formats: Sequence[str] = ("c",),
        clocks_per_tick: int = 0,
    ) -> None:
        self.setup = setup
        self.plan = plan
        self.certificate = certificate
        self._formats = list(formats)
        self._clocks_per_tick = clocks_per_tick

    @property
    def name(self) -> str:
        """The scan's name, which every emitted file and identifier begins with."""
        return self.plan.name

    @property
    def formats(self) -> list[str]:
        """The names of its formats."""
        return list(self._formats)

    @property
    def choices(self) -> tuple[str, ...]:
        """Settings that the build chose, in sentences."""
        programs: dict[str, FrameProgram] = {axis.axis: axis.program for axis in self.plan.axes}
        programs |= {tilt.name: tilt.program for tilt in self.plan.tilts}
        chosen: dict[str, str] = {axis.axis: f", {axis.choice}" for axis in self.plan.axes if axis.choice}
        tables = [
            f"{name}: cubic tables of {len(program.fast.words)} words for the line and "
            f"{len(program.slow.words)} for the frame, {program.memory_bits // 8} bytes in all{chosen.get(name, '')}"
            for name, program in programs.items()
        ]
        return (*self.setup.choices, *tables)

    @property
    def warnings(self) -> list[str]:
        """Sizes or a residual above 1 %; empty if there are none."""
        return [text for _, text in turned_warnings(self.certificate)]

    @cached_property
    def files(self) -> dict[str, bytes]:
        """Every file by its name, the manifest last."""
        return render_turned(self.plan, self.certificate, self.formats, self._clocks_per_tick)

    @property
    def runtime(self) -> set[str]:
        """The names of those files that are the same in every build."""
        return set(turned_runtime(self.formats))

    @property
    def prepared(self) -> "PreparedScan":
        """The program that ``Device.upload`` sends: ``device.upload(scan.prepared.image("table", device.info))``."""
        from tablegen.link.prepare import PreparedScan

        return PreparedScan.of_turned(self.plan)

    @property
    def record(self) -> dict[str, Any]:
        """The manifest as plain data."""
        plain: dict[str, Any] = read_json(self.files[MANIFEST])
        return plain

    def brief(self) -> list[str]:
        """Return the lines that every output of the scan begins with: its errors, and the time of an image."""
        return turned_brief(self.plan, self.certificate)

    def summary(self) -> str:
        """Return errors and drives as text."""
        return "\n".join(turned_summary(self.plan, self.certificate))

    def charts(self) -> "PlottedCharts":
        """Return the drives over the frame, and those of both axes on the first, a middle and the last imaged line."""
        from tablegen.charts.chart import Chart, DrawnCurve
        from tablegen.charts.picture_file import PlottedCharts
        from tablegen.html_report.tilt_chart import tilt_chart

        charts = []
        for axis in self.plan.axes:
            driver, lines = axis.known.driver, axis.motion.lines
            u = axis.drive.on_grid(lines, _POINTS)
            imaged = np.flatnonzero(axis.motion.imaged).tolist()
            t = np.arange(_POINTS) / _POINTS
            curves = tuple(
                DrawnCurve(f"line {at}", "other", t, driver.volts(u[at]))
                for at in (imaged[0], imaged[len(imaged) // 2], imaged[-1])
            )
            charts.append(Chart(f"{axis.axis}_line", f"{axis.axis}: lines", "line period", "drive [V]", curves))
            frame = DrawnCurve(f"{axis.axis}", "other", np.arange(u.size) / _POINTS, driver.volts(u.ravel()))
            charts.append(Chart(f"{axis.axis}_frame", f"{axis.axis}: frame", "line", "drive [V]", (frame,)))
        charts += [
            tilt_chart(tilt.name, tilt.program, tilt.converter.v_zero, tilt.converter.v_per_code)
            for tilt in self.plan.tilts
        ]
        return PlottedCharts(self.name, tuple(charts))

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
        """Return the files of a directory that an earlier build made and this one does not: ``write`` removes them."""
        names = outdated_files(Path(folder), self.files)
        read = {path.resolve() for path in self.setup.files} if names else set()
        return [name for name in names if (Path(folder) / name).resolve() not in read]

    def leftovers(self, folder: str | Path) -> list[str]:
        """Return files of a directory that look like a build's and are not of this one: ``write`` leaves them there."""
        return leftover_files(Path(folder), self.files)

    def _lines(self) -> Sequence[str]:
        errors, plan = self.certificate.errors, self.plan
        return (
            f"build {plan.name!r} on {plan.scanner!r} at {plan.geometry.angle_deg:g} degrees",
            f"residual {errors.rms:.3f} % rms, sizes {errors.fast_size:+.3f} and {errors.slow_size:+.3f} %",
        )
