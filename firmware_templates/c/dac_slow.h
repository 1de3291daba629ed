/* Private to the runtime: the slow part of an axis, once a line. */
#ifndef DAC_SLOW_H
#define DAC_SLOW_H

#include "dac_sequencer.h"

#if DAC_SLOW_PART
/* What a line begins with: gain and ratio, the offset of its first tick, and what that grows by in a tick. */
typedef struct {
    int32_t gain, ratio;
    int64_t offset, ramp;
} dac_slow_line;

/* Returns the line of a frame of `lines`; `step` is 2^32 / ticks of a line, rounded down. */
dac_slow_line dac_slow_line_of(const dac_slow_part *slow, uint32_t line, uint32_t lines, uint32_t step);

/* Returns the mixture of two words, saturated to words of least .. -least - 1. */
DAC_CODE_ATTR static inline dac_word dac_slow_mix(int32_t fast, int32_t second, int32_t ratio, int32_t least)
{
    const int32_t word = fast + ((ratio * second + (1 << 11)) >> 12);

    if ((uint32_t)(word - least) > (uint32_t)-least * 2u - 1u)
        return (dac_word)(word < 0 ? least : -least - 1);
    return (dac_word)word;
}

/* Prepares a line of a frame, before its first tick: table, gain, offset, ramp, and what belongs to runs. Without a
 * slow part they stay as they are. */
void dac_slow_begin_line(dac_axis *axis, dac_bank_axis *bank, uint32_t line);

/* Returns the code of a sample, before the clamp. */
int32_t dac_slow_code(const dac_axis *axis, const dac_bank_axis *bank, int32_t sample);

/* Plays a run on a line with a ramp, as dac_axis_run() does, from position `at` on: as many ticks as 64 bits of
 * position are enough for. */
uint32_t dac_slow_play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step, dac_output *out,
                       uint32_t ticks);
#endif

#endif
