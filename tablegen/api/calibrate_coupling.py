"""Calibrate the coupling of the axes from images of a known lattice, or from sensors of both, into the scanner file."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tablegen.api.image_input import ImageSource, known_sample, read_trace_and_perhaps_retrace
from tablegen.api.measured import Measured, measured_list, table_of
from tablegen.api.result import Result
from tablegen.base.blas_threads import one_blas_thread
from tablegen.base.data_files import Source
from tablegen.base.input_errors import Problem, Rejected, Unphysical
from tablegen.base.reading import CONFIGURATION, read_text
from tablegen.base.toml import parse_toml
from tablegen.base.warnings import Finding, of_remarks, worst_first
from tablegen.calibration.laws.coupling import CouplingFit, onto_earlier
from tablegen.calibration.laws.coupling_images import CouplingImage, fit_coupling_images
from tablegen.calibration.laws.coupling_records import fit_coupling_records
from tablegen.calibration.scanner_file import Change, updated
from tablegen.calibration.tables.columns import POSITION_X, POSITION_Y, TIME
from tablegen.calibration.tables.recorder import Columns, Recorder
from tablegen.calibration.tables.table import MeasuredTable
from tablegen.charts.chart import Chart, DrawnCurve
from tablegen.charts.picture_file import PlottedCharts
from tablegen.emit.write import write_files
from tablegen.fitting.estimate import Estimate
from tablegen.images.files import ScanImage
from tablegen.images.indexer import find_cell
from tablegen.images.lattice_map import mapped_cell
from tablegen.images.line_length import Cell
from tablegen.numerics.arrays import Floats

Way = Literal["up", "down"]
_WAYS = {"bottom": "up", "top": "down"}
_SAME_ANGLE_DEG = 0.05


@one_blas_thread
def calibrate_coupling(
    records: Measured | Sequence[Measured] = (),
    *,
    images: Sequence[tuple[float, Way, ImageSource]] = (),
    lattice_nm: float | None = None,
    lattice: Literal["hexagonal", "square"] = "hexagonal",
    cell: tuple[float, float, float] | None = None,
    lies_deg: tuple[float, float] | None = None,
    corrected: tuple[float, float] | None = None,
    channel: str | int | None = None,
    columns: Columns | None = None,
) -> "CalibratedCoupling":
    """Fit by how much each axis moves along the other: ``[coupling]`` of the scanner file.

    Parameters
    ----------
    records : path, mapping of arrays, or a sequence of them
        ``x_nm`` and ``y_nm`` (n,) of sensors of both axes, and perhaps ``time_s``, while one axis moves and the other
        is at rest; a second record for the other axis.
    images : sequence of (degrees, "up" or "down", image), optional
        In place of ``records``, images of one lattice, not turned between them: scan angle counterclockwise from x, the
        way of the frame in the image, and a file or heights of shape (rows, columns), rows in the order of time.
    lattice_nm, lattice, cell : optional
        The sample: constant in nm of a hexagonal or square lattice, or sides and angle (nm, nm, degrees) of its cell.
    lies_deg : (float, float), optional
        Direction of the first side of the cell, counterclockwise from x, and its standard error, in degrees. Without it
        x_per_y is the whole shear, and y_per_x is 0.
    corrected : (float, float), optional
        x_per_y and y_per_x that the scan of the images had undone.
    channel : str or int, optional
        Title or number of the channel.
    columns : str or mapping, optional
        Which column is which, by number from 1 or by name: ``"x=3,y=2:um"``.

    Returns
    -------
    CalibratedCoupling
        ``values`` with standard errors; ``write`` puts them into the scanner file.

    Raises
    ------
    Rejected
        A file is wrong, or states another scan angle or another way of the frame.
    Unphysical
        An image does not show this lattice, or the data do not determine a coupling.

    Examples
    --------
    >>> moved = [5.0 * (step % 200) for step in range(800)]
    >>> fit = tablegen.calibrate_coupling({"x_nm": moved, "y_nm": [0.02 * x for x in moved]})
    >>> round(fit.values["y_per_x"].value, 6)
    0.02
    """
    measured = measured_list(records)
    if bool(measured) == bool(images):
        raise TypeError("give records of both sensors, or images of a lattice")
    if measured:
        return _of_records(measured, Recorder(columns, None, None))
    sample = known_sample(lattice_nm=lattice_nm, lattice=lattice, cell=cell).cell
    if sample is None:
        raise TypeError("images need the lattice of their sample: lattice_nm, or cell")
    name = None if channel is None else str(channel)
    scanned = [_image(angle, way, image, name) for angle, way, image in images]
    scans = tuple(scan for scan, _, _ in scanned)
    try:
        cells = [_cell(scan, angle, way, sample) for scan, angle, way in scanned]
        fit = fit_coupling_images(cells, sample.vectors, None if lies_deg is None else Estimate(*lies_deg))
    except Unphysical as reason:
        raise Unphysical(f"{', '.join(dict.fromkeys(one.file for one in scans))}: {reason}") from None
    return CalibratedCoupling(fit, scans, corrected)


def _of_records(measured: Sequence[Measured], recorder: Recorder) -> "CalibratedCoupling":
    tables = tuple(table_of(one, [POSITION_X, POSITION_Y], [TIME], recorder) for one in measured)
    records = [(one.file, one[POSITION_X], one[POSITION_Y], one.columns.get(TIME.name)) for one in tables]
    fit = fit_coupling_records(records)
    return CalibratedCoupling(fit, tables)


def _image(angle_deg: float, way: Way, image: ImageSource, channel: str | None) -> tuple[ScanImage, float, Way]:
    """Read an image, and check what the file says of its scan."""
    if way not in ("up", "down"):
        raise TypeError(f"{way!r} is no way of a frame: up, or down")
    scan = read_trace_and_perhaps_retrace(image, None, {"channel": channel})[0]
    stated = scan.angle_deg
    if stated is not None and min(_apart(stated, angle_deg), _apart(stated, -angle_deg)) > _SAME_ANGLE_DEG:
        why = f"states a scan angle of {stated:.4g} degrees, and {angle_deg:.4g} is given"
        raise Rejected([Problem(scan.file, 0, "", why)])
    if scan.first_row is not None and _WAYS[scan.first_row] != way:
        why = f"states a frame that goes {_WAYS[scan.first_row]}, and {way} is given"
        raise Rejected([Problem(scan.file, 0, "", why)])
    return scan, angle_deg, way


def _apart(one: float, other: float) -> float:
    return abs((one - other + 180.0) % 360.0 - 180.0)


def _cell(scan: ScanImage, angle_deg: float, way: Way, sample: Cell) -> CouplingImage:
    """Find the cell of an image, y upwards."""
    rows, columns = scan.heights.shape
    sized = bool(scan.width_nm and scan.height_nm)
    pixel = np.array([(scan.width_nm or 0.0) / columns, (scan.height_nm or 0.0) / rows]) if sized else np.ones(2)
    area = abs(float(np.linalg.det(sample.vectors))) / float(np.prod(pixel))
    cell = find_cell(scan.heights, None, area if sized else None)
    scale = np.tile(pixel * [1.0, -1.0 if way == "down" else 1.0], 2)
    speed = pixel[1] * scan.line_rate_hz if sized and scan.line_rate_hz else None
    vectors, covariance = mapped_cell(scan.heights, cell)
    vectors = (vectors.ravel() * scale).reshape(2, 2)
    covariance = covariance * np.outer(scale, scale)
    row = float(pixel[1] / (columns * pixel[0]))
    return CouplingImage(scan.file, angle_deg, way == "down", vectors, covariance, row, speed, sized)


@dataclass(frozen=True, eq=False, repr=False)
class CalibratedCoupling(Result):
    """Coupling of the axes with standard errors: ``values`` by key, ``doubts``, and the change of the scanner file.

    ``fit`` has what images or records show, ``corrected`` the coupling that their scan had undone.
    """

    fit: CouplingFit
    measured: tuple[MeasuredTable | ScanImage, ...]
    corrected: tuple[float, float] | None = None

    @property
    def values(self) -> dict[str, Estimate]:
        """Coupling of the scanner by key, where it was determined: ``value`` and ``standard_error``."""
        return self.fit.values if self.corrected is None else onto_earlier(self.fit.values, self.corrected)

    @property
    def sources(self) -> tuple[Source, ...]:
        """Names of the files with their SHA-256, each once."""
        return tuple(dict.fromkeys(one.source for one in self.measured))

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons why nothing should be written, in sentences; empty for a fit that ``write`` takes."""
        return self.fit.doubts

    @property
    def record(self) -> dict[str, Any]:
        """The fit as plain data, as ``tablegen calibrate coupling --json`` prints it."""
        fit = self.fit
        return {
            "kind": "coupling",
            "parameters": {key: _plain(one) for key, one in self.values.items()},
            "corrected": None if self.corrected is None else list(self.corrected),
            "shear_alone": fit.shear_alone,
            "drift": None if fit.drift is None else [_plain(one) for one in fit.drift],
            "drift_unit": fit.drift_unit if fit.drift is not None else None,
            "size_ratio": None if fit.size_ratio is None else _plain(fit.size_ratio),
            "directions_deg": fit.directions_deg.tolist(),
            "fitted_deg": fit.fitted_deg.tolist(),
            "sources": [{"name": source.name, "sha256": source.sha256} for source in self.sources],
            "doubts": list(self.doubts),
            "findings": [one.record() for one in self.findings()],
        }

    def findings(self) -> list[Finding]:
        """Return warnings to read before the fit is trusted, the worst first."""
        return worst_first(of_remarks(self.fit.remarks))

    def summary(self) -> str:
        """Return what ``tablegen calibrate coupling`` prints: values with standard errors, and warnings."""
        return "\n".join([*self.table(), *(finding.line for finding in self.findings())])

    def table(self) -> list[str]:
        """Return the lines of ``summary`` without the findings."""
        fit, meanings = self.fit, {"x_per_y": "nm along x for each nm of y", "y_per_x": "nm along y for each nm of x"}
        rows = [
            f"{key:<12} {_shown(one)}  {meanings[key]}"
            + (", by choice" if fit.shear_alone and key == "y_per_x" else "")
            for key, one in self.values.items()
        ]
        if fit.drift is not None:
            x, y = fit.drift
            rows.append(f"(drift)      x {_shown(x)}, y {_shown(y)} {fit.drift_unit}")
        if fit.size_ratio is not None:
            rows.append(f"(size)       y is too long against x by {_shown(fit.size_ratio)}")
        return [self._title(), "", *rows, *([""] if self.findings() else [])]

    def _title(self) -> str:
        names = ", ".join(one.source.name for one in self.measured)
        return f"coupling of the axes, {self._count()}: {names}"

    def _count(self) -> str:
        kind = "image" if isinstance(self.measured[0], ScanImage) else "record"
        return f"{len(self.measured)} {kind}{'s' if len(self.measured) > 1 else ''}"

    def _lines(self) -> Sequence[str]:
        return self._title(), ", ".join(f"{key} {_shown(one)}" for key, one in self.values.items())

    def content(self, scanner: Path, force: bool = False) -> bytes:
        """Return the text of the scanner file with ``[coupling]``; nothing is written.

        Raises
        ------
        Rejected
            If the file cannot take the values, or the fit is meaningless, unless by ``force``.
        """
        if self.doubts and not force:
            raise Rejected([Problem(str(scanner), 0, "coupling", doubt) for doubt in self.doubts])
        by_force = ", meaningless, written by --force" if self.doubts else ""
        errors = ", ".join(f"{key} {one.rounded:.9g} +- {one.standard_error:.2g}" for key, one in self.values.items())
        lines = [
            f"{self._count()}{by_force}",
            *(f"from {_printable(one.name)}, sha256 {one.sha256}" for one in self.sources),
            f"standard errors: {errors}",
        ]
        values = {key: one.rounded for key, one in self.values.items()}
        text = read_text(scanner.resolve(), CONFIGURATION)
        return updated(text, str(scanner), "", Change("coupling", values, provenance=[lines])).encode("utf-8")

    def write(self, scanner: str | Path, force: bool = False) -> list[str]:
        """Put the values into a scanner file, as ``tablegen calibrate coupling --write``; return what changed.

        Raises
        ------
        Rejected
            As ``content``.
        CannotWrite
            If the file cannot be written.
        """
        path = Path(scanner)
        return write_files(path.resolve().parent, {path.resolve().name: self.content(path, force)})

    def charts(self) -> PlottedCharts:
        """Return the directions of lines and columns of each image, or the axis at rest over the one that moves."""
        charts = [*self._record_charts(), *self._image_charts()]
        return PlottedCharts(self._title(), tuple(charts))

    def _image_charts(self) -> list[Chart]:
        fit = self.fit
        at = np.arange(1.0, len(fit.directions_deg) + 1.0)
        return [
            Chart(
                f"coupling_{name}", f"direction of the {name}", "image", "against the scan angle [degrees]",
                (DrawnCurve("measured", "other", at, fit.directions_deg[:, column], "points"),
                 DrawnCurve("fit", "before", at, fit.fitted_deg[:, column])),
            )
            for column, name in enumerate(("lines", "columns"))
            if len(at)
        ]  # fmt: skip

    def _record_charts(self) -> list[Chart]:
        charts = []
        for table in self.measured:
            if not isinstance(table, MeasuredTable):
                continue
            x, y = table[POSITION_X], table[POSITION_Y]
            moves, names = ((x, y), "xy") if np.ptp(x) > np.ptp(y) else ((y, x), "yx")
            slope = self.fit.values[f"{names[1]}_per_{names[0]}"].value
            charts.append(_record_chart(*moves, names, slope))
        return charts


def _record_chart(moves: Floats, rests: Floats, names: str, slope: float) -> Chart:
    ends = np.array([np.min(moves), np.max(moves)])
    line = np.mean(rests) + slope * (ends - np.mean(moves))
    return Chart(
        f"coupling_{names[1]}_per_{names[0]}", f"{names[1]} while {names[0]} moves", f"{names[0]} [nm]",
        f"{names[1]} [nm]",
        (DrawnCurve("measured", "other", moves, rests, "points"), DrawnCurve("fit", "before", ends, line)),
    )  # fmt: skip


def earlier_coupling(scanner: Path) -> tuple[float, float]:
    """Return x_per_y and y_per_x of a scanner file as it is, 0 where they are missing.

    Raises
    ------
    Rejected
        If the file cannot be read.
    """
    table = parse_toml(read_text(scanner, CONFIGURATION), str(scanner))[0].get("coupling", {})
    numbers = [table.get(key, 0.0) if isinstance(table, dict) else 0.0 for key in ("x_per_y", "y_per_x")]
    x, y = (float(one) if isinstance(one, int | float) else 0.0 for one in numbers)
    return x, y


def _plain(estimate: Estimate) -> dict[str, float | None]:
    error = estimate.standard_error
    return {"value": estimate.value, "standard_error": error if isfinite(error) else None}


def _shown(estimate: Estimate) -> str:
    if not estimate.standard_error > 0.0:
        return f"{estimate.value:.4g}"
    return f"{estimate.value:.4g} ± {estimate.standard_error:.2g}"


def _printable(name: str) -> str:
    return name if name.isprintable() else ascii(name)
