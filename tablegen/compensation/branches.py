"""Models that are calibrated branch by branch: ``branches`` of the scanner file, at the turn and the size of a scan."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Annotated, Self

from msgspec import Meta, field

from tablegen.base.figures import at_least, at_most
from tablegen.base.input_errors import Unphysical
from tablegen.base.quantities import Normalised
from tablegen.compensation.branch import Branch, residual_between
from tablegen.compensation.line import AppliedBranch, LineRequest, LineShape, Sweep
from tablegen.compensation.model import Hysteresis, Parameters
from tablegen.compensation.model_problems import ModelProblems
from tablegen.compensation.points import beyond_driver, repeated_points

# A calibration serves turning points this far beyond the calibrated ones: the paper sees no major difference
# between 0.5 and 0.7 except at large sizes, and 10 % to 25 % between 0.7 and 0.9.
TURN_REACH = 0.1


class Branches(Parameters, frozen=True):
    """Both directions, calibrated at one turning point."""

    turn: Annotated[Normalised, Meta(description="turning point at which the branches were calibrated")]
    forward: Branch
    backward: Branch

    @property
    def sides(self) -> tuple[tuple[str, Branch], ...]:
        """Both directions by name."""
        return ("forward", self.forward), ("backward", self.backward)


class WithBranches(Hysteresis, frozen=True):
    """A model whose table may hold calibrated branches, used or not, so that one key changes the model."""

    branches: Annotated[
        list[Branches], Meta(max_length=64, description="one entry per calibrated turn; interpolated between them")
    ] = field(default_factory=list)

    @property
    def calibrated(self) -> bool:
        """True if there are branches."""
        return bool(self.branches)

    @classmethod
    def like(cls, other: Hysteresis) -> Self | None:
        """Return this model on the branches of another one; None where those lack what it needs."""
        model = cls(branches=other.branches) if isinstance(other, WithBranches) else cls()
        return None if model.faults() else model


class ByBranches(WithBranches, frozen=True):
    """A model that has a sweep for each residual beta, and for its peak where it needs one."""

    @classmethod
    @abstractmethod
    def sweep(cls, beta: float, u_peak: float) -> Sweep:
        """Return the sweep by the model's equation.

        Raises
        ------
        Unphysical
            If there is no sweep of this residual and peak.
        """

    @classmethod
    @abstractmethod
    def peak_at(cls, beta: float, u_peak: float) -> float:
        """Return the place of the largest residual, from the numbers of the table."""

    @classmethod
    def wrong_key(cls, beta: float, u_peak: float) -> str | None:
        """Return the key that is wrong where there is no sweep; None if it is the residual."""
        return None

    def lacking(self, branch: Branch) -> list[str]:
        """Return the keys of a branch that this model needs and that are not given."""
        return []

    def faults(self) -> list[tuple[str, str]]:
        """Return the branches that lack keys, or that are repeated, with the reason."""
        if not self.branches:
            return [("branches", f"missing; the {self.model()} model needs a calibrated branch")]
        faults = []
        for i, entry in enumerate(self.branches):
            if any(entry.turn == earlier.turn for earlier in self.branches[:i]):
                faults.append((f"branches[{i}].turn", f"{entry.turn:g} is calibrated twice"))
            for side, branch in entry.sides:
                wrong = repeated_points(branch.points or [])
                wrong += [(key, f"missing; the {self.model()} model needs it") for key in self.lacking(branch)]
                faults += [(f"branches[{i}].{side}.{key}", why) for key, why in wrong]
        return faults

    def line(self, request: LineRequest, problems: ModelProblems) -> LineShape | None:
        """Return the line of both branches at this turn and scan size."""
        self._check_amplitudes(request, problems)
        turn, entries = request.turn, sorted(enumerate(self.branches), key=lambda entry: entry[1].turn)
        turns = [entry.turn for _, entry in entries]
        if not turns[0] - TURN_REACH - 1e-9 <= turn <= turns[-1] + TURN_REACH + 1e-9:
            _refuse_turn(request.turn, problems, turns)
            return None
        right = next((i for i, t in enumerate(turns) if t >= turn), len(turns) - 1)
        left = right if turns[right] <= turn or right == 0 else right - 1
        share = 0.0 if left == right else (turn - turns[left]) / (turns[right] - turns[left])

        applied, shapes = [], []
        for side in ("forward", "backward"):
            one: Branch = getattr(entries[left][1], side)
            other: Branch = getattr(entries[right][1], side)
            key = f"branches[{entries[left if share < 0.5 else right][0]}].{side}"
            residual = None
            with problems.at(f"{key}.points"):
                residual = residual_between(one, other, share, request.v, request.driver, request.v_offset)
            if residual is None:
                continue
            beta, u_peak, beta_max = residual
            name = "points" if beta_max is None else self.wrong_key(beta, u_peak) or "beta_max"
            with problems.at(f"{key}.{name}"):
                shapes.append(self._shape(beta, beta_max, u_peak))
                applied.append(AppliedBranch(beta, self.peak_at(beta, u_peak)))
        if len(shapes) < 2:
            return None
        return LineShape(turn, shapes[0], shapes[1], (applied[0], applied[1]))

    def _check_amplitudes(self, request: LineRequest, problems: ModelProblems) -> None:
        for i, entry in enumerate(self.branches):
            for side, branch in entry.sides:
                for key, why in beyond_driver(branch.points or [], request.driver):
                    problems.add(f"branches[{i}].{side}.{key}", why)

    def _shape(self, beta: float, beta_max: float | None, u_peak: float) -> Sweep:
        """Return the sweep; raise ``Unphysical`` with the residual that fits where there is none."""
        try:
            return self.sweep(beta, u_peak)
        except Unphysical as reason:
            text, has_remedy = str(reason).partition("; lower it")[:2]
            fits = _largest(lambda share: self.sweep(share * beta, u_peak)) if has_remedy else 0.0
            if not fits:
                raise
            what, value = ("beta", beta) if beta_max is None else ("beta_max", beta_max)
            raise Unphysical(f"{text}; a {what} up to {at_most(fits * value)} fits, or a smaller scan") from None


def _largest(build: Callable[[float], object]) -> float:
    """Return the largest share, below 1, that can be built."""
    fits, fails = 0.0, 1.0
    for _ in range(40):
        middle = 0.5 * (fits + fails)
        try:
            build(middle)
            fits = middle
        except Unphysical:
            fails = middle
    return fits


def _refuse_turn(turn: float, problems: ModelProblems, turns: list[float]) -> None:
    nearest = min(turns, key=lambda t: abs(t - turn))
    low = at_least(max(turns[0] - TURN_REACH - 1e-10, 0.0), 6)
    high = at_most(min(turns[-1] + TURN_REACH + 1e-10, 1.0), 6)
    problems.add_to_scan(
        "turn",
        f"{turn:.9g} is {abs(turn - nearest):.9g} from the nearest calibrated branch (turn = {nearest:g}); "
        f"{low} to {high} can be served, "
        f"or calibrate one in {problems.scanner_file.name}",
    )
