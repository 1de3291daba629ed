/* Kept programs. tablegen/link/store.py has the same, flash operation by flash operation. */
#include "dac_store.h"

#include <stddef.h>

#include "dac_config.h"
#include "dac_link_frame.h"

#if DAC_STORE

enum { RECORD_MAGIC = 0x31525354, PLACE_MAGIC = 0x31505354 }; /* "TSR1", "TSP1" */
enum { HEADER = 64, IMAGE_BYTES = 32, IMAGE_CRC = 36 };

static uint32_t crc_of(const uint8_t *bytes, uint32_t count)
{
    uint32_t crc = DAC_LINK_CRC;

    for (uint32_t i = 0; i < count; i++)
        crc = dac_link_crc(crc, bytes[i]);
    return ~crc;
}

static uint32_t record_address(const dac_store *s, uint32_t sector)
{
    return s->flash->base + sector * s->flash->sector_bytes;
}

static uint32_t place_address(const dac_store *s, unsigned place)
{
    return record_address(s, DAC_STORE_RECORDS + place * s->flash->place_sectors);
}

static bool same(const uint8_t *a, const uint8_t *b, unsigned count)
{
    unsigned differ = 0;

    for (unsigned i = 0; i < count; i++)
        differ |= (unsigned)(a[i] ^ b[i]);
    return differ == 0;
}

/* Writes a line and reads it again. */
static bool write_line(const dac_store *s, uint32_t address, const uint8_t *line)
{
    uint8_t again[DAC_STORE_LINE];

    return s->flash->write(address, line) && s->flash->read(address, again, DAC_STORE_LINE)
        && same(line, again, DAC_STORE_LINE);
}

static void pack(const dac_store_state *state, uint8_t *line)
{
    dac_link_put(line, RECORD_MAGIC);
    dac_link_put(line + 4, state->counter);
    line[8] = state->selected;
    line[9] = state->trial;
    line[10] = state->started;
    line[11] = 0;
    for (unsigned slot = 0; slot <= DAC_STORE_SLOTS; slot++)
        line[12 + slot] = state->place[slot];
    dac_link_put(line + 28, crc_of(line, 28));
}

static bool unpack(const uint8_t *line, dac_store_state *state)
{
    if (dac_link_get(line) != RECORD_MAGIC || dac_link_get(line + 28) != crc_of(line, 28))
        return false;
    state->counter = dac_link_get(line + 4);
    state->selected = line[8];
    state->trial = line[9];
    state->started = line[10];
    for (unsigned slot = 0; slot <= DAC_STORE_SLOTS; slot++)
        state->place[slot] = line[12 + slot];
    return true;
}

/* Writes the state to a sector, which is then the one of the record. */
static bool write_record(dac_store *s, unsigned sector, const dac_store_state *state)
{
    uint8_t line[DAC_STORE_LINE];

    pack(state, line);
    if (!s->flash->erase(record_address(s, sector)) || !write_line(s, record_address(s, sector), line)) {
        s->certain = false; /* what was written may count at the next start, or not */
        return false;
    }
    s->state = *state;
    s->sector = (uint8_t)sector;
    s->certain = true;
    return true;
}

/* The sector to write a copy of the record to: neither that of the record nor that of the one before it. */
static unsigned oldest(const dac_store *s)
{
    unsigned chosen = 0;
    uint32_t least = UINT32_MAX;

    for (unsigned sector = 0; sector < DAC_STORE_RECORDS; sector++) {
        uint8_t line[DAC_STORE_LINE];
        dac_store_state state;
        uint32_t counter = 0;
        if (sector == s->sector)
            continue;
        if (s->flash->read(record_address(s, sector), line, DAC_STORE_LINE) && unpack(line, &state))
            counter = state.counter;
        if (counter < least) {
            least = counter;
            chosen = sector;
        }
    }
    return chosen;
}

/* Before the first change after a start: the record that was read may be one that a cut has left half written, and may
 * read otherwise the next time. It is written again, and all others are erased, before anything depends on it. */
static bool make_certain(dac_store *s)
{
    dac_store_state copy = s->state;

    if (s->certain)
        return true;
    copy.counter += 2; /* beyond that of a record that a cut has left and that could not be read */
    if (!write_record(s, oldest(s), &copy))
        return false;
    for (unsigned sector = 0; sector < DAC_STORE_RECORDS; sector++)
        if (sector != s->sector && !s->flash->erase(record_address(s, sector))) {
            s->certain = false;
            return false;
        }
    return true;
}

/* One record makes the change. */
static dac_store_result change(dac_store *s, dac_store_state *state)
{
    const unsigned sector = (s->sector + 1u) % DAC_STORE_RECORDS;

    state->counter = s->state.counter + 1;
    return write_record(s, sector, state) ? DAC_STORE_DONE : DAC_STORE_FAILED;
}

dac_store_result dac_store_open(dac_store *s, const dac_store_flash *flash)
{
    s->flash = flash;
    s->sector = DAC_STORE_NONE;
    s->certain = false;
    s->state.counter = 0;
    s->state.selected = DAC_STORE_NONE;
    s->state.trial = DAC_STORE_NONE;
    s->state.started = 0;
    for (unsigned slot = 0; slot <= DAC_STORE_SLOTS; slot++)
        s->state.place[slot] = DAC_STORE_NONE;
    if (flash->erase == NULL || flash->write == NULL || flash->read == NULL || flash->slots < 1
        || flash->slots > DAC_STORE_SLOTS || flash->place_sectors < 1 || flash->sector_bytes < HEADER
        || flash->sector_bytes % DAC_STORE_LINE != 0
        || flash->place_sectors > UINT32_MAX / flash->sector_bytes / (DAC_STORE_SLOTS + 5u))
        return DAC_STORE_BAD_FLASH;
    for (unsigned sector = 0; sector < DAC_STORE_RECORDS; sector++) {
        uint8_t line[DAC_STORE_LINE];
        dac_store_state state;
        if (flash->read(record_address(s, sector), line, DAC_STORE_LINE) && unpack(line, &state)
            && (s->sector == DAC_STORE_NONE || state.counter > s->state.counter)) {
            s->state = state;
            s->sector = (uint8_t)sector;
        }
    }
    return DAC_STORE_DONE;
}

/* The place of a slot, or DAC_STORE_NONE. */
static uint8_t place_of(const dac_store *s, uint8_t slot)
{
    return slot < s->flash->slots && s->state.place[slot] <= s->flash->slots ? s->state.place[slot] : DAC_STORE_NONE;
}

bool dac_store_holds(const dac_store *s, uint8_t slot)
{
    return place_of(s, slot) != DAC_STORE_NONE;
}

uint32_t dac_store_room(const dac_store *s)
{
    return s->flash->place_sectors * s->flash->sector_bytes - HEADER;
}

/* Whether a place has an image of this slot; its announcement, if it has. */
static bool good_place(const dac_store *s, unsigned place, uint8_t slot, uint8_t *info)
{
    const uint32_t address = place_address(s, place);
    uint8_t header[HEADER], line[DAC_STORE_LINE];
    uint32_t crc = DAC_LINK_CRC;

    if (!s->flash->read(address, header, HEADER) || dac_link_get(header) != PLACE_MAGIC
        || dac_link_get(header + 4) != slot || dac_link_get(header + 60) != crc_of(header, 60))
        return false;
    const uint32_t bytes = dac_link_get(header + 8 + IMAGE_BYTES);
    if (bytes > dac_store_room(s))
        return false;
    for (uint32_t at = 0; at < bytes; at += DAC_STORE_LINE) {
        const uint32_t count = bytes - at < DAC_STORE_LINE ? bytes - at : DAC_STORE_LINE;
        if (!s->flash->read(address + HEADER + at, line, count))
            return false;
        for (uint32_t i = 0; i < count; i++)
            crc = dac_link_crc(crc, line[i]);
    }
    for (unsigned i = 0; i < DAC_STORE_INFO; i++)
        info[i] = header[8 + i];
    return ~crc == dac_link_get(header + 8 + IMAGE_CRC);
}

bool dac_store_info(const dac_store *s, uint8_t slot, uint8_t *info)
{
    const uint8_t place = place_of(s, slot);
    return place != DAC_STORE_NONE && good_place(s, place, slot, info);
}

bool dac_store_read(const dac_store *s, uint8_t slot, uint32_t offset, uint8_t *bytes, uint32_t count)
{
    const uint8_t place = place_of(s, slot);
    return place != DAC_STORE_NONE && s->flash->read(place_address(s, place) + HEADER + offset, bytes, count);
}

uint8_t dac_store_start(dac_store *s)
{
    uint8_t info[DAC_STORE_INFO];

    if (s->state.trial != DAC_STORE_NONE) {
        dac_store_state state = s->state;
        const bool first = state.started == 0 && dac_store_info(s, state.trial, info);
        state.started = 1;
        if (!first)
            state.trial = DAC_STORE_NONE;
        /* A trial is not played before flash says that it was: it could otherwise be started for ever. */
        if (make_certain(s) && change(s, &state) == DAC_STORE_DONE && first)
            return state.trial;
    }
    return dac_store_info(s, s->state.selected, info) ? s->state.selected : DAC_STORE_NONE;
}

/* A place that no slot has: there is one more than there are slots. */
static unsigned free_place(const dac_store *s)
{
    unsigned place = 0;

    for (unsigned slot = 0; slot < s->flash->slots;) {
        if (s->state.place[slot] == place) {
            place++;
            slot = 0;
        } else {
            slot++;
        }
    }
    return place;
}

static bool write_image(const dac_store *s, uint32_t address, uint32_t bytes, dac_store_source source, void *from)
{
    uint8_t line[DAC_STORE_LINE];

    for (uint32_t sector = 0; sector < s->flash->place_sectors; sector++)
        if (!s->flash->erase(address + sector * s->flash->sector_bytes))
            return false;
    for (uint32_t at = 0; at < bytes; at += DAC_STORE_LINE) {
        const uint32_t count = bytes - at < DAC_STORE_LINE ? bytes - at : DAC_STORE_LINE;
        for (unsigned i = 0; i < DAC_STORE_LINE; i++)
            line[i] = 0xFF;
        source(from, at, line, count);
        if (!write_line(s, address + HEADER + at, line))
            return false;
    }
    return true;
}

dac_store_result dac_store_save(dac_store *s, uint8_t slot, const uint8_t *info, dac_store_source source, void *from)
{
    const uint32_t bytes = dac_link_get(info + IMAGE_BYTES);
    uint8_t header[HEADER], stored[DAC_STORE_INFO];

    if (slot >= s->flash->slots)
        return DAC_STORE_NO_SLOT;
    if (bytes > dac_store_room(s))
        return DAC_STORE_TOO_LONG;
    if (!make_certain(s))
        return DAC_STORE_FAILED;
    const unsigned place = free_place(s);
    const uint32_t address = place_address(s, place);
    dac_link_put(header, PLACE_MAGIC);
    dac_link_put(header + 4, slot);
    for (unsigned i = 0; i < DAC_STORE_INFO; i++)
        header[8 + i] = info[i];
    dac_link_put(header + 56, s->state.counter);
    dac_link_put(header + 60, crc_of(header, 60));
    if (!write_image(s, address, bytes, source, from) || !write_line(s, address, header)
        || !write_line(s, address + DAC_STORE_LINE, header + DAC_STORE_LINE))
        return DAC_STORE_FAILED;
    if (!good_place(s, place, slot, stored))
        return DAC_STORE_BAD_IMAGE;
    dac_store_state state = s->state;
    state.place[slot] = (uint8_t)place;
    return change(s, &state);
}

dac_store_result dac_store_select(dac_store *s, uint8_t slot, bool trial)
{
    dac_store_state state = s->state;
    uint8_t info[DAC_STORE_INFO];

    if ((slot != DAC_STORE_NONE || trial) && !dac_store_info(s, slot, info))
        return DAC_STORE_NO_SLOT;
    if (trial) {
        state.trial = slot;
    } else {
        state.selected = slot;
        state.trial = DAC_STORE_NONE;
    }
    state.started = 0;
    return make_certain(s) ? change(s, &state) : DAC_STORE_FAILED;
}

dac_store_result dac_store_confirm(dac_store *s)
{
    dac_store_state state = s->state;

    if (state.trial == DAC_STORE_NONE || state.started == 0)
        return DAC_STORE_NO_TRIAL;
    state.selected = state.trial;
    state.trial = DAC_STORE_NONE;
    state.started = 0;
    return make_certain(s) ? change(s, &state) : DAC_STORE_FAILED;
}

dac_store_result dac_store_delete(dac_store *s, uint8_t slot)
{
    dac_store_state state = s->state;

    if (place_of(s, slot) == DAC_STORE_NONE)
        return DAC_STORE_NO_SLOT;
    state.place[slot] = DAC_STORE_NONE;
    if (state.selected == slot)
        state.selected = DAC_STORE_NONE;
    if (state.trial == slot)
        state.trial = DAC_STORE_NONE;
    return make_certain(s) ? change(s, &state) : DAC_STORE_FAILED;
}

#endif
