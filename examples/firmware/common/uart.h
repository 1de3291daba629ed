/* The UART of a port: what it sends. What it receives goes to control_received(). */
#ifndef UART_H
#define UART_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

bool board_can_put(void); /* whether board_putc() would not wait */
void board_putc(char c);

#ifdef __cplusplus
}
#endif

#endif
