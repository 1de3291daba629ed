/* Private to the runtime: computes the codes of an axis from positions in its period, for one tick or many. */
#ifndef DAC_AXIS_H
#define DAC_AXIS_H

#include "dac_sequencer.h"

/* Returns true if the runtime can serve a converter. */
bool dac_axis_serves(const dac_converter *converter);

/* Plays one tick: moves the code towards the waveform, and advances the position. Returns true if the code has arrived;
 * sets *outside if the clamp acted. */
bool dac_axis_step(dac_axis *axis, const dac_bank_axis *bank, bool *outside);

/* Moves the code towards a target, by at most max_step; returns true if it has arrived. */
bool dac_axis_approach(dac_axis *axis, const dac_bank_axis *bank, int32_t target);

/* Writes the codes of up to `ticks` ticks of one period to out[0], out[DAC_STRIDE].., not coded yet; returns how many
 * were played. It ends before ticks on which the clamp or the slew guard might have to act: these are for
 * dac_axis_step(). */
uint32_t dac_axis_run(dac_axis *axis, const dac_bank_axis *bank, dac_output *out, uint32_t ticks);

/* Moves the position `ticks` ticks on; ticks below 2^24. */
void dac_axis_skip(dac_axis *axis, const dac_bank_axis *bank, uint32_t ticks);

#endif
