/* Frames of docs/protocol.md: all of it is dac_link.c. */
#include "board.h"
#include "control.h"
#include "dac_link.h"
#include "player.h"
#include "scan.h"
#include "scan_link.h"

static dac_link link;

/* Survives a reset, and begins anywhere: another number at each start is all that is asked for. */
static uint32_t boots __attribute__((section(".noinit")));

bool control_start(void)
{
    dac_link_init(&link, scan_link(), &sequencer, ++boots);
    return dac_sequencer_load(&sequencer, &scan_whole) == DAC_LOADED && dac_sequencer_commit(&sequencer);
}

void control_ready(bool good)
{
    (void)good; /* a host asks */
}

void control_received(uint8_t byte)
{
    dac_link_receive(&link, byte);
}

void control_work(void)
{
    dac_link_work(&link);
    while (board_can_put()) {
        const int byte = dac_link_transmit(&link);
        if (byte < 0)
            break;
        board_putc((char)byte);
    }
}
