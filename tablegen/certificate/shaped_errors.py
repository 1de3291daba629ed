"""The effect of shaping on the errors of an axis, and its cost: the certificate of shaped axes alone."""

from collections.abc import Mapping

import numpy as np
from msgspec import Struct

from tablegen.certificate.line_errors import EmittedPeriod, TickErrors, tick_scaling
from tablegen.certificate.shaped_periods import Changes, Passage, largest_and_rms
from tablegen.compensation.line import Sweep
from tablegen.fixedpoint.shaping import Shaping
from tablegen.planning.line_plan import LinePlan


class RoundedErrors(Struct, frozen=True):
    """The same scan without shaping: errors of the position in LSB, scaling errors, changes of codes."""

    max_error_lsb: float
    rms_error_lsb: float
    scaling: dict[str, float]
    changes: Changes


class ShapedErrors(Struct, frozen=True):
    """The additional figures of a shaped axis, whose errors are those of the position.

    ``ticks`` are judged, behind the ``passage``. ``code_error_lsb`` are the largest error of a code and the rms, and
    ``largest_step`` the largest step that was seen; ``rounded`` has what rounding alone would leave.
    """

    shaping: Shaping
    passage: Passage
    ticks: int
    code_error_lsb: tuple[float, float]
    largest_step: int
    changes: Changes
    rounded: RoundedErrors


def shaped_errors(line: LinePlan, played: EmittedPeriod, directions: Mapping[str, Sweep]) -> ShapedErrors | None:
    """Return the figures of a shaped axis, None of any other; scaling errors are of whole periods only."""
    periods = played.shaped
    if periods is None:
        return None
    sides = directions if periods.is_whole else {}
    rounded = [TickErrors(errors) for errors in periods.rounded_errors]
    scaling = {
        side: max(tick_scaling(line, played, side, branch, errors) for errors in rounded)
        for side, branch in sides.items()
    }
    return ShapedErrors(
        shaping=line.program.output.shaping,
        passage=Passage.of(line),
        ticks=periods.ticks,
        code_error_lsb=largest_and_rms(periods.code_errors),
        largest_step=int(np.max(np.abs(np.diff(periods.judged_codes)))),
        changes=periods.changes,
        rounded=RoundedErrors(*largest_and_rms(periods.rounded_errors), scaling, periods.rounded_changes),
    )
