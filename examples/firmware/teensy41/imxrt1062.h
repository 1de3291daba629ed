/* The registers that this firmware uses, under the names of NXP's reference manual IMXRT1060RM (i.MX RT1062).
 * Compared with imxrt.h, clockspeed.c, pwm.c and bootdata.c of Teensyduino's core: bases of LPSPI, FlexPWM and LPUART,
 * clock gates, dividers and PLL 2, numbers of DMA requests, the image in flash, pin 4; with NXP's headers of this
 * family: registers of FlexPWM, bits of LPSPI, its clock, interrupts; with public drivers: which pads these are, bits
 * of LPUART and of eDMA's minor loops, requests of FlexPWM. The manual was not at hand: compare the rest. */
#ifndef IMXRT1062_H
#define IMXRT1062_H

#include "cortex_m7.h"

#define REGISTER16(address) (*(volatile uint16_t *)(uintptr_t)(address))
#define REGISTER8(address) (*(volatile uint8_t *)(uintptr_t)(address))

/* Clock controller module, and its analog part: PLL 2, with addresses that set and clear bits */
#define CCM_CBCDR REGISTER(0x400FC014)
#define CCM_CBCMR REGISTER(0x400FC018)
#define CCM_CSCDR1 REGISTER(0x400FC024)
#define CCM_CDHIPR REGISTER(0x400FC048)
#define CCM_CCGR1 REGISTER(0x400FC06C)
#define CCM_CCGR3 REGISTER(0x400FC074)
#define CCM_CCGR4 REGISTER(0x400FC078)
#define CCM_CCGR5 REGISTER(0x400FC07C)
#define CCM_ANALOG_PLL_SYS REGISTER(0x400D8030)
#define CCM_ANALOG_PLL_SYS_SET REGISTER(0x400D8034)
#define CCM_ANALOG_PLL_SYS_CLR REGISTER(0x400D8038)
/* Pins: the function of a pad, and which pad is an input */
#define IOMUXC_MUX(pad) REGISTER(0x401F8000 + (pad))
#define IOMUXC_LPUART6_RX_SELECT_INPUT REGISTER(0x401F8550)
enum {
    EMC_06 = 0x2C, AD_B0_02 = 0xC4, AD_B0_03 = 0xC8, AD_B1_12 = 0x12C, AD_B1_14 = 0x134, AD_B1_15 = 0x138,
    B0_00 = 0x13C, B0_02 = 0x144, B0_03 = 0x148
};
/* Low-power serial peripheral interfaces 3 and 4 */
enum { LPSPI3 = 0x4039C000, LPSPI4 = 0x403A0000 };
#define LPSPI_CR(unit) REGISTER((unit) + 0x10)
#define LPSPI_CFGR1(unit) REGISTER((unit) + 0x24)
#define LPSPI_CCR(unit) REGISTER((unit) + 0x40)
#define LPSPI_TCR(unit) REGISTER((unit) + 0x60)
#define LPSPI_TDR_ADDRESS(unit) ((uint32_t)(unit) + 0x64)
/* Enhanced flex pulse width modulator 2, submodule 0 */
#define PWM2_SM0INIT REGISTER16(0x403E0002)
#define PWM2_SM0CTRL2 REGISTER16(0x403E0004)
#define PWM2_SM0CTRL REGISTER16(0x403E0006)
#define PWM2_SM0VAL0 REGISTER16(0x403E000A)
#define PWM2_SM0VAL1 REGISTER16(0x403E000E)
#define PWM2_SM0VAL2 REGISTER16(0x403E0012)
#define PWM2_SM0VAL3 REGISTER16(0x403E0016)
#define PWM2_SM0DMAEN REGISTER16(0x403E0028)
#define PWM2_SM0DISMAP0 REGISTER16(0x403E002C)
#define PWM2_OUTEN REGISTER16(0x403E0180)
#define PWM2_MCTRL REGISTER16(0x403E0188)
/* Enhanced direct memory access: a channel has a transfer control descriptor (TCD) */
#define DMA_CR REGISTER(0x400E8000)
#define DMA_SERQ REGISTER8(0x400E801B)
#define DMA_CINT REGISTER8(0x400E801F)
#define TCD_SADDR(channel) REGISTER(0x400E9000 + 0x20 * (channel))
#define TCD_SOFF(channel) REGISTER16(0x400E9004 + 0x20 * (channel))
#define TCD_ATTR(channel) REGISTER16(0x400E9006 + 0x20 * (channel))
#define TCD_NBYTES(channel) REGISTER(0x400E9008 + 0x20 * (channel))
#define TCD_SLAST(channel) REGISTER(0x400E900C + 0x20 * (channel))
#define TCD_DADDR(channel) REGISTER(0x400E9010 + 0x20 * (channel))
#define TCD_DOFF(channel) REGISTER16(0x400E9014 + 0x20 * (channel))
#define TCD_CITER(channel) REGISTER16(0x400E9016 + 0x20 * (channel))
#define TCD_DLAST(channel) REGISTER(0x400E9018 + 0x20 * (channel))
#define TCD_CSR(channel) REGISTER16(0x400E901C + 0x20 * (channel))
#define TCD_BITER(channel) REGISTER16(0x400E901E + 0x20 * (channel))
#define DMAMUX_CHCFG(channel) REGISTER(0x400EC000 + 4 * (channel))
enum { REQUEST_LPUART6_RX = 71, REQUEST_FLEXPWM2_WRITE0 = 100 };
/* Low-power universal asynchronous receiver transmitter 6 */
#define LPUART6_BAUD REGISTER(0x40198010)
#define LPUART6_STAT REGISTER(0x40198014)
#define LPUART6_CTRL REGISTER(0x40198018)
#define LPUART6_DATA REGISTER(0x4019801C)
#define LPUART6_DATA_ADDRESS UINT32_C(0x4019801C)
enum { LPUART_OVERRUN = 1 << 19, LPUART_IDLE = 1 << 20, LPUART_TRANSMIT_EMPTY = 1 << 23 };
enum { DMA_CHANNEL0, DMA_CHANNEL1, LPUART6 = 25 }; /* interrupts (vector table) */

#endif
