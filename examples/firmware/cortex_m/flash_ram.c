/* A flash for kept programs (docs/c.md) in RAM that a reset leaves as it is: QEMU has no flash that can be written.
 *
 * On hardware these three functions call the driver of the flash controller, with the sectors that are left behind the
 * firmware. An erase that takes longer than half a buffer stops the samples where code runs from the same flash. */
#include "names.h"
#include "scan_link.h"

#include SCAN_HEADER

enum { SECTOR = 1024, SLOTS = 2 };
enum { PLACE = 64 + 192 + (CONSTANT(_X_TABLE_LENGTH) + CONSTANT(_Y_TABLE_LENGTH)) * (int)sizeof(dac_word) };
enum { PLACE_SECTORS = (PLACE + SECTOR - 1) / SECTOR, SECTORS = DAC_STORE_RECORDS + (SLOTS + 1) * PLACE_SECTORS };

static uint8_t cells[SECTORS * SECTOR] __attribute__((section(".noinit")));

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

const dac_store_flash scan_flash = {erase_sector, write_line, read_bytes, 0, SECTOR, PLACE_SECTORS, SLOTS};
