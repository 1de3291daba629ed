/* The consumer of the sequencer: the interrupt handlers. player_step.c is the simple one, player_fill.c the fast one.
 * */
#ifndef PLAYER_H
#define PLAYER_H

#include "scan.h"

void player_start(void);  /* called before the timer starts */
void player_timer(void);  /* interrupt: a sample is due */
void player_pended(void); /* interrupt of the lowest priority, PendSV */

#endif
