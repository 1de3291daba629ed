"""A scan whose x axis has an operator: plays over a bent line, with figures of the traces that were left out."""

from pathlib import Path

import numpy as np
from editing import SCAN, SCANNER, edited

from tablegen.compensation.operator.file import (
    BoucWenTable,
    CreepTable,
    LengthsTable,
    LineTable,
    OperatorFile,
    PlaysTable,
    operator_text,
)
from tablegen.compensation.operator.plays import FIXED_BENDS

THRESHOLDS = np.geomspace(0.01, 0.4, 30)
WEIGHTS = (12.0, 3.0, 5.0)  # of all thresholds, of u, u^2 and 1 - (1 - u)^2
REVERSIBLE = (700.0, 60.0)
STROKES = (0.1, 0.3, 0.6, 0.95)


def operator_file(
    axis: str = "x",
    rms: float = 0.05,
    size: float = 0.1,
    creep: float = 0.0,
    weights: tuple[float, ...] = WEIGHTS,
    strokes: tuple[float, ...] = STROKES,
    left_out: tuple[float, float, float, float] | None = None,
) -> OperatorFile:
    """The operator; ``rms`` and ``size`` are what the traces that were left out are missed by, in percent.

    With ``left_out`` all four figures of that.
    """
    nothing = [0.0] * 12
    rms, scaling, mismatch, size = left_out or (rms, 20.0 * rms, 3.0 * rms, size)
    lines = [
        LineTable(
            name=f"{stroke:g}",
            stroke=stroke,
            centre=0.5,
            rate_hz=100.0,
            size=0.0,
            rising=nothing,
            falling=nothing,
            rms_percent=rms,
            scaling_percent=scaling,
            mismatch_percent=mismatch,
            size_percent=size,
            in_fit_percent=[rms, scaling, mismatch, size],  # all that is left out is noise
        )
        for stroke in strokes
    ]
    return OperatorFile(
        version=1,
        axis="y" if axis == "y" else "x",
        v_max=100.0,
        centre=0.5,
        creep=CreepTable(loss_per_decade=creep, fastest_s=1e-5, slowest_s=10.0, reference_hz=100.0),
        plays=PlaysTable(
            thresholds=THRESHOLDS.tolist(),
            weights=[[weight] * len(THRESHOLDS) for weight in weights],
            bends=FIXED_BENDS.tolist(),
            reversible=list(REVERSIBLE),
        ),
        bouc_wen=BoucWenTable(depth_nm=0.0, n=1.0, beta=0.0, gamma=0.0, asymmetry=0.0, bend=[0.0, 0.0]),
        lengths=LengthsTable(stroke=0.4, centre=0.6, noise=1e-5),
        lines=lines,
    )


def write_operator_scan(folder: Path, file: OperatorFile, *edits: str, branches: bool = True) -> Path:
    """The example with the operator on its axis, at 100 Hz, beside the file of the operator."""
    axis = file.axis
    (folder / "operator.toml").write_text(operator_text(file, []), encoding="utf-8")
    text = edited(SCANNER, f"{axis}.hysteresis.model = 'operator'", f"{axis}.hysteresis.file = 'operator.toml'")
    if not branches:
        text = edited(text, f"- [[{axis}.hysteresis.branches]]")
    (folder / "scanner.toml").write_text(text, encoding="utf-8")
    short = edited(SCAN, "timing.lines = 20", "timing.line_rate_hz = 100", "y.band_limit.harmonics = 16")
    scan = folder / "scan.toml"
    scan.write_text(edited(short, *edits), encoding="utf-8")
    return scan
