/* One axis: the code of one tick, and the fast path for many ticks at once. */
#include "dac_axis.h"
#include "dac_run.h"
#include "dac_shaping.h"
#include "dac_short.h"
#include "dac_slow.h"

bool dac_axis_serves(const dac_converter *c)
{
    return c->bits >= 8 && c->bits <= 24 && c->bits <= c->word_bits && c->word_bits <= DAC_OUTPUT_STORAGE_BITS
        && c->power_up_code >= 0 && c->power_up_code < INT32_C(1) << c->bits;
}

DAC_CODE_ATTR bool dac_axis_approach(dac_axis *axis, const dac_bank_axis *bank, int32_t target)
{
    const int32_t rise = target - axis->code, most = bank->max_step;
    axis->code += rise > most ? most : rise < -most ? -most : rise;
    return axis->code == target;
}

DAC_CODE_ATTR static inline int32_t code_of(const dac_bank_axis *bank, int32_t sample)
{
    return (int32_t)(((int64_t)bank->gain * sample + bank->offset) >> bank->gain_q); /* 28 bits or fewer */
}

/* The code of this tick, before the clamp. */
DAC_CODE_ATTR static inline int32_t unclamped(dac_axis *axis, const dac_bank_axis *bank)
{
    const int32_t sample = dac_sample_at(bank, axis->at.high);
#if DAC_SHAPING
    if (bank->order != 0)
        return dac_shaping_code(axis, bank, sample);
#else
    (void)axis;
#endif
#if DAC_SLOW_PART
    if (bank->slow != NULL)
        return dac_slow_code(axis, bank, sample);
#endif
    return code_of(bank, sample);
}

DAC_CODE_ATTR bool dac_axis_step(dac_axis *axis, const dac_bank_axis *bank, bool *outside)
{
    const int32_t code = unclamped(axis, bank);
    const int32_t clamped = code < bank->code_min ? bank->code_min : code > bank->code_max ? bank->code_max : code;

    if (clamped != code)
        *outside = true;
#if DAC_SLOW_PART
    axis->rise += bank->ramp;
#endif
    if (!bank->holds)
        dac_advance(&axis->at, &bank->step);
    return dac_axis_approach(axis, bank, clamped);
}

/* The fast path has one check of clamp and slew guard for a block of DAC_RUN ticks, or of fewer.
 *
 * Why one check is enough. `base` is the lower end of a window of 2^run_bits codes around the last code, inside the
 * limits. If all codes of a run are in it, no limit is met, and the clamp would have changed nothing. Nor would the
 * slew guard, for one of two reasons: the window is at most max_step + 1 wide, so any two of its codes differ by
 * max_step at most; or dac_program.c has found no words so far apart that a code could move further, and may_enter()
 * has compared the first one with the code before, which is any. A code is in the window if code - base, unsigned, has
 * no bit above run_bits; the bits of all codes are or-ed together, and looked at once.
 *
 * Why 64 bits are enough. A position of 96 bits, cut to 64 and rounded up, is at most two units of 2^-32 above the
 * exact one, and every tick adds one more; run_most ticks are so few that these cannot reach the next fraction, which
 * is 1 / period away or more. */

#if DAC_LONG_MULTIPLY

/* Plays from position `at` until a code leaves the window; returns the number of ticks played. */
DAC_CODE_ATTR static inline uint32_t play_along(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step,
                                                dac_output *out, uint32_t ticks, bool cubic)
{
    const dac_word *const table = bank->table;
    /* Read again for every sample: a constant would take two registers, which the loop does not have. */
    const volatile int64_t offset = bank->run_offset;
    int32_t gain = bank->run_gain;
    const unsigned guard = DAC_GUARD(bank);
    int32_t half = DAC_HALF(guard);
    uint32_t done = 0;
    int32_t code = axis->code;
#if DAC_SPLINE
    dac_track track;

    if (cubic)
        track = dac_track_of(table, at, step);
#endif

    DAC_HIDE_FROM_OPTIMIZER(half);
    while (done < ticks) {
        const uint32_t length = dac_block_of(ticks - done);
        const int32_t base = code - bank->run_half;
        dac_output *stop = out + length * DAC_STRIDE;
        uint32_t out_of_window = 0;

        if (!dac_has_room(bank, base))
            break;
        do {
            int32_t sample;
#if DAC_SPLINE
            if (cubic) {
                DAC_HIDE_FROM_OPTIMIZER(gain);
                sample = dac_track_next(&track);
            } else
#endif
            {
                const uint32_t high = (uint32_t)(at >> 32);
                DAC_NEIGHBOURS(table, high >> 15, here, there);
                sample = dac_lerp(here, there, high & 0x7fffu, guard, half);
            }
            code = (int32_t)((offset + (int64_t)gain * sample) >> 32);
            out_of_window |= (uint32_t)(code - base);
            *out = (dac_output)code;
            if (!cubic)
                at += step;
            out += DAC_STRIDE;
            DAC_HIDE_FROM_OPTIMIZER(out);
        } while (out != stop);
        if (out_of_window >> bank->run_bits != 0)
            break;
        axis->code = code;
        done += length;
    }
    return done;
}

#if DAC_SPLINE
#if DAC_TABLE_STORAGE_BITS == 16
DAC_ALWAYS_INLINE uint32_t play_cubic
#else /* the loop of lines would take registers */
DAC_NOINLINE uint32_t play_cubic
#endif
    (dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step, dac_output *out, uint32_t ticks)
{
    return play_along(axis, bank, at, step, out, ticks, true);
}
#endif

DAC_CODE_ATTR static uint32_t play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step,
                                   dac_output *out, uint32_t ticks)
{
#if DAC_SPLINE
    if (bank->cubic)
        return play_cubic(axis, bank, at, step, out, ticks);
#endif
    return play_along(axis, bank, at, step, out, ticks, false);
}

#else

#if DAC_SPLINE
DAC_NOINLINE uint32_t play_spline(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step,
                                  dac_output *out, uint32_t ticks)
{
    const dac_stretch stretch = {at, step, out, ticks};
    const dac_short_kind kind = {false, true, 0, DAC_SHORT_BITS(bank, axis), NULL, false};
    return dac_play_short(axis, bank, stretch, kind);
}
#endif

DAC_CODE_ATTR static uint32_t play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step,
                                   dac_output *out, uint32_t ticks)
{
#if DAC_SPLINE
    if (bank->cubic)
        return play_spline(axis, bank, at, step, out, ticks);
#endif
    const dac_stretch stretch = {at, step, out, ticks};
    const dac_short_kind kind = {false, false, 0, DAC_SHORT_BITS(bank, axis), NULL, false};
    return dac_play_short(axis, bank, stretch, kind);
}

#endif

#if DAC_SHAPING
#define PLAY_LEVEL(bank) ((bank)->order != 0 ? dac_shaping_play : play)
#else
#define PLAY_LEVEL(bank) play
#endif
#if DAC_SLOW_PART && DAC_SHAPING
#define PLAY(bank)                                                                                                    \
    ((bank)->ramp != 0 || ((bank)->slow != NULL && (bank)->order != 0) ? dac_slow_play : PLAY_LEVEL(bank))
#elif DAC_SLOW_PART
#define PLAY(bank) ((bank)->ramp != 0 ? dac_slow_play : PLAY_LEVEL(bank))
#else
#define PLAY(bank) PLAY_LEVEL(bank)
#endif

/* Whether the slew guard lets the code of this tick be. */
DAC_CODE_ATTR static bool may_enter(const dac_axis *axis, const dac_bank_axis *bank)
{
    const int32_t sample = dac_sample_at(bank, axis->at.high);
#if DAC_SLOW_PART
    const int32_t code = bank->slow != NULL ? dac_slow_code(axis, bank, sample) : code_of(bank, sample);
#else
    const int32_t code = code_of(bank, sample);
#endif
    const int32_t rise = code - axis->code;

    return rise <= bank->run_entry && rise >= -bank->run_entry;
}

DAC_CODE_ATTR uint32_t dac_axis_run(dac_axis *axis, const dac_bank_axis *bank, dac_output *out, uint32_t ticks)
{
    if (bank->run_entry != 0 && !may_enter(axis, bank))
        return 0;
    const uint64_t step = bank->holds ? 0 : ((uint64_t)bank->step.high << 32 | bank->step.low >> 32) + 1;
    uint32_t done = 0;

    while (done < ticks) {
        const uint64_t at = ((uint64_t)axis->at.high << 32 | axis->at.low >> 32) + 1;
        const uint32_t most = ticks - done < bank->run_most ? ticks - done : bank->run_most;
        const uint32_t played = PLAY(bank)(axis, bank, at, step, out + done * DAC_STRIDE, most);

        dac_axis_skip(axis, bank, played);
        done += played;
        if (played != most || most == 0)
            break;
    }
    return done;
}

DAC_CODE_ATTR void dac_axis_skip(dac_axis *axis, const dac_bank_axis *bank, uint32_t ticks)
{
    if (bank->holds)
        return;
    const uint64_t first = (bank->step.low & 0xffffffffu) * ticks;
    const uint64_t second = (bank->step.low >> 32) * ticks + (first >> 32);
    const dac_position way = {bank->step.high * ticks + (uint32_t)(second >> 32),
                              second << 32 | (first & 0xffffffffu)};
    dac_advance(&axis->at, &way);
#if DAC_SLOW_PART
    axis->rise += bank->ramp * (int64_t)ticks;
#endif
}
