/* AD5761, AD5761R: 16 bits, one output. A frame writes the input register (command 1); LDAC changes the output.
 * The set-up resets the converter (command 15), which has to come before a range, and writes the control register
 * (command 4): -10..+10 V (RA 000), straight binary (B2C cleared), middle of the range after the reset and after a
 * clear (PV 01, CV 01). Other ranges stand in its lowest three bits: 001 is 0..10 V, 010 -5..+5 V, 011 0..5 V. 0x040228
 * takes the inner reference of an AD5761R (IRO).
 * Data sheet AD5761R Rev. C, p. 30, tables 13 to 16: frame, coding, bits of the control register. Numbers of commands:
 * the maker's no-OS driver ad5761r.h; reset before a range: Linux' ad5761.c, and table 12 as other drivers quote it.
 *
 *     [dac]
 *     bits = 16
 *     coding = "offset-binary"
 *     v_min = -10.0
 *     v_max = 10.0
 */
#ifndef AD5761_H
#define AD5761_H

#include "spi_words.h"

static const dac_spi_converter ad5761 = {
    24, 16, 0, 1, /* bits of a frame and of a word, lowest bit, SPI mode */
    {UINT32_C(0x010000), UINT32_C(0x010000)},
    2, {UINT32_C(0x0F0000), UINT32_C(0x040208)}
};
enum { ad5761_frame_bits = 24, ad5761_bits = 16, ad5761_word_bits = 16, ad5761_twos_complement = 0 };

#endif
