/* Summarises the ticks of each line in a few numbers. */
#ifndef LINES_H
#define LINES_H

#include "dac_link_frame.h"
#include "dac_sequencer.h"

typedef struct {
    uint32_t generation; /* generation of the program that played it */
    uint32_t line;       /* line number within the frame */
    uint32_t ticks, crc; /* CRC-32 over x, y (32 bits each, lowest byte first) and markers of every tick */
    uint8_t markers;     /* markers of all ticks, or-ed */
    uint8_t faults;      /* faults at the end of the line */
} line_record;

typedef struct {
    line_record now;
    bool open;
    uint32_t generation;
} line_log;

static inline uint32_t line_add(uint32_t crc, uint32_t value, unsigned bytes)
{
    for (; bytes != 0; bytes--, value >>= 8)
        crc = dac_link_crc(crc, (uint8_t)value);
    return crc;
}

/* Adds a tick, and the faults before it. Returns true if a line ended, and writes it to *ended. Ticks without a scan
 * are not counted. */
static inline bool line_tick(line_log *log, uint32_t x, uint32_t y, uint8_t markers, uint8_t faults, line_record *ended)
{
    line_record *const now = &log->now;
    const bool ends = log->open && ((markers & DAC_LINE) != 0 || (markers & DAC_PLAYING) == 0);

    if (ends) {
        *ended = *now;
        ended->crc = ~now->crc;
        ended->faults = faults;
        log->open = false;
    }
    if ((markers & DAC_SWAPPED) != 0)
        log->generation++;
    if ((markers & DAC_PLAYING) == 0)
        return ends;
    if ((markers & DAC_LINE) != 0) {
        now->line = (markers & DAC_FRAME) != 0 ? 0 : now->line + 1;
        now->generation = log->generation;
        now->ticks = 0;
        now->crc = DAC_LINK_CRC;
        now->markers = 0;
        log->open = true;
    }
    now->ticks++;
    now->markers |= markers;
    now->crc = line_add(line_add(line_add(now->crc, x, 4), y, 4), markers, 1);
    return ends;
}

#endif
