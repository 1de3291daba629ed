"""What the sequencers in Verilog and in C are both played with: shapes, paces, and numbers of samples and swaps."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from programs import random_dual, random_program
from replacing import replace
from stream_scripts import random_play

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import DualProgram
from tablegen.device.schedule import Schedule
from tablegen.emit.constants import DEGREES
from tablegen.verification.play.placement import Placement
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script

SWAPS, SWAPS_SLOW = 10_000, 100_000
FEW = (
    "bits_16",
    "bits_18_plain",
    "bits_24",
    "small_counters",
    "low_area",
    "cubic",
    "power_up_codes",
)  # in every `make test`
SMALL = SequencerShape(16, 1, 2, 16, 1, 2, 16)  # so that an upload takes few clocks


@dataclass(frozen=True)
class Configuration:
    """A sequencer as synthesised, and how it is played; ``samples`` on Icarus."""

    shape: SequencerShape
    parameters: Mapping[str, int] = field(default_factory=dict)
    paces: tuple[int, ...] = (1,)
    ticks: tuple[int, int] = (8, 40)
    lines: tuple[int, int] = (1, 5)
    samples: int = 9000

    def script(self, seed: str) -> Script:
        """Random programs back to back; the same ones for the same seed."""
        rng = np.random.default_rng(sum(seed.encode()))
        codes = (self.parameters.get("X_POWER_UP_CODE", 0), self.parameters.get("Y_POWER_UP_CODE", 0))
        script = Script(codes, drain=self.placement.drain_clocks if self.placement.spline else Script.drain)
        script.tick_every(self.paces[0])
        script.wait_ticks(5)
        random_play(rng, script, self.shape, self.samples, self.paces, self.ticks, self.lines, self.shaping)
        return script

    @property
    def placement(self) -> Placement:
        """As it is synthesised."""
        axis = "serial" if self.parameters.get("LOW_AREA") else "pipelined"
        spline = DEGREES["cubic"] in (self.shape.x_interpolated, self.shape.y_interpolated)
        return Placement(axis, shaping=self.shaping, spline=spline)

    @property
    def shaping(self) -> int:
        """The highest order that the sequencer has."""
        return self.parameters.get("SHAPING", 0)


PLAIN_MULTIPLIER = {"PLAIN_MULTIPLIER": 1}
LOW_AREA = {"LOW_AREA": 1}
LEAST_PACE = Placement("serial").tick_clocks
LEAST_PACES = (LEAST_PACE, 64)  # clocks from tick to tick, with LOW_AREA
FIRST, SECOND, SCANNER = ({"SHAPING": order} for order in (1, 2, 3))
SCANNER_PACE = Placement("pipelined", shaping=3).tick_clocks
SHAPED_LEAST_PACES = (Placement("serial", shaping=1).tick_clocks, 64)
SPLINE_PACE = Placement("pipelined", spline=True).tick_clocks
SPLINE_PACES = (SPLINE_PACE, 12, 40)
SPLINE_LOW_AREA_PACES = (Placement("serial", spline=True).tick_clocks, 99)
SHAPED_SPLINE_LOW_AREA_PACES = (Placement("serial", shaping=3, spline=True).tick_clocks,)
CONFIGURATIONS: dict[str, Configuration] = {
    "bits_16": Configuration(SequencerShape(16, 1, 5, 16, 1, 4, 16), samples=12000),
    "bits_16_plain": Configuration(SequencerShape(16, 1, 5, 16, 1, 4, 16), PLAIN_MULTIPLIER, samples=12000),
    "bits_8": Configuration(SequencerShape(8, 1, 3, 8, 1, 2, 8)),
    "bits_12": Configuration(SequencerShape(12, 1, 2, 12, 0, 7, 12), paces=(1, 2, 3, 7)),
    "bits_18_plain": Configuration(SequencerShape(18, 0, 6, 18, 1, 3, 18), PLAIN_MULTIPLIER, paces=(1, 2, 3, 7)),
    "bits_20": Configuration(SequencerShape(20, 1, 3, 20, 1, 3, 20), paces=(7, 1)),
    "bits_24": Configuration(SequencerShape(24, 1, 3, 24, 1, 2, 24)),
    "bits_24_plain": Configuration(SequencerShape(24, 1, 3, 24, 1, 2, 24), PLAIN_MULTIPLIER),
    "dac_24_words_8_plain": Configuration(SequencerShape(24, 1, 4, 8, 0, 3, 12), PLAIN_MULTIPLIER),
    "dac_24_words_8": Configuration(SequencerShape(24, 1, 4, 8, 1, 3, 9)),
    "dac_8_words_24": Configuration(SequencerShape(8, 1, 4, 24, 1, 3, 22)),
    "dac_8_words_24_plain": Configuration(SequencerShape(8, 0, 5, 24, 1, 3, 21), PLAIN_MULTIPLIER),
    "small_counters": Configuration(
        SequencerShape(16, 1, 3, 16, 1, 2, 16),
        {"TICK_BITS": 5, "LINE_BITS": 3, "PERIOD_BITS": 9, "COUNT_BITS": 5},
        ticks=(24, 32),
        lines=(6, 8),
    ),
    "shortest_lines": Configuration(SequencerShape(16, 1, 3, 16, 0, 3, 16), ticks=(8, 8), lines=(1, 2)),
    "low_area": Configuration(SequencerShape(16, 1, 5, 16, 1, 4, 16), LOW_AREA, LEAST_PACES, samples=1200),
    "low_area_dac_24": Configuration(SequencerShape(24, 1, 3, 8, 0, 4, 24), LOW_AREA, LEAST_PACES, samples=800),
    "low_area_dac_8": Configuration(SequencerShape(8, 0, 5, 24, 1, 3, 12), LOW_AREA, LEAST_PACES, samples=800),
    "first": Configuration(SequencerShape(16, 1, 4, 16, 1, 3, 16), FIRST),
    "first_dac_8_words_24": Configuration(SequencerShape(8, 1, 4, 24, 0, 5, 21), FIRST),
    "second": Configuration(SequencerShape(16, 1, 4, 16, 0, 5, 14), SECOND),
    "second_dac_24_words_8_plain": Configuration(
        SequencerShape(24, 1, 3, 8, 1, 3, 8), SECOND | PLAIN_MULTIPLIER, paces=(1, 2, 7)
    ),
    "scanner": Configuration(SequencerShape(16, 1, 4, 16, 1, 3, 16), SCANNER, paces=(SCANNER_PACE, 7, 19)),
    "scanner_dac_24_words_8": Configuration(SequencerShape(24, 0, 5, 8, 1, 4, 8), SCANNER, paces=(SCANNER_PACE,)),
    "scanner_dac_23_words_24_plain": Configuration(
        SequencerShape(23, 1, 3, 24, 1, 3, 24), SCANNER | PLAIN_MULTIPLIER, paces=(SCANNER_PACE, 8)
    ),
    "scanner_dac_8_words_22_plain": Configuration(
        SequencerShape(8, 1, 3, 22, 0, 5, 24), SCANNER | PLAIN_MULTIPLIER, paces=(SCANNER_PACE,)
    ),
    "scanner_dac_12": Configuration(SequencerShape(12, 1, 3, 12, 1, 3, 16), SCANNER, paces=(SCANNER_PACE,)),
    "first_low_area": Configuration(
        SequencerShape(18, 1, 3, 16, 1, 3, 18), FIRST | LOW_AREA, SHAPED_LEAST_PACES, samples=800
    ),
    "scanner_low_area": Configuration(
        SequencerShape(16, 1, 4, 16, 1, 3, 16), SCANNER | LOW_AREA, SHAPED_LEAST_PACES, samples=1200
    ),
    "scanner_low_area_dac_24": Configuration(
        SequencerShape(24, 1, 3, 8, 0, 4, 24), SCANNER | LOW_AREA, SHAPED_LEAST_PACES, samples=800
    ),
    "second_low_area_dac_8": Configuration(
        SequencerShape(8, 0, 5, 24, 1, 3, 12), SECOND | LOW_AREA, SHAPED_LEAST_PACES, samples=800
    ),
    "cubic": Configuration(SequencerShape(16, 3, 5, 14, 3, 4, 16), paces=SPLINE_PACES, samples=2500),
    "cubic_x": Configuration(SequencerShape(18, 3, 3, 21, 1, 4, 18), paces=SPLINE_PACES, samples=1500),
    "cubic_y_plain": Configuration(
        SequencerShape(24, 0, 5, 24, 3, 3, 8), PLAIN_MULTIPLIER, paces=SPLINE_PACES, samples=1500
    ),
    "cubic_y_lines_plain": Configuration(
        SequencerShape(12, 1, 4, 22, 3, 3, 21), PLAIN_MULTIPLIER, paces=(SPLINE_PACE,), samples=1500
    ),
    "cubic_scanner": Configuration(
        SequencerShape(8, 3, 3, 21, 3, 4, 8), SCANNER, paces=(SPLINE_PACE, 13), samples=1500
    ),
    "cubic_low_area": Configuration(
        SequencerShape(16, 3, 4, 14, 3, 3, 21), LOW_AREA, SPLINE_LOW_AREA_PACES, samples=700
    ),
    "cubic_y_low_area": Configuration(
        SequencerShape(24, 1, 3, 8, 3, 3, 8), LOW_AREA, SPLINE_LOW_AREA_PACES, samples=500
    ),
    "cubic_x_scanner_low_area": Configuration(
        SequencerShape(8, 3, 3, 21, 0, 5, 12), SCANNER | LOW_AREA, SHAPED_SPLINE_LOW_AREA_PACES, samples=500
    ),
    "power_up_codes": Configuration(
        SequencerShape(16, 1, 3, 16, 0, 3, 14), {"X_POWER_UP_CODE": 65535, "Y_POWER_UP_CODE": 12345}, paces=(3, 1)
    ),
}


def random_swaps(
    rng: np.random.Generator, swaps: int, shape: SequencerShape = SMALL
) -> tuple[Script, list[DualProgram]]:
    """A scan without end in which programs follow each other, committed at any tick; and the programs, in order."""
    script, programs = Script(), []
    script.tick_every(1)
    for _ in range(swaps):
        program = random_dual(rng, shape, (8, 20), kind="smooth", lines=(1, 3))
        script.load(program)
        script.wait(int(rng.integers(0, 20)))
        script.request("commit", program=program)
        if not programs:
            script.wait(10)
            script.request("arm", "trigger")
        script.wait_ticks(24)
        programs.append(program)
    script.wait_ticks(100)
    return script, programs


def random_changes(rng: np.random.Generator, changes: int, shape: SequencerShape = SMALL) -> tuple[Script, Schedule]:
    """A scan without end whose program is changed at any tick, by commits that keep the frame; and its schedule."""
    script = Script()
    script.tick_every(1)
    first = random_dual(rng, shape, (12, 20), kind="smooth", lines=(3, 5))
    y_place = first.y.hold, first.y.phase.ticks
    for number in range(changes):
        x, y = (random_program(rng, shape, axis, first.schedule, "smooth") for axis in "xy")
        program = replace(first, x=x, y=y if (y.hold, y.phase.ticks) == y_place else first.y)
        script.load(program)
        script.wait(int(rng.integers(0, 20)))
        script.request("commit", program=program, mode=CommitMode.KEEP)
        if number == 0:
            script.wait(10)
            script.request("arm", "trigger")
        script.wait_ticks(24)
    script.wait_ticks(100)
    return script, first.schedule
