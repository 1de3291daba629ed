/* The key: challenges, and the tags of requests that answer them. */
#include "dac_link_parts.h"

enum { NONCE = 16 };

/* Without a source of random numbers: nobody without the key knows the next, and none comes twice if no `boot` does. */
dac_link_finding dac_link_challenge(dac_link *l, dac_link_answer *a)
{
    if (l->config->random != NULL) {
        l->config->random(l->nonce);
    } else {
        uint8_t count[8];
        dac_link_mac m;
        dac_link_put(count, l->boot);
        dac_link_put(count + 4, ++l->challenges);
        dac_link_mac_begin(&m, NONCE, l->config->key, l->config->key_bytes);
        dac_link_mac_add(&m, count, sizeof count);
        dac_link_mac_end(&m, l->nonce);
    }
    l->challenged = true;
    a->length = NONCE;
    dac_link_copy(a->payload, l->nonce, NONCE);
    return dac_link_fine();
}

bool dac_link_tagged(const dac_link *l, const uint8_t *nonce, const uint8_t *request, uint8_t bytes,
                     const uint8_t *digest, const uint8_t *tag)
{
    uint8_t right[DAC_LINK_TAG];
    dac_link_mac m;

    dac_link_mac_begin(&m, DAC_LINK_TAG, l->config->key, l->config->key_bytes);
    dac_link_mac_add(&m, nonce, sizeof l->nonce);
    dac_link_mac_add(&m, request, bytes);
    if (digest != NULL)
        dac_link_mac_add(&m, digest, 32);
    dac_link_mac_end(&m, right);
    return dac_link_same(right, tag, DAC_LINK_TAG);
}
