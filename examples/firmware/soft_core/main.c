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

int main(void)
{
    const bool good = dac_sequencer_init(&sequencer, &scan_x_converter, &scan_y_converter) && control_start();

    while (good && dac_sequencer_status(&sequencer).swaps == 0)
        ; /* a trigger before the program is taken has no effect */
    control_ready(good);
    for (;;) {
        for (uint32_t byte; ((byte = SYSTEM_BYTE) & BYTE_RECEIVED) != 0;)
            control_received((uint8_t)byte);
        control_work();
    }
}
