/* From reset to main(). */
#include <stdint.h>

#include "stm32h7.h"

extern uint32_t data_start[], data_end[], bss_start[], bss_end[], stack_top[];
extern const uint32_t data_load[];

int main(void);
void dma_interrupt(void);
void receive_interrupt(void);
void idle_interrupt(void);
void trigger_interrupt(void);
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
}

void fault(void)
{
    for (;;)
        ;
}

typedef union {
    void *stack;
    void (*handler)(void);
} vector;

__attribute__((section(".vectors"), used)) static const vector vectors[16 + 40] = {
    [0] = {.stack = stack_top},
    [1] = {.handler = reset},
    [2] = {.handler = fault},
    [3] = {.handler = fault},
    [4] = {.handler = fault},
    [5] = {.handler = fault},
    [6] = {.handler = fault},
    [16 + DMA1_STREAM2] = {.handler = dma_interrupt},
    [16 + DMA1_STREAM3] = {.handler = receive_interrupt},
    [16 + EXTI9_5] = {.handler = trigger_interrupt},
    [16 + USART3] = {.handler = idle_interrupt},
};
