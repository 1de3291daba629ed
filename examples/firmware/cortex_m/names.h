/* The names of a build: SCAN and SCAN_UPPER, SCAN_HEADER, from the Makefile. */
#ifndef NAMES_H
#define NAMES_H

#include "dac_sequencer.h"

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define NAMED(suffix) JOIN(SCAN, suffix)
#define CONSTANT(suffix) JOIN(SCAN_UPPER, suffix)
#define PROGRAM(NAME, name) DAC_PROGRAM(NAME, name)
#define CONVERTER(AXIS) DAC_CONVERTER(AXIS, 0)

#endif
