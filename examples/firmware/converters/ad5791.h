/* AD5791: 20 bits, one output. A frame writes register 1 (the DAC); LDAC, or LDAC held low, changes the output.
 * The set-up writes register 2: output on, offset binary, no inner amplifier (RBUF). Clear RBUF (0x200010) if yours is
 * wired for a gain of two. Data sheet Rev. D, pp. 19 to 22.
 *
 *     [dac]
 *     bits = 20
 *     coding = "offset-binary"
 */
#ifndef AD5791_H
#define AD5791_H

#include "spi_words.h"

static const dac_spi_converter ad5791 = {
    24, 20, 0, 1, /* bits of a frame and of a word, lowest bit, SPI mode */
    {UINT32_C(0x100000), UINT32_C(0x100000)},
    1, {UINT32_C(0x200012), 0}
};

#endif
