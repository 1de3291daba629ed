/* The registers that this firmware uses, from ST's reference manual RM0090 (STM32F405, 407, 415, 417..): addresses from
 * the memory map (table 1), bits from the register chapters named below. */
#ifndef STM32F4_H
#define STM32F4_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))

/* Embedded flash interface */
#define FLASH_ACR REGISTER(0x40023C00)
/* Reset and clock control */
#define RCC_CR REGISTER(0x40023800)
#define RCC_PLLCFGR REGISTER(0x40023804)
#define RCC_CFGR REGISTER(0x40023808)
#define RCC_AHB1ENR REGISTER(0x40023830)
#define RCC_APB1ENR REGISTER(0x40023840)
/* General-purpose I/O */
#define GPIOA_MODER REGISTER(0x40020000)
#define GPIOB_MODER REGISTER(0x40020400)
#define GPIOB_AFRH REGISTER(0x40020424)
/* Basic timer */
#define TIM6_CR1 REGISTER(0x40001000)
#define TIM6_CR2 REGISTER(0x40001004)
#define TIM6_ARR REGISTER(0x4000102C)
/* Digital-to-analogue converter */
#define DAC_CR REGISTER(0x40007400)
#define DAC_DHR12RD_ADDRESS UINT32_C(0x40007420) /* both channels: 1 in bits 11..0, 2 in bits 27..16 */
#define DAC_SR REGISTER(0x40007434)
/* Universal synchronous asynchronous receiver transmitter 3: PB10 sends, PB11 receives */
#define USART3_SR REGISTER(0x40004800)
#define USART3_DR REGISTER(0x40004804)
#define USART3_DR_ADDRESS UINT32_C(0x40004804)
#define USART3_BRR REGISTER(0x40004808)
#define USART3_CR1 REGISTER(0x4000480C)
#define USART3_CR3 REGISTER(0x40004814)
enum { USART_IDLE = 1 << 4, USART_TRANSMIT_EMPTY = 1 << 7 };
/* DMA controller 1, stream 1; channel 4 of it is the receiver of USART 3 */
#define DMA1_LISR REGISTER(0x40026000)
#define DMA1_LIFCR REGISTER(0x40026008)
#define DMA1_S1CR REGISTER(0x40026028)
#define DMA1_S1NDTR REGISTER(0x4002602C)
#define DMA1_S1PAR REGISTER(0x40026030)
#define DMA1_S1M0AR REGISTER(0x40026034)
enum { STREAM1_FLAGS = 0x3d << 6 };
/* DMA controller 1, stream 5; channel 7 of it is DAC channel 1 (table of DMA1's request mapping) */
#define DMA1_HISR REGISTER(0x40026004)
#define DMA1_HIFCR REGISTER(0x4002600C)
#define DMA1_S5CR REGISTER(0x40026088)
#define DMA1_S5NDTR REGISTER(0x4002608C)
#define DMA1_S5PAR REGISTER(0x40026090)
#define DMA1_S5M0AR REGISTER(0x40026094)
enum { DMA1_STREAM1 = 12, DMA1_STREAM5 = 16, USART3 = 39 }; /* interrupts (vector table) */
enum { HALF_TRANSFER = 1 << 10, TRANSFER_COMPLETE = 1 << 11, STREAM5_FLAGS = 0x3d << 6 };
/* Cortex-M4: Arm's generic user guide, DUI 0553 */
#define NVIC_ISER0 REGISTER(0xE000E100)
#define NVIC_ISER1 REGISTER(0xE000E104)
#define NVIC_IPR(interrupt) (*(volatile uint8_t *)(uintptr_t)(0xE000E400 + (interrupt)))

#endif
