/* Kept programs on the flash of an nRF51: a store, whose functions are called from outside. */
#include "dac_store.h"
#include "flash_nrf51.h"

static const dac_store_flash flash = {
    flash_nrf51_erase, flash_nrf51_write, flash_nrf51_read, 0x20000, FLASH_NRF51_PAGE, 2, 3,
};
static dac_store store;

static void copy(void *from, uint32_t offset, uint8_t *bytes, uint32_t count)
{
    const uint8_t *const image = from;

    for (uint32_t i = 0; i < count; i++)
        bytes[i] = image[offset + i];
}

uint32_t store_open(void);
uint32_t store_open(void)
{
    return dac_store_open(&store, &flash);
}

uint32_t store_start(void);
uint32_t store_start(void)
{
    return dac_store_start(&store);
}

uint32_t store_save(uint32_t slot, const uint8_t *info, uint8_t *image);
uint32_t store_save(uint32_t slot, const uint8_t *info, uint8_t *image)
{
    return dac_store_save(&store, (uint8_t)slot, info, copy, image);
}

uint32_t store_select(uint32_t slot, uint32_t trial);
uint32_t store_select(uint32_t slot, uint32_t trial)
{
    return dac_store_select(&store, (uint8_t)slot, trial != 0);
}

uint32_t store_confirm(void);
uint32_t store_confirm(void)
{
    return dac_store_confirm(&store);
}

uint32_t store_delete(uint32_t slot);
uint32_t store_delete(uint32_t slot)
{
    return dac_store_delete(&store, (uint8_t)slot);
}
