"""The one pipeline from a setup to a certified plan: plan, certify, compare with the limits of the scan file."""

from collections.abc import Callable
from functools import partial

from msgspec import Struct

from tablegen.base.input_errors import Problem
from tablegen.certificate.certificate import (
    Certificate,
    EmittedPeriods,
    broken_limits,
    certify,
    limited_figures,
    steps_beyond_guard,
)
from tablegen.certificate.scan_warnings import limit_advice
from tablegen.config.load import Setup
from tablegen.planning.line_plan import Plan, SampleCost, make_plan


class CertifiedScan(Struct, frozen=True, eq=False):
    """A setup, its plan, the certificate of each axis ("x", "y"), and the limits of the scan file that are exceeded."""

    setup: Setup
    plan: Plan
    certificates: dict[str, Certificate]
    broken: tuple[Problem, ...]


def certify_scan(
    setup: Setup, progress: Callable[[str], object] = lambda _: None, *, remedies: bool = True
) -> CertifiedScan:
    """Plan and certify a scan.

    Parameters
    ----------
    setup
        A validated scan with its scanner.
    progress
        Called with each stage, in words.
    remedies
        Plan and measure remedies for a limit that is exceeded, and name them in its problem.

    Raises
    ------
    Rejected
        With every contradiction between the scan, the scanner and the hardware.
    """
    progress("shaping the waveforms")
    return certify_planned(setup, make_plan(setup, sines=True), progress, remedies=remedies)


def certify_planned(
    setup: Setup,
    plan: Plan,
    progress: Callable[[str], object] = lambda _: None,
    *,
    remedies: bool = True,
    periods: EmittedPeriods | None = None,
) -> CertifiedScan:
    """Certify the plan of a scan; parameters as for ``certify_scan`` and ``certify``."""
    progress("measuring every tick of a line and a frame")
    certificates = certify(plan, periods)
    advise = partial(limit_advice, setup, plan, certificates) if remedies else _no_advice
    broken = broken_limits(plan, certificates, setup.scan_file, advise, setup.hardware_problem)
    broken += [problem for line in plan.lines if (problem := too_dear(setup, line.axis, line.sample_cost))]
    broken += _beyond_limit_of_tilts(setup, plan)
    return CertifiedScan(setup, plan, certificates, tuple(broken))


def breaks_limit(setup: Setup, periods: EmittedPeriods) -> bool:
    """Return True if a plan exceeds a limit: what its certificate is refused for, without the rest of it."""
    plan, limits = periods.plan, periods.plan.limits
    if any(too_dear(setup, line.axis, line.sample_cost) is not None for line in plan.lines):
        return True
    if limits.max_error_lsb is None and limits.max_scaling_error_percent is None:
        return steps_beyond_guard(periods)
    return bool(broken_limits(plan, limited_figures(periods), setup.scan_file) or _beyond_limit_of_tilts(setup, plan))


def _beyond_limit_of_tilts(setup: Setup, plan: Plan) -> list[Problem]:
    """Return problems where codes of outputs beside x and y are off by more than the scan file allows."""
    limit, problems = plan.limits.max_error_lsb, []
    nearer = "more harmonics of x bring" if plan.schedule.pixel_table is None else "a smaller slope brings"
    for tilt in plan.tilts:
        error = tilt.errors.error_lsb
        if limit is not None and error > limit:
            why = f"{tilt.name} errs by up to {error:.4g} LSB, above {limit:g}; {nearer} it closer to the plane"
            problems.append(setup.scan_file.problem("limits.max_error_lsb", why))
    return problems


def too_dear(setup: Setup, axis: str, takes: SampleCost | None) -> Problem | None:
    """Return a problem where a sample of an axis takes more instructions than the scan file allows."""
    if takes is None or takes.max_instructions is None or takes.instructions <= takes.max_instructions:
        return None
    auto = f"with [{axis}.table] mode = 'auto' the build looks for a table that takes no more"
    why = f"the {axis} axis takes {takes}, above {takes.max_instructions:g}; {takes.remedy or auto}"
    return setup.scan_file.problem("cost.max_instructions", why)


def _no_advice(_axis: str) -> str:
    return ""
