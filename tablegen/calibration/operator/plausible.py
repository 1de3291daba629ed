"""Refuse records without a settled line, with the reason: gaps, clipping, a drive that does not repeat."""

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.spans import check_spans
from tablegen.numerics.arrays import Floats

_MOST_AT_REST = 0.04  # share of a record at its largest or least value: a coarsely sampled sine has 0.03
_FEW = 4  # samples at one turn that may be equal, in a period of few samples
_SAME = 1e-9  # of the span
_MOST_DIFFERENCE = 0.02  # of the drive's span, rms, from period to period


class Unsettled(Unphysical):
    """The record, or the set of them, is no settled lines; an operator in time may still be fitted to it."""


def check_record(trace: Trace) -> None:
    """Refuse a record that has no values, that does not move, or that was clipped.

    Raises
    ------
    Unphysical
        If the record is refused.
    """
    columns = (("time", trace.time_s), ("drive", trace.drive_v), ("displacement", trace.displacement_nm))
    for name, values in columns:
        missing = np.flatnonzero(~np.isfinite(values))
        if len(missing):
            raise Unphysical(f"the {name} of sample {missing[0] + 1} is {values[missing[0]]:g}; leave such samples out")
    check_spans(trace.time_s, trace.displacement_nm, trace.drive_v)
    for name, values in columns[1:]:
        span = float(np.ptp(values)) if len(values) else 0.0
        if not span > 0.0:
            raise Unphysical(f"the {name} does not move")
        for end, at in (("largest", float(np.max(values))), ("least", float(np.min(values)))):
            still = np.abs(values - at) <= _SAME * span
            share, times = float(np.mean(still)), int(np.sum(np.diff(still, prepend=False) & still))
            if share > _MOST_AT_REST and int(np.sum(still)) >= _FEW * times:
                raise Unsettled(
                    f"the {name} is at its {end} value, {at:.6g}, for {100.0 * share:.2g} % of the record; "
                    "it was clipped, or stands still: record less of a stroke, or with more range"
                )


def check_repeats(drives: Floats) -> None:
    """Refuse a drive that is not the same in every period.

    Parameters
    ----------
    drives
        Drive in any unit, shape (periods, phases).

    Raises
    ------
    Unsettled
        If the drive is refused.
    """
    mean = drives.mean(axis=0)
    difference = float(np.sqrt(np.mean((drives - mean) ** 2))) / float(np.ptp(mean))
    if difference > _MOST_DIFFERENCE:
        raise Unsettled(
            f"the drive differs by {100.0 * difference:.2g} % of its span from period to period; a settled line needs "
            "one that repeats"
        )
