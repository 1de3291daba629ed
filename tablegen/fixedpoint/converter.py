"""Volts to codes, and the words of the output stage that scale a table to a drive."""

from dataclasses import dataclass
from math import ceil, floor

from tablegen.config.hardware import AxisAmplifier, AxisDac
from tablegen.driver import Driver
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.output import UNIT_GAIN_BITS, Output
from tablegen.fixedpoint.rounding import round_number


@dataclass(frozen=True)
class Converter:
    """Volts at the piezo to codes of the converter, as real numbers: code = (V - v_zero) / v_per_code."""

    v_zero: float
    v_per_code: float
    bits: int

    @classmethod
    def of(cls, dac: AxisDac, amplifier: AxisAmplifier) -> "Converter":
        """The chain of converter and amplifier.

        v_per_code has the sign of the amplifier's gain, and the other one where the converter's codes are inverted.
        """
        lsb = (dac.v_max - dac.v_min) / float(1 << dac.bits)
        first, step = (dac.highest_v, -lsb) if dac.inverted else (dac.v_min, lsb)
        return cls(amplifier.gain * first + amplifier.bias_v, amplifier.gain * step, dac.bits)

    def code(self, volts: float) -> float:
        """The code, as a real number, of a voltage at the piezo."""
        return (volts - self.v_zero) / self.v_per_code


def fit_gain(amplitude: float, peak: float, bits: int, dac_bits: int) -> tuple[int, float]:
    """The gain word, and the scale of the table that makes their product exact.

    ``amplitude`` is in codes for 2 w - 1 = 1 and may be negative; ``peak`` is the largest |2 w - 1|, at least 1.
    The scale is the least that keeps the peak inside the table's words, raised until the gain is a whole
    number of its LSB: the rounding of the gain costs a little of the table's range instead of accuracy.
    """
    top = float((1 << (bits - 1)) - 1) / float(1 << (bits - 1))
    unit = abs(amplitude) * 2.0 ** (UNIT_GAIN_BITS + 1 - dac_bits)
    gain_word = ceil(unit * peak / top)
    return (gain_word if amplitude > 0.0 else -gain_word), gain_word / unit


def make_output(
    dac: AxisDac,
    converter: Converter,
    driver: Driver,
    v_offset: float,
    v_park: float,
    bits: int,
    gain_word: int,
    max_step: int,
) -> Output:
    """The output stage of one axis; the clamp keeps the piezo in the driver's range, the code in the converter's."""
    gain_q = UNIT_GAIN_BITS + bits + guard_bits(bits) - dac.bits
    ends = sorted((converter.code(driver.v_min), converter.code(driver.v_max)))
    # A millionth of a code forgives the last bits of the voltages, not the voltages.
    code_min, code_max = max(0, ceil(ends[0] - 1e-6)), min((1 << dac.bits) - 1, floor(ends[1] + 1e-6))
    return Output(
        gain_word=gain_word,
        gain_q=gain_q,
        offset_word=round_number(converter.code(v_offset) * float(1 << gain_q)),
        code_min=code_min,
        code_max=code_max,
        max_step=max_step,
        park_code=min(max(round_number(converter.code(v_park)), code_min), code_max),
        dac_bits=dac.bits,
        coding=dac.coding,
        align=dac.align,
        word_bits=dac.word_bits if dac.word_bits is not None else dac.bits,
        channel=dac.output or "",
    )
