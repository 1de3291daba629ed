/* The board functions that the firmware uses: a UART (uart.h), a timer, and an output for the log of the samples. */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "uart.h"

#define REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))

void board_start(void);
void board_start_timer(uint32_t hz); /* its interrupt calls player_timer() */

bool board_log_ready(void); /* whether board_log_putc() would not wait */
void board_log_putc(char c);

/* Interrupts that only some boards have. */
void board_timer_interrupt(void);
void board_uart_interrupt(void);

#endif
