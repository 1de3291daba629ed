/* The link of this firmware: memory for two programs, limits, a key. */
#ifndef SCAN_LINK_H
#define SCAN_LINK_H

#include "dac_link.h"

const dac_link_config *scan_link(void);
#if DAC_LINK_Z
const dac_link_config *scan_link_of_z(void);
#endif

#if DAC_LIBRARY
bool board_pressed(void); /* in the port: whether the button has been pressed since the last call */
#endif

#if DAC_STORE
extern dac_store scan_store;
extern const dac_store_flash scan_flash; /* in the port */
#endif

#endif
