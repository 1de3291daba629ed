/* On an ATmega2560: the chains and the sequencer over a line each. GPIOR0 tells the simulator's host (avr_count.c)
 * which of them runs, 0 for none; the codes go to GPIOR1, byte by byte. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

#include "annexin_200nm.h"
#include "chains.h"
#include "dac_sequencer.h"

enum { BLOCKS = ANNEXIN_200NM_LINE_TICKS / TICKS };

static const dac_program scan = DAC_PROGRAM(ANNEXIN_200NM, annexin_200nm);
static const dac_converter x_converter = DAC_CONVERTER(ANNEXIN_200NM_X, 0);
static const dac_converter y_converter = DAC_CONVERTER(ANNEXIN_200NM_Y, 0);
static dac_sequencer sequencer;
static dac_output codes[2 * TICKS];

static void tell(const uint16_t *values, int step)
{
    for (int i = 0; i < TICKS; i++) {
        GPIOR1 = (uint8_t)(values[i * step] & 255);
        GPIOR1 = (uint8_t)(values[i * step] >> 8);
    }
}

static void play(uint8_t name, void (*chain)(void))
{
    chain_start();
    for (int block = 0; block < BLOCKS; block++) {
        GPIOR0 = name;
        chain();
        GPIOR0 = 0;
        tell(chain_codes, 1);
    }
}

int main(void)
{
    dac_tick tick;

    play(1, chain_plain);
    play(2, chain_float);
    play(3, chain_library);
    dac_sequencer_init(&sequencer, &x_converter, &y_converter);
    (void)dac_sequencer_load(&sequencer, &scan);
    (void)dac_sequencer_commit(&sequencer);
    dac_sequencer_step(&sequencer, &tick); /* takes the program */
    (void)dac_sequencer_arm(&sequencer, 0);
    (void)dac_sequencer_trigger(&sequencer);
    for (int block = 0; block < BLOCKS; block++) {
        GPIOR0 = 4;
        dac_sequencer_fill(&sequencer, codes, codes + 1, NULL, TICKS);
        GPIOR0 = 0;
        tell(codes, 2);
    }
    cli();
    sleep_enable();
    sleep_cpu(); /* with no interrupts simavr ends here */
    return 0;
}
