/* The flash of an nRF51 for kept programs (docs/c.md): the functions of a dac_store_flash. Registers and times as in
 * Nordic's nRF51 Series Reference Manual 3.0, chapter on the NVMC, and the product specification of the nRF51822.
 *
 * The linker script gives the region: kept_start and kept_end, at pages, and behind the firmware. The functions return
 * false outside of it, where the controller does not become ready, and where flash reads otherwise than it was left.
 *
 * The processor stops while flash is written or erased, up to 23 ms a page: park the scan first (`store_while_playing`
 * of the link is false), and expect that bytes of a UART that arrive meanwhile are lost. A SoftDevice does not let
 * others use the controller: with one, write these functions with its calls. */
#ifndef FLASH_NRF51_H
#define FLASH_NRF51_H

#include <stdbool.h>
#include <stdint.h>

enum { FLASH_NRF51_PAGE = 1024 }; /* bytes, which are erased at once */

extern const uint8_t kept_start[], kept_end[]; /* of the region; in the linker script */

bool flash_nrf51_erase(uint32_t address);                        /* the page that begins here */
bool flash_nrf51_write(uint32_t address, const uint8_t *bytes);  /* DAC_STORE_LINE bytes, at a multiple of 4 */
bool flash_nrf51_read(uint32_t address, uint8_t *bytes, uint32_t count);

#endif
