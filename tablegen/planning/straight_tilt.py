"""The output z of a scan at 0 degrees whose axes play a table each: those that are corrected by the laws."""

from tablegen.base.input_errors import Problems
from tablegen.config.load import Setup
from tablegen.device.schedule import Schedule
from tablegen.planning.tilt import TiltedOutput, plan_tilt
from tablegen.waveform.series import FourierSeries


def plan_straight_z(
    setup: Setup,
    schedule: Schedule,
    sizes_nm: tuple[float, float],
    harmonics: int,
    place: FourierSeries | None = None,
) -> TiltedOutput:
    """Plan the output z of a planned scan; an axis at rest has the wanted place 0.

    Parameters
    ----------
    setup
        A scan and a scanner that both have z.
    sizes_nm
        Of x and y, from turn to turn; 0 of an axis at rest.
    harmonics
        Those of x.
    place
        The predicted position over a line where x moves as a sine.

    Raises
    ------
    Rejected
        Where the tilt does not fit z, or y steps with no room between lines.
    """
    scan, problems = setup.scan, Problems()
    tilt = scan.z
    assert tilt is not None
    z = None
    with problems.at(setup.scan_file, "z"):
        shares = tilt.slope_x * sizes_nm[0], tilt.slope_y * sizes_nm[1]
        z = plan_tilt(setup, schedule, harmonics, shares, problems, place)
    problems.stop_if_any()
    assert z is not None
    return z
