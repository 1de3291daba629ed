/* What benchmarks/slow_costs.py counts the instructions of: a program with a slow part on both axes, whose words the
 * host writes into memory, and functions that are called one at a time. */
#include "dac_run.h"
#include "dac_slow.h"

enum { TICKS = 256, MOST_WORDS = 256, BEHIND = 3, KNOTS = 17 }; /* half a buffer; knots as a build has them */

dac_word fast[MOST_WORDS + BEHIND], slow[MOST_WORDS + BEHIND];
int8_t second[MOST_WORDS];
int32_t gains[KNOTS];
int16_t ratios[KNOTS];
uint32_t line_ticks, frame_lines, index_bits, slow_index_bits, word_bits, code_bits, gain_word;
uint32_t coded, mixed, without_runs; /* two's complement; a second table; as of a program that has no runs */
uint32_t window_bits, block;         /* of the codes of a window, and ticks of a block, unless it is 0 */
uint32_t refused;

static dac_word memory[2][MOST_WORDS + DAC_WORDS_BEHIND];
static dac_slow_part parts[2];
static dac_sequencer sequencer;
static dac_output codes[2 * TICKS];

void bench_main(void) {}

static void make_part(unsigned axis, unsigned gain_q)
{
    dac_slow_part *const part = &parts[axis];

    part->gains = gains;
    part->ratios = ratios;
    part->second = mixed != 0 ? second : NULL;
    part->mixed = memory[axis];
    part->table = slow;
    part->gain_spacing = part->ratio_spacing = frame_lines / (KNOTS - 1);
    part->gain_knots = part->ratio_knots = KNOTS;
    part->index_bits = (uint8_t)slow_index_bits;
    part->gain_word = (int32_t)gain_word;
    part->offset_word = (int64_t)1 << (code_bits - 1u + gain_q);
}

/* Both axes play the same. */
static void make_axis(dac_axis_program *axis, unsigned number)
{
    const unsigned guard = word_bits > 21 ? 25u - word_bits : 4u;

    axis->table = fast;
    axis->length = UINT32_C(1) << (index_bits & ~(unsigned)DAC_CUBIC);
    axis->storage_bits = DAC_TABLE_STORAGE_BITS;
    axis->bits = (uint8_t)word_bits;
    axis->index_bits = (uint8_t)index_bits;
    axis->phase_period = line_ticks;
    axis->hold_ticks = 1;
    axis->gain_word = gains[0];
    axis->gain_q = (uint8_t)(16u + word_bits + guard - code_bits);
    axis->code_max = (INT32_C(1) << code_bits) - 1;
    axis->park_code = axis->code_max / 2;
    axis->max_step = axis->code_max;
    axis->dac_bits = axis->word_bits = (uint8_t)code_bits;
    axis->twos_complement = coded != 0;
#if DAC_SHAPING
    axis->shaping_order = DAC_SHAPING;
    axis->shaping_zero = DAC_SHAPING == 3 ? 100 : 0;
#endif
    make_part(number, axis->gain_q);
    axis->slow = &parts[number];
}

void count_start(void)
{
    static dac_program program;
    const dac_converter converter = {(uint8_t)code_bits, (uint8_t)code_bits, coded != 0, false,
                                     INT32_C(1) << (code_bits - 1u)};
    dac_tick tick;

    program.schedule.line_ticks = line_ticks;
    program.schedule.frame_lines = frame_lines;
    program.schedule.pixels = 64;
    program.schedule.turn_tick = line_ticks / 2u;
    program.schedule.forward.first = line_ticks / 20u; /* of each sweep 80 % */
    program.schedule.backward.first = line_ticks / 2u + line_ticks / 20u;
    program.schedule.forward.count = program.schedule.backward.count = line_ticks * 2u / 5u;
    program.schedule.up.count = frame_lines;
    make_axis(&program.x, 0);
    make_axis(&program.y, 1);
    dac_sequencer_init(&sequencer, &converter, &converter);
    refused = (uint32_t)dac_sequencer_load(&sequencer, &program);
    (void)dac_sequencer_commit(&sequencer);
    dac_sequencer_step(&sequencer, &tick); /* takes the program */
    for (unsigned i = 0; i < 2; i++) {
        dac_bank *bank = &sequencer.bank[i];
        if (without_runs != 0)
            bank->x.run_most = bank->x.line_most = bank->y.run_most = bank->y.line_most = 0;
        if (block != 0)
            bank->x.run_block = bank->y.run_block = (uint8_t)block;
        if (window_bits != 0) {
            dac_set_window(&bank->x, (uint8_t)window_bits);
            dac_set_window(&bank->y, (uint8_t)window_bits);
        }
    }
    (void)dac_sequencer_arm(&sequencer, 0);
    (void)dac_sequencer_trigger(&sequencer);
}

void count_fill(void)
{
    dac_sequencer_fill(&sequencer, codes, codes + 1, NULL, TICKS);
}

/* What a line begins with, of x. */
void count_line(uint32_t line)
{
    dac_slow_begin_line(&sequencer.x, &sequencer.bank[sequencer.playing].x, line);
}
