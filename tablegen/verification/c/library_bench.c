/* Plays programs of a library in turn, to standard output. The arguments are picks: NAME RESTARTS TICKS. A pick is
 * its number in four bytes, the digits of its hash, and its ticks, of ten bytes each, the lowest of each word first: x
 * and y in four, markers, faults. */
#include <stdio.h>
#include <stdlib.h>

#include BENCH_LIBRARY_HEADER

static const dac_converter x_converter = DAC_CONVERTER(BENCH_X, 0);
static const dac_converter y_converter = DAC_CONVERTER(BENCH_Y, 0);
static dac_sequencer sequencer;

static void check(bool done, const char *what)
{
    if (done)
        return;
    fprintf(stderr, "refused: %s\n", what);
    exit(1);
}

static void put(uint32_t word, unsigned bytes)
{
    for (unsigned i = 0; i < bytes; i++)
        check(putchar((int)(word >> 8 * i & 255)) != EOF, "a byte of the record");
}

static void play(unsigned long ticks)
{
    for (unsigned long done = 0; done < ticks; done++) {
        dac_tick tick;

        dac_sequencer_step(&sequencer, &tick);
        put(tick.x, 4);
        put(tick.y, 4);
        put(tick.markers, 1);
        put(tick.faults, 1);
    }
}

int main(int count, char **arguments)
{
    check(dac_sequencer_init(&sequencer, &x_converter, &y_converter), "the converters");
    for (int at = 1; at + 2 < count; at += 3) {
        const int32_t number = BENCH_NUMBER(arguments[at]);
        const bool restarts = arguments[at + 1][0] == '1';

        put((uint32_t)number, 4);
        if (number < 0 || number >= BENCH_PROGRAMS)
            continue;
        for (const char *digit = BENCH_LIBRARY[number].hash; *digit != '\0'; digit++)
            put((unsigned char)*digit, 1);
        if (restarts)
            dac_sequencer_park(&sequencer);
        check(dac_sequencer_load(&sequencer, &BENCH_LIBRARY[number].program) == DAC_LOADED, arguments[at]);
        check(dac_sequencer_commit(&sequencer), "commit");
        if (restarts) {
            play(1);
            check(dac_sequencer_arm(&sequencer, 0), "arm");
            check(dac_sequencer_trigger(&sequencer), "trigger");
        }
        play(strtoul(arguments[at + 2], NULL, 10));
    }
    return fflush(stdout) != 0 || ferror(stdout);
}
