/* Plays a scan at an angle: some ticks of rest, so many of the scan, then a park, to standard output. A tick is ten
 * bytes, the lowest of each word first: x and y in four, markers, faults. Arguments: "steps" or "fills", the ticks of
 * the scan, those after the park. With fills the faults are those of the status after each. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include BENCH_PROGRAM_HEADER

enum { REST = 5, MOST = 600 };

static dac_sequencer sequencer;
static dac_output codes[MOST * DAC_STRIDE * 2];
static uint8_t marks[MOST];

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

static void put_tick(uint32_t x, uint32_t y, uint8_t markers, uint8_t faults)
{
    put(x, 4);
    put(y, 4);
    put(markers, 1);
    put(faults, 1);
}

static void play(bool fills, unsigned long ticks)
{
    dac_output *const y = codes + (DAC_STRIDE == 2 ? 1 : MOST);

    for (unsigned long done = 0, length = 1; done < ticks; length = length * 7 % 601) {
        unsigned long now = fills ? length : 1;

        if (now > ticks - done)
            now = ticks - done;
        if (fills) {
            dac_sequencer_fill(&sequencer, codes, y, marks, now);
            for (unsigned long i = 0; i < now; i++)
                put_tick(codes[i * DAC_STRIDE], y[i * DAC_STRIDE], marks[i], dac_sequencer_status(&sequencer).faults);
        } else {
            dac_tick tick;
            dac_sequencer_step(&sequencer, &tick);
            put_tick(tick.x, tick.y, tick.markers, tick.faults);
        }
        done += now;
    }
}

int main(int count, char **arguments)
{
    check(count == 4, "two numbers of ticks");
    const bool fills = strcmp(arguments[1], "fills") == 0;

    check(dac_sequencer_init(&sequencer, &BENCH_X_CONVERTER, &BENCH_Y_CONVERTER), "the converters");
    play(fills, REST);
    check(dac_sequencer_load(&sequencer, &BENCH_PROGRAM) == DAC_LOADED, "the program");
    check(dac_sequencer_commit(&sequencer), "commit");
    check(dac_sequencer_arm(&sequencer, 0), "arm");
    check(dac_sequencer_trigger(&sequencer), "trigger");
    play(fills, strtoul(arguments[2], NULL, 10));
    check(dac_sequencer_park(&sequencer), "park");
    play(fills, strtoul(arguments[3], NULL, 10));
    return fflush(stdout) != 0 || ferror(stdout);
}
