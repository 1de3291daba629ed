"""The operator's file: TOML that `tablegen calibrate operator` writes beside the scanner file, which names it."""

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, Struct, ValidationError, convert, structs

from tablegen.base.input_errors import Problem, Problems, Rejected
from tablegen.base.toml import read_toml
from tablegen.compensation.identification import MeasuredLine
from tablegen.compensation.operator.bias_memory import BiasMemory
from tablegen.compensation.operator.bouc_wen import BoucWen
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.family import Family
from tablegen.compensation.operator.field import Lengths, points_of, through
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.plays import BENDS, Plays
from tablegen.compensation.operator.sweep_loss import SweepLoss

VERSION = 1
_Number = Annotated[float, Meta(ge=-1e9, le=1e9)]
_Share = Annotated[float, Meta(ge=0.0, le=1.0)]
_Bend = Annotated[float, Meta(ge=-1.0, le=1.0)]
_Length = Annotated[float, Meta(ge=0.01, le=100.0)]
_Time = Annotated[float, Meta(ge=1e-9, le=1e9)]
_Row = Annotated[list[_Number], Meta(min_length=2, max_length=128)]


class _Table(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of the file."""


class CreepTable(_Table, frozen=True, kw_only=True):
    """Logarithmic creep; see ``LogarithmicCreep``."""

    loss_per_decade: Annotated[float, Meta(ge=0.0, le=0.5)]
    fastest_s: _Time
    slowest_s: _Time
    reference_hz: Annotated[float, Meta(ge=1e-6, le=1e9)]


class PlaysTable(_Table, frozen=True, kw_only=True):
    """The plays of the hysteresis family; see ``Plays``. Weights in nm; ``bends`` are l and s of both envelopes."""

    thresholds: Annotated[list[Annotated[float, Meta(gt=0.0, lt=1.0)]], Meta(max_length=256)]
    weights: Annotated[list[list[_Number]], Meta(min_length=1, max_length=8)]
    bends: Annotated[list[list[_Bend]], Meta(min_length=1, max_length=8)]
    reversible: Annotated[list[_Number], Meta(min_length=1, max_length=16)]
    growth_per_decade: Annotated[float, Meta(ge=-1.0, le=1.0)] = 0.0


class BoucWenTable(_Table, frozen=True, kw_only=True):
    """Bouc and Wen's part of the hysteresis family; see ``BoucWen``. ``depth_nm`` is 0 where there is none."""

    depth_nm: Annotated[float, Meta(ge=0.0, le=1e9)]
    n: Annotated[float, Meta(ge=1.0, le=4.0)]
    beta: Annotated[float, Meta(ge=0.0, le=100.0)]
    gamma: Annotated[float, Meta(ge=-100.0, le=100.0)]
    asymmetry: Annotated[float, Meta(gt=-1.0, lt=1.0)]
    bend: Annotated[list[_Bend], Meta(min_length=2, max_length=2)]


class LengthsTable(_Table, frozen=True, kw_only=True):
    """The differences over which the fields change; see ``Lengths``."""

    stroke: _Length
    centre: _Length
    noise: Annotated[float, Meta(ge=1e-12, le=1.0)]
    rate_share: _Share = 0.0


class ResponseTable(_Table, frozen=True, kw_only=True):
    """What the measured response contains beside dynamics; see ``SweepLoss``. ``creep`` is that of the file."""

    loss_deg: Annotated[float, Meta(ge=-30.0, le=30.0)]
    creep: bool


class LineTable(_Table, frozen=True, kw_only=True):
    """A trace: its stroke and centre, the residual of the family, and the errors of a fit without the trace."""

    name: Annotated[str, Meta(max_length=200)]
    stroke: Annotated[float, Meta(gt=0.0, le=1.1)]
    centre: _Share
    rate_hz: Annotated[float, Meta(ge=1e-6, le=1e9)]
    size: _Number
    rising: _Row
    falling: _Row
    rms_percent: _Number
    scaling_percent: _Number
    mismatch_percent: _Number
    size_percent: _Number
    in_fit_percent: Annotated[list[_Number], Meta(min_length=4, max_length=4)]


class BiasMemoryTable(_Table, frozen=True, kw_only=True):
    """The memory of the bias; see ``BiasMemory``. Shares of the change of the mean position."""

    rise_share: Annotated[float, Meta(ge=-1.0, le=1.0)]
    rise_time_s: _Time
    fall_share: Annotated[float, Meta(ge=-1.0, le=1.0)]
    fall_time_s: _Time


class OperatorFile(_Table, frozen=True, kw_only=True):
    """The whole file. Strokes, centres and thresholds are shares of v_max - v_min."""

    version: int
    axis: Literal["x", "y"]
    v_max: Annotated[float, Meta(ge=1e-3, le=1e5)]
    v_min: Annotated[float, Meta(ge=-1e5, le=0.0)] = 0.0
    centre: _Share
    creep: CreepTable
    bias_memory: BiasMemoryTable | None = None
    plays: PlaysTable
    bouc_wen: BoucWenTable
    lengths: LengthsTable
    response: ResponseTable | None = None
    misfit_percent: Annotated[float, Meta(ge=0.0, le=1e3)] | None = None
    lines: Annotated[list[LineTable], Meta(min_length=1, max_length=1000)]


def read_operator(path: Path, name: str) -> tuple[Operator, OperatorFile]:
    """Read the operator of a file; return the operator and the file.

    Raises
    ------
    Rejected
        At the line of the first fault.
    """
    if not os.path.isfile(path):  # a pipe would be waited for
        raise Rejected([Problem(name, 0, "", "is not a file; the path is relative to the scanner file")])
    values, document = read_toml(path, name)
    problems = Problems()
    version = values.get("version")
    if version != VERSION:
        problems.add(document, "version", f"{version!r} is not {VERSION}, the only one that this tablegen knows")
        problems.stop_if_any()
    try:
        file = convert(values, OperatorFile)
    except ValidationError as error:
        why, _, place = str(error).partition(" - at ")
        problems.add(document, re.sub(r"^\$\.?", "", place.strip("`")), f"{why[:1].lower()}{why[1:]}")
        raise Rejected(problems.entries) from None
    for key, why in _contradictions(file):
        problems.add(document, key, why)
    problems.stop_if_any()
    return _operator(file), file


def _contradictions(file: OperatorFile) -> list[tuple[str, str]]:
    """Return the faults that the types cannot express, each a key and the reason."""
    plays, faults = file.plays, []
    if any(b <= a for a, b in zip(plays.thresholds, plays.thresholds[1:], strict=False)):
        faults.append(("plays.thresholds", "do not ascend"))
    if any(len(row) != len(plays.thresholds) for row in plays.weights):
        faults.append(("plays.weights", f"need {len(plays.thresholds)} numbers a row, one for each threshold"))
    if len(plays.bends) != len(plays.weights) or any(len(row) != BENDS for row in plays.bends):
        faults.append(("plays.bends", f"need {BENDS} numbers a row, and a row for each of weights"))
    elif any(abs(row[i]) + 0.5 * abs(row[i + 1]) > 1.0 for row in plays.bends for i in (0, 2)):
        faults.append(("plays.bends", "|l| + |s| / 2 above 1 would let an envelope run backwards"))
    if any(weight < 0.0 for row in plays.weights for weight in row):
        faults.append(("plays.weights", "a weight below 0 would let a branch run backwards"))
    if abs(file.bouc_wen.bend[0]) + 0.5 * abs(file.bouc_wen.bend[1]) > 1.0:
        faults.append(("bouc_wen.bend", "|l| + |s| / 2 above 1 would let the bent drive run backwards"))
    if file.creep.slowest_s < file.creep.fastest_s:
        faults.append(("creep.slowest_s", "is below fastest_s"))
    if len({len(row) for line in file.lines for row in (line.rising, line.falling)}) > 1:
        faults.append(("lines", "have rows of different lengths"))
    return faults


def _operator(file: OperatorFile) -> Operator:
    lengths = Lengths(*structs.astuple(file.lengths))
    plays, loop = file.plays, file.bouc_wen
    family = Family(
        Plays(
            np.array(plays.thresholds),
            np.array(plays.weights),
            np.array(plays.reversible),
            np.array(plays.bends),
            plays.growth_per_decade,
        ),
        BoucWen(loop.depth_nm, loop.n, loop.beta, loop.gamma, loop.asymmetry, (loop.bend[0], loop.bend[1]))
        if loop.depth_nm
        else None,
    )
    creep = LogarithmicCreep(
        file.creep.loss_per_decade, file.creep.fastest_s, file.creep.slowest_s, file.creep.reference_hz
    )
    points = points_of(file.lines)
    rows = np.array([[*line.rising, *line.falling] for line in file.lines])
    residual = through(points, rows, lengths, straight=True)
    size = through(points, np.array([[line.size] for line in file.lines]), lengths)
    lines = tuple(
        MeasuredLine(
            line.name,
            line.stroke,
            line.centre,
            line.rate_hz,
            (line.rms_percent, line.scaling_percent, line.mismatch_percent, line.size_percent),
            (line.in_fit_percent[0], line.in_fit_percent[1], line.in_fit_percent[2], line.in_fit_percent[3]),
        )
        for line in file.lines
    )
    late = file.bias_memory
    bias_memory = None
    if late is not None:
        bias_memory = BiasMemory(late.rise_share, late.rise_time_s, late.fall_share, late.fall_time_s)
    sweep = None
    if file.response is not None:
        sweep = SweepLoss(file.response.loss_deg / 360.0, creep if file.response.creep else None)
    operator = Operator(family, residual, size, creep, file.centre, lines, bias_memory, sweep, file.misfit_percent)
    return operator.at_rate(creep.reference_hz)


def operator_text(file: OperatorFile, comments: Sequence[str]) -> str:
    """Return the text of the file, with the comments at its head."""

    def numbers(values: Sequence[float]) -> str:
        return "[" + ", ".join(f"{value:.9g}" if value else "0.0" for value in _floats(values)) + "]"

    out = [*(f"# {line}" for line in comments), f"version = {file.version}", f'axis = "{file.axis}"']
    out.append(f"v_max = {float(file.v_max)!r}")
    if file.v_min != 0.0:
        out.append(f"v_min = {float(file.v_min)!r}")
    out.append(f"centre = {_float(file.centre)}")
    if file.misfit_percent is not None:
        out.append(f"misfit_percent = {_float(file.misfit_percent)}")
    out += ["", "[creep]"]
    out += [f"{name} = {_float(getattr(file.creep, name))}" for name in file.creep.__struct_fields__]
    if file.bias_memory is not None:
        out += ["", "[bias_memory]"]
        out += [f"{name} = {_float(getattr(file.bias_memory, name))}" for name in file.bias_memory.__struct_fields__]
    out += [
        "",
        "[plays]",
        f"thresholds = {numbers(file.plays.thresholds)}",
        "weights = [",
    ]
    out += [f"    {numbers(row)}," for row in file.plays.weights]
    out += ["]", "bends = [", *(f"    {numbers(row)}," for row in file.plays.bends)]
    out += ["]", f"reversible = {numbers(file.plays.reversible)}"]
    if file.plays.growth_per_decade != 0.0:
        out.append(f"growth_per_decade = {_float(file.plays.growth_per_decade)}")
    out += ["", "[bouc_wen]"]
    out += [f"{name} = {_float(getattr(file.bouc_wen, name))}" for name in file.bouc_wen.__struct_fields__[:-1]]
    out += [f"bend = {numbers(file.bouc_wen.bend)}", "", "[lengths]"]
    out += [f"{name} = {_float(value)}" for name, value in structs.asdict(file.lengths).items() if value != 0.0]
    if file.response is not None:
        creep = "true" if file.response.creep else "false"
        out += ["", "[response]", f"loss_deg = {_float(file.response.loss_deg)}", f"creep = {creep}"]
    for line in file.lines:
        out += ["", "[[lines]]", f"name = {_text(line.name)}"]
        for name in line.__struct_fields__[1:]:
            value = getattr(line, name)
            out.append(f"{name} = {numbers(value) if isinstance(value, list) else _float(value)}")
    return "\n".join(out) + "\n"


def _floats(values: Sequence[float]) -> list[float]:
    return [float(value) for value in values]


def _float(value: float) -> str:
    digits = f"{float(value):.9g}"
    return digits if any(mark in digits for mark in ".en") else f"{digits}.0"


def _text(value: str) -> str:
    plain = "".join(c if c.isprintable() and c not in '"\\' else "_" for c in value)
    return f'"{plain[:200]}"'
