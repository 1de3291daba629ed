"""Simulate a scan on a virtual scanner: the errors that remain, with each model of hysteresis."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from tablegen.api.laboratory import Laboratory
from tablegen.api.result import Result
from tablegen.base.blas_threads import one_blas_thread
from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.certificate.certificate import certify
from tablegen.certificate.error_answer import ErrorAnswer, duration, error_answers
from tablegen.charts.picture_file import PlottedCharts
from tablegen.config.load import Setup, load
from tablegen.planning.line_plan import make_plan
from tablegen.virtual import own_report, report
from tablegen.virtual.own_run import OwnRun, own_axes, simulate_own
from tablegen.virtual.parameters import Truth
from tablegen.virtual.report import SimulationStage
from tablegen.virtual.scanner import VirtualScanner
from tablegen.virtual.simulation import Run, models_of
from tablegen.virtual.simulation import simulate as play

OWN, DEFAULT = "own", "default"
_SINE = "a sine is simulated on the scanner file's own operator alone; leave --scanner-truth out, or take 'line'"


@one_blas_thread
def simulate(
    scan: str | Path | Setup,
    truth: str | Path | None = None,
    *,
    calibrated: bool = True,
    noise_percent: float = 0.2,
    seed: int = 0,
    progress: Callable[[str], object] = lambda _: None,
) -> "SimulatedScan":
    """Simulate a scan on a virtual scanner: the uncompensated triangle, and each model of hysteresis.

    Parameters
    ----------
    scan : path or Setup
        Scan file, or a result of ``load``.
    truth : {"own", "default", "duhem"} or path, optional
        Scanner to play on; "own" is the operator of the scanner file, and the default if the file has one.
    calibrated : bool
        True to play also with a calibration on simulated measurements; not for "own".
    noise_percent : float
        Noise of these measurements, rms, in percent.
    seed : int
        Random seed of the noise, and of the errors of "own".
    progress : callable
        Called with a text for each stage.

    Returns
    -------
    SimulatedScan
        ``record`` has the errors in percent of the line; ``stages`` or ``own_runs`` have the positions.

    Raises
    ------
    Rejected
        The scan or the virtual scanner is wrong, or y is off.
    Unphysical
        No model can be played.
    ValueError
        ``truth`` is "own", and the scanner file has no operator.

    Examples
    --------
    >>> simulated = tablegen.simulate("scan.toml", calibrated=False)
    >>> [run.model for run in simulated.stages[0].runs]
    ['triangle', 'sinusoidal', 'harmonic']
    """
    setup = scan if isinstance(scan, Setup) else load(scan)
    if setup.scan.y.off:
        raise Rejected([setup.scan_file.problem("y.motion", "'off' makes a line scan, and frames alone are simulated")])
    operators = own_axes(setup)
    if truth == OWN and not operators:
        raise ValueError(f"{setup.scanner_file.name} has no operator; identify one with calibrate_operator")
    if truth == OWN or (truth is None and operators):
        own_runs = tuple(simulate_own(setup, seed, progress))
        return SimulatedScan(setup.scan.name, None, (), own_runs, tuple(operators), *_answers(setup))
    if setup.scan.x.motion != "line":
        raise Rejected([setup.scan_file.problem("x.motion", _SINE)])
    name = truth or DEFAULT
    laboratory = Laboratory(name, setup.scanner)
    if laboratory.scanner.coupling:
        raise Unphysical(f"{truth}: [coupling] is played for a scan at an angle, on coupled axes or with drift alone")
    model, scanner = laboratory.truth, laboratory.scanner
    if laboratory.scaled:
        model = replace(model, name=f"{model.name}, {laboratory.scaled}")
    heading = "with the scanner file as it is"
    if operators:
        heading += "; its operator is that of the piezo on which it was measured"
    stages = [_played("given", heading, setup, scanner, str(name), progress)]
    if not stages[0].runs:
        raise Unphysical("\n".join(dict.fromkeys(why for _, reasons in stages[0].rejected for why in reasons)))
    if calibrated:
        stages.append(_calibrated(setup, scanner, str(name), noise_percent, seed, progress))
    return SimulatedScan(setup.scan.name, model, tuple(stages), (), (), *_answers(setup))


def _answers(setup: Setup) -> tuple[tuple[ErrorAnswer, ...], str]:
    """Return the error of each axis, and the time of an image; empty where the scan itself cannot be played."""
    try:
        plan = make_plan(setup, sines=True)
        certificates = certify(plan)
    except Rejected:  # the simulation says of each model why
        return (), ""
    return tuple(error_answers(setup, plan, certificates)), duration(plan.schedule)


def _calibrated(
    setup: Setup,
    scanner: VirtualScanner,
    truth: str,
    noise_percent: float,
    seed: int,
    progress: Callable[[str], object],
) -> SimulationStage:
    from tablegen.virtual.calibration_day import calibrate

    progress("calibrating")
    heading = f"with one calibrated on the virtual scanner's own data, {noise_percent:g} % noise"
    try:
        after = calibrate(setup, scanner, 0.01 * noise_percent, seed).setup
        return _played("calibrated", heading, after, scanner, truth, progress)
    except (Unphysical, ValueError) as reason:
        return SimulationStage("calibrated", heading, (), (("calibration", (str(reason),)),))


def _played(
    name: str, heading: str, setup: Setup, scanner: VirtualScanner, truth: str, progress: Callable[[str], object]
) -> SimulationStage:
    """Play every model that can be played, and collect the reasons of the others."""
    runs: list[Run] = []
    rejected: list[tuple[str, tuple[str, ...]]] = []
    for model in models_of(setup):
        progress(f"playing the {model} model, scanner file as {name}")
        try:
            runs.append(play(setup, scanner, model))
        except Rejected as faults:
            rejected.append((model, tuple(map(str, faults.problems))))
        except ValueError as reason:
            rejected.append((model, (f"{truth}: {reason}",)))
    return SimulationStage(name, heading, tuple(runs), tuple(rejected))


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedScan(Result):
    """A scan on a virtual scanner: ``stages`` of a built-in one or of a file, or ``own_runs`` on the own operator.

    ``answers`` has the error of each axis and ``duration`` the time of an image, as ``tablegen show`` prints them
    first; both are empty where only the triangle could be played.
    ``truth`` has the parameters of the virtual scanner, None on the own operator, whose axes are ``operators``.
    """

    name: str
    truth: Truth | None
    stages: tuple[SimulationStage, ...]
    own_runs: tuple[OwnRun, ...] = ()
    operators: tuple[str, ...] = ()
    answers: tuple[ErrorAnswer, ...] = ()
    duration: str = ""

    @property
    def record(self) -> dict[str, Any]:
        """The errors in percent as plain data, as ``tablegen simulate --json`` prints them."""
        if self.truth is None:
            plain = own_report.data(self.name, self.own_runs, self._without)
        else:
            plain = report.data(self.name, self.truth, self.stages)
        expected = {one.axis: one.record() for one in self.answers}
        return {**plain, "answers": expected, "duration": self.duration or None}

    def brief(self) -> list[str]:
        """Return the error of each axis, and the time of an image, as ``tablegen show`` prints them first."""
        return [*map(str, self.answers), *([self.duration] if self.duration else [])]

    @property
    def _without(self) -> list[str]:
        return [axis for axis in ("x", "y") if axis not in self.operators]

    def summary(self) -> str:
        """Return what ``tablegen simulate`` prints: the errors that remain with each correction."""
        if self.truth is None:
            text = own_report.text(self.name, self.own_runs, self._without)
        else:
            text = report.text(self.name, self.truth, self.stages)
        brief = self.brief()
        return "\n".join([*brief, *([""] if brief else []), *text])

    def charts(self) -> PlottedCharts:
        """Return residual and scaling error of each run."""
        from tablegen.html_report.simulated import own_charts, stage_charts

        return own_charts(self.name, self.own_runs) if self.truth is None else stage_charts(self.name, self.stages)

    def csv(self) -> str:
        """Return drive and displacement of a line of x and a frame of y, as ``tablegen simulate --csv`` writes them."""
        return report.csv(self.stages)

    def _lines(self) -> Sequence[str]:
        if self.truth is None:
            on, count = f"the own operator of {' and '.join(self.operators)}", len(self.own_runs[0].rows)
            played = ", ".join(row.correction for row in self.own_runs[0].rows)
        else:
            on, count = f"the virtual scanner {self.truth.name!r}", len(self.stages[-1].runs)
            played = ", ".join(run.model for run in self.stages[-1].runs)
        return f"simulation of {self.name!r}", f"on {on}", f"{count} corrections: {played}"
