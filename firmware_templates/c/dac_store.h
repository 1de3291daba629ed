/* Kept programs: images of programs in flash, one of which plays after a start (docs/c.md, "Kept programs").
 *
 * A save writes to a place that no slot uses, and one record of 32 bytes then gives the slot this place. So whenever
 * power is lost, either the old program plays or the new one. Calls return when flash has been written: they belong
 * into the main loop, and on a processor that stops while its flash is written the scan is parked first.
 *
 * From `base` on: DAC_STORE_RECORDS sectors for the record of the state, then a place more than there are slots. */
#ifndef DAC_STORE_H
#define DAC_STORE_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define DAC_STORE_RECORDS 3 /* sectors of records */
#define DAC_STORE_SLOTS 15  /* at most */
#define DAC_STORE_NONE 255  /* no slot: the program of the firmware */
#define DAC_STORE_LINE 32   /* writes have this many bytes, at a multiple of it, and happen once after an erase */
#define DAC_STORE_INFO 48   /* bytes of the announcement of an image, as BEGIN has it (docs/protocol.md) */

/* The flash. Each function returns true if it has succeeded. An erased byte reads as 0xFF. */
typedef struct {
    bool (*erase)(uint32_t address); /* the sector that begins here */
    bool (*write)(uint32_t address, const uint8_t *bytes); /* DAC_STORE_LINE bytes */
    bool (*read)(uint32_t address, uint8_t *bytes, uint32_t count);
    uint32_t base, sector_bytes; /* sectors of one size, a multiple of DAC_STORE_LINE */
    uint32_t place_sectors;      /* sectors of a place: an image and 64 bytes */
    uint8_t slots;               /* 1..DAC_STORE_SLOTS */
} dac_store_flash;

typedef enum {
    DAC_STORE_DONE = 0,
    DAC_STORE_BAD_FLASH, /* sizes or slots that are out of range, or a function that is missing */
    DAC_STORE_NO_SLOT,   /* no such slot, or nothing is kept in it */
    DAC_STORE_TOO_LONG,  /* a place has no room for this image */
    DAC_STORE_BAD_IMAGE, /* its bytes do not have the CRC of its announcement */
    DAC_STORE_NO_TRIAL,  /* nothing waits to be confirmed */
    DAC_STORE_FAILED     /* flash was not erased, or not written, or reads otherwise than it was written */
} dac_store_result;

typedef struct {
    uint32_t counter;
    uint8_t selected, trial; /* slots, or DAC_STORE_NONE */
    uint8_t started;         /* 1: the trial has been started */
    uint8_t place[DAC_STORE_SLOTS + 1]; /* of each slot, or DAC_STORE_NONE */
} dac_store_state;

typedef struct {
    const dac_store_flash *flash;
    dac_store_state state;
    uint8_t sector; /* of the record, or DAC_STORE_NONE */
    bool certain;   /* this record was written since the start */
} dac_store;

/* Writes to bytes[] what comes at an offset of an image: up to DAC_STORE_LINE bytes, as many as there are. */
typedef void (*dac_store_source)(void *from, uint32_t offset, uint8_t *bytes, uint32_t count);

/* Reads the state. Writes nothing. */
dac_store_result dac_store_open(dac_store *s, const dac_store_flash *flash);

/* Called once after dac_store_open(): the slot to play, or DAC_STORE_NONE. It is the trial the first time, and the
 * selected slot from then on, until the trial is confirmed. Only the CRC of the image is checked here: check its
 * words as those of an upload before they play. */
uint8_t dac_store_start(dac_store *s);

/* Keeps an image in a slot, in place of what the slot has. */
dac_store_result dac_store_save(dac_store *s, uint8_t slot, const uint8_t *info, dac_store_source source, void *from);

/* The slot that plays after a start; DAC_STORE_NONE: the firmware's program. `trial`: only once, until confirmed. */
dac_store_result dac_store_select(dac_store *s, uint8_t slot, bool trial);

/* The trial that was started is selected. */
dac_store_result dac_store_confirm(dac_store *s);

/* Empties a slot. If it was selected, the firmware's program is. */
dac_store_result dac_store_delete(dac_store *s, uint8_t slot);

/* Whether a slot has an image with the right CRC. Its announcement, if it has. */
bool dac_store_info(const dac_store *s, uint8_t slot, uint8_t *info);

/* Whether a slot has an image, which may be damaged. */
bool dac_store_holds(const dac_store *s, uint8_t slot);

/* Bytes of the longest image. */
uint32_t dac_store_room(const dac_store *s);

/* Bytes of the image of a slot; the caller stays within the bytes that its announcement states. */
bool dac_store_read(const dac_store *s, uint8_t slot, uint32_t offset, uint8_t *bytes, uint32_t count);

#ifdef __cplusplus
}
#endif

#endif
