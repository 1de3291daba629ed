/* BLAKE2s: RFC 7693, sections 2 and 3. */
#include "dac_link_mac.h"

#include "dac_link_frame.h"

static const uint32_t initial[8] = {
    UINT32_C(0x6A09E667), UINT32_C(0xBB67AE85), UINT32_C(0x3C6EF372), UINT32_C(0xA54FF53A),
    UINT32_C(0x510E527F), UINT32_C(0x9B05688C), UINT32_C(0x1F83D9AB), UINT32_C(0x5BE0CD19),
};

/* Which words of a message each round mixes in, four bits each. */
static const uint8_t order[10][8] = {
    {0x01, 0x23, 0x45, 0x67, 0x89, 0xAB, 0xCD, 0xEF}, {0xEA, 0x48, 0x9F, 0xD6, 0x1C, 0x02, 0xB7, 0x53},
    {0xB8, 0xC0, 0x52, 0xFD, 0xAE, 0x36, 0x71, 0x94}, {0x79, 0x31, 0xDC, 0xBE, 0x26, 0x5A, 0x40, 0xF8},
    {0x90, 0x57, 0x24, 0xAF, 0xE1, 0xBC, 0x68, 0x3D}, {0x2C, 0x6A, 0x0B, 0x83, 0x4D, 0x75, 0xFE, 0x19},
    {0xC5, 0x1F, 0xED, 0x4A, 0x07, 0x63, 0x92, 0x8B}, {0xDB, 0x7E, 0xC1, 0x39, 0x50, 0xF4, 0x86, 0x2A},
    {0x6F, 0xE9, 0xB3, 0x08, 0xC2, 0xD7, 0x14, 0xA5}, {0xA2, 0x84, 0x76, 0x15, 0xFB, 0x9E, 0x3C, 0xD0},
};

static uint32_t turned(uint32_t value, unsigned right)
{
    return value >> right | value << (32 - right);
}

static void mix(uint32_t *v, unsigned column, unsigned diagonal, uint32_t first, uint32_t second)
{
    uint32_t *const a = v + column, *const b = v + 4 + ((column + diagonal) & 3);
    uint32_t *const c = v + 8 + ((column + 2 * diagonal) & 3), *const d = v + 12 + ((column + 3 * diagonal) & 3);

    *a += *b + first;
    *d = turned(*d ^ *a, 16);
    *c += *d;
    *b = turned(*b ^ *c, 12);
    *a += *b + second;
    *d = turned(*d ^ *a, 8);
    *c += *d;
    *b = turned(*b ^ *c, 7);
}

static void compress(dac_link_mac *m, uint32_t last)
{
    uint32_t v[16];

    for (unsigned i = 0; i < 8; i++) {
        v[i] = m->chain[i];
        v[8 + i] = initial[i];
    }
    v[12] ^= m->count; /* messages here are far below 2^32 bytes */
    v[14] ^= last;
    for (unsigned round = 0; round < 10; round++)
        for (unsigned i = 0; i < 8; i++) {
            const uint8_t pair = order[round][i];
            mix(v, i & 3, i >> 2, dac_link_get(m->block + 4 * (pair >> 4)), dac_link_get(m->block + 4 * (pair & 15)));
        }
    for (unsigned i = 0; i < 8; i++)
        m->chain[i] ^= v[i] ^ v[8 + i];
}

void dac_link_mac_begin(dac_link_mac *m, uint8_t size, const uint8_t *key, uint8_t key_bytes)
{
    for (unsigned i = 0; i < 8; i++)
        m->chain[i] = initial[i];
    m->chain[0] ^= UINT32_C(0x01010000) ^ (uint32_t)key_bytes << 8 ^ size;
    m->count = 0;
    m->used = 0;
    m->size = size;
    if (key_bytes == 0)
        return;
    for (uint8_t i = 0; i < sizeof m->block; i++)
        m->block[i] = i < key_bytes ? key[i] : 0;
    m->used = sizeof m->block;
}

void dac_link_mac_byte(dac_link_mac *m, uint8_t byte)
{
    if (m->used == sizeof m->block) { /* only now: the last block is compressed otherwise */
        m->count += m->used;
        compress(m, 0);
        m->used = 0;
    }
    m->block[m->used++] = byte;
}

void dac_link_mac_add(dac_link_mac *m, const uint8_t *bytes, uint8_t count)
{
    for (uint8_t i = 0; i < count; i++)
        dac_link_mac_byte(m, bytes[i]);
}

void dac_link_mac_end(dac_link_mac *m, uint8_t *result)
{
    m->count += m->used;
    while (m->used < sizeof m->block)
        m->block[m->used++] = 0;
    compress(m, UINT32_MAX);
    for (uint8_t i = 0; i < m->size; i++)
        result[i] = (uint8_t)(m->chain[i / 4] >> 8 * (i % 4));
}
