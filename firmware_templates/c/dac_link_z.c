/* A second sequencer, whose x is z: uploads, checks and requests of both (docs/protocol.md, "An output z"). */
#include "dac_link_parts.h"

#if DAC_LINK_Z

enum { Z_BYTES = DAC_LINK_INFO, Z_SHAPES = DAC_LINK_INFO + 4, SHAPES = 8, STATUS_BYTES = 28 };
enum { SCHEDULE_WORDS = DAC_LINK_PIXELS + 1 }; /* words of the scan that both have in common */
enum { NO_PROGRAM, PARKED, PARKING, PLAYING };
#define MOST_FRAMES (UINT32_C(1) << 31)

dac_link_started dac_link_init_z(dac_link *l, dac_link *z, const dac_link_config *config, dac_sequencer *sequencer,
                                 bool plays)
{
    const dac_link_started started = dac_link_init(z, config, sequencer, 0);

    if (started != DAC_LINK_STARTED)
        return started;
    if (l->config == NULL || l->config->stop_ticks == NULL || l == z || l->sequencer == sequencer
        || config->key_bytes != 0 || config->harmonics != 0 || config->permits != NULL)
        return DAC_LINK_BAD_Z;
#if DAC_PIXEL_TABLE
    if (config->table_pixels != 0)
        return DAC_LINK_BAD_Z;
#endif
    z->is_z = true;
    l->z = z;
    l->plays_z = l->played_z = plays;
    return DAC_LINK_STARTED;
}

/* Requests to both. */

static void stop_ticks(const dac_link *l, bool stopped)
{
    if (l->z != NULL)
        l->config->stop_ticks(stopped);
}

/* Whether so many requests have room. With stopped ticks this stays true. */
static bool has_room(const dac_sequencer *s, unsigned requests)
{
    const uint8_t waiting = (uint8_t)(s->head - s->tail);
    return waiting + requests <= DAC_REQUESTS;
}

static bool pass_on(dac_sequencer *s, uint8_t what, uint32_t frames)
{
    switch (what) {
    case DAC_LINK_ARM:
        return dac_sequencer_arm(s, frames);
    case DAC_LINK_TRIGGER:
        return dac_sequencer_trigger(s);
    case DAC_LINK_CLEAR:
        return dac_sequencer_clear_faults(s);
    default:
        return dac_sequencer_park(s);
    }
}

static bool pass_on_both(dac_link *l, uint8_t what, uint32_t frames)
{
    dac_sequencer *const z = l->z != NULL && (what != DAC_LINK_TRIGGER || l->plays_z) ? l->z->sequencer : NULL;

    stop_ticks(l, true);
    const bool room = has_room(l->sequencer, 1) && (z == NULL || has_room(z, 1));
    if (room)
        (void)pass_on(l->sequencer, what, frames);
    if (room && z != NULL)
        (void)pass_on(z, what, frames);
    stop_ticks(l, false);
    return room;
}

bool dac_link_arm(dac_link *l, uint32_t frames)
{
    return frames <= MOST_FRAMES && pass_on_both(l, DAC_LINK_ARM, frames);
}

bool dac_link_trigger(dac_link *l)
{
    return pass_on_both(l, DAC_LINK_TRIGGER, 0);
}

bool dac_link_park(dac_link *l)
{
    return pass_on_both(l, DAC_LINK_PARK, 0);
}

bool dac_link_clear(dac_link *l)
{
    return pass_on_both(l, DAC_LINK_CLEAR, 0);
}

/* Uploads. */

static uint32_t bytes_of(const dac_link *l)
{
    return dac_link_get(l->image[l->idle].info + DAC_LINK_BYTES);
}

uint32_t dac_link_received(const dac_link *l)
{
    return l->received + (l->has_z ? l->z->received : 0);
}

dac_link_finding dac_link_begin_both(dac_link *l, const uint8_t *info, uint8_t length, dac_link_answer *a)
{
    const bool has_z = length != DAC_LINK_INFO;
    const uint8_t before = l->upload;
    uint8_t first[DAC_LINK_INFO], second[DAC_LINK_INFO];

    if (has_z && l->z == NULL)
        return dac_link_because(DAC_LINK_PAYLOAD, 0);
    if (l->upload > DAC_LINK_RECEIVING || !dac_sequencer_writable(l->sequencer)
        || (l->z != NULL && !dac_sequencer_writable(l->z->sequencer)))
        return dac_link_because(DAC_LINK_BUSY, 0);
    dac_link_copy(first, info, sizeof first);
    dac_link_copy(second, info, sizeof second);
    if (has_z) {
        dac_link_put(first + DAC_LINK_BYTES, dac_link_get(info + DAC_LINK_BYTES) - dac_link_get(info + Z_BYTES));
        dac_link_put(second + DAC_LINK_BYTES, dac_link_get(info + Z_BYTES));
        dac_link_copy(second + DAC_LINK_SHAPES, info + Z_SHAPES, SHAPES);
    }
    const bool again = l->upload == DAC_LINK_RECEIVING && has_z == l->has_z
                    && dac_link_same(first, l->image[l->idle].info, sizeof first)
                    && (!has_z || dac_link_same(second, l->z->image[l->z->idle].info, sizeof second));
    if (!again)
        l->upload = DAC_LINK_NONE;
    dac_link_finding found = dac_link_begin(l, first, a);
    if (found.reason != DAC_LINK_NO_REASON) {
        l->upload = before;
        return found;
    }
    l->has_z = has_z;
    if (has_z) {
        l->z->upload = again ? DAC_LINK_RECEIVING : DAC_LINK_NONE;
        found = dac_link_begin(l->z, second, a);
        if (found.reason != DAC_LINK_NO_REASON) {
            l->upload = DAC_LINK_NONE;
            return dac_link_of_z(found);
        }
    }
    a->length = 4;
    dac_link_put(a->payload, dac_link_received(l));
    return dac_link_fine();
}

dac_link_finding dac_link_data_both(dac_link *l, const uint8_t *payload, uint8_t length, dac_link_answer *a)
{
    const uint8_t count = (uint8_t)(length - 4);

    if (l->upload == DAC_LINK_NONE)
        return dac_link_because(DAC_LINK_UPLOAD, 0);
    const uint32_t received = dac_link_received(l), bytes = bytes_of(l) + (l->has_z ? bytes_of(l->z) : 0);
    if (dac_link_get(payload) == received && count <= bytes - received)
        for (uint8_t i = 0; i < count; i++) {
            dac_link *const part = l->received != bytes_of(l) ? l : l->z;
            const dac_link_finding found = dac_link_store(part, payload[4 + i]);
            if (found.reason != DAC_LINK_NO_REASON) {
                l->upload = DAC_LINK_NONE;
                return part->is_z ? dac_link_of_z(found) : found;
            }
        }
    a->length = 4;
    dac_link_put(a->payload, dac_link_received(l));
    return dac_link_fine();
}

dac_link_finding dac_link_commit_both(dac_link *l, const uint8_t *payload, uint8_t length, dac_link_answer *a)
{
    if (l->upload == DAC_LINK_RECEIVING && l->has_z
        && dac_link_get(payload) == dac_link_get(l->image[l->idle].info + DAC_LINK_IMAGE_CRC)) {
        if (l->z->received != bytes_of(l->z))
            return dac_link_because(DAC_LINK_INCOMPLETE, dac_link_received(l));
        dac_link_start_check(&l->z->check);
    }
    if (l->upload == DAC_LINK_RECEIVING)
        l->checks_z = false;
    return dac_link_commit(l, payload, length, a);
}

/* Whether lines, windows and pixels of z are those of x and y. */
static bool same_schedule(const dac_link *l)
{
    return dac_link_same(l->image[l->idle].program, l->z->image[l->z->idle].program, 4 * SCHEDULE_WORDS);
}

dac_link_finding dac_link_check_both(dac_link *l, bool *passed)
{
    bool first = false;

    if (l->checks_z)
        return dac_link_of_z(dac_link_check_work(l->z, passed));
    const dac_link_finding found = dac_link_check_work(l, &first);
    if (!first || !l->has_z) {
        *passed = first;
        return found;
    }
    l->checks_z = true;
    return same_schedule(l) ? dac_link_fine() : dac_link_because(DAC_LINK_SCHEDULE, DAC_LINK_OF_Z);
}

/* Whether a scan plays, or begins with the next tick. */
static bool plays(const dac_sequencer *s)
{
    const bool starts = dac_sequencer_starts(s); /* first: in front of the tick whose markers follow */
    return starts || (dac_sequencer_status(s).markers & DAC_PLAYING) != 0;
}

/* Why programs are not handed over now. With stopped ticks this stays true. */
static dac_link_finding judge_commit(const dac_link *l, bool changes)
{
    unsigned requests = 1;

    if (changes) /* a park in front of the commit */
        requests++;
    if (changes && (plays(l->sequencer) || plays(l->z->sequencer)))
        return dac_link_because(DAC_LINK_NOT_PARKED, 0);
#if DAC_COMMIT_MODES
    if (l->commit_mode == (uint8_t)DAC_COMMIT_KEEP
        && (dac_sequencer_status(l->sequencer).markers & DAC_PLAYING) != 0
        && (!dac_sequencer_can_keep(l->sequencer) || (l->has_z && !dac_sequencer_can_keep(l->z->sequencer))))
        return dac_link_because(DAC_LINK_KEEP, 0);
#endif
    if (!has_room(l->sequencer, requests) || !has_room(l->z->sequencer, requests))
        return dac_link_because(DAC_LINK_TICKS, 0);
    return dac_link_fine();
}

dac_link_finding dac_link_hand_over(dac_link *l, dac_link_finding (*commit)(const dac_link *l))
{
    dac_link *const z = l->z;
    dac_program program;

    if (z == NULL)
        return commit(l);
    if (l->has_z) {
        dac_link_program_of(z, &program);
        const dac_loaded loaded = dac_sequencer_load(z->sequencer, &program);
        if (loaded != DAC_LOADED)
            return dac_link_because(DAC_LINK_REFUSED, (uint32_t)loaded | DAC_LINK_OF_Z);
#if DAC_COMMIT_MODES
        z->commit_mode = l->commit_mode;
#endif
    }
    const bool changes = l->has_z != l->plays_z;
    stop_ticks(l, true);
    dac_link_finding found = judge_commit(l, changes);
    if (found.reason == DAC_LINK_NO_REASON && changes) { /* an ARM that only one of them had is forgotten */
        (void)dac_sequencer_park(l->sequencer);
        (void)dac_sequencer_park(z->sequencer);
    }
    if (found.reason == DAC_LINK_NO_REASON)
        found = commit(l);
    if (found.reason == DAC_LINK_NO_REASON && l->has_z)
        found = commit(z);
    stop_ticks(l, false);
    if (found.reason == DAC_LINK_NO_REASON) {
        l->played_z = l->plays_z;
        l->plays_z = l->has_z;
    }
    return found;
}

/* A trigger behind the commit may have started a program whose z is not that of the commit: it is parked. */
bool dac_link_withdraw(dac_link *l)
{
    dac_link *const z = l->z;
    const bool changes = l->plays_z != l->played_z;

    if (z == NULL)
        return dac_sequencer_withdraw(l->sequencer);
    stop_ticks(l, true);
    const bool room = has_room(l->sequencer, changes ? 2u : 1u) && has_room(z->sequencer, changes ? 2u : 1u);
    if (room) {
        (void)dac_sequencer_withdraw(l->sequencer);
        (void)dac_sequencer_withdraw(z->sequencer);
    }
    if (room && changes && dac_sequencer_status(l->sequencer).swaps == l->swaps) {
        (void)dac_sequencer_park(l->sequencer);
        (void)dac_sequencer_park(z->sequencer);
    }
    stop_ticks(l, false);
    return room;
}

void dac_link_settle_z(dac_link *l, bool taken)
{
    if (!taken) {
        l->plays_z = l->played_z;
        return;
    }
    l->played_z = l->plays_z;
    if (l->plays_z) {
        l->z->playing = l->z->idle;
        l->z->uploaded = true;
    }
}

/* Answers. */

dac_link_finding dac_link_readback_both(const dac_link *l, const uint8_t *payload, dac_link_answer *a)
{
    const uint32_t offset = dac_link_get(payload);
    const uint8_t count = payload[4];
    const dac_link_finding found = dac_link_readback(l, payload, a);
    const bool plays_z = l->upload == DAC_LINK_WAITING ? l->played_z : l->plays_z;

    if (found.reason != DAC_LINK_NO_REASON || !plays_z)
        return found;
    const uint8_t done = (uint8_t)(a->length - 4);
    if (done != count) {
        const uint32_t at = offset + done - dac_link_read_back_bytes(l);
        const uint8_t rest = dac_link_read_back(l->z, at, a->payload + a->length, (uint8_t)(count - done));
        a->length = (uint8_t)(a->length + rest);
    }
    return found;
}

uint8_t dac_link_put_z_status(const dac_link *l, uint8_t *at)
{
    if (l->z == NULL)
        return 0;
    const dac_status s = dac_sequencer_status(l->z->sequencer);
    at[0] = s.swaps == 0 ? NO_PROGRAM : s.markers & DAC_PLAYING ? PLAYING : s.markers & DAC_PARKED ? PARKED : PARKING;
    at[1] = s.faults;
    at[2] = l->plays_z;
    at[3] = 0;
    dac_link_put(at + 4, s.swaps);
    dac_link_put(at + 8, s.line);
    for (unsigned i = 0; i < DAC_FAULTS; i++)
        dac_link_put(at + 12 + 4 * i, s.fault_counts[i]);
    return STATUS_BYTES;
}

#endif
