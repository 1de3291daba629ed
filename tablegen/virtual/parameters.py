"""The file of a virtual scanner: what is true of it, as a laboratory would never know it."""

from collections.abc import Mapping
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta, Struct

from tablegen.config.decode import decode
from tablegen.problems import Document, Problems
from tablegen.quantities import Hertz, Name, PositiveVolts
from tablegen.toml import read_toml

Coefficient = Annotated[float, Meta(ge=0.0, le=1e9)]


class HysteresisTruth(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The Preisach operator; see ``tablegen.virtual.preisach``."""

    reversible_nm: Annotated[
        list[Coefficient], Meta(min_length=1, max_length=16, description="slope without hysteresis over the drive")
    ]
    density_nm: Annotated[
        list[list[Coefficient]], Meta(max_length=13, description="n + 1 rows of n + 1, n, ..., 1 coefficients")
    ] = []


class Creep(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Creep, and the loss of gain with frequency."""

    loss_per_decade: Annotated[float, Meta(ge=0.0, le=0.1, description="of the gain at reference_hz")]
    reference_hz: Annotated[Hertz, Meta(description="where the gain is 1")]
    fastest_s: Annotated[float, Meta(ge=1e-9, le=1e3, description="shortest time constant")] = 1e-6
    slowest_s: Annotated[float, Meta(ge=1e-6, le=1e6, description="longest time constant")] = 1e3
    terms_per_decade: Annotated[int, Meta(ge=1, le=8, description="time constants a decade")] = 2


class ResonanceTruth(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The first resonance."""

    frequency_hz: Annotated[Hertz, Meta(description="undamped")]
    quality: Annotated[float, Meta(ge=0.6, le=1e4, description="quality factor")]


class AxisTruth(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One axis of the scanner."""

    hysteresis: HysteresisTruth
    sensitivity: Annotated[
        list[Annotated[float, Meta(ge=-2.0, le=2.0)]],
        Meta(max_length=8, description="s = 1 + c1 p + c2 p^2 + ..., p = 2 V / v_max - 1 of the mean drive"),
    ] = []
    creep: Creep | None = None
    resonance: ResonanceTruth | None = None


class AmplifierTruth(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the amplifier does beyond its gain."""

    bandwidth_hz: Annotated[Hertz, Meta(description="half the power")] | None = None


class Truth(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A virtual scanner."""

    name: Annotated[Name, Meta(description="for reports")]
    v_max: Annotated[PositiveVolts, Meta(description="drive 1 of the hysteresis")]
    amplifier: AmplifierTruth = AmplifierTruth()
    x: AxisTruth
    y: AxisTruth


def load_truth(path: str | Path | None = None) -> Truth:
    """Read a virtual scanner, or the default one.

    Raises ``Rejected`` with every fault of the file.
    """
    path = Path(str(files("tablegen.virtual") / "default.toml")) if path is None else Path(path)
    values, document = read_toml(path, str(path))
    problems = Problems()
    truth = decode(Truth, values, document, problems, partial(_check, document, problems))
    problems.stop_if_any()
    assert truth is not None
    return truth


def _check(file: Document, problems: Problems, kind: type, key: str, _: Mapping[str, Any], built: Any) -> None:
    if kind is HysteresisTruth and built is not None:
        rows = [len(row) for row in built.density_nm]
        if rows != list(range(len(rows), 0, -1)):
            problems.add(file, f"{key}.density_nm", f"{len(rows)} rows need {len(rows)}, ..., 2, 1 coefficients")
        if not any(built.reversible_nm):
            problems.add(file, f"{key}.reversible_nm", "all 0; a drive that turns would not move at all")
    elif kind is Creep and built is not None and built.slowest_s <= built.fastest_s:
        problems.add(file, f"{key}.slowest_s", f"{built.slowest_s:g} s is not above fastest_s = {built.fastest_s:g} s")
    elif kind is AxisTruth and built is not None:
        factors = [sensitivity(built.sensitivity, 0.1 * k - 1.0) for k in range(21)]
        if min(factors) <= 0.05:
            problems.add(file, f"{key}.sensitivity", f"falls to {min(factors):.3g} between 0 and v_max")


def sensitivity(coefficients: list[float], p: float) -> float:
    """s(p) = 1 + c1 p + c2 p^2 + ..."""
    return 1.0 + sum(c * p ** (n + 1) for n, c in enumerate(coefficients))
