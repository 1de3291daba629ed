/* On an ATmega2560 in simavr: prints what each tick of a scan is, as the benches record it, and the cycles that it
 * took. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

#include "annexin_200nm.h"
#include "dac_sequencer.h"

static const dac_program scan = DAC_PROGRAM(ANNEXIN_200NM, annexin_200nm);
static const dac_converter x_converter = DAC_CONVERTER(ANNEXIN_200NM_X, 0);
static const dac_converter y_converter = DAC_CONVERTER(ANNEXIN_200NM_Y, 0);
static dac_sequencer sequencer;

static void put(char c)
{
    while ((UCSR0A & (1 << UDRE0)) == 0)
        ;
    UDR0 = (uint8_t)c;
}

static void print(uint32_t value, uint8_t digits)
{
    while (digits-- != 0)
        put("0123456789abcdef"[value >> (4 * digits) & 15]);
}

int main(void)
{
    UCSR0B = 1 << TXEN0;
    TCCR1B = 1 << CS10; /* counts cycles */
    dac_sequencer_init(&sequencer, &x_converter, &y_converter);
    (void)dac_sequencer_load(&sequencer, &scan);
    (void)dac_sequencer_commit(&sequencer);
    for (uint16_t i = 0; i < TICKS; i++) {
        dac_tick tick;
        if (i == 20) {
            (void)dac_sequencer_arm(&sequencer, 1);
            (void)dac_sequencer_trigger(&sequencer);
        }
        TCNT1 = 0;
        dac_sequencer_step(&sequencer, &tick);
        const uint16_t cycles = TCNT1;
        print(tick.x, 6);
        put(' ');
        print(tick.y, 6);
        put(' ');
        print(tick.markers, 2);
        put(' ');
        print(cycles, 4);
        put('\n');
    }
    cli();
    sleep_enable();
    sleep_cpu(); /* with no interrupts simavr ends here */
    return 0;
}
