/* The sectors that a port keeps programs in, by what the scan of the build needs. */
#ifndef KEPT_SECTORS_H
#define KEPT_SECTORS_H

#include "names.h"
#include "scan_link.h"

#include SCAN_HEADER

enum { KEPT_SLOTS = 2 };
/* Bytes of a place: an image of tables as long as those of the build. */
enum { KEPT_BYTES = 64 + 192 + (CONSTANT(_X_TABLE_LENGTH) + CONSTANT(_Y_TABLE_LENGTH)) * (int)sizeof(dac_word) };

#define KEPT_PLACE_SECTORS(sector) ((KEPT_BYTES + (sector) - 1) / (sector))
#define KEPT_SECTORS(sector) (DAC_STORE_RECORDS + (KEPT_SLOTS + 1) * KEPT_PLACE_SECTORS(sector))

#endif
