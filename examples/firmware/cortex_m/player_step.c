/* Computes each tick when it is due. Variations of the execution time are jitter of the output, unless the converter is
 * latched. */
#include "dac.h"
#include "player.h"

void player_start(void) { }

void player_timer(void)
{
    dac_tick tick;

    if (!dac_ready())
        return;
    dac_sequencer_step(&sequencer, &tick);
    dac_put(tick.x, tick.y, tick.markers);
}

void player_pended(void) { }
