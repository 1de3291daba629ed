/* A minimal program that uses a build: prints the first samples of its x table. */
#include <stdio.h>

#include "annexin_200nm.h"

int main(void)
{
    printf("%ld ticks a line, words of x:", (long)ANNEXIN_200NM_LINE_TICKS);
    for (int i = 0; i < 8; i++)
        printf(" %ld", (long)annexin_200nm_x_table[i]);
    printf("\n");
    return 0;
}
