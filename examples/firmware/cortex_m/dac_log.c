/* Instead of converters: a line for each sample, "xxxxxx yyyyyy mm" in hexadecimal, words and markers, to a UART of its
 * own. */
#include "board.h"
#include "dac.h"

enum { SAMPLES = 256, LINE = 17 }; /* a power of two; characters */

typedef struct {
    dac_output x, y;
    uint8_t markers;
} sample;

static sample samples[SAMPLES];
static volatile uint32_t head, tail; /* written by the interrupt, and by the main loop */

bool dac_ready(void)
{
    return head - tail != SAMPLES;
}

void dac_put(dac_output x, dac_output y, uint8_t markers)
{
    sample *const next = &samples[head % SAMPLES];
    next->x = x;
    next->y = y;
    next->markers = markers;
    __asm__ volatile("" ::: "memory"); /* write the sample before `head` */
    head = head + 1;
}

static char *hexadecimal(char *at, uint32_t value, unsigned digits)
{
    while (digits-- != 0)
        *at++ = "0123456789abcdef"[value >> 4 * digits & 15];
    return at;
}

void dac_work(void)
{
    static char line[LINE];
    static unsigned sent = LINE;

    for (;;) {
        while (sent != LINE) {
            if (!board_log_ready())
                return;
            board_log_putc(line[sent++]);
        }
        if (tail == head)
            return;
        const sample *const next = &samples[tail % SAMPLES];
        char *at = hexadecimal(line, next->x, 6);
        *at++ = ' ';
        at = hexadecimal(at, next->y, 6);
        *at++ = ' ';
        at = hexadecimal(at, next->markers, 2);
        *at = '\n';
        __asm__ volatile("" ::: "memory");
        tail = tail + 1;
        sent = 0;
    }
}
