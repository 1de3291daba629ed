/* Functions on blocks of 16-bit fractions, which saturate; see block_functions.c. */
#ifndef BLOCK_FUNCTIONS_H
#define BLOCK_FUNCTIONS_H

#include <stdint.h>

void block_scale(int16_t *samples, int16_t fraction, int shift, unsigned count);
void block_add(int16_t *samples, int16_t offset, unsigned count);
void block_clip(int16_t *samples, int16_t low, int16_t high, unsigned count);

#endif
