// Plays a build of tablegen from an Arduino with a dual 12-bit converter MCP4922 on SPI, and takes uploads on Serial:
// Mega (AVR) or Teensy 4. An Uno, whose 2 KB hold no second set of tables, plays the scan that was compiled in, and
// obeys letters. README.md says what belongs into src. Not tested on hardware.
#include <Arduino.h>
#include <SPI.h>

#include "src/arduino_scan.h"
#include "src/control.h"
#include "src/mcp4922.h"
#include "src/names.h"
#include "src/scan.h"
#include "src/uart.h"

#if defined(__AVR__) && RAMEND < 0x2000
#define LINKED 0
#else
#define LINKED 1
#endif

static const uint8_t SELECT = 10;  // CS of the converter
static const uint8_t LATCH = 9;    // LDAC: both channels change when it falls
#if !defined(__AVR__)
enum { HALF = 32 };  // ticks in half a buffer
#elif LINKED
enum { HALF = 8 };
#else
enum { HALF = 2 };
#endif

dac_sequencer sequencer;
static dac_output codes[2][2 * HALF];
static volatile bool full[2];       // set by refill(), cleared by tick()
static volatile uint8_t underruns;  // counted by tick(), reported by refill(): a consumer does not interrupt itself

static_assert(DAC_SPI_FITS(mcp4922, CONSTANT(_X)) && DAC_SPI_FITS(mcp4922, CONSTANT(_Y)),
              "the scan has another [dac] table than mcp4922.h");

static void send(uint32_t frame)
{
    digitalWrite(SELECT, LOW);
    SPI.transfer16((uint16_t)frame);
    digitalWrite(SELECT, HIGH);
}

// The timer's interrupt, first part: a sample of both axes. Outputs change at its start, without jitter.
static void tick()
{
    static uint8_t half, at;

    digitalWrite(LATCH, LOW);  // outputs the words that were sent last time
    digitalWrite(LATCH, HIGH);
    if (!full[half]) {
        underruns = (uint8_t)(underruns + 1);  // the outputs keep their values
        return;
    }
    send(dac_spi_frame(&mcp4922, 0, codes[half][2 * at]));
    send(dac_spi_frame(&mcp4922, 1, codes[half][2 * at + 1]));
    if (++at != HALF)
        return;
    at = 0;
    full[half] = false;
    half ^= 1;
}

// Its second part, the consumer: the next samples. The first part may interrupt it.
static void refill()
{
    static uint8_t reported, next;

    for (; reported != underruns; reported++)
        dac_sequencer_report(&sequencer, DAC_FAULT_UNDERRUN);
    while (!full[next]) {
#if LINKED
        dac_sequencer_fill(&sequencer, codes[next], codes[next] + 1, NULL, HALF);
#else
        for (uint8_t i = 0; i < HALF; i++) {  // slower, but with less of the stack
            dac_tick now;
            dac_sequencer_step(&sequencer, &now);
            codes[next][2 * i] = now.x;
            codes[next][2 * i + 1] = now.y;
        }
#endif
        __asm__ volatile("" ::: "memory");  // write the samples before `full`
        full[next] = true;
        next ^= 1;
    }
}

#if LINKED
static void receive()
{
    while (Serial.available() > 0)
        control_received((uint8_t)Serial.read());
}
#endif

#if defined(__IMXRT1062__)
static_assert(UPDATE_RATE_HZ <= 50000, "two words of 16 bits at 20 MHz take 2 us, their selects another 2 us");
static IntervalTimer timer;

static void on_timer()
{
    tick();
    refill();
}

static void start_timer()
{
    timer.begin(on_timer, 1e6f / (float)UPDATE_RATE_HZ);
}
#else
static_assert(UPDATE_RATE_HZ <= 2000, "a tick takes up to 8000 clocks");

ISR(TIMER1_COMPA_vect)
{
    static bool refilling;

    TIMSK1 = 0;    // no tick in a tick
    interrupts();  // but Serial's: of received bytes the processor holds two, which are 174 us
    tick();
#if LINKED
    receive();  // here, since the main loop may take longer than the 5 ms that the buffer of Serial lasts
#endif
    noInterrupts();
    TIMSK1 = 1 << OCIE1A;
    if (refilling)
        return;
    refilling = true;
    interrupts();  // the next ticks too
    refill();
    noInterrupts();
    refilling = false;
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

bool board_can_put()
{
    return Serial.availableForWrite() > 0;
}

void board_putc(char c)
{
    Serial.write((uint8_t)c);
}

static bool start()
{
#if LINKED
    return control_start();
#else
    return dac_sequencer_load(&sequencer, &scan_whole) == DAC_LOADED && dac_sequencer_commit(&sequencer);
#endif
}

void setup()
{
    Serial.begin(115200);
    pinMode(SELECT, OUTPUT);
    pinMode(LATCH, OUTPUT);
    digitalWrite(SELECT, HIGH);
    digitalWrite(LATCH, HIGH);
    SPI.begin();
    SPI.beginTransaction(SPISettings(20000000, MSBFIRST, SPI_MODE0));
    const bool good = dac_sequencer_init(&sequencer, &scan_x_converter, &scan_y_converter) && start();
    refill();
    start_timer();
#if LINKED
    control_ready(good);
#else
    if (!good)
        Serial.println("the scan is refused");
#endif
}

// The producer.
void loop()
{
#if LINKED
#if !defined(__AVR__)
    receive();  // USB waits until there is room
#endif
    control_work();
#else
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
#endif
}
