"""Scripts of random moves, zooms and turns of a scan at an angle, for a sequencer with SLOW_PART."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from slow_scripts import SlowScript, least_ticks, slow_pace
from turned_changes import PARK_CODES, TICK, Change, RandomHost, Seen, Ticks, follow, shape_of_plans

from tablegen.verification.play.stream import Words


@dataclass
class TurnedScript:
    """A script, the programs in the order in which they are taken, and how often the scan is started and parked."""

    script: SlowScript
    taken: list[Change]
    starts: int = 0
    parks: int = 0

    def follow(self, capture: Words) -> Seen:
        """Check the laws of all captured ticks."""
        return follow(ticks_of(capture), self.taken, self.starts, self.parks, PARK_CODES)


def turned_script(rng: Generator, changes: int) -> TurnedScript:
    """Commits of a host at any tick of a scan that seldom parks."""
    host = RandomHost(rng)
    shape = shape_of_plans()
    pace = slow_pace(shape)
    script = SlowScript(PARK_CODES, shape=shape)
    made = TurnedScript(script, [])
    script.tick_every(pace)
    while len(made.taken) < changes:
        change = host.change()
        ticks = change.program.schedule.ticks
        assert ticks >= least_ticks(shape, pace)
        script.put(change.program)
        if script.model.running:
            script.wait_ticks(int(rng.integers(1, max(ticks - script.model.tick, 2))))
        if rng.random() < 0.06:
            script.wait_ticks(int(rng.integers(1, ticks)))
        script.swap(change.program, change.mode)
        made.taken.append(change)
        if script.model.running and rng.random() < 0.01:
            script.wait_ticks(int(rng.integers(1, 2 * ticks)))
            script.park()
            made.parks += 1
        if not script.model.running:
            script.wait_ticks(2)
            script.start()
            made.starts += 1
        while script.waiting:  # up to the first tick of a line
            playing = script.model.playing
            script.wait_ticks(1 if playing is None else -script.model.tick % playing.schedule.ticks + 1)
        if rng.random() < 0.1:
            script.request("clear_faults")
        if rng.random() < 0.1:
            script.wait_ticks(int(rng.integers(1, 2 * ticks)))
    script.wait_ticks(100)
    return made


def ticks_of(capture: Words) -> Ticks:
    """Captured words as ticks."""
    ticks = np.zeros(len(capture), dtype=TICK)
    ticks["x"], ticks["y"] = capture & np.uint64(0xFFFFFF), capture >> np.uint64(24) & np.uint64(0xFFFFFF)
    ticks["markers"], ticks["faults"] = capture >> np.uint64(48) & np.uint64(0xFF), capture >> np.uint64(56)
    return ticks
