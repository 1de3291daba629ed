"""The placement of the sequencer: the kind of axis, and whether it renders its tables from Fourier words."""

from dataclasses import dataclass, replace
from typing import Literal

from tablegen.device.by_turns import LEAST_CLOCKS
from tablegen.device.dual_program import DualProgram
from tablegen.fixedpoint.program import Program

_SERIAL_CLOCKS, _SPLINE_SERIAL_CLOCKS = 41, 90  # clocks per sample
_SHAPING_SERIAL_CLOCKS = 2  # more
_SCANNER_CLOCKS = 6  # of a sample whose remainder is multiplied
_SPLINE_CLOCKS = 11  # of a product of a spline
_BY_TURNS_LATENCY = 48  # clocks from a tick to its sample where x and y go by turns
_BY_TURNS_DRAIN = 58  # more than that
_LATENCY, _SPLINE_LATENCY = 48, 76  # clocks: more than a sample takes, if it is not serial

Axis = Literal["pipelined", "blocks", "serial", "alternate"]


@dataclass(frozen=True)
class Placement:
    """A placement: a sample a clock in look-up tables or with multiplier blocks, low area, or both axes by turns.

    ``shaping`` is the highest order of shaping that it has, 0 to 3; ``spline``: it plays a cubic table.
    """

    axis: Axis = "pipelined"
    fourier: bool = False
    shaping: int = 0
    spline: bool = False

    def playing(self, program: DualProgram) -> "Placement":
        """Return this placement with what a program needs."""
        axes = (program.x, program.y)
        shaping = max(axis.output.shaping.order for axis in axes)
        return replace(self, shaping=shaping, spline=any(axis.mode == "cubic" for axis in axes))

    @property
    def tick_clocks(self) -> int:
        """The fewest clocks from tick to tick."""
        if self.axis == "serial":
            clocks = _SPLINE_SERIAL_CLOCKS if self.spline else _SERIAL_CLOCKS
            return clocks + (_SHAPING_SERIAL_CLOCKS if self.shaping else 0)
        if self.axis == "alternate":
            return LEAST_CLOCKS
        return _SPLINE_CLOCKS if self.spline else _SCANNER_CLOCKS if self.shaping == 3 else 1

    @property
    def latency(self) -> int:
        """The clocks from a tick to its sample."""
        if self.axis == "serial":
            return self.tick_clocks
        if self.axis == "alternate":
            return _BY_TURNS_LATENCY
        spline, plain = self.spline, self.axis == "blocks"
        return (45 if spline else 12 if plain else 17) + (12 if plain else 19) + (1 if self.shaping else 0)

    @property
    def drain_clocks(self) -> int:
        """The clocks after which a sample has left: more than its latency."""
        if self.axis == "alternate":
            return _BY_TURNS_DRAIN + self.tick_clocks
        return (_SPLINE_LATENCY if self.spline else _LATENCY) + self.tick_clocks

    def renders(self, program: Program) -> bool:
        """Return True if the device renders the table of this axis; a ``direct`` one is always uploaded."""
        return self.fourier and program.mode != "direct"

    def parameters(self, harmonics: int, sine_file: str) -> dict[str, int | str]:
        """Return the parameters of the sequencer; ``harmonics`` is the greatest of both axes."""
        parameters: dict[str, int | str] = {
            "PLAIN_MULTIPLIER": int(self.axis == "blocks"),
            "LOW_AREA": int(self.axis == "serial"),
            "ALTERNATE": int(self.axis == "alternate"),
            "SHAPING": self.shaping,
        }
        if self.fourier:
            parameters |= {"FOURIER": 1, "HARMONICS": harmonics, "SINE_FILE": sine_file}
        return parameters

    def commit_clocks(self, *tables: tuple[int, int]) -> int:
        """Return the clocks from a commit to the committed bank, for tables (length, harmonics or 0 if uploaded).

        The numbers are those of dac_fourier.v and dac_render.v.
        """
        if not self.fourier:
            return 1
        digits, latency = (2, 8) if self.axis == "blocks" else (16, 6)
        return 4 + sum(
            (length // 2 + 1) * (digits * (2 * harmonics + 3) + 2) + latency + 1
            for length, harmonics in tables
            if harmonics
        )
