/* Kept programs in the flash of the chip: the region that microbit.ld leaves for them. */
#include "flash_nrf51.h"
#include "kept_sectors.h"

/* These sectors, so that the linker checks that the region has room for them. */
static const uint8_t sectors[KEPT_SECTORS(FLASH_NRF51_PAGE) * FLASH_NRF51_PAGE]
    __attribute__((section(".kept"), aligned(FLASH_NRF51_PAGE)));

const dac_store_flash scan_flash = {
    flash_nrf51_erase, flash_nrf51_write, flash_nrf51_read, (uint32_t)(uintptr_t)sectors, FLASH_NRF51_PAGE,
    KEPT_PLACE_SECTORS(FLASH_NRF51_PAGE), KEPT_SLOTS,
};
