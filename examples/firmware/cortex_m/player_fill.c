/* Two half buffers: the timer puts out one while an interrupt of lower priority fills the other. */
#include "board.h"
#include "dac.h"
#include "player.h"

#define SHPR3 REGISTER(0xE000ED20) /* priorities of PendSV (bits 23..16) and SysTick */
#define ICSR REGISTER(0xE000ED04)
enum { PEND = 1 << 28 };

enum { HALF = 32 }; /* ticks per half buffer: requests take effect, and computed samples leave, this much later */

static dac_output codes[2][2 * HALF];
static uint8_t markers[2][HALF];
static volatile uint8_t full[2];      /* set by PendSV, cleared by the timer */
/* Counted by the timer, reported by PendSV: a consumer does not interrupt itself. */
static volatile uint32_t underruns;
static unsigned half, at;             /* used by the timer only */

static void pend(void)
{
    ICSR = PEND;
}

void player_start(void)
{
    SHPR3 |= UINT32_C(0xff) << 16;
    player_pended();
}

void player_timer(void)
{
    if (!dac_ready())
        return;
    if (!full[half]) {
        underruns = underruns + 1; /* the outputs keep their values */
        pend();
        return;
    }
    dac_put(codes[half][2 * at], codes[half][2 * at + 1], markers[half][at]);
    if (++at != HALF)
        return;
    at = 0;
    full[half] = 0;
    half ^= 1;
    pend();
}

void player_pended(void)
{
    static uint32_t reported;
    static unsigned next;

    for (; reported != underruns; reported++)
        dac_sequencer_report(&sequencer, DAC_FAULT_UNDERRUN);
    while (!full[next]) {
        dac_sequencer_fill(&sequencer, codes[next], codes[next] + 1, markers[next], HALF);
        __asm__ volatile("" ::: "memory"); /* write the samples before `full` */
        full[next] = 1;
        next ^= 1;
    }
}
