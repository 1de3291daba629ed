/* From the reset to main(). Configuration of the FPGA fills the RAM, so that nothing is copied. */
#include <stdint.h>

extern uint32_t bss_start[], bss_end[];

int main(void);
void entry(void);
void start(void);

__attribute__((naked, section(".entry"), used)) void entry(void)
{
    __asm__(".option arch, +zicsr\n"
            "lui sp, %hi(stack_top)\n"
            "addi sp, sp, %lo(stack_top)\n"
            "la t0, trap\n"
            "csrw mtvec, t0\n"
            "j start\n"
            ".align 2\n"
            "trap: j trap\n"); /* a failed access: the line is silent from then on */
}

void start(void)
{
    for (uint32_t *to = bss_start; to != bss_end; to++)
        *to = 0;
    main();
}
