/* AD5541A: 16 bits, one output, a bare word. It needs no set-up.
 * Data sheet Rev. A, p. 14.
 *
 *     [dac]
 *     bits = 16
 *     coding = "offset-binary"
 */
#ifndef AD5541A_H
#define AD5541A_H

#include "spi_words.h"

static const dac_spi_converter ad5541a = {
    16, 16, 0, 0, /* bits of a frame and of a word, lowest bit, SPI mode */
    {0, 0},
    0, {0, 0}
};
enum { ad5541a_frame_bits = 16, ad5541a_bits = 16, ad5541a_word_bits = 16, ad5541a_twos_complement = 0 };

#endif
