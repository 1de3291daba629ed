/* Plays compensated scan lines on a microcontroller: two axes from one counter, markers, slew guard, two banks.
 *
 * The arithmetic and what happens on which tick are stated in docs/sequencer.md of tablegen; every code, marker and
 * fault equals its integer model. C99, no heap, nothing of the C library. Two things are asked of the compiler that C99 leaves
 * to it, and every compiler for such controllers does: int64_t exists, and >> of a negative number is arithmetic.
 *
 *     static const dac_program scan = DAC_PROGRAM(ANNEXIN_200NM, annexin_200nm);
 *     static dac_sequencer sequencer;
 *
 *     dac_sequencer_init(&sequencer, &x_converter, &y_converter);
 *     dac_sequencer_load(&sequencer, &scan);
 *     dac_sequencer_commit(&sequencer);
 *     ... start a timer, or a DMA channel, whose interrupt calls dac_sequencer_step() or dac_sequencer_fill()
 *     while (dac_sequencer_status(&sequencer).swaps == 0) {}    the first tick takes the program
 *     dac_sequencer_arm(&sequencer, 0);
 *     dac_sequencer_trigger(&sequencer);
 *
 * WHO MAY CALL WHAT. A sequencer has one producer (the main loop, or whatever serves the link) and one consumer (the
 * interrupt that asks for samples), on one core or on two. Functions are marked with the side they belong to; those of
 * one side must not interrupt each other. Nothing disables interrupts, and neither side ever waits for the other.
 *
 * MEMORY ORDER. The producer writes a bank, then a request, then (DAC_RELEASE) the head of the queue of requests; the
 * consumer reads the head, then (DAC_ACQUIRE) the requests and the bank. The other way round the consumer stops to use
 * a bank, then (DAC_RELEASE) publishes what it waits for and the tail of the queue; the producer reads these, then (DAC_ACQUIRE)
 * writes. Each shared word has a single writer and is read and written at once. A bank is therefore never written while it plays,
 * and never played while it is written.
 */
#ifndef DAC_SEQUENCER_H
#define DAC_SEQUENCER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Choices of a whole firmware, the same for all its files; give them to the compiler with -D. */

#ifndef DAC_TABLE_STORAGE_BITS
#define DAC_TABLE_STORAGE_BITS 16 /* of a table word in memory: 16, or 32 for tables of 17 to 24 bits */
#endif
#ifndef DAC_OUTPUT_STORAGE_BITS
#define DAC_OUTPUT_STORAGE_BITS 16 /* of a converter word in memory: 16, or 32 for converters of more */
#endif

#ifndef DAC_STRIDE
#define DAC_STRIDE 2 /* from one word of an axis to its next in a buffer: 2 where x and y take turns, 1 where each has its own */
#endif

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

/* Programs: what tablegen emits, under the names of its headers. */

/* Half-open: first <= k < first + count. */
typedef struct {
    uint32_t first, count;
} dac_window;

/* One axis. The table stays where it is, in flash or in memory of the application, until its bank is idle again. */
typedef struct {
    const dac_word *table;
    uint32_t length;       /* words: 2^index_bits, or phase_period if not interpolated */
    uint8_t bits;          /* of a word, 8..24; its guard bits are min(4, 25 - bits) */
    uint8_t index_bits;    /* 3..16, or 0 if not interpolated */
    uint32_t phase_period; /* advances of a period, up to 2^31 - 1 */
    uint32_t hold_ticks;   /* of an advance: 1, or on y the ticks of a line */
    int32_t gain_word;     /* signed 18 bits */
    int64_t offset_word;   /* signed, codes with gain_q fraction bits, below 2^(dac_bits + 1) codes */
    uint8_t gain_q;        /* 16 + bits + guard bits - dac_bits */
    int32_t code_min, code_max, park_code; /* straight binary, 0 is the lowest voltage */
    int32_t max_step;      /* codes a tick, at least 1 */
    uint8_t dac_bits, word_bits;           /* of a code, 8..24, and of the word sent to the converter */
    bool twos_complement, left_aligned;
} dac_axis_program;

/* What both axes share. */
typedef struct {
    uint32_t line_ticks;  /* 1..2^24 */
    uint32_t frame_lines; /* line_ticks * frame_lines < 2^31 */
    uint32_t pixels;      /* of a window */
    uint32_t settle_lines;
    uint32_t turn_tick;           /* the first of the backward sweep */
    dac_window forward, backward; /* ticks of a line */
    dac_window up, down;          /* lines of a frame */
} dac_schedule;

typedef struct {
    dac_schedule schedule;
    dac_axis_program x, y;
} dac_program;

/* The program of an emitted header, as an initialiser: DAC_PROGRAM(ANNEXIN_200NM, annexin_200nm). */
#define DAC_PROGRAM(NAME, name)                                                                                       \
    {                                                                                                                 \
        {NAME##_LINE_TICKS, NAME##_FRAME_LINES, NAME##_PIXELS, NAME##_SETTLE_LINES, NAME##_TURN_TICK,                 \
         {NAME##_FORWARD_FIRST_TICK, NAME##_FORWARD_TICKS}, {NAME##_BACKWARD_FIRST_TICK, NAME##_BACKWARD_TICKS},      \
         {NAME##_UP_FIRST_LINE, NAME##_UP_LINES}, {NAME##_DOWN_FIRST_LINE, NAME##_DOWN_LINES}},                       \
        DAC_AXIS_PROGRAM(NAME##_X, name##_x_table), DAC_AXIS_PROGRAM(NAME##_Y, name##_y_table)                        \
    }
/* One axis of it, with a table of your own in place of the emitted one if you like. */
#define DAC_AXIS_PROGRAM(AXIS, words)                                                                                 \
    {                                                                                                                 \
        words, AXIS##_TABLE_LENGTH, AXIS##_TABLE_BITS, AXIS##_INDEX_BITS, AXIS##_PHASE_PERIOD, AXIS##_HOLD_TICKS,     \
        AXIS##_GAIN_WORD, AXIS##_OFFSET_WORD, AXIS##_GAIN_Q, AXIS##_CODE_MIN, AXIS##_CODE_MAX, AXIS##_PARK_CODE,      \
        AXIS##_MAX_STEP, AXIS##_DAC_BITS, AXIS##_DAC_WORD_BITS, AXIS##_DAC_TWOS_COMPLEMENT, AXIS##_DAC_LEFT_ALIGNED   \
    }

/* What is soldered to an axis. Programs for another converter are refused. */
typedef struct {
    uint8_t bits, word_bits;
    bool twos_complement, left_aligned;
    int32_t power_up_code; /* straight binary: what it puts out by itself until it is written to */
} dac_converter;
/* DAC_CONVERTER(ANNEXIN_200NM_X, 0): the converter that a header was made for. */
#define DAC_CONVERTER(AXIS, power_up_code)                                                                            \
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
    DAC_SWAPPED = 32,  /* another program plays from this tick on */
    DAC_PLAYING = 64,  /* a scan runs */
    DAC_PARKED = 128   /* both axes rest at their park codes */
};

/* Sticky faults; only dac_sequencer_clear_faults() and dac_sequencer_reset() clear them. */
enum {
    DAC_FAULT_SLEW = 1,     /* the slew guard held a code back although the output had caught up with its program */
    DAC_FAULT_CLAMP = 2,    /* a code had to be held inside code_min..code_max */
    DAC_FAULT_OVERRUN = 4,  /* reported by the driver: samples were asked for before the last ones were taken */
    DAC_FAULT_UNDERRUN = 8  /* reported by the driver: a sample was not ready when the converter wanted it */
};
#define DAC_FAULTS 4

/* Why a program was not loaded. */
typedef enum {
    DAC_LOADED = 0,
    DAC_BUSY,            /* a program waits to be taken */
    DAC_OTHER_CONVERTER, /* made for other bits, coding or alignment, or too wide for DAC_OUTPUT_STORAGE_BITS */
    DAC_BAD_SCHEDULE,    /* empty, too long, or a window that is not inside its line or frame */
    DAC_BAD_TABLE,       /* none, or its length or width is outside its range */
    DAC_BAD_PERIOD,      /* does not belong to the schedule */
    DAC_BAD_OUTPUT       /* gain, offset, codes or step outside their ranges */
} dac_loaded;

/* What leaves on a tick. */
typedef struct {
    dac_output x, y; /* converter words: coding and alignment done */
    uint8_t markers, faults;
} dac_tick;

/* A copy of what the consumer last said of itself. Each value is of one moment; two values may be of two. */
typedef struct {
    uint8_t markers; /* after a fill without markers just DAC_PLAYING of those of a scan */
    uint8_t faults;
    uint32_t fault_counts[DAC_FAULTS]; /* of ticks, in the order of the bits; they stay at 2^32 - 1 */
    uint32_t swaps;                    /* programs taken since power-up */
    uint32_t line;                     /* of the frame */
} dac_status;

/* From here on to the functions: private, and here only so that the application can place it. */

#ifndef DAC_REQUESTS
#define DAC_REQUESTS 8 /* a power of two, at most 128 */
#endif

/* A place in a period: word index and 15 bits of fraction in `high`, 64 more bits in `low`. */
typedef struct {
    uint32_t high;
    uint64_t low;
} dac_position;

/* Small things first: a Cortex-M0 reaches bytes at 0..31 and words at 0..124 with one instruction. */

/* What a bank knows of an axis: its program, and what was derived from it when it was loaded. */
typedef struct {
    uint8_t holds, guard, gain_q, run_bits;
    const dac_word *table;
    uint32_t last;              /* index of the last word */
    int32_t gain, run_gain;     /* with gain_q and with 32 fraction bits */
    int32_t code_min, code_max, max_step, park_code;
    int32_t run_half, run_room; /* half a window of 2^run_bits codes, and by how much it fits between the limits */
    uint32_t run_most;          /* ticks of a run; 0 where there are none */
    dac_position step;          /* of an advance, rounded up */
    int64_t offset;             /* offset_word and half an LSB */
    int64_t run_offset;         /* the same with 32 fraction bits */
} dac_bank_axis;

typedef struct {
    dac_schedule schedule;
    dac_bank_axis x, y;
} dac_bank;

typedef struct {
    int32_t code;
    uint32_t flip;   /* the bit that two's complement inverts */
    uint8_t shift;   /* of left alignment */
    uint8_t bits, word_bits;
    dac_position at;
} dac_axis;

typedef struct {
    /* shared: the producer writes requests and head, the consumer the rest */
    volatile uint8_t head, tail;
    volatile uint8_t playing, waiting, commits_answered; /* playing: 0, 1, or 2 before the first program */
    volatile uint8_t markers, faults;
    /* the consumer's own */
    uint8_t running, endless, armed, catching_up;
    /* the producer's own */
    uint8_t loaded, commits;
    uint32_t loaded_after; /* so many swaps */
    /* the consumer's own */
    const dac_bank *now; /* the bank that plays, or NULL */
    uint32_t tick, frames_left, armed_frames, settle_left, pixel_rest;
    /* shared: the consumer writes them */
    volatile uint32_t swaps, line, fault_counts[DAC_FAULTS];
    dac_axis x, y;
    /* shared: the producer writes them */
    volatile uint8_t request[DAC_REQUESTS];
    volatile uint32_t argument[DAC_REQUESTS];
    dac_bank bank[2];
} dac_sequencer;

/* PRODUCER. Each request returns false, and changes nothing, when the queue of 8 is full: samples are not asked for.
 * Requests act in order before the next tick that is computed. Cost: below 40 instructions. */

/* Power-up state: no program, not running, codes at those that the converters put out by themselves. Call it before the
 * interrupt is enabled. */
void dac_sequencer_init(dac_sequencer *s, const dac_converter *x, const dac_converter *y);

/* Whether the idle bank may be written: nothing waits in it, nor will. */
bool dac_sequencer_writable(const dac_sequencer *s);

/* Which of two sets of tables the application may write now, 0 or 1: not the one that plays. Valid while writable; a program
 * that is loaded next plays from the set of this number if the application keeps to it. */
unsigned dac_sequencer_idle(const dac_sequencer *s);

/* Checks a program and puts it into the idle bank, where it stays until it is committed or another one is loaded. The descriptor
 * is copied, the tables are not. Cost: some 4000 instructions, no dependence on the table's length. */
dac_loaded dac_sequencer_load(dac_sequencer *s, const dac_program *program);

/* The program in the idle bank is to be taken at the next line start, or on the next tick while no scan runs. */
bool dac_sequencer_commit(dac_sequencer *s);

/* A committed program that was not taken yet is not to be. Whether it came in time shows once the request is answered
 * (dac_sequencer_writable()): status.swaps has grown, or not. */
bool dac_sequencer_withdraw(dac_sequencer *s);

/* The next trigger will start so many frames, up to 2^31; 0 is without end. A scan that runs keeps its own count. */
bool dac_sequencer_arm(dac_sequencer *s, uint32_t frames);

/* Start at line 0, if armed, not running, and with a program to play. Otherwise nothing. */
bool dac_sequencer_trigger(dac_sequencer *s);

/* Disarm, stop, ramp to the park codes and hold them. */
bool dac_sequencer_park(dac_sequencer *s);

/* Disarm, stop, forget faults and the program that waits. The program that plays and the codes are kept: they ramp. */
bool dac_sequencer_reset(dac_sequencer *s);

/* Forget faults and their counts. */
bool dac_sequencer_clear_faults(dac_sequencer *s);

/* Either side, at any time. */
dac_status dac_sequencer_status(const dac_sequencer *s);

/* CONSUMER. */

/* One tick of both axes. */
void dac_sequencer_step(dac_sequencer *s, dac_tick *tick);

/* `ticks` ticks at once, equal to as many steps: converter words of x to x[0], x[DAC_STRIDE], x[2 DAC_STRIDE].., of y alike; DAC_*
 * markers to markers[0], markers[1].., unless markers is NULL. For one buffer of both: fill(s, buffer, buffer + 1, NULL, n).
 * Requests act before the first of them. Where markers is NULL, DAC_PIXEL is not told again before the next imaging window. */
void dac_sequencer_fill(dac_sequencer *s, dac_output *x, dac_output *y, uint8_t *markers, size_t ticks);

/* Acts on requests now. Only for drivers that have stopped to ask for samples: both functions above do it. */
void dac_sequencer_answer(dac_sequencer *s);

/* The driver saw DAC_FAULT_OVERRUN or DAC_FAULT_UNDERRUN. */
void dac_sequencer_report(dac_sequencer *s, uint8_t fault);

/* PRODUCER, and anybody else: no sequencer is involved. */

/* Renders Fourier words a0, a1..aH, b1..bH (Q2.30) into the 2^index_bits words of a table, index_bits 3..16, equal to
 * the host's word for word. `sine` is the emitted table NAME_sine of a length of 2^sine_index_bits, sine_index_bits >= index_bits.
 * False, and nothing is written, if the words could leave the accumulator (their magnitudes sum to 4 or more) or a size is
 * outside its range. Not re-entrant on the same table; the table must not be playing. */
bool dac_synthesize(dac_word *table, unsigned index_bits, unsigned bits, const int32_t *words, unsigned harmonics,
                    const int32_t *sine, unsigned sine_index_bits);

#ifdef __cplusplus
}
#endif

#endif
