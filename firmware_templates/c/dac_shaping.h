/* Private to the runtime: shaped output, one tick or many. Both functions are for programs whose order is not 0. */
#ifndef DAC_SHAPING_H
#define DAC_SHAPING_H

#include "dac_sequencer.h"

#if DAC_SHAPING
/* Returns the code of a sample, before the clamp, and feeds back its remainder. */
int32_t dac_shaping_code(dac_axis *axis, const dac_bank_axis *bank, int32_t sample);

/* Plays a run, as dac_axis_run() does, from position `at` on: as many ticks as 64 bits of position are enough for. */
uint32_t dac_shaping_play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step, dac_output *out,
                          uint32_t ticks);

#if DAC_SLOW_PART
#if !DAC_LONG_MULTIPLY
/* The same on a line of a slow part. */
uint32_t dac_shaping_ramp(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step, dac_output *out,
                          uint32_t ticks);
#endif
#endif
#endif

#endif
