"""WAV of one frame: x left, y right, or output A left, a sample a tick; for sound cards, and whatever plays it."""

import struct

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.emit.content import AxisContent, Content
from tablegen.emit.format import Format
from tablegen.emit.waveforms import require_period
from tablegen.numerics.arrays import Ints

_PCM = 1
_CHANNELS = 2


class Wav(Format):
    """The format wav: ``NAME.wav``, PCM of 16 bits for converters of up to 16 bits, of 32 bits above."""

    name = "wav"
    purpose = "WAV of one frame, x left and y right, at the update rate; 16-bit samples, 32-bit above 16 dac.bits"
    file_names = "NAME.wav"

    def files(self, content: Content) -> dict[str, bytes]:
        """Render one file."""
        require_period(content)
        bits = 16 if max(axis.program.output.dac_bits for axis in content.axes) <= 16 else 32
        rate = _rate(content, bits // 8 * _CHANNELS)
        axes = sorted(content.axes, key=lambda axis: axis.program.output.channel)  # x is the left one unless it is on B
        return {
            f"{content.name}.wav": _file(np.column_stack([_samples(content, axis, bits) for axis in axes]), rate, bits)
        }


FORMAT = Wav()


def _rate(content: Content, frame_bytes: int) -> int:
    """Return the update rate in Hz, which a WAV file has as a whole number of 32 bits, like the bytes of a second."""
    rate = content.schedule.update_rate_hz
    if rate.denominator != 1:
        raise Unphysical(
            f"the update rate is {float(rate)!r} Hz, and the sample rate of a WAV file a whole number of Hz; "
            f"a dac.update_rate_hz of {round(rate)} would fit"
        )
    most = ((1 << 32) - 1) // frame_bytes
    if rate > most:
        raise Unphysical(
            f"the update rate is {rate.numerator} Hz, and the sample rate of a WAV file of {frame_bytes} bytes a tick "
            f"at most {most} Hz; choose another format, such as npz"
        )
    return rate.numerator


def _samples(content: Content, axis: AxisContent, bits: int) -> Ints:
    """Scale a frame to samples: the converter's full scale is that of the sample, and code 2^(dac_bits - 1) is 0."""
    period = axis.program.ticks
    codes = axis.program.codes(np.arange(period, dtype=np.int64))
    whole = np.tile(codes, content.schedule.frame_ticks // period)
    output = axis.program.output
    return (whole - (1 << (output.dac_bits - 1))) << (bits - output.dac_bits)


def _file(samples: Ints, rate: int, bits: int) -> bytes:
    """Write samples of shape (ticks, 2) with the header of RIFF."""
    data = samples.astype(f"<i{bits // 8}").tobytes()
    frame_bytes = bits // 8 * _CHANNELS
    layout = struct.pack("<HHIIHH", _PCM, _CHANNELS, rate, rate * frame_bytes, frame_bytes, bits)
    chunks = b"fmt " + struct.pack("<I", len(layout)) + layout + b"data" + struct.pack("<I", len(data)) + data
    return b"RIFF" + struct.pack("<I", 4 + len(chunks)) + b"WAVE" + chunks
