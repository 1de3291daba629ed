/* DAC8562, DAC8563: 16 bits, two outputs. A frame writes an input register (command 0); LDAC changes both outputs.
 * Where LDAC is not wired, hold it high, and let the frame of B change both: prefix 0x110000 (command 2), A first. The
 * set-up switches the inner reference of 2.5 V on, which sets both gains to 2 (command 7, data 1). DAC8562 powers up at
 * the lowest voltage, DAC8563 in the middle.
 * Data sheet SLAS719D: frame in table 8, commands in table 11. Reference and gain: its table of all commands (17 in
 * SLAS719E), as public drivers quote it.
 *
 *     [dac]
 *     bits = 16
 *     coding = "offset-binary"
 *     v_min = 0.0
 *     v_max = 5.0
 */
#ifndef DAC8562_H
#define DAC8562_H

#include "spi_words.h"

static const dac_spi_converter dac8562 = {
    24, 16, 0, 1, /* bits of a frame and of a word, lowest bit, SPI mode */
    {UINT32_C(0x000000), UINT32_C(0x010000)},
    1, {UINT32_C(0x380001), 0}
};
enum { dac8562_frame_bits = 24, dac8562_bits = 16, dac8562_word_bits = 16, dac8562_twos_complement = 0 };

#endif
