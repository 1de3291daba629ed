/* Private to the link: requests and answers, the key, an image in memory, and its checks. */
#ifndef DAC_LINK_PARTS_H
#define DAC_LINK_PARTS_H

#include "dac_link.h"

enum { DAC_LINK_HELLO = 1, DAC_LINK_BEGIN, DAC_LINK_DATA, DAC_LINK_COMMIT, DAC_LINK_ABORT, DAC_LINK_STATUS,
       DAC_LINK_READ, DAC_LINK_PARK, DAC_LINK_ARM, DAC_LINK_TRIGGER, DAC_LINK_CLEAR, DAC_LINK_CHALLENGE,
       DAC_LINK_LIMITS, DAC_LINK_SLOT, DAC_LINK_SAVE, DAC_LINK_SELECT, DAC_LINK_CONFIRM, DAC_LINK_DELETE,
       DAC_LINK_MOVE, DAC_LINK_LIST, DAC_LINK_PLAY };
enum { DAC_LINK_ANSWER = 0x80, DAC_LINK_REFUSAL = 0xFF };

/* Why a request is refused; docs/protocol.md, "Reasons". */
enum {
    DAC_LINK_NO_REASON,
    DAC_LINK_TYPE,
    DAC_LINK_PAYLOAD,
    DAC_LINK_VERSION,
    DAC_LINK_SESSION,
    DAC_LINK_OLD,
    DAC_LINK_KEY,
    DAC_LINK_BUSY,
    DAC_LINK_UPLOAD,
    DAC_LINK_SHAPE,
    DAC_LINK_LENGTH,
    DAC_LINK_HARMONICS,
    DAC_LINK_INCOMPLETE,
    DAC_LINK_INTERLOCK,
    DAC_LINK_IMAGE,
    DAC_LINK_SCHEDULE,
    DAC_LINK_PERIOD,
    DAC_LINK_OUTPUT,
    DAC_LINK_CODES,
    DAC_LINK_STEP,
    DAC_LINK_FOURIER,
    DAC_LINK_WORD,
    DAC_LINK_RANGE,
    DAC_LINK_SLEW,
    DAC_LINK_JUMP,
    DAC_LINK_WITHDRAWN,
    DAC_LINK_READBACK,
    DAC_LINK_TICKS,
    DAC_LINK_REFUSED,
    DAC_LINK_SHAPING,
    DAC_LINK_KEEP,
    DAC_LINK_NO_SLOT,
    DAC_LINK_ROOM,
    DAC_LINK_NOT_PARKED,
    DAC_LINK_GENERATION,
    DAC_LINK_NO_TRIAL,
    DAC_LINK_FLASH,
    DAC_LINK_PIXEL_TICKS,
    DAC_LINK_SLOW_PART,
    DAC_LINK_NO_NUMBER
};

typedef struct {
    uint8_t reason; /* or DAC_LINK_NO_REASON */
    uint32_t detail;
} dac_link_finding;

/* An answer that is being made. */
typedef struct {
    uint8_t type, seq, length;
    uint32_t session;
    uint8_t *payload; /* up to 244 bytes */
} dac_link_answer;
#define DAC_LINK_SILENT 0 /* in place of the type: the answer comes later */
#define DAC_LINK_TAG 16   /* bytes of a tag */

static inline dac_link_finding dac_link_because(uint8_t reason, uint32_t detail)
{
    const dac_link_finding found = {reason, detail};
    return found;
}

static inline dac_link_finding dac_link_fine(void)
{
    return dac_link_because(DAC_LINK_NO_REASON, 0);
}

static inline void dac_link_copy(uint8_t *to, const uint8_t *from, unsigned count)
{
    for (unsigned i = 0; i < count; i++)
        to[i] = from[i];
}

/* Always compares all bytes, so that the time does not depend on them. */
static inline bool dac_link_same(const uint8_t *a, const uint8_t *b, unsigned count)
{
    unsigned differ = 0;
    for (unsigned i = 0; i < count; i++)
        differ |= (unsigned)(a[i] ^ b[i]);
    return differ == 0;
}

/* The values of `upload` in STATUS. */
enum { DAC_LINK_NONE, DAC_LINK_RECEIVING, DAC_LINK_CHECKING, DAC_LINK_WAITING };

/* The announcement of an image in BEGIN. */
enum { DAC_LINK_HASH = 0, DAC_LINK_BYTES = 32, DAC_LINK_IMAGE_CRC = 36, DAC_LINK_SHAPES = 40 };
#define DAC_LINK_PROGRAM 192 /* bytes of the program words */
#define DAC_LINK_INFO 48     /* bytes of an announcement */
#if DAC_LINK_Z
#define DAC_LINK_Z_INFO 12                 /* behind it: bytes of the image of z, and its shapes */
#define DAC_LINK_OF_Z (UINT32_C(1) << 31) /* in the detail of a refusal */
#endif

/* Words of the pages. */
enum { DAC_LINK_LINE_TICKS, DAC_LINK_FRAME_LINES, DAC_LINK_SETTLE_LINES, DAC_LINK_TURN_TICK, DAC_LINK_FORWARD,
       DAC_LINK_BACKWARD = 6, DAC_LINK_UP = 8, DAC_LINK_DOWN = 10, DAC_LINK_PIXELS = 12, DAC_LINK_Y_STEPS,
       DAC_LINK_PIXEL_WORD };
enum { DAC_LINK_PHASE_STEP, DAC_LINK_PHASE_REMAINDER, DAC_LINK_PHASE_PERIOD, DAC_LINK_GAIN, DAC_LINK_OFFSET_LOW,
       DAC_LINK_OFFSET_HIGH, DAC_LINK_CODE_MIN, DAC_LINK_CODE_MAX, DAC_LINK_MAX_STEP, DAC_LINK_PARK_CODE,
       DAC_LINK_ORDER, DAC_LINK_SHAPING_WORD, DAC_LINK_SLOW_WORD, DAC_LINK_KNOT_SPACING, DAC_LINK_SLOW_STEP,
       DAC_LINK_SLOW_REMAINDER };

static inline bool dac_link_permits(const dac_link *l)
{
    return l->config->permits == NULL || l->config->permits();
}

static inline const dac_link_axis *dac_link_axis_of(const dac_link *l, unsigned axis)
{
    return axis == 0 ? &l->config->x : &l->config->y;
}

/* Which of the two tables the image has that is received or checked. */
static inline uint8_t dac_link_tables(const dac_link *l)
{
#if DAC_MOVE
    return l->moving ? l->playing : l->idle;
#else
    return l->idle;
#endif
}

/* A program word: page 0 is the scan's, 1 and 2 are those of x and y. */
static inline uint32_t dac_link_program_word(const dac_link_image *image, unsigned page, unsigned word)
{
    return dac_link_get(image->program + 64 * page + 4 * word);
}

/* index_bits, word_bits, dac_bits of an axis, and a zero; DAC_CUBIC is part of the index_bits. */
static inline const uint8_t *dac_link_shape(const dac_link_image *image, unsigned axis)
{
    return image->info + DAC_LINK_SHAPES + 4 * axis;
}

/* The index_bits without DAC_CUBIC. */
static inline unsigned dac_link_index_bits(const dac_link_image *image, unsigned axis)
{
    return dac_link_shape(image, axis)[0] & (DAC_SPLINE ? DAC_CUBIC - 1u : 255u);
}

#if DAC_SLOW_PART
enum { DAC_LINK_MOVED_SLOW = 2 }; /* where the slow parts of moves begin */

/* Where the slow parts are of the image that is received or checked. */
static inline unsigned dac_link_slow_at(const dac_link *l)
{
#if DAC_MOVE
    return l->moving ? DAC_LINK_MOVED_SLOW + 1u - l->moved_slow : l->idle;
#else
    return l->idle;
#endif
}
#endif

#if DAC_PIXEL_TABLE
/* The word that says whether an image has a table of pixels; 0 on a device that has no memory for one. */
static inline uint32_t dac_link_pixel_word(const dac_link *l, const dac_link_image *image)
{
    return l->config->table_pixels != 0 ? dac_link_program_word(image, 0, DAC_LINK_PIXEL_WORD) : 0;
}
#endif

/* The word that describes the slow part of an axis; 0 without one, and on a device that has none. */
static inline uint32_t dac_link_slow_word(const dac_link *l, const dac_link_image *image, unsigned axis)
{
#if DAC_SLOW_PART
    return l->config->slow_knots != 0 ? dac_link_program_word(image, axis + 1, DAC_LINK_SLOW_WORD) : 0;
#else
    (void)l;
    (void)image;
    (void)axis;
    return 0;
#endif
}

/* The offset word of an axis, from its two words. */
static inline int64_t dac_link_offset_word(const dac_link_image *image, unsigned axis)
{
    return (int64_t)(int32_t)dac_link_program_word(image, axis + 1, DAC_LINK_OFFSET_HIGH) * (INT64_C(1) << 18)
         + dac_link_program_word(image, axis + 1, DAC_LINK_OFFSET_LOW);
}

/* dac_link_answer.c */

void dac_link_refuse(dac_link_answer *a, uint8_t request, dac_link_finding why);

/* Stores the answer to a request that acts, and repeats it if the request is repeated. */
void dac_link_remember(dac_link *l, uint8_t type, const uint8_t *payload, uint8_t length);
void dac_link_recall(const dac_link *l, dac_link_answer *a);

/* Sends an answer; nothing else may be in transmission. */
void dac_link_send(dac_link *l, const dac_link_answer *a);

/* Answers that had to wait, one a call: there is one if commit_due or aborts_due. */
void dac_link_send_late(dac_link *l);

/* dac_link_key.c */

/* Whether a configuration has all that its key needs. */
dac_link_started dac_link_judge_key(const dac_link_config *config);

/* Forgets a challenge that is too old. */
void dac_link_expire(dac_link *l);

/* Whether a tag is that of a request under the key. `digest`: the 32 bytes of a COMMIT, or NULL. */
bool dac_link_tagged(const dac_link *l, const uint8_t *nonce, const uint8_t *request, uint8_t bytes,
                     const uint8_t *digest, const uint8_t *tag);

/* dac_link_image.c */

/* Number of words of a table. */
uint32_t dac_link_table_words(const dac_link_image *image, unsigned axis);

/* Maximum bytes of an image. */
uint32_t dac_link_most_bytes(const dac_link_config *config);

/* The next byte of the upload goes to its place. What is found is found once the program words are complete. */
dac_link_finding dac_link_store(dac_link *l, uint8_t byte);

/* The next byte of the upload from where it stands in memory. */
uint8_t dac_link_load_byte(const dac_link *l, dac_link_place *at);

/* Bytes of the image of the tables that play, by offset; returns how many there are up to its end. */
uint8_t dac_link_read_back(const dac_link *l, uint32_t offset, uint8_t *bytes, uint8_t count);

#if DAC_LINK_Z
/* Bytes of the image that dac_link_read_back() reads. */
uint32_t dac_link_read_back_bytes(const dac_link *l);
#endif

/* The program as the sequencer wants it. */
void dac_link_program_of(const dac_link *l, dac_program *program);

/* dac_link_check.c */

static inline void dac_link_start_check(dac_link_check *c)
{
    unsigned char *const bytes = (unsigned char *)c;

    for (size_t i = 0; i < sizeof *c; i++)
        bytes[i] = 0;
}

/* The checks of a commit, a slice a call, from a check of all zeros on: a reason, or whether all have *passed. */
dac_link_finding dac_link_check_work(dac_link *l, bool *passed);

/* Requests, by what they do: a finding, or an answer's payload in *a. */
dac_link_finding dac_link_hello(dac_link *l, uint32_t session, dac_link_answer *a);
dac_link_finding dac_link_status(const dac_link *l, dac_link_answer *a);
/* Bytes of the payload of a COMMIT without its tag: the CRC, and the mode behind it, which may be absent. */
static inline uint8_t dac_link_commit_bytes(uint8_t length)
{
    return DAC_COMMIT_MODES && (length == 5 || length == 5 + DAC_LINK_TAG) ? 5 : 4;
}

dac_link_finding dac_link_begin(dac_link *l, const uint8_t *info, dac_link_answer *a);
dac_link_finding dac_link_data(dac_link *l, const uint8_t *payload, uint8_t length, dac_link_answer *a);
dac_link_finding dac_link_commit(dac_link *l, const uint8_t *payload, uint8_t length, dac_link_answer *a);
dac_link_finding dac_link_abort(dac_link *l, dac_link_answer *a);
dac_link_finding dac_link_readback(const dac_link *l, const uint8_t *payload, dac_link_answer *a);
dac_link_finding dac_link_challenge(dac_link *l, dac_link_answer *a);
dac_link_finding dac_link_set_limits(dac_link *l, const uint8_t *payload, uint8_t length, dac_link_answer *a);

#if DAC_LINK_Z
/* dac_link_z.c: of both sequencers, or of x and y alone where there is no z */

static inline dac_link_finding dac_link_of_z(dac_link_finding found)
{
    return found.reason == DAC_LINK_NO_REASON ? found : dac_link_because(found.reason, found.detail | DAC_LINK_OF_Z);
}

dac_link_finding dac_link_begin_both(dac_link *l, const uint8_t *info, uint8_t length, dac_link_answer *a);
dac_link_finding dac_link_data_both(dac_link *l, const uint8_t *payload, uint8_t length, dac_link_answer *a);
dac_link_finding dac_link_commit_both(dac_link *l, const uint8_t *payload, uint8_t length, dac_link_answer *a);
dac_link_finding dac_link_readback_both(const dac_link *l, const uint8_t *payload, dac_link_answer *a);
bool dac_link_clear(dac_link *l);

/* A slice of the checks of both; *passed behind the last. */
dac_link_finding dac_link_check_both(dac_link *l, bool *passed);

/* Loads the program of z, if there is one, and hands both over by `commit`, between the same two ticks. */
dac_link_finding dac_link_hand_over(dac_link *l, dac_link_finding (*commit)(const dac_link *l));

/* Withdraws both programs that wait. */
bool dac_link_withdraw(dac_link *l);

/* What became of a program that waited is true of z too. */
void dac_link_settle_z(dac_link *l, bool taken);

/* Bytes that were received, of both. */
uint32_t dac_link_received(const dac_link *l);

/* What STATUS has of z; returns its bytes. */
uint8_t dac_link_put_z_status(const dac_link *l, uint8_t *at);
#endif

#if DAC_MOVE
/* dac_link_move.c */
#define DAC_LINK_MOVE_BYTES 28  /* generation; gain, offset low and high of x, then of y */
#define DAC_LINK_FACTOR_BYTES 8 /* behind them, for slow parts: factor of the gains of x, then of y */

/* Whether a link moves programs with slow parts. */
static inline bool dac_link_moves_slow(const dac_link_config *config)
{
#if DAC_LINK_MOVES_SLOW
    return config->slow_knots != 0 && config->x.moved_gains[0] != NULL;
#else
    (void)config;
    return false;
#endif
}

/* Bytes of the payload of a MOVE without its tag. */
static inline uint8_t dac_link_move_bytes(const dac_link_config *config, uint8_t length)
{
    const uint8_t most = DAC_LINK_MOVE_BYTES + DAC_LINK_FACTOR_BYTES;
    const bool has_factors = length == most || length == most + DAC_LINK_TAG;

    return has_factors && dac_link_moves_slow(config) ? most : DAC_LINK_MOVE_BYTES;
}

dac_link_finding dac_link_move(dac_link *l, const uint8_t *payload, uint8_t length, dac_link_answer *a);

/* The sequencer plays the moved program. */
void dac_link_take_move(dac_link *l);

/* The MOVE in progress has an answer; the upload is as it was, or forgotten if the MOVE was withdrawn. */
void dac_link_end_move(dac_link *l, bool withdrawn);
#endif

#if DAC_STORE
/* dac_link_kept.c */

#if DAC_LIBRARY
/* Puts the image of a slot where an upload goes. */
dac_link_finding dac_link_load_slot(dac_link *l, uint8_t slot);
#endif

dac_link_finding dac_link_slot(const dac_link *l, const uint8_t *payload, dac_link_answer *a);
dac_link_finding dac_link_save(dac_link *l, const uint8_t *payload);
dac_link_finding dac_link_select(dac_link *l, const uint8_t *payload);
dac_link_finding dac_link_confirm(dac_link *l);
dac_link_finding dac_link_delete(dac_link *l, const uint8_t *payload);
#endif

#if DAC_LIBRARY > 1
/* dac_link_library.c */
dac_link_finding dac_link_list_number(const dac_link *l, const uint8_t *payload, dac_link_answer *a);
dac_link_finding dac_link_play_number(dac_link *l, const uint8_t *payload, dac_link_answer *a);
#endif

/* dac_link_upload.c */

/* A slice of the checks; behind the last the program is loaded and committed. */
void dac_link_check_on(dac_link *l);

/* Finds out whether a committed program was taken. */
void dac_link_settle(dac_link *l);

#endif
