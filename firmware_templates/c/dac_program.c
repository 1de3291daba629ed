/* Loads a program: checks it, and derives the values that the sequencer needs. */
#include "dac_run.h"

static bool inside(const dac_window *window, uint32_t length)
{
    return window->first <= length && window->count <= length - window->first;
}

/* Whether each pixel has a tick of a window, if that has any. */
static bool has_pixels(const dac_window *window, uint32_t pixels)
{
    return window->count == 0 || pixels <= window->count;
}

#if DAC_PIXEL_TABLE
/* Whether pixels of at least a tick fill a window of so many ticks. */
static bool fill_window(const uint16_t *counts, uint32_t pixels, uint32_t ticks)
{
    for (; pixels != 0; pixels--, counts++) {
        if (*counts == 0 || *counts > ticks)
            return false;
        ticks -= *counts;
    }
    return ticks == 0;
}

static bool good_pixels(const dac_schedule *p)
{
    return p->pixel_table == NULL
        || (fill_window(p->pixel_table, p->pixels, p->forward.count)
            && fill_window(p->pixel_table + p->pixels, p->pixels, p->backward.count));
}
#endif

static bool good_schedule(const dac_schedule *p)
{
    return p->line_ticks - 1 < UINT32_C(1) << 24 && p->frame_lines != 0 && p->frame_lines <= INT32_MAX / p->line_ticks
        && p->turn_tick <= p->line_ticks && has_pixels(&p->forward, p->pixels) && has_pixels(&p->backward, p->pixels)
        && inside(&p->forward, p->line_ticks) && inside(&p->backward, p->line_ticks)
        && inside(&p->up, p->frame_lines) && inside(&p->down, p->frame_lines);
}

/* Words of another width in memory would be read as others, and behind the table. */
static bool good_storage(const dac_axis_program *p)
{
    return p->storage_bits == DAC_TABLE_STORAGE_BITS && p->bits <= DAC_TABLE_STORAGE_BITS;
}

#if DAC_SPLINE
#define INDEX_BITS(p) ((p)->index_bits & ~(unsigned)DAC_CUBIC)
#define CUBIC(p) (((p)->index_bits & DAC_CUBIC) != 0)
#else
#define INDEX_BITS(p) ((p)->index_bits)
#define CUBIC(p) false
#endif

static bool good_length(const dac_axis_program *p)
{
    if (p->index_bits == 0)
        return p->length == p->phase_period && p->length <= UINT32_C(1) << 17;
    return INDEX_BITS(p) >= 3 && INDEX_BITS(p) <= (CUBIC(p) ? 14 : 16) && p->length == UINT32_C(1) << INDEX_BITS(p);
}

/* Every tick reads a word and the next one, of a cubic table the next three: behind the last one have to stand the
 * first ones again. */
static bool good_table(const dac_axis_program *p)
{
    return p->table != NULL && p->bits >= 8 && p->bits <= (CUBIC(p) ? 21 : 24) && good_length(p)
        && DAC_TABLE_WORD(p->table[p->length]) == DAC_TABLE_WORD(p->table[0])
        && (!CUBIC(p)
            || (DAC_TABLE_WORD(p->table[p->length + 1]) == DAC_TABLE_WORD(p->table[1])
                && DAC_TABLE_WORD(p->table[p->length + 2]) == DAC_TABLE_WORD(p->table[2])));
}

/* x plays one period per line; y plays one period per frame, with one advance per tick, or per line if it is held for a
 * line. With a slow part y plays one period per line. */
static bool good_periods(const dac_program *p)
{
    const uint32_t ticks = p->schedule.line_ticks;
    uint32_t lines = p->schedule.frame_lines; /* of a period of y */

#if DAC_SLOW_PART
    if (p->y.slow != NULL) {
        if (p->y.hold_ticks != 1)
            return false;
        lines = 1;
    }
#endif
    return p->x.hold_ticks == 1 && p->x.phase_period == ticks
        && (p->y.hold_ticks == 1 ? p->y.phase_period == ticks * lines
                                 : p->y.hold_ticks == ticks && p->y.phase_period == lines);
}

static unsigned guard_bits(const dac_axis_program *p)
{
    return p->bits > 21 ? 25u - p->bits : 4u;
}

static bool good_output(const dac_axis_program *p)
{
    return p->gain_word >= -(INT32_C(1) << 17) && p->gain_word < INT32_C(1) << 17
        && p->gain_q == 16u + p->bits + guard_bits(p) - p->dac_bits
        && p->offset_word > -(INT64_C(2) << (p->dac_bits + p->gain_q)) /* twice the range of a code; at most 2^42 */
        && p->offset_word < INT64_C(2) << (p->dac_bits + p->gain_q)
        && 0 <= p->code_min && p->code_min <= p->park_code && p->park_code <= p->code_max
        && p->code_max < INT32_C(1) << p->dac_bits && p->max_step >= 1 && p->max_step < INT32_C(1) << 24;
}

#if DAC_SHAPING
static bool good_shaping(const dac_axis_program *p)
{
    return (p->shaping_zero == 0 || (p->shaping_order == 3 && p->shaping_zero <= 128))
        && p->shaping_order <= DAC_SHAPING;
}
#endif

#if DAC_SLOW_PART
/* Whether knots reach all lines of a frame. */
static bool good_knots(uint8_t knots, uint32_t spacing, uint32_t lines)
{
    return knots >= 2 && knots <= 65 && (uint64_t)spacing * (knots - 1u) >= lines;
}

/* Whether the slow table and its words behind are in range, so that every offset is. A spline stays between the least
 * and the greatest of its words. */
static bool good_slow_table(const dac_slow_part *slow, int64_t most)
{
    const uint32_t length = UINT32_C(1) << slow->index_bits;

    for (uint32_t i = 0; i < length + 3; i++) {
        const int32_t word = slow->table[i];
        const int64_t offset = (int64_t)slow->gain_word * word * DAC_SPLINE_UNIT + slow->offset_word;
        if (word >= INT32_C(1) << 20 || word < -(INT32_C(1) << 20) || offset >= most || offset <= -most
            || word != slow->table[i % length])
            return false;
    }
    return true;
}

static bool good_mixture(const dac_axis_program *p, const dac_slow_part *slow, uint32_t lines)
{
    return slow->second == NULL
        || ((CUBIC(p) || p->index_bits <= 8) && slow->mixed != NULL && slow->ratios != NULL
            && good_knots(slow->ratio_knots, slow->ratio_spacing, lines));
}

static bool good_gains(const dac_slow_part *slow, uint32_t lines)
{
    if (slow->gains == NULL || !good_knots(slow->gain_knots, slow->gain_spacing, lines))
        return false;
    for (unsigned i = 0; i < slow->gain_knots; i++)
        if (slow->gains[i] >= INT32_C(1) << 17 || slow->gains[i] < -(INT32_C(1) << 17))
            return false;
    return true;
}

static bool good_slow_part(const dac_axis_program *p, uint32_t lines)
{
    const dac_slow_part *const slow = p->slow;
    const int64_t most = INT64_C(2) << (p->dac_bits + p->gain_q); /* of an offset, as without a slow part */

    if (slow == NULL)
        return true;
    return p->index_bits != 0 && good_mixture(p, slow, lines) && good_gains(slow, lines) && slow->table != NULL
        && slow->index_bits >= 3 && slow->index_bits <= 14 && slow->gain_word >= -(INT32_C(1) << 17)
        && slow->gain_word < INT32_C(1) << 17 && slow->offset_word < most && slow->offset_word > -most
        && good_slow_table(slow, most);
}

static bool mixes(const dac_axis_program *p)
{
    return p->slow != NULL && p->slow->second != NULL;
}

/* Whether both slow parts are good, and their lines are mixed in memory of their own. */
static bool good_slow_parts(const dac_program *p)
{
    const uint32_t lines = p->schedule.frame_lines;

    return good_slow_part(&p->x, lines) && good_slow_part(&p->y, lines)
        && (!mixes(&p->x) || !mixes(&p->y) || p->x.slow->mixed != p->y.slow->mixed);
}
#endif

/* Whether a program is for the converter, which dac_sequencer_init() has found good, or has left at 0 bits. */
static bool same_converter(const dac_axis_program *p, const dac_axis *axis)
{
    const bool shifted = p->left_aligned && p->word_bits != p->dac_bits;
    return axis->bits != 0 && p->dac_bits == axis->bits && p->word_bits == axis->word_bits
        && p->twos_complement == (axis->flip != 0) && shifted == (axis->shift != 0);
}

/* The first reason not to play an axis. */
static dac_loaded judge_axis(const dac_axis_program *p, const dac_axis *axis)
{
    return !same_converter(p, axis) ? DAC_OTHER_CONVERTER
         : !good_storage(p) ? DAC_OTHER_STORAGE
         : !good_table(p) ? DAC_BAD_TABLE
         : !good_output(p) ? DAC_BAD_OUTPUT
#if DAC_SHAPING
         : !good_shaping(p) ? DAC_BAD_SHAPING
#endif
         : DAC_LOADED;
}

/* numerator 2^`zeros` by divisor < 2^31, rounded up, by long division: 96 bits or fewer, some 12 instructions a bit. */
static dac_position power_divided(unsigned zeros, uint32_t divisor)
{
    dac_position quotient = {0, 0};
    uint32_t rest = 1;
    const dac_position one = {0, 1};

    for (;; rest <<= 1) {
        if (rest >= divisor) {
            rest -= divisor;
            quotient.low |= 1;
        }
        if (zeros-- == 0)
            break;
        quotient.high = quotient.high << 1 | (uint32_t)(quotient.low >> 63);
        quotient.low <<= 1;
    }
    if (rest != 0)
        dac_advance(&quotient, &one);
    return quotient;
}

#if DAC_SHAPING
/* Gain and offset as dac_shaping_play() needs them: the offset without the half of the rounding, which is fed back.
 * Returns whether they fit. */
static bool scale_shaped(dac_bank_axis *b, const dac_axis_program *p)
{
#if !DAC_LONG_MULTIPLY
    b->run_gain = p->gain_word * (INT32_C(1) << DAC_UP(p->bits, b->guard));
    b->run_offset = p->offset_word * ((int64_t)1 << DAC_UP(p->bits, b->guard));
#elif DAC_TABLE_STORAGE_BITS != 16
    b->run_gain = p->gain_word;
    b->run_offset = p->offset_word;
#else
    /* With the 11 bits more of a sample the upper word has the code and its remainder. */
    const unsigned up = 29u - p->bits;
    const int32_t most = up > 14 ? INT32_C(1) << (31 - up) : INT32_C(1) << 17;
    if (p->gain_word >= most || p->gain_word < -most)
        return false;
    b->run_gain = p->gain_word * (INT32_C(1) << up);
    b->run_offset = p->offset_word * ((int64_t)1 << (up + 11));
#endif
    return true;
}
#endif

static uint32_t distance(int32_t here, int32_t there)
{
    return here < there ? (uint32_t)there - (uint32_t)here : (uint32_t)here - (uint32_t)there;
}

/* The most that neighbouring words of the table differ by, on any line. */
static uint32_t steepest_words(const dac_axis_program *p)
{
    uint32_t steepest = 0;
#if DAC_SLOW_PART
    uint32_t ratio = 0;

    for (unsigned i = 0; mixes(p) && i < p->slow->ratio_knots; i++)
        if (distance(p->slow->ratios[i], 0) > ratio)
            ratio = distance(p->slow->ratios[i], 0);
#endif
    for (uint32_t i = 0; i < p->length; i++) {
        uint32_t way = distance(DAC_TABLE_WORD(p->table[i]), DAC_TABLE_WORD(p->table[i + 1]));
#if DAC_SLOW_PART
        if (mixes(p)) /* words are mixed to the nearest */
            way += (ratio * distance(p->slow->second[i], p->slow->second[i + 1 == p->length ? 0 : i + 1]) >> 12) + 1;
#endif
        if (way > steepest)
            steepest = way;
    }
    return steepest;
}

/* The largest gain of any line, without its sign. */
static uint32_t largest_gain(const dac_axis_program *p)
{
    uint32_t largest = distance(p->gain_word, 0);

#if DAC_SLOW_PART
    for (unsigned i = 0; p->slow != NULL && i < p->slow->gain_knots; i++)
        if (distance(p->slow->gains[i], 0) > largest)
            largest = distance(p->slow->gains[i], 0);
#endif
    return largest;
}

/* The most that codes move by from one advance to the next, without a ramp. The samples between two words are on a
 * straight line, or on a spline, which is nowhere steeper than its steepest two words are. */
static int32_t steepest_step(const dac_bank_axis *b, const dac_axis_program *p)
{
    const uint32_t unit = CUBIC(p) ? DAC_SPLINE_UNIT : UINT32_C(1) << b->guard; /* of a sample, for an LSB of a word */
    const uint64_t words = (uint64_t)b->step.high + 1; /* from one advance to the next, with a fraction */
    const uint32_t rise = steepest_words(p);
    /* Both samples are rounded, by less than 1 each. */
    const uint64_t move = (unit * rise * words >> (CUBIC(p) ? 18 : 15)) + 3;
    const uint64_t codes = (largest_gain(p) * move >> p->gain_q) + 1;

    /* Words may have more bits than the program says, so that a product is cut off. */
    return rise >> 25 != 0 || move >> 26 != 0 || codes > INT32_MAX ? INT32_MAX : (int32_t)codes;
}

/* Windows of a run in the range of codes, at least: 32 bits hold none that is wider than a 32nd. */
#if DAC_LONG_MULTIPLY
enum { WINDOWS = 4 };
#else
enum { WINDOWS = 32, LEAST_BLOCK = 4 };
#endif
enum { RAMP = 4 }; /* codes of a tick for which a window has room */

#if !DAC_LONG_MULTIPLY
#if DAC_SLOW_PART
/* The bits by which runs scale the gain. */
static unsigned run_up(const dac_bank_axis *b, const dac_axis_program *p)
{
#if DAC_TABLE_STORAGE_BITS != 16
    return DAC_UP(p->bits, b->guard);
#elif DAC_SHAPING
    return b->order != 0 ? DAC_UP(p->bits, b->guard) : 0u;
#else
    (void)b;
    (void)p;
    return 0;
#endif
}
#endif

/* Codes that a block may move by: half a window, and on a line with a ramp the spread of its samples. */
static int32_t reach(const dac_bank_axis *b, const dac_axis_program *p, uint8_t bits)
{
    const int32_t half = INT32_C(1) << bits >> 1;
#if DAC_SLOW_PART
    if (p->slow != NULL) {
        const uint32_t gain = largest_gain(p);
        const uint64_t codes = (uint64_t)gain << dac_ramp_spread(gain << run_up(b, p)) >> p->gain_q;
        return codes < (uint32_t)half ? (int32_t)codes : half;
    }
#else
    (void)b;
    (void)p;
#endif
    return half;
}
#endif

/* Widens a window of 2^bits codes, to at most `widest`, until no block of a run leaves it, if the slew guard cannot act
 * on these codes. Only the first one, which follows any code, is then checked against the guard. */
static uint8_t widened(dac_bank_axis *b, const dac_axis_program *p, uint8_t bits, int32_t widest)
{
    int32_t aside = 0; /* a code is so far from the value before its shaping, at most */

#if DAC_SHAPING
    aside = b->order < 2 ? b->order : 2 + (b->zero + 63) / 64;
#endif
    const int32_t step = steepest_step(b, p), allowed = p->max_step - 2 * aside;
    int32_t block;

    if (step > allowed)
        return bits;
    block = DAC_RUN * step + 2 * aside;
#if DAC_SLOW_PART
    b->ramp_most = (int64_t)(allowed - step) << b->gain_q;
    if (p->slow != NULL)
        block += DAC_RUN * RAMP;
#endif
    while (INT32_C(1) << bits < 2 * block && INT32_C(2) << bits <= widest + 1)
        bits++;
    if (INT32_C(1) << bits >> 1 > p->max_step)
        b->run_entry = p->max_step - aside;
#if !DAC_LONG_MULTIPLY
    block = DAC_RUN * step + 2 * aside;
    for (; !b->holds && block > reach(b, p, bits) && b->run_block > LEAST_BLOCK; b->run_block /= 2)
        block = block / 2 + 1;
#endif
    return bits;
}

/* Derives the windows of dac_axis_run, if runs are possible. */
static void allow_runs(dac_bank_axis *b, const dac_axis_program *p)
{
    const int32_t range = p->code_max - p->code_min;
    int32_t widest = range / 32; /* keeps most of the range far enough from the limits */
    const uint32_t most = UINT32_MAX / p->phase_period;
    uint8_t bits = 0;

    b->run_most = 0;
    b->run_entry = 0;
    b->run_block = DAC_RUN;
    /* Runs of a spline take less than half a segment from tick to tick. */
    if (CUBIC(p) && p->hold_ticks == 1 && p->phase_period <= 2 * p->length)
        return;
#if DAC_SHAPING
    if (b->order != 0 && !scale_shaped(b, p))
        return;
#endif
#if !DAC_LONG_MULTIPLY
    uint32_t gain = (uint32_t)(p->gain_word < 0 ? -p->gain_word : p->gain_word);

#if DAC_TABLE_STORAGE_BITS != 16
    const int32_t unit = INT32_C(1) << DAC_UP(p->bits, b->guard);
    gain *= (uint32_t)unit;
#if DAC_SHAPING
    if (b->order == 0)
#endif
    {
        b->run_gain = p->gain_word * unit;
        b->run_offset = b->offset * unit;
    }
#elif DAC_SHAPING
    if (b->order != 0)
        gain <<= DAC_UP(p->bits, b->guard);
#endif
    b->run_spread = 31 + DAC_FINE;
    for (; gain != 0; gain >>= 1)
        b->run_spread--;
    if (b->run_spread > 19 + DAC_FINE)
        b->run_spread = 19 + DAC_FINE;
#else
    const unsigned left = 32u - p->gain_q;
#if DAC_SHAPING
    if (b->order == 0)
#endif
    {
        if (left > 30 || largest_gain(p) > (uint32_t)INT32_MAX >> left) /* it would not fit */
            return;
        b->run_gain = p->gain_word * (INT32_C(1) << left);
        b->run_offset = b->offset * ((int64_t)1 << left);
    }
#endif
    b->run_most = most > 258 ? 256 : most > 2 ? most - 2 : 0;
    if (widest > p->max_step)
        widest = p->max_step;
    while ((widest + 1) >> (bits + 1) != 0) /* gain_q + bits <= 31, with words of 16 bits */
        bits++;
#if DAC_SHAPING && !DAC_LONG_MULTIPLY
    if (b->order != 0 && bits < 4) /* what is fed back may leave half a window */
        b->run_most = 0;
#endif
    dac_set_window(b, widened(b, p, bits, range / WINDOWS));
}

static void derive(dac_bank_axis *b, const dac_axis_program *p)
{
    const dac_position word = {UINT32_C(1) << 15, 0};

    b->step = p->index_bits ? power_divided(79u + (CUBIC(p) ? 3u : 0u) + INDEX_BITS(p), p->phase_period) : word;
    b->table = p->table;
    b->length = p->length;
    b->holds = p->hold_ticks != 1;
#if DAC_SPLINE
    b->cubic = CUBIC(p);
#endif
#if DAC_SHAPING
    b->order = p->shaping_order;
    b->zero = p->shaping_zero;
    b->remainder_bits = (uint8_t)(28 - p->dac_bits);
#endif
    b->guard = (uint8_t)guard_bits(p);
    b->gain = p->gain_word;
    b->gain_q = p->gain_q;
    b->offset = p->offset_word + ((int64_t)1 << (p->gain_q - 1));
    b->code_min = p->code_min;
    b->code_max = p->code_max;
    b->max_step = p->max_step;
    b->park_code = p->park_code;
    allow_runs(b, p);
}

#if DAC_SLOW_PART
/* Derives what dac_slow_begin_line() needs. */
static void derive_slow_part(dac_bank_axis *b, const dac_axis_program *p, uint32_t lines)
{
    const uint32_t ticks = p->phase_period;

    b->slow = p->slow;
    b->fast = p->table;
    b->lines = lines;
    b->bits = p->bits;
    b->ramp_step = UINT32_MAX / ticks + (UINT32_MAX % ticks == ticks - 1 ? 1u : 0u); /* 0 for a line of 1 tick */
    b->line_most = b->run_most;
    b->ramp = 0;
    b->run_ramp = 0;
    if (mixes(p))
        b->table = p->slow->mixed;
}
#endif

dac_loaded dac_sequencer_load(dac_sequencer *s, const dac_program *p)
{
    if (!dac_sequencer_writable(s))
        return DAC_BUSY;
    if (!good_schedule(&p->schedule))
        return DAC_BAD_SCHEDULE;
#if DAC_PIXEL_TABLE
    if (!good_pixels(&p->schedule))
        return DAC_BAD_SCHEDULE;
#endif
    const dac_loaded x = judge_axis(&p->x, &s->x), y = judge_axis(&p->y, &s->y);
    if (x != DAC_LOADED || y != DAC_LOADED)
        return x != DAC_LOADED ? x : y;
#if DAC_SLOW_PART
    if (!good_slow_parts(p))
        return DAC_BAD_SLOW_PART;
#endif
    if (!good_periods(p))
        return DAC_BAD_PERIOD;

    dac_bank *const bank = &s->bank[dac_sequencer_idle(s)];
    bank->schedule = p->schedule;
    derive(&bank->x, &p->x);
    derive(&bank->y, &p->y);
#if DAC_SLOW_PART
    derive_slow_part(&bank->x, &p->x, p->schedule.frame_lines);
    derive_slow_part(&bank->y, &p->y, p->schedule.frame_lines);
#endif
    s->loaded = 1;
    s->loaded_after = s->swaps;
    return DAC_LOADED;
}
