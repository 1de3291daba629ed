/* Private to the runtime: the slow part of an axis, once a line. */
#ifndef DAC_SLOW_H
#define DAC_SLOW_H

#include "dac_sequencer.h"

#if DAC_SLOW_PART
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
