/* Commands as frames of docs/protocol.md; dac_link.c does all the work. */
#include "control.h"
#include "dac_link.h"
#include "scan.h"
#include "scan_link.h"
#include "uart.h"

static dac_link link;

/* Not initialised, so that it survives a reset, but no power cycle: for hosts that want to know of a reset, not for the
 * key. */
static uint32_t boots __attribute__((section(".noinit")));

static bool start_link(void)
{
#if DAC_STORE
    if (dac_store_open(&scan_store, &scan_flash) != DAC_STORE_DONE)
        return false;
#endif
    return dac_link_init(&link, scan_link(), &sequencer, ++boots) == DAC_LINK_STARTED;
}

bool control_start(void)
{
    if (!start_link())
        return false;
#if DAC_STORE
    if (dac_link_load_kept(&link))
        return true;
#endif
    return dac_sequencer_load(&sequencer, &scan_whole) == DAC_LOADED && dac_sequencer_commit(&sequencer);
}

void control_ready(bool good)
{
    (void)good; /* the host asks for the status */
}

void control_received(uint8_t byte)
{
    dac_link_receive(&link, byte);
}

#if DAC_LIBRARY
/* Plays the next program of the library and of the slots that this device plays. */
static void play_next(void)
{
    static uint32_t number;

    for (uint32_t left = dac_link_numbers(&link); left != 0; left--) {
        const uint32_t now = number;
        number = (number + 1) % dac_link_numbers(&link);
        if (dac_link_play(&link, now))
            return;
    }
}
#endif

void control_work(void)
{
#if DAC_LIBRARY
    if (board_pressed())
        play_next();
#endif
    dac_link_work(&link);
    while (board_can_put()) {
        const int byte = dac_link_transmit(&link);
        if (byte < 0)
            break;
        board_putc((char)byte);
    }
}
