/* What the boot ROM reads, and from reset to main(). */
#include <stdint.h>

#include "imxrt1062.h"

extern uint32_t data_start[], data_end[], bss_start[], bss_end[], stack_top[];
extern const uint32_t data_load[];

int main(void);
void dma_interrupt(void);
void receive_interrupt(void);
void idle_interrupt(void);
void reset(void);
void fault(void);

typedef union {
    const volatile void *data;
    void (*handler)(void);
    uint32_t number;
} word;

__attribute__((section(".vectors"), used)) static const word vectors[16 + LPUART6 + 1] = {
    [0] = {.data = stack_top},
    [1] = {.handler = reset},
    [2] = {.handler = fault},
    [3] = {.handler = fault},
    [4] = {.handler = fault},
    [5] = {.handler = fault},
    [6] = {.handler = fault},
    [16 + DMA_CHANNEL0] = {.handler = dma_interrupt},
    [16 + DMA_CHANNEL1] = {.handler = receive_interrupt},
    [16 + LPUART6] = {.handler = idle_interrupt},
};

/* How FlexSPI reads the flash, at 0x60000000: the fields of NXP's serial NOR configuration block that are not 0. The
 * sequence is that of a W25Q64: command 0xEB, then address, mode, four dummy cycles and data on four lines. */
__attribute__((section(".boot_flash"), used)) static const uint32_t flash_configuration[128] = {
    [0] = 0x42464346,                               /* "FCFB" */
    [1] = 0x56010000,                               /* "V" 1.0 */
    [3] = 3u << 16 | 3u << 8 | 1,                   /* hold and set-up of CS; samples with the DQS pad looped back */
    [17] = 8u << 16 | 4u << 8 | 1,                  /* 133 MHz, four lines, NOR */
    [20] = 8u << 20,                                /* bytes */
    [32] = 0x0A1804EB, [33] = 0x32041E00, [34] = 0x00002604,
    [112] = 256, [113] = 4096, [114] = 1, [116] = 65536, /* page, sector, clock of commands: 30 MHz, block */
};

/* Image vector table, at 0x60001000, and boot data: this image is executed where it is. */
static const word boot_data[3];
__attribute__((section(".boot_image"), used)) static const word image_vectors[8] = {
    [0] = {.number = 0x432000D1},
    [1] = {.data = vectors},
    [4] = {.data = boot_data},
    [5] = {.data = image_vectors},
};
__attribute__((section(".boot_data"), used)) static const word boot_data[3] = {
    [0] = {.number = 0x60000000},
    [1] = {.number = 1u << 20},
};

void reset(void)
{
    SCB_VTOR = (uint32_t)(uintptr_t)vectors;
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
