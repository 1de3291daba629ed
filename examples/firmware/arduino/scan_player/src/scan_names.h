/* The names that the build of ../../scan.toml has, and what of the link has room on the board. Give another scan the
 * same name, or change these three. */
#ifndef SCAN_NAMES_H
#define SCAN_NAMES_H

#define SCAN arduino_scan
#define SCAN_UPPER ARDUINO_SCAN
#define SCAN_HEADER "arduino_scan.h"

#define UPDATE_RATE_HZ (CONSTANT(_UPDATE_RATE_MILLIHZ) / 1000)

#if defined(__AVR__)
#define LINK_HARMONICS 0 /* tables only: to compute them from Fourier words takes a sine of 1280 bytes more */
#endif

#endif
