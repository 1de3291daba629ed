/* The registers that this firmware uses, from Raspberry Pi's RP2040 datasheet: addresses from section 2.2 (address
 * map), offsets and bits from the lists of registers of SIO (2.3.1.7), clocks (2.15.7), XOSC (2.16.7), PLL (2.18.4),
 * resets (2.14.3), GPIO (2.19.6) and PIO (3.7). */
#ifndef RP2040_H
#define RP2040_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))

#define RESETS_RESET REGISTER(0x4000C000)
#define RESETS_RESET_DONE REGISTER(0x4000C008)
enum { RESET_IO_BANK0 = 1 << 5, RESET_PADS_BANK0 = 1 << 8, RESET_PIO0 = 1 << 10, RESET_PLL_SYS = 1 << 12 };

#define CLK_REF_CTRL REGISTER(0x40008030)
#define CLK_REF_SELECTED REGISTER(0x40008038)
#define CLK_SYS_CTRL REGISTER(0x4000803C)
#define CLK_SYS_SELECTED REGISTER(0x40008044)
#define XOSC_CTRL REGISTER(0x40024000)
#define XOSC_STATUS REGISTER(0x40024004)
#define XOSC_STARTUP REGISTER(0x4002400C)
#define PLL_SYS_CS REGISTER(0x40028000)
#define PLL_SYS_PWR REGISTER(0x40028004)
#define PLL_SYS_FBDIV_INT REGISTER(0x40028008)
#define PLL_SYS_PRIM REGISTER(0x4002800C)

#define GPIO_CTRL(pin) REGISTER(0x40014004 + 8 * (pin))
enum { FUNCTION_PIO0 = 6 };

#define PIO0_CTRL REGISTER(0x50200000)
#define PIO0_FSTAT REGISTER(0x50200004)
#define PIO0_FDEBUG REGISTER(0x50200008)
#define PIO0_TXF(machine) REGISTER(0x50200010 + 4 * (machine))
#define PIO0_INSTR_MEM(at) REGISTER(0x50200048 + 4 * (at))
#define PIO0_CLKDIV(machine) REGISTER(0x502000C8 + 0x18 * (machine))
#define PIO0_EXECCTRL(machine) REGISTER(0x502000CC + 0x18 * (machine))
#define PIO0_SHIFTCTRL(machine) REGISTER(0x502000D0 + 0x18 * (machine))
#define PIO0_INSTR(machine) REGISTER(0x502000D8 + 0x18 * (machine))
#define PIO0_PINCTRL(machine) REGISTER(0x502000DC + 0x18 * (machine))

#define SIO_FIFO_ST REGISTER(0xD0000050)
#define SIO_FIFO_WR REGISTER(0xD0000054)
#define SIO_FIFO_RD REGISTER(0xD0000058)
enum { FIFO_VALID = 1, FIFO_READY = 2 };

#define VTOR REGISTER(0xE000ED08)

#endif
