/* From the boot ROM to main(). The image is for RAM: picotool or the drive of the boot ROM loads it there and enters it
 * at its start. */
#include <stdint.h>

#include "rp2040.h"

extern uint32_t bss_start[], bss_end[], stack_top[];

int main(void);
void entry(void);
void reset(void);
void fault(void);
void uart_interrupt(void);

typedef union {
    void *stack;
    void (*handler)(void);
} vector;

extern const vector vectors[];
__attribute__((aligned(256), used)) const vector vectors[16 + 26] = {
    [0] = {.stack = stack_top},
    [1] = {.handler = reset},
    [2] = {.handler = fault},
    [3] = {.handler = fault},
    [16 + UART0_INTERRUPT] = {.handler = uart_interrupt}, /* of core 0, which alone enables it */
};

/* The first instructions of the image: a stack, then C. */
__attribute__((naked, section(".vectors"), used)) void entry(void)
{
    __asm__("ldr r0, =stack_top\n"
            "mov sp, r0\n"
            "ldr r0, =reset\n"
            "bx r0\n"
            ".ltorg\n");
}

void reset(void)
{
    VTOR = (uint32_t)(uintptr_t)vectors;
    for (uint32_t *to = bss_start; to != bss_end; to++)
        *to = 0;
    main();
}

void fault(void)
{
    for (;;)
        ;
}
