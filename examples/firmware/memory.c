/* Functions to which compilers generate calls; needed without a C library. */
#include <stddef.h>

/* The barriers keep compilers from making a call of the function itself out of its loop. */
void *memcpy(void *restrict to, const void *restrict from, size_t count);
void *memcpy(void *restrict to, const void *restrict from, size_t count)
{
    unsigned char *t = to;
    const unsigned char *f = from;
    while (count-- != 0) {
        *t++ = *f++;
        __asm__ volatile("" ::: "memory");
    }
    return to;
}

void *memset(void *to, int value, size_t count);
void *memset(void *to, int value, size_t count)
{
    unsigned char *t = to;
    while (count-- != 0) {
        *t++ = (unsigned char)value;
        __asm__ volatile("" ::: "memory");
    }
    return to;
}
