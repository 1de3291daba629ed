/* The registers of soft_core.v beside those of the sequencer. */
#ifndef SOFT_CORE_H
#define SOFT_CORE_H

#include <stdbool.h>
#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))
#define SEQUENCER(offset) REGISTER(0x80000000u + (offset)) /* dac_registers.h has the offsets */
#define OF_Z 0x10000000u    /* behind an offset: of the sequencer of z */
#define OF_BOTH 0x20000000u /* written: to both sequencers on one clock */

#define SYSTEM_BYTE REGISTER(0xC0000000)  /* written: sent; read: the oldest received byte, which it takes */
#define BYTE_RECEIVED 0x100u              /* in what was read: there was one */
#define SYSTEM_STATE REGISTER(0xC0000004)
#define STATE_CAN_SEND 1u
#define STATE_PERMIT 2u
#define SYSTEM_LINE REGISTER(0xC0000008)  /* line of the frame; 0 while no scan plays */
#define SYSTEM_SWAPS REGISTER(0xC000000C) /* programs taken since power-up */
#define SYSTEM_Z_LINE REGISTER(0xC0000010)
#define SYSTEM_Z_SWAPS REGISTER(0xC0000014)

void requests_to_both(bool begin); /* with DAC_LINK_Z */

#endif
