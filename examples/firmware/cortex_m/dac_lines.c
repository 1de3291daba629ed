/* Instead of converters: text for each line that was played, "GGGGGGGG LLLLLLLL TTTTTTTT CCCCCCCC MM FF" in
 * hexadecimal: the program's number, the line of the frame, ticks, CRC-32 of all of them (lines.h), markers, faults. */
#include "board.h"
#include "dac.h"
#include "lines.h"
#include "player.h"

enum { LINES = 64, TEXT = 42 }; /* a power of two; characters */

static line_log played;
static line_record lines[LINES];
static volatile uint32_t head, tail; /* written by the interrupt, and by the main loop */

bool dac_ready(void)
{
    return head - tail != LINES;
}

void dac_put(dac_output x, dac_output y, uint8_t markers)
{
    if (!line_tick(&played, x, y, markers, sequencer.faults, &lines[head % LINES]))
        return;
    __asm__ volatile("" ::: "memory"); /* write the line before `head` */
    head = head + 1;
}

static char *hexadecimal(char *at, uint32_t value, unsigned digits, char after)
{
    while (digits-- != 0)
        *at++ = "0123456789abcdef"[value >> 4 * digits & 15];
    *at++ = after;
    return at;
}

void dac_work(void)
{
    static char text[TEXT];
    static unsigned sent = TEXT;

    for (;;) {
        while (sent != TEXT) {
            if (!board_log_ready())
                return;
            board_log_putc(text[sent++]);
        }
        if (tail == head)
            return;
        const line_record *const next = &lines[tail % LINES];
        char *at = hexadecimal(text, next->generation, 8, ' ');
        at = hexadecimal(at, next->line, 8, ' ');
        at = hexadecimal(at, next->ticks, 8, ' ');
        at = hexadecimal(at, next->crc, 8, ' ');
        at = hexadecimal(at, next->markers, 2, ' ');
        hexadecimal(at, next->faults, 2, '\n');
        __asm__ volatile("" ::: "memory");
        tail = tail + 1;
        sent = 0;
    }
}
