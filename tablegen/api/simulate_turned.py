"""Simulate a scan at an angle: a whole frame of both axes on a virtual scanner."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from msgspec.structs import replace

from tablegen.api.laboratory import Laboratory
from tablegen.api.result import Result
from tablegen.api.turned import TurnedBuild
from tablegen.base.blas_threads import one_blas_thread
from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.certificate.turned_errors import certify_turned
from tablegen.charts.picture_file import PlottedCharts
from tablegen.config.load import Setup, load
from tablegen.planning.turned_plan import make_turned_plan
from tablegen.virtual import turned_report
from tablegen.virtual.parameters import BUILT_IN
from tablegen.virtual.turned_report import FrameStage
from tablegen.virtual.turned_run import BUILT, TurnedPlant, frame_rows, own_plants, own_samples

OWN = "own"


@one_blas_thread
def simulate_turned(
    scan: str | Path | Setup,
    truth: str | Path = OWN,
    *,
    calibrated: bool = True,
    noise_percent: float = 0.2,
    seed: int = 0,
    progress: Callable[[str], object] = lambda _: None,
) -> "SimulatedTurned":
    """Simulate a scan at an angle, on coupled axes or with drift: straight lines, and the emitted integers.

    Parameters
    ----------
    scan : path or Setup
        Scan file, or a result of ``load``.
    truth : {"own", "default", "duhem"} or path
        Scanner to play on; "own" are the operators of the scanner file. The axes of a built-in one couple as the
        scanner file says.
    calibrated : bool
        True to play also with operators that were identified on simulated traces; not for "own".
    noise_percent : float
        Noise of these traces, rms, in percent.
    seed : int
        Random seed of the noise, and of the errors of "own".
    progress : callable
        Called with a text for each stage.

    Returns
    -------
    SimulatedTurned
        ``record`` has the errors; ``stages`` the positions over the frame.

    Raises
    ------
    Rejected
        The scan or the virtual scanner is wrong, or an axis has no operator.
    Unphysical
        Nothing can be played.

    Examples
    --------
    >>> try:
    ...     print(tablegen.simulate_turned("scan.toml").summary())
    ... except tablegen.Rejected as rejected:  # a scan that `simulate` plays
    ...     print(rejected.problems[0].why)
    this scan has no angle, coupling or drift; `simulate` plays it
    """
    setup = scan if isinstance(scan, Setup) else load(scan)
    if not setup.mixes_motions:
        why = "this scan has no angle, coupling or drift; `simulate` plays it"
        raise Rejected([setup.scan_file.problem("name", why)])
    laboratory = None if truth == OWN else Laboratory(truth, setup.scanner)
    plan = make_turned_plan(setup, progress)
    built = TurnedBuild(setup, plan, certify_turned(plan, progress))
    if laboratory is None:
        rows = frame_rows(setup, plan, own_plants(setup, plan, seed), own_samples(plan), progress)
        return _checked(SimulatedTurned(built, OWN, "", (FrameStage("own", "", rows, own=True),)))
    scanner = laboratory.scanner
    coupling = setup.scanner.coupling if truth in BUILT_IN else scanner.coupling
    plant = TurnedPlant(scanner.x, scanner.y, coupling, setup.scan.drift_nm_per_s)
    heading = "with the scanner file as it is; its operators are those of the piezo on which they were measured"
    stages = [FrameStage("given", heading, frame_rows(setup, plan, [plant], tell=progress))]
    if calibrated:
        stages.append(_calibrated(setup, laboratory, plant, noise_percent, seed, progress))
    name = laboratory.truth.name + (f", {laboratory.scaled}" if laboratory.scaled else "")
    return _checked(SimulatedTurned(built, name, laboratory.truth.identified_on, tuple(stages)))


def _checked(simulated: "SimulatedTurned") -> "SimulatedTurned":
    """Return a simulation in which the emitted integers were played at least once."""
    rows = [row for stage in simulated.stages for row in stage.rows if row.correction == BUILT]
    if not any(row.errors for row in rows):
        raise Unphysical("\n".join(dict.fromkeys(row.rejected for row in rows)))
    return simulated


def _calibrated(
    setup: Setup,
    laboratory: Laboratory,
    plant: TurnedPlant,
    noise_percent: float,
    seed: int,
    progress: Callable[[str], object],
) -> FrameStage:
    from tablegen.virtual.operator_day import with_operators

    heading = f"with operators identified on the virtual scanner's own traces, {noise_percent:g} % noise"
    try:
        with TemporaryDirectory() as folder:
            after = with_operators(setup, laboratory.scanner, Path(folder), 0.01 * noise_percent, seed, progress)
            after = replace(after, scanner=replace(after.scanner, coupling=plant.coupling))
            plan = make_turned_plan(after, progress)
        return FrameStage("calibrated", heading, frame_rows(after, plan, [plant], tell=progress))
    except Rejected as faults:
        return FrameStage("calibrated", heading, (), "; ".join(problem.why for problem in faults.problems))
    except (Unphysical, ValueError) as reason:
        return FrameStage("calibrated", heading, (), str(reason))


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedTurned(Result):
    """A scan at an angle on a virtual scanner, ``truth`` its name; ``stages`` as for ``SimulatedScan``.

    ``built`` is the certified scan, ``identified_on`` the source of the scanner's parameters.
    """

    built: TurnedBuild
    truth: str
    identified_on: str
    stages: tuple[FrameStage, ...]

    @property
    def record(self) -> dict[str, Any]:
        """The errors as plain data, as ``tablegen simulate --json`` prints them."""
        plain = turned_report.data(self.built.plan, self.truth, self.stages, self.identified_on)
        residual, duration = self.built.brief()
        return {**plain, "answer": residual, "duration": duration}

    def summary(self) -> str:
        """Return what ``tablegen simulate`` prints: the errors with and without the correction."""
        text = turned_report.text(self.built.plan, self.truth, self.stages, self.identified_on)
        return "\n".join([*self.built.brief(), "", *text])

    def charts(self) -> PlottedCharts:
        """Return the errors over the image, and a lattice in it, of each row."""
        from tablegen.html_report.turned_simulated import frame_charts

        return frame_charts(self.built.plan, self.stages)

    def csv(self) -> str:
        """Return drives and positions of a frame, as ``tablegen simulate --csv`` writes them."""
        return turned_report.csv(self.built.plan, self.stages)

    def _lines(self) -> Sequence[str]:
        played = [row for stage in self.stages for row in stage.rows if row.errors]
        residual = played[-1].summary()["rms"][0]
        return (
            f"simulation of {self.built.name!r} at {self.built.plan.geometry.angle_deg:g} degrees",
            f"on {'its own operators' if self.truth == OWN else f'the virtual scanner {self.truth!r}'}",
            f"residual {residual:.3f} % rms with the {played[-1].correction} correction",
        )
