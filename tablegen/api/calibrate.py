"""From measurements to the parameters of a scanner file, with their standard errors, and into the file."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from tablegen.api.measured import Measured, table_of
from tablegen.base.data_files import Source
from tablegen.base.input_errors import Problem, Problems, Rejected, Unphysical
from tablegen.base.reading import CONFIGURATION, RESPONSE, read_bytes, read_text
from tablegen.base.toml import read_toml
from tablegen.calibration.fit_checks import doubts
from tablegen.calibration.laws.frequency import fit_frequency
from tablegen.calibration.laws.hysteresis import fit_hysteresis
from tablegen.calibration.laws.offset import fit_offset
from tablegen.calibration.laws.offset_sizes import fit_offset_sizes
from tablegen.calibration.laws.resonance import ResonanceFit, fit_resonance
from tablegen.calibration.laws.size import fit_size
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
from tablegen.calibration.tables.response_csv import MARK, response_csv
from tablegen.calibration.tables.table import MeasuredTable
from tablegen.calibration.tables.traces import split_traces
from tablegen.compensation.size import SizeLaw
from tablegen.config.decode import decode
from tablegen.config.like import inherited
from tablegen.config.scanner import Scanner
from tablegen.emit.write import write_files
from tablegen.fitting.estimate import Estimate, Fit
from tablegen.numerics.driver import Driver
from tablegen.planning.laws import size_law_of

Kind = Literal["size", "offset", "hysteresis", "frequency", "resonance"]
_COLUMNS = {
    "size": ([DRIVE, ACTUAL], []),
    "offset": ([OFFSET, APPARENT], [SIZE]),
    "hysteresis": ([TIME, DRIVE, DISPLACEMENT], [TRACE]),
    "frequency": ([FREQUENCY, GAIN], []),
    "resonance": ([FREQUENCY, GAIN], [PHASE]),
}


def calibrate(
    kind: Kind,
    data: Measured | Sequence[Measured],
    *,
    axis: Literal["x", "y"],
    scanner: str | Path | None = None,
    v_max: float | None = None,
    v_min: float = 0.0,
    points: bool = False,
    **options: Any,
) -> "Calibrated":
    """Fit what ``tablegen calibrate KIND`` fits, to CSV files or to arrays by the names of their columns.

    Sizes take ``drive_v`` and ``actual_nm``; offsets ``offset_v`` and ``apparent_nm``, optionally ``size_v``;
    hysteresis one or more traces of ``time_s``, ``drive_v``, ``displacement_nm``; frequency ``frequency_hz`` and
    ``gain``; resonance also ``phase_deg``. Volts are at the piezo, and drives peak to peak. ``v_max``, ``v_min`` and
    what a fit needs of other calibrations are read from the file ``scanner``; without one, give them. With ``points``
    hysteresis, or a response, is kept as measured, in place of a law.

    ``options`` are those of the fits: ``base_nm``, ``threshold``, ``noise`` of sizes, ``size_v`` of offsets,
    ``reference_hz`` of frequency; ``rho``, ``settle_periods``, ``drift_order``, ``delay_s`` of hysteresis. Raises
    ``Rejected`` for wrong input, ``Unphysical`` for data that no scanner makes.
    """
    if kind not in _COLUMNS:
        raise ValueError(f"{kind!r} is none of {', '.join(_COLUMNS)}")
    measured = list(data) if isinstance(data, Sequence) and not isinstance(data, str) else [data]
    tables = [table_of(one, *_COLUMNS[kind]) for one in measured]
    if len(tables) > 1 and kind != "hysteresis":
        raise ValueError(f"{kind} takes one table; hysteresis alone takes several")
    found = _Scanner(None if scanner is None else Path(scanner), axis, v_max, v_min)
    sources = tuple(dict.fromkeys(table.source for table in tables))
    return Calibrated(_fit(kind, tables, found, options), axis, sources, points)


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A fit of one kind to an axis: ``parameters`` with standard errors, ``doubts``, and how it gets into the file.

    ``fit`` has residuals, outliers and remarks; ``points`` says that measured values are written in place of a law.
    """

    fit: Fit
    axis: str
    sources: tuple[Source, ...]
    points: bool = False

    @property
    def kind(self) -> str:
        """Which table of the scanner file it is: "size", "offset", "hysteresis", "frequency", "resonance"."""
        return change(self.fit, ()).kind

    @property
    def parameters(self) -> dict[str, Estimate]:
        """Each parameter by its key: ``value``, and ``standard_error``, twice which covers the truth in 95 %.

        Of hysteresis at several turns the keys of the second one begin with "2: ", and so on.
        """
        found: dict[str, Estimate] = {}
        number = 0
        for key, estimate, _ in parameters(self.fit):
            number += key in ("turn", "size_v")
            found[f"{number}: {key}" if number > 1 else key] = estimate
        return found

    @property
    def doubts(self) -> tuple[str, ...]:
        """What makes the fit meaningless, in sentences with what to do; empty for one that ``write`` takes."""
        return doubts(self.fit, self.points)

    @property
    def record(self) -> dict[str, Any]:
        """As plain data: what ``tablegen calibrate --json`` prints."""
        return record(self.fit, self.axis, self.sources)

    def content(self, scanner: Path, driver: Driver | float | None = None, force: bool = False) -> dict[str, bytes]:
        """Names and contents of the files that change beside ``scanner``, its own the last; nothing is written.

        A file that is not there is begun, and needs the range of the driver, or a number for ``v_max``. Raises
        ``Rejected`` where the file cannot take the values, where the fit is meaningless unless by ``force``, and
        ``Unphysical`` where there are no ``points``.
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
        put = change(self.fit, self.sources, self.points, response, bool(meaningless))
        files[path.name] = updated(text, str(scanner), self.axis, put).encode("utf-8")
        return files

    def write(
        self, scanner: str | Path, v_max: float | None = None, force: bool = False, v_min: float = 0.0
    ) -> list[str]:
        """Put the parameters into a scanner file, as ``tablegen calibrate --write`` does; the names that changed.

        Raises as ``content`` does, and ``CannotWrite``.
        """
        path = Path(scanner)
        files = self.content(path, None if v_max is None else Driver(v_max, v_min), force)
        *beside, own = files
        changed = write_files(path.parent, {name: files[name] for name in beside}) if beside else []
        return changed + write_files(path.resolve().parent, {own: files[own]})

    def __repr__(self) -> str:
        values = ", ".join(f"{key} {_shown(one)}" for key, one in list(self.parameters.items())[:4])
        left = f"left {self.fit.rms_percent:.2g} % rms of {self.fit.before_percent:.3g} %"
        doubtful = f"\n  means nothing: {self.doubts[0]}" if self.doubts else ""
        what = f"{self.axis}.{self.kind} from {self.fit.points} points"
        return f"<tablegen calibration of {what}: {left}\n  {values}{doubtful}>"


def scanner_tables(path: Path) -> tuple[dict[str, Any], list[Problem]]:
    """The tables of a scanner file that are whole, by their path such as "x.size", and the faults of the others.

    Raises ``Rejected`` where the file is no TOML.
    """
    values, document = inherited(*read_toml(path, str(path)))
    tables: dict[str, Any] = {}
    problems = Problems()
    decode(Scanner, values, document, problems, lambda _kind, key, _values, built: tables.update({key: built}))
    return tables, problems.entries


def _values(path: Path) -> dict[str, Any]:
    """As the file says them, or as the axis says that it is like."""
    return inherited(*read_toml(path, str(path)))[0]


class _Scanner:
    """What is known of the scanner beside the data."""

    def __init__(self, path: Path | None, axis: str, v_max: float | None, v_min: float) -> None:
        self.path, self.axis = path, axis
        self.values: dict[str, Any] = _values(path) if path is not None and path.exists() else {}
        known = self.values.get("v_max", v_max)
        if not isinstance(known, int | float) or isinstance(known, bool) or known <= 0.0:
            raise ValueError("give v_max, the driver's maximum output in V, or a scanner file that has it")
        if v_max is not None and v_max != known:
            raise ValueError(f"v_max is {known:g} in {path}, and {v_max:g} was given")
        self.driver = Driver(float(known), float(self.values.get("v_min", v_min)))

    def number(self, kind: str, key: str) -> float | None:
        """A number of the file as it is, or None."""
        value: Any = self.values
        for name in (self.axis, kind, key):
            value = value.get(name) if isinstance(value, dict) else None
        return float(value) if isinstance(value, int | float) and value > 0.0 else None

    def size_law(self) -> SizeLaw:
        """That of the file."""
        table = scanner_tables(self.path)[0].get(f"{self.axis}.size") if self.path is not None and self.values else None
        if table is None:
            raise Unphysical("sizes of the scan are known, and the size law is not; calibrate the size first")
        return size_law_of(table, self.driver)


def _fit(kind: Kind, tables: list[MeasuredTable], scanner: _Scanner, options: dict[str, Any]) -> Fit:
    table, driver = tables[0], scanner.driver
    match kind:
        case "size":
            base = options.pop("base_nm", None) or scanner.number("size", "base_nm") or 200.0
            return fit_size(table[DRIVE], table[ACTUAL], driver, base, **options)
        case "offset" if SIZE in table:
            return fit_offset_sizes(table[OFFSET], table[APPARENT], table[SIZE], driver, scanner.size_law(), **options)
        case "offset":
            size_v = options.pop("size_v", None)
            law = None if size_v is None else scanner.size_law()
            return fit_offset(table[OFFSET], table[APPARENT], driver, law, size_v, **options)
        case "hysteresis":
            return fit_hysteresis([trace for one in tables for trace in split_traces(one)], driver, **options)
        case "frequency":
            reference = options.pop("reference_hz", None) or scanner.number("frequency", "reference_hz")
            return fit_frequency(table[FREQUENCY], table[GAIN], reference, **options)
        case "resonance":
            return fit_resonance(table[FREQUENCY], table[GAIN], table.columns.get(PHASE.name), **options)


def _shown(estimate: Estimate) -> str:
    known = estimate.standard_error > 1e-9 * abs(estimate.value)  # not nan, nor of a turn, which is as it was set
    return f"{estimate.value:.5g}" + (f" \u00b1 {estimate.standard_error:.2g}" if known else "")
