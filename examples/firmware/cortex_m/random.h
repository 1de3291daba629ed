/* Random numbers and time for the key of the link. */
#ifndef RANDOM_H
#define RANDOM_H

#include <stdint.h>

void random_bytes(uint8_t bytes[16]);

void clock_tick(void); /* once in each period of the timer */
uint32_t clock_milliseconds(void);

#endif
