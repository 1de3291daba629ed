"""The scaling errors of a certificate, computed again through the shape in the manifest, by chords of its words.

The shape of a branch is u = lambda s + xi sin(pi s) + xi_gamma (cos(pi s) - 1), equations (15) and (17) to (21), from
its beta and u_peak. An operator's waveform is its own shape: such a line has no other. docs/manifest.md says what each
figure is.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, cos, floor, pi, sin

import numpy as np

from tablegen.base.input_errors import shortened
from tablegen.manifest.fields import ManifestAxis, ManifestBranch, ManifestSeries
from tablegen.numerics.arrays import Floats, Ints, union_sorted
from tablegen.verification.checks.certified import PlayedPeriod, at, on_grid, played_series
from tablegen.verification.checks.shaped import ShapedPlay

CHORD = 0.05  # share of the line
OPERATOR = "operator"  # the model whose waveform follows from no equation
_POINTS = 16, 513  # per harmonic, and beside them, over the window
_ACCELERATION_POINTS = 32  # per harmonic
_PLACES = 1025  # at which a branch is asked whether it rises
_GRID = 4097  # points on which a branch is inverted first


@dataclass(frozen=True)
class ModelBranch:
    """One direction of the line, over its sweep s = 0..1."""

    xi: float
    xi_gamma: float

    @classmethod
    def of(cls, branch: ManifestBranch, model: str) -> "ModelBranch":
        """Return the branch of a residual with this peak at this place."""
        return _EQUATIONS[model](branch)

    @classmethod
    def harmonic(cls, branch: ManifestBranch) -> "ModelBranch":
        """Return the branch of the harmonic model, equations (17) to (21)."""
        at_peak = branch.u_peak - branch.beta
        c, s = cos(0.5 * pi * 2.0 * at_peak), sin(pi * at_peak)
        # The residual is xi s + xi_gamma (c - 1 + 2 at_peak); it is beta at its peak, and flat there.
        rise, bend = (s, c - 1.0 + 2.0 * at_peak), (pi * c, -pi * s + 2.0)
        determinant = rise[0] * bend[1] - rise[1] * bend[0]
        return cls(branch.beta * bend[1] / determinant, -branch.beta * bend[0] / determinant)

    def value(self, s: Floats) -> Floats:
        """Return u(s), equation (17).

        Parameters
        ----------
        s
            Places in the sweep, 0..1, any shape.

        Returns
        -------
        Floats
            Normalised drive, shape of ``s``.
        """
        return (1.0 + 2.0 * self.xi_gamma) * s + self.xi * np.sin(pi * s) + self.xi_gamma * (np.cos(pi * s) - 1.0)

    def slope(self, s: Floats) -> Floats:
        """Return du/ds.

        Parameters
        ----------
        s
            Places in the sweep, 0..1, any shape.

        Returns
        -------
        Floats
            Shape of ``s``.
        """
        return 1.0 + 2.0 * self.xi_gamma + pi * (self.xi * np.cos(pi * s) - self.xi_gamma * np.sin(pi * s))

    def inverse(self, u: Floats) -> Floats:
        """Return s(u), the inverse of ``value``.

        Parameters
        ----------
        u
            Normalised drive, shape (n,).

        Returns
        -------
        Floats
            Places in the sweep, shape (n,).
        """
        return _inverse(self, u)


@dataclass(frozen=True)
class WaveformBranch:
    """One direction of a line whose shape is a waveform, over its sweep s = 0..1; it has no error of its own."""

    waveform: ManifestSeries
    turn: float
    forward: bool

    @classmethod
    def of(cls, axis: ManifestAxis, side: str) -> "WaveformBranch":
        """Return the waveform that the piezo is to follow, less a layer: the output of the operator."""
        waveform, layer = followed(axis), axis.fourier.refinement
        if layer is not None:
            a, b = (np.subtract(one, other).tolist() for one, other in ((waveform.a, layer.a), (waveform.b, layer.b)))
            waveform = ManifestSeries(a, b, waveform.a0)
        return cls(waveform, axis.drive.turn, side == "forward")

    def value(self, s: Floats) -> Floats:
        """Return u(s).

        Parameters
        ----------
        s
            Places in the sweep, 0..1, any shape.

        Returns
        -------
        Floats
            Normalised drive, shape of ``s``.
        """
        w = at(self.waveform, self._times(s))
        return w if self.forward else 1.0 - w

    def slope(self, s: Floats) -> Floats:
        """Return du/ds.

        Parameters
        ----------
        s
            Places in the sweep, 0..1, any shape.

        Returns
        -------
        Floats
            Shape of ``s``.
        """
        rise = at(self.waveform, self._times(s), 1)
        return self.turn * rise if self.forward else (self.turn - 1.0) * rise

    def inverse(self, u: Floats) -> Floats:
        """Return s(u), the inverse of ``value``.

        Parameters
        ----------
        u
            Normalised drive, shape (n,).

        Returns
        -------
        Floats
            Places in the sweep, shape (n,).
        """
        return _inverse(self, u)

    def _times(self, s: Floats) -> Floats:
        return self.turn * s if self.forward else self.turn + (1.0 - self.turn) * s


def _inverse(branch: "ModelBranch | WaveformBranch", u: Floats) -> Floats:
    grid = np.linspace(0.0, 1.0, _GRID)
    s = np.interp(u, branch.value(grid), grid)
    for _ in range(3):
        s = s - (branch.value(s) - u) / branch.slope(s)
    return s


# Independent copies of the build's equations; scaling errors of other models are not compared.
_EQUATIONS: dict[str, Callable[[ManifestBranch], ModelBranch]] = {
    "triangle": lambda branch: ModelBranch(0.0, 0.0),
    "sinusoidal": lambda branch: ModelBranch(branch.beta, 0.0),
    "harmonic": ModelBranch.harmonic,
}


def knows(model: str) -> bool:
    """Return True if the scaling errors of this model can be computed here; those of installed packages cannot.

    Raises
    ------
    ValueError
        If neither tablegen nor an installed package has the model: no build states it.
    """
    if model in _EQUATIONS or model == OPERATOR:
        return True
    from importlib.metadata import entry_points  # seldom needed; nothing of the model itself is loaded

    if not entry_points(group="tablegen.models", name=model):
        raise ValueError(f"drive.model is {shortened(repr(model))}, which neither tablegen nor a package here has")
    return False


def law(branch: ManifestBranch, model: str) -> ModelBranch | None:
    """Return the branch of an equation that is known here; None of another model."""
    return ModelBranch.of(branch, model) if model in _EQUATIONS else None


def _branch(axis: ManifestAxis, side: str) -> ModelBranch | WaveformBranch:
    if axis.drive.model == OPERATOR:
        return WaveformBranch.of(axis, side)
    return ModelBranch.of(getattr(axis.drive, side), axis.drive.model)


def hold_response(harmonics: int, advances: int, steps: bool) -> tuple[Floats, Floats]:
    """Return the response of a zero-order hold to harmonics of a period of ``advances`` held values.

    Where an axis steps once a line, the phase alone counts: it is imaged at its codes.

    Parameters
    ----------
    harmonics
        H, the highest harmonic.
    steps
        True for an axis that steps once a line.

    Returns
    -------
    real, imaginary
        Dimensionless, for harmonics 1..H, shape (H,).
    """
    share = np.arange(1, harmonics + 1) / advances
    size = np.ones(harmonics) if steps else np.sinc(share)
    return size * np.cos(pi * share), -size * np.sin(pi * share)


def _times(series: ManifestSeries, real: Floats, imaginary: Floats) -> ManifestSeries:
    a, b = np.array(series.a), np.array(series.b)
    return ManifestSeries((a * real + b * imaginary).tolist(), (b * real - a * imaginary).tolist(), series.a0)


def followed(axis: ManifestAxis) -> ManifestSeries:
    """Return the series that the piezo is to follow: stated, or what arrives if there are no dynamics."""
    if axis.fourier.target is not None:
        return axis.fourier.target
    program = axis.program
    response = hold_response(axis.fourier.harmonics, program.phase.ticks, program.hold > 1)
    return _times(played_series(axis), *response)


def peak_acceleration(axis: ManifestAxis) -> float:
    """Return max abs(w'') of the series that the piezo is to follow, per period squared."""
    return float(np.max(np.abs(on_grid(followed(axis), _ACCELERATION_POINTS * axis.fourier.harmonics, 2))))


def reached(axis: ManifestAxis) -> ManifestSeries:
    """Return the series that the piezo follows: the intended one less what the boost limit removed."""
    target = followed(axis)
    factor = np.ones(len(target.a))
    for harmonic, share in zip(axis.fourier.held_harmonics, axis.fourier.held_factors, strict=True):
        factor[harmonic - 1] = share
    return _times(target, factor, np.zeros(len(factor)))


def scaling_figures(
    axis: ManifestAxis, period: PlayedPeriod, shaped: ShapedPlay | None = None
) -> dict[str, dict[str, float]]:
    """Return the parts of the scaling error of each imaged direction, in percent; none of a static axis.

    For a shaped axis they are those of its position, the worst of what was judged, without the unknown parts.
    """
    if axis.resting:
        return {}
    sides = ("forward", "backward") if axis.fourier.directions == "both" else ("forward",)
    parts = {side: _direction(axis, [period], side) for side in sides}
    if shaped is None or not shaped.is_whole:
        return parts
    if shaped.position_errors is None:
        return {
            side: {name: one[name] for name in one.keys() - {"total", "quantisation"}} for side, one in parts.items()
        }
    every: list[PlayedPeriod | PositionErrors] = [PositionErrors(period, errors) for errors in shaped.position_errors]
    return {side: _direction(axis, every, side) for side in sides}


def rounded_scaling(axis: ManifestAxis, period: PlayedPeriod, shaped: ShapedPlay) -> dict[str, float] | None:
    """Return the total of each direction without shaping; None where it cannot be computed."""
    if not shaped.is_whole or axis.resting:
        return {}
    if shaped.rounded_errors is None:
        return None
    every: list[PlayedPeriod | PositionErrors] = [PositionErrors(period, errors) for errors in shaped.rounded_errors]
    sides = ("forward", "backward") if axis.fourier.directions == "both" else ("forward",)
    return {side: _direction(axis, every, side)["total"] for side in sides}


def position_scaling(axis: ManifestAxis, period: PlayedPeriod, errors: Floats) -> dict[str, float]:
    """Return the total of each direction from the errors of the position.

    Parameters
    ----------
    errors
        Errors of the position in LSB at every tick, shape (ticks,).
    """
    sides = ("forward", "backward") if axis.fourier.directions == "both" else ("forward",)
    return {side: _direction(axis, [PositionErrors(period, errors)], side)["total"] for side in sides}


class PositionErrors:
    """The errors of the position at every tick of a period."""

    def __init__(self, period: PlayedPeriod, errors: Floats) -> None:
        self._errors = errors
        self.codes_per_unit = period.codes_per_unit
        self.edges = np.arange(len(errors), dtype=np.int64)

    def errors(self, k: Ints) -> Floats:
        """Return the errors of the position.

        Parameters
        ----------
        k
            Ticks, any shape; periods repeat, since a damaged manifest may have windows beyond the first one.

        Returns
        -------
        Floats
            LSB of the converter, shape of ``k``.
        """
        return self._errors[k % len(self._errors)]


def refinement_figures(axis: ManifestAxis) -> dict[str, dict[str, float]] | None:
    """Return what the refinement layer moves in each direction, in percent; None without a layer."""
    layer = axis.fourier.refinement
    if layer is None:
        return None
    sides = ("forward", "backward") if axis.fourier.directions == "both" else ("forward",)
    figures = {}
    for side in sides:
        branch, position, sweep, times = _sweep(axis, side)
        shift = at(layer, times) / branch.slope(sweep)
        figures[side] = {
            "position": 100.0 * float(np.max(np.abs(shift))),
            "scaling": _peak_to_peak(np.gradient(shift, position)),
        }
    return figures


def _sweep(axis: ManifestAxis, side: str) -> tuple[ModelBranch | WaveformBranch, Floats, Floats, Floats]:
    """Return the branch of a direction, positions over its window, the sweep's position there, and its times."""
    turn, (low, high) = axis.drive.turn, axis.fourier.window
    position = np.linspace(low, high, _POINTS[0] * axis.fourier.harmonics + _POINTS[1])
    branch = _branch(axis, side)
    if side == "forward":
        return branch, position, position, turn * position
    return branch, position, 1.0 - position, turn + (1.0 - turn) * (1.0 - position)


def _direction(axis: ManifestAxis, periods: "Sequence[PlayedPeriod | PositionErrors]", side: str) -> dict[str, float]:
    branch, position, sweep, times = _sweep(axis, side)
    turn, (low, high) = axis.drive.turn, axis.fourier.window
    shape = branch.value(sweep) if side == "forward" else 1.0 - branch.value(sweep)
    steepness = branch.slope(sweep)
    ideal = steepness / turn if side == "forward" else -steepness / (1.0 - turn)
    target, arrived = followed(axis), reached(axis)
    target_slope, arrived_slope, value = at(target, times, 1), at(arrived, times, 1), at(arrived, times)
    if axis.fourier.refinement is not None:
        layer = axis.fourier.refinement
        layer_slope = at(layer, times, 1)
        target_slope, arrived_slope, value = (
            target_slope - layer_slope,
            arrived_slope - layer_slope,
            value - at(layer, times),
        )
    deviation = (value - shape) / steepness
    chords = [_chords(axis, period, side, position, deviation, steepness) for period in periods]
    return {
        "total": max(_peak_to_peak(total) for total, _ in chords),
        "band_limit": _peak_to_peak(target_slope / ideal),
        "quantisation": max(_peak_to_peak(noise) for _, noise in chords),
        "model": _peak_to_peak((arrived_slope - target_slope) / ideal),
        "size": 100.0 * float(deviation[-1] - deviation[0]) / (high - low),
        **_uncompensated(branch, sweep),
    }


def _uncompensated(branch: ModelBranch | WaveformBranch, sweep: Floats) -> dict[str, float]:
    """Return what a triangle would give; nothing where the branch does not rise over so much of u."""
    values = branch.value(np.linspace(0.0, 1.0, _PLACES))
    rises, middle_place = np.diff(values) > 0.0, _PLACES // 2
    low, high = middle_place, middle_place
    while low > 0 and rises[low - 1]:
        low -= 1
    while high < _PLACES - 1 and rises[high]:
        high += 1
    if np.min(sweep) < values[low] or np.max(sweep) > values[high]:
        return {}
    triangle = 1.0 / branch.slope(branch.inverse(sweep))
    middle = 1.0 / branch.slope(branch.inverse(np.array([0.5])))[0]
    return {"uncompensated": _peak_to_peak(triangle / middle)}


def _chords(
    axis: ManifestAxis,
    period: "PlayedPeriod | PositionErrors",
    side: str,
    position: Floats,
    deviation: Floats,
    steepness: Floats,
) -> tuple[Floats, Floats]:
    """Return the slope errors of chords of 1/20 of the line: of the codes, and of their rounding alone.

    A code stands for the middle of its tick. Chords that begin or end where a run of one code does are enough.
    """
    ticks, turn = axis.program.ticks, axis.drive.turn
    share = turn if side == "forward" else 1.0 - turn
    low, high = (edge if side == "forward" else 1.0 - edge for edge in axis.fourier.window)
    begin_t = 0.0 if side == "forward" else turn
    ends = sorted(ticks * (begin_t + share * edge) for edge in (low, high))
    first, stop = ceil(ends[0] - 0.5), floor(ends[1] - 0.5) + 1
    length = max(1, min(round(CHORD * share * ticks), stop - first - 1))
    if stop - first < 2:
        return np.zeros(1), np.zeros(1)
    begins = union_sorted(period.edges, period.edges - length)
    begins = begins[(begins >= first) & (begins + length < stop)]
    if not len(begins):
        begins = np.array([first], dtype=np.int64)
    both = []
    for k in (begins, begins + length):
        t = (k + 0.5) / ticks
        where = t / turn if side == "forward" else (1.0 - t) / share
        noise = period.errors(k) / period.codes_per_unit / np.interp(where, position, steepness)
        both.append((where, noise, noise + np.interp(where, position, deviation)))
    (x0, noise0, total0), (x1, noise1, total1) = both
    return (total1 - total0) / (x1 - x0), (noise1 - noise0) / (x1 - x0)


def _peak_to_peak(values: Floats) -> float:
    return 100.0 * float(np.max(values) - np.min(values))
