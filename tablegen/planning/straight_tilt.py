"""The outputs beside x and y of a scan at 0 degrees whose axes play a table each."""

from tablegen.base.input_errors import Problems
from tablegen.config.load import Setup
from tablegen.config.schema import TiltName
from tablegen.device.schedule import Schedule
from tablegen.planning.tilt import TiltedOutput, plan_tilt
from tablegen.waveform.series import FourierSeries


def plan_straight_tilts(
    setup: Setup,
    schedule: Schedule,
    sizes_nm: tuple[float, float],
    harmonics: int,
    place: FourierSeries | None = None,
) -> dict[TiltName, TiltedOutput]:
    """Plan the outputs beside x and y of a planned scan; an axis at rest has the wanted place 0.

    Parameters
    ----------
    setup
        A scan, and a scanner that has all outputs of the scan.
    sizes_nm
        Of x and y, from turn to turn; 0 of an axis at rest.
    harmonics
        Those of x.
    place
        The predicted position over a line where x moves as a sine.

    Raises
    ------
    Rejected
        Where a tilt does not fit its output, or y steps with no room between lines.
    """
    problems, planned = Problems(), {}
    for name, tilt in setup.scan.tilts.items():
        with problems.at(setup.scan_file, name):
            shares = tilt.slope_x * sizes_nm[0], tilt.slope_y * sizes_nm[1]
            planned[name] = plan_tilt(setup, name, schedule, harmonics, shares, problems, place)
    problems.stop_if_any()
    return {name: output for name, output in planned.items() if output is not None}
