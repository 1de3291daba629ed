/* The bytes that a converter of ../converters is sent, to a UART instead of its SPI unit: what both outputs need after
 * power-up, then a frame of A (x) and a frame of B (y) for each sample. On hardware SPI takes these bytes, SYNC rises
 * after each frame, and LDAC falls after each pair. */
#include "board.h"
#include "dac.h"
#include "names.h"
#include CONVERTER_HEADER
#include SCAN_HEADER

enum { RING = 4096, MOST = 12 * 4 }; /* bytes: a power of two; of the first sample, at most */

typedef char the_scan_has_words_of_the_converter[DAC_SPI_FITS(SPI_CONVERTER, CONSTANT(_X))
                                                 && DAC_SPI_FITS(SPI_CONVERTER, CONSTANT(_Y)) ? 1 : -1];

static uint8_t ring[RING];
static volatile uint32_t head, tail; /* written by the interrupt, and by the main loop */

bool dac_ready(void)
{
    return RING - (head - tail) >= MOST;
}

void dac_put(dac_output x, dac_output y, uint8_t markers)
{
    static bool started;
    uint8_t bytes[MOST], *end = bytes;
    uint32_t at = head;

    (void)markers;
    if (!started) {
        end = dac_spi_start(&SPI_CONVERTER, 0, x, end);
        end = dac_spi_start(&SPI_CONVERTER, 1, y, end);
        started = true;
    }
    end = dac_spi_pairs(&SPI_CONVERTER, &x, &y, 1, end);
    for (const uint8_t *from = bytes; from != end; from++)
        ring[at++ % RING] = *from;
    __asm__ volatile("" ::: "memory"); /* write the bytes before `head` */
    head = at;
}

void dac_work(void)
{
    while (tail != head) {
        if (!board_log_ready())
            return;
        board_log_putc((char)ring[tail % RING]);
        __asm__ volatile("" ::: "memory");
        tail = tail + 1;
    }
}
