/* The key: challenges, and the tags of requests that answer them. */
#include "dac_link_parts.h"

enum { NONCE = 16 };

dac_link_started dac_link_judge_key(const dac_link_config *c)
{
    if (c->key_bytes == 0)
        return DAC_LINK_STARTED;
    if (c->key_bytes < 16 || c->key_bytes > 32 || c->key == NULL)
        return DAC_LINK_BAD_KEY;
    if (c->identity == NULL || c->identity_bytes < 4 || c->identity_bytes > 32)
        return DAC_LINK_NO_IDENTITY;
    if (c->random == NULL && !c->boot_persists)
        return DAC_LINK_NO_RANDOM;
    return c->milliseconds == NULL ? DAC_LINK_NO_CLOCK : DAC_LINK_STARTED;
}

/* Nobody without the key knows the next nonce. None comes twice if no boot count does, or by chance of the random
 * numbers; none of this device comes from another one, whatever their boot counts and random numbers are. */
dac_link_finding dac_link_challenge(dac_link *l, dac_link_answer *a)
{
    const dac_link_config *const c = l->config;
    uint8_t count[8], some[NONCE] = {0};
    dac_link_mac m;

    dac_link_put(count, l->boot);
    dac_link_put(count + 4, ++l->challenges);
    dac_link_mac_begin(&m, NONCE, c->key, c->key_bytes);
    dac_link_mac_byte(&m, c->identity_bytes);
    dac_link_mac_add(&m, c->identity, c->identity_bytes);
    dac_link_mac_add(&m, count, sizeof count);
    dac_link_mac_end(&m, l->nonce);
    if (c->random != NULL)
        c->random(some);
    for (unsigned i = 0; i < NONCE; i++)
        l->nonce[i] ^= some[i];
    l->challenged = true;
    l->challenged_at = c->milliseconds();
    a->length = NONCE;
    dac_link_copy(a->payload, l->nonce, NONCE);
    return dac_link_fine();
}

void dac_link_expire(dac_link *l)
{
    if (l->challenged && l->config->milliseconds() - l->challenged_at >= DAC_LINK_CHALLENGE_MS)
        l->challenged = false;
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
