"""The request of a scan and of its axes, before a model is asked: schedule, clocks, voltages, and harmonics."""

from typing import Literal

from msgspec import Struct

from tablegen.base.input_errors import Problems
from tablegen.config.load import Setup
from tablegen.device.schedule import Schedule
from tablegen.planning.feasibility import Feasibility
from tablegen.planning.harmonic_choice import HarmonicChoice
from tablegen.planning.timing import AxisTiming, make_schedule
from tablegen.planning.voltages import Voltages, axis_voltages


class AxisRequest(Struct, frozen=True, eq=False):
    """One axis of a scan as its files ask for it.

    ``harmonics`` are those of a model that makes the whole waveform itself. ``feasible`` and ``choice`` go on reporting
    to the problems of the request.
    """

    axis: Literal["x", "y"]
    timing: AxisTiming
    feasible: Feasibility
    choice: HarmonicChoice
    voltages: Voltages
    harmonics: int

    @classmethod
    def of(cls, setup: Setup, axis: Literal["x", "y"], schedule: Schedule, problems: Problems) -> "AxisRequest":
        """Return the request of an axis; what contradicts the calibration or the hardware goes to ``problems``."""
        timing = AxisTiming.of(setup, axis, schedule)
        feasible = Feasibility(setup, axis, problems)
        choice = HarmonicChoice(setup, axis, timing.rate, timing.period, feasible, problems)
        feasible.check_table(timing.period)
        voltages = axis_voltages(setup, axis, float(timing.rate), problems)
        return cls(axis, timing, feasible, choice, voltages, choice.for_straight_line(voltages.allowed))


class ScanRequest(Struct, frozen=True, eq=False):
    """Both axes of a scan and their schedule, whose settling lines are not known where they are ``auto``."""

    schedule: Schedule
    x: AxisRequest
    y: AxisRequest

    @classmethod
    def of(cls, setup: Setup) -> "ScanRequest":
        """Return the request of a scan.

        Raises
        ------
        Rejected
            With every contradiction that is seen without a model.
        """
        problems = Problems()
        schedule = make_schedule(setup, problems)
        problems.stop_if_any()
        assert schedule is not None
        x, y = AxisRequest.of(setup, "x", schedule, problems), AxisRequest.of(setup, "y", schedule, problems)
        problems.stop_if_any()
        return cls(schedule, x, y)
