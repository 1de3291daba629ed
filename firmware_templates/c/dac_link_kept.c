/* Kept programs: a start with one of them, and the requests about them (docs/protocol.md, "Kept programs"). */
#include "dac_link_parts.h"

#if DAC_STORE

enum { STORE = 12 }; /* bytes of the description of a store */
enum { EMPTY, PROGRAM, DAMAGED };

/* The bytes of a slot go the way of those of an upload. */
static dac_link_finding load_bytes(dac_link *l, uint8_t slot, const uint8_t *info)
{
    const uint32_t bytes = dac_link_get(info + DAC_LINK_BYTES);
    uint8_t line[DAC_STORE_LINE], payload[4];
    dac_link_answer a = {0, 0, 0, 0, payload};
    dac_link_finding found = dac_link_begin(l, info, &a);

    for (uint32_t at = 0; at < bytes && found.reason == DAC_LINK_NO_REASON; at += DAC_STORE_LINE) {
        const uint32_t count = bytes - at < DAC_STORE_LINE ? bytes - at : DAC_STORE_LINE;
        if (!dac_store_read(l->config->store, slot, at, line, count))
            return dac_link_because(DAC_LINK_FLASH, 0);
        for (uint32_t i = 0; i < count && found.reason == DAC_LINK_NO_REASON; i++)
            found = dac_link_store(l, line[i]);
    }
    return found;
}

/* All checks of a commit at once, except that of the tag. */
static dac_link_finding check_all(dac_link *l)
{
    dac_link_finding found = dac_link_fine();

    dac_link_start_check(&l->check);
    l->loading = true;
    for (bool passed = false; !passed && found.reason == DAC_LINK_NO_REASON;)
        found = dac_link_check_work(l, &passed);
    l->loading = false;
    return found;
}

static dac_link_finding commit(dac_link *l)
{
    dac_program program;

    dac_link_program_of(l, &program);
    const dac_loaded loaded = dac_sequencer_load(l->sequencer, &program);
    if (loaded != DAC_LOADED)
        return dac_link_because(DAC_LINK_REFUSED, (uint32_t)loaded);
    return dac_sequencer_commit(l->sequencer) ? dac_link_fine() : dac_link_because(DAC_LINK_TICKS, 0);
}

static bool start_with(dac_link *l, uint8_t slot)
{
    uint8_t info[DAC_LINK_INFO];

    if (!dac_store_info(l->config->store, slot, info))
        return false;
    dac_link_finding found = load_bytes(l, slot, info);
    if (found.reason == DAC_LINK_NO_REASON)
        found = check_all(l);
    if (found.reason == DAC_LINK_NO_REASON)
        found = commit(l);
    l->upload = DAC_LINK_NONE;
    if (found.reason != DAC_LINK_NO_REASON) {
        if (l->kept_refused == DAC_LINK_NO_REASON)
            l->kept_refused = found.reason;
        return false;
    }
    l->kept = slot;
    l->playing = l->idle;
    l->uploaded = true;
    l->taken_generation = 1;
    return true;
}

bool dac_link_load_kept(dac_link *l)
{
    if (l->config == NULL || l->config->store == NULL)
        return false;
    dac_store *const store = l->config->store;
    const bool tries = store->state.trial != DAC_STORE_NONE && store->state.started == 0;
    const uint8_t due = tries ? store->state.trial : store->state.selected;
    const uint8_t slot = dac_store_start(store);
    uint8_t info[DAC_LINK_INFO];

    if (slot != due)
        l->kept_refused = dac_store_info(store, due, info) ? DAC_LINK_FLASH : DAC_LINK_IMAGE;
    return start_with(l, slot) || (slot != store->state.selected && start_with(l, store->state.selected));
}

#if DAC_LIBRARY
dac_link_finding dac_link_load_slot(dac_link *l, uint8_t slot)
{
    uint8_t info[DAC_LINK_INFO];

    return dac_store_info(l->config->store, slot, info) ? load_bytes(l, slot, info)
                                                        : dac_link_because(DAC_LINK_NO_NUMBER, 0);
}
#endif

/* Requests. */

dac_link_finding dac_link_slot(const dac_link *l, const uint8_t *payload, dac_link_answer *a)
{
    const dac_store *const store = l->config->store;
    const uint8_t slot = payload[0];

    if (slot != DAC_STORE_NONE && slot >= store->flash->slots)
        return dac_link_because(DAC_LINK_NO_SLOT, store->flash->slots);
    const bool good = dac_store_info(store, slot, a->payload + STORE);
    a->length = good ? STORE + DAC_LINK_INFO : STORE;
    a->payload[0] = store->flash->slots;
    a->payload[1] = store->state.selected;
    a->payload[2] = store->state.trial;
    a->payload[3] = store->state.started;
    a->payload[4] = l->kept;
    a->payload[5] = l->kept_refused;
    a->payload[6] = good ? PROGRAM : dac_store_holds(store, slot) ? DAMAGED : EMPTY;
    a->payload[7] = l->config->store_while_playing ? 1 : 0;
    dac_link_put(a->payload + 8, dac_store_room(store));
    return dac_link_fine();
}

/* Whether flash may be written now. */
static dac_link_finding check_state(const dac_link *l)
{
    const bool starts = dac_sequencer_starts(l->sequencer); /* first: in front of the tick whose markers follow */
    const dac_status s = dac_sequencer_status(l->sequencer);
    const bool rests = s.swaps == 0 || (s.markers & (DAC_PLAYING | DAC_PARKED)) == DAC_PARKED;

    return l->config->store_while_playing || (rests && !starts) ? dac_link_fine()
                                                                : dac_link_because(DAC_LINK_NOT_PARKED, 0);
}

static dac_link_finding changed(const dac_link *l, dac_store_result result)
{
    switch (result) {
    case DAC_STORE_DONE:
        return dac_link_fine();
    case DAC_STORE_NO_SLOT:
        return dac_link_because(DAC_LINK_NO_SLOT, l->config->store->flash->slots);
    case DAC_STORE_TOO_LONG:
        return dac_link_because(DAC_LINK_ROOM, dac_store_room(l->config->store));
    case DAC_STORE_NO_TRIAL:
        return dac_link_because(DAC_LINK_NO_TRIAL, 0);
    default:
        return dac_link_because(DAC_LINK_FLASH, 0);
    }
}

/* A slot that has other content now is not the one of this start any more. */
static dac_link_finding changed_slot(dac_link *l, dac_store_result result, uint8_t slot)
{
    if (result == DAC_STORE_DONE && slot == l->kept)
        l->kept = DAC_STORE_NONE;
    return changed(l, result);
}

static void read_playing(void *from, uint32_t offset, uint8_t *bytes, uint32_t count)
{
    const dac_link *const l = from;
    (void)dac_link_read_back(l, offset, bytes, (uint8_t)count);
}

/* The announcement of what can be read back: tables, whatever form was uploaded. */
static void announce_playing(const dac_link *l, uint8_t *info)
{
    uint8_t line[DAC_STORE_LINE], count;
    uint32_t bytes = 0, crc = DAC_LINK_CRC;

    do {
        count = dac_link_read_back(l, bytes, line, DAC_STORE_LINE);
        for (uint8_t i = 0; i < count; i++)
            crc = dac_link_crc(crc, line[i]);
        bytes += count;
    } while (count == DAC_STORE_LINE);
    dac_link_copy(info, l->image[l->playing].info, DAC_LINK_INFO);
    dac_link_put(info + DAC_LINK_BYTES, bytes);
    dac_link_put(info + DAC_LINK_IMAGE_CRC, ~crc);
}

dac_link_finding dac_link_save(dac_link *l, const uint8_t *payload)
{
    dac_store *const store = l->config->store;
    const dac_link_finding found = check_state(l);
    /* Of the tables that are read, even if a tick has just taken the program that waited. */
    const uint32_t generation = l->upload == DAC_LINK_WAITING ? l->swaps : dac_sequencer_status(l->sequencer).swaps;
    uint8_t info[DAC_LINK_INFO];

    if (found.reason != DAC_LINK_NO_REASON)
        return found;
    if (payload[0] >= store->flash->slots)
        return dac_link_because(DAC_LINK_NO_SLOT, store->flash->slots);
    if (!l->uploaded)
        return dac_link_because(DAC_LINK_READBACK, 0);
    if (dac_link_get(payload + 1) != generation)
        return dac_link_because(DAC_LINK_GENERATION, generation);
    announce_playing(l, info);
    return changed_slot(l, dac_store_save(store, payload[0], info, read_playing, l), payload[0]);
}

dac_link_finding dac_link_select(dac_link *l, const uint8_t *payload)
{
    const dac_link_finding found = check_state(l);

    if (found.reason != DAC_LINK_NO_REASON)
        return found;
    return changed(l, dac_store_select(l->config->store, payload[0], payload[1] != 0));
}

dac_link_finding dac_link_confirm(dac_link *l)
{
    dac_store *const store = l->config->store;
    const dac_link_finding found = check_state(l);

    if (found.reason != DAC_LINK_NO_REASON)
        return found;
    if (l->kept != store->state.trial) /* a trial that did not play */
        return dac_link_because(DAC_LINK_NO_TRIAL, 0);
    return changed(l, dac_store_confirm(store));
}

dac_link_finding dac_link_delete(dac_link *l, const uint8_t *payload)
{
    const dac_link_finding found = check_state(l);

    if (found.reason != DAC_LINK_NO_REASON)
        return found;
    return changed_slot(l, dac_store_delete(l->config->store, payload[0]), payload[0]);
}

#endif
