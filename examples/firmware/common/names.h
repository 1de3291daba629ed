/* The names of a build: SCAN and SCAN_UPPER, SCAN_HEADER. A Makefile gives them; where none can, as in Arduino's IDE,
 * they stand in the port's own scan_names.h. */
#ifndef NAMES_H
#define NAMES_H

#ifndef SCAN
#include "scan_names.h"
#endif
#include "dac_sequencer.h"

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define NAMED(suffix) JOIN(SCAN, suffix)
#define CONSTANT(suffix) JOIN(SCAN_UPPER, suffix)
#define PROGRAM(NAME, name) DAC_PROGRAM(NAME, name)
/* The code at which the outputs are before the first write. */
#ifndef POWER_UP_CODE
#define POWER_UP_CODE 0
#endif
#define CONVERTER(AXIS) DAC_CONVERTER(AXIS, POWER_UP_CODE)

#endif
