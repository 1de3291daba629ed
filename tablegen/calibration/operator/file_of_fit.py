"""Format an operator fit as the file that the scanner file names."""

import dataclasses
from collections.abc import Sequence

from msgspec.structs import asdict

from tablegen.calibration.operator.fit import OperatorFit
from tablegen.compensation.models.operator import OperatorModel
from tablegen.compensation.operator.bouc_wen import NO_BOUC_WEN
from tablegen.compensation.operator.file import (
    VERSION,
    BiasMemoryTable,
    BoucWenTable,
    CreepTable,
    LengthsTable,
    LineTable,
    OperatorFile,
    PlaysTable,
    ResponseTable,
    operator_text,
)
from tablegen.numerics.driver import Driver

MODEL = OperatorModel.model()
_HEAD = (
    "An operator of the piezo, written by tablegen calibrate operator; docs/operator.md says what the numbers are.",
    "Strokes, centres and thresholds are shares of v_max, weights nm.",
)


def operator_file(fit: OperatorFit, axis: str, driver: Driver | float, sources: Sequence[str] = ()) -> bytes:
    """Format an operator file; ``sources`` has a line for the origin of each trace."""
    operator, creep, lengths = fit.operator, fit.operator.creep, fit.operator.residual.lengths
    plays, loop = operator.family.plays, operator.family.bouc_wen or NO_BOUC_WEN
    late = operator.bias_memory
    sweep = operator.sweep
    lines = []
    for i, line in enumerate(operator.lines):
        row = fit.rows[i]
        half = len(row) // 2
        rms, scaling, mismatch, size = line.left_out
        lines.append(
            LineTable(
                name=line.name,
                stroke=line.stroke,
                centre=line.centre,
                rate_hz=line.rate_hz,
                size=float(fit.sizes[i]),
                rising=row[:half].tolist(),
                falling=row[half:].tolist(),
                rms_percent=rms,
                scaling_percent=scaling,
                mismatch_percent=mismatch,
                size_percent=size,
                in_fit_percent=list(line.in_fit),
            )
        )
    file = OperatorFile(
        version=VERSION,
        axis="x" if axis == "x" else "y",
        v_max=Driver.of(driver).v_max,
        v_min=Driver.of(driver).v_min,
        centre=operator.centre,
        misfit_percent=operator.misfit_percent,
        creep=CreepTable(
            loss_per_decade=creep.loss_per_decade,
            fastest_s=creep.fastest_s,
            slowest_s=creep.slowest_s,
            reference_hz=creep.reference_hz,
        ),
        bias_memory=None if late is None else BiasMemoryTable(**asdict(late)),
        plays=PlaysTable(
            thresholds=plays.thresholds.tolist(),
            weights=plays.weights.tolist(),
            bends=plays.bends.tolist(),
            growth_per_decade=plays.growth,
            reversible=plays.reversible.tolist(),
        ),
        bouc_wen=BoucWenTable(
            depth_nm=loop.depth,
            n=loop.n,
            beta=loop.beta,
            gamma=loop.gamma,
            asymmetry=loop.asymmetry,
            bend=list(loop.bend),
        ),
        lengths=LengthsTable(**dataclasses.asdict(lengths)),
        response=None if sweep is None else ResponseTable(loss_deg=360.0 * sweep.loss_turns, creep=bool(sweep.creep)),
        lines=lines,
    )
    return operator_text(file, [*_HEAD, *sources]).encode("utf-8")
