/* Plays a build of tablegen: what is to be done comes over a UART, samples leave in an interrupt. */
#include "board.h"
#include "control.h"
#include "dac.h"
#include "player.h"
#include "scan.h"

#ifndef UPDATE_RATE_HZ
#define UPDATE_RATE_HZ 20000 /* of the timer */
#endif

dac_sequencer sequencer;

int main(void)
{
    dac_sequencer_init(&sequencer, &scan_x_converter, &scan_y_converter);
    const bool good = control_start();
    board_start();
    player_start();
    board_start_timer(UPDATE_RATE_HZ);
    while (good && dac_sequencer_status(&sequencer).swaps == 0) /* before it no trigger would be heard */
        dac_work();
    control_ready(good);
    for (;;) {
        dac_work();
        control_work();
    }
}
