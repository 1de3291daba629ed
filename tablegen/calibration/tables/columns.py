"""Columns of measurements: a quantity, its unit in the name, and the range that it can have."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import degrees, inf

Conversion = Callable[[float], float]


@dataclass(frozen=True, slots=True)
class Times:
    """A conversion that is a factor."""

    factor: float

    def __call__(self, value: float) -> float:
        """Return the value in the unit of the fits."""
        return value * self.factor


_VOLTS = {"v": Times(1.0), "mv": Times(1e-3), "kv": Times(1e3)}
_NANOMETRES = {"nm": Times(1.0), "pm": Times(1e-3), "um": Times(1e3), "mm": Times(1e6), "m": Times(1e9)}
_SECONDS = {"s": Times(1.0), "ms": Times(1e-3), "us": Times(1e-6), "ns": Times(1e-9)}
_HERTZ = {"hz": Times(1.0), "khz": Times(1e3), "mhz": Times(1e6)}
_GAIN: Mapping[str, Conversion] = {"": Times(1.0), "db": lambda value: 10.0 ** (value / 20.0)}
_DEGREES: Mapping[str, Conversion] = {"deg": Times(1.0), "rad": degrees}
_NUMBER = {"": Times(1.0)}


# No quantity that has to be above 0 is as small as this in any of these units, and nothing divided by it overflows.
_SMALLEST = 1e-12


@dataclass(frozen=True, slots=True)
class Column:
    """One quantity: its units, the first of which is what the fits take, and the open range of its values there.

    ``words`` are the names that the field has for it, one of which a header of another program has to have;
    ``qualifiers`` may stand beside them. ``needs_unit`` is True if such a name alone may be another quantity.
    """

    quantity: str
    units: Mapping[str, Conversion]
    above: float = -inf
    below: float = inf
    words: tuple[str, ...] = ()
    qualifiers: tuple[str, ...] = ()
    needs_unit: bool = False

    @property
    def name(self) -> str:
        """The name of the column in the unit of the fits, such as ``offset_v``."""
        return self.spelt(next(iter(self.units)))

    def spelt(self, unit: str) -> str:
        """Return the name of the column in one of its units."""
        return f"{self.quantity}_{unit}" if unit else self.quantity


_SIZES = ("size", "scan", "length", "width")
_VOLTAGES = ("voltage", "volts", "volt", "piezo", "scan")

OFFSET = Column("offset", _VOLTS, -1e6, 1e6, ("offset", "bias"), (*_VOLTAGES, "dc"))
SIZE = Column("size", _VOLTS, _SMALLEST, 1e6, ("size",), (*_VOLTAGES, "pp", "peak", "to"), needs_unit=True)
APPARENT = Column("apparent", _NANOMETRES, _SMALLEST, 1e12, ("apparent",), (*_SIZES, "lattice", "constant"))
TRUE = Column("true", _NANOMETRES, _SMALLEST, 1e12, ("true",), (*_SIZES, "lattice", "constant"))
NOMINAL = Column("nominal", _NANOMETRES, _SMALLEST, 1e12, ("nominal",), (*_SIZES, "set"))
ACTUAL = Column("actual", _NANOMETRES, _SMALLEST, 1e12, ("actual", "measured"), (*_SIZES, "sensor"))
DRIVE = Column(
    "drive",
    _VOLTS,
    -1e6,
    1e6,
    ("drive", "dac", "voltage", "command", "excitation", "output", "volts"),
    ("out", "piezo", "hv", "amplifier", "amp", "input", "signal", "controller", "x", "y", "axis", "pp"),
)
TIME = Column("time", _SECONDS, -1e12, 1e12, ("time", "t", "timestamp", "zeit"), ("elapsed", "stamp", "axis"))
DISPLACEMENT = Column(
    "displacement",
    _NANOMETRES,
    -1e12,
    1e12,
    ("displacement", "position", "pos", "disp", "sensor"),
    ("piezo", "measured", "actual", "stage", "capacitive", "signal", "x", "y", "axis", "feedback", "out"),
)
FREQUENCY = Column("frequency", _HERTZ, _SMALLEST, 1e12, ("frequency", "freq", "f"))
GAIN = Column("gain", _GAIN, _SMALLEST, 1e12, ("gain", "magnitude", "mag"), ("ratio",))
PHASE = Column("phase", _DEGREES, -1e6, 1e6, ("phase",), ("shift", "angle"))
TRACE = Column("trace", _NUMBER, -1e9, 1e9)
_POSITION = ("position", "pos", "displacement", "sensor", "stage", "axis", "piezo", "measured", "actual", "signal")
POSITION_X = Column("x", _NANOMETRES, -1e12, 1e12, ("x",), _POSITION)
POSITION_Y = Column("y", _NANOMETRES, -1e12, 1e12, ("y",), _POSITION)
