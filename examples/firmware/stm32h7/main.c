/* STM32H7: two SPI converters with frames of 24 bits, such as AD5791. One timer is the clock of everything: it makes
 * SYNC and LDAC and the pixel clock as compare outputs, and requests DMA, which feeds two SPI units and the compare
 * value of the pixel clock from two half buffers. An interrupt per half fills the one that was just sent, and cleans
 * the data cache there. The timing of samples does not depend on the processor. The link receives by DMA too. Not
 * tested on hardware. */
#include "control.h"
#include "names.h"
#include "scan.h"
#include "stm32h7.h"
#include "uart.h"
#include CONVERTER_HEADER
#include SCAN_HEADER

#if DAC_STRIDE != 2
#error "codes of x and y stand in turn"
#endif

enum { HALF = 128, TIMER_HZ = 200000000, UART_HZ = 100000000, SPI_COUNTS = 8 }; /* of the timer, for a bit */
enum { PERIOD = TIMER_HZ / UPDATE_RATE_HZ };
enum { FRAME_BITS = JOIN(SPI_CONVERTER, _frame_bits) };
enum { Y_COUNT = 4, SETTLE = 88, LDAC_WAIT = 20, LDAC_WIDTH = 40 }; /* counts: see start_timer() */
enum { RECEIVED = 256 }; /* bytes: at half of them, and when the line rests, they go to the link */
enum { X_STREAM, Y_STREAM, PIXEL_STREAM, RECEIVE_STREAM };
enum { LOWER = 0x80 };   /* priority of interrupts that must not interrupt each other */

typedef char a_tick_has_room[PERIOD >= FRAME_BITS * SPI_COUNTS + SETTLE + LDAC_WAIT + LDAC_WIDTH ? 1 : -1];
typedef char a_frame_is_no_half_word[FRAME_BITS > 16 ? 1 : -1];
typedef char the_scan_has_words_of_the_converter[DAC_SPI_FITS(SPI_CONVERTER, CONSTANT(_X))
                                                 && DAC_SPI_FITS(SPI_CONVERTER, CONSTANT(_Y)) ? 1 : -1];
typedef char the_counter_has_room[PERIOD < 65536 ? 1 : -1];
typedef char halves_are_whole_lines[HALF * 4 % CACHE_LINE == 0 && RECEIVED % CACHE_LINE == 0 ? 1 : -1];

dac_sequencer sequencer;

/* Memory that DMA reaches (AXI SRAM, not DTCM), behind the data cache. What DMA reads is cleaned after it is written;
 * what DMA has written is invalidated before it is read, and shares no line of the cache with anything else. */
static struct {
    uint32_t x[2 * HALF], y[2 * HALF], pixels[2 * HALF];
} play __attribute__((aligned(CACHE_LINE)));
static volatile uint8_t received[RECEIVED] __attribute__((aligned(CACHE_LINE)));
static volatile bool edge; /* on the trigger's pin */

void dma_interrupt(void);
void receive_interrupt(void);
void idle_interrupt(void);
void trigger_interrupt(void);
int main(void);

/* 400 MHz from a clock of 8 MHz (bypass: from the debugger of a Nucleo board); buses at 200 MHz and 100 MHz, the timer
 * at 200 MHz, SPI at 100 MHz. */
static void start_clocks(void)
{
    PWR_CR3 = (PWR_CR3 & ~UINT32_C(7)) | 2; /* the regulator supplies the core */
    while ((PWR_CSR1 & 1u << 13) == 0)
        ;
    PWR_D3CR = 3u << 14; /* VOS1, for 400 MHz */
    while ((PWR_D3CR & 1u << 13) == 0)
        ;
    RCC_CR |= 1u << 18 | 1u << 16;
    while ((RCC_CR & 1u << 17) == 0)
        ;
    FLASH_ACR = 2u << 4 | 2u;
    RCC_PLLCKSELR = 1u << 4 | 2u;
    RCC_PLLCFGR = 1u << 17 | 1u << 16 | 3u << 2;                    /* outputs P and Q; input of 8 to 16 MHz */
    RCC_PLL1DIVR = (8u - 1) << 16 | (2u - 1) << 9 | (100u - 1);     /* 8 MHz * 100 / 2, and / 8 */
    RCC_CR |= 1u << 24;
    while ((RCC_CR & 1u << 25) == 0)
        ;
    RCC_D1CFGR = 4u << 4 | 8u;
    RCC_D2CFGR = 4u << 8 | 4u << 4;
    RCC_D3CFGR = 4u << 4;
    RCC_CFGR = 3;
    while ((RCC_CFGR & 7u << 3) != 3u << 3)
        ;
    RCC_AHB1ENR |= 1u;                               /* DMA1 */
    RCC_AHB4ENR |= 1u << 4 | 1u << 3 | 1u << 1 | 1u; /* ports E, D, B, A */
    RCC_APB1LENR |= 1u << 18 | 1u << 14;             /* USART3, SPI2 */
    RCC_APB2ENR |= 1u << 12 | 1u;                    /* SPI1, TIM1 */
    RCC_APB4ENR |= 1u << 1;                          /* SYSCFG */
    (void)RCC_APB4ENR;
}

static void start_pin(unsigned port, unsigned pin, uint32_t function)
{
    GPIO_AFR(port, pin) = (GPIO_AFR(port, pin) & ~(UINT32_C(15) << pin % 8 * 4)) | function << pin % 8 * 4;
    GPIO_OSPEEDR(port) |= UINT32_C(2) << pin * 2;
    GPIO_MODER(port) = (GPIO_MODER(port) & ~(UINT32_C(3) << pin * 2)) | UINT32_C(2) << pin * 2;
}

/* Computes ticks of both axes, into the buffers from `at` on. */
static void fill(unsigned at, unsigned ticks)
{
    static dac_output codes[2 * HALF];
    static uint8_t markers[HALF];

    dac_sequencer_fill(&sequencer, codes, codes + 1, markers, ticks);
    dac_spi_frames32(&SPI_CONVERTER, 0, codes, ticks, play.x + at);
    dac_spi_frames32(&SPI_CONVERTER, 0, codes + 1, ticks, play.y + at);
    for (unsigned i = 0; i < ticks; i++)
        play.pixels[at + i] = (markers[i] & DAC_PIXEL) != 0 ? PERIOD / 2 : 0;
}

static void clean_half(unsigned half)
{
    clean(play.x + half * HALF, HALF * 4);
    clean(play.y + half * HALF, HALF * 4);
    clean(play.pixels + half * HALF, HALF * 4);
}

/* The first half: a tick, the set-up of both converters, the same tick again, then what follows. */
static void fill_first(void)
{
    unsigned at = 1;

    fill(0, 1); /* takes the program; the outputs begin to ramp to its park codes */
    for (unsigned i = 0; i < SPI_CONVERTER.setups; i++, at++)
        play.x[at] = play.y[at] = SPI_CONVERTER.setup[i];
    play.x[at] = play.x[0];
    play.y[at++] = play.y[0];
    fill(at, HALF - at);
    clean_half(0);
    fill(HALF, HALF);
    clean_half(1);
}

static void start_stream(unsigned stream, uint32_t request, uint32_t peripheral, const volatile void *memory,
                         uint32_t items, uint32_t control)
{
    DMAMUX1_CCR(stream) = request;
    DMA1_PAR(stream) = peripheral;
    DMA1_M0AR(stream) = (uint32_t)(uintptr_t)memory;
    DMA1_NDTR(stream) = items;
    DMA1_CR(stream) = control | 1u << 10 | 1u << 8 | 1u; /* memory counts up, circular, on */
}

static void start_spi(uint32_t unit)
{
    SPI_CFG1(unit) = 1u << 28 | (FRAME_BITS - 1u); /* 100 MHz / 4 */
    /* Keeps its pins, no SS, mode of the converter, master, only transmits. */
    SPI_CFG2(unit) = UINT32_C(1) << 31 | 1u << 26 | (uint32_t)SPI_CONVERTER.mode << 24 | 1u << 22 | 1u << 17;
    SPI_CR1(unit) = 1u << 12;                   /* SSI: no other master */
    SPI_CR1(unit) = 1u << 12 | 1u;
    SPI_CR1(unit) = 1u << 12 | 1u << 9 | 1u;    /* starts a transfer without an end: a frame for each word */
}

/* A tick, in counts of the timer from its update:
 *
 *     0            SYNC falls, DMA writes the frame of x into SPI1; the pixel clock rises if a pixel has begun
 *     Y_COUNT      DMA writes the frame of y into SPI2
 *     frame        SYNC rises; DMA writes the compare value of the pixel clock, which the next update takes, and asks
 *                  for the interrupt at the end of a half: x and y of the half have been read before
 *     + LDAC_WAIT  LDAC falls, both outputs change; it rises at the update */
static void start_timer(void)
{
    const uint32_t frame = FRAME_BITS * SPI_COUNTS + SETTLE;

    TIM1_ARR = PERIOD - 1;
    TIM1_CCR1 = frame;
    TIM1_CCR2 = frame + LDAC_WAIT;
    TIM1_CCR4 = Y_COUNT;
    TIM1_CCMR1 = 6u << 12 | 1u << 11 | 7u << 4 | 1u << 3; /* LDAC: high until its count; SYNC: low until its count */
    TIM1_CCMR2 = 6u << 4 | 1u << 3;                       /* pixel clock: high until its count, which is preloaded */
    TIM1_CCER = 1u << 8 | 1u << 4 | 1u;
    TIM1_EGR = 1;                                         /* takes what is preloaded, before DMA is requested */
    TIM1_SR = 0;
    TIM1_CNT = PERIOD - 1;                                /* the first that happens is an update */
    TIM1_DIER = 1u << 12 | 1u << 9 | 1u << 8;             /* DMA at CCR4, CCR1 and the update */
    TIM1_BDTR = 1u << 15;                                 /* outputs on: SYNC is high */
    start_pin(PORT_E, 9, 1);                              /* SYNC, LDAC, pixel clock */
    start_pin(PORT_E, 11, 1);
    start_pin(PORT_E, 13, 1);
    TIM1_CR1 = 1u << 7 | 1u;
}

static void start_converters(void)
{
    const uint32_t words = 2u << 16 | 2u << 13 | 2u << 11 | 1u << 6; /* high priority, words, to the peripheral */

    start_pin(PORT_A, 5, 5); /* SPI1: clock, data */
    start_pin(PORT_A, 7, 5);
    start_pin(PORT_B, 13, 5); /* SPI2 */
    start_pin(PORT_B, 15, 5);
    start_spi(SPI1);
    start_spi(SPI2);
    start_stream(X_STREAM, REQUEST_TIM1_UP, SPI_TXDR_ADDRESS(SPI1), play.x, 2 * HALF, words);
    start_stream(Y_STREAM, REQUEST_TIM1_CH4, SPI_TXDR_ADDRESS(SPI2), play.y, 2 * HALF, words);
    start_stream(PIXEL_STREAM, REQUEST_TIM1_CH1, TIM1_CCR3_ADDRESS, play.pixels, 2 * HALF, words | 1u << 4 | 1u << 3);
    NVIC_ISER0 = UINT32_C(1) << DMA1_STREAM2;
    start_timer();
}

void dma_interrupt(void)
{
    enum { HALF_TRANSFER = 1 << 20, TRANSFER_COMPLETE = 1 << 21 };
    const uint32_t flags = DMA1_LISR & (HALF_TRANSFER | TRANSFER_COMPLETE);

    DMA1_LIFCR = flags; /* clear first: a later event sets it again */
    if (flags == (HALF_TRANSFER | TRANSFER_COMPLETE))
        dac_sequencer_report(&sequencer, DAC_FAULT_UNDERRUN); /* a half was sent twice */
    if ((flags & HALF_TRANSFER) != 0) {
        fill(0, HALF);
        clean_half(0);
    }
    if ((flags & TRANSFER_COMPLETE) != 0) {
        fill(HALF, HALF);
        clean_half(1);
    }
}

static void start_uart(void)
{
    start_pin(PORT_D, 8, 7); /* sends, receives */
    start_pin(PORT_D, 9, 7);
    USART3_BRR = (UART_HZ + BAUD / 2) / BAUD;
    invalidate(received, RECEIVED);
    /* Medium priority, bytes, to memory, interrupts at half and end. */
    start_stream(RECEIVE_STREAM, REQUEST_USART3_RX, USART3_RDR_ADDRESS, received, RECEIVED,
                 1u << 16 | 1u << 4 | 1u << 3);
    USART3_CR3 = 1u << 12 | 1u << 6;              /* received bytes by DMA; a late one does not stop the others */
    USART3_CR1 = 1u << 4 | 1u << 3 | 1u << 2 | 1; /* interrupt of an idle line, both ways, on */
    NVIC_IPR(DMA1_STREAM3) = LOWER;
    NVIC_IPR(USART3) = LOWER;
    NVIC_ISER0 = UINT32_C(1) << DMA1_STREAM3;
    NVIC_ISER1 = UINT32_C(1) << (USART3 - 32);
}

/* Gives the link what DMA has written since the last time. */
static void take_received(void)
{
    static unsigned taken;
    const unsigned written = (RECEIVED - DMA1_NDTR(RECEIVE_STREAM)) % RECEIVED;

    invalidate(received, RECEIVED);
    while (taken != written) {
        control_received(received[taken]);
        taken = (taken + 1) % RECEIVED;
    }
}

void receive_interrupt(void)
{
    DMA1_LIFCR = DMA1_LISR & (3u << 26); /* clear first: a later byte sets it again */
    take_received();
}

void idle_interrupt(void)
{
    USART3_ICR = USART_IDLE;
    take_received();
}

/* PE7: a rising edge starts an armed scan, as TRIGGER of the link does. */
static void start_trigger(void)
{
    GPIO_MODER(PORT_E) &= ~(UINT32_C(3) << 14);
    SYSCFG_EXTICR2 = (SYSCFG_EXTICR2 & ~(UINT32_C(15) << 12)) | (uint32_t)PORT_E << 12;
    EXTI_RTSR1 |= 1u << 7;
    EXTI_CPUIMR1 |= 1u << 7;
    NVIC_IPR(EXTI9_5) = LOWER;
    NVIC_ISER0 = UINT32_C(1) << EXTI9_5;
}

void trigger_interrupt(void)
{
    EXTI_CPUPR1 = 1u << 7;
    edge = true; /* the main loop is the only producer of requests */
}

bool board_can_put(void)
{
    return (USART3_ISR & USART_TRANSMIT_EMPTY) != 0;
}

void board_putc(char c)
{
    USART3_TDR = (unsigned char)c;
}

int main(void)
{
    start_clocks();
    start_caches();
    const bool good = dac_sequencer_init(&sequencer, &scan_x_converter, &scan_y_converter) && control_start();
    fill_first();
    start_converters();
    start_uart();
    start_trigger();
    control_ready(good);
    for (;;) {
        if (edge) {
            edge = false;
            (void)dac_sequencer_trigger(&sequencer);
        }
        control_work();
    }
}
