/* The registers that this firmware uses, under the names of ST's reference manual RM0433 (STM32H742, 743, 750, 753).
 * Compared with ST's stm32h743xx.h: the places of RCC, EXTI, SYSCFG and GPIO, and the bits of TIM1_BDTR; with public
 * drivers: the numbers of DMA requests, and the bits of SPI. The manual itself was not at hand: compare the rest. */
#ifndef STM32H7_H
#define STM32H7_H

#include "cortex_m7.h"

/* Power control, embedded flash interface, reset and clock control */
#define PWR_CSR1 REGISTER(0x58024804)
#define PWR_CR3 REGISTER(0x5802480C)
#define PWR_D3CR REGISTER(0x58024818)
#define FLASH_ACR REGISTER(0x52002000)
#define RCC_CR REGISTER(0x58024400)
#define RCC_CFGR REGISTER(0x58024410)
#define RCC_D1CFGR REGISTER(0x58024418)
#define RCC_D2CFGR REGISTER(0x5802441C)
#define RCC_D3CFGR REGISTER(0x58024420)
#define RCC_PLLCKSELR REGISTER(0x58024428)
#define RCC_PLLCFGR REGISTER(0x5802442C)
#define RCC_PLL1DIVR REGISTER(0x58024430)
#define RCC_AHB1ENR REGISTER(0x580244D8)
#define RCC_AHB4ENR REGISTER(0x580244E0)
#define RCC_APB1LENR REGISTER(0x580244E8)
#define RCC_APB2ENR REGISTER(0x580244F0)
#define RCC_APB4ENR REGISTER(0x580244F4)
/* General-purpose I/O: ports A to K are 0 to 10 */
#define GPIO_MODER(port) REGISTER(0x58020000 + 0x400 * (port))
#define GPIO_OSPEEDR(port) REGISTER(0x58020008 + 0x400 * (port))
#define GPIO_AFR(port, pin) REGISTER(0x58020020 + 0x400 * (port) + 4 * ((pin) / 8))
enum { PORT_A, PORT_B, PORT_D = 3, PORT_E };
/* System configuration, extended interrupts: lines 4 to 7, and the processor's mask and pending register */
#define SYSCFG_EXTICR2 REGISTER(0x5800040C)
#define EXTI_RTSR1 REGISTER(0x58000000)
#define EXTI_CPUIMR1 REGISTER(0x58000080)
#define EXTI_CPUPR1 REGISTER(0x58000088)
/* Advanced-control timer 1 */
#define TIM1_CR1 REGISTER(0x40010000)
#define TIM1_DIER REGISTER(0x4001000C)
#define TIM1_SR REGISTER(0x40010010)
#define TIM1_EGR REGISTER(0x40010014)
#define TIM1_CCMR1 REGISTER(0x40010018)
#define TIM1_CCMR2 REGISTER(0x4001001C)
#define TIM1_CCER REGISTER(0x40010020)
#define TIM1_CNT REGISTER(0x40010024)
#define TIM1_ARR REGISTER(0x4001002C)
#define TIM1_CCR1 REGISTER(0x40010034)
#define TIM1_CCR2 REGISTER(0x40010038)
#define TIM1_CCR3_ADDRESS UINT32_C(0x4001003C)
#define TIM1_CCR4 REGISTER(0x40010040)
#define TIM1_BDTR REGISTER(0x40010044)
/* Serial peripheral interfaces 1 and 2 */
enum { SPI1 = 0x40013000, SPI2 = 0x40003800 };
#define SPI_CR1(unit) REGISTER(unit)
#define SPI_CFG1(unit) REGISTER((unit) + 0x08)
#define SPI_CFG2(unit) REGISTER((unit) + 0x0C)
#define SPI_TXDR_ADDRESS(unit) ((uint32_t)(unit) + 0x20)
/* DMA controller 1 and its request multiplexer: stream n has channel n */
#define DMA1_LISR REGISTER(0x40020000)
#define DMA1_LIFCR REGISTER(0x40020008)
#define DMA1_CR(stream) REGISTER(0x40020010 + 0x18 * (stream))
#define DMA1_NDTR(stream) REGISTER(0x40020014 + 0x18 * (stream))
#define DMA1_PAR(stream) REGISTER(0x40020018 + 0x18 * (stream))
#define DMA1_M0AR(stream) REGISTER(0x4002001C + 0x18 * (stream))
#define DMAMUX1_CCR(stream) REGISTER(0x40020800 + 4 * (stream))
enum { REQUEST_TIM1_CH1 = 11, REQUEST_TIM1_CH4 = 14, REQUEST_TIM1_UP = 15, REQUEST_USART3_RX = 45 };
/* Universal synchronous asynchronous receiver transmitter 3 */
#define USART3_CR1 REGISTER(0x40004800)
#define USART3_CR3 REGISTER(0x40004808)
#define USART3_BRR REGISTER(0x4000480C)
#define USART3_ISR REGISTER(0x4000481C)
#define USART3_ICR REGISTER(0x40004820)
#define USART3_RDR_ADDRESS UINT32_C(0x40004824)
#define USART3_TDR REGISTER(0x40004828)
enum { USART_IDLE = 1 << 4, USART_TRANSMIT_EMPTY = 1 << 7 };
enum { DMA1_STREAM2 = 13, DMA1_STREAM3 = 14, EXTI9_5 = 23, USART3 = 39 }; /* interrupts (vector table) */

#endif
