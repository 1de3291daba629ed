"""The file of a virtual scanner: its true parameters, which a laboratory would never know."""

from collections.abc import Mapping, Sequence
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta, Struct

from tablegen.base.input_errors import Document, Problems
from tablegen.base.quantities import Hertz, Name, PositiveVolts
from tablegen.base.toml import read_toml
from tablegen.config.decode import decode
from tablegen.config.scanner import Coupling
from tablegen.numerics.arrays import Floats, FloatsLike
from tablegen.virtual.duhem import Duhem, Lag
from tablegen.virtual.preisach import Preisach

Coefficient = Annotated[float, Meta(ge=0.0, le=1e9)]


Family = Literal["preisach", "duhem"]
BUILT_IN = ("default", "duhem")  # scanners that come with the package


class LagTruth(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One lag of the Duhem operator; see ``tablegen.virtual.duhem``."""

    rise: Annotated[float, Meta(ge=0.5, le=200.0, description="rate per full drive while the drive rises")]
    fall: Annotated[float, Meta(ge=0.5, le=200.0, description="the same while it falls")]
    below_nm: Annotated[list[Coefficient], Meta(min_length=1, max_length=9, description="how far a long rise lags")]
    above_nm: Annotated[list[Coefficient], Meta(min_length=1, max_length=9, description="how far a long fall lags")]


class HysteresisTruth(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An operator of one family: ``tablegen.virtual.preisach`` or ``tablegen.virtual.duhem``."""

    family: Family = "preisach"
    reversible_nm: Annotated[
        list[Coefficient], Meta(min_length=1, max_length=16, description="slope without hysteresis over the drive")
    ]
    density_nm: Annotated[
        list[list[Coefficient]],
        Meta(max_length=13, description="preisach: n + 1 rows of n + 1, ..., 1 coefficients"),
    ] = []
    lags: Annotated[list[LagTruth], Meta(max_length=4, description="duhem: lags that add up")] = []

    def operator(self) -> Preisach | Duhem:
        """Build the hysteresis operator.

        Raises
        ------
        ValueError
            If a branch could run backwards.
        """
        if self.family == "preisach":
            return Preisach(tuple(self.reversible_nm), tuple(map(tuple, self.density_nm)))
        lags = (Lag(one.rise, one.fall, tuple(one.below_nm), tuple(one.above_nm)) for one in self.lags)
        return Duhem(tuple(self.reversible_nm), tuple(lags))


class Creep(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Creep, and the loss of gain with frequency."""

    loss_per_decade: Annotated[float, Meta(ge=0.0, le=0.1, description="of the gain at reference_hz")]
    reference_hz: Annotated[Hertz, Meta(description="where the gain is 1")]
    fastest_s: Annotated[float, Meta(ge=1e-9, le=1e3, description="shortest time constant")] = 1e-6
    slowest_s: Annotated[float, Meta(ge=1e-6, le=1e6, description="longest time constant")] = 1e3
    terms_per_decade: Annotated[int, Meta(ge=1, le=8, description="time constants a decade")] = 2


class ResonanceTruth(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Parameters of the first resonance."""

    frequency_hz: Annotated[Hertz, Meta(description="undamped")]
    quality: Annotated[float, Meta(ge=0.6, le=1e4, description="quality factor")]


class SecondResonanceTruth(ResonanceTruth, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Another mode beside the first: both follow the drive, and their displacements add up."""

    share: Annotated[float, Meta(gt=0.0, lt=1.0, description="of the displacement at low frequencies")]


class AxisTruth(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One axis of the scanner."""

    hysteresis: HysteresisTruth
    sensitivity: Annotated[
        list[Annotated[float, Meta(ge=-2.0, le=2.0)]],
        Meta(max_length=8, description="s = 1 + c1 p + c2 p^2 + ..., p = 2 V / v_max - 1 of the mean drive"),
    ] = []
    sensitivity_memory_s: (
        Annotated[float, Meta(ge=1e-3, le=1e5, description="time constant of that mean; none: all of what is played")]
        | None
    ) = None
    creep: Creep | None = None
    resonance: ResonanceTruth | None = None
    second_resonance: SecondResonanceTruth | None = None
    dead_time_s: Annotated[float, Meta(ge=0.0, le=1.0, description="between the code and the first movement")] = 0.0


class AmplifierTruth(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the amplifier does beyond its gain."""

    bandwidth_hz: Annotated[Hertz, Meta(description="half the power")] | None = None


class Truth(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Parameters of a virtual scanner."""

    name: Annotated[Name, Meta(description="for reports")]
    identified_on: Annotated[Name, Meta(description="what the parameters come from")] = "nothing that its file names"
    v_max: Annotated[PositiveVolts, Meta(description="drive 1 of the hysteresis")]
    amplifier: AmplifierTruth = AmplifierTruth()
    coupling: Coupling = Coupling()
    x: AxisTruth
    y: AxisTruth


def load_truth(source: str | Path = "default") -> Truth:
    """Read a virtual scanner: the name of one of ``BUILT_IN``, or a file.

    Raises
    ------
    Rejected
        If the file is faulty; the message has every fault.
    """
    path = Path(str(files("tablegen.virtual") / f"{source}.toml")) if source in BUILT_IN else Path(source)
    values, document = read_toml(path, str(path))
    problems = Problems()
    truth = decode(Truth, values, document, problems, partial(_check, document, problems))
    problems.stop_if_any()
    assert truth is not None
    return truth


def _check(file: Document, problems: Problems, kind: type, key: str, _: Mapping[str, Any], built: Any) -> None:
    if kind is HysteresisTruth and built is not None:
        _check_hysteresis(file, problems, key, built)
    elif kind is Creep and built is not None and built.slowest_s <= built.fastest_s:
        problems.add(file, f"{key}.slowest_s", f"{built.slowest_s:g} s is not above fastest_s = {built.fastest_s:g} s")
    elif kind is AxisTruth and built is not None:
        if built.second_resonance is not None and built.resonance is None:
            problems.add(file, f"{key}.second_resonance", f"needs the first one, [{key}.resonance]")
        least = float(np.min(sensitivity(built.sensitivity, np.linspace(-1.0, 1.0, 21))))
        if least <= 0.05:
            problems.add(file, f"{key}.sensitivity", f"falls to {least:.3g} between 0 and v_max")


def _check_hysteresis(file: Document, problems: Problems, key: str, built: HysteresisTruth) -> None:
    other = "lags" if built.family == "preisach" else "density_nm"
    if getattr(built, other):
        problems.add(file, f"{key}.{other}", f"not of the family {built.family!r}; remove it, or change family")
        return
    rows = [len(row) for row in built.density_nm]
    if rows != list(range(len(rows), 0, -1)):
        problems.add(file, f"{key}.density_nm", f"{len(rows)} rows need {len(rows)}, ..., 2, 1 coefficients")
    elif not any(built.reversible_nm):
        problems.add(file, f"{key}.reversible_nm", "all 0; the axis would not move after a turn of the drive")
    else:
        try:
            built.operator()
        except ValueError as reason:
            problems.add(file, f"{key}.reversible_nm", f"{reason}; raise it, or lower the lags")


def sensitivity(coefficients: Sequence[float], p: FloatsLike) -> Floats:
    """Return s(p) = 1 + c1 p + c2 p^2 + ...

    Returns
    -------
    Relative sensitivities, of the shape of ``p`` (-1..1).
    """
    return np.asarray(np.polynomial.polynomial.polyval(p, [1.0, *coefficients]), dtype=np.float64)
