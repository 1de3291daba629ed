/* The converters. dac_log.c stands in for them in an emulator; on hardware write your SPI, parallel port or DAC
 * registers here. */
#ifndef DAC_H
#define DAC_H

#include "dac_sequencer.h"

/* Whether a sample can be put out now. True on hardware; the log is full at times, and then time stands still. */
bool dac_ready(void);

/* A sample of both axes, from the interrupt of the timer. */
void dac_put(dac_output x, dac_output y, uint8_t markers);

/* From the main loop: what is not for an interrupt to do. */
void dac_work(void);

#endif
