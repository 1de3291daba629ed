/* From reset to main(): vectors and memory. */
#include <stdint.h>

#include "board.h"
#include "player.h"

extern uint32_t data_start[], data_end[], bss_start[], bss_end[], stack_top[];
extern const uint32_t data_load[];

int main(void);
void reset(void);
void fault(void);

void reset(void)
{
    const uint32_t *from = data_load;
    for (uint32_t *to = data_start; to != data_end; to++)
        *to = *from++;
    for (uint32_t *to = bss_start; to != bss_end; to++)
        *to = 0;
    main();
    fault();
}

void fault(void)
{
    for (;;)
        ;
}

/* The interrupts of all boards: each board has its own vectors for UART and timer. */
typedef union {
    void *stack;
    void (*handler)(void);
} vector;

__attribute__((section(".vectors"), used)) static const vector vectors[16 + 16] = {
    [0] = {.stack = stack_top},
    [1] = {.handler = reset},
    [2] = {.handler = fault},
    [3] = {.handler = fault},
    [4] = {.handler = fault},
    [5] = {.handler = fault},
    [6] = {.handler = fault},
    [14] = {.handler = player_pended},
    [15] = {.handler = board_timer_interrupt},     /* SysTick */
    [16] = {.handler = board_uart_interrupt},      /* MPS2: UART 0 has received */
    [16 + 2] = {.handler = board_uart_interrupt},  /* nRF51: UART 0 */
    [16 + 5] = {.handler = board_uart_interrupt},  /* LM3S6965: UART 0 */
    [16 + 8] = {.handler = board_timer_interrupt}, /* MPS2, nRF51: timer 0 */
};
