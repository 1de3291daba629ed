/* As much of Arduino's headers as the example's sketch uses, so that it compiles without them. */
#ifndef ARDUINO_H
#define ARDUINO_H

#include <stdint.h>

#if defined(__AVR__)
#include <avr/interrupt.h>
#include <avr/io.h>
#endif

enum { LOW, HIGH, OUTPUT };

void digitalWrite(uint8_t pin, uint8_t level);
void pinMode(uint8_t pin, uint8_t mode);
void noInterrupts(void);
void interrupts(void);

struct SerialPort {
    void begin(unsigned long baud);
    int read();
    void println(const char *text);
    void println(unsigned char value);
};
extern SerialPort Serial;

#if defined(__IMXRT1062__)
class IntervalTimer {
public:
    bool begin(void (*function)(), float microseconds);
};
#endif

#endif
