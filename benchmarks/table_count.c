/* What benchmarks/tables.py counts the instructions of: functions without arguments, called one at a time. */
#include "dac_run.h"
#include "annexin_200nm.h"

enum { TICKS = 256 }; /* half a buffer */

static const dac_program scan = DAC_PROGRAM(ANNEXIN_200NM, annexin_200nm);
static const dac_converter x_converter = DAC_CONVERTER(ANNEXIN_200NM_X, 0);
static const dac_converter y_converter = DAC_CONVERTER(ANNEXIN_200NM_Y, 0);
static dac_sequencer sequencer;
static dac_output codes[2 * TICKS];
uint32_t refused;

void bench_main(void) {}

/* Both axes play x. Codes are two's complement if `coded`; there are no runs if `ticks`, as of a program that allows
 * none; their windows have 2^`bits` codes, and their blocks `block` ticks, unless it is 0. */
void count_start(uint32_t coded, uint32_t ticks, uint32_t bits, uint32_t block)
{
    dac_converter x = x_converter, y = y_converter;
    dac_program program = scan;
    dac_tick tick;

    x.twos_complement = y.twos_complement = program.x.twos_complement = program.y.twos_complement = coded != 0;
#if DAC_SHAPING
    program.x.shaping_order = program.y.shaping_order = DAC_SHAPING;
    program.x.shaping_zero = program.y.shaping_zero = DAC_SHAPING == 3 ? 100 : 0;
#endif
    dac_sequencer_init(&sequencer, &x, &y);
    refused = (uint32_t)dac_sequencer_load(&sequencer, &program);
    (void)dac_sequencer_commit(&sequencer);
    dac_sequencer_step(&sequencer, &tick); /* takes the program */
    for (unsigned i = 0; i < 2; i++) {
        dac_bank *bank = &sequencer.bank[i];
        if (ticks != 0)
            bank->x.run_most = 0;
        if (block != 0)
            bank->x.run_block = (uint8_t)block;
        if (bits != 0)
            dac_set_window(&bank->x, (uint8_t)bits);
        bank->y = bank->x;
    }
    sequencer.y.at = sequencer.x.at;
    sequencer.y.code = sequencer.x.code;
    (void)dac_sequencer_arm(&sequencer, 0);
    (void)dac_sequencer_trigger(&sequencer);
}

void count_fill(void)
{
    dac_sequencer_fill(&sequencer, codes, codes + 1, NULL, TICKS);
}
