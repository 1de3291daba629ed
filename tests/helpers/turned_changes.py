"""Moves, zooms and turns of a scan at an angle, at random and while it plays, and what must hold of every tick.

The laws take nothing from the model of the sequencer. They have the programs in the order in which a device took them,
and the codes of each, which ``frame_codes`` computes from its words by the formulas of docs/sequencer.md.
"""

import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from replacing import replace
from turned_scans import turned_setup

from tablegen.api.turned import build_turned
from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import ScanProgram
from tablegen.fixedpoint.frame_program import FrameProgram, Knots
from tablegen.fixedpoint.frame_words import FrameMove
from tablegen.numerics.arrays import Bools, Ints
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import FLAGS

ANGLES_DEG = (12.0, 90.0, -35.0, 140.0)
RATES_HZ = (500.0, 400.0)  # 32 and 40 ticks a line
LINES, UPDATE_RATE_HZ, SIZE_NM = 6, 16e3, 100.0
LIMITS = (2500, 61000), (4000, 64500)  # codes of x and y
PARK_CODES = 30000, 36000
MOST_SHARE, LEAST_SHARE = 5.0, 0.01  # of the parts of a plan: its gains fit their bits up to this
BIT = {name: 1 << bit for bit, name in enumerate(FLAGS)}
TICK = np.dtype([("x", "<u4"), ("y", "<u4"), ("markers", "u1"), ("faults", "u1")])
Ticks = NDArray[np.void]
KINDS = ("move", "zoom", "turn", "plan", "rate")


class Broken(AssertionError):
    """A law does not hold; the message has which one, and the tick."""


# The programs.


@cache
def plan_of(angle_deg: float, rate_hz: float) -> ScanProgram:
    """The program of a plan at an angle, with limits to its codes."""
    edits = (
        f"timing.lines = {LINES}",
        "timing.pixels = 8",
        f"timing.line_rate_hz = {rate_hz}",
        f"dac.update_rate_hz = {UPDATE_RATE_HZ}",
        "x.band_limit.harmonics = 12",
        "y.band_limit.harmonics = 8",
    )
    with tempfile.TemporaryDirectory() as folder:
        setup = turned_setup(Path(folder), angle_deg, *edits, size_nm=SIZE_NM)
        program = build_turned(setup).plan.program
    axes = []
    for axis, limits, park_code in zip((program.x, program.y), LIMITS, PARK_CODES, strict=True):
        assert isinstance(axis, FrameProgram)
        output = replace(axis.output, code_min=limits[0], code_max=limits[1], park_code=park_code)
        assert (output.coding, output.word_bits) == ("offset-binary", output.dac_bits)
        axes.append(replace(axis, fast=replace(axis.fast, output=output)))
    return replace(program, x=axes[0], y=axes[1])


def shape_of_plans() -> SequencerShape:
    """The shape of the sequencer that plays all of them."""
    (shape,) = {
        SequencerShape.of((program.x.fast, program.y.fast))  # type: ignore[union-attr]
        for program in (plan_of(angle, rate) for angle in ANGLES_DEG for rate in RATES_HZ)
    }
    return shape


def frame_sums(axis: FrameProgram) -> Ints:
    """The sums of a frame before they are rounded, from the words alone; shape (lines, ticks)."""
    lines, ticks = axis.lines, axis.fast.phase.ticks
    j, k = np.arange(lines), np.arange(ticks)
    gain, ratio = at_lines(axis.gains, j), at_lines(axis.ratios, j)
    top = 1 << (axis.fast.bits - 1)
    tables = np.clip(axis.fast.words + ((ratio[:, None] * axis.second + (1 << 11)) >> 12), -top, top - 1)
    slow_at = np.arange(lines + 1) % lines
    slow = axis.slow.gain_word * spline(axis.slow.words, (slow_at << 32) // lines) + axis.slow.offset_word
    here = [int(word) for word in slow]  # products of more than 64 bits
    step = (1 << 32) // ticks
    ways = [after - before for before, after in pairwise(here)]
    ramp = np.array([(abs(way) * step >> 32) * (1 if way > 0 else -1) for way in ways])
    return np.asarray(gain[:, None] * spline(tables, (k << 32) // ticks) + slow[:lines, None] + k * ramp[:, None])


def frame_codes(axis: FrameProgram) -> Ints:
    """The codes of a frame with their limits and without a guard, from the words alone; shape (lines, ticks)."""
    output = axis.output
    codes = (frame_sums(axis) + (1 << (output.gain_q - 1))) >> output.gain_q
    return np.asarray(np.clip(codes, output.code_min, output.code_max))


def at_lines(knots: Knots, line: Ints) -> Ints:
    """The words of lines between knots."""
    n = np.minimum(line // knots.spacing, len(knots.words) - 2)
    u, v = knots.words[n], knots.words[n + 1]
    return np.asarray(u + ((v - u) * (line - n * knots.spacing) + knots.spacing // 2) // knots.spacing)


def spline(tables: Ints, phase: Ints) -> Ints:
    """The samples of cubic tables, shape (..., words), at phases."""
    length = tables.shape[-1]
    bits = length.bit_length() - 1
    index, v = phase >> (32 - bits), (phase >> (14 - bits)) & ((1 << 18) - 1)
    c0, c1, c2, c3 = (tables[..., (index + ahead) % length] for ahead in range(4))

    def part(value: Ints) -> Ints:
        return np.asarray((value * v + (1 << 18)) >> 19)

    sample = 24 * (c0 - 2 * c1 + c2) + part(16 * (c3 - c0 + 3 * (c1 - c2)))
    return np.asarray(2 * (c0 + 4 * c1 + c2) + part(12 * (c2 - c0) + part(sample)))


# Random changes.


@dataclass(frozen=True, eq=False)
class Change:
    """A program that a host commits, and the codes of its frame, of shape (lines, ticks) an axis."""

    program: ScanProgram
    mode: CommitMode
    kind: str
    codes: tuple[Ints, Ints]

    @property
    def outputs(self) -> tuple[FrameProgram, FrameProgram]:
        """Both axes."""
        x, y = self.program.x, self.program.y
        assert isinstance(x, FrameProgram)
        assert isinstance(y, FrameProgram)
        return x, y


@dataclass
class RandomHost:
    """What an operator does with a scan: each change is a program beside the last one."""

    rng: Generator
    angle_deg: float = ANGLES_DEG[0]
    rate_hz: float = RATES_HZ[0]
    shares: NDArray[np.float64] = field(default_factory=lambda: np.ones((2, 2)))  # of the line and the frame, an axis
    places: NDArray[np.float64] = field(default_factory=lambda: np.full(2, 0.5))  # in the room between the limits

    def change(self) -> Change:
        """A move, a zoom or a turn; seldom another rate, or a commit by which the host asks for a new frame."""
        rng, shares = self.rng, self.shares.copy()
        kind = str(rng.choice(KINDS, p=[0.4, 0.2, 0.18, 0.2, 0.02]))
        mode = CommitMode.KEEP if rng.random() < 0.97 else CommitMode(int(rng.choice([0, 2])))
        match kind:
            case "move" if rng.random() < 0.3:
                self.places = rng.uniform(0.0, 1.0, 2)
            case "move":
                self.places = np.clip(self.places + rng.normal(0.0, 0.1, 2), 0.0, 1.0)
            case "zoom":
                shares = shares * np.exp(rng.uniform(-1.0, 1.0)) * np.exp(rng.uniform(-0.1, 0.1, (2, 2)))
            case "turn":  # the preview of a turn: other shares of the tables that play
                shares = shares * rng.uniform(-1.3, 1.3, (2, 2))
            case "plan":
                self.angle_deg = float(rng.choice([each for each in ANGLES_DEG if each != self.angle_deg]))
            case "rate":
                self.rate_hz = RATES_HZ[1 - RATES_HZ.index(self.rate_hz)]
                mode = CommitMode(int(rng.integers(3)))
        size = np.clip(np.abs(shares), LEAST_SHARE, MOST_SHARE)
        if np.max(size) < 20 * LEAST_SHARE:  # zoom out again
            size = np.full((2, 2), rng.uniform(0.5, 3.0))
        self.shares = np.where(shares < 0, -size, size)
        plan = plan_of(self.angle_deg, self.rate_hz)
        axes = [
            self._axis(axis, float(row[0]), float(row[1]), float(place))
            for axis, row, place in zip((plan.x, plan.y), self.shares, self.places, strict=True)
        ]
        schedule = replace(plan.schedule, settle_lines=int(rng.integers(3)))
        codes = axes[0][1], axes[1][1]
        return Change(ScanProgram(axes[0][0], axes[1][0], schedule), mode, kind, codes)

    def _axis(self, axis: object, fast: float, slow: float, place: float) -> tuple[FrameProgram, Ints]:
        """An axis of a plan with other shares, mostly where its limits let it be, and a guard for its steps."""
        assert isinstance(axis, FrameProgram)
        rng, output = self.rng, axis.output
        made = FrameMove.of(axis, fast, slow, 0.0).program(axis)
        sums, half = frame_sums(made), 1 << (output.gain_q - 1)
        low = output.code_min - (int(np.min(sums)) >> output.gain_q)
        high = output.code_max - (int(np.max(sums)) >> output.gain_q) - 1
        if low > high or rng.random() < 0.04:  # the clamp limits some of the codes
            low, high = output.code_min, output.code_max
        word = int((low + place * (high - low)) * (1 << output.gain_q))
        made = replace(made, slow=replace(made.slow, offset_word=word))
        codes = np.asarray(np.clip((sums + word + half) >> output.gain_q, output.code_min, output.code_max))
        steepest = int(np.max(np.abs(np.diff(codes.ravel(), prepend=codes[-1, -1]))))
        share = float(rng.choice([1.0, rng.uniform(1.0, 3.0), rng.uniform(3.0, 20.0), 0.7], p=[0.2, 0.35, 0.42, 0.03]))
        return made.guarded(int(share * steepest)), codes


# What must hold.


@dataclass
class Seen:
    """What the laws have seen; ``whole_lines`` are those with both axes at the codes of their program on all ticks.

    Each is its first tick, its number in the frame, and the number of its program among those that were taken.
    """

    counts: Counter[str] = field(default_factory=Counter)
    whole_lines: list[tuple[int, int, int]] = field(default_factory=list)

    def __str__(self) -> str:
        return ", ".join(f"{name} {count}" for name, count in sorted(self.counts.items()))


def follow(ticks: Ticks, changes: Sequence[Change], starts: int, parks: int, codes: tuple[int, int]) -> Seen:
    """Check the laws of every tick of a session.

    Every code is inside the limits and no step is larger than the guard of the program that plays. A program is taken
    where a line begins, and the next line of the frame goes on unless the host asked for another. Each line is that of
    one program: its codes are those of the frame, or on the way there from where the output was when the program was
    taken, and once an axis has been there it stays, unless the guard is narrower than the program's own steps.

    Parameters
    ----------
    ticks
        All ticks from power-up on.
    changes
        The programs in the order in which the device took them.
    starts, parks
        How often a scan at rest was started, and a running one parked.
    codes
        Of x and y at power-up.

    Raises
    ------
    Broken
        If a law does not hold.
    """
    seen, laws = Seen(), _Laws(ticks, changes, codes)
    playing = laws.flag("playing")
    edges = np.diff(np.concatenate([[0], playing.astype(np.int64), [0]]))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    stops = len(ends) - int(bool(len(playing)) and bool(playing[-1]))
    if (len(begins), stops) != (starts, parks):
        raise Broken(f"the scan begins {len(begins)} times and stops {stops} times, not {starts} and {parks}")
    at = 0
    for begin, end in zip(begins, ends, strict=True):
        laws.rest(at, int(begin))
        laws.scan(int(begin), int(end), seen)
        at = int(end)
    laws.rest(at, len(ticks))
    laws.all_taken()
    seen.counts["ticks"] += len(ticks)
    return seen


class _Laws:
    def __init__(self, ticks: Ticks, changes: Sequence[Change], codes: tuple[int, int]) -> None:
        self._changes, self._taken = changes, 0
        self._markers = ticks["markers"]
        self._codes = tuple(
            np.concatenate([[code], ticks[name].astype(np.int64)]) for name, code in zip("xy", codes, strict=True)
        )
        self._swapped = self.flag("swapped")

    def flag(self, name: str) -> Bools:
        """A marker of all ticks."""
        return np.asarray(self._markers & BIT[name] != 0)

    def all_taken(self) -> None:
        """Every program was."""
        if self._taken != len(self._changes):
            raise Broken(f"{self._taken} programs were taken, not {len(self._changes)}")

    def rest(self, begin: int, end: int) -> None:
        """Ticks at which no scan plays."""
        at = begin
        for swap in [*(np.flatnonzero(self._swapped[begin:end]) + begin).tolist(), end]:
            self._limited(at, swap)
            if swap < end:
                self._take(swap)
            at = swap
        if np.any(self._markers[begin:end] & (BIT["line"] | BIT["frame"] | BIT["valid"])):
            raise Broken(f"a line begins at rest, between the ticks {begin} and {end}")

    def scan(self, begin: int, end: int, seen: Seen) -> None:
        """The lines of a scan from its start on."""
        at, line = begin, -1
        there = [False, False]
        while at < end:
            line, new = self._next(at, line, at == begin, seen)
            if new or at == begin:
                there = [False, False]
            program = self._changes[self._taken - 1].program
            until = min(at + program.schedule.ticks, end)
            marks, swaps = self._markers[at:until], self._swapped[at + 1 : until]
            if np.any(marks[1:] & (BIT["line"] | BIT["frame"])) or np.any(swaps):
                raise Broken(f"a line or a program begins inside the line at tick {at}")
            if not marks[0] & BIT["line"] or bool(marks[0] & BIT["frame"]) != (line == 0):
                raise Broken(f"at tick {at} line {line} is due, the markers are {marks[0]:#x}")
            self._limited(at, until)
            before = seen.counts["whole lines of an axis"]
            there = [self._goes(at, until, line, axis, there[axis], seen) for axis in (0, 1)]
            seen.counts["lines"] += 1
            if seen.counts["whole lines of an axis"] == before + 2:
                seen.whole_lines.append((at, line, self._taken - 1))
            at = until

    def _next(self, at: int, line: int, begins: bool, seen: Seen) -> tuple[int, bool]:
        """The line that is due, and whether a new program plays it."""
        before = self._changes[self._taken - 1].program.schedule if self._taken else None
        due = 0 if begins or before is None else (line + 1) % before.lines
        if not self._swapped[at]:
            return due, False
        self._take(at)
        change = self._changes[self._taken - 1]
        if begins or before is None:
            return 0, True
        if change.mode == CommitMode.FRAME and due != 0:
            raise Broken(f"a program that waits for a frame is taken in one, at tick {at}")
        same = (before.ticks, before.lines) == (change.program.schedule.ticks, change.program.schedule.lines)
        goes_on = change.mode == CommitMode.KEEP and same
        seen.counts["goes on" if goes_on else "begins again"] += 1
        seen.counts[change.kind] += 1
        return due if goes_on else 0, True

    def _take(self, at: int) -> None:
        if self._taken == len(self._changes):
            raise Broken(f"a program that nobody committed is taken at tick {at}")
        self._taken += 1

    def _limited(self, begin: int, end: int) -> None:
        """The limits of the program that plays; without one the codes stay."""
        outputs = [axis.output for axis in self._changes[self._taken - 1].outputs] if self._taken else [None, None]
        for name, codes, output in zip("xy", self._codes, outputs, strict=True):
            part = codes[begin : end + 1]
            if len(part) < 2:
                continue
            step = int(np.max(np.abs(np.diff(part))))
            if output is None:
                if step:
                    raise Broken(f"{name} moves without a program, between the ticks {begin} and {end}")
                continue
            if step > output.max_step:
                raise Broken(f"{name} steps by {step} of {output.max_step}, between the ticks {begin} and {end}")
            if np.min(part[1:]) < output.code_min or np.max(part[1:]) > output.code_max:
                raise Broken(f"{name} is outside its limits, between the ticks {begin} and {end}")

    def _goes(self, begin: int, end: int, line: int, axis: int, there: bool, seen: Seen) -> bool:
        """An axis on ticks of a line of the program that plays; whether it has been at the codes of the program."""
        change = self._changes[self._taken - 1]
        wanted, step = change.codes[axis][line, : end - begin], change.outputs[axis].output.max_step
        played, before = self._codes[axis][begin + 1 : end + 1], self._codes[axis][begin:end]
        arrived = played == wanted
        seen.counts["ticks of the formula"] += int(np.count_nonzero(arrived))
        seen.counts["ticks on the way"] += int(np.count_nonzero(~arrived))
        if arrived.all():
            seen.counts["whole lines of an axis"] += 1
            return True
        if not np.array_equal(played, np.where(arrived, wanted, before + np.sign(wanted - before) * step)):
            raise Broken(f"{'xy'[axis]} is not that of its program in line {line}, at tick {begin}")
        frame = change.codes[axis].ravel()
        narrow = int(np.max(np.abs(np.diff(frame, prepend=frame[-1])))) > step
        has_been = np.logical_or.accumulate(np.concatenate([[there], arrived[:-1]]))
        if not narrow and np.any(has_been & ~arrived):
            raise Broken(f"{'xy'[axis]} leaves its program in line {line}, at tick {begin}")
        return bool(there or arrived.any())
