/* The slow part of an axis: what a line begins with, and its ticks. docs/sequencer.md has the arithmetic. */
#include "dac_slow.h"
#include "dac_run.h"
#include "dac_shaping.h"
#include "dac_short.h"

#if DAC_SLOW_PART

#if DAC_TABLE_STORAGE_BITS == 16 && !defined(__OPTIMIZE_SIZE__) /* what is small has the other loops only */
#define SEGMENT_RUNS 1
#else
#define SEGMENT_RUNS 0
#endif
#if DAC_SPLINE
#define CUBIC(bank) ((bank)->cubic != 0)
#else
#define CUBIC(bank) false
#endif
#if DAC_SHAPING
#define SHAPED(bank) ((bank)->order != 0)
#else
#define SHAPED(bank) false
#endif

/* What is divided, and the quotient. */
typedef struct {
    uint32_t rest, quotient;
} dac_division;

/* Divides 2^`bits` start + factor part by `whole`; start and part are below whole <= 2^31, and factor below 2^`bits`.
 * Long division, since no processor here has one of 64 bits: some 8 instructions a bit. */
DAC_CODE_ATTR static dac_division divide(uint32_t start, uint32_t part, uint32_t factor, unsigned bits, uint32_t whole)
{
    dac_division at = {start, 0};

    while (bits-- != 0) {
        at.rest <<= 1;
        at.quotient <<= 1;
        if (at.rest >= whole) {
            at.rest -= whole;
            at.quotient++;
        }
        if ((factor >> bits & 1u) == 0)
            continue;
        at.rest += part;
        if (at.rest >= whole) {
            at.rest -= whole;
            at.quotient++;
        }
    }
    return at;
}

/* Returns the nearest word to the straight line from `here` to `there`, ties up. */
DAC_CODE_ATTR static int32_t between(int32_t here, int32_t there, uint32_t ahead, uint32_t spacing)
{
    const bool falls = there < here;
    const uint32_t distance = falls ? (uint32_t)(here - there) : (uint32_t)(there - here);
    const dac_division way = divide(0, ahead, distance, 19, spacing);
    const uint32_t half = spacing >> 1;

    if (falls)
        return here - (int32_t)(way.quotient + (way.rest > half ? 1u : 0u));
    return here + (int32_t)(way.quotient + (way.rest + half >= spacing ? 1u : 0u));
}

/* Returns the knot before a line, and moves `line` to the lines since then. */
DAC_CODE_ATTR static unsigned knot_before(uint32_t *line, uint32_t spacing)
{
    unsigned knot = 0;

    for (; *line >= spacing; knot++)
        *line -= spacing;
    return knot;
}

DAC_CODE_ATTR static int32_t gain_of(const dac_slow_part *slow, uint32_t line)
{
    const int32_t *const knot = slow->gains + knot_before(&line, slow->gain_spacing);
    return between(knot[0], knot[1], line, slow->gain_spacing);
}

DAC_CODE_ATTR static int32_t ratio_of(const dac_slow_part *slow, uint32_t line)
{
    const int16_t *const knot = slow->ratios + knot_before(&line, slow->ratio_spacing);
    return between(knot[0], knot[1], line, slow->ratio_spacing);
}

/* Mixes the table of a line. Behind its last word stand as many of the first ones as any table has. */
DAC_CODE_ATTR static void mix(const dac_bank_axis *bank, int32_t ratio)
{
    const dac_word *const fast = bank->fast;
    const int8_t *const second = bank->slow->second;
    dac_word *const mixed = bank->slow->mixed;
    const int32_t least = -(INT32_C(1) << (bank->bits - 1u));
    const uint32_t length = bank->length;

    for (uint32_t i = 0; i < length; i++)
        mixed[i] = dac_slow_mix(fast[i], second[i], ratio, least);
    for (uint32_t i = 0; i < DAC_WORDS_BEHIND; i++)
        mixed[length + i] = mixed[i];
}

/* Returns the offset at the start of a line. */
DAC_CODE_ATTR static int64_t offset_of(const dac_slow_part *slow, uint32_t line, uint32_t lines)
{
    const uint32_t place = divide(line, 0, 0, 18u + slow->index_bits, lines).quotient;
    const dac_segment segment = dac_segment_of(slow->table + (place >> 18));

    return (int64_t)slow->gain_word * dac_spline_eval(&segment, place & 0x3ffffu) + slow->offset_word;
}

/* Returns what the offset grows by in a tick: distance step / 2^32, cut off towards 0. */
DAC_CODE_ATTR static int64_t ramp_of(int64_t distance, uint32_t step)
{
    const uint64_t way = (uint64_t)(distance < 0 ? -distance : distance);
    const int64_t ramp = (int64_t)((way >> 32) * step + ((way & UINT32_MAX) * step >> 32));

    return distance < 0 ? -ramp : ramp;
}

#if SEGMENT_RUNS
enum { SEGMENT_MOST = 64 };

/* Returns how many ticks play_segments() covers with one check on a line: 0 if it does not play the line, else 8 or
 * more. It plays straight lines between words that are 8 ticks apart or more, not shaped, in a window that 32 bits
 * hold; the ramps of these ticks add 2^30 at most. */
DAC_CODE_ATTR static uint8_t segment_ticks(const dac_bank_axis *bank, int64_t ramp)
{
    const uint32_t step = bank->step.high;

    if (CUBIC(bank) || SHAPED(bank) || step >> 12 != 0 || bank->gain_q + bank->run_bits > 31
        || ramp > INT64_C(1) << 24)
        return 0;
    const uint32_t parts = 4 * step / bank->length; /* 2^17 / period */
    return (uint8_t)(parts < 9 ? 0 : parts - 1 < SEGMENT_MOST ? parts - 1 : SEGMENT_MOST);
}
#endif

/* Sets what runs of the line need; see dac_program.c and dac_short.h. */
DAC_CODE_ATTR static void allow_runs(dac_bank_axis *bank)
{
    const int64_t ramp = bank->ramp < 0 ? -bank->ramp : bank->ramp;

    bank->run_most = bank->run_entry == 0 || ramp <= bank->ramp_most ? bank->line_most : 0;
#if SEGMENT_RUNS
    bank->segment_ticks = segment_ticks(bank, ramp);
#if DAC_LONG_MULTIPLY
    if (bank->segment_ticks != 0)
        bank->run_spread = dac_ramp_spread((uint32_t)(bank->gain < 0 ? -bank->gain : bank->gain));
#endif
#endif
#if DAC_LONG_MULTIPLY
    if (bank->line_most == 0 || SHAPED(bank)) /* shaped runs take gain, offset and ramp as they are */
        return;
    const unsigned left = 32u - bank->gain_q;
    bank->run_gain = bank->gain * (INT32_C(1) << left);
    bank->run_offset = bank->offset * ((int64_t)1 << left);
    bank->run_ramp = bank->ramp * ((int64_t)1 << left);
#else
    const bool scaled = SHAPED(bank) || DAC_TABLE_STORAGE_BITS != 16;
    const unsigned up = scaled ? DAC_UP(bank->bits, bank->guard) : 0u; /* as in dac_program.c */
#if DAC_SHAPING || DAC_TABLE_STORAGE_BITS != 16
    const int64_t half = DAC_TABLE_STORAGE_BITS == 16 || SHAPED(bank) ? (int64_t)1 << (bank->gain_q - 1u) : 0;

    bank->run_gain = bank->gain * (INT32_C(1) << up);
    bank->run_offset = (bank->offset - half) * ((int64_t)1 << up);
    bank->run_ramp = bank->ramp * ((int64_t)1 << up);
#endif
    bank->run_spread = dac_ramp_spread((uint32_t)(bank->gain < 0 ? -bank->gain : bank->gain) << up);
    if (DAC_RUN * (ramp << up) > INT64_C(1) << (30 + DAC_FINE))
        bank->run_most = 0;
#endif
}

DAC_CODE_ATTR dac_slow_line dac_slow_line_of(const dac_slow_part *slow, uint32_t line, uint32_t lines, uint32_t step)
{
    const int64_t here = offset_of(slow, line, lines);
    const int64_t there = offset_of(slow, line + 1 == lines ? 0 : line + 1, lines);
    const dac_slow_line at = {
        gain_of(slow, line),
        slow->second != NULL ? ratio_of(slow, line) : 0,
        here,
        ramp_of(there - here, step),
    };
    return at;
}

DAC_CODE_ATTR void dac_slow_begin_line(dac_axis *axis, dac_bank_axis *bank, uint32_t line)
{
    const dac_slow_part *const slow = bank->slow;

    axis->rise = 0;
    if (slow == NULL)
        return;
    const dac_slow_line at = dac_slow_line_of(slow, line, bank->lines, bank->ramp_step);
    if (slow->second != NULL)
        mix(bank, at.ratio);
    bank->gain = at.gain;
    bank->offset = at.offset + ((int64_t)1 << (bank->gain_q - 1u));
    bank->ramp = at.ramp;
    allow_runs(bank);
}

DAC_CODE_ATTR int32_t dac_slow_code(const dac_axis *axis, const dac_bank_axis *bank, int32_t sample)
{
    return (int32_t)(((int64_t)bank->gain * sample + bank->offset + axis->rise) >> bank->gain_q); /* 28 bits or fewer */
}

#if SEGMENT_RUNS
/* The fast path of straight lines that are not shaped, with a ramp: from word to word of the table. Between two words
 * samples only rise or only fall, as offsets do on the whole line. So the value of a tick, gain * sample + offset, lies
 * between the least and the greatest of four sums: of the product of the first or the last sample, and the first or the
 * last offset. If the codes of all four are in the window of dac_axis.c, those between are, and nothing is checked
 * tick by tick. Otherwise no more than a block is tried, and then the loops below.
 *
 * Why 32 bits of a value are enough. Its window has 31 at most. Let s0 be the last sample before, whose value is in the
 * window, or at the start of a run the first one, which is compared with 64 bits. The first and the last sample are
 * within 2^run_spread of it, so with the first offset their values differ from that of s0 by 2^30 of the samples and
 * less than 2^30 of a ramp (dac_short.h): their lower 32 bits are below 2^31 only if they are in 0..2^31. From there
 * the ramps to the last offset move them by 2^30 at most.
 *
 * Why 32 bits of a position are enough. They have the 15 bits of the fraction and 17 below; the position is cut and
 * rounded up at the first of these ticks, and so is the step. After t of them it is less than t + 2 units of 2^-17 of a
 * fraction above the exact one, with what 64 bits are above it. The next fraction is 1 / period away or more, which
 * is as many units as segment_ticks() counts. So the last tick before the next word is found exactly too. */

/* Two neighbouring words: what a sample grows by in a fraction, and the first one with the half of the rounding. */
typedef struct {
    uint32_t slope, low;
} dac_line;

enum { BELOW_SAMPLE = 11 }; /* bits of the sum: 15 of a fraction, less 4 guard bits */

DAC_CODE_ATTR static inline dac_line line_of(const dac_word *table, uint64_t at)
{
    DAC_NEIGHBOURS(table, (uint32_t)(at >> 47), here, there);
    const dac_line line = {
        (uint32_t)(there - here),
        ((uint32_t)here << 15) + (UINT32_C(1) << (BELOW_SAMPLE - 1)),
    };
    return line;
}

DAC_CODE_ATTR static inline uint32_t place_of(uint64_t at)
{
    return (uint32_t)(at >> 15) + 1;
}

DAC_CODE_ATTR static inline uint32_t sample_of(dac_line line, uint32_t place)
{
    return (uint32_t)((int32_t)(line.slope * (place >> 17) + line.low) >> BELOW_SAMPLE);
}

/* The ticks of a segment are counted with a division, and position and step have 64 bits: processors that have no
 * instructions for these divide once a run, and split the product, whose parts have 32 bits within a segment. */
#if DAC_LONG_MULTIPLY || defined(__riscv_mul)
#define WHOLE_SEGMENT(step) 0
DAC_CODE_ATTR static inline uint32_t ticks_within(uint32_t place, uint32_t step, uint32_t whole)
{
    (void)whole;
    return (UINT32_MAX - place) / step + 1;
}

DAC_CODE_ATTR static inline uint64_t way_of(uint64_t step, uint32_t ticks)
{
    return step * ticks;
}
#else
#define WHOLE_SEGMENT(step) (UINT32_MAX / (step))
DAC_CODE_ATTR static inline uint32_t ticks_within(uint32_t place, uint32_t step, uint32_t whole)
{
    if (place >= step) /* not the first tick of the segment */
        return (UINT32_MAX - place) / step + 1;
    return whole + (place <= UINT32_MAX - whole * step ? 1u : 0u);
}

DAC_CODE_ATTR static inline uint64_t way_of(uint64_t step, uint32_t ticks)
{
    const uint32_t upper = (uint32_t)(step >> 16) * ticks, lower = (uint32_t)(step & 0xffffu) * ticks;
    return ((uint64_t)upper << 16) + lower;
}
#endif

DAC_NOINLINE uint32_t play_segments(dac_axis *axis, const dac_bank_axis *bank, dac_stretch s)
{
    const dac_word *const table = bank->table;
    uint32_t step = (uint32_t)(s.step >> 15) + 1, ramp = (uint32_t)bank->ramp;
    const uint32_t spread = UINT32_C(1) << bank->run_spread;
    const uint32_t gain = (uint32_t)bank->gain, half = (uint32_t)bank->run_half;
    const uint32_t whole = WHOLE_SEGMENT(step);
    const unsigned below = bank->gain_q, window = below + bank->run_bits;
    const int64_t offset = bank->offset + axis->rise;
    uint32_t sample = sample_of(line_of(table, s.at), place_of(s.at)); /* the last one before */
    const int32_t unrounded = (int32_t)(((int64_t)bank->gain * (int32_t)sample + offset) >> below);
    uint32_t code = (uint32_t)axis->code, rest = (uint32_t)offset, left = s.ticks, most = bank->segment_ticks;
    uint64_t at = s.at;
    dac_output *out = s.out;

    if (((uint32_t)unrounded - code + half) >> bank->run_bits != 0)
        return 0;
    while (left != 0) {
        const dac_line line = line_of(table, at);
        uint32_t place = place_of(at);
        const uint32_t within = ticks_within(place, step, whole), asked = left < most ? left : most;
        const uint32_t ticks = within < asked ? within : asked, way = ticks - 1, rise = way * ramp;
        const uint32_t first = sample_of(line, place), last = sample_of(line, place + way * step);
        uint32_t base = code - half;
        uint32_t value = rest - (base << below); /* of a tick, without its sample */
        const uint32_t from = gain * first + value, to = gain * last + value;
        const dac_output *stop = out + ticks * DAC_STRIDE;

        if ((from | to | (from + rise) | (to + rise)) >> window != 0
            || ((first - sample + spread) | (last - sample + spread)) > 2 * spread - 1
            || !dac_has_room(bank, (int32_t)base)) {
            if (ticks <= bank->run_block)
                break;
            most = bank->run_block;
            continue;
        }
        do {
            DAC_HIGH_REGISTER(base);
            DAC_HIGH_REGISTER(ramp);
            DAC_HIGH_REGISTER(step);
            DAC_HIGH_REGISTER(stop);
            code = ((gain * sample_of(line, place) + value) >> below) + base;
            value += ramp;
            place += step;
            *out = (dac_output)code;
            out += DAC_STRIDE;
            DAC_HIDE_FROM_OPTIMIZER(out);
        } while (out != stop);
        sample = last;
        rest += rise + ramp;
        at += way_of(s.step, ticks);
        left -= ticks;
    }
    axis->code = (int32_t)code;
    return s.ticks - left;
}
#endif

#if DAC_LONG_MULTIPLY

/* The fast path, as in dac_axis.c, but in two loops: samples first, then codes. One loop for both would need more
 * registers than a Cortex-M has, of a spline by far. */

enum { CHUNK = 4 * DAC_RUN };

/* Writes the codes of samples, block by block; returns how many. Ends before a block with a code outside the window. */
DAC_NOINLINE uint32_t put(dac_axis *axis, const dac_bank_axis *bank, const int32_t *sample, uint32_t ticks,
                          int64_t rise, dac_output *out)
{
    const int64_t ramp = bank->run_ramp;
    const int32_t gain = bank->run_gain;
    int64_t offset = bank->run_offset + rise * ((int64_t)1 << (32u - bank->gain_q));
    int32_t code = axis->code;
    uint32_t done = 0;

    while (done < ticks) {
        const int32_t base = code - bank->run_half;
        const uint32_t length = dac_block_of(ticks - done);
        const int32_t *const end = sample + length;
        uint32_t out_of_window = 0;

        if (!dac_has_room(bank, base))
            break;
        do {
            code = (int32_t)((offset + (int64_t)gain * *sample++) >> 32);
            offset += ramp;
            out_of_window |= (uint32_t)(code - base);
            *out = (dac_output)code;
            out += DAC_STRIDE;
            DAC_HIDE_FROM_OPTIMIZER(out);
            DAC_HIDE_FROM_OPTIMIZER(sample);
        } while (sample != end);
        if (out_of_window >> bank->run_bits != 0)
            break;
        axis->code = code;
        done += length;
    }
    return done;
}

#if DAC_SHAPING
/* As put(), of shaped output: `rise` is what the ramp has added at the first sample. What is fed back is stored behind
 * each block; that of a block that is refused never is. The sum of a code above `base` and its remainder is below 2^31,
 * since offsets stay within twice the range of a code. */
DAC_NOINLINE uint32_t put_shaped(dac_axis *axis, const dac_bank_axis *bank, const int32_t *sample, uint32_t ticks,
                                 int64_t rise, dac_output *out)
{
    const int64_t ramp = bank->ramp;
    const int32_t gain = bank->gain, weight = DAC_WEIGHT(bank);
    const unsigned bits = bank->remainder_bits, below = bank->gain_q - bits;
    const uint32_t mask = (UINT32_C(1) << bits) - 1;
    int64_t offset = bank->offset - ((int64_t)1 << (bank->gain_q - 1u)) + rise;
    dac_shaper shaper = axis->shaper;
    uint32_t done = 0;

    while (done < ticks) {
        const int32_t base = axis->code - bank->run_half;
        const uint32_t length = dac_block_of(ticks - done);
        const int32_t *const end = sample + length;
        uint32_t out_of_window = 0, code = 0;

        if (!dac_has_room(bank, base))
            break;
        do {
            const uint32_t fed = (uint32_t)((offset + (int64_t)gain * *sample++) >> below)
                               - ((uint32_t)base << bits) + shaper.back;
            shaper = dac_shaper_next(shaper, fed, mask, bank->order, weight);
            offset += ramp;
            out_of_window |= fed;
            code = (fed >> bits) + (uint32_t)base;
            *out = (dac_output)code;
            out += DAC_STRIDE;
        } while (sample != end);
        if (out_of_window >> bits >> bank->run_bits != 0)
            break;
        axis->shaper = shaper;
        axis->code = (int32_t)code;
        done += length;
    }
    return done;
}
#endif

/* Writes samples of straight lines, up to `end`; returns the position after them. */
DAC_NOINLINE uint64_t sample_lines(const dac_bank_axis *bank, uint64_t at, uint64_t step, int32_t *sample,
                                   const int32_t *end)
{
    const dac_word *const table = bank->table;
    const unsigned guard = DAC_GUARD(bank);
    int32_t half = DAC_HALF(guard);

    DAC_HIDE_FROM_OPTIMIZER(half);
    do {
        const uint32_t high = (uint32_t)(at >> 32);
        DAC_NEIGHBOURS(table, high >> 15, here, there);
        *sample++ = dac_lerp(here, there, high & 0x7fffu, guard, half);
        at += step;
        DAC_HIDE_FROM_OPTIMIZER(sample);
    } while (sample != end);
    return at;
}

#if DAC_SPLINE
DAC_NOINLINE void sample_spline(dac_track *track, int32_t *sample, const int32_t *end)
{
    dac_track here = *track;

    do {
        *sample++ = dac_track_next(&here);
    } while (sample != end);
    *track = here;
}
#endif

DAC_CODE_ATTR uint32_t dac_slow_play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step,
                                     dac_output *out, uint32_t ticks)
{
#if SEGMENT_RUNS
    if (bank->segment_ticks != 0) {
        const dac_stretch stretch = {at, step, out, ticks};
        const uint32_t played = play_segments(axis, bank, stretch);
        if (played != 0)
            return played;
    }
#endif
    int32_t samples[CHUNK];
    int64_t rise = axis->rise;
    uint32_t done = 0;
#if DAC_SPLINE
    dac_track track;

    if (bank->cubic)
        track = dac_track_of(bank->table, at, step);
#endif
    while (done < ticks) {
        const uint32_t length = ticks - done < CHUNK ? ticks - done : CHUNK;
        const int32_t *const end = samples + length;
#if DAC_SPLINE
        if (bank->cubic)
            sample_spline(&track, samples, end);
        else
#endif
            at = sample_lines(bank, at, step, samples, end);
#if DAC_SHAPING
        const uint32_t played = SHAPED(bank) ? put_shaped(axis, bank, samples, length, rise, out)
                                             : put(axis, bank, samples, length, rise, out);
#else
        const uint32_t played = put(axis, bank, samples, length, rise, out);
#endif
        done += played;
        if (played != length)
            break;
        rise += CHUNK * bank->ramp;
        out += CHUNK * DAC_STRIDE;
    }
    return done;
}

#else

#if DAC_SPLINE
DAC_NOINLINE uint32_t play_spline(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step,
                                  dac_output *out, uint32_t ticks)
{
    const dac_stretch stretch = {at, step, out, ticks};
    const dac_short_kind kind = {false, true, 0, DAC_SHORT_BITS(bank, axis), NULL, true};
    return dac_play_short(axis, bank, stretch, kind);
}
#endif

DAC_CODE_ATTR uint32_t dac_slow_play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step,
                                     dac_output *out, uint32_t ticks)
{
#if DAC_SHAPING
    if (SHAPED(bank))
        return dac_shaping_ramp(axis, bank, at, step, out, ticks);
#endif
#if DAC_SPLINE
    if (bank->cubic)
        return play_spline(axis, bank, at, step, out, ticks);
#endif
    const dac_stretch stretch = {at, step, out, ticks};
#if SEGMENT_RUNS
    if (bank->segment_ticks != 0) {
        const uint32_t played = play_segments(axis, bank, stretch);
        if (played != 0)
            return played;
    }
#endif
    const dac_short_kind kind = {false, false, 0, DAC_SHORT_BITS(bank, axis), NULL, true};
    return dac_play_short(axis, bank, stretch, kind);
}

#endif

#endif
