"""Shaped scripts for converters of other than 16 bits, of which the C sequencer's fast path plays almost every tick."""

import numpy as np
from c_scripts import wave_program
from replacing import replace
from stream_scripts import play

from tablegen.fixedpoint.shaping import MAXIMUM_ZERO, Shaping
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script

WAVES = {
    "bits_12": SequencerShape(12, 1, 8, 16, 1, 8, 16),
    "bits_18": SequencerShape(18, 1, 8, 16, 1, 8, 16),
    "bits_20": SequencerShape(20, 1, 8, 16, 1, 8, 16),
    "bits_24": SequencerShape(24, 1, 8, 16, 1, 8, 16),
    "wide_words": SequencerShape(20, 1, 8, 24, 1, 8, 24),
}

JUMPS = SequencerShape(16, 1, 8, 16, 1, 8, 16)


def shaped_waves(shape: SequencerShape) -> Script:
    """Waves so slow that runs play almost all of them, whatever the converter: each axis by the second and third order.

    Both axes have the same bits of index and word.
    """
    rng, script = np.random.default_rng(shape.dac_bits), Script()
    half = 1 << (shape.dac_bits - 1)
    script.tick_every(1)
    for orders in ((2, 3), (3, 2)):
        program = wave_program(shape, 0, int(rng.integers(2500, 3500)))
        axes = {}
        for name, order in zip("xy", orders, strict=True):
            axis = getattr(program, name)
            zero = int(rng.integers(1, MAXIMUM_ZERO)) if order == 3 else 0
            output = replace(
                axis.output,
                gain_word=int(rng.integers(1 << 14, 1 << 15)),
                offset_word=(half << axis.output.gain_q) + int(rng.integers(1 << axis.output.gain_q)),
                code_min=0,
                code_max=2 * half - 1,
                park_code=half,
                max_step=half // 4,
                shaping=Shaping(order, zero),
            )
            axes[name] = replace(axis, output=output)
        play(script, replace(program, **axes))
        script.wait_ticks(4000)
        script.request("park")
        script.wait_ticks(50)
    return script


def shaped_jumps(shape: SequencerShape) -> Script:
    """Programs that all but rest, one after the other at twice the slew guard or a little less, by the third order.

    So the second tick of each is at the slew guard or a little less from the code before, before it is shaped.
    """
    rng, script = np.random.default_rng(1), Script()
    half, guard = 1 << (shape.dac_bits - 1), 30
    jumps = (way * (2 * guard - few) for few in range(1, 5) for _ in range(16) for way in (1, -1))
    script.tick_every(1)
    for place in np.cumsum([half, *jumps]):
        program = wave_program(shape, 0, 100)
        output = replace(
            program.x.output,
            gain_word=10,
            offset_word=(int(place) << program.x.output.gain_q) + int(rng.integers(1 << 20)),
            code_min=0,
            code_max=2 * half - 1,
            park_code=half,
            max_step=guard,
            shaping=Shaping(3, MAXIMUM_ZERO),
        )
        play(script, replace(program, x=replace(program.x, output=output), y=replace(program.y, output=output)))
        script.wait_ticks(110)
    return script
