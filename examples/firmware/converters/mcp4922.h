/* MCP4922: 12 bits, two outputs. The upper four bits of a frame are the output, no input buffer, gain 1, output on;
 * LDAC changes both. It needs no set-up. Data sheet DS22250.
 *
 *     [dac]
 *     bits = 12
 *     coding = "offset-binary"
 */
#ifndef MCP4922_H
#define MCP4922_H

#include "spi_words.h"

static const dac_spi_converter mcp4922 = {
    16, 12, 0, 0, /* bits of a frame and of a word, lowest bit, SPI mode */
    {UINT32_C(0x3000), UINT32_C(0xB000)},
    0, {0, 0}
};

#endif
