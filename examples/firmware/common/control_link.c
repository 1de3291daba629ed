/* Commands as frames of docs/protocol.md; dac_link.c does all the work. */
#include "control.h"
#include "dac_link.h"
#include "scan.h"
#include "scan_link.h"
#include "uart.h"

static dac_link link;
#if DAC_LINK_Z
static dac_link z_link;
#endif

/* Not initialised, so that it survives a reset, but no power cycle: for hosts that want to know of a reset, not for the
 * key. */
static uint32_t boots __attribute__((section(".noinit")));

static bool start_link(void)
{
#if DAC_STORE
    if (dac_store_open(&scan_store, &scan_flash) != DAC_STORE_DONE)
        return false;
#endif
#if DAC_LINK_Z
    return dac_link_init(&link, scan_link(), &sequencer, ++boots) == DAC_LINK_STARTED
        && dac_link_init_z(&link, &z_link, scan_link_of_z(), &sequencer_of_z, true) == DAC_LINK_STARTED;
#else
    return dac_link_init(&link, scan_link(), &sequencer, ++boots) == DAC_LINK_STARTED;
#endif
}

static bool commit_scan(void)
{
#if DAC_LINK_Z
    if (dac_sequencer_load(&sequencer, &scan_whole) != DAC_LOADED
        || dac_sequencer_load(&sequencer_of_z, &scan_z) != DAC_LOADED)
        return false;
    scan_link()->stop_ticks(true); /* both begin on one tick */
    const bool x_y = dac_sequencer_commit(&sequencer), z = dac_sequencer_commit(&sequencer_of_z);
    scan_link()->stop_ticks(false);
    return x_y && z;
#else
    return dac_sequencer_load(&sequencer, &scan_whole) == DAC_LOADED && dac_sequencer_commit(&sequencer);
#endif
}

bool control_start(void)
{
    if (!start_link())
        return false;
#if DAC_STORE
    if (dac_link_load_kept(&link))
        return true;
#endif
    return commit_scan();
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
