/* RP2040: core 0 is the producer, core 1 the consumer, and two state machines of the PIO are the clock of the samples:
 * each shifts 16 bits to its own converter in 34 cycles, as long as core 1 keeps the queues filled. Not tested on
 * hardware. */
#include "dac_sequencer.h"
#include SCAN_HEADER
#include "rp2040.h"

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define CONSTANT(suffix) JOIN(SCAN_UPPER, suffix)
#define PROGRAM(NAME, name) DAC_PROGRAM(NAME, name)
#define CONVERTER(AXIS) DAC_CONVERTER(AXIS, 0)

enum { X, Y };                                            /* state machines */
enum { TICKS = 32 };                                      /* ticks computed at once */
enum { SYSTEM_HZ = 125000000, SAMPLE_CYCLES = 34 };
enum { DIVIDER = SYSTEM_HZ / SAMPLE_CYCLES / UPDATE_RATE_HZ }; /* a whole number: no jitter */
enum { X_DATA = 2, X_CLOCK = 3, X_SELECT = 4, Y_DATA = 5, Y_CLOCK = 6, Y_SELECT = 7 };

typedef char sixteen_bits[CONSTANT(_X_DAC_WORD_BITS) == 16 && CONSTANT(_Y_DAC_WORD_BITS) == 16 ? 1 : -1];
typedef char the_divider_fits[DIVIDER >= 2 && DIVIDER < 65536 ? 1 : -1];

/* .side_set 2: bit 0 is the clock, bit 1 the select, low while bits are shifted; the converter takes them when it
 * rises. */
static const uint16_t shift[] = {
    0x90A0, /*      pull block   side 0b10 */
    0xF02F, /*      set x, 15    side 0b10 */
    0x6001, /* bit: out pins, 1  side 0b00 */
    0x0842, /*      jmp x--, bit side 0b01  ; the rising edge */
};
enum { LENGTH = sizeof shift / sizeof shift[0] };

static const dac_program scan = PROGRAM(SCAN_UPPER, SCAN);
static const dac_converter x_converter = CONVERTER(CONSTANT(_X)), y_converter = CONVERTER(CONSTANT(_Y));
static dac_sequencer sequencer;
static uint32_t core1_stack[256];

extern const char vectors[]; /* in startup.c */
int main(void);

static void start_clocks(void)
{
    XOSC_STARTUP = 47; /* 1 ms */
    XOSC_CTRL = 0xFABu << 12 | 0xAA0u;
    while ((XOSC_STATUS & UINT32_C(1) << 31) == 0)
        ;
    CLK_REF_CTRL = 2;
    while (CLK_REF_SELECTED != 1u << 2)
        ;
    RESETS_RESET &= ~(uint32_t)(RESET_PLL_SYS | RESET_IO_BANK0 | RESET_PADS_BANK0 | RESET_PIO0);
    while ((~RESETS_RESET_DONE & (RESET_PLL_SYS | RESET_IO_BANK0 | RESET_PADS_BANK0 | RESET_PIO0)) != 0)
        ;
    PLL_SYS_CS = 1;
    PLL_SYS_FBDIV_INT = 125; /* 12 MHz * 125 / 6 / 2 */
    PLL_SYS_PWR = 1u << 3;   /* on, but for the post divider */
    while ((PLL_SYS_CS & UINT32_C(1) << 31) == 0)
        ;
    PLL_SYS_PRIM = 6u << 16 | 2u << 12;
    PLL_SYS_PWR = 0;
    CLK_SYS_CTRL = 0;
    CLK_SYS_CTRL = 1;
    while (CLK_SYS_SELECTED != 2)
        ;
}

static void start_machine(unsigned machine, uint32_t data, uint32_t clock)
{
    PIO0_CLKDIV(machine) = (uint32_t)DIVIDER << 16;
    PIO0_EXECCTRL(machine) = (LENGTH - 1) << 12;    /* wraps after the last */
    PIO0_SHIFTCTRL(machine) = UINT32_C(1) << 30;    /* all eight words for output; the highest bit first */
    PIO0_PINCTRL(machine) = 3u << 26 | data << 5;   /* three pins for SET, starting at the data pin */
    PIO0_INSTR(machine) = 0xE087;                   /* set pindirs, 7: all three pins are outputs */
    /* Two side-set pins from the clock on, one pin to shift out to. */
    PIO0_PINCTRL(machine) = UINT32_C(2) << 29 | 1u << 20 | clock << 10 | data;
    PIO0_INSTR(machine) = 0x1000;                   /* jmp 0 side 0b10 */
}

/* Core 1: the consumer. The queues hold 8 samples of an axis, some 80 us at 100 kHz, while the next are computed. */
static void consume(void)
{
    static dac_output codes[2 * TICKS];

    for (;;) {
        dac_sequencer_fill(&sequencer, codes, codes + 1, NULL, TICKS);
        if ((PIO0_FDEBUG & 3u << 24) != 0) { /* a state machine found its queue empty */
            PIO0_FDEBUG = 3u << 24;
            dac_sequencer_report(&sequencer, DAC_FAULT_UNDERRUN);
        }
        for (unsigned i = 0; i < 2 * TICKS; i++) {
            while ((PIO0_FSTAT & UINT32_C(1) << (16 + i % 2)) != 0)
                ;
            PIO0_TXF(i % 2) = (uint32_t)codes[i] << 16;
        }
    }
}

static void core1_main(void)
{
    /* Both queues are filled before the machines start, on the same cycle, so that x and y leave together. */
    for (unsigned i = 0; i < 8; i++) {
        dac_tick tick;
        dac_sequencer_step(&sequencer, &tick);
        PIO0_TXF(X) = (uint32_t)tick.x << 16;
        PIO0_TXF(Y) = (uint32_t)tick.y << 16;
    }
    PIO0_FDEBUG = 3u << 24;
    PIO0_CTRL = 3u << 8 | 3u; /* dividers restarted, both on */
    consume();
}

/* The boot ROM of core 1 waits for these words, each of them echoed (section 2.8.2). */
static void start_core1(void)
{
    const uint32_t words[] = {0, 0, 1, (uint32_t)(uintptr_t)vectors, (uint32_t)(uintptr_t)(core1_stack + 256),
                              (uint32_t)(uintptr_t)core1_main};
    unsigned at = 0;

    while (at < sizeof words / sizeof words[0]) {
        if (words[at] == 0) {
            while ((SIO_FIFO_ST & FIFO_VALID) != 0)
                (void)SIO_FIFO_RD;
            __asm__ volatile("sev");
        }
        while ((SIO_FIFO_ST & FIFO_READY) == 0)
            ;
        SIO_FIFO_WR = words[at];
        __asm__ volatile("sev");
        while ((SIO_FIFO_ST & FIFO_VALID) == 0)
            __asm__ volatile("wfe");
        at = SIO_FIFO_RD == words[at] ? at + 1 : 0;
    }
}

int main(void)
{
    start_clocks();
    for (unsigned i = 0; i < LENGTH; i++)
        PIO0_INSTR_MEM(i) = shift[i];
    for (unsigned pin = X_DATA; pin <= Y_SELECT; pin++)
        GPIO_CTRL(pin) = FUNCTION_PIO0;
    start_machine(X, X_DATA, X_CLOCK);
    start_machine(Y, Y_DATA, Y_CLOCK);
    dac_sequencer_init(&sequencer, &x_converter, &y_converter);
    if (dac_sequencer_load(&sequencer, &scan) != DAC_LOADED)
        for (;;)
            ;
    (void)dac_sequencer_commit(&sequencer);
    start_core1();
    while (dac_sequencer_status(&sequencer).swaps == 0)
        ; /* wait until the program is taken */
    (void)dac_sequencer_arm(&sequencer, 0);
    (void)dac_sequencer_trigger(&sequencer);
    for (;;)
        ; /* core 0 is the producer: commands, loads, commits */
}
