/* Commands in lines of text.
 *
 *     status           what the sequencer does, its faults and their counts
 *     arm N            the next trigger starts N frames; 0 is endless
 *     trigger, park, reset, clear
 *     swap             change to the other program at the next line: the whole scan, or the half one
 *     withdraw         discard the committed program
 *
 * Each command is answered by one line: ok, or error and the reason.
 */
#include "console.h"
#include "control.h"
#include "player.h"
#include "scan.h"

static bool loaded_half; /* what was loaded last */

static void answer(bool done)
{
    console_text(done ? "ok\n" : "error: too many requests wait\n");
}

static void tell_status(void)
{
    const dac_status status = dac_sequencer_status(&sequencer);

    console_text(status.markers & DAC_PLAYING ? "playing" : status.markers & DAC_PARKED ? "parked" : "parking");
    console_number("line", status.line);
    console_number("swaps", status.swaps);
    console_number("writable", dac_sequencer_writable(&sequencer));
    console_number("faults", status.faults);
    console_number("slew", status.fault_counts[0]);
    console_number("clamp", status.fault_counts[1]);
    console_number("overrun", status.fault_counts[2]);
    console_number("underrun", status.fault_counts[3]);
    console_text("\n");
}

static bool load(bool half)
{
    dac_program program = scan_whole;

    if (half && !scan_half(&program, dac_sequencer_idle(&sequencer)))
        return false;
    return dac_sequencer_load(&sequencer, &program) == DAC_LOADED;
}

static void swap(void)
{
    if (!dac_sequencer_writable(&sequencer)) {
        console_text("error: a program waits\n");
        return;
    }
    if (!load(!loaded_half)) {
        console_text("error: the program is refused\n");
        return;
    }
    loaded_half = !loaded_half;
    answer(dac_sequencer_commit(&sequencer));
}

static void obey(char *line)
{
    uint32_t frames;

    if (console_word(&line, "status"))
        tell_status();
    else if (console_word(&line, "arm")) {
        if (console_decimal(line, &frames))
            answer(dac_sequencer_arm(&sequencer, frames));
        else
            console_text("error: arm N, a number of frames; 0 is without end\n");
    } else if (console_word(&line, "trigger"))
        answer(dac_sequencer_trigger(&sequencer));
    else if (console_word(&line, "park"))
        answer(dac_sequencer_park(&sequencer));
    else if (console_word(&line, "reset"))
        answer(dac_sequencer_reset(&sequencer));
    else if (console_word(&line, "clear"))
        answer(dac_sequencer_clear_faults(&sequencer));
    else if (console_word(&line, "withdraw"))
        answer(dac_sequencer_withdraw(&sequencer));
    else if (console_word(&line, "swap"))
        swap();
    else
        console_text("error: status, arm N, trigger, park, reset, clear, swap or withdraw\n");
}

bool control_start(void)
{
    return load(false) && dac_sequencer_commit(&sequencer);
}

void control_ready(bool good)
{
    console_text(good ? "ready\n" : "error: the scan is refused\n");
}

void control_received(uint8_t byte)
{
    console_received((char)byte);
}

void control_work(void)
{
    char *const line = console_line();

    if (line != NULL)
        obey(line);
}
