"""Write a measured response as the CSV file that ``resonance.response`` of the scanner file names."""

from collections.abc import Sequence
from itertools import pairwise

from tablegen.base.data_files import Source
from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.resonance import ResonanceFit

MARK = "# calibrate resonance: "


def response_csv(fit: ResonanceFit, sources: Sequence[Source]) -> bytes:
    """Write comments on the origin, the header hz,gain,phase_deg, and a row a frequency; without a date.

    Raises
    ------
    Unphysical
        If there is no phase, or a frequency stands twice.
    """
    if fit.response is None:
        raise Unphysical("a response takes phase_deg or phase_rad beside the gain")
    rows = fit.response.tolist()
    for one, other in pairwise(rows):
        if not one[0] < other[0]:
            raise Unphysical(f"{other[0]:g} Hz was measured twice; give one of the two")
    names = [source.name if source.name.isprintable() else ascii(source.name) for source in sources]
    lines = [f"{MARK}{len(rows)} points, as measured"]
    lines += [f"# from {name}, sha256 {source.sha256}" for name, source in zip(names, sources, strict=True)]
    lines.append("hz,gain,phase_deg")
    lines += [",".join(f"{value:.9g}" for value in row) for row in rows]
    return ("\n".join(lines) + "\n").encode("utf-8")
