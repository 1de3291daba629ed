/* Stellaris LM3S6965 evaluation board, Cortex-M3: PL011 UARTs and SysTick. Registers as in the LM3S6965 data sheet (DS-
 * LM3S6965): System Control, GPIO, UART; SysTick and NVIC in the chapter on the Cortex-M3 peripherals. 12 MHz internal
 * oscillator. */
#include "board.h"
#include "control.h"
#include "player.h"
#include "random.h"

enum { CLOCK_HZ = 12000000 };
enum { RECEIVE_EMPTY = 1 << 4, TRANSMIT_FULL = 1 << 5 };         /* UARTFR */
enum { RECEIVE_INTERRUPT = 1 << 4, RECEIVE_TIMEOUT = 1 << 6 };   /* UARTIM, UARTICR */

#define RCGC1 REGISTER(0x400FE104)
#define RCGC2 REGISTER(0x400FE108)
#define GPIO_AFSEL(port) REGISTER((port) + 0x420)
#define GPIO_PUR(port) REGISTER((port) + 0x510)
#define GPIO_DEN(port) REGISTER((port) + 0x51C)
#define GPIO_DATA(port) REGISTER((port) + 0x3FC)
#define UART_DR(uart) REGISTER((uart) + 0x00)
#define UART_FR(uart) REGISTER((uart) + 0x18)
#define UART_IBRD(uart) REGISTER((uart) + 0x24)
#define UART_FBRD(uart) REGISTER((uart) + 0x28)
#define UART_LCRH(uart) REGISTER((uart) + 0x2C)
#define UART_CTL(uart) REGISTER((uart) + 0x30)
#define UART_IM(uart) REGISTER((uart) + 0x38)
#define UART_ICR(uart) REGISTER((uart) + 0x44)
#define SYST_CSR REGISTER(0xE000E010)
#define SYST_RVR REGISTER(0xE000E014)
#define SYST_CVR REGISTER(0xE000E018)
#define NVIC_ISER0 REGISTER(0xE000E100)

#define PORT_A UINT32_C(0x40004000) /* 0 and 1: UART 0 */
#define PORT_D UINT32_C(0x40007000) /* 2 and 3: UART 1 */
#define PORT_E UINT32_C(0x40024000) /* 0: the button "up", low when pressed */
#define CONSOLE UINT32_C(0x4000C000)
#define LOG UINT32_C(0x4000D000)

static void start_uart(uint32_t uart)
{
    const uint32_t divisor = (CLOCK_HZ * 4u + BAUD / 2) / BAUD; /* in 1/64 of 16 clocks */

    UART_CTL(uart) = 0;
    UART_IBRD(uart) = divisor >> 6;
    UART_FBRD(uart) = divisor & 63;
    UART_LCRH(uart) = 3u << 5 | 1u << 4; /* 8 bits, FIFOs */
    UART_CTL(uart) = 1u << 9 | 1u << 8 | 1u;
}

void board_start(void)
{
    RCGC1 |= 3;
    RCGC2 |= 1u << 4 | 1u << 3 | 1u;
    (void)RCGC2; /* clocks take three cycles to arrive */
    (void)RCGC2;
    GPIO_AFSEL(PORT_A) |= 3;
    GPIO_DEN(PORT_A) |= 3;
    GPIO_AFSEL(PORT_D) |= 3u << 2;
    GPIO_DEN(PORT_D) |= 3u << 2;
    GPIO_PUR(PORT_E) |= 1;
    GPIO_DEN(PORT_E) |= 1;
    start_uart(CONSOLE);
    start_uart(LOG);
    /* Read what was received before: the interrupt comes only when the FIFO fills to its level. */
    while ((UART_FR(CONSOLE) & RECEIVE_EMPTY) == 0)
        (void)UART_DR(CONSOLE);
    UART_IM(CONSOLE) = RECEIVE_INTERRUPT | RECEIVE_TIMEOUT;
    NVIC_ISER0 = 1u << 5;
}

void board_start_timer(uint32_t hz)
{
    SYST_RVR = CLOCK_HZ / hz - 1;
    SYST_CVR = 0;
    SYST_CSR = 7; /* the processor's clock, interrupt, on */
}

void board_timer_interrupt(void)
{
    clock_tick();
    player_timer();
}

void board_uart_interrupt(void)
{
    UART_ICR(CONSOLE) = RECEIVE_INTERRUPT | RECEIVE_TIMEOUT; /* clear first: a later character sets it again */
    while ((UART_FR(CONSOLE) & RECEIVE_EMPTY) == 0)
        control_received((uint8_t)UART_DR(CONSOLE));
}

bool board_pressed(void)
{
    static bool before = true; /* a button that is held over a start is not pressed anew */
    const bool down = (GPIO_DATA(PORT_E) & 1) == 0, pressed = down && !before;

    before = down;
    return pressed;
}

bool board_can_put(void)
{
    return (UART_FR(CONSOLE) & TRANSMIT_FULL) == 0;
}

void board_putc(char c)
{
    while (!board_can_put())
        ;
    UART_DR(CONSOLE) = (unsigned char)c;
}

bool board_log_ready(void)
{
    return (UART_FR(LOG) & TRANSMIT_FULL) == 0;
}

void board_log_putc(char c)
{
    UART_DR(LOG) = (unsigned char)c;
}
