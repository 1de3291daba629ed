/* Linear interpolation and nothing else, as libraries for signal processing have it: a call a sample, 12 bits of index
 * and 20 of fraction, a look at both ends of the table, a 64-bit product for each neighbour. */
#include <stdint.h>

static int32_t __attribute__((noinline)) linear(const int16_t *words, int32_t x, uint32_t length)
{
    const int32_t index = x >> 20, fraction = x & 0xfffff;
    int64_t sum;

    if (index >= (int32_t)(length - 1))
        return words[length - 1];
    if (index < 0)
        return words[0];
    sum = (int64_t)words[index] * (0xfffff - fraction);
    sum += (int64_t)words[index + 1] * fraction;
    return (int32_t)(sum >> 20);
}
