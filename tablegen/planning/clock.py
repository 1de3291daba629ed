"""The clock of an FPGA: how many of its clocks a tick of the scan has, and whether the sequencer does with them."""

from fractions import Fraction

from tablegen.base.figures import at_least, at_most
from tablegen.base.input_errors import Problems
from tablegen.config.frame import exact
from tablegen.config.load import Setup
from tablegen.device.clocks import least_clocks, least_slow_clocks
from tablegen.device.dual_program import ScanProgram
from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.program import Program

_TOLERANCE = Fraction(1, 10000)  # of the rate; a crystal is as far off
_MOST = (1 << 31) - 1


def clocks_per_tick(setup: Setup, schedule: Schedule, programs: tuple[Program, Program], problems: Problems) -> int:
    """Return the clocks from tick to tick at ``emit.clock_hz``, 0 without this key or where ``problems`` grew."""
    return _clocks(setup, schedule, least_clocks(programs), problems)


def slow_clocks_per_tick(setup: Setup, program: ScanProgram, problems: Problems, of: str = "this scan") -> int:
    """Return the same for a program with a slow part on both axes, which a sequencer ``of`` the scan or z plays."""
    return _clocks(setup, program.schedule, least_slow_clocks(program), problems, of)


def _clocks(setup: Setup, schedule: Schedule, least: int, problems: Problems, of: str = "this scan") -> int:
    clock_hz = setup.scan.emit.clock_hz
    if clock_hz is None:
        return 0
    rate = schedule.update_rate_hz
    exact_clocks = exact(clock_hz) / rate
    clocks = round(exact_clocks)
    why = None
    if clocks < least:
        why = (
            f"{clock_hz:.9g} Hz are {float(exact_clocks):.4g} clocks a tick, and the sequencer of {of} takes "
            f"{least}; take a clock of at least {at_least(float(rate * least), 6)} Hz, or an update_rate_hz of at "
            f"most {at_most(clock_hz / least, 6)}"
        )
    elif clocks > _MOST:
        why = f"{clock_hz:.9g} Hz are {clocks} clocks a tick, above {_MOST}; take a slower clock"
    elif abs(clocks - exact_clocks) > _TOLERANCE * clocks:
        why = (
            f"{clock_hz:.9g} Hz are {float(exact_clocks):.7g} clocks a tick, which is not whole; an update_rate_hz of "
            f"{float(exact(clock_hz) / clocks):.9g} has {clocks} clocks"
        )
    if why is None:
        return clocks
    problems.add(setup.scan_file, "emit.clock_hz", why)
    return 0
