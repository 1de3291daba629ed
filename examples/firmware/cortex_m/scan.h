/* The programs of this firmware: the scan of the build, and its central half. */
#ifndef SCAN_H
#define SCAN_H

#include "dac_sequencer.h"

extern const dac_converter scan_x_converter, scan_y_converter;
extern const dac_program scan_whole;

/* The half scan. Its tables are computed here from Fourier words, into one of two places: see dac_sequencer_idle(). */
bool scan_half(dac_program *program, unsigned place);

#endif
