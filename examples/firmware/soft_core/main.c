/* The link of a scanner whose sequencer is in the FPGA beside this core. */
#include "control.h"
#include "names.h"
#include "scan.h"
#include "soft_core.h"
#include "uart.h"

bool board_can_put(void)
{
    return (SYSTEM_STATE & STATE_CAN_SEND) != 0;
}

void board_putc(char c)
{
    SYSTEM_BYTE = (unsigned char)c;
}

bool board_permits(void);
bool board_permits(void)
{
    return (SYSTEM_STATE & STATE_PERMIT) != 0;
}

/* Whether the program of the build plays at the next trigger, which has no effect before. */
static bool taken(void)
{
#if DAC_LINK_Z
    if (dac_sequencer_status(&sequencer_of_z).swaps == 0)
        return false;
#endif
    return dac_sequencer_status(&sequencer).swaps != 0;
}

static bool begin(void)
{
#if DAC_LINK_Z
    if (!dac_sequencer_init(&sequencer_of_z, &scan_z_converter, &scan_z_rest_converter))
        return false;
#endif
    return dac_sequencer_init(&sequencer, &scan_x_converter, &scan_y_converter) && control_start();
}

int main(void)
{
    const bool good = begin();

    while (good && !taken())
        ;
    control_ready(good);
    for (;;) {
        for (uint32_t byte; ((byte = SYSTEM_BYTE) & BYTE_RECEIVED) != 0;)
            control_received((uint8_t)byte);
        control_work();
    }
}
