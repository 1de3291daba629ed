/* SPI frames from the words of the sequencer, for the converters of this folder.
 *
 *     #include "ad5791.h"
 *     static uint8_t frames[2][64 * 3];                    // for DMA: x and y on two data lines
 *
 *     dac_sequencer_fill(&sequencer, x, y, NULL, 64);
 *     dac_spi_words(&ad5791, 0, x, 64, frames[0]);
 *     dac_spi_words(&ad5791, 0, y, 64, frames[1]);
 *
 * A frame is the prefix of an output (command and address) with the word of the axis above bit data_lsb. Its bytes go
 * out highest first. They are the same on every processor: a SPI unit that sends bytes needs no byte order. A unit that
 * takes a frame at once takes numbers in the processor's byte order: dac_spi_frames16() and dac_spi_frames32().
 * The word is that of the scan: fill has made it straight binary or two's complement, left- or right-aligned. Give the
 * scan's [dac] table the bits, coding, word_bits and align that the converter's file states. */
#ifndef SPI_WORDS_H
#define SPI_WORDS_H

#include "dac_sequencer.h"

typedef struct dac_spi_converter {
    uint8_t frame_bits;     /* 16, 24 or 32 */
    uint8_t word_bits;      /* as in the scan: word_bits, or bits without it */
    uint8_t data_lsb;       /* the bit of the frame that takes the lowest bit of the word */
    uint8_t mode;           /* of SPI: 0 samples on the rising edge, 1 on the falling one; the clock rests low */
    uint32_t prefix[2];     /* of outputs A and B; of a converter with one output, twice the same */
    uint8_t setups;         /* frames in setup */
    uint32_t setup[2];      /* after power-up, between two frames of the first word: dac_spi_start() */
} dac_spi_converter;

/* Whether the words of an axis of a scan are those of a converter, a constant: DAC_SPI_FITS(ad5791, ANNEXIN_200NM_X). A
 * scan with fewer bits than the converter is left-aligned. */
#define DAC_SPI_FITS(converter, AXIS) DAC_SPI_FITS_OF(converter, AXIS)
#define DAC_SPI_FITS_OF(converter, AXIS)                                                                              \
    (AXIS##_DAC_WORD_BITS == converter##_word_bits && AXIS##_DAC_TWOS_COMPLEMENT == converter##_twos_complement       \
     && AXIS##_DAC_BITS <= converter##_bits && (AXIS##_DAC_LEFT_ALIGNED || AXIS##_DAC_BITS == AXIS##_DAC_WORD_BITS))

/* The frame of a word. output: 0 for A, 1 for B. A word in two's complement may have its sign above word_bits. */
static inline uint32_t dac_spi_frame(const dac_spi_converter *converter, unsigned output, uint32_t word)
{
    const uint32_t mask = (UINT32_C(1) << converter->word_bits) - 1;

    return converter->prefix[output] | (word & mask) << converter->data_lsb;
}

/* Writes a frame as frame_bits / 8 bytes, highest first, and returns the place after them. */
static inline uint8_t *dac_spi_bytes(const dac_spi_converter *converter, uint32_t frame, uint8_t *to)
{
    unsigned bits = converter->frame_bits;

    while (bits != 0) {
        bits -= 8;
        *to++ = (uint8_t)(frame >> bits);
    }
    return to;
}

/* Writes the frames of `count` words as dac_sequencer_fill() leaves them, and returns the place after them. */
static inline uint8_t *dac_spi_words(
    const dac_spi_converter *converter, unsigned output, const dac_output *words, unsigned count, uint8_t *to)
{
    while (count-- != 0) {
        to = dac_spi_bytes(converter, dac_spi_frame(converter, output, *words), to);
        words += DAC_STRIDE;
    }
    return to;
}

/* The same for a converter with two outputs on one data line: a frame of A and a frame of B for each sample. Exchange
 * x and y if output B drives x. */
static inline uint8_t *dac_spi_pairs(
    const dac_spi_converter *converter, const dac_output *a, const dac_output *b, unsigned count, uint8_t *to)
{
    while (count-- != 0) {
        to = dac_spi_bytes(converter, dac_spi_frame(converter, 0, *a), to);
        to = dac_spi_bytes(converter, dac_spi_frame(converter, 1, *b), to);
        a += DAC_STRIDE;
        b += DAC_STRIDE;
    }
    return to;
}

/* Writes the frames of `count` words as numbers, each into the lowest bits of 32: for a unit with frames of up to 32
 * bits that DMA feeds by words, such as that of an STM32H7. Returns the place after them. */
static inline uint32_t *dac_spi_frames32(
    const dac_spi_converter *converter, unsigned output, const dac_output *words, unsigned count, uint32_t *to)
{
    while (count-- != 0) {
        *to++ = dac_spi_frame(converter, output, *words);
        words += DAC_STRIDE;
    }
    return to;
}

/* The same for frames of 16 bits and DMA by half words. */
static inline uint16_t *dac_spi_frames16(
    const dac_spi_converter *converter, unsigned output, const dac_output *words, unsigned count, uint16_t *to)
{
    while (count-- != 0) {
        *to++ = (uint16_t)dac_spi_frame(converter, output, *words);
        words += DAC_STRIDE;
    }
    return to;
}

/* Writes what an output needs after power-up: the first word, the set-up, the first word again; 4 frames at most. So an
 * output that the set-up switches on begins at this word, and one that the set-up resets returns to it. */
static inline uint8_t *dac_spi_start(
    const dac_spi_converter *converter, unsigned output, dac_output first, uint8_t *to)
{
    unsigned done;

    to = dac_spi_words(converter, output, &first, 1, to);
    for (done = 0; done < converter->setups; done++)
        to = dac_spi_bytes(converter, converter->setup[done], to);
    return dac_spi_words(converter, output, &first, 1, to);
}

#endif
