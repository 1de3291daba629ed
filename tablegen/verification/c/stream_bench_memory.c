/* The bench on a bare processor under emulation: script and captures are arrays in memory, which the emulator
 * exchanges.
 *
 * The emulator starts bench_main() with a stack, and stops the processor at every call of bench_exchange(): it takes
 * the captures, hands out more of the script, and lets the processor return. There is no C library: what compilers call
 * by themselves is here.
 */
#include <stddef.h>

#include "stream_bench.h"

enum { WORDS = 8192 };

/* By the emulator's side these are found by name. */
uint64_t bench_script[WORDS], bench_records[WORDS];
volatile uint32_t bench_script_words, bench_records_written, bench_done;
const char *volatile bench_refused;

static uint32_t script_at;

void bench_main(void);
void __attribute__((noinline)) bench_exchange(void)
{
    __asm__ volatile("" ::: "memory");
}

uint64_t bench_read(void)
{
    if (script_at == bench_script_words) {
        bench_script_words = 0; /* asks for more */
        bench_exchange();
        script_at = 0;
    }
    return bench_script_words != 0 ? bench_script[script_at++] : 0;
}

void bench_write(uint64_t capture)
{
    if (bench_records_written == WORDS)
        bench_exchange();
    bench_records[bench_records_written] = capture;
    bench_records_written = bench_records_written + 1;
}

void bench_check(bool done, const char *what)
{
    if (done)
        return;
    bench_refused = what;
    for (;;)
        bench_exchange();
}

void bench_main(void)
{
    bench_play(true);
    bench_done = 1;
    for (;;)
        bench_exchange();
}

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
