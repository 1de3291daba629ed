/* The bench as a program: the script from standard input in hexadecimal lines, captures to standard output as 8 bytes
 * each, the lowest first, since text takes many times as long as to play. With an argument, whatever it is, ticks are
 * played one a call, though it was compiled to fill. */
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
    unsigned char bytes[8];

    for (unsigned i = 0; i < sizeof bytes; i++)
        bytes[i] = (unsigned char)(capture >> 8 * i);
    if (fwrite(bytes, sizeof bytes, 1, stdout) != 1)
        exit(1);
}

void bench_check(bool done, const char *what)
{
    if (done)
        return;
    fprintf(stderr, "refused: %s\n", what);
    exit(1);
}

int main(int count, char **arguments)
{
    (void)arguments;
    bench_play(count == 1);
    return fflush(stdout) != 0 || ferror(stdout);
}
