/* MCP4922: 12 bits, two outputs. The upper four bits of a frame are the output, no input buffer (BUF), gain 1 (GA set),
 * output on (SHDN set); LDAC changes both. It needs no set-up. Data sheet DS21897A, p. 18, section 5.2: 16 bits, four
 * of configuration, rising edge, LDAC. Order of the four: register 5-1, as in DS22250.
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
enum { mcp4922_frame_bits = 16, mcp4922_bits = 12, mcp4922_word_bits = 12, mcp4922_twos_complement = 0 };

#endif
