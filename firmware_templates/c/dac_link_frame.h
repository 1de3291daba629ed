/* Private to the link: frames on a serial line, COBS around header, payload and CRC-32 (docs/protocol.md). */
#ifndef DAC_LINK_FRAME_H
#define DAC_LINK_FRAME_H

#include <stdbool.h>
#include <stdint.h>

#define DAC_LINK_FRAME 254 /* bytes before COBS, at most */
#define DAC_LINK_HEADER 6  /* type, seq, session */
#define DAC_LINK_SHORTEST 10

/* A frame that comes in byte by byte. */
typedef struct {
    uint32_t crc;
    uint8_t length; /* bytes so far */
    uint8_t left;   /* up to the next zero that was taken out */
    bool begun, wrong;
    uint8_t bytes[DAC_LINK_FRAME];
} dac_link_reader;

typedef enum { DAC_LINK_MORE, DAC_LINK_GOOD, DAC_LINK_BAD } dac_link_read;

/* A byte from the line. After DAC_LINK_GOOD a frame without its CRC is in bytes[0..length - 1] until the next call. */
dac_link_read dac_link_read_byte(dac_link_reader *r, uint8_t byte);

/* wire[1..length] holds a frame without its CRC, and wire has room for 256 bytes. Makes of it what goes onto the line,
 * and returns the bytes of that. */
uint16_t dac_link_seal(uint8_t *wire, uint16_t length);

/* CRC-32 as zlib and Ethernet have it: begin with DAC_LINK_CRC, add bytes, invert at the end. */
#define DAC_LINK_CRC UINT32_C(0xFFFFFFFF)
uint32_t dac_link_crc(uint32_t crc, uint8_t byte);

/* Numbers on the line have their lowest byte first, whatever the processor has. */
uint32_t dac_link_get(const uint8_t *at);
void dac_link_put(uint8_t *at, uint32_t value);

#endif
