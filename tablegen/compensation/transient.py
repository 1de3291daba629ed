"""How a line drifts after a change of offset or of size, line after line."""

from dataclasses import dataclass

from tablegen.numerics.elementary import exp

OFFSET_CHANGE = 0.1  # of v_max: the change of offset that drift is stated for, from the middle's side
SIZE_CHANGE = 0.5  # of the size: the smaller scan before


@dataclass(frozen=True, slots=True)
class Transient:
    """``late`` has what is to come of every term of creep, in nm, and its time constant in s.

    ``memory_nm`` is the largest distance of the first forward sweep from settled ones.
    """

    late: tuple[tuple[float, float], ...]
    memory_nm: float

    def drift_nm(self, line_s: float, first: int, count: int) -> float:
        """How far the mean position of a line moves from line ``first`` after the change on, over ``count`` lines."""
        total = 0.0
        for nm, tau_s in self.late:
            share = line_s / tau_s
            of_line = (1.0 - exp(-share)) / share if share > 1e-9 else 1.0
            total += nm * of_line * exp(-first * share) * (1.0 - exp(-count * share))
        return abs(total)

    def lines(self, line_s: float, count: int, bound_nm: float, most: int) -> int:
        """After how many lines the next ``count`` drift by no more than a bound; ``most`` + 1 where that is later."""
        low, high = 0, most + 1
        while low < high:  # the drift falls from line to line
            middle = (low + high) // 2
            if self.drift_nm(line_s, middle, count) <= bound_nm:
                high = middle
            else:
                low = middle + 1
        return low
