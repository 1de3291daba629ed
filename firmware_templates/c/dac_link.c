/* Receives bytes from the line, and makes the checks that are common to all requests: docs/protocol.md. */
#include "dac_link.h"

#include "dac_axis.h"
#include "dac_barriers.h"
#include "dac_link_parts.h"

enum { VERSION = 1, MOST_READ = 240, LIMITS = 32 };
#define MOST_FRAMES (UINT32_C(1) << 31)
#if DAC_LIBRARY > 1
#define MOST_MODE (DAC_COMMIT_MODES ? 2u : 0u) /* DAC_COMMIT_FRAME, or DAC_COMMIT_LINE alone */
#endif
#define BLOCK (DAC_LINK_RING / 128) /* bytes of the ring that are freed at once */

#if DAC_LINK_RING < 512 || DAC_LINK_RING > 32768 || (DAC_LINK_RING & (DAC_LINK_RING - 1)) != 0
#error "DAC_LINK_RING is a power of two, 512..32768"
#endif

/* What does not fit is refused here, once: no request has to ask again. */

static bool good_axis(const dac_link_axis *axis)
{
    const dac_link_limits *const limits = &axis->limits;

    return dac_axis_serves(&axis->converter) && limits->code_min <= limits->code_max
        && limits->code_max < UINT32_C(1) << axis->converter.bits && limits->max_step != 0
        && axis->word_bits >= 8 && axis->word_bits <= 24 && axis->word_bits <= DAC_TABLE_STORAGE_BITS
        && axis->index_bits >= 3 && axis->index_bits <= 16 && axis->room >= DAC_TABLE_ROOM(axis->index_bits)
        && axis->table[0] != NULL && axis->table[1] != NULL && axis->table[0] != axis->table[1];
}

static bool good_fourier(const dac_link_config *c)
{
    return c->harmonics == 0
        || (c->harmonics <= 4096 && c->x.fourier != NULL && c->y.fourier != NULL && c->sine != NULL
            && c->sine_index_bits <= 16 && c->sine_index_bits >= c->x.index_bits
            && c->sine_index_bits >= c->y.index_bits);
}

#if DAC_SLOW_PART
static bool good_slow_memory(const dac_link_slow *slow)
{
    return slow->second != NULL && slow->table != NULL && slow->gains != NULL && slow->ratios != NULL;
}

/* Whether there is memory for the gains of two moves on both axes, or none. */
static bool good_moved_gains(const dac_link_config *c)
{
#if DAC_LINK_MOVES_SLOW
    const int32_t *const of[] = {c->x.moved_gains[0], c->x.moved_gains[1], c->y.moved_gains[0], c->y.moved_gains[1]};

    for (unsigned i = 0; i < 4; i++)
        for (unsigned j = 0; j < i; j++)
            if ((of[i] == NULL) != (of[j] == NULL) || (of[i] != NULL && of[i] == of[j]))
                return false;
#else
    (void)c;
#endif
    return true;
}

static bool good_slow(const dac_link_config *c)
{
    return c->slow_knots == 0
        || (c->slow_knots >= 2 && c->slow_knots <= 65 && c->slow_index_bits >= 3 && c->slow_index_bits <= 14
            && good_slow_memory(&c->x.slow[0]) && good_slow_memory(&c->x.slow[1])
            && good_slow_memory(&c->y.slow[0]) && good_slow_memory(&c->y.slow[1])
            && c->x.mixed != NULL && c->y.mixed != NULL && c->x.mixed != c->y.mixed
            && good_moved_gains(c));
}
#endif

#if DAC_PIXEL_TABLE
static bool good_pixel_memory(const dac_link_config *c)
{
    return c->table_pixels == 0
        || (c->pixel_ticks[0] != NULL && c->pixel_ticks[1] != NULL && c->pixel_ticks[0] != c->pixel_ticks[1]);
}
#endif

static dac_link_started judge_config(const dac_link_config *c)
{
    if (DAC_PROGMEM || !good_axis(&c->x) || !good_axis(&c->y)) /* tables of the link are not in flash */
        return DAC_LINK_BAD_AXIS;
    if (!good_fourier(c))
        return DAC_LINK_BAD_FOURIER;
#if DAC_SLOW_PART
    if (!good_slow(c))
        return DAC_LINK_BAD_SLOW;
#endif
#if DAC_PIXEL_TABLE
    if (!good_pixel_memory(c))
        return DAC_LINK_BAD_PIXEL_TABLE;
#endif
    return dac_link_judge_key(c);
}

dac_link_started dac_link_init(dac_link *l, const dac_link_config *config, dac_sequencer *sequencer, uint32_t boot)
{
    const dac_link_started started = judge_config(config);
    unsigned char *const bytes = (unsigned char *)l;

    for (size_t i = 0; i < sizeof *l; i++)
        bytes[i] = 0;
    if (started != DAC_LINK_STARTED)
        return started; /* without a configuration dac_link_work() does nothing */
    l->config = config;
    l->sequencer = sequencer;
    l->boot = boot;
    l->x_limits = config->x.limits;
    l->y_limits = config->y.limits;
#if DAC_STORE
    l->kept = DAC_STORE_NONE;
#endif
    return started;
}

/* The ring. `freed` is one byte, which an 8-bit processor reads at once; its `head` may change while it is read. */

bool dac_link_receive(dac_link *l, uint8_t byte)
{
    const uint16_t head = l->head;

    if ((uint8_t)(head / BLOCK - l->freed) >= 128) {
        l->lost = l->lost + 1;
        return false;
    }
    DAC_ACQUIRE();
    l->ring[head % DAC_LINK_RING] = byte;
    DAC_RELEASE();
    l->head = (uint16_t)(head + 1u);
    return true;
}

static uint16_t received(const dac_link *l)
{
    uint16_t first, second = l->head;
    do {
        first = second;
        second = l->head;
    } while (first != second);
    DAC_ACQUIRE();
    return (uint16_t)(first - l->tail);
}

static uint8_t next_byte(dac_link *l)
{
    const uint8_t byte = l->ring[l->tail % DAC_LINK_RING];

    l->tail = (uint16_t)(l->tail + 1u);
    DAC_RELEASE();
    l->freed = (uint8_t)(l->tail / BLOCK);
    return byte;
}

/* Requests. */

#if DAC_STORE || DAC_MOVE || DAC_LIBRARY > 1
typedef uint32_t request_set;
#else
typedef unsigned request_set;
#endif
#if DAC_LIBRARY > 1
#define KNOWN DAC_LINK_PLAY /* the last request */
#elif DAC_MOVE
#define KNOWN DAC_LINK_MOVE
#elif DAC_STORE
#define KNOWN DAC_LINK_DELETE
#else
#define KNOWN DAC_LINK_LIMITS
#endif
#if DAC_MOVE || DAC_LIBRARY > 1
#define ABOUT_KEPT(request) ((request) > DAC_LINK_LIMITS && (request) < DAC_LINK_MOVE)
#elif DAC_STORE
#define ABOUT_KEPT(request) ((request) > DAC_LINK_LIMITS)
#endif
#if DAC_STORE
#define TAGGED_STORE (UINT32_C(1) << DAC_LINK_SAVE | UINT32_C(1) << DAC_LINK_SELECT \
                      | UINT32_C(1) << DAC_LINK_CONFIRM | UINT32_C(1) << DAC_LINK_DELETE)
#else
#define TAGGED_STORE 0u
#endif
#if DAC_MOVE
#define TAGGED_MOVE (UINT32_C(1) << DAC_LINK_MOVE)
#else
#define TAGGED_MOVE 0u
#endif
#if DAC_LIBRARY > 1
#define TAGGED_PLAY (UINT32_C(1) << DAC_LINK_PLAY)
#else
#define TAGGED_PLAY 0u
#endif
#define TAGGED (TAGGED_ALWAYS | TAGGED_STORE | TAGGED_MOVE | TAGGED_PLAY)
#define TAGGED_ALWAYS (1u << DAC_LINK_COMMIT | 1u << DAC_LINK_PARK | 1u << DAC_LINK_ARM | 1u << DAC_LINK_TRIGGER \
                       | 1u << DAC_LINK_CLEAR | 1u << DAC_LINK_LIMITS)

static bool in(request_set set, uint8_t request)
{
    return (set >> request & 1u) != 0;
}

/* Bytes of a payload without tag, but for those whose length varies. */
static uint8_t plain_bytes(const dac_link_config *config, uint8_t request, uint8_t length)
{
    (void)config; /* of use for a MOVE alone */
    switch (request) {
    case DAC_LINK_HELLO:
        return 1;
    case DAC_LINK_BEGIN:
#if DAC_LINK_Z
        if (length == DAC_LINK_INFO + DAC_LINK_Z_INFO)
            return length;
#endif
        return DAC_LINK_INFO;
    case DAC_LINK_READ:
        return 5;
    case DAC_LINK_COMMIT:
        return dac_link_commit_bytes(length);
    case DAC_LINK_ARM:
        return 4;
    case DAC_LINK_LIMITS:
        return length == 0 ? 0 : LIMITS;
#if DAC_STORE
    case DAC_LINK_SLOT:
    case DAC_LINK_DELETE:
        return 1;
    case DAC_LINK_SELECT:
        return 2;
    case DAC_LINK_SAVE:
        return 5;
#endif
#if DAC_MOVE
    case DAC_LINK_MOVE:
        return dac_link_move_bytes(config, length);
#endif
#if DAC_LIBRARY > 1
    case DAC_LINK_LIST:
        return 2;
    case DAC_LINK_PLAY:
        return 3;
#endif
    default:
        return 0;
    }
}

static dac_link_finding check_payload(const dac_link *l, uint8_t request, const uint8_t *payload, uint8_t length)
{
    const uint8_t plain = plain_bytes(l->config, request, length);
    const bool may_be_tagged = l->config->key_bytes != 0 && in(TAGGED, request);
    bool good = length == plain || (may_be_tagged && length == plain + DAC_LINK_TAG);

    if (request == DAC_LINK_HELLO && length != 0 && payload[0] != VERSION)
        return dac_link_because(DAC_LINK_VERSION, VERSION);
    if (request == DAC_LINK_DATA)
        good = length > 4;
    else if (good && request == DAC_LINK_READ)
        good = payload[4] >= 1 && payload[4] <= MOST_READ;
    else if (good && request == DAC_LINK_ARM)
        good = dac_link_get(payload) <= MOST_FRAMES;
#if DAC_COMMIT_MODES
    else if (good && request == DAC_LINK_COMMIT && plain == 5)
        good = payload[4] <= DAC_COMMIT_FRAME;
#endif
#if DAC_STORE
    else if (good && request == DAC_LINK_SELECT)
        good = payload[1] <= 1;
#endif
#if DAC_LIBRARY > 1
    else if (good && request == DAC_LINK_PLAY)
        good = payload[2] <= MOST_MODE;
#endif
    return good ? dac_link_fine() : dac_link_because(DAC_LINK_PAYLOAD, 0);
}

/* Checks the tag of a request that acts, except COMMIT, whose tag covers the image. Uses up the challenge, right or
 * wrong. */
static bool good_tag(dac_link *l, const uint8_t *frame, uint8_t length)
{
    const uint8_t bytes = (uint8_t)(DAC_LINK_HEADER + plain_bytes(l->config, frame[0], length));
    const bool challenged = l->challenged;

    l->challenged = false;
    return challenged && DAC_LINK_HEADER + length == bytes + DAC_LINK_TAG
        && dac_link_tagged(l, l->nonce, frame, bytes, NULL, frame + bytes);
}

static dac_link_finding passed_on(bool passed)
{
    return passed ? dac_link_fine() : dac_link_because(DAC_LINK_TICKS, 0);
}

static dac_link_finding obey(dac_link *l, uint8_t request, const uint8_t *payload, uint8_t length,
                             dac_link_answer *a)
{
    switch (request) {
    case DAC_LINK_HELLO:
        return dac_link_hello(l, a->session, a);
#if DAC_LINK_Z
    case DAC_LINK_BEGIN:
        return dac_link_begin_both(l, payload, length, a);
    case DAC_LINK_DATA:
        return dac_link_data_both(l, payload, length, a);
    case DAC_LINK_COMMIT:
        return dac_link_commit_both(l, payload, length, a);
#else
    case DAC_LINK_BEGIN:
        return dac_link_begin(l, payload, a);
    case DAC_LINK_DATA:
        return dac_link_data(l, payload, length, a);
    case DAC_LINK_COMMIT:
        return dac_link_commit(l, payload, length, a);
#endif
    case DAC_LINK_ABORT:
        return dac_link_abort(l, a);
    case DAC_LINK_STATUS:
        return dac_link_status(l, a);
#if DAC_LINK_Z
    case DAC_LINK_READ:
        return dac_link_readback_both(l, payload, a);
    case DAC_LINK_PARK:
        return passed_on(dac_link_park(l));
    case DAC_LINK_ARM:
        return passed_on(dac_link_arm(l, dac_link_get(payload)));
    case DAC_LINK_TRIGGER:
        return passed_on(dac_link_trigger(l));
    case DAC_LINK_CLEAR:
        return passed_on(dac_link_clear(l));
#else
    case DAC_LINK_READ:
        return dac_link_readback(l, payload, a);
    case DAC_LINK_PARK:
        return passed_on(dac_sequencer_park(l->sequencer));
    case DAC_LINK_ARM:
        return passed_on(dac_sequencer_arm(l->sequencer, dac_link_get(payload)));
    case DAC_LINK_TRIGGER:
        return passed_on(dac_sequencer_trigger(l->sequencer));
    case DAC_LINK_CLEAR:
        return passed_on(dac_sequencer_clear_faults(l->sequencer));
#endif
    case DAC_LINK_CHALLENGE:
        return dac_link_challenge(l, a);
#if DAC_STORE
    case DAC_LINK_SLOT:
        return dac_link_slot(l, payload, a);
    case DAC_LINK_SAVE:
        return dac_link_save(l, payload);
    case DAC_LINK_SELECT:
        return dac_link_select(l, payload);
    case DAC_LINK_CONFIRM:
        return dac_link_confirm(l);
    case DAC_LINK_DELETE:
        return dac_link_delete(l, payload);
#endif
#if DAC_MOVE
    case DAC_LINK_MOVE:
        return dac_link_move(l, payload, length, a);
#endif
#if DAC_LIBRARY > 1
    case DAC_LINK_LIST:
        return dac_link_list_number(l, payload, a);
    case DAC_LINK_PLAY:
        return dac_link_play_number(l, payload, a);
#endif
    default:
        return dac_link_set_limits(l, payload, length, a);
    }
}

/* The checks that are common to all requests; *again: the request was answered before. */
static dac_link_finding admit(dac_link *l, const uint8_t *frame, uint8_t length, bool acts, bool *again)
{
    const uint8_t request = frame[0], seq = frame[1];

    if (request != DAC_LINK_HELLO && (!l->opened || dac_link_get(frame + 2) != l->session))
        return dac_link_because(DAC_LINK_SESSION, 0);
    if (request < DAC_LINK_HELLO || request > KNOWN
        || (request == DAC_LINK_CHALLENGE && l->config->key_bytes == 0))
        return dac_link_because(DAC_LINK_TYPE, 0);
#if DAC_STORE
    if (ABOUT_KEPT(request) && l->config->store == NULL)
        return dac_link_because(DAC_LINK_TYPE, 0);
#elif DAC_MOVE || DAC_LIBRARY > 1
    if (ABOUT_KEPT(request))
        return dac_link_because(DAC_LINK_TYPE, 0);
#endif
#if DAC_LIBRARY > 1
    if ((request > DAC_LINK_MOVE && dac_link_numbers(l) == 0) || (!DAC_MOVE && request == DAC_LINK_MOVE))
        return dac_link_because(DAC_LINK_TYPE, 0);
#endif
    const dac_link_finding found = check_payload(l, request, frame + DAC_LINK_HEADER, length);
    if (found.reason != DAC_LINK_NO_REASON || !acts)
        return found;
    if (l->last.known) {
        const uint8_t behind = (uint8_t)(l->last.seq - seq);
        *again = behind == 0 && request == l->last.request;
        if (*again)
            return dac_link_fine();
        if (behind < 128)
            return dac_link_because(DAC_LINK_OLD, 0);
    }
    if (in(TAGGED, request) && request != DAC_LINK_COMMIT && l->config->key_bytes != 0 && !good_tag(l, frame, length))
        return dac_link_because(DAC_LINK_KEY, 0);
    return dac_link_fine();
}

/* A frame is complete. */
static void judge(dac_link *l)
{
    const uint8_t *const frame = l->reader.bytes;
    const uint8_t request = frame[0], length = (uint8_t)(l->reader.length - DAC_LINK_HEADER);
    const bool acts = request == DAC_LINK_ABORT || (request <= KNOWN && in(TAGGED, request)
                                                    && (request != DAC_LINK_LIMITS || length != 0));
    dac_link_answer a = {(uint8_t)(request | DAC_LINK_ANSWER), frame[1], 0, 0, l->out + 1 + DAC_LINK_HEADER};
    bool again = false;

    if ((request & DAC_LINK_ANSWER) != 0)
        return; /* an echo */
    a.session = dac_link_get(frame + 2);
    dac_link_finding found = admit(l, frame, length, acts, &again);
    if (again) {
        dac_link_recall(l, &a);
    } else if (found.reason != DAC_LINK_NO_REASON) {
        dac_link_refuse(&a, request, found);
    } else {
        if (acts) {
            l->before_commit = l->last;
            l->last.known = true;
            l->last.request = request;
            l->last.seq = frame[1];
            l->last.type = DAC_LINK_SILENT;
            l->commit_is_last = l->abort_is_last = false;
        }
        found = obey(l, request, frame + DAC_LINK_HEADER, length, &a);
        if (found.reason != DAC_LINK_NO_REASON)
            dac_link_refuse(&a, request, found);
        if (acts && a.type != DAC_LINK_SILENT)
            dac_link_remember(l, a.type, a.payload, a.length);
    }
    if (a.type != DAC_LINK_SILENT)
        dac_link_send(l, &a);
}

bool dac_link_work(dac_link *l)
{
    if (l->config == NULL)
        return false;
    dac_link_expire(l);
    if (l->upload == DAC_LINK_WAITING)
        dac_link_settle(l);
    if (l->upload == DAC_LINK_CHECKING)
        dac_link_check_on(l);
    /* While an answer is sent, received bytes stay in the ring, so that there is room for each answer. */
    if (!l->sending && (l->commit_due || l->aborts_due)) {
        dac_link_send_late(l);
    } else if (!l->sending) {
        for (unsigned left = DAC_LINK_SLICE; left != 0 && received(l) != 0; left--) {
            const dac_link_read read = dac_link_read_byte(&l->reader, next_byte(l));
            if (read == DAC_LINK_BAD)
                l->bad_frames++;
            if (read == DAC_LINK_GOOD) {
                judge(l);
                break;
            }
        }
    }
    return l->upload == DAC_LINK_CHECKING || (!l->sending && (l->commit_due || l->aborts_due || received(l) != 0));
}
