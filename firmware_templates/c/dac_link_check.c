/* The checks of a program before it is loaded, in slices. tablegen/link/acceptance.py has the same for hosts. */
#include "dac_arithmetic.h"
#include "dac_link_parts.h"
#include "dac_slow.h"

enum {
    CRC, PROGRAM, FOURIER, RENDER, WORD,
#if DAC_SLOW_PART
    SLOW_WORD,
#endif
#if DAC_PIXEL_TABLE
    PIXELS,
#endif
    RANGE, SLEW, JUMP
};

#if DAC_SLOW_PART
#define MOVED_WORDS SLOW_WORD /* the only check of words that a MOVE needs */
#else
#define MOVED_WORDS RANGE
#endif

#define OUTSIDE 1 /* codes: ticks need not visit a word, and rounding may carry it over a limit that no tick crosses */

/* From a word to its code. */
struct output {
    const dac_word *table;
    uint32_t length;
#if DAC_SPLINE
    bool cubic;
#endif
    unsigned guard, gain_q;
    int32_t gain, code_min, code_max, park_code;
    int64_t offset; /* offset plus half an LSB */
#if DAC_SLOW_PART
    const dac_slow_part *slow; /* or NULL; gain and offset are then those of a line */
    unsigned bits;
    uint32_t lines, ramp_step;
#endif
};

static const dac_link_finding nothing = {DAC_LINK_NO_REASON, 0};

static dac_link_finding finding(uint8_t reason, unsigned axis, uint32_t word)
{
    const dac_link_finding found = {reason, axis + 2 * word};
    return found;
}

static struct output output_of(const dac_link *l, unsigned axis)
{
    dac_program program;
    struct output o;

    dac_link_program_of(l, &program);
    const dac_axis_program *const p = axis == 0 ? &program.x : &program.y;
    o.table = p->table;
    o.length = p->length;
#if DAC_SPLINE
    o.cubic = (p->index_bits & DAC_CUBIC) != 0;
#endif
    o.guard = p->bits > 21 ? 25u - p->bits : 4u;
    o.gain_q = p->gain_q;
    o.gain = p->gain_word;
    o.code_min = p->code_min;
    o.code_max = p->code_max;
    o.park_code = p->park_code;
    o.offset = p->offset_word + ((int64_t)1 << (p->gain_q - 1));
#if DAC_SLOW_PART
    o.slow = p->slow;
    o.bits = p->bits;
    o.lines = program.schedule.frame_lines;
    o.ramp_step = dac_link_program_word(&l->image[l->idle], axis + 1, DAC_LINK_PHASE_STEP);
#endif
    return o;
}

/* Reads the active program from its bank: the consumer reads it too, and nobody writes it. */
static struct output playing_of(const dac_link *l, unsigned axis)
{
    const dac_bank *const bank = &l->sequencer->bank[l->sequencer->playing];
    const dac_bank_axis *const b = axis == 0 ? &bank->x : &bank->y;
    struct output o;

    o.table = b->table;
    o.length = b->length;
#if DAC_SPLINE
    o.cubic = b->cubic != 0;
#endif
    o.guard = b->guard;
    o.gain_q = b->gain_q;
    o.gain = b->gain;
    o.code_min = b->code_min;
    o.code_max = b->code_max;
    o.park_code = b->park_code;
    o.offset = b->offset;
#if DAC_SLOW_PART
    o.slow = b->slow;
    o.bits = b->bits;
    o.lines = b->lines;
    o.ramp_step = b->ramp_step;
    if (o.slow != NULL)
        o.table = b->fast;
#endif
    return o;
}

static int64_t unclamped(const struct output *o, int32_t sample)
{
    return ((int64_t)o->gain * sample + o->offset) >> o->gain_q;
}

static int32_t code(const struct output *o, int32_t sample)
{
    const int64_t wide = unclamped(o, sample);
    return wide < o->code_min ? o->code_min : wide > o->code_max ? o->code_max : (int32_t)wide;
}

static int32_t sample_of(const struct output *o, int32_t word)
{
#if DAC_SPLINE
    if (o->cubic)
        return word * DAC_SPLINE_UNIT;
#endif
    return word * (INT32_C(1) << o->guard);
}

#if DAC_SLOW_PART
/* A line of a frame with a slow part. */
struct line {
    dac_slow_line at;
    int64_t offset; /* plus half an LSB */
};

static struct line line_of(const struct output *o, uint32_t number)
{
    struct line line;

    line.at = dac_slow_line_of(o->slow, number, o->lines, o->ramp_step);
    line.offset = line.at.offset + ((int64_t)1 << (o->gain_q - 1));
    return line;
}

/* A word of the table of a line; behind the last one the first. */
static dac_word mixed_word(const struct output *o, const struct line *line, uint32_t index)
{
    const uint32_t at = index & (o->length - 1);

    return o->slow->second == NULL ? o->table[at]
         : dac_slow_mix(o->table[at], o->slow->second[at], line->at.ratio, -(INT32_C(1) << (o->bits - 1)));
}

/* The code of a tick of a line, by its phase. */
static int64_t line_sum(const struct output *o, const struct line *line, uint32_t phase, uint32_t tick)
{
    unsigned index_bits = 3;
    dac_word words[4] = {0, 0, 0, 0}; /* gcc's analyser does not see that the loop fills it */
    int32_t sample;

    while (o->length >> index_bits != 1)
        index_bits++;
    for (unsigned i = 0; i < 4; i++)
        words[i] = mixed_word(o, line, (phase >> (32 - index_bits)) + i);
#if DAC_SPLINE
    if (o->cubic) {
        const dac_segment segment = dac_segment_of(words);
        sample = dac_spline_eval(&segment, phase << index_bits >> 14);
    } else
#endif
        sample = dac_lerp(words[0], words[1], phase << index_bits >> 17, o->guard, DAC_HALF(o->guard));
    return ((int64_t)line->at.gain * sample + line->offset + (int64_t)tick * line->at.ramp) >> o->gain_q;
}

static int32_t line_code(const struct output *o, const struct line *line, uint32_t phase, uint32_t tick)
{
    const int64_t wide = line_sum(o, line, phase, tick);
    return wide < o->code_min ? o->code_min : wide > o->code_max ? o->code_max : (int32_t)wide;
}
#endif

/* The code at the first advance of a period. */
static int32_t first_code(const struct output *o)
{
#if DAC_SLOW_PART
    if (o->slow != NULL) {
        const struct line line = line_of(o, 0);
        return line_code(o, &line, 0, 0);
    }
#endif
#if DAC_SPLINE
    if (o->cubic)
        return code(o, dac_segment_of(o->table).b0);
#endif
    return code(o, sample_of(o, o->table[0]));
}

static uint32_t distance(int32_t a, int32_t b)
{
    return a < b ? (uint32_t)b - (uint32_t)a : (uint32_t)a - (uint32_t)b;
}

/* The program words. */

static bool inside(const dac_link_image *image, unsigned window, uint32_t length)
{
    const uint32_t first = dac_link_program_word(image, 0, window), count = dac_link_program_word(image, 0, window + 1);
    return first <= length && count <= length - first;
}

/* Whether each pixel has a tick of a window, if that has any. */
static bool has_pixels(const dac_link_image *image, unsigned window)
{
    const uint32_t count = dac_link_program_word(image, 0, window + 1);
    return count == 0 || dac_link_program_word(image, 0, DAC_LINK_PIXELS) <= count;
}

static bool good_schedule(const dac_link_image *image)
{
    const uint32_t ticks = dac_link_program_word(image, 0, DAC_LINK_LINE_TICKS);
    const uint32_t lines = dac_link_program_word(image, 0, DAC_LINK_FRAME_LINES);

    return ticks >= 1 && ticks <= UINT32_C(1) << 24 && lines >= 1 && lines <= INT32_MAX / ticks
        && inside(image, DAC_LINK_FORWARD, ticks) && inside(image, DAC_LINK_BACKWARD, ticks)
        && inside(image, DAC_LINK_UP, lines) && inside(image, DAC_LINK_DOWN, lines)
        && dac_link_program_word(image, 0, DAC_LINK_TURN_TICK) <= ticks
        && has_pixels(image, DAC_LINK_FORWARD) && has_pixels(image, DAC_LINK_BACKWARD)
        && dac_link_program_word(image, 0, DAC_LINK_Y_STEPS) <= 1;
}

/* Whether step and remainder, in words of a page that follow each other, are those of a period. */
static bool good_phase(const dac_link_image *image, unsigned axis, uint32_t period, unsigned word)
{
    uint32_t step = UINT32_MAX / period, remainder = UINT32_MAX % period + 1; /* quotient and remainder of 2^32 */

    if (remainder == period) {
        step++;
        remainder = 0;
    }
    return dac_link_program_word(image, axis + 1, word) == step
        && dac_link_program_word(image, axis + 1, word + 1) == remainder;
}

static bool good_period(const dac_link *l, const dac_link_image *image, unsigned axis)
{
    const uint32_t ticks = dac_link_program_word(image, 0, DAC_LINK_LINE_TICKS);
    const uint32_t lines = dac_link_program_word(image, 0, DAC_LINK_FRAME_LINES);
    const bool steps = dac_link_program_word(image, 0, DAC_LINK_Y_STEPS) != 0;
    const uint32_t slow = dac_link_slow_word(l, image, axis);
    const uint32_t wanted = axis == 0 || slow != 0 ? ticks : steps ? lines : ticks * lines;

#if DAC_SLOW_PART
    if (slow != 0) {
        const uint64_t spacing = dac_link_program_word(image, axis + 1, DAC_LINK_KNOT_SPACING);
        if ((axis == 1 && steps) || spacing * ((slow & 127u) - 1) < lines
            || !good_phase(image, axis, lines, DAC_LINK_SLOW_STEP))
            return false;
    }
#endif
    return good_phase(image, axis, wanted, DAC_LINK_PHASE_STEP)
        && dac_link_program_word(image, axis + 1, DAC_LINK_PHASE_PERIOD) == wanted;
}

static bool good_output(const dac_link *l, const dac_link_image *image, unsigned axis)
{
    const uint32_t code_min = dac_link_program_word(image, axis + 1, DAC_LINK_CODE_MIN);
    const uint32_t code_max = dac_link_program_word(image, axis + 1, DAC_LINK_CODE_MAX);
    const uint32_t park_code = dac_link_program_word(image, axis + 1, DAC_LINK_PARK_CODE);
    dac_program program;

    dac_link_program_of(l, &program);
    const dac_axis_program *const p = axis == 0 ? &program.x : &program.y;
    const int64_t reach = INT64_C(2) << (p->dac_bits + p->gain_q);
    return p->gain_word >= -(INT32_C(1) << 17) && p->gain_word < INT32_C(1) << 17
        && p->offset_word > -reach && p->offset_word < reach
        && dac_link_program_word(image, axis + 1, DAC_LINK_OFFSET_LOW) < UINT32_C(1) << 18
        && code_min <= park_code && park_code <= code_max && code_max < UINT32_C(1) << p->dac_bits
        && p->max_step >= 1 && p->max_step < INT32_C(1) << 24;
}

static uint32_t order_of(const dac_link_image *image, unsigned axis)
{
    return dac_link_program_word(image, axis + 1, DAC_LINK_SHAPING_WORD) & 3;
}

static uint32_t zero_of(const dac_link_image *image, unsigned axis)
{
    return dac_link_program_word(image, axis + 1, DAC_LINK_SHAPING_WORD) >> 8;
}

static bool good_shaping(const dac_link_image *image, unsigned axis)
{
    const uint32_t order = order_of(image, axis), zero = zero_of(image, axis);
    const uint32_t most_zero = order == 3 ? 128 : 0;

    if (order > DAC_SHAPING || zero > most_zero)
        return false;
    return dac_link_program_word(image, axis + 1, DAC_LINK_SHAPING_WORD) == (order | zero << 8);
}

/* By how many whole codes shaping can move a code, and by how many more a step. */
static uint32_t code_excess(const dac_link_image *image, unsigned axis)
{
    const uint32_t order = order_of(image, axis);
    return order < 3 ? order : 2 + (zero_of(image, axis) >> 6);
}

static uint32_t step_excess(const dac_link_image *image, unsigned axis)
{
    const uint32_t order = order_of(image, axis);
    return order < 3 ? 2 * order : 4 + ((zero_of(image, axis) + 31) >> 5);
}

static dac_link_finding check_program(const dac_link *l)
{
    const dac_link_image *const image = &l->image[l->idle];

    if (!good_schedule(image))
        return finding(DAC_LINK_SCHEDULE, 0, 0);
    for (unsigned axis = 0; axis < 2; axis++)
        if (!good_period(l, image, axis))
            return finding(DAC_LINK_PERIOD, axis, 0);
    for (unsigned axis = 0; axis < 2; axis++)
        if (!good_output(l, image, axis))
            return finding(DAC_LINK_OUTPUT, axis, 0);
    for (unsigned axis = 0; axis < 2; axis++)
        if (!good_shaping(image, axis))
            return finding(DAC_LINK_SHAPING, axis, 0);
    for (unsigned axis = 0; axis < 2; axis++) {
        const dac_link_limits *const limits = axis == 0 ? &l->x_limits : &l->y_limits;
        if (dac_link_program_word(image, axis + 1, DAC_LINK_CODE_MIN) < limits->code_min
            || dac_link_program_word(image, axis + 1, DAC_LINK_CODE_MAX) > limits->code_max)
            return finding(DAC_LINK_CODES, axis, 0);
    }
    for (unsigned axis = 0; axis < 2; axis++)
        if (dac_link_program_word(image, axis + 1, DAC_LINK_MAX_STEP)
            > (axis == 0 ? l->x_limits.max_step : l->y_limits.max_step))
            return finding(DAC_LINK_STEP, axis, 0);
    return nothing;
}

/* The words, a slice at a time. Each of these says by *done that it has seen all of an axis. */

static const dac_link_part *part_of(const dac_link *l, unsigned axis)
{
    return axis == 0 ? l->x_part : l->y_part;
}

/* From check.at to the end of this slice. */
static uint32_t slice(const dac_link *l, uint32_t length)
{
    const uint32_t left = length - l->check.at;
    return l->check.at + (left < DAC_LINK_SLICE ? left : DAC_LINK_SLICE);
}

static dac_link_finding check_fourier(dac_link *l, unsigned axis, bool *done)
{
    const dac_link_part *const part = part_of(l, axis);
    dac_link_check *const c = &l->check;
    const int32_t *const words = dac_link_axis_of(l, axis)->fourier;

    *done = true;
    if (part->harmonics == 0)
        return nothing;
    for (const uint32_t end = slice(l, part->words); c->at != end; c->at++)
        c->sum += words[c->at] < 0 ? 0u - (uint32_t)words[c->at] : (uint32_t)words[c->at];
    *done = c->at == part->words;
    return *done && c->sum >= UINT64_C(1) << 32 ? finding(DAC_LINK_FOURIER, axis, 0) : nothing;
}

/* Not in slices: dac_synthesize() computes a whole table. It accepts all that check_fourier() accepts. */
static void render(const dac_link *l, unsigned axis)
{
    const dac_link_axis *const here = dac_link_axis_of(l, axis);
    const uint8_t *const shape = dac_link_shape(&l->image[l->idle], axis);

    if (part_of(l, axis)->harmonics != 0)
        (void)dac_synthesize(here->table[l->idle], here->room, dac_link_index_bits(&l->image[l->idle], axis), shape[1],
                             here->fourier, part_of(l, axis)->harmonics,
                             l->config->sine, l->config->sine_index_bits);
}

static dac_link_finding check_words(dac_link *l, unsigned axis, bool *done)
{
    const dac_link_part *const part = part_of(l, axis);
    const int32_t half = INT32_C(1) << (dac_link_shape(&l->image[l->idle], axis)[1] - 1);
    dac_word *const table = dac_link_axis_of(l, axis)->table[l->idle];
    dac_link_check *const c = &l->check;

    *done = true;
    if (part->harmonics != 0)
        return nothing;
    for (const uint32_t end = slice(l, part->words); c->at != end; c->at++)
        if (table[c->at] < -half || table[c->at] >= half)
            return finding(DAC_LINK_WORD, axis, c->at);
    *done = c->at == part->words;
    if (*done) /* the sequencer reads the first words behind the last */
        for (unsigned i = 0; i < DAC_WORDS_BEHIND; i++)
            table[part->words + i] = table[i];
    return nothing;
}

#if DAC_SLOW_PART
/* The words of a slow part that have more room than they may use: slow table, then gains. A word is counted from the
 * first of its axis. */
static dac_link_finding check_slow_words(dac_link *l, unsigned axis, bool *done)
{
    const dac_link_image *const image = &l->image[l->idle];
    const int32_t half = INT32_C(1) << (dac_link_shape(image, axis)[1] - 1);
    dac_link_check *const c = &l->check;
    dac_program program;

    *done = true;
    if (dac_link_slow_word(l, image, axis) == 0)
        return nothing;
    const dac_slow_part *const slow = &l->slow[dac_link_slow_at(l)][axis];
    const uint32_t words = UINT32_C(1) << slow->index_bits, before = 2 * dac_link_table_words(image, axis);
    dac_word *const table = dac_link_axis_of(l, axis)->slow[dac_link_tables(l)].table;
    dac_link_program_of(l, &program);
    const dac_axis_program *const p = axis == 0 ? &program.x : &program.y;
    const int64_t reach = INT64_C(2) << (p->dac_bits + p->gain_q); /* as that of an offset word */
    for (const uint32_t end = slice(l, words + slow->gain_knots); c->at != end; c->at++) {
        if (c->at < words) {
            const int64_t offset = (int64_t)slow->gain_word * table[c->at] * DAC_SPLINE_UNIT + slow->offset_word;
            if (table[c->at] < -half || table[c->at] >= half || offset >= reach || offset <= -reach)
                return finding(DAC_LINK_WORD, axis, before + c->at);
        } else if (slow->gains[c->at - words] < -(INT32_C(1) << 17)
                   || slow->gains[c->at - words] >= INT32_C(1) << 17) {
            return finding(DAC_LINK_WORD, axis, before + c->at);
        }
    }
    *done = c->at == words + slow->gain_knots;
    if (*done && dac_link_tables(l) == l->idle) /* the sequencer reads three words behind the last of a slow table */
        for (unsigned i = 0; i < 3; i++)
            table[words + i] = table[i];
    return nothing;
}

/* Whether the words of a line show that none of its codes is out of range: a sample stays between the least and the
 * greatest of them, and the offset between that of the first and that of the last tick. */
static bool words_in_range(const dac_link *l, const struct output *o, const struct line *line, uint32_t ticks)
{
    const int64_t a = (int64_t)line->at.gain * sample_of(o, l->check.lowest);
    const int64_t b = (int64_t)line->at.gain * sample_of(o, l->check.highest);
    const int64_t rise = line->at.ramp * (int64_t)(ticks - 1);
    const int64_t least = (a < b ? a : b) + line->offset + (rise < 0 ? rise : 0);
    const int64_t most = (a < b ? b : a) + line->offset + (rise < 0 ? 0 : rise);

    return least >> o->gain_q >= o->code_min && most >> o->gain_q <= o->code_max;
}

/* Whether the words of a line show that none of its steps is too large. From tick to tick a sample moves by at most
 * the steepest way between two words, by what cuts the fraction off, and by 2 for its rounding. */
static bool words_in_step(const dac_link *l, const struct output *o, const struct line *line, uint32_t ticks,
                          uint32_t max_step)
{
    const uint64_t gain = distance(line->at.gain, 0), ramp = (uint64_t)(line->at.ramp < 0 ? -line->at.ramp
                                                                                          : line->at.ramp);
    const uint64_t rise = (uint64_t)sample_of(o, (int32_t)l->check.rise);
    const uint64_t rest = ((ramp + gain * (3 + (rise >> 15))) >> o->gain_q) + 1;

    return rest < max_step && ((gain * rise * o->length) >> o->gain_q) < ticks * (max_step - rest);
}

/* Every line of a frame, by its words if these are enough, and else by its ticks. */
static dac_link_finding check_lines(dac_link *l, unsigned axis, uint8_t reason, bool *done)
{
    const dac_link_image *const image = &l->image[l->idle];
    const uint32_t ticks = dac_link_program_word(image, 0, DAC_LINK_LINE_TICKS);
    const uint32_t step = dac_link_program_word(image, axis + 1, DAC_LINK_PHASE_STEP);
    const uint32_t remainder = dac_link_program_word(image, axis + 1, DAC_LINK_PHASE_REMAINDER);
    const uint32_t limit = dac_link_program_word(image, axis + 1, DAC_LINK_MAX_STEP);
    const uint32_t excess = step_excess(image, axis), max_step = limit - excess;
    const bool slew = reason == DAC_LINK_SLEW;
    const struct output o = output_of(l, axis);
    dac_link_check *const c = &l->check;
    const struct line line = line_of(&o, c->line);

    if (slew && limit < excess)
        return finding(reason, axis, 0);
    if (c->at == 0 && !c->exact) {
        const int32_t now = line_code(&o, &line, 0, 0);
        if (c->line == 0)
            c->first = now;
        else if (slew && distance(now, c->before) > max_step)
            return finding(reason, axis, c->line - 1);
        c->rise = 0;
        c->lowest = c->highest = mixed_word(&o, &line, 0);
    }
    if (!c->exact) {
        for (const uint32_t end = slice(l, o.length); c->at != end; c->at++) {
            const int32_t word = mixed_word(&o, &line, c->at);
            const uint32_t rise = distance(mixed_word(&o, &line, c->at + 1), word);
            c->lowest = word < c->lowest ? word : c->lowest;
            c->highest = word > c->highest ? word : c->highest;
            c->rise = rise > c->rise ? rise : c->rise;
        }
        if (c->at != o.length)
            return nothing;
        c->at = c->phase = c->remainder = 0;
        c->exact = slew ? !words_in_step(l, &o, &line, ticks, max_step) : !words_in_range(l, &o, &line, ticks);
        if (c->exact)
            return nothing;
    } else {
        for (const uint32_t end = slice(l, ticks); c->at != end; c->at++) {
            const int64_t wide = line_sum(&o, &line, c->phase, c->at);
            const int32_t now = line_code(&o, &line, c->phase, c->at);
            if (slew ? c->at != 0 && distance(now, c->before) > max_step : wide < o.code_min || wide > o.code_max)
                return finding(reason, axis, c->line);
            c->before = now;
            c->phase += step;
            c->remainder += remainder;
            if (c->remainder >= ticks) {
                c->remainder -= ticks;
                c->phase++;
            }
        }
        if (c->at != ticks)
            return nothing;
        c->at = 0;
        c->exact = false;
    }
    c->before = line_code(&o, &line, 0u - step - (remainder != 0 ? 1u : 0u), ticks - 1);
    c->line++;
    *done = c->line == o.lines;
    return *done && slew && distance(c->first, c->before) > max_step ? finding(reason, axis, c->line - 1) : nothing;
}

static bool has_slow(const dac_link *l, unsigned axis)
{
    return dac_link_slow_word(l, &l->image[l->idle], axis) != 0;
}
#endif

static dac_link_finding check_range(dac_link *l, unsigned axis, bool *done)
{
    const struct output o = output_of(l, axis);
    const int32_t outside = OUTSIDE + (int32_t)code_excess(&l->image[l->idle], axis);
    dac_link_check *const c = &l->check;

    for (const uint32_t end = slice(l, o.length); c->at != end; c->at++) {
        const int64_t at = unclamped(&o, sample_of(&o, o.table[c->at]));
        if (at < o.code_min - outside || at > o.code_max + outside)
            return finding(DAC_LINK_RANGE, axis, c->at);
    }
    *done = c->at == o.length;
    return nothing;
}

/* The code of an advance, by the phase of `check`. */
static int32_t advance_code(const dac_link *l, const struct output *o, unsigned index_bits)
{
    const uint32_t phase = l->check.phase;
    if (index_bits == 0)
        return code(o, sample_of(o, o->table[l->check.at]));
    const uint32_t index = phase >> (32 - index_bits);
#if DAC_SPLINE
    if (o->cubic) {
        const dac_segment segment = dac_segment_of(o->table + index);
        return code(o, dac_spline_eval(&segment, phase << index_bits >> 14));
    }
#endif
    const int32_t here = o->table[index], there = o->table[(index + 1) & (o->length - 1)];
    return code(o, dac_lerp(here, there, phase << index_bits >> 17, o->guard, DAC_HALF(o->guard)));
}

/* Every advance of a period that is not much longer than its table. */
static dac_link_finding check_advances(dac_link *l, unsigned axis, uint32_t advances, bool *done)
{
    const dac_link_image *const image = &l->image[l->idle];
    const uint32_t step = dac_link_program_word(image, axis + 1, DAC_LINK_PHASE_STEP);
    const uint32_t remainder = dac_link_program_word(image, axis + 1, DAC_LINK_PHASE_REMAINDER);
    const uint32_t max_step = dac_link_program_word(image, axis + 1, DAC_LINK_MAX_STEP);
    const uint32_t excess = step_excess(image, axis);
    const unsigned index_bits = dac_link_index_bits(image, axis);
    const struct output o = output_of(l, axis);
    dac_link_check *const c = &l->check;

    for (const uint32_t end = slice(l, advances); c->at != end; c->at++) {
        const int32_t now = advance_code(l, &o, index_bits);
        if (c->at == 0)
            c->first = now;
        else if (distance(now, c->before) + excess > max_step)
            return finding(DAC_LINK_SLEW, axis, c->at - 1);
        c->before = now;
        c->phase += step;
        c->remainder += remainder;
        if (c->remainder >= advances) {
            c->remainder -= advances;
            c->phase++;
        }
    }
    *done = c->at == advances;
    return *done && distance(c->first, c->before) + excess > max_step ? finding(DAC_LINK_SLEW, axis, advances - 1)
                                                                      : nothing;
}

/* For a longer period: the steepest segment. */
static dac_link_finding check_segments(dac_link *l, unsigned axis, uint32_t advances, bool *done)
{
    const struct output o = output_of(l, axis);
    dac_link_check *const c = &l->check;

    for (const uint32_t end = slice(l, o.length); c->at != end; c->at++) {
        const uint32_t after = c->at + 1 == o.length ? 0 : c->at + 1;
        const uint32_t rise = distance(o.table[after], o.table[c->at]);
        if (rise > c->rise) {
            c->rise = rise;
            c->steepest = c->at;
        }
    }
    *done = c->at == o.length;
    if (!*done)
        return nothing;
#if DAC_SPLINE
    const uint64_t gain = distance(o.gain, 0), rise = (uint64_t)sample_of(&o, (int32_t)c->rise);
#else
    const uint64_t gain = distance(o.gain, 0), rise = (uint64_t)c->rise << o.guard;
#endif
    const uint64_t max_step = dac_link_program_word(&l->image[l->idle], axis + 1, DAC_LINK_MAX_STEP);
    const uint64_t excess = step_excess(&l->image[l->idle], axis);
    const uint64_t slack = 2 + (gain * (2 + (rise >> 14)) >> o.gain_q);
    return ((gain * rise * o.length) >> o.gain_q) + advances * excess <= advances * (max_step + slack)
        ? nothing : finding(DAC_LINK_SLEW, axis, c->steepest);
}

static dac_link_finding check_slew(dac_link *l, unsigned axis, bool *done)
{
    const dac_link_image *const image = &l->image[l->idle];
    const uint32_t advances = dac_link_program_word(image, axis + 1, DAC_LINK_PHASE_PERIOD);

    return advances <= 2 * dac_link_table_words(image, axis) ? check_advances(l, axis, advances, done)
                                                     : check_segments(l, axis, advances, done);
}

#if DAC_SLOW_PART
/* The furthest way from where the program that plays may be replaced: from the start of any line if it has a slow part,
 * else as without slow parts. An axis at a time; `rise` is the way. */
static dac_link_finding check_jump(dac_link *l, unsigned axis, bool *done)
{
    const dac_status status = dac_sequencer_status(l->sequencer);
    dac_link_check *const c = &l->check;

    *done = true;
    if (status.swaps == 0)
        return nothing;
    const struct output old = playing_of(l, axis), next = output_of(l, axis);
    const uint32_t most = axis == 0 ? l->x_limits.max_jump : l->y_limits.max_jump;
    if ((status.markers & DAC_PLAYING) == 0) {
        c->rise = distance(next.park_code, old.park_code);
    } else {
        const int32_t begin = first_code(&next);
        const uint32_t places = old.slow != NULL ? old.lines : axis == 0 ? 1 : old.length;
        for (const uint32_t end = slice(l, places); c->at != end; c->at++) {
            int32_t from;
            if (old.slow != NULL) {
                const struct line line = line_of(&old, c->at);
                from = line_code(&old, &line, 0, 0);
            } else {
                from = axis == 0 ? first_code(&old) : code(&old, sample_of(&old, old.table[c->at]));
            }
            c->rise = distance(from, begin) > c->rise ? distance(from, begin) : c->rise;
        }
        *done = c->at == places;
    }
    return *done && c->rise > most ? finding(DAC_LINK_JUMP, axis, 0) : nothing;
}
#else
/* Codes rise with words, or fall with them: the least and the greatest word have the codes that are furthest away. */
static dac_link_finding check_jump(dac_link *l, bool *done)
{
    const dac_sequencer *const s = l->sequencer;
    dac_link_check *const c = &l->check;
    struct output y;
    uint32_t jump[2];

    *done = true;
    if (dac_sequencer_status(s).swaps == 0)
        return nothing;
    y = playing_of(l, 1);
    for (const uint32_t end = slice(l, y.length); c->at != end; c->at++) {
        const int32_t word = y.table[c->at];
        c->lowest = c->at == 0 || word < c->lowest ? word : c->lowest;
        c->highest = c->at == 0 || word > c->highest ? word : c->highest;
    }
    *done = c->at == y.length;
    if (!*done)
        return nothing;
    for (unsigned axis = 0; axis < 2; axis++) {
        const struct output old = playing_of(l, axis), next = output_of(l, axis);
        const int32_t begin = first_code(&next);
        if ((dac_sequencer_status(s).markers & DAC_PLAYING) == 0) {
            jump[axis] = distance(next.park_code, old.park_code);
        } else if (axis == 0) {
            jump[0] = distance(first_code(&old), begin);
        } else {
            const uint32_t low = distance(code(&old, sample_of(&old, c->lowest)), begin);
            const uint32_t high = distance(code(&old, sample_of(&old, c->highest)), begin);
            jump[1] = low > high ? low : high;
        }
    }
    return jump[0] > l->x_limits.max_jump ? finding(DAC_LINK_JUMP, 0, 0)
         : jump[1] > l->y_limits.max_jump ? finding(DAC_LINK_JUMP, 1, 0) : nothing;
}
#endif

#if DAC_PIXEL_TABLE
/* The pixels of a window, 0 trace and 1 retrace: each has a tick at least, and all together those of the window. */
static dac_link_finding check_pixels(dac_link *l, unsigned window, bool *done)
{
    const dac_link_image *const image = &l->image[l->idle];
    const uint32_t pixels = dac_link_program_word(image, 0, DAC_LINK_PIXELS);
    const uint32_t count = dac_link_program_word(image, 0, (window == 0 ? DAC_LINK_FORWARD : DAC_LINK_BACKWARD) + 1u);
    dac_link_check *const c = &l->check;

    *done = true;
    if (dac_link_pixel_word(l, image) == 0)
        return nothing;
    const uint16_t *const ticks = l->config->pixel_ticks[l->idle] + window * pixels;
    for (const uint32_t end = slice(l, pixels); c->at != end; c->at++) {
        if (ticks[c->at] == 0 || ticks[c->at] > count - c->sum)
            return finding(DAC_LINK_PIXEL_TICKS, window, c->at);
        c->sum += ticks[c->at];
    }
    *done = c->at == pixels;
    return *done && c->sum != count ? finding(DAC_LINK_PIXEL_TICKS, window, pixels) : nothing;
}
#endif

/* Checks the content of the memory, not the received bytes. */
static dac_link_finding check_crc(dac_link *l, bool *done)
{
    dac_link_check *const c = &l->check;

    if (c->place.part == 0 && c->place.word == 0) {
        c->crc = DAC_LINK_CRC;
        dac_link_mac_begin(&l->digest, 32, NULL, 0);
    }
#if DAC_LINK_Z
    dac_link *const part = c->place.part == DAC_LINK_END && l->has_z ? l->z : l; /* a slice is of one image */
    dac_link_place *const at = &part->check.place;
    for (unsigned i = 0; i < 2 * DAC_LINK_SLICE && at->part != DAC_LINK_END; i++) {
        const uint8_t byte = dac_link_load_byte(part, at);
#else
    for (unsigned i = 0; i < 2 * DAC_LINK_SLICE && c->place.part != DAC_LINK_END; i++) {
        const uint8_t byte = dac_link_load_byte(l, &c->place);
#endif
        c->crc = dac_link_crc(c->crc, byte);
        if (l->config->key_bytes != 0)
            dac_link_mac_byte(&l->digest, byte);
    }
#if DAC_LINK_Z
    *done = at->part == DAC_LINK_END && (part != l || !l->has_z);
#else
    *done = c->place.part == DAC_LINK_END;
#endif
    const bool wrong = *done && ~c->crc != dac_link_get(l->image[l->idle].info + DAC_LINK_IMAGE_CRC);
    return wrong ? finding(DAC_LINK_IMAGE, 0, 0) : nothing;
}

static bool good_tag(dac_link *l)
{
    uint8_t request[11], digest[32], bytes = 10;

    if (l->config->key_bytes == 0)
        return true;
#if DAC_STORE || DAC_LIBRARY
    if (l->loading)
        return true;
#endif
#if DAC_MOVE
    if (l->moving)
        return true;
#endif
    request[0] = DAC_LINK_COMMIT;
    request[1] = l->commit_seq;
    dac_link_put(request + 2, l->commit_session);
    dac_link_put(request + 6, dac_link_get(l->image[l->idle].info + DAC_LINK_IMAGE_CRC));
#if DAC_COMMIT_MODES
    request[10] = l->commit_mode;
    if (l->commit_has_mode)
        bytes = 11;
#endif
    dac_link_mac_end(&l->digest, digest);
    return l->commit_challenged && l->commit_tagged
        && dac_link_tagged(l, l->commit_nonce, request, bytes, digest, l->commit_tag);
}

/* One slice of the check of a stage. */
static dac_link_finding check(dac_link *l, bool *done)
{
    const unsigned axis = l->check.axis;

    switch (l->check.stage) {
    case CRC:
#if DAC_MOVE
        if (l->moving) { /* nothing was received, and its tag has been checked */
            *done = true;
            return nothing;
        }
#endif
#if DAC_LINK_Z
        if (l->is_z) { /* it is part of the CRC of x and y */
            *done = true;
            return nothing;
        }
#endif
        return check_crc(l, done);
    case PROGRAM:
        *done = true;
        return good_tag(l) ? check_program(l) : finding(DAC_LINK_KEY, 0, 0);
    case FOURIER:
        return check_fourier(l, axis, done);
    case RENDER:
        *done = true;
        render(l, axis);
        return nothing;
    case WORD:
        return check_words(l, axis, done);
#if DAC_SLOW_PART
    case SLOW_WORD:
        return check_slow_words(l, axis, done);
#endif
#if DAC_PIXEL_TABLE
    case PIXELS:
        return check_pixels(l, axis, done);
#endif
#if DAC_SLOW_PART
    case RANGE:
        return has_slow(l, axis) ? check_lines(l, axis, DAC_LINK_RANGE, done) : check_range(l, axis, done);
    case SLEW:
        return has_slow(l, axis) ? check_lines(l, axis, DAC_LINK_SLEW, done) : check_slew(l, axis, done);
    default:
        return check_jump(l, axis, done);
#else
    case RANGE:
        return check_range(l, axis, done);
    case SLEW:
        return check_slew(l, axis, done);
    default:
        return check_jump(l, done);
#endif
    }
}

#if DAC_SLOW_PART
#define BY_AXIS(stage) ((stage) != CRC && (stage) != PROGRAM)
#define LAST_AXIS 1 /* of the last stage */
#else
#define BY_AXIS(stage) ((stage) != CRC && (stage) != PROGRAM && (stage) != JUMP)
#define LAST_AXIS 0
#endif

dac_link_finding dac_link_check_work(dac_link *l, bool *passed)
{
    dac_link_check *const c = &l->check;
    bool done = false;
    const dac_link_finding found = check(l, &done);

    *passed = found.reason == DAC_LINK_NO_REASON && done && c->stage == JUMP
           && c->axis == LAST_AXIS;
    if (!done)
        return found;
    if (c->axis == 0 && BY_AXIS(c->stage)) {
        c->axis = 1;
    } else {
        c->axis = 0;
        c->stage++;
#if DAC_MOVE
        if (l->moving && c->stage > PROGRAM && c->stage < RANGE) /* its tables have been rendered and checked */
            c->stage = c->stage <= MOVED_WORDS ? MOVED_WORDS : RANGE;
#endif
    }
    c->at = 0;
    c->phase = c->remainder = 0;
    c->rise = c->steepest = 0;
    c->sum = 0;
#if DAC_SLOW_PART
    c->line = 0;
    c->exact = false;
#endif
    return found;
}
