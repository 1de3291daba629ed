/* The device's end of the serial protocol (docs/protocol.md): new programs for a sequencer that goes on playing.
 *
 * C99, static, no heap, no C library. All is in one dac_link that the application owns, and in the tables that its
 * configuration names:
 *
 *     static dac_link link;
 *     dac_sequencer_init(&sequencer, &config.x.converter, &config.y.converter);
 *     dac_link_init(&link, &config, &sequencer, boot_count);
 *     ... interrupt of the UART: dac_link_receive(&link, byte)
 *     for (;;) {
 *         dac_link_work(&link);
 *         if (uart_has_room() && (byte = dac_link_transmit(&link)) >= 0)
 *             uart_put((uint8_t)byte);
 *     }
 *
 * WHO MAY CALL WHAT. The link is a producer of its sequencer: dac_link_work() belongs where dac_sequencer_commit()
 * does. The application may arm, trigger and park there as well; programs, after the first, are the link's alone.
 * dac_link_receive() may interrupt everything but itself, and so may dac_link_transmit(). Nothing disables interrupts.
 */
#ifndef DAC_LINK_H
#define DAC_LINK_H

#include "dac_link_frame.h"
#include "dac_link_mac.h"
#include "dac_sequencer.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifndef DAC_LINK_RING
#define DAC_LINK_RING 2048 /* bytes that wait for dac_link_work(): a power of two, 512..32768; 256 a frame */
#endif
#ifndef DAC_LINK_SLICE
#define DAC_LINK_SLICE 64 /* words, or bytes of the line, that dac_link_work() looks at in a call */
#endif

#define DAC_LINK_ABORTS 8 /* as many as wait for a tick */

/* Beyond these no program may go: straight binary codes, codes a tick, codes at a change of programs. */
typedef struct {
    uint32_t code_min, code_max, max_step, max_jump;
} dac_link_limits;

/* What there is of an axis. */
typedef struct {
    dac_converter converter;
    dac_link_limits limits;
    uint8_t word_bits;  /* of a table word, 8..24; more than 16 need DAC_TABLE_STORAGE_BITS 32 */
    uint8_t index_bits; /* a table has up to 2^index_bits words, 3..16 */
    dac_word *table[2]; /* so many words each; one is written while the other one plays */
    int32_t *fourier;   /* 2 harmonics + 1 words */
} dac_link_axis;

typedef struct {
    dac_link_axis x, y;
    uint16_t harmonics;       /* most of an axis, up to 4096; 0: tables alone */
    uint8_t sine_index_bits;  /* at least the index_bits of both axes */
    const int32_t *sine;      /* NAME_sine, as dac_synthesize() wants it */
    uint32_t update_rate_hz;  /* 0: not known */
    uint8_t window;           /* frames that may be on the way; 0: as many as the ring has room for */
    uint8_t key_bytes;        /* 16..32, or 0: no key */
    const uint8_t *key;
    const uint8_t *hash;      /* 32 bytes, of the program that comes with the firmware, or NULL: not known */
    bool (*permits)(void);    /* the interlock, or NULL: there is none */
    void (*random)(uint8_t bytes[16]); /* for challenges, or NULL: they come from key and boot count */
} dac_link_config;

/* From here on to the functions: private, and here only so that the application can place it. */

/* An image: what BEGIN said of it, and its program words. Its tables are where the configuration says. */
typedef struct {
    uint8_t info[48];
    uint8_t program[192];
} dac_link_image;

/* A place in an image. */
typedef struct {
    uint8_t part;  /* 0 program words, 1 x, 2 y, 3 behind them */
    uint8_t byte;  /* of the word */
    uint32_t word; /* of the part */
    uint32_t held; /* the bytes of a word that are there already */
} dac_link_place;

/* What stands in an image for an axis. */
typedef struct {
    uint32_t words; /* that were sent: of the table, or Fourier words */
    uint8_t bytes;  /* of each */
    uint16_t harmonics; /* 0: a table */
} dac_link_part;

/* What is said to a request that acts; its answer, if it has one yet. */
typedef struct {
    bool known; /* there is such a request */
    uint8_t request, seq;
    uint8_t type, length; /* of the answer; type 0: not yet */
    uint8_t payload[32];
} dac_link_memory;

/* The checks of a program, in slices. */
typedef struct {
    uint8_t stage, axis;
    uint32_t at;               /* word, or advance */
    uint32_t phase, remainder; /* of the advance */
    int32_t first, before;     /* codes */
    uint32_t steepest, rise;   /* of a table */
    int32_t lowest, highest;   /* words of the table of y that plays */
    uint64_t sum;
    uint32_t crc;
    dac_link_place place;
} dac_link_check;

typedef struct {
    const dac_link_config *config;
    dac_sequencer *sequencer;
    uint32_t boot, bad_frames;
    dac_link_limits x_limits, y_limits; /* in force */

    /* session */
    bool opened;
    uint32_t session;
    dac_link_memory last, before_commit;

    /* upload */
    uint8_t upload;        /* as STATUS has it */
    uint8_t idle, playing; /* of the two images and tables */
    bool uploaded;         /* the program that plays came by the link */
    uint32_t received;
    uint32_t taken_generation, taken_line; /* when it came into force */
    dac_link_place place;
    dac_link_part x_part, y_part;
    dac_link_image image[2];

    /* a COMMIT at work, and ABORTs that wait with it */
    bool committing, commit_is_last, commit_due, abort_is_last, aborts_due;
    uint8_t commit_seq, commit_type, commit_length, commit_payload[8];
    uint8_t aborts, aborts_said, abort_seq[DAC_LINK_ABORTS];
    uint32_t commit_session, abort_session[DAC_LINK_ABORTS], abort_generation;
    uint32_t swaps, line; /* before the one that waits */
    dac_link_check check;

    /* key */
    bool challenged, commit_challenged, commit_tagged;
    uint32_t challenges;
    uint8_t nonce[16], commit_nonce[16], commit_tag[16];
    dac_link_mac digest;

    dac_link_reader reader;
    /* what leaves: dac_link_work() fills it, dac_link_transmit() empties it */
    volatile uint8_t sending;
    uint16_t out_at, out_length;
    uint8_t out[256];
    /* what comes: dac_link_receive() writes head and lost, dac_link_work() freed */
    volatile uint8_t freed;
    volatile uint16_t head;
    volatile uint32_t lost;
    uint16_t tail;
    volatile uint8_t ring[DAC_LINK_RING];
} dac_link;

/* After dac_sequencer_init(), and before the interrupt of the UART is enabled. `boot` should be another one at each
 * start. The program of the firmware is loaded and committed by the application. */
void dac_link_init(dac_link *l, const dac_link_config *config, dac_sequencer *sequencer, uint32_t boot);

/* A byte from the line: interrupt. False: there was no room, and it is lost and counted. */
bool dac_link_receive(dac_link *l, uint8_t byte);

/* From the main loop, again and again: a bounded piece of what is to be done. True if there may be more. */
bool dac_link_work(dac_link *l);

/* The next byte for the line, or -1: main loop, or the interrupt of a UART that can take one. */
int dac_link_transmit(dac_link *l);

#ifdef __cplusplus
}
#endif

#endif
