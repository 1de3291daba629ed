/* Commands over the UART: control_link.c receives frames (docs/protocol.md), in cortex_m control_console.c lines of
 * text. */
#ifndef CONTROL_H
#define CONTROL_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

bool control_start(void);           /* called first: commits the scan of the build */
void control_ready(bool good);      /* called when the scan is active (good) or was refused */
void control_received(uint8_t byte); /* called by the interrupt of the UART; not by two that interrupt each other */
void control_work(void);            /* called by the main loop */

#ifdef __cplusplus
}
#endif

#endif
