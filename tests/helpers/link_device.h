/* A whole device on this machine, for tests: sequencer, link, memory for two programs, and a record of every line. */
#ifndef LINK_DEVICE_H
#define LINK_DEVICE_H

#include "dac_link_parts.h"
#include "lines.h"

enum { OUT = 1 << 20, COMPILED = 4 };
#if DAC_SLOW_PART
enum { SLOW_KNOTS = 65, SLOW_INDEX_BITS = 7 }; /* of every device; tests/link_device.py has them too */
#endif
#if DAC_PIXEL_TABLE
enum { TABLE_PIXELS = 16 }; /* likewise */
#endif
enum { AXIS_FAULTS = 20, FAULTS = 2 * AXIS_FAULTS + 15 }; /* of a configuration */

typedef struct {
    dac_converter x_converter, y_converter;
    uint32_t x_limits[4], y_limits[4];
    uint8_t x_word_bits, x_index_bits, y_word_bits, y_index_bits;
    uint16_t harmonics;
    uint8_t sine_index_bits, window;
    uint32_t update_rate_hz;
    uint8_t key_bytes, key[32];
    uint8_t knows_hash, hash[32];
    uint8_t has_interlock;
    uint8_t identity_bytes, identity[32], boot_persists;
    void (*random)(uint8_t bytes[16]); /* or NULL */
    const int32_t *sine;
    const dac_program *boot_program; /* or NULL */
} device_setup;

#if DAC_LINK_Z
/* What both sequencers play on a tick. */
typedef struct {
    uint32_t x, y, z, markers, z_markers;
} tick_record;
#endif

typedef struct {
    device_setup setup;
    dac_link_config config;
    dac_sequencer sequencer;
    dac_link link;
    line_log log;
#if DAC_LINK_Z
    bool has_z, plays_z; /* a second sequencer; the program of the firmware has z */
    dac_link_config z_config;
    dac_sequencer z_sequencer;
    dac_link z_link;
    const dac_program *z_boot_program; /* or NULL */
    line_log z_log;
    uint32_t apart; /* ticks on which the markers of a scan differ though z plays */
    size_t z_records, z_room;
    line_record *z_record;
    tick_record *watched; /* NULL: none */
    size_t watched_ticks;
#endif
#if DAC_STORE
    dac_store store;
    dac_store_flash flash; /* of no slot: none */
#endif
#if DAC_LIBRARY
    dac_library_entry compiled[COMPILED];
#endif
    uint32_t boot;
    dac_link_started started;
    bool permits, stalled;
    size_t records, room, sent;
    line_record *record;
    uint8_t out[OUT];
} device;

device *device_new(const device_setup *setup, uint32_t boot);
#if DAC_LINK_Z
dac_link_started device_add_z(device *d, const device_setup *setup, bool plays);
size_t device_z_records(device *d, line_record *records);
uint32_t device_apart(const device *d);
void device_watch(device *d, tick_record *to);
uint32_t device_stops(void);
bool device_request(device *d, unsigned request, uint32_t frames);
dac_link_started device_z_refusal(device *d, unsigned fault);
#endif
#if DAC_SLOW_PART
void device_refuse_slow(device *d);
#endif
#if DAC_STORE
void device_keep(device *d, const dac_store_flash *flash, bool while_playing);
#endif
#if DAC_LIBRARY
void device_compile(device *d, const char *name, const char *hash, const dac_program *program);
bool device_play(device *d, uint32_t number);
#if DAC_COMMIT_MODES
bool device_play_at(device *d, uint32_t number, uint32_t mode);
#endif
uint32_t device_numbers(const device *d);
bool device_list(const device *d, uint32_t number, dac_link_listing *listing);
int32_t device_find(const device *d, const char *name);
#endif
void device_delete(device *d);
void device_start(device *d, uint32_t boot);
void device_permit(device *d, bool permits);
size_t device_feed(device *d, const uint8_t *bytes, size_t count);
unsigned device_run(device *d, unsigned most);
void device_tick(device *d, uint32_t ticks, unsigned work);
void device_answer(device *d);
size_t device_take(device *d, uint8_t *bytes);
size_t device_records(device *d, line_record *records);
void device_poke(device *d, unsigned axis, uint32_t word, int32_t value);
void device_report(device *d, uint8_t fault);
dac_link_started device_started(const device *d);
dac_link_started device_refusal(const device *d, unsigned fault);
uint32_t device_lost(const device *d);
void device_set_clock(uint32_t now);
size_t device_sizes(unsigned which);
int32_t device_table(const device *d, unsigned axis, unsigned place, uint32_t word);
void device_stall(device *d, bool stalled);

#endif
