/* The converters. dac_log.c stands in for them in an emulator; on hardware write your SPI, parallel port or DAC
 * registers here. */
#ifndef DAC_H
#define DAC_H

#include "dac_sequencer.h"

/* Returns whether a sample can be output now. Always true on hardware. If the log of the emulator is full, the timer
 * waits. */
bool dac_ready(void);

/* Outputs a sample of both axes; called by the interrupt of the timer. */
void dac_put(dac_output x, dac_output y, uint8_t markers);

/* Called by the main loop, for slow work. */
void dac_work(void);

#endif
