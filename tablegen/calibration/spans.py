"""Check that the columns of a record move by more than arithmetic resolves."""

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.numerics.arrays import Floats

# No record of an instrument is as small as this in s, V or nm, and no square of it or quotient by it leaves the floats.
LEAST_SPAN = 1e-12


def check_spans(time_s: Floats, displacement_nm: Floats, drive_v: Floats | None) -> None:
    """Refuse a record one of whose columns hardly changes, as of a wrong unit.

    A column that does not change at all is left to the fits, which name its effect.

    Parameters
    ----------
    time_s, displacement_nm, drive_v
        Columns in s, nm and V, shape (samples,) each; no drive is None.

    Raises
    ------
    Unphysical
        If the range of a column is above 0 and below ``LEAST_SPAN``.
    """
    for name, unit, values in (("time", "s", time_s), ("drive", "V", drive_v), ("displacement", "nm", displacement_nm)):
        span = float(np.ptp(values)) if values is not None and len(values) else 0.0
        if 0.0 < span < LEAST_SPAN:
            raise Unphysical(
                f"the {name} spans {span:.3g} {unit} in all, less than {LEAST_SPAN:g} {unit}: is its unit right?"
            )
