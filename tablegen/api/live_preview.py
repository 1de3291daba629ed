"""The preview of a change: words with which the tables that play come closest to the plan that follows them."""

import hashlib
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from tablegen.device.dual_program import AxisProgram, DualProgram, ScanProgram
from tablegen.fixedpoint.frame_program import FACTOR_FRACTION_BITS, FrameProgram
from tablegen.fixedpoint.program import Program
from tablegen.link.acceptance import Playing, first_objection
from tablegen.link.messages import AxisWords
from tablegen.link.program_image import make_image, take_apart
from tablegen.link.refusal_reasons import Limits
from tablegen.numerics.arrays import Floats

_PLACES = 1024  # of a period that are fitted
_NO_HASH = bytes(32).hex()


@dataclass(frozen=True)
class LivePreview:
    """A move by words alone that plays until the plan of the change does.

    ``x_error_percent`` and ``y_error_percent`` are the largest distances from that plan, in percent of the size; at an
    angle those from the wanted position, by the operators.
    """

    generation: int
    x_error_percent: float
    y_error_percent: float


@dataclass(frozen=True, eq=False)
class PreviewWords:
    """The words of a preview for both axes, and their errors in percent of the size."""

    x: AxisWords
    y: AxisWords
    x_error_percent: float
    y_error_percent: float

    def program(self, playing: DualProgram) -> DualProgram:
        """Return the program that plays, with these words."""
        return DualProgram(_moved(playing.x, self.x), _moved(playing.y, self.y), playing.schedule)


def words_of(axis: AxisProgram) -> AxisWords:
    """Return the words of a program that was not moved."""
    if isinstance(axis, FrameProgram):
        return AxisWords(axis.slow.gain_word, axis.slow.offset_word, 1 << FACTOR_FRACTION_BITS)
    return AxisWords(axis.output.gain_word, axis.output.offset_word)


def preview_words(playing: DualProgram, plan: DualProgram) -> PreviewWords | None:
    """Fit the words for the tables that play to a plan; None where its lines or windows are others.

    Parameters
    ----------
    playing
        Program whose tables play.
    plan
        Program that is to follow it.
    """
    old, new = playing.schedule, plan.schedule
    timing = [
        (each.ticks, each.lines, each.pixels, each.turn_tick, each.forward, each.backward, each.up, each.down,
         each.pixel_table)
        for each in (old, new)
    ]  # fmt: skip
    if timing[0] != timing[1] or (playing.y.hold, playing.y.phase.ticks) != (plan.y.hold, plan.y.phase.ticks):
        return None
    x, x_error_percent = _closest(playing.x, plan.x)
    y, y_error_percent = _closest(playing.y, plan.y)
    return PreviewWords(x, y, x_error_percent, y_error_percent)


def program_digest(program: ScanProgram, program_of_z: ScanProgram | None = None) -> str:
    """Return a digest of a program that is no plan's, with that of its z."""
    programs = [program] if program_of_z is None else [program, program_of_z]
    return hashlib.sha256(b"".join(make_image(each, _NO_HASH).data for each in programs)).hexdigest()


def is_accepted(program: ScanProgram, limits: Limits, playing: ScanProgram, order: int) -> bool:
    """Return True if a device that plays ``playing`` accepts a program: its checks, made before anything is sent.

    ``limits`` are those of the device, ``order`` is its highest order of shaping.
    """
    image = make_image(program, _NO_HASH)
    contents = take_apart(image.data, image.info.x, image.info.y)
    return first_objection(contents, *limits, Playing(playing.x, playing.y, running=True), order) is None


def _closest(playing: Program, plan: Program) -> tuple[AxisWords, float]:
    """Fit gain and offset by least squares over a period; return the error in percent of the range of the codes."""
    advances = playing.phase.ticks
    ticks = np.unique(np.linspace(0, advances - 1, min(advances, _PLACES)).astype(np.int64)) * playing.hold
    samples = playing.samples(ticks)
    codes = plan.output.unrounded(plan.samples(ticks))
    unit = float(1 << playing.output.gain_q)
    spread = samples - np.mean(samples)
    power = float(np.sum(spread * spread))
    gain = playing.output.gain_word / unit if power == 0.0 else float(np.sum(spread * codes)) / power
    gain_word = round(gain * unit)
    offset_word = round(float(np.mean(codes)) * unit - gain_word * float(np.mean(samples)))
    error: Floats = (gain_word * samples + offset_word) / unit - codes
    size = float(np.ptp(codes))
    return AxisWords(gain_word, offset_word), 100.0 * float(np.max(np.abs(error))) / size if size else 0.0


def _moved(axis: Program, words: AxisWords) -> Program:
    return replace(axis, output=replace(axis.output, gain_word=words.gain_word, offset_word=words.offset_word))
