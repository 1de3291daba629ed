/* STM32F4: a timer triggers both channels of the converter, DMA feeds them from two half buffers, and an interrupt per
 * half fills the one that was just sent. The timing of samples does not depend on the processor. The link receives by
 * DMA too. Not tested on hardware. */
#include "control.h"
#include "names.h"
#include "scan.h"
#include "stm32f4.h"
#include "uart.h"
#include SCAN_HEADER

#if DAC_STRIDE != 2 || DAC_OUTPUT_STORAGE_BITS != 16
#error "the converter takes x and y as halves of a word"
#endif

enum { HALF = 256, TIMER_HZ = 84000000, UART_HZ = 42000000 };
enum { RECEIVED = 256 };    /* bytes: at half of them, and when the line rests, they go to the link */
enum { LOWER = 0x80 };      /* priority of the link's interrupts, which must not interrupt each other */

typedef char twelve_bits_right_aligned[CONSTANT(_X_DAC_BITS) == 12 && CONSTANT(_Y_DAC_BITS) == 12
                                       && CONSTANT(_X_DAC_TWOS_COMPLEMENT) == 0 && CONSTANT(_Y_DAC_TWOS_COMPLEMENT) == 0
                                       && CONSTANT(_X_DAC_LEFT_ALIGNED) == 0 && CONSTANT(_Y_DAC_LEFT_ALIGNED) == 0
                                           ? 1 : -1];

dac_sequencer sequencer;
static union {
    dac_output codes[4 * HALF]; /* x, y, x, y.. */
    uint32_t words[2 * HALF];   /* the same for DMA: aligned words, x in the lower half */
} buffer;
/* In RAM that DMA reaches (not CCM), and behind no cache. With a cache, as in STM32F7 and H7, put it and the buffer
 * above where the MPU says that nothing is cached. */
static volatile uint8_t received[RECEIVED];

void dma_interrupt(void);
void receive_interrupt(void);
void idle_interrupt(void);
int main(void);

/* 168 MHz from a crystal of 8 MHz; the timer's bus runs at half of that. */
static void start_clocks(void)
{
    FLASH_ACR = 7u << 8 | 5u; /* caches, prefetch, 5 wait states */
    RCC_CR |= 1u << 16;
    while ((RCC_CR & 1u << 17) == 0)
        ;
    RCC_PLLCFGR = 7u << 24 | 1u << 22 | 0u << 16 | 336u << 6 | 8u; /* 8 MHz / 8 * 336 / 2 */
    RCC_CFGR = 4u << 13 | 5u << 10;                                /* APB2 by 2, APB1 by 4 */
    RCC_CR |= 1u << 24;
    while ((RCC_CR & 1u << 25) == 0)
        ;
    RCC_CFGR |= 2;
    while ((RCC_CFGR & 12) != 8)
        ;
    RCC_AHB1ENR |= 1u << 21 | 1u << 1 | 1u; /* DMA1, ports B and A */
    RCC_APB1ENR |= 1u << 29 | 1u << 18 | 1u << 4; /* DAC, USART3, TIM6 */
    (void)RCC_APB1ENR;
}

static void fill(unsigned half)
{
    dac_output *const codes = buffer.codes + half * 2 * HALF;
    dac_sequencer_fill(&sequencer, codes, codes + 1, NULL, HALF);
}

static void start_converters(void)
{
    GPIOA_MODER |= 15u << 8;                     /* PA4, PA5: analogue */
    DMA1_S5PAR = DAC_DHR12RD_ADDRESS;
    DMA1_S5M0AR = (uint32_t)(uintptr_t)buffer.words;
    DMA1_S5NDTR = 2 * HALF;
    DMA1_HIFCR = STREAM5_FLAGS;
    /* Channel 7, high priority, words, memory counts up, circular, to the peripheral, interrupts, on. */
    DMA1_S5CR = 7u << 25 | 2u << 16 | 2u << 13 | 2u << 11 | 1u << 10 | 1u << 8 | 1u << 6 | 1u << 4 | 1u << 3 | 1u;
    NVIC_ISER0 = UINT32_C(1) << DMA1_STREAM5;
    /* TIM6 triggers both channels; channel 1 requests DMA, and one word serves both. */
    DAC_CR = 1u << 18 | 1u << 16 | 1u << 12 | 1u << 2 | 1u;
    TIM6_ARR = TIMER_HZ / UPDATE_RATE_HZ - 1;
    TIM6_CR2 = 2u << 4; /* its update is the trigger */
    TIM6_CR1 = 1;
}

void dma_interrupt(void)
{
    const uint32_t flags = DMA1_HISR & (HALF_TRANSFER | TRANSFER_COMPLETE);

    DMA1_HIFCR = flags; /* clear first: a later event sets it again */
    if (flags == (HALF_TRANSFER | TRANSFER_COMPLETE) || (DAC_SR & 1u << 13) != 0) {
        dac_sequencer_report(&sequencer, DAC_FAULT_UNDERRUN); /* a half was sent twice, or not in time */
        DAC_SR = 1u << 13;
    }
    if ((flags & HALF_TRANSFER) != 0)
        fill(0);
    if ((flags & TRANSFER_COMPLETE) != 0)
        fill(1);
}

static void start_uart(void)
{
    GPIOB_AFRH |= 7u << 12 | 7u << 8;   /* PB10, PB11: USART3 */
    GPIOB_MODER |= 2u << 22 | 2u << 20;
    USART3_BRR = (UART_HZ + BAUD / 2) / BAUD;
    DMA1_S1PAR = USART3_DR_ADDRESS;
    DMA1_S1M0AR = (uint32_t)(uintptr_t)received;
    DMA1_S1NDTR = RECEIVED;
    DMA1_LIFCR = STREAM1_FLAGS;
    /* Channel 4, medium priority, bytes, memory counts up, circular, to memory, interrupts at half and end, on. */
    DMA1_S1CR = 4u << 25 | 1u << 16 | 1u << 10 | 1u << 8 | 1u << 4 | 1u << 3 | 1u;
    USART3_CR3 = 1u << 6;                                /* received bytes by DMA */
    USART3_CR1 = 1u << 13 | 1u << 4 | 1u << 3 | 1u << 2; /* on, interrupt of an idle line, both ways */
    NVIC_IPR(DMA1_STREAM1) = LOWER;
    NVIC_IPR(USART3) = LOWER;
    NVIC_ISER0 = UINT32_C(1) << DMA1_STREAM1;
    NVIC_ISER1 = UINT32_C(1) << (USART3 - 32);
}

/* Gives the link what DMA has written since the last time. */
static void take_received(void)
{
    static unsigned taken;
    const unsigned written = (RECEIVED - DMA1_S1NDTR) % RECEIVED;

    while (taken != written) {
        control_received(received[taken]);
        taken = (taken + 1) % RECEIVED;
    }
}

void receive_interrupt(void)
{
    DMA1_LIFCR = DMA1_LISR & (HALF_TRANSFER | TRANSFER_COMPLETE); /* clear first: a later byte sets it again */
    take_received();
}

void idle_interrupt(void)
{
    /* Reading SR and then DR clears the flag. DMA has taken what was in DR before the pause. Should a byte come just
     * now, and this read be quicker than DMA, that byte is lost: the frame fails its CRC, and the host sends it again.
     */
    if ((USART3_SR & USART_IDLE) != 0)
        (void)USART3_DR;
    take_received();
}

bool board_can_put(void)
{
    return (USART3_SR & USART_TRANSMIT_EMPTY) != 0;
}

void board_putc(char c)
{
    USART3_DR = (unsigned char)c;
}

int main(void)
{
    start_clocks();
    const bool good = dac_sequencer_init(&sequencer, &scan_x_converter, &scan_y_converter) && control_start();
    fill(0); /* takes the program; the outputs begin to ramp to its park codes */
    fill(1);
    start_converters();
    start_uart();
    control_ready(good);
    for (;;)
        control_work();
}
