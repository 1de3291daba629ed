/* Private to the runtime: the slow part of an axis, once a line. */
#ifndef DAC_SLOW_H
#define DAC_SLOW_H

#include "dac_sequencer.h"

#if DAC_SLOW_PART
/* Prepares a line of a frame, before its first tick: table, gain, offset, ramp, and what belongs to runs. Without a slow
 * part they stay as they are. */
void dac_slow_begin_line(dac_axis *axis, dac_bank_axis *bank, uint32_t line);
#endif

#endif
