#include "flash_nrf51.h"

#include "dac_store.h"

#define REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))

#define NVMC_READY REGISTER(0x4001E400)
#define NVMC_CONFIG REGISTER(0x4001E504)
#define NVMC_ERASEPAGE REGISTER(0x4001E508) /* of code region 1, which is all flash unless a SoftDevice is there */

enum { READY = 1 };
enum { READ_ONLY = 0, WRITE = 1, ERASE = 2 }; /* CONFIG */
enum { WORD = 4 };                            /* bytes: the controller writes no less */
/* An erase takes up to 22.3 ms, 357,000 cycles. A poll takes 6 or more: a load, a comparison, and a branch. */
enum { POLLS = 100000 };

static bool within(uint32_t address, uint32_t bytes)
{
    const uint32_t start = (uint32_t)(uintptr_t)kept_start, end = (uint32_t)(uintptr_t)kept_end;

    return address >= start && address <= end && bytes <= end - address;
}

/* Waits: a write, or a change of CONFIG, while the controller is busy is lost or spoils what it does. Code in flash
 * finds it ready, because the processor stops meanwhile. Code in RAM does not stop. */
static bool wait_until_ready(void)
{
    __asm__ volatile("dsb" ::: "memory"); /* what was written before has reached the controller */
    for (uint32_t polls = 0; polls < POLLS; polls++)
        if ((NVMC_READY & READY) != 0)
            return true;
    return false;
}

static bool configure(uint32_t access)
{
    if (!wait_until_ready())
        return false;
    NVMC_CONFIG = access;
    __asm__ volatile("dsb" ::: "memory"); /* CONFIG is written before flash is */
    return true;
}

static bool erased(uint32_t address)
{
    for (uint32_t at = 0; at < FLASH_NRF51_PAGE; at += WORD)
        if (REGISTER(address + at) != UINT32_MAX)
            return false;
    return true;
}

bool flash_nrf51_erase(uint32_t address)
{
    if (address % FLASH_NRF51_PAGE != 0 || !within(address, FLASH_NRF51_PAGE) || !configure(ERASE))
        return false;
    NVMC_ERASEPAGE = address;
    return configure(READ_ONLY) && erased(address); /* read-only: no stray write of the firmware changes flash */
}

bool flash_nrf51_write(uint32_t address, const uint8_t *bytes)
{
    bool good = true;

    if (address % WORD != 0 || !within(address, DAC_STORE_LINE) || !configure(WRITE))
        return false;
    for (uint32_t at = 0; good && at < DAC_STORE_LINE; at += WORD) {
        const uint32_t word = (uint32_t)bytes[at] | (uint32_t)bytes[at + 1] << 8 | (uint32_t)bytes[at + 2] << 16
                            | (uint32_t)bytes[at + 3] << 24;
        REGISTER(address + at) = word;
        /* A bit that was 0 before stays 0. */
        good = wait_until_ready() && REGISTER(address + at) == word;
    }
    return configure(READ_ONLY) && good;
}

bool flash_nrf51_read(uint32_t address, uint8_t *bytes, uint32_t count)
{
    if (!within(address, count))
        return false;
    for (uint32_t i = 0; i < count; i++)
        bytes[i] = *(const volatile uint8_t *)(uintptr_t)(address + i);
    return true;
}
