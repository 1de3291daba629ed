/* AD5761: 16 bits, one output. A frame writes the input register (command 1); LDAC changes the output.
 * The set-up writes the control register (command 4): -10..+10 V, straight binary, middle of the range after power-up
 * and after a clear. Other ranges stand in its lowest three bits. Commands and bits are those of the drivers that the
 * maker publishes.
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
    1, {UINT32_C(0x040208), 0}
};

#endif
