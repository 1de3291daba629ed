/* Plays a session of turned_sessions.py: words of four bytes, the lowest first, from standard input; ticks of ten
 * bytes, as of frame_bench.c, to standard output. The faults of a fill are those of the status after its last tick;
 * before that they are 255. Tables are copied to memory of the bank that does not play, while the other one plays. */
#include <stdio.h>
#include <stdlib.h>

#include "dac_sequencer.h"

#ifndef ONE_MEMORY
#define ONE_MEMORY 0 /* 1: both banks have the same words, so that a line is of two programs */
#endif

enum { STEP = 1, FILL, COMMIT, WITHDRAW, PARK, START, CLEAR_FAULTS };
enum { MOST_WORDS = 256, MOST_KNOTS = 65, MOST_FILL = 200, UNTOLD = 255 };

typedef struct {
    dac_word fast[MOST_WORDS + DAC_WORDS_BEHIND], slow[MOST_WORDS + DAC_WORDS_BEHIND];
    int8_t second[MOST_WORDS];
    int32_t gains[MOST_KNOTS];
    int16_t ratios[MOST_KNOTS];
    dac_slow_part part;
} axis_memory;

static dac_sequencer sequencer;
static axis_memory memory[2][2]; /* of a bank, and an axis */
static dac_word mixed[2][MOST_WORDS + DAC_WORDS_BEHIND];

static void check(bool done, const char *what)
{
    if (done)
        return;
    fprintf(stderr, "refused: %s\n", what);
    exit(1);
}

static bool next(int32_t *word)
{
    unsigned char bytes[4];

    if (fread(bytes, 1, 4, stdin) != 4)
        return false;
    *word = (int32_t)(bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24);
    return true;
}

static int32_t number(void)
{
    int32_t word = 0;

    check(next(&word), "the end of the script");
    return word;
}

static unsigned count(unsigned most)
{
    const int32_t read = number();

    check(read >= 0 && (uint32_t)read <= most, "a count");
    return (unsigned)read;
}

static dac_window window(void)
{
    dac_window read;

    read.first = (uint32_t)number();
    read.count = (uint32_t)number();
    return read;
}

static void read_table(dac_word *table, unsigned words)
{
    for (unsigned i = 0; i < words; i++)
        table[i] = (dac_word)number();
    for (unsigned i = 0; i < DAC_WORDS_BEHIND; i++)
        table[words + i] = table[i];
}

static void read_axis(dac_axis_program *axis, axis_memory *to, dac_word *mix, uint32_t ticks)
{
    dac_slow_part *const slow = &to->part;
    unsigned index_bits;

    axis->bits = (uint8_t)number();
    index_bits = count(8);
    axis->gain_q = (uint8_t)number();
    axis->code_min = number();
    axis->code_max = number();
    axis->park_code = number();
    axis->max_step = number();
    axis->dac_bits = axis->word_bits = (uint8_t)number();
    slow->gain_knots = (uint8_t)count(MOST_KNOTS);
    slow->gain_spacing = (uint32_t)number();
    slow->ratio_knots = (uint8_t)count(MOST_KNOTS);
    slow->ratio_spacing = (uint32_t)number();
    slow->index_bits = (uint8_t)count(8);
    slow->gain_word = number();
    slow->offset_word = (int64_t)(uint32_t)number();
    slow->offset_word += (int64_t)number() * ((int64_t)1 << 32);
    axis->table = to->fast;
    axis->length = 1u << index_bits;
    axis->index_bits = (uint8_t)(index_bits + DAC_CUBIC);
    axis->storage_bits = DAC_TABLE_STORAGE_BITS;
    axis->phase_period = ticks;
    axis->hold_ticks = 1;
    axis->gain_word = 0;
    axis->offset_word = 0;
    axis->twos_complement = axis->left_aligned = false;
    axis->slow = slow;
    read_table(to->fast, axis->length);
    for (unsigned i = 0; i < axis->length; i++)
        to->second[i] = (int8_t)number();
    for (unsigned i = 0; i < slow->gain_knots; i++)
        to->gains[i] = number();
    for (unsigned i = 0; i < slow->ratio_knots; i++)
        to->ratios[i] = (int16_t)number();
    read_table(to->slow, 1u << slow->index_bits);
    slow->gains = to->gains;
    slow->ratios = to->ratios;
    slow->second = to->second;
    slow->mixed = mix;
    slow->table = to->slow;
}

static void commit(void)
{
    const dac_commit_mode mode = (dac_commit_mode)number();
    dac_program program;
    dac_schedule *const schedule = &program.schedule;

    dac_sequencer_answer(&sequencer);
    check(dac_sequencer_writable(&sequencer), "a program waits");
    const unsigned idle = ONE_MEMORY ? 0 : dac_sequencer_idle(&sequencer);
    schedule->line_ticks = (uint32_t)number();
    schedule->frame_lines = (uint32_t)number();
    schedule->pixels = (uint32_t)number();
    schedule->settle_lines = (uint32_t)number();
    schedule->turn_tick = (uint32_t)number();
    schedule->forward = window();
    schedule->backward = window();
    schedule->up = window();
    schedule->down = window();
    read_axis(&program.x, &memory[idle][0], mixed[0], schedule->line_ticks);
    read_axis(&program.y, &memory[idle][1], mixed[1], schedule->line_ticks);
    check(dac_sequencer_load(&sequencer, &program) == DAC_LOADED, "a program");
    check(dac_sequencer_commit_at(&sequencer, mode), "a commit");
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

static void steps(unsigned ticks)
{
    for (unsigned i = 0; i < ticks; i++) {
        dac_tick tick;
        dac_sequencer_step(&sequencer, &tick);
        put_tick(tick.x, tick.y, tick.markers, tick.faults);
    }
}

static void fill(unsigned ticks)
{
    static dac_output codes[MOST_FILL * DAC_STRIDE * 2];
    static uint8_t marks[MOST_FILL];
    dac_output *const y = codes + (DAC_STRIDE == 2 ? 1 : MOST_FILL);

    dac_sequencer_fill(&sequencer, codes, y, marks, ticks);
    for (unsigned i = 0; i < ticks; i++)
        put_tick(codes[i * DAC_STRIDE], y[i * DAC_STRIDE], marks[i],
                 i + 1 == ticks ? dac_sequencer_status(&sequencer).faults : (uint8_t)UNTOLD);
}

int main(void)
{
    dac_converter x = {16, 16, false, false, 0}, y = {16, 16, false, false, 0};
    int32_t what;

    x.power_up_code = number();
    y.power_up_code = number();
    check(dac_sequencer_init(&sequencer, &x, &y), "the converters");
    while (next(&what)) {
        if (what == STEP) {
            steps(count(MOST_FILL));
        } else if (what == FILL) {
            fill(count(MOST_FILL));
        } else if (what == COMMIT) {
            commit();
        } else if (what == WITHDRAW) {
            check(dac_sequencer_withdraw(&sequencer), "a withdrawal");
        } else if (what == PARK) {
            check(dac_sequencer_park(&sequencer), "a park");
        } else if (what == START) {
            check(dac_sequencer_arm(&sequencer, 0), "arming");
            check(dac_sequencer_trigger(&sequencer), "a trigger");
        } else {
            check(what == CLEAR_FAULTS, "a word that is no command");
            check(dac_sequencer_clear_faults(&sequencer), "clearing the faults");
        }
    }
    return fflush(stdout) != 0 || ferror(stdout);
}
