/* RP2040: core 0 is the producer and serves the link, core 1 is the consumer, and two state machines of the PIO are the
 * clock of the samples: each shifts 16 bits to its own converter in 34 cycles, as long as core 1 keeps the queues
 * filled. Not tested on hardware. */
#include "control.h"
#include "names.h"
#include "rp2040.h"
#include "scan.h"
#include "uart.h"
#include SCAN_HEADER

enum { X, Y };                                            /* state machines */
enum { QUEUE = 8, TICKS = QUEUE / 2 };                    /* samples in a queue, and ticks computed at once */
enum { EMPTY = 3 << 24, STALLED = 3 << 24 }; /* of both machines, in FSTAT and FDEBUG */
enum { SYSTEM_HZ = 125000000 };                           /* DIVIDER * 34 of its cycles are a sample */
enum { UART_TRANSMIT = 0, UART_RECEIVED = 1 };            /* pins */
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

dac_sequencer sequencer;
static uint32_t core1_stack[256];

extern const char vectors[]; /* in startup.c */
int main(void);
void uart_interrupt(void);

enum { NEEDED = RESET_PLL_SYS | RESET_IO_BANK0 | RESET_PADS_BANK0 | RESET_PIO0 | RESET_UART0 };

static void start_clocks(void)
{
    XOSC_STARTUP = 47; /* 1 ms */
    XOSC_CTRL = 0xFABu << 12 | 0xAA0u;
    while ((XOSC_STATUS & UINT32_C(1) << 31) == 0)
        ;
    CLK_REF_CTRL = 2;
    while (CLK_REF_SELECTED != 1u << 2)
        ;
    RESETS_RESET &= ~(uint32_t)NEEDED;
    while ((~RESETS_RESET_DONE & NEEDED) != 0)
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
    CLK_PERI_CTRL = 1u << 11; /* the UART's clock is that of the system */
}

/* Its FIFO holds 32 bytes. The interrupt comes at 4 of them, or when the line rests: 600 us before a loss at 460800
 * baud. */
static void start_uart(void)
{
    const uint32_t divisor = (SYSTEM_HZ * 4u + BAUD / 2) / BAUD; /* in 1/64 of 16 clocks */

    GPIO_CTRL(UART_TRANSMIT) = FUNCTION_UART;
    GPIO_CTRL(UART_RECEIVED) = FUNCTION_UART;
    UART0_IBRD = divisor >> 6;
    UART0_FBRD = divisor & 63;
    UART0_IFLS = 0;
    UART0_LCR_H = 3u << 5 | 1u << 4; /* 8 bits, FIFOs; this write takes the divisor as well */
    UART0_CR = 1u << 9 | 1u << 8 | 1u;
    /* Read what was received before: the interrupt comes only when the FIFO fills to its level. */
    while ((UART0_FR & UART_RECEIVE_EMPTY) == 0)
        (void)UART0_DR;
    UART0_IMSC = UART_RECEIVE | UART_RECEIVE_TIMEOUT;
    NVIC_ISER = UINT32_C(1) << UART0_INTERRUPT;
}

void uart_interrupt(void)
{
    UART0_ICR = UART_RECEIVE | UART_RECEIVE_TIMEOUT; /* clear first: a later byte sets it again */
    while ((UART0_FR & UART_RECEIVE_EMPTY) == 0)
        control_received((uint8_t)UART0_DR);
}

bool board_can_put(void)
{
    return (UART0_FR & UART_TRANSMIT_FULL) == 0;
}

void board_putc(char c)
{
    UART0_DR = (unsigned char)c;
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

/* Core 1: the consumer. The queues hold 8 samples of an axis, which last while the next 4 are computed, however long
 * each takes. The machines start on the same cycle, so that x and y leave together; after an underrun they start again.
 */
static void core1_main(void)
{
    static dac_output codes[2 * TICKS];
    unsigned queued = 0; /* samples before the machines start; then no more */

    for (;;) {
        dac_sequencer_fill(&sequencer, codes, codes + 1, NULL, TICKS);
        if (queued == QUEUE && (PIO0_FDEBUG & STALLED) != 0) { /* a machine found its queue empty */
            dac_sequencer_report(&sequencer, DAC_FAULT_UNDERRUN);
            while ((PIO0_FSTAT & EMPTY) != EMPTY)
                ;
            PIO0_FDEBUG = STALLED;
            while ((PIO0_FDEBUG & STALLED) != STALLED)
                ; /* until both have shifted out their last words and wait */
            PIO0_CTRL = 0;
            queued = 0;
        }
        for (unsigned i = 0; i < 2 * TICKS; i++) {
            while ((PIO0_FSTAT & UINT32_C(1) << (16 + i % 2)) != 0)
                ;
            PIO0_TXF(i % 2) = (uint32_t)codes[i] << 16;
        }
        if (queued != QUEUE) {
            queued += TICKS;
            if (queued == QUEUE) {
                PIO0_FDEBUG = STALLED;
                PIO0_CTRL = 3u << 8 | 3u; /* dividers restarted, both on */
            }
        }
    }
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
    const bool good = dac_sequencer_init(&sequencer, &scan_x_converter, &scan_y_converter) && control_start();
    start_uart();
    start_core1();
    while (good && dac_sequencer_status(&sequencer).swaps == 0)
        ; /* a trigger before the program is taken has no effect */
    control_ready(good);
    for (;;)
        control_work();
}
