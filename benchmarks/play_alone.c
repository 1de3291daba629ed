/* play_alone TICKS ROUNDS: plays the example so many times so many ticks, once one tick a call and once 256, and prints
 * a sum of all codes: what `tablegen verify` plays, without a record, a model or a comparison. */
#include <stdio.h>
#include <stdlib.h>

#include "annexin_200nm.h"
#include "dac_sequencer.h"

enum { BLOCK = 256 };

static const dac_program scan = DAC_PROGRAM(ANNEXIN_200NM, annexin_200nm);
static const dac_converter x_converter = DAC_CONVERTER(ANNEXIN_200NM_X, 0);
static const dac_converter y_converter = DAC_CONVERTER(ANNEXIN_200NM_Y, 0);
static dac_sequencer sequencer;
static dac_output codes[2 * BLOCK];
static uint8_t markers[BLOCK];

int main(int count, char **arguments)
{
    const long ticks = count == 3 ? atol(arguments[1]) : 0, rounds = count == 3 ? atol(arguments[2]) : 0;
    unsigned long sum = 0;
    dac_tick tick;

    dac_sequencer_init(&sequencer, &x_converter, &y_converter);
    if (ticks <= 0 || dac_sequencer_load(&sequencer, &scan) != DAC_LOADED)
        return 2;
    (void)dac_sequencer_commit(&sequencer);
    dac_sequencer_step(&sequencer, &tick); /* takes the program */
    (void)dac_sequencer_arm(&sequencer, 0);
    (void)dac_sequencer_trigger(&sequencer);
    for (long round = 0; round < rounds; round++) {
        for (long at = 0; at < ticks; at++) {
            dac_sequencer_step(&sequencer, &tick);
            sum += tick.x + tick.y + tick.markers;
        }
        for (long at = 0; at < ticks; at += BLOCK) {
            dac_sequencer_fill(&sequencer, codes, codes + 1, markers, BLOCK);
            for (int i = 0; i < BLOCK; i++)
                sum += (unsigned long)codes[2 * i] + codes[2 * i + 1] + markers[i];
        }
    }
    printf("%lu\n", sum);
    return 0;
}
