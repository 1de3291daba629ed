"""Whether the columns of a record move by as much as arithmetic can tell."""

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.numerics.arrays import Floats

# No record of an instrument is as small as this in s, V or nm, and no square of it or quotient by it leaves the floats.
LEAST_SPAN = 1e-12


def check_spans(time_s: Floats, displacement_nm: Floats, drive_v: Floats | None) -> None:
    """Refuse a record one of whose columns hardly changes, as of a wrong unit. Raises ``Unphysical``.

    A column that does not change at all is left to the fits, which say what they miss.
    """
    for name, unit, values in (("time", "s", time_s), ("drive", "V", drive_v), ("displacement", "nm", displacement_nm)):
        span = float(np.ptp(values)) if values is not None and len(values) else 0.0
        if 0.0 < span < LEAST_SPAN:
            raise Unphysical(
                f"the {name} spans {span:.3g} {unit} in all, less than {LEAST_SPAN:g} {unit}: is its unit right?"
            )
