"""The operator model: the waveform that an identified operator follows straight, learnt when a scan is built."""

from dataclasses import replace
from math import sqrt
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta, structs

from tablegen.base.figures import shown_path
from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.base.quantities import FileName
from tablegen.compensation.branches import WithBranches
from tablegen.compensation.dynamics import Response, capped_inverse
from tablegen.compensation.expectation import Expectation, Figure
from tablegen.compensation.hysteresis import BranchShape
from tablegen.compensation.identification import Identification
from tablegen.compensation.line import AccelerationTrade, LineRequest, LineShape, SineLine, WholeLine
from tablegen.compensation.model_problems import ModelProblems
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.file import read_operator
from tablegen.compensation.operator.loop import Loop
from tablegen.compensation.operator.minimum_acceleration_line import minimum_acceleration_waveform
from tablegen.compensation.operator.operator import CENTRE_REACH, SMALL_STROKE, STROKE_REACH, Operator
from tablegen.compensation.operator.piezo import OperatorPiezo, departing
from tablegen.compensation.operator.scan_line import (
    ExpectedErrors,
    LearntWaveform,
    TargetLine,
    learn_waveform,
    size_sine,
)
from tablegen.compensation.operator.transient import (
    SLOWEST_HZ,
    SettledLine,
    after_offset,
    after_size,
    transient_between,
)
from tablegen.compensation.operator.uncertainty import possible_errors, size_uncertainty
from tablegen.compensation.transient import Transient
from tablegen.numerics.driver import Driver
from tablegen.waveform.series import FourierSeries
from tablegen.waveform.window_fit import fit_window

_BEND_UNKNOWN = 0.7  # of what a loop grows by its bend; on simulated piezos of four kinds it was wrong by less
SIDES = ("forward", "backward")


class OperatorIdentification(Identification, frozen=True, kw_only=True, eq=False):
    """The piezo as the operator knows it, at the rate and offset of a line.

    ``operator`` is that of this rate, ``factor`` that of its loops at the mean of the line's drive, and ``between``
    which share of the size is uncertain since the turns of the drive are not even about that mean. ``settled`` is the
    line as the operator plays it.
    """

    operator: Operator
    factor: float
    between: float
    settled: SettledLine

    def piezo(self, driver: Driver, response: Response | None, seed: tuple[int, ...] | None = None) -> OperatorPiezo:
        """Return the piezo that does what the operator says, or that departs from it at random."""
        response = self.operator.dynamics(response)
        operator, factor = self.operator, self.factor
        if seed is not None:
            operator = departing(operator, seed)
            factor *= 1.0 + self.between * float(np.random.default_rng((*seed, 1)).standard_normal())
        return OperatorPiezo(operator, factor, driver, response)

    def transient_from(self, before: Identification) -> Transient | None:
        """Return the transient of this line after another one, by this operator."""
        if not isinstance(before, OperatorIdentification):
            return None
        return transient_between(_creeping_late(self.operator), before.settled, self.settled, self.factor)


class OperatorModel(WithBranches, frozen=True, kw_only=True, tag="operator"):
    """The operator of `tablegen calibrate operator`: in a file, for every size, offset and rate. Branches may stay."""

    purpose: ClassVar[str] = "identified from traces"
    calibration: ClassVar[str] = "`calibrate operator`"
    order: ClassVar[int] = 3
    counts_turns: ClassVar[bool] = True
    identified: ClassVar[bool] = True

    file: Annotated[FileName, Meta(description="the operator's file, relative to the scanner file")]

    @property
    def calibrated(self) -> bool:
        """True: the file is a calibration."""
        return True

    @classmethod
    def like(cls, other: object) -> "OperatorModel | None":
        """Return the operator of another table that has one; branches make no operator."""
        return other if isinstance(other, cls) else None

    def files(self) -> tuple[str, ...]:
        """Return the operator's file."""
        return (self.file,)

    @property
    def operator_file(self) -> str:
        """The operator's file."""
        return self.file

    def line(self, request: LineRequest, problems: ModelProblems) -> LineShape | None:
        """Learn the waveform on the operator, starting from a straight line."""
        operator = self._read(request, problems)
        if operator is None or not request.size_nm > 0.0 or not 0.0 <= request.v_share <= 1.0:
            return None  # a size or an offset that was refused, and no line to look for
        with problems.at("file"):
            _check_sense(operator, request)
            return _line(operator, request, problems)
        return None

    def loop(
        self, request: LineRequest, low: float, high: float, problems: ModelProblems
    ) -> tuple[Loop, LogarithmicCreep, Response | None] | None:
        """Return the loop of the operator, of the size that it gives, its creep, and the dynamics behind them."""
        operator = self._read(request, problems)
        if operator is None:
            return None
        with problems.at("file"):
            _check_sense(operator, request)
            _check_reach(operator, high - low, 0.5 * (low + high), request.driver)
            here, factor = _at(operator, request)
            return here.loop(low, high, factor, request.v_share), here.creep, operator.dynamics(request.response)
        return None

    def _read(self, request: LineRequest, problems: ModelProblems) -> Operator | None:
        """Read the operator of the file; None where it does not serve, with the reason in ``problems``."""
        path, before = request.folder / self.file, problems.count
        try:
            operator, file = read_operator(path, shown_path(path))
        except Rejected as rejected:
            problems.extend(rejected.problems)
            return None
        if file.axis != request.axis:
            why = f"{self.file} is the operator of {file.axis}; [{request.axis}.hysteresis] needs a model of its own"
            problems.add("file", why)
        for key in ("v_max", "v_min"):
            its, ours = getattr(file, key), getattr(request.driver, key)
            if abs(its - ours) > 1e-6 * request.driver.span:
                problems.add("file", f"{self.file} was identified with {key} = {its:g} V, not {ours:g} V")
        return operator if problems.count == before else None

    def described(self, line: LineShape) -> str:
        """Return the model and the name of its file."""
        return f"{self.model()} {Path(self.file).name}"


def _at(operator: Operator, request: LineRequest) -> tuple[Operator, float]:
    """Return the operator at this rate, and the factor of its loops at this offset."""
    factor = request.factor_at(request.v_share) / request.factor_at(operator.centre)
    operator = replace(operator, creep=operator.creep.down_to(request.rate_hz)).at_rate(request.rate_hz)
    # (23), a straight line over the logarithm of the rate, says what it does to the size where creep does not.
    if request.rate_gain is not None and not operator.knows_rates:
        factor *= request.rate_gain(request.rate_hz) / request.rate_gain(operator.creep.reference_hz)
        operator = replace(operator, creep=structs.replace(operator.creep, reference_hz=request.rate_hz))
    return operator, factor


def _line(operator: Operator, request: LineRequest, problems: ModelProblems) -> WholeLine | None:
    centre, dynamics = request.v_share, operator.dynamics(request.response)
    operator, factor = _at(operator, request)
    at_offset = request.factor_at(centre)

    def with_mean(mean: float) -> float:
        return request.factor_at(mean) / at_offset

    line = TargetLine(
        request.size_nm, request.turn, request.window, request.both, request.rate_hz, centre, factor, with_mean
    )
    response, boost = request.response, request.max_boost_db
    n = np.arange(1.0, request.harmonics + 1.0) * request.rate_hz

    def through(series: FourierSeries) -> FourierSeries:
        return series

    if response is not None:
        real, imaginary, _ = capped_inverse(response, n, boost)

        def through(series: FourierSeries) -> FourierSeries:
            return series.times(real, imaginary)

    if request.sine:
        solution, place = size_sine(operator, line, through, dynamics)
        return _made(operator, request, factor * with_mean(solution.mean), solution, None, place)
    straight = LineShape(request.turn, BranchShape(), BranchShape())
    start = fit_window(straight, request.harmonics, request.window, request.both)
    solution = learn_waveform(operator, line, start, through, dynamics)
    trade: AccelerationTrade | None = None
    if request.allowed is not None:
        try:
            traded = minimum_acceleration_waveform(operator, line, solution, request.allowed.percent, through, dynamics)
            solution = traded.waveform
            trade = AccelerationTrade(request.allowed.percent, traded.straight_series, traded.beside_percent)
        except Unphysical as reason:
            if request.allowed.firm:
                problems.add_to_scan("band_limit.max_scaling_error_percent", str(reason))
                return None
    return _made(operator, request, factor * with_mean(solution.mean), solution, trade)


def _made(
    operator: Operator,
    request: LineRequest,
    factor: float,
    solution: LearntWaveform,
    trade: AccelerationTrade | None,
    place: FourierSeries | None = None,
) -> WholeLine:
    """Return the line of a waveform in the units of the laws, with what the operator knows of it; of a sine by place.

    ``factor`` is that of the operator's loops at the mean of the drive.
    """
    between = _BEND_UNKNOWN * solution.grown
    _check_reach(operator, solution.stroke, solution.centre, request.driver)
    if not request.v_amplitude > 0.0:
        raise Unphysical(
            f"the operator makes {request.size_nm:.6g} nm with {solution.stroke * request.driver.span:.4g} V, and "
            f"[{request.axis}.size] refuses them: the two contradict each other; calibrate `size` again, or lower the "
            "size"
        )
    # w = 0 and 1 are the ends of the laws' amplitude everywhere else.
    scale = solution.v_amplitude * request.driver.span / request.v_amplitude

    def scaled(series: FourierSeries) -> FourierSeries:
        return FourierSeries(0.5 + scale * (series.a0 - 0.5), scale * series.a, scale * series.b)

    series = scaled(solution.series)
    if trade is not None and trade.straight_series is not None:
        trade = structs.replace(trade, straight_series=scaled(trade.straight_series))
    identification = OperatorIdentification(
        traces=operator.lines,
        expectation=_expectation(operator, solution, _uncertainty(operator, request, solution)),
        unmeasured_percent=solution.unmeasured_percent,
        transients=_transients(_creeping_late(operator), request, solution, factor),
        operator=operator,
        factor=factor,
        between=between,
        settled=SettledLine.about(solution.stroke, solution.centre, request.turn, 1.0 / request.rate_hz),
    )
    if place is not None:
        return SineLine.of(series, request.turn, place=place, identification=identification)
    return WholeLine.of(series, request.turn, trade=trade, identification=identification)


def _creeping_late(operator: Operator) -> Operator:
    """Return the operator with creep for all that a few frames may last."""
    return replace(operator, creep=operator.creep.down_to(SLOWEST_HZ))


def _transients(
    operator: Operator, request: LineRequest, solution: LearntWaveform, factor: float
) -> tuple[Transient, Transient]:
    """Return what follows a change of offset, and a smaller scan."""
    line = (solution.stroke, solution.centre, factor, request.turn, 1.0 / request.rate_hz)

    def factor_ratio(centre: float) -> float:
        return request.factor_at(centre) / request.factor_at(solution.mean)

    return after_offset(operator, *line, factor_ratio), after_size(operator, *line)


def _expectation(operator: Operator, solution: LearntWaveform, by: ExpectedErrors) -> Expectation:
    """Return the expected errors of a learnt waveform, uncertain by others, in percent.

    What the response is not measured for is added, since nobody knows how both fall together.
    """
    errors, beyond = solution.expected, solution.unmeasured
    return Expectation(
        "traces",
        {side: Figure(errors.rms[i], by.rms[i] + beyond.rms[i]) for i, side in enumerate(SIDES)},
        {side: Figure(errors.scaling[i], by.scaling[i] + beyond.scaling[i]) for i, side in enumerate(SIDES)},
        Figure(errors.mismatch, by.mismatch + beyond.mismatch),
        Figure(errors.size, by.size + beyond.size),
        100.0 * operator.distance(solution.stroke, solution.centre),
    )


def _check_sense(operator: Operator, request: LineRequest) -> None:
    """Refuse an operator that stands still or runs backwards at small drives, to which its size refers."""
    for centre in (operator.centre, request.v_share):
        extent = operator.family.extent(SMALL_STROKE, centre)
        if not extent > 0.0:
            driver = request.driver
            raise Unphysical(
                f"at {driver.volts(centre):.4g} V it moves by {extent:.4g} nm for {SMALL_STROKE * driver.span:.4g} V, "
                "and no piezo stands still or runs backwards; calibrate it again"
            )


def _check_reach(operator: Operator, stroke: float, centre: float, driver: Driver) -> None:
    """Refuse a stroke or centre far from everything that was measured."""
    largest = max(line.stroke for line in operator.lines)
    if stroke > largest + STROKE_REACH:
        raise Unphysical(
            f"measured up to {largest * driver.span:.4g} V, which serves scans up to "
            f"{(largest + STROKE_REACH) * driver.span:.4g} V; this one takes {stroke * driver.span:.4g} V; "
            "measure a larger trace"
        )
    nearest = min((abs(line.centre - centre), line.centre) for line in operator.lines)
    if nearest[0] > CENTRE_REACH:
        raise Unphysical(
            f"measured at an offset of {driver.volts(nearest[1]):.4g} V, which serves "
            f"{CENTRE_REACH * driver.span:.4g} V to either side; this scan is at {driver.volts(centre):.4g} V; "
            "measure a trace there"
        )


def _uncertainty(operator: Operator, request: LineRequest, solution: LearntWaveform) -> ExpectedErrors:
    """Return the possible errors besides the waveform's: departures of the piezo from the operator, more for the size.

    The size depends on (23) or creep from the nearest rate too, and on the bend of the loop: from a triangle's trace
    only the bend tells what depends on the mean of the drive, and what on the middle between the turns.
    """
    rms, scaling, mismatch, size = possible_errors(operator, solution.stroke, solution.centre)
    rate = min(abs(_rate_change(operator, request, line.rate_hz)) for line in operator.lines)
    by = size_uncertainty((rate,))
    size = sqrt(size * size + by * by + (100.0 * _BEND_UNKNOWN * solution.grown) ** 2)
    return ExpectedErrors((rms, rms), (scaling, scaling), mismatch, size)


def _rate_change(operator: Operator, request: LineRequest, rate_hz: float) -> float:
    """Return by which share lines are larger at a rate than at that of the scan."""
    if request.rate_gain is not None and not operator.knows_rates:
        return request.rate_gain(request.rate_hz) / request.rate_gain(rate_hz) - 1.0
    both = np.array([rate_hz, request.rate_hz])
    real, imaginary = operator.creep.response(both)
    there, here = np.sqrt(real * real + imaginary * imaginary).tolist()
    return float(there / here) - 1.0


MODEL = OperatorModel
