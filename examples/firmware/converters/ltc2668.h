/* LTC2668: 16 bits, 16 outputs, of which 0 and 1 are used. A frame writes an input register (command 0); LDAC changes
 * all outputs. Where LDAC is not wired, hold it high, and let the frame of B change all: prefix 0x210000 (command 2), A
 * first. The set-up sets all outputs to -10..+10 V (command 14, range 3). A frame of 32 bits has eight zeros in front:
 * set the first number to 32. Commands and ranges are those of the maker's library (Linduino LTC2668.h) and of Linux'
 * ltc2664.c; the data sheet was not at hand.
 *
 *     [dac]
 *     bits = 16
 *     coding = "offset-binary"
 *     v_min = -10.0
 *     v_max = 10.0
 */
#ifndef LTC2668_H
#define LTC2668_H

#include "spi_words.h"

static const dac_spi_converter ltc2668 = {
    24, 16, 0, 0, /* bits of a frame and of a word, lowest bit, SPI mode */
    {UINT32_C(0x000000), UINT32_C(0x010000)},
    1, {UINT32_C(0xE00003), 0}
};
enum { ltc2668_frame_bits = 24, ltc2668_bits = 16, ltc2668_word_bits = 16, ltc2668_twos_complement = 0 };

#endif
