/* Private to the runtime: shared by the loops that play many ticks with one check. */
#ifndef DAC_RUN_H
#define DAC_RUN_H

#include "dac_arithmetic.h"

#if defined(__ARM_FEATURE_UNALIGNED) && !defined(__ARM_BIG_ENDIAN) && DAC_TABLE_STORAGE_BITS == 16
/* Reads two neighbouring words with one load. */
struct dac_pair {
    int32_t words;
} __attribute__((packed, may_alias));
#define DAC_NEIGHBOURS(table, index, here, there)                                                                     \
    const int32_t words = ((const struct dac_pair *)((table) + (index)))->words;                                      \
    const int32_t here = (int16_t)words, there = words >> 16
#else
#define DAC_NEIGHBOURS(table, index, here, there)                                                                     \
    const int32_t here = DAC_TABLE_WORD((table)[index]), there = DAC_TABLE_WORD((table)[(index) + 1])
#endif

/* Hides a value from the optimiser, so that the compiler neither computes it in advance nor computes it again. */
#if defined(__GNUC__)
#define DAC_HIDE_FROM_OPTIMIZER(value) __asm__("" : "+r"(value))
#else
#define DAC_HIDE_FROM_OPTIMIZER(value) (void)0
#endif

/* Returns the sample at a position, given by its upper word. */
DAC_CODE_ATTR static inline int32_t dac_sample_at(const dac_bank_axis *bank, uint32_t high)
{
#if DAC_SPLINE
    if (bank->cubic) {
        const dac_segment segment = dac_segment_of(bank->table + (high >> 18));
        return dac_spline_eval(&segment, high & 0x3ffffu);
    }
#endif
    const uint32_t index = high >> 15; /* the fraction behind it is 0 in a direct table */
    const unsigned guard = DAC_GUARD(bank);
    return dac_lerp(DAC_TABLE_WORD(bank->table[index]), DAC_TABLE_WORD(bank->table[index + 1]), high & 0x7fffu, guard,
                    DAC_HALF(guard));
}

#if DAC_SPLINE
/* Position of a run along a spline. Two ticks are less than half a segment apart; a segment is computed once for all
 * of its ticks. */
typedef struct {
    dac_segment segment;
    const dac_word *next; /* the words of the next segment */
    uint64_t way, step;   /* distance into the segment, and from tick to tick, in 2^-64 of a segment */
} dac_track;

/* Returns the track as it is one tick before position `at`. */
DAC_CODE_ATTR static inline dac_track dac_track_of(const dac_word *table, uint64_t at, uint64_t step)
{
    const dac_word *const words = table + (at >> 50);
    const bool goes_on = (at - step) >> 50 == at >> 50;
    dac_track track;

    track.segment = dac_segment_of(words);
    track.next = words + (goes_on ? 1 : 0);
    track.way = (at - step) << 14;
    track.step = step << 14;
    return track;
}

/* Moves to the next tick, and returns its sample. */
DAC_CODE_ATTR static inline int32_t dac_track_next(dac_track *track)
{
    const uint32_t before = (uint32_t)(track->way >> 32);

    track->way += track->step;
    if ((uint32_t)(track->way >> 32) < before) /* an overflow, since a step is below 2^63 */
        track->segment = dac_segment_of(track->next++);
    return dac_spline_eval(&track->segment, (uint32_t)(track->way >> 46));
}

#endif

/* The stretch of a waveform that is played: a position, cut to 64 bits and rounded up, the step of a tick, and the
 * place of the first code. */
typedef struct {
    uint64_t at, step;
    dac_output *out;
    uint32_t ticks;
} dac_stretch;

/* Returns the ticks of the next block, which one check covers. */
DAC_CODE_ATTR static inline uint32_t dac_block_of(uint32_t ticks)
{
    return ticks < DAC_RUN ? ticks : DAC_RUN;
}

/* Gives runs a window of 2^bits codes, half of them below the code before. */
static inline void dac_set_window(dac_bank_axis *bank, uint8_t bits)
{
    bank->run_bits = bits;
    bank->run_half = INT32_C(1) << bits >> 1;
    bank->run_room = bank->code_max - bank->code_min + 1 - (INT32_C(1) << bits);
}

#if DAC_SLOW_PART && DAC_SHORT_SUMS
/* Returns the spread of samples on a line with a ramp, of a gain as runs scale it; see dac_short.h. */
DAC_CODE_ATTR static inline uint8_t dac_ramp_spread(uint32_t gain)
{
    uint8_t spread = 30 + DAC_FINE;

    for (; gain != 0; gain >>= 1)
        spread--;
    return spread > 19 + DAC_FINE ? 19 + DAC_FINE : spread;
}
#endif

/* Returns true if a window with this lower end is inside the limits. */
DAC_CODE_ATTR static inline bool dac_has_room(const dac_bank_axis *bank, int32_t base)
{
    return (uint32_t)(base - bank->code_min) <= (uint32_t)bank->run_room;
}

/* For functions that take constants, such as the order of the shaping: each caller gets a copy made for its own. */
#if defined(__GNUC__)
#define DAC_ALWAYS_INLINE static inline __attribute__((always_inline))
#define DAC_NOINLINE DAC_CODE_ATTR static __attribute__((noinline)) /* a loop that shares no register with its caller */
#else
#define DAC_ALWAYS_INLINE static inline
#define DAC_NOINLINE DAC_CODE_ATTR static
#endif

/* The remainders here have half a code more, so that none is negative. What is fed back has half a code more then too,
 * since all orders have a zero at DC: it is the half of the rounding, which need not be added. */

/* Weight of e1 - e2 in the third order, in 1/64: what docs/sequencer.md has of it without a zero, and the zero. */
#define DAC_WEIGHT(bank) ((bank)->zero + 64)

/* Returns what is fed back to the code after `fed`, which is a code with its remainder. */
DAC_ALWAYS_INLINE dac_shaper dac_shaper_next(dac_shaper last, uint32_t fed, uint32_t mask, unsigned order,
                                             int32_t weight)
{
    dac_shaper next;

    next.back = next.newest = next.older = fed & mask;
    if (order == 1)
        return next;
    next.older = last.newest;
    const uint32_t rise = next.newest - next.older;
    if (order == 2)
        next.back = next.newest + rise;
    else
        next.back = last.older + (uint32_t)((weight * (int32_t)rise) >> 6);
    return next;
}

#endif
