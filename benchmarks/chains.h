/* Chains that make blocks of codes; see chains.c. */
#ifndef CHAINS_H
#define CHAINS_H

#include <stdint.h>

enum { TICKS = 250 };

extern uint16_t chain_codes[TICKS];

void bench_main(void);
void chain_start(void);
void chain_plain(void);
void chain_float(void);
void chain_library(void);

#endif
