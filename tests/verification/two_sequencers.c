/* Plays a scan with the output z as an application does: two sequencers, a tick of each in every interrupt. Prints the
 * word of z, the markers of both, and the word of y beside z, a tick a line. The argument is the number of ticks. */
#include <stdio.h>
#include <stdlib.h>

#include "annexin_200nm_program.h"
#include "annexin_200nm_z_program.h"

static dac_sequencer sequencer, sequencer_of_z;

static bool begin(dac_sequencer *s, const dac_converter *x, const dac_converter *y, const dac_program *program)
{
    return dac_sequencer_init(s, x, y) && dac_sequencer_load(s, program) == DAC_LOADED && dac_sequencer_commit(s)
        && dac_sequencer_arm(s, 0) && dac_sequencer_trigger(s);
}

int main(int count, char **arguments)
{
    if (count != 2
        || !begin(&sequencer, &annexin_200nm_x_converter, &annexin_200nm_y_converter, &annexin_200nm_program)
        || !begin(&sequencer_of_z, &annexin_200nm_z_x_converter, &annexin_200nm_z_y_converter,
                  &annexin_200nm_z_program))
        return 1;
    for (long ticks = strtol(arguments[1], NULL, 10); ticks > 0; ticks--) {
        dac_tick tick, tick_of_z;

        dac_sequencer_step(&sequencer, &tick);
        dac_sequencer_step(&sequencer_of_z, &tick_of_z);
        printf("%lu %u %u %lu\n", (unsigned long)tick_of_z.x, (unsigned)tick.markers, (unsigned)tick_of_z.markers,
               (unsigned long)tick_of_z.y);
    }
    return 0;
}
