/* STM32F4: a timer triggers both channels of the converter, DMA feeds them from two half buffers, and an interrupt per
 * half fills the one that was just sent. The timing of samples does not depend on the processor. Not tested on
 * hardware. */
#include "dac_sequencer.h"
#include SCAN_HEADER
#include "stm32f4.h"

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define CONSTANT(suffix) JOIN(SCAN_UPPER, suffix)
#define PROGRAM(NAME, name) DAC_PROGRAM(NAME, name)
#define CONVERTER(AXIS) DAC_CONVERTER(AXIS, 0)

#if DAC_STRIDE != 2 || DAC_OUTPUT_STORAGE_BITS != 16
#error "the converter takes x and y as halves of a word"
#endif

enum { HALF = 256, TIMER_HZ = 84000000 };

typedef char twelve_bits_right_aligned[CONSTANT(_X_DAC_BITS) == 12 && CONSTANT(_Y_DAC_BITS) == 12
                                       && CONSTANT(_X_DAC_TWOS_COMPLEMENT) == 0 && CONSTANT(_Y_DAC_TWOS_COMPLEMENT) == 0
                                       && CONSTANT(_X_DAC_LEFT_ALIGNED) == 0 && CONSTANT(_Y_DAC_LEFT_ALIGNED) == 0
                                           ? 1 : -1];

static const dac_program scan = PROGRAM(SCAN_UPPER, SCAN);
static const dac_converter x_converter = CONVERTER(CONSTANT(_X)), y_converter = CONVERTER(CONSTANT(_Y));
static dac_sequencer sequencer;
static union {
    dac_output codes[4 * HALF]; /* x, y, x, y.. */
    uint32_t words[2 * HALF];   /* the same for DMA: aligned words, x in the lower half */
} buffer;

void dma_interrupt(void);
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
    RCC_AHB1ENR |= 1u << 21 | 1u; /* DMA1, port A */
    RCC_APB1ENR |= 1u << 29 | 1u << 4; /* DAC, TIM6 */
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

int main(void)
{
    start_clocks();
    dac_sequencer_init(&sequencer, &x_converter, &y_converter);
    if (dac_sequencer_load(&sequencer, &scan) != DAC_LOADED)
        for (;;)
            ;
    (void)dac_sequencer_commit(&sequencer);
    (void)dac_sequencer_arm(&sequencer, 0);
    fill(0); /* takes the program; the outputs begin to ramp to its park codes */
    (void)dac_sequencer_trigger(&sequencer);
    fill(1);
    start_converters();
    for (;;)
        ; /* the main loop is the producer: commands, loads, commits */
}
