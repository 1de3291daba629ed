/* AD5791: 20 bits, one output. A frame writes register 1 (the DAC); LDAC changes the output.
 * The set-up writes register 2, the control register: output on (OPGND and DACTRI cleared), straight binary (BIN/2sC
 * set), no inner amplifier (RBUF set), linearity for references 20 V apart (LIN COMP 1100). For references up to 10 V
 * apart write 0x200012. Clear RBUF (0x200310) if yours is wired for a gain of two.
 * Data sheet Rev. D: input shift register p. 19, table 7; DAC register p. 21, table 10; power-up, output states and LIN
 * COMP p. 24. Places of the control bits: AD5781 Rev. D, p. 22, table 11, and Linux' ad5791.c, which serves both.
 *
 *     [dac]
 *     bits = 20
 *     coding = "offset-binary"
 *     v_min = -10.0
 *     v_max = 10.0
 */
#ifndef AD5791_H
#define AD5791_H

#include "spi_words.h"

static const dac_spi_converter ad5791 = {
    24, 20, 0, 1, /* bits of a frame and of a word, lowest bit, SPI mode */
    {UINT32_C(0x100000), UINT32_C(0x100000)},
    1, {UINT32_C(0x200312), 0}
};
enum { ad5791_frame_bits = 24, ad5791_bits = 20, ad5791_word_bits = 20, ad5791_twos_complement = 0 };

#endif
