/* What benchmarks/firmware.py counts the instructions of: functions without arguments, called one at a time. */
#include "dac_sequencer.h"
#include "annexin_200nm.h"

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

/* To compare with: linear interpolation and nothing else, as libraries for signal processing have it: a call a sample, 12 bits of
 * index and 20 of fraction, a look at both ends of the table, a 64-bit product for each neighbour. */
static int32_t __attribute__((noinline)) linear(const int16_t *words, int32_t x, uint32_t length)
{
    const int32_t index = x >> 20, fraction = x & 0xfffff;
    int64_t sum;

    if (index >= (int32_t)(length - 1))
        return words[length - 1];
    if (index < 0)
        return words[0];
    sum = (int64_t)words[index] * (0xfffff - fraction);
    sum += (int64_t)words[index + 1] * fraction;
    return (int32_t)(sum >> 20);
}

void count_linear(void)
{
    int32_t x = 0;
    for (int i = 0; i < TICKS; i++) {
        interpolated[i] = linear(annexin_200nm_x_table, x, ANNEXIN_200NM_X_TABLE_LENGTH);
        x += 1717986; /* 2048 words in 1250 ticks */
    }
}
