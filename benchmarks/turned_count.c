/* What benchmarks/turned_costs.py counts the instructions of: an emitted scan at an angle, a fill at a time. */
#include "annexin_200nm_program.h"

enum { TICKS = 256 }; /* half a buffer */

static dac_sequencer sequencer;
static dac_output codes[2 * TICKS];
uint32_t refused;

void bench_main(void) {}

void count_start(void)
{
    dac_sequencer_init(&sequencer, &annexin_200nm_x_converter, &annexin_200nm_y_converter);
    refused = (uint32_t)dac_sequencer_load(&sequencer, &annexin_200nm_program);
    (void)dac_sequencer_commit(&sequencer);
    (void)dac_sequencer_arm(&sequencer, 0);
    (void)dac_sequencer_trigger(&sequencer);
}

void count_fill(void)
{
    dac_sequencer_fill(&sequencer, codes, codes + 1, NULL, TICKS);
}
