/* COBS and CRC-32. */
#include "dac_link_frame.h"

#define WHOLE UINT32_C(0xDEBB20E3) /* the result of a CRC over data and its own CRC */

uint32_t dac_link_crc(uint32_t crc, uint8_t byte)
{
    /* Four bits at a time: a table of 256 words would take much of the memory of a small processor. */
    static const uint32_t by_four[16] = {
        UINT32_C(0x00000000), UINT32_C(0x1DB71064), UINT32_C(0x3B6E20C8), UINT32_C(0x26D930AC),
        UINT32_C(0x76DC4190), UINT32_C(0x6B6B51F4), UINT32_C(0x4DB26158), UINT32_C(0x5005713C),
        UINT32_C(0xEDB88320), UINT32_C(0xF00F9344), UINT32_C(0xD6D6A3E8), UINT32_C(0xCB61B38C),
        UINT32_C(0x9B64C2B0), UINT32_C(0x86D3D2D4), UINT32_C(0xA00AE278), UINT32_C(0xBDBDF21C),
    };
    crc ^= byte;
    crc = crc >> 4 ^ by_four[crc & 15];
    return crc >> 4 ^ by_four[crc & 15];
}

uint32_t dac_link_get(const uint8_t *at)
{
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

void dac_link_put(uint8_t *at, uint32_t value)
{
    for (unsigned i = 0; i < 4; i++)
        at[i] = (uint8_t)(value >> 8 * i);
}

static void add(dac_link_reader *r, uint8_t byte)
{
    if (r->length == DAC_LINK_FRAME) {
        r->wrong = true;
        return;
    }
    r->bytes[r->length++] = byte;
    r->crc = dac_link_crc(r->crc, byte);
}

static dac_link_read end(dac_link_reader *r)
{
    const bool good = !r->wrong && r->left == 0 && r->length >= DAC_LINK_SHORTEST && r->crc == WHOLE;
    const bool empty = !r->begun;

    r->begun = false;
    if (empty)
        return DAC_LINK_MORE;
    if (!good)
        return DAC_LINK_BAD;
    r->length = (uint8_t)(r->length - 4);
    return DAC_LINK_GOOD;
}

dac_link_read dac_link_read_byte(dac_link_reader *r, uint8_t byte)
{
    if (byte == 0)
        return end(r);
    if (!r->begun) {
        r->begun = true;
        r->wrong = false;
        r->length = 0;
        r->crc = DAC_LINK_CRC;
        r->left = (uint8_t)(byte - 1);
    } else if (r->left == 0) {
        add(r, 0);
        r->left = (uint8_t)(byte - 1);
    } else {
        r->left--;
        add(r, byte);
    }
    return DAC_LINK_MORE;
}

uint16_t dac_link_seal(uint8_t *wire, uint16_t length)
{
    uint32_t crc = DAC_LINK_CRC;
    uint16_t zero = 0;

    for (uint16_t i = 1; i <= length; i++)
        crc = dac_link_crc(crc, wire[i]);
    dac_link_put(wire + length + 1, ~crc);
    length = (uint16_t)(length + 5);
    for (uint16_t i = 1; i < length; i++)
        if (wire[i] == 0) {
            wire[zero] = (uint8_t)(i - zero);
            zero = i;
        }
    wire[zero] = (uint8_t)(length - zero);
    wire[length] = 0;
    return (uint16_t)(length + 1);
}
