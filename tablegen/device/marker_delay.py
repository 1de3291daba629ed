"""The integer model of ``dac_marker_delay.v``: each signal of a bundle later by a number of clocks of its own."""

from collections.abc import Sequence
from dataclasses import dataclass, field


@dataclass
class MarkerDelay:
    """The past of every signal since power-up, before which all were low; ``signals`` counts them."""

    signals: int
    _past: list[Sequence[int]] = field(default_factory=list)
    _delays: Sequence[int] = ()

    def step(self, levels: Sequence[int], delays: Sequence[int]) -> list[int]:
        """Take the levels and the delays of a clock; return the outputs of this clock.

        Parameters
        ----------
        levels, delays
            One of each signal, delays in clocks. They act from the next clock on; on the first clock of all, they
            are 2 or more, and nothing has come in.
        """
        self._past.append(levels)
        acting, now = self._delays or [len(self._past)] * self.signals, len(self._past) - 1
        self._delays = list(delays)
        return [int(self._past[now - delay][signal]) if delay <= now else 0 for signal, delay in enumerate(acting)]
