/* Arm MPS2 with the FPGA image AN386, Cortex-M4: the UARTs and the timer of the Cortex-M System Design Kit. Registers
 * as in its technical reference manual (DDI 0479), chapters on the APB UART and the APB timer; addresses as in AN386,
 * memory map. 25 MHz. */
#include "board.h"
#include "control.h"
#include "player.h"
#include "random.h"

enum { CLOCK_HZ = 25000000 };
enum { TRANSMIT_FULL = 1, RECEIVE_FULL = 2 };                          /* STATE */
enum { TRANSMIT = 1, RECEIVE = 2, RECEIVE_INTERRUPT = 8 };             /* CTRL */
enum { RECEIVED_ONE = 2 };                                             /* INTCLEAR */
enum { UART0_RECEIVES = 0, TIMER0 = 8 };                               /* interrupts */

#define UART_DATA(uart) REGISTER((uart) + 0x00)
#define UART_STATE(uart) REGISTER((uart) + 0x04)
#define UART_CTRL(uart) REGISTER((uart) + 0x08)
#define UART_INTCLEAR(uart) REGISTER((uart) + 0x0C)
#define UART_BAUDDIV(uart) REGISTER((uart) + 0x10)
#define TIMER_CTRL REGISTER(0x40000000)
#define TIMER_VALUE REGISTER(0x40000004)
#define TIMER_RELOAD REGISTER(0x40000008)
#define TIMER_INTCLEAR REGISTER(0x4000000C)
#define NVIC_ISER0 REGISTER(0xE000E100)

#define CONSOLE UINT32_C(0x40004000)
#define LOG UINT32_C(0x40005000)

void board_start(void)
{
    UART_BAUDDIV(CONSOLE) = CLOCK_HZ / BAUD;
    UART_BAUDDIV(LOG) = CLOCK_HZ / BAUD;
    UART_CTRL(LOG) = TRANSMIT;
    UART_CTRL(CONSOLE) = TRANSMIT | RECEIVE | RECEIVE_INTERRUPT;
    NVIC_ISER0 = 1u << UART0_RECEIVES;
}

void board_start_timer(uint32_t hz)
{
    TIMER_VALUE = CLOCK_HZ / hz - 1;
    TIMER_RELOAD = CLOCK_HZ / hz - 1;
    NVIC_ISER0 = 1u << TIMER0;
    TIMER_CTRL = 1u << 3 | 1u; /* interrupt, on */
}

void board_timer_interrupt(void)
{
    TIMER_INTCLEAR = 1;
    clock_tick();
    player_timer();
}

void board_uart_interrupt(void)
{
    UART_INTCLEAR(CONSOLE) = RECEIVED_ONE; /* clear first: a later character sets it again */
    while ((UART_STATE(CONSOLE) & RECEIVE_FULL) != 0)
        control_received((uint8_t)UART_DATA(CONSOLE));
}

bool board_can_put(void)
{
    return (UART_STATE(CONSOLE) & TRANSMIT_FULL) == 0;
}

void board_putc(char c)
{
    while (!board_can_put())
        ;
    UART_DATA(CONSOLE) = (unsigned char)c;
}

bool board_log_ready(void)
{
    return (UART_STATE(LOG) & TRANSMIT_FULL) == 0;
}

void board_log_putc(char c)
{
    UART_DATA(LOG) = (unsigned char)c;
}
