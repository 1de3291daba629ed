/* Plays compensated scan lines on a microcontroller: two axes from one counter, markers, slew guard, two banks.
 *
 * docs/sequencer.md of tablegen defines the arithmetic and what happens on which tick; every code, marker and fault
 * equals its integer model. C99, no heap, no C library. The compiler must provide int64_t, and an arithmetic >> of
 * negative numbers; C99 does not require these, but every compiler for such controllers has them.
 *
 *     #include "annexin_200nm_program.h"
 *     static dac_sequencer sequencer;
 *
 *     dac_sequencer_init(&sequencer, &annexin_200nm_x_converter, &annexin_200nm_y_converter);
 *     dac_sequencer_load(&sequencer, &annexin_200nm_program);
 *     dac_sequencer_commit(&sequencer);
 *     ... start a timer, or a DMA channel, whose interrupt calls dac_sequencer_step() or dac_sequencer_fill()
 *     dac_sequencer_arm(&sequencer, 0);
 *     dac_sequencer_trigger(&sequencer);
 *
 * WHO MAY CALL WHAT. A sequencer has one producer (the main loop, or whatever serves the link) and one consumer (the
 * interrupt that asks for samples), on one core or on two. Functions are marked with the side they belong to; those of
 * one side must not interrupt each other. Nothing disables interrupts, and neither side ever waits for the other.
 *
 * MEMORY ORDER. The producer writes a bank, then a request, then (DAC_RELEASE) the head of the queue of requests; the
 * consumer reads the head, then (DAC_ACQUIRE) the requests and the bank. The other way round the consumer stops to use
 * a bank, then (DAC_RELEASE) publishes what it waits for and the tail of the queue; the producer reads these, then
 * (DAC_ACQUIRE) writes. Each shared word has a single writer and is read and written at once. A bank is therefore never
 * written while it plays, and never played while it is written.
 */
#ifndef DAC_SEQUENCER_H
#define DAC_SEQUENCER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dac_config.h"

#ifdef __cplusplus
extern "C" {
#endif

#define DAC_CUBIC 128 /* of a cubic table: added to its index_bits */
/* Words of a table that stand behind its last one: its first ones again. */
#define DAC_WORDS_BEHIND (DAC_SPLINE ? 3 : 1)

#if DAC_TABLE_STORAGE_BITS == 16
typedef int16_t dac_word;
#elif DAC_TABLE_STORAGE_BITS == 32
typedef int32_t dac_word;
#else
#error "DAC_TABLE_STORAGE_BITS is 16 or 32"
#endif
#if DAC_OUTPUT_STORAGE_BITS == 16
typedef uint16_t dac_output;
#elif DAC_OUTPUT_STORAGE_BITS == 32
typedef uint32_t dac_output;
#else
#error "DAC_OUTPUT_STORAGE_BITS is 16 or 32"
#endif

/* Programs: what tablegen emits, with the names of its headers. */

/* A half-open interval: first <= k < first + count. */
typedef struct {
    uint32_t first, count;
} dac_window;

#if DAC_SLOW_PART
/* The slow part of an axis: what changes from line to line. Gain and ratio are straight between knots, `gain_spacing`
 * and `ratio_spacing` lines apart, of which the first is at line 0 and the last at the end of the frame or behind it.
 * All words stay where they are until the bank is idle again. */
typedef struct {
    const int32_t *gains;  /* at knots, signed 18 bits: they take the place of gain_word */
    const int16_t *ratios; /* at knots, 12 fraction bits; not used without `second` */
    const int8_t *second;  /* words mixed into the table, as many as its length; NULL: none */
    dac_word *mixed;       /* memory for the table of a line, length + DAC_WORDS_BEHIND words; unused without `second`.
                            * x and y need memory of their own, programs of one sequencer may share it */
    const dac_word *table; /* of the offset over a frame: words of a cubic table, then its first three again */
    uint32_t gain_spacing, ratio_spacing;
    uint8_t gain_knots, ratio_knots; /* 2..65 */
    uint8_t index_bits;              /* of this table, 3..14 */
    int32_t gain_word;               /* of this table, signed 18 bits */
    int64_t offset_word;             /* takes the place of that of the axis */
} dac_slow_part;
#endif

/* One axis. The table stays where it is, in flash or in memory of the application, until its bank is idle again. */
typedef struct {
    const dac_word *table; /* its words, then its first one again; of a cubic table its first three */
    uint32_t length;       /* words without these: 2^index_bits, or phase_period if not interpolated */
    uint8_t storage_bits;  /* bits of a word in memory: DAC_STORAGE_BITS(table) */
    uint8_t bits;          /* bits of a word, 8..24; it has min(4, 25 - bits) guard bits */
    uint8_t index_bits;    /* 3..16, or 0 if not interpolated; and DAC_CUBIC for a cubic table */
    uint32_t phase_period; /* advances per period, up to 2^31 - 1 */
    uint32_t hold_ticks;   /* ticks per advance: 1, or for y the ticks of a line */
    int32_t gain_word;     /* signed 18 bits */
    int64_t offset_word;   /* signed, codes with gain_q fraction bits, below 2^(dac_bits + 1) codes */
    uint8_t gain_q;        /* 16 + bits + guard bits - dac_bits */
    int32_t code_min, code_max, park_code; /* straight binary, 0 is the lowest voltage */
    int32_t max_step;      /* codes per tick, at least 1 */
    uint8_t dac_bits, word_bits;           /* bits of a code, 8..24, and of a converter word */
    bool twos_complement, left_aligned;
#if DAC_SHAPING
    uint8_t shaping_order; /* 0 off, 1 first, 2 second, 3 scanner; at most DAC_SHAPING */
    uint8_t shaping_zero;  /* 0..128, with order 3 only */
#endif
#if DAC_SLOW_PART
    const dac_slow_part *slow; /* NULL: none */
#endif
} dac_axis_program;

/* Words of memory of an interpolated table. */
#define DAC_TABLE_ROOM(index_bits) ((UINT32_C(1) << (index_bits)) + DAC_WORDS_BEHIND)

/* What both axes share. */
typedef struct {
    uint32_t line_ticks;  /* 1..2^24 */
    uint32_t frame_lines; /* line_ticks * frame_lines < 2^31 */
    uint32_t pixels;      /* pixels per window; not more than its ticks, unless it has none */
    uint32_t settle_lines;
    uint32_t turn_tick;           /* first tick of the backward sweep */
    dac_window forward, backward; /* ticks of a line */
    dac_window up, down;          /* lines of a frame */
#if DAC_PIXEL_TABLE
    /* Ticks of each pixel, at least 1: `pixels` of the forward window, then as many of the backward one; each add up to
     * the window's count. It stays where it is until the bank is idle again. NULL: pixels of equal length. */
    const uint16_t *pixel_table;
#endif
} dac_schedule;

typedef struct {
    dac_schedule schedule;
    dac_axis_program x, y;
} dac_program;

/* A program of a library: LIBRARY_library.h has an array of them. */
typedef struct {
    const char *name;    /* of the scan */
    const char *hash;    /* of its plan, as in manifest.json: 64 hexadecimal digits */
    dac_program program; /* for dac_sequencer_load() */
} dac_library_entry;

/* Initialiser for the program of an emitted header: DAC_PROGRAM(ANNEXIN_200NM, annexin_200nm). The names may be macros,
 * as of -DUP=ANNEXIN_200NM -Dlow=annexin_200nm: DAC_PROGRAM(UP, low). NAME_program.c of a build has it as an object. */
#if DAC_PIXEL_TABLE
/* With the table of the ticks of each pixel, if the header has one: NAME_PIXEL_TABLE is 1 then, and else not defined.
 * Before a 1, DAC_PIXELS_1 puts a comma between the words, so that the table is the second argument, not NULL. */
#define DAC_PROGRAM(NAME, name) DAC_ANY_PROGRAM(NAME, name)
#define DAC_ANY_PROGRAM(NAME, name) DAC_PROGRAM_OF(NAME, name, DAC_PIXELS(NAME##_PIXEL_TABLE, name##_pixel_table))
#define DAC_PIXELS(has_table, table) DAC_PIXELS_OF(has_table, table)
#define DAC_PIXELS_OF(has_table, table) DAC_SECOND(DAC_PIXELS_##has_table table, NULL, 0)
#define DAC_PIXELS_1 0,
#define DAC_SECOND(...) DAC_SECOND_OF(__VA_ARGS__)
#define DAC_SECOND_OF(first, second, ...) second
/* The same for a header that has such a table. */
#define DAC_PIXEL_PROGRAM(NAME, name) DAC_PIXEL_PROGRAM_OF(NAME, name)
#define DAC_PIXEL_PROGRAM_OF(NAME, name) DAC_PROGRAM_OF(NAME, name, name##_pixel_table)
#define DAC_PIXEL_MEMBER(counts) , counts
#else
#define DAC_PROGRAM(NAME, name) DAC_PROGRAM_OF(NAME, name, NULL)
#define DAC_PIXEL_MEMBER(counts)
#endif
#define DAC_PROGRAM_OF(NAME, name, counts)                                                                            \
    {                                                                                                                 \
        {NAME##_LINE_TICKS, NAME##_FRAME_LINES, NAME##_PIXELS, NAME##_SETTLE_LINES, NAME##_TURN_TICK,                 \
         {NAME##_FORWARD_FIRST_TICK, NAME##_FORWARD_TICKS}, {NAME##_BACKWARD_FIRST_TICK, NAME##_BACKWARD_TICKS},      \
         {NAME##_UP_FIRST_LINE, NAME##_UP_LINES}, {NAME##_DOWN_FIRST_LINE, NAME##_DOWN_LINES}                         \
         DAC_PIXEL_MEMBER(counts)},                                                                                   \
        DAC_AXIS_PROGRAM(NAME##_X, name##_x_table), DAC_AXIS_PROGRAM(NAME##_Y, name##_y_table)                        \
    }
/* Initialiser for one axis of a program, with the emitted table or your own. */
#define DAC_AXIS_PROGRAM(AXIS, words) DAC_AXIS_PROGRAM_OF(AXIS, words, NULL)
#if DAC_SLOW_PART
/* The same with a slow part; `slow` is the address of a dac_slow_part. */
#define DAC_SLOW_AXIS_PROGRAM(AXIS, words, slow) DAC_AXIS_PROGRAM_OF(AXIS, words, slow)
#define DAC_SLOW_MEMBER(slow) , slow
#else
#define DAC_SLOW_MEMBER(slow)
#endif
#define DAC_AXIS_PROGRAM_OF(AXIS, words, slow)                                                                        \
    {                                                                                                                 \
        words, AXIS##_TABLE_LENGTH, DAC_STORAGE_BITS(words), AXIS##_TABLE_BITS,                                       \
        AXIS##_INDEX_BITS + (AXIS##_INTERPOLATED == 3 ? DAC_CUBIC : 0), AXIS##_PHASE_PERIOD, AXIS##_HOLD_TICKS,       \
        AXIS##_GAIN_WORD, AXIS##_OFFSET_WORD, AXIS##_GAIN_Q,                                                          \
        AXIS##_CODE_MIN, AXIS##_CODE_MAX, AXIS##_PARK_CODE, AXIS##_MAX_STEP, AXIS##_DAC_BITS, AXIS##_DAC_WORD_BITS,   \
        AXIS##_DAC_TWOS_COMPLEMENT,                                                                                   \
        (AXIS##_DAC_LEFT_ALIGNED)                                                                                     \
            + 0 * DAC_SHAPED_BY_RUNTIME(DAC_SHAPING_OF(AXIS##_SHAPING_ORDER, AXIS##_SHAPING_ORDER))                   \
        DAC_SHAPING_MEMBERS(AXIS) DAC_SLOW_MEMBER(slow)                                                               \
    }
/* A value of shaping if a header has AXIS_SHAPING_ORDER, 0 if it has none, as that of a scan without shaping: only an
 * order of 1 to 3 makes DAC_SHAPING_GIVEN_... two arguments of one. */
#define DAC_SHAPING_GIVEN_1 0,
#define DAC_SHAPING_GIVEN_2 0,
#define DAC_SHAPING_GIVEN_3 0,
#define DAC_SHAPING_SECOND(first, second, ...) (second)
#define DAC_SHAPING_CHOSEN(given, value) DAC_SHAPING_SECOND(given value, 0, 0)
#define DAC_SHAPING_PASTED(order, value) DAC_SHAPING_CHOSEN(DAC_SHAPING_GIVEN_##order, value)
#define DAC_SHAPING_OF(order, value) DAC_SHAPING_PASTED(order, value)
/* Does not compile if a header needs a higher DAC_SHAPING. */
#ifdef __cplusplus
#define DAC_SHAPED_BY_RUNTIME(order) sizeof(char[(order) <= DAC_SHAPING ? 1 : -1])
#else
#define DAC_SHAPED_BY_RUNTIME(order)                                                                                  \
    sizeof(struct { int compile_with_the_DAC_SHAPING_of_the_header : (order) <= DAC_SHAPING ? 1 : -1; })
#endif
#if DAC_SHAPING
#define DAC_SHAPING_MEMBERS(AXIS)                                                                                     \
    , DAC_SHAPING_OF(AXIS##_SHAPING_ORDER, AXIS##_SHAPING_ORDER),                                                     \
        DAC_SHAPING_OF(AXIS##_SHAPING_ORDER, AXIS##_SHAPING_ZERO)
#else
#define DAC_SHAPING_MEMBERS(AXIS)
#endif
/* Bits of a word of a table in memory. Does not compile if they are not DAC_TABLE_STORAGE_BITS: older compilers only
 * warn of the other pointer, and the runtime would read behind the table. (C++ refuses the other pointer by itself.) */
#ifdef __cplusplus
#define DAC_STORAGE_BITS(words) ((uint8_t)(8 * sizeof *(words)))
#else
#define DAC_STORAGE_BITS(words)                                                                                       \
    ((uint8_t)(8 * sizeof *(words)                                                                                    \
               + 0 * sizeof(struct {                                                                                  \
                     int compile_with_the_DAC_TABLE_STORAGE_BITS_of_the_table                                         \
                         : sizeof *(words) == sizeof(dac_word) ? 1 : -1;                                              \
                 })))
#endif

/* The converter of an axis. Programs for a different converter are refused. */
typedef struct {
    uint8_t bits, word_bits;
    bool twos_complement, left_aligned;
    int32_t power_up_code; /* straight binary: output of the converter before the first write */
} dac_converter;
/* Initialiser for the converter that a header was made for: DAC_CONVERTER(ANNEXIN_200NM_X, 0). */
#define DAC_CONVERTER(AXIS, power_up_code) DAC_CONVERTER_OF(AXIS, power_up_code)
#define DAC_CONVERTER_OF(AXIS, power_up_code)                                                                         \
    {                                                                                                                 \
        AXIS##_DAC_BITS, AXIS##_DAC_WORD_BITS, AXIS##_DAC_TWOS_COMPLEMENT, AXIS##_DAC_LEFT_ALIGNED, power_up_code     \
    }

/* Markers of a tick; they belong to the codes of the same tick. */
enum {
    DAC_LINE = 1,      /* the first tick of a line */
    DAC_FRAME = 2,     /* the first tick of a frame */
    DAC_PIXEL = 4,     /* the first tick of a pixel */
    DAC_BACKWARD = 8,  /* on the backward sweep */
    DAC_VALID = 16,    /* inside the imaging window, settled, and no fault */
    DAC_SWAPPED = 32,  /* a new program plays from this tick on */
    DAC_PLAYING = 64,  /* a scan runs */
    DAC_PARKED = 128   /* both axes rest at their park codes */
};

/* Sticky faults; only dac_sequencer_clear_faults() and dac_sequencer_reset() clear them. */
enum {
    DAC_FAULT_SLEW = 1,     /* the slew guard limited a step after the output had reached the waveform */
    DAC_FAULT_CLAMP = 2,    /* a code was clamped to code_min..code_max */
    DAC_FAULT_OVERRUN = 4,  /* reported by the driver: samples were requested before the last ones were taken */
    DAC_FAULT_UNDERRUN = 8  /* reported by the driver: a sample was not ready in time for the converter */
};
#define DAC_FAULTS 4

/* Why a program was not loaded. */
typedef enum {
    DAC_LOADED = 0,
    DAC_BUSY,            /* a committed program has not been taken yet */
    DAC_OTHER_CONVERTER, /* made for other bits, coding or alignment, or too wide for DAC_OUTPUT_STORAGE_BITS */
    DAC_BAD_SCHEDULE,    /* empty, too long, a window outside its line or frame, or pixels that do not fit or fill it */
    DAC_BAD_TABLE,       /* missing, length or width out of range, or the word behind the last one is not the first */
    DAC_BAD_PERIOD,      /* the period does not fit the schedule */
    DAC_BAD_OUTPUT,      /* gain, offset, codes or step out of range */
    DAC_OTHER_STORAGE,   /* DAC_TABLE_STORAGE_BITS of the runtime differs from that of the table, or is too narrow */
    DAC_BAD_SHAPING,     /* an order above DAC_SHAPING, or no zero of that order */
    DAC_BAD_SLOW_PART    /* words missing or out of range, or a table or an output that has no slow part */
} dac_loaded;

/* Output of one tick. */
typedef struct {
    dac_output x, y; /* converter words: coding and alignment done */
    uint8_t markers, faults;
} dac_tick;

/* A copy of the state that the consumer published last. Two values may be from two different ticks. */
typedef struct {
    uint8_t markers; /* after a fill without markers, DAC_PLAYING is the only scan marker */
    uint8_t faults;
    uint32_t fault_counts[DAC_FAULTS]; /* ticks with each fault, in the order of the bits; saturate at 2^32 - 1 */
    uint32_t swaps;                    /* programs taken since power-up */
    uint32_t line;                     /* line number within the frame */
} dac_status;

/* Private, down to the functions. It is declared here so that the application can allocate it. */

/* A place in a period: word index and 15 bits of fraction, of a cubic table 18 bits, in `high`, 64 more bits in
 * `low`. */
typedef struct {
    uint32_t high;
    uint64_t low;
} dac_position;

/* Small things first: a Cortex-M0 reaches bytes at 0..31 and words at 0..124 with one instruction. */

/* One axis of a bank: its program, and values derived from it when it was loaded. */
typedef struct {
    uint8_t holds, guard, gain_q, run_bits, run_spread, run_block;
#if DAC_SPLINE
    uint8_t cubic;
#endif
#if DAC_SHAPING
    uint8_t order, zero, remainder_bits;
#endif
#if DAC_SLOW_PART
    uint8_t bits, segment_ticks; /* of a word; most ticks between two words that one check covers, 0: no such runs */
#endif
    const dac_word *table;
    uint32_t length;            /* words of the table, without the one behind the last */
    int32_t gain, run_gain;     /* with gain_q and, if not shaped, with 32 fraction bits, or as DAC_UP scales it */
    int32_t code_min, code_max, max_step, park_code;
    int32_t run_half, run_room; /* half a window of 2^run_bits codes, and the room for it between the limits */
    int32_t run_entry;          /* most codes from the code before a run to its first; 0: half a window */
    uint32_t run_most;          /* maximum ticks of a run; 0: no runs */
    dac_position step;          /* step per advance, rounded up */
    int64_t offset;             /* offset_word and half an LSB */
    int64_t run_offset;         /* the same as run_gain is scaled; if shaped, offset_word */
#if DAC_SLOW_PART
    /* Of a program with a slow part, the consumer sets table, gain, offset, ramp and what belongs to runs at the start
     * of each line that plays. */
    const dac_slow_part *slow;
    const dac_word *fast;       /* the table that others are mixed into */
    uint32_t lines, ramp_step;  /* lines of a frame; 2^32 / ticks of a line, rounded down */
    uint32_t line_most;         /* maximum ticks of a run, on lines whose ramp allows runs */
    int64_t ramp, run_ramp;     /* what offset and run_offset grow by in a tick */
    int64_t ramp_most;          /* with run_entry, a line has runs if its ramp is at most that */
#endif
} dac_bank_axis;

typedef struct {
    dac_schedule schedule;
    dac_bank_axis x, y;
} dac_bank;

/* What is fed back to the next code, and the remainders of the last two ticks: all with half a code more than they
 * are. */
typedef struct {
    uint32_t back, newest, older;
} dac_shaper;

typedef struct {
    int32_t code;
    uint32_t flip;   /* the bit that two's complement inverts */
    uint8_t shift;   /* shift for left alignment */
    uint8_t bits, word_bits;
    dac_position at;
#if DAC_SHAPING
    dac_shaper shaper;
#endif
#if DAC_SLOW_PART
    int64_t rise; /* what the ramp has added to the offset since the start of the line */
#endif
} dac_axis;

typedef struct {
    /* shared: the producer writes requests and head, the consumer the rest */
    volatile uint8_t head, tail;
    volatile uint8_t playing, waiting, commits_answered; /* playing: 0, 1, or 2 before the first program */
    volatile uint8_t markers, faults;
    /* the consumer's own */
    uint8_t running, endless, armed, catching_up;
#if DAC_COMMIT_MODES
    uint8_t commit; /* the request of the last commit, which has its mode */
#endif
#if DAC_SLOW_PART
    uint8_t line_due; /* the line of the next tick has not been prepared */
#endif
    /* the producer's own */
    uint8_t loaded, commits;
    uint32_t loaded_after; /* value of swaps when the bank was loaded */
    /* the consumer's own */
    const dac_bank *now; /* the active bank, or NULL */
    uint32_t tick, frames_left, armed_frames, settle_left, pixel_rest;
#if DAC_PIXEL_TABLE
    const uint16_t *next_pixel; /* ticks of the next pixel; pixel_rest are those left of this one */
#endif
    /* shared: the consumer writes them */
    volatile uint32_t swaps, line, fault_counts[DAC_FAULTS];
    dac_axis x, y;
    /* shared: the producer writes them */
    volatile uint8_t request[DAC_REQUESTS];
    volatile uint32_t argument[DAC_REQUESTS];
    dac_bank bank[2];
} dac_sequencer;

/* PRODUCER. Each request returns false, and changes nothing, if the queue of 8 is full, that is, if no samples are
 * being requested. Requests act in order before the next tick that is computed. Cost: less than 40 instructions. */

/* Sets the power-up state: no program, not running, codes at the power-up codes of the converters. Call it before the
 * interrupt is enabled. Returns false for converters that it cannot serve: bits outside 8..24 or above word_bits,
 * word_bits above DAC_OUTPUT_STORAGE_BITS, a power_up_code of more bits. No program can be loaded then. */
bool dac_sequencer_init(dac_sequencer *s, const dac_converter *x, const dac_converter *y);

/* Returns whether the idle bank may be written: it holds no committed program, and no commit is queued. */
bool dac_sequencer_writable(const dac_sequencer *s);

/* Returns which of two sets of tables the application may write, 0 or 1: the one that does not play. Valid while
 * writable. Use the set of this number for the program that is loaded next. */
unsigned dac_sequencer_idle(const dac_sequencer *s);

/* Checks a program and puts it into the idle bank, where it stays until it is committed or another one is loaded. The
 * descriptor is copied, the tables are not: from now on they stay as they are, until the bank is idle again, since
 * runs rely on how far their words are apart. Cost: about 4000 instructions, and 8 to 18 for each word. */
dac_loaded dac_sequencer_load(dac_sequencer *s, const dac_program *program);

/* Commits the program in the idle bank: it is taken at the next line start, or on the next tick while no scan runs. */
bool dac_sequencer_commit(dac_sequencer *s);

#if DAC_COMMIT_MODES
/* Where in a running scan a committed program is taken, and on which of its lines it starts. */
typedef enum {
    DAC_COMMIT_LINE = 0, /* at the next line start, from line 0 of a frame, as dac_sequencer_commit() */
    DAC_COMMIT_KEEP,     /* at the next line start, and the frame goes on, if both programs have the same line_ticks,
                          * frame_lines and hold_ticks of y; else as DAC_COMMIT_LINE */
    DAC_COMMIT_FRAME     /* at the next frame start */
} dac_commit_mode;

/* Commits the program in the idle bank with a mode; while no scan runs it is taken on the next tick. A later commit of
 * the same program, before it is taken, replaces the mode. Returns false for another mode too. */
bool dac_sequencer_commit_at(dac_sequencer *s, dac_commit_mode mode);

/* Returns whether the loaded program could continue the frame of the active one, or no program is active. */
bool dac_sequencer_can_keep(const dac_sequencer *s);
#endif

/* Withdraws a committed program, if it was not taken yet. Once dac_sequencer_writable() returns true, status.swaps
 * tells whether the program was taken before: it has then grown. A scan that was triggered for the first program does
 * not start. */
bool dac_sequencer_withdraw(dac_sequencer *s);

/* Sets the number of frames that the next trigger starts, up to 2^31; 0: endless. Returns false for more. A running
 * scan keeps its own count. */
bool dac_sequencer_arm(dac_sequencer *s, uint32_t frames);

/* Starts at line 0, if armed, not running, and with a program: one that was taken, or one that is committed by then, so
 * that commit, arm and trigger may follow each other at once. Otherwise does nothing. */
bool dac_sequencer_trigger(dac_sequencer *s);

#if DAC_STORE || DAC_LINK_Z
/* Returns whether a scan runs, or begins with the next tick: a trigger waits for it, and no park or reset behind that.
 * The status has the markers of the last tick, which do not tell that yet. */
bool dac_sequencer_starts(const dac_sequencer *s);
#endif

/* Disarms, stops, ramps to the park codes and holds them. */
bool dac_sequencer_park(dac_sequencer *s);

/* Disarms, stops, clears the faults, and withdraws a committed program. Keeps the active program; the codes ramp. */
bool dac_sequencer_reset(dac_sequencer *s);

/* Clears the faults and their counts. */
bool dac_sequencer_clear_faults(dac_sequencer *s);

/* EITHER SIDE, at any time. */
dac_status dac_sequencer_status(const dac_sequencer *s);

/* CONSUMER. */

/* Plays one tick of both axes. */
void dac_sequencer_step(dac_sequencer *s, dac_tick *tick);

/* Plays `ticks` ticks, equal to as many steps: converter words of x to x[0], x[DAC_STRIDE], x[2 DAC_STRIDE].., of y
 * alike; DAC_* markers to markers[0], markers[1].., unless markers is NULL. For one buffer of both: fill(s, buffer,
 * buffer + 1, NULL, n). Requests act before the first tick. After a fill with markers NULL, DAC_PIXEL is not set before
 * the next imaging window. */
void dac_sequencer_fill(dac_sequencer *s, dac_output *x, dac_output *y, uint8_t *markers, size_t ticks);

/* Acts on requests now. Needed only while a driver requests no samples: the two functions above do it as well. */
void dac_sequencer_answer(dac_sequencer *s);

/* Reports a fault that the driver detected: DAC_FAULT_OVERRUN or DAC_FAULT_UNDERRUN. */
void dac_sequencer_report(dac_sequencer *s, uint8_t fault);

/* ANY CALLER: no sequencer is involved. */

/* Computes the 2^index_bits words of a table, index_bits 3..16, from Fourier words a0, a1..aH, b1..bH (Q2.30), equal to
 * the table of the build, and puts DAC_WORDS_BEHIND of the first ones behind the last. `room`: words that the table has
 * room for, DAC_TABLE_ROOM(index_bits) or more. `sine` is the emitted table NAME_sine of a length of 2^sine_index_bits,
 * sine_index_bits >= index_bits. Returns false, and writes nothing, if the accumulator could overflow (the magnitudes
 * of the words sum to 4 or more) or a size is out of range. Not re-entrant on the same table; the table must not be
 * playing. */
bool dac_synthesize(dac_word *table, uint32_t room, unsigned index_bits, unsigned bits, const int32_t *words,
                    unsigned harmonics, const int32_t *sine, unsigned sine_index_bits);

#ifdef __cplusplus
}
#endif

#endif
