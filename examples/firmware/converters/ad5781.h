/* AD5781: 18 bits, one output. The code stands in the upper bits of a word of 20, and the lowest two are ignored (data
 * sheet Rev. D, p. 21, table 10). Its control register (p. 22, tables 11 and 12) and the rest are as in ad5791.h.
 *
 *     [dac]
 *     bits = 18
 *     coding = "offset-binary"
 *     word_bits = 20
 *     align = "left"
 *     v_min = -10.0
 *     v_max = 10.0
 */
#ifndef AD5781_H
#define AD5781_H

#include "spi_words.h"

static const dac_spi_converter ad5781 = {
    24, 20, 0, 1, /* bits of a frame and of a word, lowest bit, SPI mode */
    {UINT32_C(0x100000), UINT32_C(0x100000)},
    1, {UINT32_C(0x200312), 0}
};
enum { ad5781_frame_bits = 24, ad5781_bits = 18, ad5781_word_bits = 20, ad5781_twos_complement = 0 };

#endif
