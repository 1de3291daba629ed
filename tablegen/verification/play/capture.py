"""The captured words of a session beside those of the model, and the place of each tick in its program."""

from dataclasses import dataclass, replace

import numpy as np

from tablegen.device.dual_program import DualProgram
from tablegen.fixedpoint.program import Program
from tablegen.manifest.read import StoredBuild
from tablegen.numerics.arrays import Bools, Ints
from tablegen.verification.checks.shaped import shaped_codes
from tablegen.verification.play.stream import FLAGS, Script, Words

UNDEFINED = np.uint64((1 << 64) - 1)  # value of a captured word with an unknown bit
_MASK = {"x": (0, 0xFFFFFF), "y": (24, 0xFFFFFF), "markers": (48, 0xFF), "faults": (56, 0xFF)}


@dataclass(frozen=True, eq=False)
class Capture:
    """The captured words of a session, those of the model, and the place of each tick in its program.

    ``place`` is the tick of the frame, -1 where nothing plays, and ``since`` the tick since the program began.
    ``which`` is the program in the bank, by its number in ``programs``; the first is none. ``steady`` says where the
    output had caught up with it, ``own`` where it is the program of the build.
    """

    got: Words
    expected: Words
    place: Ints
    since: Ints
    which: Ints
    steady: Bools
    own: Bools
    programs: tuple[DualProgram | None, ...]
    length_error: int  # ticks that the model has and the capture has not, or the other way round

    @property
    def known(self) -> Bools:
        """The ticks of which the simulator knew every bit.

        Returns
        -------
        Bools
            Shape (ticks,).
        """
        known: Bools = self.got != UNDEFINED
        return known

    def limits(self, axis: str, name: str) -> Ints:
        """Return a figure of the output stage, such as max_step, of the program of each tick; 0 before the first.

        Returns
        -------
        Ints
            Shape (ticks,).
        """
        figures = [0 if one is None else int(getattr(getattr(one, axis).output, name)) for one in self.programs]
        return np.array(figures, dtype=np.int64)[self.which]


def part(subject: str, words: Words) -> Ints:
    """Return a field of captured words.

    Parameters
    ----------
    subject
        "x", "y", "markers" or "faults".
    words
        Captured words, shape (ticks,).

    Returns
    -------
    Ints
        Shape (ticks,).
    """
    shift, mask = _MASK[subject]
    return (words >> np.uint64(shift) & np.uint64(mask)).view(np.int64)


def differing(subject: str, capture: Capture) -> Ints:
    """Return the ticks at which a field of the captured words differs from the model.

    Parameters
    ----------
    subject
        "x", "y", "markers" or "faults".

    Returns
    -------
    Ints
        Ticks, ascending, shape (errors,).
    """
    shift, mask = _MASK[subject]
    return np.flatnonzero((capture.got ^ capture.expected) & np.uint64(mask << shift))


def without_faults(words: Words) -> Words:
    """Return captured words with their faults cleared.

    Parameters
    ----------
    words
        Captured words, shape (ticks,).

    Returns
    -------
    Words
        Shape (ticks,).
    """
    cleared: Words = words & ~np.uint64(_MASK["faults"][1] << _MASK["faults"][0])
    return cleared


def with_capture(capture: Capture, got: Words) -> Capture | None:
    """Return a second capture of the same session, if it has as many ticks as the first; else None.

    Parameters
    ----------
    got
        Words of the second capture, shape (ticks,).

    Returns
    -------
    Capture or None
        With the model of the first.
    """
    return None if capture.length_error or len(got) != len(capture.got) else replace(capture, got=got)


def make_capture(stored: StoredBuild, script: Script, got: Words) -> Capture:
    """Align the captured words of a session with the model, up to the shorter of both.

    Parameters
    ----------
    got
        Captured words, shape (ticks,).

    Returns
    -------
    Capture
        Its arrays have one shape; ``lost`` is the difference of both lengths.
    """
    model = np.array(script.expected, dtype=np.uint64)
    playing, frame = (model & np.uint64(1 << 48 + FLAGS.index(name)) != 0 for name in ("playing", "frame"))
    index = np.arange(len(model))
    place = np.where(playing, index - np.maximum.accumulate(np.where(frame, index, -1)), -1)
    firsts = [first for first, _ in script.programs]
    programs = tuple(program for _, program in script.programs)
    which = np.searchsorted(firsts, index, side="right") - 1
    steady = np.zeros(len(model), dtype=np.bool_)
    own = np.zeros(len(model), dtype=np.bool_)
    since = np.zeros(len(model), dtype=np.int64)
    for number, (first, stop) in enumerate(zip(firsts, [*firsts[1:], len(model)], strict=True)):
        program = programs[number]
        if program is None:
            continue
        own[first:stop] = program is stored.program
        since[first:stop] = _since_begin(program, place[first:stop])
        steady[first:stop] = _caught_up(program, place[first:stop], since[first:stop], model[first:stop])
    length = min(len(model), len(got))
    return Capture(
        got[:length],
        model[:length],
        place[:length],
        since[:length],
        which[:length],
        steady[:length],
        own[:length],
        programs,
        abs(len(model) - len(got)),
    )


def _since_begin(program: DualProgram, place: Ints) -> Ints:
    """Return the ticks since one program began, which nothing interrupts but rests and starts."""
    # A scan begins where a frame does and the tick before was not the last of one.
    begins = (place == 0) & (np.concatenate([[-1], place[:-1]]) != program.schedule.frame_ticks - 1)
    index = np.arange(len(place))
    return index - np.maximum.accumulate(np.where(begins, index, 0))


def _caught_up(program: DualProgram, place: Ints, since: Ints, model: Words) -> Bools:
    """Return True at ticks where the codes of the model have caught up with one program."""
    reached = place >= 0
    for axis, one in (("x", program.x), ("y", program.y)):
        reached[reached] = _codes(one, place[reached], since[reached]) == part(axis, model)[reached]
    index = np.arange(len(place))
    # An output that has caught up stays so: one right tick since the program began, this one included, is enough.
    return (place >= 0) & (np.maximum.accumulate(np.where(reached, index, -1)) >= index - since)


def _codes(program: Program, place: Ints, since: Ints) -> Ints:
    """Return the codes at ticks of a frame, and since the program began."""
    if not program.output.shaping.order:
        if len(place) > program.ticks:  # every code of a period once
            return program.codes(np.arange(program.ticks, dtype=np.int64))[place % program.ticks]
        return program.codes(place % program.ticks)
    return shaped_codes(program, int(np.max(since, initial=-1)) + 1)[since]
