"""How a user places the sequencer: the kind of axis, and whether it renders its tables from Fourier words."""

from dataclasses import dataclass
from typing import Literal

from tablegen.fixedpoint.program import Program

_SERIAL_CLOCKS, _SHAPED_SERIAL_CLOCKS = 41, 43  # clocks per sample
_SCANNER_CLOCKS = 6  # of a sample whose remainder is multiplied


@dataclass(frozen=True)
class Placement:
    """``axis``: a sample a clock in look-up tables or with multiplier blocks, or low area.

    ``shaping`` is the highest order of shaping that it has, 0 to 3.
    """

    axis: Literal["pipelined", "blocks", "serial"] = "pipelined"
    fourier: bool = False
    shaping: int = 0

    @property
    def tick_clocks(self) -> int:
        """The fewest clocks from tick to tick."""
        if self.axis == "serial":
            return _SHAPED_SERIAL_CLOCKS if self.shaping else _SERIAL_CLOCKS
        return _SCANNER_CLOCKS if self.shaping == 3 else 1

    def renders(self, program: Program) -> bool:
        """Whether the device makes the table of this axis; a ``direct`` one is always uploaded."""
        return self.fourier and program.mode != "direct"

    def parameters(self, harmonics: int, sine_file: str) -> dict[str, int | str]:
        """As the sequencer has them; ``harmonics`` is the greatest of both axes."""
        chosen: dict[str, int | str] = {
            "PLAIN_MULTIPLIER": int(self.axis == "blocks"),
            "LOW_AREA": int(self.axis == "serial"),
            "SHAPING": self.shaping,
        }
        if self.fourier:
            chosen |= {"FOURIER": 1, "HARMONICS": harmonics, "SINE_FILE": sine_file}
        return chosen

    def commit_clocks(self, *tables: tuple[int, int]) -> int:
        """Clocks from a commit to the committed bank, for the length of each table and its harmonics, 0 if uploaded.

        As dac_fourier.v and dac_render.v state them.
        """
        if not self.fourier:
            return 1
        digits, latency = (2, 8) if self.axis == "blocks" else (16, 6)
        return 4 + sum(
            (length // 2 + 1) * (digits * (2 * harmonics + 3) + 2) + latency + 1
            for length, harmonics in tables
            if harmonics
        )
