/* As much of Arduino's headers as the example's sketch uses, so that it compiles for a Teensy, whose core Debian does
 * not have. */
#ifndef ARDUINO_H
#define ARDUINO_H

#include <stdint.h>

enum { LOW, HIGH, OUTPUT };

void digitalWrite(uint8_t pin, uint8_t level);
void pinMode(uint8_t pin, uint8_t mode);
void noInterrupts(void);
void interrupts(void);

struct SerialPort {
    void begin(unsigned long baud);
    int available();
    int read();
    int availableForWrite();
    unsigned write(uint8_t byte);
    void println(const char *text);
    void println(unsigned char value);
};
extern SerialPort Serial;

class IntervalTimer {
public:
    bool begin(void (*function)(), float microseconds);
};

#endif
