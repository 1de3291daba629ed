"""Conversion of volts to codes, and the words of the output stage that scale a table to a drive."""

from math import ceil, floor

from msgspec import Struct
from msgspec.structs import replace

from tablegen.config.hardware import AxisAmplifier, AxisDac
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.output import UNIT_GAIN_BITS, Output
from tablegen.fixedpoint.rounding import round_number
from tablegen.fixedpoint.shaping import OFF, Shaping
from tablegen.numerics.driver import Driver


class Converter(Struct, frozen=True):
    """Conversion of volts at the piezo to codes, as real numbers: code = (V - v_zero) / v_per_code."""

    v_zero: float
    v_per_code: float
    bits: int

    @classmethod
    def of(cls, dac: AxisDac, amplifier: AxisAmplifier) -> "Converter":
        """Return the chain of converter and amplifier.

        v_per_code has the sign of the amplifier's gain, and the opposite one where the converter's codes are inverted.
        """
        lsb = (dac.v_max - dac.v_min) / float(1 << dac.bits)
        first, step = (dac.highest_v, -lsb) if dac.inverted else (dac.v_min, lsb)
        return cls(amplifier.gain * first + amplifier.bias_v, amplifier.gain * step, dac.bits)

    def code(self, volts: float) -> float:
        """Return the code, as a real number, of a voltage at the piezo."""
        return (volts - self.v_zero) / self.v_per_code


def fit_gain(amplitude: float, peak: float, bits: int, dac_bits: int) -> tuple[int, float]:
    """Return the gain word, and the scale of the table that makes their product exact.

    ``amplitude`` is in codes for 2 w - 1 = 1 and may be negative; ``peak`` is the largest |2 w - 1|, at least 1.
    The scale is the least that keeps the peak inside the table's words, raised until the gain is a whole
    number of its LSB: the rounding of the gain costs a little of the table's range instead of accuracy.
    """
    top = float((1 << (bits - 1)) - 1) / float(1 << (bits - 1))
    unit = abs(amplitude) * 2.0 ** (UNIT_GAIN_BITS + 1 - dac_bits)
    gain_word = ceil(unit * peak / top)
    return (gain_word if amplitude > 0.0 else -gain_word), gain_word / unit


def code_limits(converter: Converter, driver: Driver) -> tuple[int, int]:
    """Return the lowest and the highest code that both the driver and the converter reach."""
    ends = sorted((converter.code(driver.v_min), converter.code(driver.v_max)))
    # A millionth of a code allows for the rounding of the voltages in their last bits.
    return max(0, ceil(ends[0] - 1e-6)), min((1 << converter.bits) - 1, floor(ends[1] + 1e-6))


def make_output(dac: AxisDac, converter: Converter, driver: Driver, v_park: float, shaping: Shaping = OFF) -> Output:
    """Return the output stage of one axis, with gain and largest step still to be set.

    The clamp keeps the piezo in the driver's range, the code in the converter's.
    """
    code_min, code_max = code_limits(converter, driver)
    return Output(
        gain_word=0,
        gain_q=0,
        offset_word=0,
        code_min=code_min,
        code_max=code_max,
        max_step=1,
        park_code=min(max(round_number(converter.code(v_park)), code_min), code_max),
        dac_bits=dac.bits,
        coding=dac.coding,
        align=dac.align,
        word_bits=dac.word_bits if dac.word_bits is not None else dac.bits,
        channel=dac.output or "",
        shaping=shaping,
    )


def scaled_output(output: Output, offset: float, bits: int, gain_word: int) -> Output:
    """Return an output stage with the gain of a table of words of ``bits`` bits, and an offset in codes."""
    gain_q = UNIT_GAIN_BITS + bits + guard_bits(bits) - output.dac_bits
    offset_word = round_number(offset * float(1 << gain_q))
    return replace(output, gain_word=gain_word, gain_q=gain_q, offset_word=offset_word)
