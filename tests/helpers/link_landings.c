/* A main loop of the link, and an interrupt that brings a byte, plays a tick and takes a byte. */
#include "dac_link.h"
#include "setup.h"

dac_sequencer sequencer;
dac_link link_;
uint8_t script[SCRIPT], sent[SCRIPT];
volatile uint32_t script_at, sent_bytes, ticks;
static dac_word x_table[2][33], y_table[2][17];

static const dac_link_config config = {
    .x = {{16, 16, false, false, 0}, {0, 65535, 0xFFFFFF, 0xFFFFFF}, 16, 5, 33, {x_table[0], x_table[1]}, NULL},
    .y = {{16, 16, false, false, 0}, {0, 65535, 0xFFFFFF, 0xFFFFFF}, 16, 4, 17, {y_table[0], y_table[1]}, NULL},
};

void bench_main(void);
void power_up(void);
void main_loop(void);
void interrupt(void);
void landing_end(void);

void bench_main(void) { }

void power_up(void)
{
    dac_sequencer_init(&sequencer, &config.x.converter, &config.y.converter);
    dac_link_init(&link_, &config, &sequencer, 0);
    script_at = sent_bytes = ticks = 0;
}

void main_loop(void)
{
    do
        (void)dac_link_work(&link_);
    while (script_at != SCRIPT || sent_bytes < ANSWERED);
    landing_end();
}

void __attribute__((noinline)) landing_end(void)
{
    for (;;)
        __asm__ volatile("" ::: "memory");
}

void interrupt(void)
{
    dac_tick tick;
    int byte;

    /* A host that keeps to its window. */
    if (script_at != SCRIPT && (uint16_t)(link_.head - link_.tail) < DAC_LINK_RING - 2 * DAC_LINK_RING / 128)
        dac_link_receive(&link_, script[script_at++]);
    dac_sequencer_step(&sequencer, &tick);
    ticks++;
    byte = dac_link_transmit(&link_);
    if (byte >= 0)
        sent[sent_bytes++] = (uint8_t)byte;
}
