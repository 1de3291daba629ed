/* A main loop and an interrupt, for interrupts that land on any instruction of the one: see test_firmware.py. */
#include "dac_sequencer.h"
#include "programs.h"

dac_sequencer sequencer;
volatile uint32_t loaded; /* the program that was loaded last */
volatile uint64_t ticked; /* what the interrupt made, as the benches record it */
dac_status told;

void power_up(void);
void main_loop(void);
void interrupt(void);
void landing_end(void);

void power_up(void)
{
    dac_sequencer_init(&sequencer, &x_converter, &y_converter);
}

static void load_and_commit(uint32_t number)
{
    while (!dac_sequencer_writable(&sequencer))
        ;
    loaded = number % PROGRAMS;
    (void)dac_sequencer_load(&sequencer, &programs[number % PROGRAMS]);
    while (!dac_sequencer_commit(&sequencer))
        ;
}

void main_loop(void)
{
    for (uint32_t n = 0; n < ROUNDS; n++) {
        load_and_commit(n);
        if (n % 4 == 0) {
            while (!dac_sequencer_arm(&sequencer, 0))
                ;
            (void)dac_sequencer_trigger(&sequencer);
        }
        if (n % 3 == 2)
            (void)dac_sequencer_withdraw(&sequencer);
        if (n % 7 == 6)
            (void)dac_sequencer_park(&sequencer);
        told = dac_sequencer_status(&sequencer);
    }
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
    dac_sequencer_step(&sequencer, &tick);
    ticked = (uint64_t)tick.faults << 56 | (uint64_t)tick.markers << 48 | (uint64_t)tick.y << 24 | tick.x;
}
