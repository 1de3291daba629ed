/* Requests that are answered at once. */
#include "dac_link_parts.h"

enum { VERSION = 1, MOST_DATA = 240, PROGRAM_HASH = 32, LIMITS = 32, DEVICE = 56, STATUS = 76 };
enum { TAKES_TABLES = 1, TAKES_FOURIER = 2, HAS_KEY = 4, READS_BACK = 8, HAS_INTERLOCK = 16, NARROWS = 32 };
#if DAC_COMMIT_MODES
enum { HAS_MODES = 64, ALWAYS = TAKES_TABLES | READS_BACK | NARROWS | HAS_MODES };
#else
enum { ALWAYS = TAKES_TABLES | READS_BACK | NARROWS };
#endif
#if DAC_STORE
enum { KEEPS_PROGRAMS = 128 };
#endif
#if DAC_SLOW_PART
enum { PLAYS_SLOW_PARTS = 1 };
#endif
#if DAC_PIXEL_TABLE
enum { PLAYS_PIXEL_TABLES = 4 };
#endif
#if DAC_LINK_Z
enum { HAS_Z = 16, Z_AT = 8, Z_BYTES = 48 };
#endif
/* Further features, by the options; HELLO ends with them if there are any. */
#if DAC_MOVE
#define TAKES_MOVE(l) (2u | (dac_link_moves_slow((l)->config) ? 32u : 0u))
#else
#define TAKES_MOVE(l) 0u
#endif
#if DAC_LIBRARY > 1
enum { PLAYS_NUMBERS = 8 };
#define FURTHER(l) (TAKES_MOVE(l) | (dac_link_numbers(l) != 0 ? (uint32_t)PLAYS_NUMBERS : 0u))
#else
#define FURTHER(l) TAKES_MOVE(l)
#endif
#if DAC_MOVE
enum { MOVED = 2 }; /* behind PERMITS */
#endif
enum { TWOS_COMPLEMENT = 64, LEFT_ALIGNED = 128 };
enum { NO_PROGRAM, PARKED, PARKING, PLAYING };

/* The description of the device. */

static void put_limits(uint8_t *at, const dac_link_limits *limits)
{
    dac_link_put(at, limits->code_min);
    dac_link_put(at + 4, limits->code_max);
    dac_link_put(at + 8, limits->max_step);
    dac_link_put(at + 12, limits->max_jump);
}

static void put_shape(uint8_t *at, const dac_link_axis *axis)
{
    const dac_converter *const c = &axis->converter;

    at[0] = axis->index_bits;
    at[1] = axis->word_bits;
    at[2] = c->bits;
    at[3] = (uint8_t)(c->word_bits | (c->twos_complement ? TWOS_COMPLEMENT : 0) | (c->left_aligned ? LEFT_ALIGNED : 0));
}

static void put_device(const dac_link *l, uint8_t *at)
{
    const dac_link_config *const c = l->config;

    at[0] = VERSION;
    at[1] = (uint8_t)(ALWAYS | (c->harmonics ? TAKES_FOURIER : 0)
                      | (c->key_bytes ? HAS_KEY : 0) | (c->permits != NULL ? HAS_INTERLOCK : 0));
#if DAC_STORE
    at[1] = (uint8_t)(at[1] | (c->store != NULL ? KEEPS_PROGRAMS : 0));
#endif
    at[2] = c->window != 0 ? c->window : DAC_LINK_RING / 256;
    at[3] = MOST_DATA;
    at[4] = (uint8_t)c->harmonics;
    at[5] = (uint8_t)(c->harmonics >> 8);
    at[6] = DAC_SHAPING;
    at[7] = DAC_SPLINE ? 3 : 0; /* the highest degree */
    dac_link_put(at + 8, dac_link_most_bytes(c));
    put_shape(at + 12, &c->x);
    put_shape(at + 16, &c->y);
    put_limits(at + 20, &c->x.limits);
    put_limits(at + 36, &c->y.limits);
    dac_link_put(at + 52, c->update_rate_hz);
}

static void put_status(const dac_link *l, uint8_t *at)
{
    const dac_status s = dac_sequencer_status(l->sequencer);
    /* A program may have become active before dac_link_work() has seen it. */
    const bool swapped = l->upload == DAC_LINK_WAITING && s.swaps != l->swaps;
    const bool uploaded = swapped || l->uploaded;
#if DAC_MOVE
    /* A MOVE leaves an upload as it is, which STATUS has again once the MOVE is done. */
    const uint8_t after = l->moving ? l->upload_before : (uint8_t)DAC_LINK_NONE;
    const uint8_t upload = swapped ? after : l->upload;
    const uint8_t received = l->moving && !swapped ? (uint8_t)DAC_LINK_NONE : upload;
    const uint8_t image = l->moving ? (uint8_t)(1u - l->playing) : l->idle;
#else
    const uint8_t upload = swapped ? (uint8_t)DAC_LINK_NONE : l->upload;
#endif
    const uint8_t *const hash = uploaded ? l->image[swapped ? l->idle : l->playing].info : l->config->hash;

    at[0] = s.swaps == 0 ? NO_PROGRAM : s.markers & DAC_PLAYING ? PLAYING : s.markers & DAC_PARKED ? PARKED : PARKING;
    at[1] = upload;
    at[2] = s.faults;
    at[3] = dac_link_permits(l);
#if DAC_MOVE
    at[3] = (uint8_t)(at[3] | ((swapped ? l->moving : l->moved) ? MOVED : 0));
#endif
    dac_link_put(at + 4, l->boot);
    dac_link_put(at + 8, s.swaps);
    dac_link_put(at + 12, s.line);
#if DAC_MOVE
    dac_link_put(at + 16, received == DAC_LINK_NONE ? 0 : l->received);
    dac_link_put(at + 20, received == DAC_LINK_NONE ? 0 : dac_link_get(l->image[image].info + DAC_LINK_IMAGE_CRC));
#else
#if DAC_LINK_Z
    dac_link_put(at + 16, upload == DAC_LINK_NONE ? 0 : dac_link_received(l));
#else
    dac_link_put(at + 16, upload == DAC_LINK_NONE ? 0 : l->received);
#endif
    dac_link_put(at + 20, upload == DAC_LINK_NONE ? 0 : dac_link_get(l->image[l->idle].info + DAC_LINK_IMAGE_CRC));
#endif
    for (unsigned i = 0; i < DAC_FAULTS; i++)
        dac_link_put(at + 24 + 4 * i, s.fault_counts[i]);
    dac_link_put(at + 40, l->bad_frames);
    for (unsigned i = 0; i < PROGRAM_HASH; i++)
        at[44 + i] = hash == NULL || s.swaps == 0 ? 0 : hash[i];
}

#if DAC_PIXEL_TABLE
/* Further features of a link with tables of pixels; returns their bytes. Those of slow parts are 0 without them. */
static uint8_t put_further(const dac_link_config *c, uint32_t further, uint8_t *at)
{
    further |= PLAYS_PIXEL_TABLES;

    at[4] = at[5] = 0;
#if DAC_SLOW_PART
    if (c->slow_knots != 0) {
        further |= PLAYS_SLOW_PARTS;
        at[4] = c->slow_knots;
        at[5] = c->slow_index_bits;
    }
#endif
    dac_link_put(at, further);
    at[6] = (uint8_t)c->table_pixels;
    at[7] = (uint8_t)(c->table_pixels >> 8);
    return 8;
}
#endif

#if DAC_LINK_Z
/* What the slow parts of a sequencer may have; 0 without them. */
static void put_slow(uint8_t *at, const dac_link_config *c)
{
#if DAC_SLOW_PART
    at[0] = c->slow_knots;
    at[1] = c->slow_knots != 0 ? c->slow_index_bits : 0;
#else
    (void)c;
    at[0] = at[1] = 0;
#endif
}

/* Further features of a link with z, which has all fields; returns their bytes. */
static uint8_t put_z(const dac_link *l, uint8_t *at)
{
    const dac_link_config *const c = l->config, *const z = l->z->config;
    uint32_t further = HAS_Z;

    put_slow(at + 4, c);
#if DAC_SLOW_PART
    further |= c->slow_knots != 0 ? (uint32_t)PLAYS_SLOW_PARTS : 0u;
#endif
    at[6] = at[7] = 0;
#if DAC_PIXEL_TABLE
    further |= c->table_pixels != 0 ? (uint32_t)PLAYS_PIXEL_TABLES : 0u;
    at[6] = (uint8_t)(c->table_pixels & 255u);
    at[7] = (uint8_t)(c->table_pixels >> 8 & 255u);
#endif
    dac_link_put(at, further);
    at += Z_AT;
    dac_link_put(at, dac_link_most_bytes(z));
    put_slow(at + 4, z);
    at[6] = at[7] = 0;
    put_shape(at + 8, &z->x);
    put_shape(at + 12, &z->y);
    put_limits(at + 16, &z->x.limits);
    put_limits(at + 32, &z->y.limits);
    return Z_AT + Z_BYTES;
}
#endif

/* Requests. */

dac_link_finding dac_link_hello(dac_link *l, uint32_t session, dac_link_answer *a)
{
    if (!l->opened || session != l->session) {
        l->opened = true;
        l->session = session;
        l->last.known = false;
        l->commit_is_last = l->abort_is_last = false;
    }
    a->length = DEVICE + STATUS;
    put_device(l, a->payload);
    put_status(l, a->payload + DEVICE);
#if DAC_LINK_Z
    if (l->z != NULL) {
        a->length = (uint8_t)(DEVICE + STATUS + put_z(l, a->payload + DEVICE + STATUS));
        return dac_link_fine();
    }
#endif
#if DAC_PIXEL_TABLE
    if (l->config->table_pixels != 0) {
        a->length = (uint8_t)(DEVICE + STATUS + put_further(l->config, FURTHER(l), a->payload + DEVICE + STATUS));
        return dac_link_fine();
    }
#endif
#if DAC_SLOW_PART
    if (l->config->slow_knots != 0) {
        dac_link_put(a->payload + DEVICE + STATUS, FURTHER(l) | PLAYS_SLOW_PARTS);
        a->payload[DEVICE + STATUS + 4] = l->config->slow_knots;
        a->payload[DEVICE + STATUS + 5] = l->config->slow_index_bits;
        a->length = DEVICE + STATUS + 6;
        return dac_link_fine();
    }
#endif
#if DAC_MOVE || DAC_LIBRARY > 1
    if (FURTHER(l) != 0) {
        dac_link_put(a->payload + DEVICE + STATUS, FURTHER(l));
        a->length = DEVICE + STATUS + 4;
    }
#endif
    return dac_link_fine();
}

dac_link_finding dac_link_status(const dac_link *l, dac_link_answer *a)
{
    a->length = STATUS;
    put_status(l, a->payload);
#if DAC_LINK_Z
    a->length = (uint8_t)(STATUS + dac_link_put_z_status(l, a->payload + STATUS));
#endif
    return dac_link_fine();
}

static uint32_t least(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

static void narrow(dac_link_limits *limits, const dac_link_limits *most, const uint8_t *asked)
{
    const uint32_t code_min = dac_link_get(asked);

    limits->code_min = code_min > most->code_min ? code_min : most->code_min;
    limits->code_max = least(dac_link_get(asked + 4), most->code_max);
    limits->max_step = least(dac_link_get(asked + 8), most->max_step);
    limits->max_jump = least(dac_link_get(asked + 12), most->max_jump);
}

dac_link_finding dac_link_set_limits(dac_link *l, const uint8_t *payload, uint8_t length, dac_link_answer *a)
{
    if (length != 0) {
        narrow(&l->x_limits, &l->config->x.limits, payload);
        narrow(&l->y_limits, &l->config->y.limits, payload + LIMITS / 2);
    }
    a->length = LIMITS;
    put_limits(a->payload, &l->x_limits);
    put_limits(a->payload + LIMITS / 2, &l->y_limits);
    return dac_link_fine();
}
