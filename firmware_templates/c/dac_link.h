/* The device side of the serial protocol (docs/protocol.md): loads new programs while the sequencer plays.
 *
 * C99, static, no heap, no C library. All memory is in one dac_link, which the application owns, and in the tables
 * that its configuration names:
 *
 *     static dac_link link;
 *     dac_sequencer_init(&sequencer, &config.x.converter, &config.y.converter);
 *     if (dac_link_init(&link, &config, &sequencer, boot_count) != DAC_LINK_STARTED)
 *         ... the configuration is wrong
 *     ... interrupt of the UART: dac_link_receive(&link, byte)
 *     for (;;) {
 *         dac_link_work(&link);
 *         if (uart_has_room() && (byte = dac_link_transmit(&link)) >= 0)
 *             uart_put((uint8_t)byte);
 *     }
 *
 * WHO MAY CALL WHAT. The link is a producer of its sequencer: dac_link_work() belongs where dac_sequencer_commit()
 * does. The application may arm, trigger and park there as well; only the link loads programs after the first.
 * dac_link_receive() may interrupt everything but itself, and so may dac_link_transmit(). Nothing disables interrupts.
 */
#ifndef DAC_LINK_H
#define DAC_LINK_H

#include "dac_link_frame.h"
#include "dac_link_mac.h"
#include "dac_sequencer.h"
#if DAC_STORE
#include "dac_store.h"
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define DAC_LINK_ABORTS 8 /* ABORTs that can wait for a tick */

/* Limits of every program: straight binary codes, codes per tick, codes at a change of programs. */
typedef struct {
    uint32_t code_min, code_max, max_step, max_jump;
} dac_link_limits;

#if DAC_SLOW_PART
#define DAC_LINK_PARTS 5 /* of an axis in an image: its table, and the words of a slow part */
/* Words of memory of a slow table. */
#define DAC_LINK_SLOW_ROOM(index_bits) ((UINT32_C(1) << (index_bits)) + 3)

/* Memory of the slow part of an axis. */
typedef struct {
    int8_t *second;  /* 2^index_bits of the axis */
    dac_word *table; /* DAC_LINK_SLOW_ROOM(slow_index_bits) */
    int32_t *gains;  /* slow_knots */
    int16_t *ratios; /* slow_knots */
} dac_link_slow;
#else
#define DAC_LINK_PARTS 1
#endif
#define DAC_LINK_MOVES_SLOW (DAC_MOVE && DAC_SLOW_PART)
#define DAC_LINK_Y_PARTS (DAC_LINK_PARTS + DAC_PIXEL_TABLE) /* those of y, then a table of pixels */

/* The resources of an axis. */
typedef struct {
    dac_converter converter;
    dac_link_limits limits;
    uint8_t word_bits;  /* bits of a table word, 8..24; more than 16 need DAC_TABLE_STORAGE_BITS 32 */
    uint8_t index_bits; /* a table has up to 2^index_bits words, 3..16 */
    uint32_t room;      /* words of memory of each table: DAC_TABLE_ROOM(index_bits) or more */
    dac_word *table[2]; /* one is written while the other one plays */
    int32_t *fourier;   /* 2 harmonics + 1 words */
#if DAC_SLOW_PART
    dac_link_slow slow[2]; /* as the tables; unused without slow_knots */
    dac_word *mixed;       /* `room` words for the line that plays, of this axis alone */
#endif
#if DAC_LINK_MOVES_SLOW
    int32_t *moved_gains[2]; /* slow_knots words each, for MOVE; all NULL: programs with slow parts are not moved */
#endif
} dac_link_axis;

typedef struct {
    dac_link_axis x, y;
    uint16_t harmonics;       /* maximum per axis, up to 4096; 0: tables only */
    uint8_t sine_index_bits;  /* at least the index_bits of both axes */
    const int32_t *sine;      /* NAME_sine, for dac_synthesize() */
    uint32_t update_rate_hz;  /* 0: unknown */
#if DAC_SLOW_PART
    uint8_t slow_knots;       /* maximum knots of a slow part, 2..65; 0: the link takes no slow parts */
    uint8_t slow_index_bits;  /* of the longest slow table, 3..14 */
#endif
#if DAC_PIXEL_TABLE
    uint16_t table_pixels;    /* maximum pixels of a table of pixels; 0: the link takes no such tables */
    uint16_t *pixel_ticks[2]; /* 2 table_pixels words each; one is written while the other one plays */
#endif
    uint8_t window;           /* frames that the host may send without an answer; 0: as many as the ring holds */
    uint8_t key_bytes;        /* 16..32, or 0: no key */
    const uint8_t *key;
    const uint8_t *hash;      /* 32 bytes: hash of the program in the firmware, or NULL: unknown */
    bool (*permits)(void);    /* the interlock, or NULL: no interlock */

    /* With a key; docs/protocol.md, "The key", says what it protects from. A request that was recorded must never be
     * right again: each challenge is made of the identity, the boot count, a counter and random numbers. */
    const uint8_t *identity;  /* what no other device with this key has, such as the serial number of the processor */
    uint8_t identity_bytes;   /* 4..32 */
    bool boot_persists;       /* the boot count is kept without power, and never comes twice */
    void (*random)(uint8_t bytes[16]); /* numbers that nobody can foresee; NULL only if boot_persists */
    uint32_t (*milliseconds)(void);    /* a clock that wraps at 2^32: a challenge expires after DAC_LINK_CHALLENGE_MS */

#if DAC_STORE
    dac_store *store;         /* opened by dac_store_open() as DAC_STORE_DONE; NULL: no programs are kept */
    bool store_while_playing; /* flash can be written while a scan plays; otherwise the scan is to be parked first */
#endif
#if DAC_LINK_Z
    /* With z: keeps out the interrupt that steps both sequencers, and lets it in again. The link calls it in pairs,
     * with a few hundred instructions between them at most. */
    void (*stop_ticks)(bool stopped);
#endif
#if DAC_LIBRARY
    const dac_library_entry *library; /* compiled programs, as LIBRARY_library of LIBRARY_library.h */
    uint32_t library_programs;        /* how many; 0: none */
#endif
} dac_link_config;

/* Why a link was not started. */
typedef enum {
    DAC_LINK_STARTED = 0,
    DAC_LINK_BAD_AXIS,    /* converter, limits, word_bits, index_bits, room or tables of an axis; or DAC_PROGMEM */
    DAC_LINK_BAD_FOURIER, /* harmonics above 4096 or without memory, or a sine that is missing or too short */
    DAC_LINK_BAD_KEY,     /* not 16..32 bytes */
    DAC_LINK_NO_IDENTITY, /* a key, but no identity of 4..32 bytes */
    DAC_LINK_NO_RANDOM,   /* a key, but neither `random` nor boot_persists: challenges would come again after a start */
    DAC_LINK_NO_CLOCK,    /* a key, but no `milliseconds`: challenges would last for ever */
    DAC_LINK_BAD_SLOW,    /* slow_knots or slow_index_bits out of range, or memory of slow parts missing or shared */
    DAC_LINK_BAD_PIXEL_TABLE /* table_pixels without memory, or with shared memory */
#if DAC_LINK_Z
    , DAC_LINK_BAD_Z /* a z without a link that was started, with a key, harmonics or an interlock, or no stop_ticks */
#endif
} dac_link_started;

/* Private, down to the functions. It is declared here so that the application can allocate it. */

/* An image: the announcement of BEGIN, and the program words. The tables are in the memory of the configuration. */
typedef struct {
    uint8_t info[48];
    uint8_t program[192];
} dac_link_image;

/* A position in an image. */
typedef struct {
    uint8_t part;  /* 0 program words, the DAC_LINK_PARTS of x, the DAC_LINK_Y_PARTS of y, DAC_LINK_END behind them */
    uint8_t byte;  /* byte of the word */
    uint32_t word; /* word of the part */
    uint32_t held; /* the bytes of a word that were received already */
} dac_link_place;

#define DAC_LINK_END (1 + DAC_LINK_PARTS + DAC_LINK_Y_PARTS)

/* A part of an image for an axis. */
typedef struct {
    uint32_t words; /* number of words: table words, or Fourier words */
    uint8_t bytes;  /* bytes per word */
    uint16_t harmonics; /* 0: a table */
} dac_link_part;

/* The last request that acts, and its answer, if it has one. */
typedef struct {
    bool known; /* there is such a request */
    uint8_t request, seq;
    uint8_t type, length; /* type and length of the answer; type 0: no answer yet */
    uint8_t payload[32];
} dac_link_memory;

/* The checks of a program, in slices. */
typedef struct {
    uint8_t stage, axis;
    uint32_t at;               /* word, or advance */
    uint32_t phase, remainder; /* phase and remainder of the advance */
    int32_t first, before;     /* codes */
    uint32_t steepest, rise;   /* of a table */
    int32_t lowest, highest;   /* words of the table of y that plays, or of a line */
#if DAC_SLOW_PART
    bool exact;                /* the ticks of the line are checked, not its words */
    uint32_t line;
#endif
    uint64_t sum;
    uint32_t crc;
    dac_link_place place;
} dac_link_check;

#if DAC_LINK_Z
#define DAC_LINK_STRUCT dac_link
#else
#define DAC_LINK_STRUCT
#endif

typedef struct DAC_LINK_STRUCT {
    const dac_link_config *config;
    dac_sequencer *sequencer;
    uint32_t boot, bad_frames;
    dac_link_limits x_limits, y_limits; /* the active limits */

    /* session */
    bool opened;
    uint32_t session;
    dac_link_memory last, before_commit;

    /* upload */
    uint8_t upload;        /* as STATUS has it */
    uint8_t idle, playing; /* which of the two images and tables */
    bool uploaded;         /* the program that plays came by the link */
    uint32_t received;
    uint32_t taken_generation, taken_line; /* when the program became active */
    dac_link_place place;
    dac_link_part x_part[DAC_LINK_PARTS], y_part[DAC_LINK_Y_PARTS];
#if DAC_SLOW_PART
    dac_slow_part slow[DAC_MOVE ? 4 : 2][2]; /* of both images, then of two moves: those of x and y */
#endif
    dac_link_image image[DAC_MOVE ? 3 : 2]; /* the third is that of a MOVE, with the tables that play */

    /* a COMMIT in progress, and ABORTs that wait with it */
    bool committing, commit_is_last, commit_due, abort_is_last, aborts_due;
    uint8_t commit_seq, commit_type, commit_length, commit_payload[8];
#if DAC_COMMIT_MODES
    uint8_t commit_mode;
    bool commit_has_mode;
#endif
    uint8_t aborts, aborts_said, abort_seq[DAC_LINK_ABORTS];
    uint32_t commit_session, abort_session[DAC_LINK_ABORTS], abort_generation;
    uint32_t swaps, line; /* before the committed program */
    dac_link_check check;

    /* key */
    bool challenged, commit_challenged, commit_tagged;
    uint32_t challenges, challenged_at; /* how many, and milliseconds() of the last one */
    uint8_t nonce[16], commit_nonce[16], commit_tag[16];
    dac_link_mac digest;

#if DAC_MOVE
    bool moving, moved;    /* a MOVE is checked or waits; the program that plays was moved */
    uint8_t moved_slow;    /* which of the two moved slow parts was taken last; the next MOVE has the other one */
    uint8_t upload_before; /* `upload` without the MOVE */
#endif

#if DAC_STORE || DAC_LIBRARY
    bool loading; /* a program of the device is checked or waits: it has no tag, and no COMMIT to be answered */
#endif
#if DAC_LIBRARY > 1
    bool asked; /* and a PLAY is to be answered */
#endif
#if DAC_STORE
    uint8_t kept, kept_refused; /* slot of this start, or DAC_STORE_NONE; why it is not the one that was due */
#endif

#if DAC_LINK_Z
    struct dac_link *z; /* of the second sequencer; NULL without one */
    bool is_z;          /* this is that one */
    bool has_z;         /* the upload */
    bool plays_z;       /* the program that plays or is committed */
    bool played_z;      /* the one before */
    bool checks_z;      /* x and y have passed */
#endif

    dac_link_reader reader;
    /* output: dac_link_work() fills it, dac_link_transmit() empties it */
    volatile uint8_t sending;
    uint16_t out_at, out_length;
    uint8_t out[256];
    /* input: dac_link_receive() writes head and lost, dac_link_work() writes freed */
    volatile uint8_t freed;
    volatile uint16_t head;
    volatile uint32_t lost;
    uint16_t tail;
    volatile uint8_t ring[DAC_LINK_RING];
} dac_link;

/* Call it after dac_sequencer_init(), and before the interrupt of the UART is enabled. `boot` should differ from start
 * to start. The application loads and commits the program of the firmware. A link that was not started is silent. */
dac_link_started dac_link_init(dac_link *l, const dac_link_config *config, dac_sequencer *sequencer, uint32_t boot);

#if DAC_LINK_Z
/* Gives a link that was started a second sequencer, whose x is z: `z` is a link of its own with the memory of this
 * sequencer, and with no line: its receive buffer is not used. `config` of it has neither key, harmonics, tables of
 * pixels nor interlock. `plays`: the program of the firmware, which the application loads and commits, has z. */
dac_link_started dac_link_init_z(dac_link *l, dac_link *z, const dac_link_config *config, dac_sequencer *sequencer,
                                 bool plays);

/* Requests of the application to both sequencers, between the same two ticks; a trigger leaves out a z that rests.
 * Called where dac_link_work() is. False: there is no room in a queue, and neither sequencer has the request. */
bool dac_link_arm(dac_link *l, uint32_t frames);
bool dac_link_trigger(dac_link *l);
bool dac_link_park(dac_link *l);
#endif

#if DAC_STORE
/* Loads and commits the kept program that is due, if it passes the checks of an upload. Call it after dac_link_init(),
 * in place of loading the program of the firmware; if it returns false, load that one. */
bool dac_link_load_kept(dac_link *l);
#endif

#if DAC_LIBRARY
/* The programs of the device under one number: the compiled ones from 0 on, as in LIBRARY_library.h, then the slots of
 * the store. Called where dac_link_work() is. */

typedef struct {
    const char *name; /* of a compiled program; NULL: a kept one, which has none */
    uint8_t hash[32]; /* of its plan, as STATUS has that of what plays */
} dac_link_listing;

/* Numbers of compiled programs and slots. */
uint32_t dac_link_numbers(const dac_link *l);

/* Describes a program. False: there is no such number, or nothing good in this slot. */
bool dac_link_list(const dac_link *l, uint32_t number, dac_link_listing *listing);

/* The number of the first program that has this name, or a hash that begins with these 12 to 64 digits, a to f in lower
 * case; or -1. */
int32_t dac_link_find(const dac_link *l, const char *name);

/* Plays a program as if a host uploaded it: it is checked, and takes the place of the one that plays at a line. False:
 * the number has no program that suits the device, the interlock is open, or an upload or another program is on its
 * way. dac_link_work() does the rest; STATUS has the hash of what plays. */
bool dac_link_play(dac_link *l, uint32_t number);

#if DAC_COMMIT_MODES
/* The same with the mode of the commit. Where the frame cannot go on with DAC_COMMIT_KEEP, the old program plays on. */
bool dac_link_play_at(dac_link *l, uint32_t number, dac_commit_mode mode);
#endif
#endif

/* Takes a received byte; called by the interrupt. False: the buffer was full; the byte is lost and counted. */
bool dac_link_receive(dac_link *l, uint8_t byte);

/* Does a bounded piece of work, but for requests about kept programs, which take as long as their flash; the main loop
 * calls it repeatedly. Returns true if there may be more to do. */
bool dac_link_work(dac_link *l);

/* Returns the next byte to send, or -1. Called by the main loop, or by the interrupt of a UART that is ready to
 * send. */
int dac_link_transmit(dac_link *l);

#ifdef __cplusplus
}
#endif

#endif
