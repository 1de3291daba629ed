/* AD5764: 16 bits, four outputs, of which A and B are used. A frame writes a data register (2); LDAC changes the
 * outputs. Its pin BIN/2sCOMP sets the coding: low is two's complement. The references set the range. It needs no
 * set-up. Data sheet Rev. F, p. 20: coding in tables 7 and 8, frame in table 9. Number of the data register, and that
 * address 0 is output A: public drivers.
 *
 *     [dac]
 *     bits = 16
 *     coding = "twos-complement"
 *     v_min = -10.0
 *     v_max = 10.0
 */
#ifndef AD5764_H
#define AD5764_H

#include "spi_words.h"

static const dac_spi_converter ad5764 = {
    24, 16, 0, 1, /* bits of a frame and of a word, lowest bit, SPI mode */
    {UINT32_C(0x100000), UINT32_C(0x110000)},
    0, {0, 0}
};
enum { ad5764_frame_bits = 24, ad5764_bits = 16, ad5764_word_bits = 16, ad5764_twos_complement = 1 };

#endif
