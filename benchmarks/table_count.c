/* What benchmarks/tables.py counts the instructions of: functions without arguments, called one at a time. */
#include "dac_sequencer.h"
#include "annexin_200nm.h"

enum { TICKS = 256 }; /* half a buffer */

static const dac_program scan = DAC_PROGRAM(ANNEXIN_200NM, annexin_200nm);
static const dac_converter x_converter = DAC_CONVERTER(ANNEXIN_200NM_X, 0);
static const dac_converter y_converter = DAC_CONVERTER(ANNEXIN_200NM_Y, 0);
static dac_sequencer sequencer;
static dac_output codes[2 * TICKS];
uint32_t refused;

void bench_main(void) {}

void count_start(void)
{
    dac_tick tick;

    dac_sequencer_init(&sequencer, &x_converter, &y_converter);
    refused = (uint32_t)dac_sequencer_load(&sequencer, &scan);
    (void)dac_sequencer_commit(&sequencer);
    dac_sequencer_step(&sequencer, &tick); /* takes the program */
    (void)dac_sequencer_arm(&sequencer, 0);
    (void)dac_sequencer_trigger(&sequencer);
}

void count_fill(void)
{
    dac_sequencer_fill(&sequencer, codes, codes + 1, NULL, TICKS);
}
