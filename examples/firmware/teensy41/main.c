/* Teensy 4.1 (i.MX RT1062): two SPI converters with frames of 24 bits, such as AD5791. One submodule of a pulse width
 * modulator is the clock of everything: it makes LDAC, and requests DMA, which feeds two SPI units from two half
 * buffers; each unit makes SYNC of its converter. An interrupt per half fills the one that was just sent, and cleans
 * the data cache there. The timing of samples does not depend on the processor. The link receives by DMA too. Not
 * tested on hardware. */
#include "control.h"
#include "imxrt1062.h"
#include "names.h"
#include "scan.h"
#include "uart.h"
#include CONVERTER_HEADER
#include SCAN_HEADER

#if DAC_STRIDE != 2
#error "codes of x and y stand in turn"
#endif

enum { HALF = 128, TIMER_HZ = 132000000, UART_HZ = 24000000, OVERSAMPLING = 26 };
enum { PERIOD = TIMER_HZ / UPDATE_RATE_HZ };
enum { FRAME_BITS = JOIN(SPI_CONVERTER, _frame_bits) };
/* Of the clock of SPI, 66 MHz: a bit, SYNC before the first bit and after the last one, SYNC high at least. */
enum { BIT_CYCLES = 3, BEFORE_CYCLES = 2, AFTER_CYCLES = 2, HIGH_CYCLES = 6 };
enum { FRAME_COUNTS = 2 * (FRAME_BITS * BIT_CYCLES + BEFORE_CYCLES + AFTER_CYCLES) }; /* of the timer */
enum { SETTLE = 60, LDAC_WIDTH = 24 }; /* counts: for DMA; at least */
enum { RECEIVED = 256 }; /* bytes: at half of them, and when the line rests, they go to the link */
enum { FRAME_CHANNEL, RECEIVE_CHANNEL };
enum { LOWER = 0x80 };   /* priority of interrupts that must not interrupt each other */

typedef char a_tick_has_room[PERIOD >= FRAME_COUNTS + SETTLE + LDAC_WIDTH ? 1 : -1];
typedef char a_frame_is_no_half_word[FRAME_BITS > 16 ? 1 : -1];
typedef char the_scan_has_words_of_the_converter[DAC_SPI_FITS(SPI_CONVERTER, CONSTANT(_X))
                                                 && DAC_SPI_FITS(SPI_CONVERTER, CONSTANT(_Y)) ? 1 : -1];
typedef char the_counter_has_room[PERIOD < 32768 ? 1 : -1];
typedef char halves_are_whole_lines[HALF * 8 % CACHE_LINE == 0 && RECEIVED % CACHE_LINE == 0 ? 1 : -1];

dac_sequencer sequencer;

/* Memory that DMA reaches (OCRAM), behind the data cache. What DMA reads is cleaned after it is written; what DMA has
 * written is invalidated before it is read, and shares no line of the cache with anything else. Frames of x and y stand
 * in turn. */
static uint32_t frames[2 * HALF][2] __attribute__((aligned(CACHE_LINE)));
static volatile uint8_t received[RECEIVED] __attribute__((aligned(CACHE_LINE)));

void dma_interrupt(void);
void receive_interrupt(void);
void idle_interrupt(void);
int main(void);

/* 528 MHz from PLL 2, buses and the timer at 132 MHz, SPI at 66 MHz, the UART at the crystal's 24 MHz. The processor
 * runs from the crystal while its clock is changed. */
static void start_clocks(void)
{
    CCM_ANALOG_PLL_SYS_SET = 1u << 13 | 1u;
    CCM_ANALOG_PLL_SYS_CLR = 1u << 12;
    while ((CCM_ANALOG_PLL_SYS & UINT32_C(1) << 31) == 0)
        ;
    CCM_ANALOG_PLL_SYS_CLR = 1u << 16;
    CCM_CBCDR &= ~(UINT32_C(7) << 27);
    CCM_CBCMR = (CCM_CBCMR & ~(UINT32_C(3) << 12)) | 1u << 12;
    while (CCM_CDHIPR != 0)
        ;
    CCM_CBCDR |= UINT32_C(1) << 25;
    while (CCM_CDHIPR != 0)
        ;
    CCM_CBCMR = (CCM_CBCMR & ~(UINT32_C(7) << 26 | UINT32_C(3) << 18 | UINT32_C(3) << 4)) | 7u << 26 | 2u << 4;
    CCM_CBCDR = (CCM_CBCDR & ~(UINT32_C(7) << 10)) | 3u << 8;
    while (CCM_CDHIPR != 0)
        ;
    CCM_CBCDR &= ~(UINT32_C(1) << 25);
    while (CCM_CDHIPR != 0)
        ;
    CCM_CSCDR1 = (CCM_CSCDR1 & ~UINT32_C(63)) | 1u << 6;
    CCM_CCGR1 |= 3u << 6 | 3u << 4;  /* LPSPI4, LPSPI3 */
    CCM_CCGR3 |= 3u << 6;            /* LPUART6 */
    CCM_CCGR4 |= 3u << 18 | 3u << 2; /* PWM2, IOMUXC */
    CCM_CCGR5 |= 3u << 6;            /* DMA */
    (void)CCM_CCGR5;
}

/* Computes ticks of both axes, into the buffer from `at` on. */
static void fill(unsigned at, unsigned ticks)
{
    static dac_output codes[2 * HALF];

    dac_sequencer_fill(&sequencer, codes, codes + 1, NULL, ticks);
    for (unsigned i = 0; i < ticks; i++)
        for (unsigned axis = 0; axis < 2; axis++)
            frames[at + i][axis] = dac_spi_frame(&SPI_CONVERTER, 0, codes[2 * i + axis]);
}

static void clean_half(unsigned half)
{
    clean(frames + half * HALF, HALF * 8);
}

/* The first half: a tick, the set-up of both converters, the same tick again, then what follows. */
static void fill_first(void)
{
    unsigned at = 1;

    fill(0, 1); /* takes the program; the outputs begin to ramp to its park codes */
    for (unsigned i = 0; i < SPI_CONVERTER.setups; i++, at++)
        frames[at][0] = frames[at][1] = SPI_CONVERTER.setup[i];
    frames[at][0] = frames[0][0];
    frames[at++][1] = frames[0][1];
    fill(at, HALF - at);
    clean_half(0);
    fill(HALF, HALF);
    clean_half(1);
}

/* A unit makes SYNC with each frame: it falls before the first bit, and rises after the last one. */
static void start_spi(uint32_t unit)
{
    LPSPI_CR(unit) = 2; /* reset */
    LPSPI_CR(unit) = 0;
    LPSPI_CFGR1(unit) = 1; /* master; SYNC is active low */
    LPSPI_CCR(unit) = (AFTER_CYCLES - 1u) << 24 | (BEFORE_CYCLES - 1u) << 16 | (HIGH_CYCLES - 2u) << 8
                      | (BIT_CYCLES - 2u);
    LPSPI_CR(unit) = 1;
    LPSPI_TCR(unit) = (uint32_t)SPI_CONVERTER.mode << 30 | 1u << 19 | (FRAME_BITS - 1u); /* receives nothing */
}

/* A request moves a frame of x to LPSPI4 and one of y to LPSPI3, which is LPSPI_STEP below; then the destination
 * goes back by two steps, also after the last request. */
static void start_frame_channel(void)
{
    enum { LPSPI_STEP = LPSPI4 - LPSPI3 };

    TCD_SADDR(FRAME_CHANNEL) = (uint32_t)(uintptr_t)frames;
    TCD_SOFF(FRAME_CHANNEL) = 4;
    TCD_ATTR(FRAME_CHANNEL) = 2u << 8 | 2u; /* words */
    TCD_NBYTES(FRAME_CHANNEL) = UINT32_C(1) << 30 | (uint32_t)(2 * LPSPI_STEP) << 10 | 8u;
    TCD_SLAST(FRAME_CHANNEL) = -(uint32_t)sizeof frames;
    TCD_DADDR(FRAME_CHANNEL) = LPSPI_TDR_ADDRESS(LPSPI4);
    TCD_DOFF(FRAME_CHANNEL) = (uint16_t)-LPSPI_STEP;
    TCD_CITER(FRAME_CHANNEL) = 2 * HALF;
    TCD_BITER(FRAME_CHANNEL) = 2 * HALF;
    TCD_DLAST(FRAME_CHANNEL) = 2 * LPSPI_STEP;
    TCD_CSR(FRAME_CHANNEL) = 1u << 2 | 1u << 1; /* interrupts at half and end */
    DMAMUX_CHCFG(FRAME_CHANNEL) = UINT32_C(1) << 31 | REQUEST_FLEXPWM2_WRITE0;
    DMA_SERQ = FRAME_CHANNEL;
}

/* A tick, in counts of the timer: at 0 LDAC rises and DMA is requested, which starts both frames; after them and
 * SETTLE counts for DMA, LDAC falls, and both outputs change. */
static void start_timer(void)
{
    PWM2_MCTRL = 1u << 4; /* CLDOK: values are about to change */
    PWM2_SM0CTRL2 = 1u << 13; /* A is no complement of B; clock of the bus */
    PWM2_SM0CTRL = 1u << 10; /* reloads after each period */
    PWM2_SM0DISMAP0 = 0xF000; /* no fault turns A off */
    PWM2_SM0INIT = 0;
    PWM2_SM0VAL0 = 0;
    PWM2_SM0VAL1 = PERIOD - 1;
    PWM2_SM0VAL2 = 0; /* A rises */
    PWM2_SM0VAL3 = FRAME_COUNTS + SETTLE;
    PWM2_SM0DMAEN = 1u << 9; /* a request for each reload */
    PWM2_OUTEN = 1u << 8;
    PWM2_MCTRL = 1u; /* LDOK: takes the values */
    PWM2_MCTRL = 1u << 8 | 1u;
    IOMUXC_MUX(EMC_06) = 1; /* pin 4: LDAC */
}

static void start_converters(void)
{
    IOMUXC_MUX(B0_00) = 3; /* LPSPI4: pins 10, 11, 13 */
    IOMUXC_MUX(B0_02) = 3;
    IOMUXC_MUX(B0_03) = 3;
    IOMUXC_MUX(AD_B1_12) = 2; /* LPSPI3: pins 38, 26, 27 */
    IOMUXC_MUX(AD_B1_14) = 2;
    IOMUXC_MUX(AD_B1_15) = 2;
    start_spi(LPSPI4);
    start_spi(LPSPI3);
    start_frame_channel();
    NVIC_ISER0 = UINT32_C(1) << DMA_CHANNEL0;
    start_timer();
}

/* Fills the half that DMA does not read. */
void dma_interrupt(void)
{
    static unsigned expected;

    DMA_CINT = FRAME_CHANNEL; /* clear first: a later event sets it again */
    const unsigned half = TCD_CITER(FRAME_CHANNEL) > HALF ? 1 : 0;
    if (half != expected)
        dac_sequencer_report(&sequencer, DAC_FAULT_UNDERRUN); /* a half was sent twice */
    expected = 1 - half;
    fill(half * HALF, HALF);
    clean_half(half);
}

static void start_uart(void)
{
    IOMUXC_MUX(AD_B0_02) = 2; /* pin 1 sends, pin 0 receives */
    IOMUXC_MUX(AD_B0_03) = 2;
    IOMUXC_LPUART6_RX_SELECT_INPUT = 1;
    invalidate(received, RECEIVED);
    TCD_SADDR(RECEIVE_CHANNEL) = LPUART6_DATA_ADDRESS;
    TCD_SOFF(RECEIVE_CHANNEL) = 0;
    TCD_ATTR(RECEIVE_CHANNEL) = 0; /* bytes */
    TCD_NBYTES(RECEIVE_CHANNEL) = 1;
    TCD_SLAST(RECEIVE_CHANNEL) = 0;
    TCD_DADDR(RECEIVE_CHANNEL) = (uint32_t)(uintptr_t)received;
    TCD_DOFF(RECEIVE_CHANNEL) = 1;
    TCD_CITER(RECEIVE_CHANNEL) = RECEIVED;
    TCD_BITER(RECEIVE_CHANNEL) = RECEIVED;
    TCD_DLAST(RECEIVE_CHANNEL) = -(uint32_t)RECEIVED;
    TCD_CSR(RECEIVE_CHANNEL) = 1u << 2 | 1u << 1;
    DMAMUX_CHCFG(RECEIVE_CHANNEL) = UINT32_C(1) << 31 | REQUEST_LPUART6_RX;
    DMA_SERQ = RECEIVE_CHANNEL;
    LPUART6_BAUD = (OVERSAMPLING - 1u) << 24 | 1u << 21 /* received bytes by DMA */
                   | (UART_HZ + OVERSAMPLING * BAUD / 2) / (OVERSAMPLING * BAUD);
    LPUART6_CTRL = 1u << 20 | 1u << 19 | 1u << 18 | 1u << 2; /* interrupt of an idle line, both ways */
    NVIC_IPR(DMA_CHANNEL1) = LOWER;
    NVIC_IPR(LPUART6) = LOWER;
    NVIC_ISER0 = UINT32_C(1) << DMA_CHANNEL1 | UINT32_C(1) << LPUART6;
}

/* Gives the link what DMA has written since the last time. */
static void take_received(void)
{
    static unsigned taken;
    const unsigned written = (unsigned)(RECEIVED - TCD_CITER(RECEIVE_CHANNEL)) % RECEIVED;

    invalidate(received, RECEIVED);
    while (taken != written) {
        control_received(received[taken]);
        taken = (taken + 1) % RECEIVED;
    }
}

void receive_interrupt(void)
{
    DMA_CINT = RECEIVE_CHANNEL; /* clear first: a later byte sets it again */
    take_received();
}

void idle_interrupt(void)
{
    LPUART6_STAT = LPUART_IDLE | LPUART_OVERRUN; /* an overrun would stop the receiver */
    take_received();
}

bool board_can_put(void)
{
    return (LPUART6_STAT & LPUART_TRANSMIT_EMPTY) != 0;
}

void board_putc(char c)
{
    LPUART6_DATA = (unsigned char)c;
}

int main(void)
{
    start_clocks();
    DMA_CR = 1u << 10 | 1u << 7; /* groups of different priority; minor loops with offsets */
    start_caches();
    const bool good = dac_sequencer_init(&sequencer, &scan_x_converter, &scan_y_converter) && control_start();
    fill_first();
    start_converters();
    start_uart();
    control_ready(good);
    for (;;)
        control_work();
}
