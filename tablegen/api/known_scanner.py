"""Data of the scanner that a calibration needs beside the measurements: the driver's range, and other laws."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from tablegen.base.input_errors import Problem, Problems, Rejected, Unphysical
from tablegen.base.toml import read_toml
from tablegen.calibration.record_checks import Known
from tablegen.calibration.tables.recorder import Recorder
from tablegen.compensation.dynamics import Response
from tablegen.compensation.offset import OffsetLaw
from tablegen.compensation.size import SizeLaw
from tablegen.config.decode import decode
from tablegen.config.like import inherited
from tablegen.config.scanner import Scanner
from tablegen.numerics.driver import Driver
from tablegen.planning.laws import dynamics_of, offset_surface, size_law_of


class NoRange(ValueError):
    """The range of the driver is missing: neither a scanner file nor ``v_max`` gives it."""


@dataclass(frozen=True, eq=False)
class KnownScanner:
    """A scanner file that may be incomplete, or none, for one ``axis``.

    ``values`` are its keys as they are written, empty where the file is to be begun; ``v_max`` and ``v_min`` in V are
    those that were given beside it.
    """

    path: Path | None
    axis: str
    values: dict[str, Any]
    v_max: float | None
    v_min: float

    @classmethod
    def read(cls, path: Path | None, axis: str, v_max: float | None, v_min: float, new: bool) -> "KnownScanner":
        """Read the file, which may be missing if it is ``new``.

        Raises
        ------
        Rejected
            If it cannot be read.
        """
        begun = path is None or (new and not path.exists())
        values = {} if path is None or begun else inherited(*read_toml(path, str(path)))[0]
        return cls(path, axis, values, v_max, v_min)

    @cached_property
    def driver(self) -> Driver:
        """The range of the driver.

        Raises
        ------
        Rejected
            If the file contradicts ``v_max`` or ``v_min``.
        NoRange
            If nothing gives a range.
        """
        return _driver(str(self.path), self.values, self.v_max, self.v_min)

    def number(self, kind: str, key: str) -> float | None:
        """Return a positive number of the file as it is, or None."""
        value: Any = self.values
        for name in (self.axis, kind, key):
            value = value.get(name) if isinstance(value, dict) else None
        return float(value) if isinstance(value, int | float) and value > 0.0 else None

    @property
    def amplifier_gain(self) -> float | None:
        """The gain of the amplifier of this axis as the file has it, or None."""
        own = self.values.get(self.axis)
        for place in (own if isinstance(own, dict) else {}, self.values):
            amplifier = place.get("amplifier")
            gain = amplifier.get("gain") if isinstance(amplifier, dict) else None
            if isinstance(gain, int | float) and not isinstance(gain, bool) and gain != 0.0:
                return abs(float(gain))
        return None

    def known(
        self, recorder: Recorder, delay_s: float | None = 0.0, absolute: bool = False, own_size: bool = True
    ) -> Known:
        """Return what the checks of a record take; ``delay_s`` is None if it is fitted.

        Without ``own_size`` lengths are not compared with the size law of the file, which is calibrated anew.

        Raises
        ------
        Rejected
            If the file contradicts the range of the driver.
        NoRange
            If nothing gives the range.
        """
        return Known(
            self.driver,
            self.number("size", "k_nm_per_v") if own_size else None,
            self.amplifier_gain,
            recorder.states_gain,
            delay_s is None,
            delay_s or 0.0,
            absolute,
        )

    def size_law(self, source: str) -> SizeLaw:
        """Return the size law of the file, for the scan voltages that ``source`` gives.

        Raises
        ------
        Rejected
            If the table has a fault.
        Unphysical
            If the size is not calibrated, or no scanner has its values.
        """
        path = f"{self.axis}.size"
        if self.number("size", "k_nm_per_v") is None:
            raise Unphysical(f"{source} takes {path} of the scanner file; calibrate the size first")
        try:
            return size_law_of(self._tables("size")[path], self.driver)
        except Unphysical as reason:
            raise Unphysical(f"{self.path}: {path}: {reason}") from None

    def axis_laws(self) -> tuple[Response | None, OffsetLaw]:
        """Return the dynamics, and the offset law for small scans; without them None, and a constant.

        Raises
        ------
        Rejected
            If a table that is read has a fault.
        Unphysical
            If no scanner has its values.
        """
        if self.path is None or not self.values:
            return None, OffsetLaw()
        tables = self._tables("offset", "resonance")
        resonance, offset, size = (tables.get(f"{self.axis}.{name}") for name in ("resonance", "offset", "size"))
        try:
            response = None if resonance is None else dynamics_of(resonance, self.path.parent)
            law = SizeLaw(1.0, 0.0, 1.0) if size is None else size_law_of(size, self.driver)
            return response, OffsetLaw() if offset is None else offset_surface(offset, self.driver, law).small
        except Unphysical as reason:
            raise Unphysical(f"{self.path}: {self.axis}: {reason}") from None

    def _tables(self, *names: str) -> dict[str, Any]:
        """Return the tables of the file that are whole, by path such as "x.size"; check ``names`` for faults."""
        assert self.path is not None
        values, document = inherited(*read_toml(self.path, str(self.path)))
        tables: dict[str, Any] = {}
        problems = Problems()
        decode(Scanner, values, document, problems, lambda _kind, key, _values, built: tables.update({key: built}))
        used = {(self.axis, name) for name in names}
        wrong = [one for one in problems.entries if tuple(one.key.split(".")[:2]) in used]
        if wrong:
            raise Rejected(wrong)
        return tables


def _driver(file: str, values: dict[str, Any], v_max: float | None, v_min: float) -> Driver:
    if not values:
        if v_max is None or not v_max > 0.0:
            raise NoRange("give v_max, the driver's maximum output in V, or a scanner file that has it")
        return Driver(v_max, v_min)
    high, low = values.get("v_max"), values.get("v_min", 0.0)
    if not isinstance(high, int | float) or isinstance(high, bool) or not high > 0.0:
        raise Rejected([Problem(file, 0, "v_max", "missing, or not a voltage")])
    if v_max is not None and v_max != high:
        raise Rejected([Problem(file, 0, "v_max", f"{high:g} there, and --v-max {v_max:g}")])
    if isinstance(low, bool) or not isinstance(low, int | float) or not low <= 0.0:
        raise Rejected([Problem(file, 0, "v_min", "not a voltage of 0 or less")])
    if v_min not in (0.0, low):
        raise Rejected([Problem(file, 0, "v_min", f"{low:g} there, and --v-min {v_min:g}")])
    return Driver(float(high), float(low))
