/* The bench as a program: the script from standard input, captures to standard output, both in hexadecimal lines. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "stream_bench.h"

uint64_t bench_read(void)
{
    uint64_t word;
    return scanf("%" SCNx64, &word) == 1 ? word : 0;
}

void bench_write(uint64_t capture)
{
    printf("%016" PRIx64 "\n", capture);
}

void bench_check(bool done, const char *what)
{
    if (done)
        return;
    fprintf(stderr, "refused: %s\n", what);
    exit(1);
}

int main(void)
{
    bench_play();
    return fflush(stdout) != 0 || ferror(stdout);
}
