/* BBC micro:bit with an nRF51822, Cortex-M0: its UART, its timer 0 (it has no SysTick) and its flash. Registers as in
 * Nordic's nRF51 Series Reference Manual 3.0: CLOCK, TIMER, UART, GPIO. 16 MHz. The one UART of the chip carries the
 * link: the log of the samples goes to a debugger. */
#include "board.h"
#include "control.h"
#include "player.h"
#include "random.h"
#include "semihosting.h"

enum { CLOCK_HZ = 16000000 };
enum { UART0 = 2, TIMER0 = 8 };               /* interrupts */
enum { SENDS = 24, RECEIVES = 25 };           /* pins of the UART, to the chip that makes it a serial line over USB */
enum { RECEIVED = 1 << 2 };                   /* INTENSET of the UART */
enum { COMPARED = 1 << 16, CLEAR_BY_COMPARE = 1 }; /* INTENSET and SHORTS of the timer */

#define CLOCK_HFCLKSTART REGISTER(0x40000000)
#define CLOCK_HFCLKSTARTED REGISTER(0x40000100)
#define UART_STARTRX REGISTER(0x40002000)
#define UART_STARTTX REGISTER(0x40002008)
#define UART_RXDRDY REGISTER(0x40002108)
#define UART_TXDRDY REGISTER(0x4000211C)
#define UART_INTENSET REGISTER(0x40002304)
#define UART_ENABLE REGISTER(0x40002500)
#define UART_PSELTXD REGISTER(0x4000250C)
#define UART_PSELRXD REGISTER(0x40002514)
#define UART_RXD REGISTER(0x40002518)
#define UART_TXD REGISTER(0x4000251C)
#define UART_BAUDRATE REGISTER(0x40002524)
#define TIMER_START REGISTER(0x40008000)
#define TIMER_COMPARE0 REGISTER(0x40008140)
#define TIMER_SHORTS REGISTER(0x40008200)
#define TIMER_INTENSET REGISTER(0x40008304)
#define TIMER_BITMODE REGISTER(0x40008508)
#define TIMER_PRESCALER REGISTER(0x40008510)
#define TIMER_CC0 REGISTER(0x40008540)
#define GPIO_OUTSET REGISTER(0x50000508)
#define GPIO_DIRSET REGISTER(0x50000518)
#define NVIC_ISER0 REGISTER(0xE000E100)

static bool sending; /* a byte was written, and its event has not been seen */

void board_start(void)
{
    CLOCK_HFCLKSTARTED = 0;
    CLOCK_HFCLKSTART = 1; /* the crystal: the internal oscillator is too far off for a UART */
    while (CLOCK_HFCLKSTARTED == 0)
        ;
    GPIO_OUTSET = 1u << SENDS; /* the line rests high, also while the UART is off */
    GPIO_DIRSET = 1u << SENDS;
    UART_PSELTXD = SENDS;
    UART_PSELRXD = RECEIVES;
    UART_BAUDRATE = (uint32_t)((((uint64_t)BAUD << 32) / CLOCK_HZ + 0x800) & 0xFFFFF000); /* multiples of 0x1000 */
    UART_ENABLE = 4;
    UART_RXDRDY = 0;
    UART_TXDRDY = 0;
    UART_INTENSET = RECEIVED;
    NVIC_ISER0 = 1u << UART0;
    UART_STARTTX = 1;
    UART_STARTRX = 1;
}

void board_start_timer(uint32_t hz)
{
    TIMER_BITMODE = 3; /* 32 bits */
    TIMER_PRESCALER = 0;
    TIMER_CC0 = CLOCK_HZ / hz;
    TIMER_SHORTS = CLEAR_BY_COMPARE;
    TIMER_INTENSET = COMPARED;
    NVIC_ISER0 = 1u << TIMER0;
    TIMER_START = 1;
}

void board_timer_interrupt(void)
{
    TIMER_COMPARE0 = 0;
    clock_tick();
    player_timer();
}

void board_uart_interrupt(void)
{
    while (UART_RXDRDY != 0) {
        UART_RXDRDY = 0; /* clear first: a byte behind this one in the FIFO of six sets it again */
        control_received((uint8_t)UART_RXD);
    }
}

bool board_can_put(void)
{
    if (sending && UART_TXDRDY != 0) {
        UART_TXDRDY = 0;
        sending = false;
    }
    return !sending;
}

void board_putc(char c)
{
    while (!board_can_put())
        ;
    sending = true;
    UART_TXD = (unsigned char)c;
}

bool board_log_ready(void)
{
    return true;
}

void board_log_putc(char c)
{
    (void)host_call(HOST_WRITEC, &c);
}
