"""Read the tables of a recorder: which column is which, and whether its voltages are at the piezo."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path

from tablegen.base.input_errors import Problem, Rejected
from tablegen.calibration.tables.columns import DRIVE, OFFSET, SIZE, Column
from tablegen.calibration.tables.header import ColumnChoice
from tablegen.calibration.tables.table import MeasuredTable, read_table

_LEAST_GAIN, _MOST_GAIN, _MOST_OFFSET = 1e-6, 1e6, 1e5

Columns = str | Mapping[str, str | int]


@dataclass(frozen=True)
class Recorder:
    """Columns of a recorder, and the amplifier between the voltage that it recorded and the piezo.

    V at the piezo = ``drive_gain`` x recorded V + ``drive_offset``; None for both means that the voltages are said to
    be at the piezo, which the checks of a trace may doubt. A gain of 1 confirms it.
    """

    columns: Columns | None = None
    drive_gain: float | None = None
    drive_offset: float | None = None

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises
        ------
        ValueError
            If the gain is 0 or no number, or the offset is no voltage.
        """
        if self.drive_gain is not None and not _LEAST_GAIN <= abs(self.drive_gain) <= _MOST_GAIN:
            raise ValueError(f"a drive gain of {self.drive_gain:g} is not within {_LEAST_GAIN:g}..{_MOST_GAIN:g}")
        offset = self.drive_offset or 0.0
        if not (isfinite(offset) and abs(offset) <= _MOST_OFFSET):
            raise ValueError(f"a drive offset of {offset:g} V is not within {_MOST_OFFSET:g} V")

    @property
    def states_gain(self) -> bool:
        """True if the user stated how recorded voltages become those at the piezo."""
        return self.drive_gain is not None

    def choice(self, expected: Sequence[Column]) -> ColumnChoice:
        """Return the choice of columns among those of a table.

        Raises
        ------
        Rejected
            If the choice is no list of them.
        """
        try:
            return ColumnChoice.parse(self.columns, expected)
        except ValueError as error:
            raise Rejected([Problem("--columns", 0, "", str(error))]) from None

    def read(
        self, path: Path, needed: Sequence[Column], optional: Sequence[Column] = (), peak_to_peak: bool = False
    ) -> MeasuredTable:
        """Read a file, with voltages at the piezo; ``peak_to_peak`` if drives are, to which no offset is added.

        Raises
        ------
        Rejected
            If the file or the choice of columns is faulty.
        """
        return self.at_piezo(read_table(path, needed, optional, self.choice([*needed, *optional])), peak_to_peak)

    def at_piezo(self, table: MeasuredTable, peak_to_peak: bool = False) -> MeasuredTable:
        """Return the table with voltages at the piezo.

        Raises
        ------
        Rejected
            If there is a gain or an offset, but no column of voltages.
        """
        if self.drive_gain is None and self.drive_offset is None:
            return table
        gain, offset = self.drive_gain or 1.0, self.drive_offset or 0.0
        columns = dict(table.columns)
        if not {DRIVE.name, OFFSET.name, SIZE.name} & set(columns):
            why = "has no column of voltages to which a drive gain could apply"
            raise Rejected([Problem(table.file, 0, "", why)])
        for column in (DRIVE, OFFSET, SIZE):
            if column.name in columns:
                spans = column is SIZE or (column is DRIVE and peak_to_peak)
                volts = columns[column.name]
                columns[column.name] = abs(gain) * volts if spans else gain * volts + offset
        return replace(table, columns=columns)


AS_WRITTEN = Recorder()
