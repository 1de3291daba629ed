/* See Arduino.h. */
#ifndef SPI_H
#define SPI_H

#include <stdint.h>

enum { MSBFIRST, SPI_MODE0 };

struct SPISettings {
    SPISettings(uint32_t clock, uint8_t order, uint8_t mode);
};

struct SpiPort {
    void begin();
    void beginTransaction(SPISettings settings);
    uint16_t transfer16(uint16_t data);
};
extern SpiPort SPI;

#endif
