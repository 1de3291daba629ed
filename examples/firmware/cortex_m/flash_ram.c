/* A flash for kept programs (docs/c.md) in RAM that a reset leaves as it is, for boards without a flash that QEMU can
 * write.
 *
 * On hardware these three functions call the driver of the flash controller, with the sectors that are left behind the
 * firmware, as flash_microbit.c does. An erase that takes longer than half a buffer stops the samples where code runs
 * from the same flash. */
#include "kept_sectors.h"

enum { SECTOR = 1024 };

static uint8_t cells[KEPT_SECTORS(SECTOR) * SECTOR] __attribute__((section(".noinit")));

static bool erase_sector(uint32_t address)
{
    for (uint32_t i = 0; i < SECTOR; i++)
        cells[address + i] = 0xFF;
    return true;
}

/* As flash does, it clears bits and sets none. */
static bool write_line(uint32_t address, const uint8_t *bytes)
{
    for (uint32_t i = 0; i < DAC_STORE_LINE; i++)
        cells[address + i] = cells[address + i] & bytes[i];
    return true;
}

static bool read_bytes(uint32_t address, uint8_t *bytes, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        bytes[i] = cells[address + i];
    return true;
}

const dac_store_flash scan_flash = {
    erase_sector, write_line, read_bytes, 0, SECTOR, KEPT_PLACE_SECTORS(SECTOR), KEPT_SLOTS,
};
