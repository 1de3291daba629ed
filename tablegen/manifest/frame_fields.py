"""The fields of an output with a slow part in ``manifest.json``: an axis of a scan at an angle, z, or aux."""

from collections.abc import Iterable, Mapping
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct

from tablegen.config.schema import SEQUENCER_FORMATS, TILT_NAMES, TiltName
from tablegen.device.beside import program_beside
from tablegen.device.dual_program import ScanProgram
from tablegen.fixedpoint.frame_program import MOST_KNOTS, FrameProgram, Knots, SlowTable
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Program
from tablegen.manifest.fields import ManifestOutput, ManifestSequence, Volts

Words = Annotated[list[Annotated[int, Meta(ge=-(1 << 23), lt=1 << 23)]], Meta(min_length=8, max_length=1 << 14)]
KnotWords = Annotated[list[Annotated[int, Meta(ge=-(1 << 17), lt=1 << 17)]], Meta(min_length=2, max_length=MOST_KNOTS)]


class TurnedKnots(Struct, forbid_unknown_fields=True):
    """Words at knots, so many lines apart."""

    spacing: Annotated[int, Meta(ge=1, le=1 << 16)]
    words: KnotWords


class TurnedSlow(Struct, forbid_unknown_fields=True):
    """The cubic table of the slow part over a frame."""

    gain_word: Annotated[int, Meta(ge=-(1 << 17), lt=1 << 17)]
    offset_word: Annotated[int, Meta(gt=-(1 << 43), lt=1 << 43)]
    words: Words


class TurnedAxisFields(Struct, forbid_unknown_fields=True):
    """One axis: its shares of both motions in nm, and its integers."""

    fast_nm: float
    slow_nm: float
    bits: Annotated[int, Meta(ge=8, le=16)]
    words: Words
    second: Words
    gains: TurnedKnots
    ratios: TurnedKnots
    slow: TurnedSlow
    output: ManifestOutput

    def program(self, sequence: ManifestSequence) -> FrameProgram:
        """Return the program of the axis in a device.

        Raises
        ------
        ValueError, OverflowError
            If no device plays it.
        """
        words, second, gains, ratios, slow = (
            np.array(each, dtype=np.int64)
            for each in (self.words, self.second, self.gains.words, self.ratios.words, self.slow.words)
        )
        fast = Program(RationalPhase(sequence.line_ticks), 1, "cubic", self.bits, words, self.output.output)
        return FrameProgram(
            fast,
            sequence.frame_lines,
            Knots(gains, self.gains.spacing),
            Knots(ratios, self.ratios.spacing),
            second,
            SlowTable(slow, self.slow.gain_word, self.slow.offset_word),
        )


class TiltFields(TurnedAxisFields, forbid_unknown_fields=True):
    """An output beside x and y: its slopes, nm for each nm along x and y, and its nm for a volt at its piezo."""

    slope_x: float
    slope_y: float
    nm_per_v: float


class TurnedCodes(Struct):
    """The codes of an axis by the certificate: the least, the greatest, and the largest step of a tick."""

    least: int
    most: int
    steepest: int


class TiltFigures(Struct):
    """The largest distance of a code from the wanted height at an imaged tick, in LSB and in nm."""

    error_lsb: Annotated[float, Meta(ge=0.0)]
    error_nm: Annotated[float, Meta(ge=0.0)]


class TiltCertificate(TiltFigures):
    """The certificate of an output beside x and y, with its codes."""

    codes: TurnedCodes


class StraightTilt(TiltFields, kw_only=True, forbid_unknown_fields=True):
    """An output beside x and y of a scan at 0 degrees; ``offset_v`` are its volts in the centre of the scan."""

    offset_v: Volts
    certificate: TiltCertificate


def beside_of(
    tilts: Mapping[TiltName, TiltFields], formats: Iterable[str], sequence: ManifestSequence
) -> ScanProgram | None:
    """Return what the second sequencer of a manifest plays; None of a scan without outputs beside x and y.

    Raises
    ------
    ValueError, OverflowError
        If no device plays them.
    """
    if not tilts:
        return None
    if "z" not in tilts:
        raise ValueError("aux is the y of a sequencer whose x is z, and the scan has no z")
    if others := set(formats) - set(SEQUENCER_FORMATS):
        raise ValueError(f"formats: {', '.join(sorted(others))} cannot hold the output z, which the scan has")
    if len({each.output.dac_bits for each in tilts.values()}) > 1:
        raise ValueError("z and aux differ in output.dac_bits")
    return program_beside(sequence.schedule, *(tilts[name].program(sequence) for name in TILT_NAMES if name in tilts))
