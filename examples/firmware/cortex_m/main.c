/* Plays a build of tablegen: commands come over a UART, an interrupt outputs the samples. */
#include "board.h"
#include "control.h"
#include "dac.h"
#include "player.h"
#include "scan.h"

#ifndef UPDATE_RATE_HZ
#define UPDATE_RATE_HZ 20000 /* rate of the timer in Hz */
#endif

dac_sequencer sequencer;

int main(void)
{
    const bool good = dac_sequencer_init(&sequencer, &scan_x_converter, &scan_y_converter) && control_start();
    board_start();
    player_start();
    board_start_timer(UPDATE_RATE_HZ);
    while (good && dac_sequencer_status(&sequencer).swaps == 0) /* a trigger before that has no effect */
        dac_work();
    control_ready(good);
    for (;;) {
        dac_work();
        control_work();
    }
}
