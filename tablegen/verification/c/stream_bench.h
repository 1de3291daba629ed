/* What the bench of the C sequencer needs of the place where it runs. */
#ifndef STREAM_BENCH_H
#define STREAM_BENCH_H

#include <stdbool.h>
#include <stdint.h>

/* Room for a table of an axis, its Fourier words, and the sine table. */
#ifndef BENCH_TABLE_WORDS
#define BENCH_TABLE_WORDS 131072
#endif
#ifndef BENCH_FOURIER_WORDS
#define BENCH_FOURIER_WORDS 8193
#endif
#ifndef BENCH_SINE_WORDS
#define BENCH_SINE_WORDS 81920
#endif

uint64_t bench_read(void);            /* the next word of the script; 0 at its end */
void bench_write(uint64_t capture);    /* a tick */
void bench_check(bool done, const char *what); /* the script asked for something that the sequencer has to do */

void bench_play(bool fill); /* by fills, if it was compiled with BENCH_FILL, or a tick a call */

#ifdef BENCH_EMITTED
#include "dac_sequencer.h"

/* What stands in an emitted header, and is played in place of what a script writes: tablegen.verification.c.target
 * makes the file that holds it. Where `fourier` is NULL the table is played as it was emitted, elsewhere it is
 * rendered. */
typedef struct {
    const int32_t *fourier;
    unsigned harmonics;
} bench_axis;

extern const dac_program *const bench_program;
extern const dac_converter *const bench_x_converter, *const bench_y_converter;
extern const bench_axis bench_x, bench_y;
/* The constants of the header, and the characters of its hash. */
enum { BENCH_HASH_DIGITS = 64 };
extern const int64_t bench_constants[BENCH_CONSTANTS];
extern const char bench_hash[BENCH_HASH_DIGITS + 1];
extern const int32_t *const bench_sine;
extern const unsigned bench_sine_index_bits;
#endif

#endif
