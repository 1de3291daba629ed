"""Sessions of random changes at an angle on the integer model, and the same as a script for the C runtime."""

import subprocess
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from building import HELPERS, run_clean, tool
from limits import within
from turned_changes import BIT, PARK_CODES, TICK, Change, RandomHost, Seen, Ticks, follow

from tablegen.base.resources import c_runtime
from tablegen.device.sequencer import Sequencer
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.numerics.arrays import Ints

STEP, FILL, COMMIT, WITHDRAW, PARK, START, CLEAR_FAULTS = range(1, 8)
UNTOLD = 0xFF  # the faults of a tick of a fill, but the last one
CHUNK = 5000  # commits of a session
MOST_FILL = 200
_REPLAY_S = 600  # of CPU time


class Session:
    """A host that changes a scan which the model plays; ``words`` are what it asks of a device in C."""

    def __init__(self, seed: int | list[int], commits: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.host = RandomHost(self.rng)
        self.model = Sequencer(None, codes=PARK_CODES)
        self.taken: list[Change] = []
        self.starts = self.parks = 0
        self.asked: Counter[str] = Counter()
        self.words: list[Ints] = [np.array(PARK_CODES)]
        self._parts: list[Ticks] = []
        self._waits: Change | None = None
        while len(self.taken) < commits:
            self._round()
        self._play(100)

    @property
    def script(self) -> bytes:
        """What the bench in C reads."""
        return (np.concatenate(self.words) & 0xFFFFFFFF).astype("<u4").tobytes()

    @property
    def ticks(self) -> Ticks:
        """All ticks of the model."""
        return np.concatenate(self._parts)

    def follow(self) -> Seen:
        """Check the laws of what the model played."""
        seen = follow(self.ticks, self.taken, self.starts, self.parks, PARK_CODES)
        seen.counts.update(self.asked)
        return seen

    def commit(self, change: Change) -> None:
        """Ask the model and the device; a session of another kind may ask the model for something else."""
        self.model.commit(change.program, change.mode)

    def _round(self) -> None:
        rng = self.rng
        change = self.host.change()
        ticks = change.program.schedule.ticks
        self._do(COMMIT, int(change.mode), *_program_words(change))
        self.commit(change)
        self._waits = change
        self.asked["commits"] += 1
        if not self.model.running and rng.random() < 0.8:
            self._start()
        if rng.random() < 0.05:  # not taken, unless a line begins before
            self._play(int(rng.integers(1, ticks)))
            self._do(WITHDRAW)
            self.model.withdraw()
            self.asked["withdrawals"] += self._waits is not None
            self._waits = None
        if rng.random() < 0.1:
            self._do(CLEAR_FAULTS)
            self.model.clear_faults()
        if rng.random() < 0.01:
            self._play(int(rng.integers(1, 2 * ticks)))
            self._park()
            self._play(int(rng.integers(1, 2 * ticks)))
        if not self.model.running:
            self._play(int(rng.integers(1, 30)))
            self._start()
        # A line later at the latest, with the mode of a frame a frame; often in the next line, seldom some lines on.
        self._play(int(rng.integers(1, ticks)))
        while self._waits is not None:
            self._play(ticks)
        if rng.random() < 0.3:
            self._play(int(rng.integers(1, 3 * ticks)))

    def _start(self) -> None:
        self._do(START)
        self.model.arm()
        self.starts += self.model.trigger()

    def _park(self) -> None:
        self._do(PARK)
        self.parks += self.model.running
        self.model.park()

    def _do(self, *words: int | Ints) -> None:
        self.words.append(np.concatenate([np.atleast_1d(np.asarray(word, dtype=np.int64)) for word in words]))

    def _play(self, ticks: int) -> None:
        """Ticks by one step or by a fill of a device, of the model by as many at once as it takes, or one by one."""
        while ticks:
            now = min(ticks, int(self.rng.integers(1, MOST_FILL)))
            fill = self.rng.random() < 0.7
            self._do(FILL if fill else STEP, now)
            rows = self._model(now, self.rng.random() < 0.1)
            if fill:
                rows["faults"][:-1] = UNTOLD
            self._parts.append(rows)
            ticks -= now

    def _model(self, ticks: int, one_by_one: bool) -> Ticks:
        rows = np.zeros(ticks, dtype=TICK)
        at = 0
        while at < ticks:
            ahead = None if one_by_one else self.model.ahead(ticks - at)
            if ahead is None:
                tick = self.model.step()
                markers = sum(bit for name, bit in BIT.items() if getattr(tick, name))
                rows[at] = tick.x, tick.y, markers, tick.faults.value
                if tick.swapped:
                    assert self._waits is not None
                    self.taken.append(self._waits)
                    self._waits = None
                at += 1
                continue
            lines, faults = ahead
            part = rows[at : at + len(faults)]
            part["x"], part["y"], part["markers"], part["faults"] = lines.x, lines.y, BIT["playing"], faults
            for name in ("line", "frame", "pixel", "backward", "valid"):
                part["markers"] |= np.where(getattr(lines, name), BIT[name], 0).astype(np.uint8)
            at += len(part)
        return rows


def _program_words(change: Change) -> tuple[Ints, ...]:
    """A program for the bench in C, which ``turned_bench.c`` reads in this order."""
    schedule = change.program.schedule
    windows = [
        number
        for each in (schedule.forward, schedule.backward, schedule.up, schedule.down)
        for number in (each.first, each.count)
    ]
    first = [schedule.ticks, schedule.lines, schedule.pixels, schedule.settle_lines, schedule.turn_tick, *windows]
    return np.array(first), *(part for axis in change.outputs for part in _axis_words(axis))


def _axis_words(axis: FrameProgram) -> list[Ints]:
    fast, slow, output = axis.fast, axis.slow, axis.output
    numbers = [
        fast.bits, len(fast.words).bit_length() - 1, output.gain_q, output.code_min, output.code_max, output.park_code,
        output.max_step, output.dac_bits, len(axis.gains.words), axis.gains.spacing, len(axis.ratios.words),
        axis.ratios.spacing, len(slow.words).bit_length() - 1, slow.gain_word,
        slow.offset_word & 0xFFFFFFFF, slow.offset_word >> 32,
    ]  # fmt: skip
    return [np.array(numbers), fast.words, axis.second, axis.gains.words, axis.ratios.words, slow.words]


# The same in C.


def compile_bench(
    program: Path,
    compiler: Sequence[str] = ("gcc",),
    options: Sequence[str] = (),
    runtime: Sequence[Path] | None = None,
) -> Path:
    """The bench, with the C runtime or another one."""
    files = list(c_runtime() if runtime is None else runtime)
    macros = ("SLOW_PART=1", "COMMIT_MODES=1", "SPLINE=1", "TABLE_STORAGE_BITS=16", "OUTPUT_STORAGE_BITS=16")
    run_clean(
        [
            *compiler, "-std=c99", "-O2", "-Wall", "-Wextra", "-Werror",
            *(f"-DDAC_{macro}" for macro in macros), *options,
            *(f"-I{folder}" for folder in sorted({str(file.parent) for file in files})),
            *(file for file in files if file.suffix == ".c"), HELPERS / "turned_bench.c", "-o", program,
        ]
    )  # fmt: skip
    return program


def differs(program: Path, session: Session, emulator: str | None = None) -> str | None:
    """Play a session with a compiled bench; says where its ticks are not those of the model."""
    command = [str(program)] if emulator is None else [tool(emulator), str(program)]
    done = subprocess.run(within(_REPLAY_S, command), input=session.script, capture_output=True, check=False)
    whole = len(done.stdout) // TICK.itemsize
    played, expected = np.frombuffer(done.stdout, dtype=TICK, count=whole), session.ticks
    length = min(len(expected), len(played))
    wrong = np.flatnonzero(expected[:length] != played[:length])
    if len(wrong):
        return f"tick {wrong[0]} is {played[wrong[0]]} and not {expected[wrong[0]]}"
    if done.returncode:
        return f"status {done.returncode}: {done.stderr.decode('utf-8', 'replace')[-2000:]}"
    return None if len(expected) == len(played) else f"{len(played)} ticks and not {len(expected)}"
