/* A producer and a consumer on two threads: every line that is played has to be of one program.
 *
 * Program n plays the code n and nothing else, on both axes, in lines of a length of its own; its tables are written
 * anew for each load, into the set of tables that dac_sequencer_idle() names. The producer loads, commits, withdraws,
 * arms, triggers and parks at random; the consumer steps and fills at random. Arguments: programs, seed. Exit status 1
 * if a line was mixed. Printed are swaps, lines, withdrawals that came in time, and such that came late.
 */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

#include "dac_sequencer.h"

#ifdef FENCES /* under ThreadSanitizer */
void fence_check(const volatile void *words, unsigned size);
#else
#define fence_check(words, size) (void)0
#endif

enum { LENGTH = 8, BLOCK = 100, CODES = 60000 };

static dac_sequencer sequencer;
static dac_word x_table[2][LENGTH + 1], y_table[2][LENGTH + 1];
static int finished;
static unsigned calls; /* of the consumer */
static unsigned long programs, swaps_seen, lines_seen, withdrawn, late;

static unsigned dice(unsigned *state, unsigned sides)
{
    *state = *state * 1664525u + 1013904223u;
    return (*state >> 16) % sides;
}

/* The words of program n are n, and of unit gain: 16-bit words map to 16-bit codes around the middle. */
static dac_axis_program axis(dac_word *table, unsigned n, uint32_t period)
{
    const dac_axis_program p = {table, LENGTH, DAC_TABLE_STORAGE_BITS, 16, 3, period, 1, 1 << 16,
                                (int64_t)32768 << 20, 20, 0, 65535, 0, 65535, 16, 16, false, false};
    for (unsigned i = 0; i <= LENGTH; i++)
        table[i] = (dac_word)((int)n - 32768);
    return p;
}

static uint32_t ticks_of(unsigned code)
{
    return 20 + code % 37;
}

static void fail(const char *what, unsigned long at)
{
    fprintf(stderr, "%s (%lu)\n", what, at);
    exit(1);
}

static void load(unsigned n)
{
    const unsigned set = dac_sequencer_idle(&sequencer);
    const uint32_t ticks = ticks_of(n);
    const dac_program p = {{ticks, 3, 4, 0, 10, {0, 5}, {10, 5}, {0, 1}, {2, 1}},
                           axis(x_table[set], n, ticks), axis(y_table[set], n, 3 * ticks)};
    if (dac_sequencer_load(&sequencer, &p) != DAC_LOADED)
        fail("not loaded", n);
}

static void request(bool (*what)(dac_sequencer *))
{
    while (!what(&sequencer)) {
    }
}

/* Until it has stopped: a line that is started again on the next tick would look as if it were cut off. Orders nothing
 * under ThreadSanitizer; otherwise the calls are counted from where the request has left the processor's store buffer.
 */
static void stop(bool (*how)(dac_sequencer *))
{
    request(how);
#ifndef FENCES
    __atomic_thread_fence(__ATOMIC_SEQ_CST);
#endif
    const unsigned before = __atomic_load_n(&calls, __ATOMIC_RELAXED);
    while (__atomic_load_n(&calls, __ATOMIC_RELAXED) - before < 2) {
    }
}

static void *produce(void *seed)
{
    unsigned state = *(unsigned *)seed;
    for (unsigned long n = 1; n <= programs; n++) {
        while (!dac_sequencer_writable(&sequencer)) {
            dac_sequencer_status(&sequencer);
        }
        load(1 + (unsigned)(n % CODES));
        if (dice(&state, 4) == 0)
            load(1 + (unsigned)(n % CODES));
        request(dac_sequencer_commit);
        if (dice(&state, 3) == 0) {
            const uint32_t before = dac_sequencer_status(&sequencer).swaps;
            request(dac_sequencer_withdraw);
            while (!dac_sequencer_writable(&sequencer)) {
            }
            if (dac_sequencer_status(&sequencer).swaps == before)
                withdrawn++;
            else
                late++;
        }
        if (dice(&state, 3) == 0) {
            while (!dac_sequencer_arm(&sequencer, dice(&state, 3))) {
            }
            request(dac_sequencer_trigger);
        }
        for (unsigned i = dice(&state, 10) == 0 ? 40 : 0; i != 0; i--) /* more than the queue holds */
            request(dac_sequencer_clear_faults);
        if (dice(&state, 50) == 0)
            stop(dac_sequencer_park);
        if (dice(&state, 50) == 0)
            stop(dac_sequencer_reset);
    }
    __atomic_store_n(&finished, 1, __ATOMIC_RELEASE);
    return NULL;
}

static unsigned now, tick, playing;

/* The codes of a line are of one program, its length is that of this program, and both axes change at once. */
static void look(unsigned x, unsigned y, unsigned markers)
{
    if (markers & DAC_SWAPPED)
        swaps_seen++;
    if (!(markers & DAC_PLAYING)) {
        playing = 0;
        return;
    }
    if (x != y)
        fail("the axes play two programs", swaps_seen);
    if (markers & DAC_LINE) {
        if (playing && tick != ticks_of(now))
            fail("a line was cut off", tick);
        lines_seen++;
        now = x;
        tick = 0;
        playing = 1;
    }
    if (x != now)
        fail("a line is of two programs", swaps_seen);
    if (++tick > ticks_of(now))
        fail("a line is too long", tick);
}

static void consume(unsigned state)
{
    dac_output codes[2 * BLOCK];
    uint8_t markers[BLOCK];
    dac_tick one;

    while (!__atomic_load_n(&finished, __ATOMIC_ACQUIRE)) {
        __atomic_fetch_add(&calls, 1, __ATOMIC_RELAXED);
        if (dice(&state, 2) == 0) {
            dac_sequencer_step(&sequencer, &one);
            look(one.x, one.y, one.markers);
        } else {
            const unsigned ticks = 1 + dice(&state, BLOCK);
            dac_sequencer_fill(&sequencer, codes, codes + 1, markers, ticks);
            for (unsigned i = 0; i < ticks; i++)
                look(codes[2 * i], codes[2 * i + 1], markers[i]);
        }
    }
}

int main(int count, char **arguments)
{
    const dac_converter converter = {16, 16, false, false, 0};
    unsigned seed = count > 2 ? (unsigned)strtoul(arguments[2], NULL, 10) : 1;
    pthread_t producer;

    programs = count > 1 ? strtoul(arguments[1], NULL, 10) : 1000;
    dac_sequencer_init(&sequencer, &converter, &converter);
    fence_check(sequencer.request, sizeof sequencer.request);
    fence_check(sequencer.argument, sizeof sequencer.argument);
    if (pthread_create(&producer, NULL, produce, &seed) != 0)
        fail("no thread", 0);
    consume(seed + 1);
    pthread_join(producer, NULL);
    printf("%lu %lu %lu %lu\n", swaps_seen, lines_seen, withdrawn, late);
    return 0;
}
