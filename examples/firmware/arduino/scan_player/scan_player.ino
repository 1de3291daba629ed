// Plays a build of tablegen from an Arduino: Uno, Mega (AVR) or Teensy 4, with a dual 12-bit converter MCP4922 on SPI.
// Run `tablegen build scan.toml --output src` in the folder of this file. Not tested on hardware.
#include <Arduino.h>
#include <SPI.h>

#include "src/annexin_200nm.h"
#include "src/dac_sequencer.h"

#if defined(__IMXRT1062__)
static const uint32_t UPDATE_RATE_HZ = 50000;  // two words of 16 bits at 20 MHz take 2 us, their selects another 2 us
#else
static const uint32_t UPDATE_RATE_HZ = 2000;
#endif
static const uint8_t SELECT = 10;  // CS of the converter
static const uint8_t LATCH = 9;    // LDAC: both channels change when it falls

static const dac_program scan = DAC_PROGRAM(ANNEXIN_200NM, annexin_200nm);
static const dac_converter x_converter = DAC_CONVERTER(ANNEXIN_200NM_X, 0);
static const dac_converter y_converter = DAC_CONVERTER(ANNEXIN_200NM_Y, 0);
static dac_sequencer sequencer;
static dac_tick next;  // computed one tick ahead, so that outputs change at the start of an interrupt, without jitter

static_assert(ANNEXIN_200NM_X_DAC_BITS == 12 && ANNEXIN_200NM_Y_DAC_BITS == 12, "the MCP4922 has 12 bits");

static void send(uint16_t channel, dac_output code)
{
    digitalWrite(SELECT, LOW);
    SPI.transfer16((uint16_t)(channel | 0x3000u | code));  // gain 1, on
    digitalWrite(SELECT, HIGH);
}

static void play()
{
    digitalWrite(LATCH, LOW);  // outputs the words that were sent last time
    digitalWrite(LATCH, HIGH);
    send(0x0000, next.x);
    send(0x8000, next.y);
    dac_sequencer_step(&sequencer, &next);
}

#if defined(__IMXRT1062__)
static IntervalTimer timer;

static void start_timer()
{
    timer.begin(play, 1e6f / (float)UPDATE_RATE_HZ);
}
#else
ISR(TIMER1_COMPA_vect)
{
    play();
    if (TIFR1 & (1 << OCF1A)) {  // the next tick is due already
        TIFR1 = 1 << OCF1A;
        dac_sequencer_report(&sequencer, DAC_FAULT_UNDERRUN);
    }
}

static void start_timer()
{
    noInterrupts();
    TCCR1A = 0;
    TCCR1B = (1 << WGM12) | (1 << CS10);  // counts clocks up to OCR1A
    TCNT1 = 0;
    OCR1A = (uint16_t)(F_CPU / UPDATE_RATE_HZ - 1);
    TIMSK1 = 1 << OCIE1A;
    interrupts();
}
#endif

void setup()
{
    Serial.begin(115200);
    pinMode(SELECT, OUTPUT);
    pinMode(LATCH, OUTPUT);
    digitalWrite(SELECT, HIGH);
    digitalWrite(LATCH, HIGH);
    SPI.begin();
    SPI.beginTransaction(SPISettings(20000000, MSBFIRST, SPI_MODE0));
    dac_sequencer_init(&sequencer, &x_converter, &y_converter);
    if (dac_sequencer_load(&sequencer, &scan) != DAC_LOADED) {
        Serial.println("the scan is refused");
        for (;;)
            ;
    }
    dac_sequencer_commit(&sequencer);
    dac_sequencer_step(&sequencer, &next);
    start_timer();
    dac_sequencer_arm(&sequencer, 0);
    dac_sequencer_trigger(&sequencer);
}

// The producer: a letter from the serial monitor.
void loop()
{
    switch (Serial.read()) {
    case 't':
        dac_sequencer_arm(&sequencer, 0);
        dac_sequencer_trigger(&sequencer);
        break;
    case 'p':
        dac_sequencer_park(&sequencer);
        break;
    case 's':
        Serial.println(dac_sequencer_status(&sequencer).faults);
        break;
    default:
        break;
    }
}
