"""Build a scan at an angle: its plan, certificate and files."""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tablegen.api.build import BrokenLimit, Source, setup_of
from tablegen.api.result import Result
from tablegen.base.input_errors import Problem, Problems, Rejected, Unphysical
from tablegen.certificate.error_answer import duration
from tablegen.certificate.summary import rate
from tablegen.certificate.turned_errors import TurnedCertificate, certify_turned
from tablegen.config.load import Setup
from tablegen.emit.render import format_rejected
from tablegen.emit.templates import comment_safe
from tablegen.emit.turned import TURNED_FORMATS, require_format, turned_files, turned_runtime
from tablegen.emit.turned_content import TurnedContent
from tablegen.emit.write import leftover_files, outdated_files, write_files
from tablegen.manifest.format import MANIFEST, content_hash, read_json
from tablegen.manifest.turned_record import turned_manifest, turned_record
from tablegen.planning.clock import slow_clocks_per_tick
from tablegen.planning.turned_plan import TurnedPlan, make_turned_plan
from tablegen.version import __version__

if TYPE_CHECKING:
    from tablegen.charts.picture_file import PlottedCharts
    from tablegen.link.prepare import PreparedScan

_WARNED_PERCENT = 1.0
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

    Parameters
    ----------
    source, scan, scanner
        As for ``plan``.
    out : str or Path, optional
        Directory; files of an earlier build there are removed.
    formats : sequence of str, optional
        "c" and "verilog"; by default those of the scan, or "c" alone.
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
    names = _formats(setup, formats)
    plan = make_turned_plan(setup, progress)
    clocks = _clocks_per_tick(setup, plan, names, explicit=formats is not None)
    certificate = certify_turned(plan, progress)
    if broken := _broken(setup, plan, certificate):
        raise BrokenLimit(broken)
    built = TurnedBuild(setup, plan, certificate, names, clocks)
    if out is not None:
        progress("writing the files")
        built.write(out)
    return built


def _formats(setup: Setup, formats: Sequence[str] | None) -> tuple[str, ...]:
    """Return the formats of a build, those of the scan file unless they are given, each once."""
    names = tuple(dict.fromkeys(formats or setup.scan.emit.formats or ("c",)))
    if not set(names) <= set(TURNED_FORMATS):
        why = "a scan at an angle, on coupled axes or with drift has the formats c and verilog"
        raise format_rejected(setup, why, explicit=formats is not None)
    return names


def _clocks_per_tick(setup: Setup, plan: TurnedPlan, formats: Sequence[str], *, explicit: bool) -> int:
    """Return the clocks of a tick of an FPGA, 0 where none plays the scan or its clock is not known."""
    for name in formats:
        try:
            require_format(name, plan.program)
        except Unphysical as error:
            raise format_rejected(setup, str(error), explicit=explicit) from None
    problems = Problems()
    clocks = slow_clocks_per_tick(setup, plan.program, problems) if "verilog" in formats else 0
    problems.stop_if_any()
    return clocks


def _broken(setup: Setup, plan: TurnedPlan, certificate: TurnedCertificate) -> list[Problem]:
    """Return the limits of the scan file that the certificate exceeds."""
    errors, limits, problems = certificate.errors, plan.limits, []
    figures = {
        "max_error_lsb": (limits.max_error_lsb, max(errors.code_lsb), "a code is off by", "LSB"),
        "max_scaling_error_percent": (
            limits.max_scaling_error_percent,
            max(errors.scaling, abs(errors.fast_size), abs(errors.slow_size)),
            "scaling and sizes are off by up to",
            "%",
        ),
    }
    for key, (limit, value, what, unit) in figures.items():
        if limit is not None and value > limit:
            problems.append(setup.scan_file.problem(f"limits.{key}", f"{what} {value:.3g} {unit}, above {limit:g}"))
    return problems


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
        tables = [
            f"{axis.axis}: cubic tables of {len(axis.program.fast.words)} words for the line and "
            f"{len(axis.program.slow.words)} for the frame, {axis.program.memory_bits // 8} bytes in all"
            for axis in self.plan.axes
        ]
        return (*self.setup.choices, *tables)

    @property
    def warnings(self) -> list[str]:
        """Sizes or a residual above 1 %; empty if there are none."""
        errors = self.certificate.errors
        figures = {
            "the residual": errors.rms,
            "the size along the lines": errors.fast_size,
            "the size across the lines": errors.slow_size,
            "the shear": errors.shear,
        }
        return [f"{what} is off by {value:.2f} %" for what, value in figures.items() if abs(value) > _WARNED_PERCENT]

    @cached_property
    def files(self) -> dict[str, bytes]:
        """Every file by its name, the manifest last."""
        plan, record = self.plan, turned_record(self.plan)
        digest = content_hash(record)
        text = tuple(map(comment_safe, self.summary().splitlines()))
        clocks = self._clocks_per_tick
        content = TurnedContent(plan.name, digest, plan.program, __version__, plan.scanner, text, clocks)
        files = turned_files(content, self.formats) | turned_runtime(self.formats)
        files[MANIFEST] = turned_manifest(record, digest, self.formats, self.certificate, files, clocks)
        return files

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
        errors = self.certificate.errors
        return [
            f"residual {errors.rms:.3f} % of the line by the operators; sizes {errors.fast_size:+.2f} % along the "
            f"lines, {errors.slow_size:+.2f} % across",
            duration(self.plan.schedule),
        ]

    def summary(self) -> str:
        """Return errors and drives as text."""
        plan, errors, schedule = self.plan, self.certificate.errors, self.plan.schedule
        geometry = plan.geometry
        lines = [
            f"{plan.name} on {plan.scanner!r} at {geometry.angle_deg:g} degrees: {rate(schedule.line_rate)} lines "
            f"of {schedule.ticks} ticks, {schedule.lines} lines a frame",
            *self._mixed(),
            "",
            "errors by the operators, percent of the line or of the frame",
            f"  residual {errors.rms:.3f} rms, worst line {errors.worst_line:.3f}",
            f"  scaling {errors.scaling:.2f} peak to peak",
            f"  size {errors.fast_size:+.3f} along the lines, {errors.slow_size:+.3f} across",
            f"  shear {errors.shear:+.3f}, angle {errors.rotation_deg:+.4f} degrees",
        ]
        if plan.x.motion.both:
            lines.append(f"  trace and retrace differ by up to {errors.mismatch:.3f}")
        lines += ["", "axis  of the line [nm]  of the frame [nm]  drive [V]  codes          step/limit  error [LSB]"]
        for axis, codes, lsb in zip(plan.axes, self.certificate.codes, errors.code_lsb, strict=True):
            volts = abs(axis.converter.v_per_code) * (codes.most - codes.least)
            reach, step = f"{codes.least}..{codes.most}", f"{codes.steepest}/{axis.program.output.max_step}"
            moves = f"{axis.motion.fast_nm:+16.2f}  {axis.motion.slow_nm:+17.2f}"
            lines.append(f"{axis.axis:<4}  {moves}  {volts:9.3f}  {reach:<13}  {step:<10}  {lsb:.2f}")
        return "\n".join(lines)

    def _mixed(self) -> list[str]:
        """Return coupling and drift in a line each, where there is any."""
        geometry, lines = self.plan.geometry, []
        if geometry.x_per_y or geometry.y_per_x:
            lines.append(
                f"coupled axes: {100.0 * geometry.x_per_y:+g} % of y along x, {100.0 * geometry.y_per_x:+g} % of x "
                "along y"
            )
        if any(geometry.drift_nm_per_s):
            x, y = geometry.drift_nm_per_s
            lines.append(f"drift: {x:+g} nm/s along x, {y:+g} nm/s along y")
        return lines

    def charts(self) -> "PlottedCharts":
        """Return the drive of both axes on the first, a middle and the last imaged line, and over the frame."""
        from tablegen.charts.chart import Chart, DrawnCurve
        from tablegen.charts.picture_file import PlottedCharts

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
