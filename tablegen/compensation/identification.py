"""What a model that was identified on traces of the piezo knows beyond the waveform of a line.

A model of the laws of the scanner file knows nothing of this, and leaves every answer at its default.
"""

from typing import Protocol

from msgspec import Struct

from tablegen.compensation.dynamics import Response
from tablegen.compensation.expectation import Expectation
from tablegen.compensation.transient import Transient
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver


class MeasuredLine(Struct, frozen=True):
    """One trace of a model's calibration: its place, and its errors when it is left out of the fit.

    Strokes and centres are shares of v_max. ``left_out`` is the rms residual, the scaling error and the mismatch of
    trace and retrace inside the window, in percent, and the error of the size in percent; ``in_fit`` is what remains of
    these where the trace is not left out, that is noise.
    """

    name: str
    stroke: float
    centre: float
    rate_hz: float
    left_out: tuple[float, float, float, float]
    in_fit: tuple[float, float, float, float]


class SettledAxis(Protocol):
    """An axis on which a period is played."""

    def settled(self, volts: Floats, tick_s: float) -> Floats:
        """Return the displacement in the middle of each tick of a settled period.

        Parameters
        ----------
        volts
            One period in V, held tick by tick, shape (ticks,).
        tick_s
            Length of a tick in s.

        Returns
        -------
        Displacement in nm, shape (ticks,).
        """


class Identification(Struct, frozen=True, kw_only=True, eq=False):
    """The piezo as a model knows it, at the offset and the rate of one line.

    ``traces`` are those that the model was identified on, ``expectation`` are the expected errors of the line on the
    scanner, ``transients`` those after a change of offset and after one of size. ``unmeasured_percent`` is the rms, in
    percent of the line, of what the position has above the highest frequency at which the response was measured.
    """

    traces: tuple[MeasuredLine, ...] = ()
    expectation: Expectation | None = None
    transients: tuple[Transient, Transient] | None = None
    unmeasured_percent: float = 0.0

    def piezo(
        self, driver: Driver, response: Response | None, seed: tuple[int, ...] | None = None
    ) -> SettledAxis | None:
        """Return the piezo of this model for simulations; None where the model cannot play one.

        With a ``seed`` the piezo departs from the model at random, by the model's own uncertainty.
        """
        return None

    def transient_from(self, before: "Identification") -> Transient | None:
        """Return the transient of this line after another line of the same axis; None where the model knows none."""
        return None


NO_IDENTIFICATION = Identification()
