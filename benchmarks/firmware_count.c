/* What benchmarks/firmware.py counts the instructions of: functions without arguments, called one at a time. */
#include "dac_sequencer.h"
#include "annexin_200nm.h"
#include "linear_interpolation.h"

enum { TICKS = 256 }; /* half a buffer */

static const dac_program scan = DAC_PROGRAM(ANNEXIN_200NM, annexin_200nm);
static const dac_converter x_converter = DAC_CONVERTER(ANNEXIN_200NM_X, 0);
static const dac_converter y_converter = DAC_CONVERTER(ANNEXIN_200NM_Y, 0);
static dac_sequencer sequencer;
static dac_output codes[2 * TICKS];
static uint8_t markers[TICKS];
static dac_word table[ANNEXIN_200NM_X_TABLE_LENGTH + 1];
static volatile int32_t interpolated[TICKS];

const uint32_t bytes[] = {sizeof(dac_sequencer), sizeof(dac_bank)};

void bench_main(void) {}

void count_init(void)
{
    dac_sequencer_init(&sequencer, &x_converter, &y_converter);
}

void count_load(void)
{
    (void)dac_sequencer_load(&sequencer, &scan);
}

void count_step(void)
{
    dac_tick tick;
    dac_sequencer_step(&sequencer, &tick);
}

/* The same, but that x meets a limit for half of each line. */
void count_load_limited(void)
{
    dac_program limited = scan;

    limited.x.code_max = limited.x.park_code = (limited.x.code_min + limited.x.code_max) / 2;
    (void)dac_sequencer_load(&sequencer, &limited);
}

#if DAC_SHAPING
/* The same, but that both axes shape, of the highest order. */
void count_load_shaped(void)
{
    dac_program shaped = scan;

    shaped.x.shaping_order = shaped.y.shaping_order = DAC_SHAPING;
    shaped.x.shaping_zero = shaped.y.shaping_zero = DAC_SHAPING == 3 ? 100 : 0;
    (void)dac_sequencer_load(&sequencer, &shaped);
}
#endif

void count_start(void)
{
    (void)dac_sequencer_commit(&sequencer);
    count_step(); /* takes the program */
    (void)dac_sequencer_arm(&sequencer, 0);
    (void)dac_sequencer_trigger(&sequencer);
}

void count_fill(void)
{
    dac_sequencer_fill(&sequencer, codes, codes + 1, NULL, TICKS);
}

void count_fill_markers(void)
{
    dac_sequencer_fill(&sequencer, codes, codes + 1, markers, TICKS);
}

void count_synthesize(void)
{
    (void)dac_synthesize(table, ANNEXIN_200NM_X_TABLE_LENGTH + 1, ANNEXIN_200NM_X_INDEX_BITS,
                         ANNEXIN_200NM_X_TABLE_BITS, annexin_200nm_x_fourier, ANNEXIN_200NM_X_HARMONICS,
                         annexin_200nm_sine, ANNEXIN_200NM_SINE_INDEX_BITS);
}

/* To compare with: a loop that does what has to be done tick by tick, for one program, whose constants the compiler
 * knows. */
struct plain {
    uint32_t phase, rest;
    int32_t code;
};
static struct plain plain_x, plain_y;

#define PLAIN(AXIS, words, at, out)                                                                                   \
    for (int i = 0; i < TICKS; i++) {                                                                                 \
        const uint32_t index = at.phase >> (32 - AXIS##_INDEX_BITS), fraction = at.phase << AXIS##_INDEX_BITS >> 17;  \
        const int32_t here = words[index], there = words[index + 1];                                                  \
        const int32_t sample = (((there - here) * (int32_t)fraction + 1024) >> 11) + here * 16;                       \
        int32_t code = (int32_t)(((int64_t)AXIS##_GAIN_WORD * sample + AXIS##_OFFSET_WORD                             \
                                  + (INT64_C(1) << (AXIS##_GAIN_Q - 1))) >> AXIS##_GAIN_Q);                           \
        code = code < AXIS##_CODE_MIN ? AXIS##_CODE_MIN : code > AXIS##_CODE_MAX ? AXIS##_CODE_MAX : code;            \
        if (code > at.code + AXIS##_MAX_STEP)                                                                         \
            code = at.code + AXIS##_MAX_STEP;                                                                         \
        if (code < at.code - AXIS##_MAX_STEP)                                                                         \
            code = at.code - AXIS##_MAX_STEP;                                                                         \
        at.code = code;                                                                                               \
        out[2 * i] = (dac_output)code;                                                                                \
        at.phase += AXIS##_PHASE_STEP;                                                                                \
        at.rest += AXIS##_PHASE_REMAINDER;                                                                            \
        if (at.rest >= AXIS##_PHASE_PERIOD) {                                                                         \
            at.rest -= AXIS##_PHASE_PERIOD;                                                                           \
            at.phase++;                                                                                               \
        }                                                                                                             \
    }

void count_plain(void)
{
    struct plain x = plain_x, y = plain_y;

    PLAIN(ANNEXIN_200NM_X, annexin_200nm_x_table, x, codes)
    PLAIN(ANNEXIN_200NM_Y, annexin_200nm_y_table, y, (codes + 1))
    plain_x = x;
    plain_y = y;
}

/* And: linear interpolation and nothing else. */
void count_linear(void)
{
    int32_t x = 0;
    for (int i = 0; i < TICKS; i++) {
        interpolated[i] = linear(annexin_200nm_x_table, x, ANNEXIN_200NM_X_TABLE_LENGTH);
        x += 1717986; /* 2048 words in 1250 ticks */
    }
}
