/* Private to the link: BLAKE2s of RFC 7693, with a key or without. */
#ifndef DAC_LINK_MAC_H
#define DAC_LINK_MAC_H

#include <stdint.h>

typedef struct {
    uint32_t chain[8];
    uint32_t count; /* bytes that were compressed */
    uint8_t used;   /* bytes in the block */
    uint8_t size;   /* bytes of the result */
    uint8_t block[64];
} dac_link_mac;

/* A result of 1..32 bytes; a key of 0..32. */
void dac_link_mac_begin(dac_link_mac *m, uint8_t size, const uint8_t *key, uint8_t key_bytes);
void dac_link_mac_add(dac_link_mac *m, const uint8_t *bytes, uint8_t count);
void dac_link_mac_byte(dac_link_mac *m, uint8_t byte);
void dac_link_mac_end(dac_link_mac *m, uint8_t *result);

#endif
