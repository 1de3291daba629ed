/* From reset to main(). */
#include <stdint.h>

#include "stm32h7.h"

extern uint32_t data_start[], data_end[], bss_start[], bss_end[], stack_top[], itcm_start[], itcm_end[];
extern const uint32_t data_load[], itcm_load[];

int main(void);
void dma_interrupt(void);
void receive_interrupt(void);
void idle_interrupt(void);
void trigger_interrupt(void);
void reset(void);
void fault(void);

static void copy(uint32_t *to, const uint32_t *end, const uint32_t *from)
{
    while (to != end)
        *to++ = *from++;
}

void reset(void)
{
    copy(data_start, data_end, data_load);
    copy(itcm_start, itcm_end, itcm_load);
    for (uint32_t *to = bss_start; to != bss_end; to++)
        *to = 0;
    barrier(); /* no instruction of the ITCM was fetched before it was there */
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
