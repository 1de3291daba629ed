/* The programs of this firmware: the scan that was built, and one of half its size in its middle. */
#ifndef SCAN_H
#define SCAN_H

#include "dac_sequencer.h"

extern const dac_converter scan_x_converter, scan_y_converter;
extern const dac_program scan_whole;

/* The half one, with tables that are rendered here from Fourier words, into one of two places: dac_sequencer_idle(). */
bool scan_half(dac_program *program, unsigned place);

#endif
