"""An axis of a scanner file that has an operator: what it does with any drive."""

from dataclasses import dataclass, replace
from pathlib import Path

from tablegen.base.figures import shown_path
from tablegen.base.input_errors import Document, Problems, Rejected
from tablegen.compensation.dynamics import Response
from tablegen.compensation.offset import OffsetLaw
from tablegen.compensation.offset_sizes import OffsetSurface
from tablegen.compensation.operator.file import read_operator
from tablegen.compensation.operator.in_time import turns_of
from tablegen.compensation.operator.operator import Operator
from tablegen.config.load import load_scanner
from tablegen.config.scanner import Scanner
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver
from tablegen.planning.laws import dynamics_of, offset_surface, size_law_of


@dataclass(frozen=True)
class KnownAxis:
    """An axis with an operator; ``response`` is what the dynamics are behind it."""

    operator: Operator
    driver: Driver
    surface: OffsetSurface
    response: Response | None

    @classmethod
    def read(cls, path: Path, axis: str) -> "KnownAxis":
        """Read an axis of a scanner file that has an operator.

        Raises
        ------
        Rejected
            If it has none, or the operator is of another axis or driver.
        """
        return cls.of(*load_scanner(path), path.parent, axis)

    @classmethod
    def of(cls, scanner: Scanner, document: Document, folder: Path, axis: str) -> "KnownAxis":
        """Return an axis of a scanner that has an operator, with the file of the operator in a folder.

        Raises
        ------
        Rejected
            As ``read``.
        """
        its = scanner.x if axis == "x" else scanner.y
        named = None if its.hysteresis is None else its.hysteresis.operator_file
        if named is None:
            key = f"{axis}.hysteresis"
            raise Rejected([document.problem(key, f"is no operator; `calibrate operator --axis {axis}` makes one")])
        driver = scanner.driver
        beside = folder / named
        operator, file = read_operator(beside, shown_path(beside))
        problems = Problems()
        if file.axis != axis:
            problems.add(document, f"{axis}.hysteresis.file", f"is the operator of {file.axis}")
        if max(abs(file.v_max - driver.v_max), abs(file.v_min - driver.v_min)) > 1e-6 * driver.span:
            why = f"was identified from {file.v_min:g} to {file.v_max:g} V; the scanner file has {driver}"
            problems.add(document, f"{axis}.hysteresis.file", why)
        surface, response = OffsetSurface.everywhere(OffsetLaw()), None
        with problems.at(document, f"{axis}.offset"):
            if its.offset is not None:
                surface = offset_surface(its.offset, driver, size_law_of(its.size, driver))
        with problems.at(document, f"{axis}.resonance"):
            response = None if its.resonance is None else operator.dynamics(dynamics_of(its.resonance, folder))
        problems.stop_if_any()
        return cls(operator, driver, surface, response)

    def at_rates(self, line_hz: float, slowest_hz: float) -> Operator:
        """Return the operator of lines of a rate, with terms of creep as slow as a lower rate shows.

        Creep has no slowest time constant.
        """
        at_rate = self.operator.at_rate(line_hz)
        return replace(at_rate, creep=self.operator.creep.down_to(slowest_hz))

    def operator_of(self, time_s: Floats, u: Floats) -> Operator:
        """Return the operator at the mean rate of a record, with terms of creep as slow as the record shows.

        Parameters
        ----------
        time_s, u
            Ascending times in s and normalised drives, shapes (n,).
        """
        span_s = float(time_s[-1] - time_s[0])
        return self.at_rates(0.5 * (len(turns_of(u)) - 1) / span_s, 1.0 / span_s)

    def factor(self, mean: float) -> float:
        """Return m of (1) at a mean over that at the operator's centre."""
        here, there = (
            self.surface.small.factor(self.driver.p(self.driver.volts(v))) for v in (mean, self.operator.centre)
        )
        return float(here / there)
