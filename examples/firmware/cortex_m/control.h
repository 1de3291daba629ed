/* What the firmware is told over its UART: control_link.c takes frames (docs/protocol.md), control_console.c text. */
#ifndef CONTROL_H
#define CONTROL_H

#include <stdbool.h>
#include <stdint.h>

bool control_start(void);           /* before anything else runs: the scan of the build waits to be taken */
void control_ready(bool good);      /* it plays, or was refused */
void control_received(uint8_t byte); /* from the interrupt of the UART */
void control_work(void);            /* from the main loop */

#endif
