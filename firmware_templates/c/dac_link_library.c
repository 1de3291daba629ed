/* The programs of a device under one number: those that were compiled, then those that are kept (docs/c.md, "A library
 * of programs"). */
#include "dac_link_parts.h"

#if DAC_LIBRARY

enum { SHORTEST = 12 }; /* digits of a hash that name a program */
#if DAC_LIBRARY > 1
enum { LONGEST = 200, LISTING = 38, LISTED_HASH = 6 }; /* bytes of a name, and of an answer to LIST in front of it */
#endif

static const char digits[] = "0123456789abcdef";

/* A program as an image: the inverse of dac_link_program_of(). */

static void put_word(uint8_t *page, unsigned word, uint32_t value)
{
    dac_link_put(page + 4 * word, value);
}

static void put_scan(uint8_t *page, const dac_program *p)
{
    const dac_schedule *const s = &p->schedule;
    const dac_window *const windows[] = {&s->forward, &s->backward, &s->up, &s->down};

    put_word(page, DAC_LINK_LINE_TICKS, s->line_ticks);
    put_word(page, DAC_LINK_FRAME_LINES, s->frame_lines);
    put_word(page, DAC_LINK_SETTLE_LINES, s->settle_lines);
    put_word(page, DAC_LINK_TURN_TICK, s->turn_tick);
    for (unsigned i = 0; i < 4; i++) {
        put_word(page, DAC_LINK_FORWARD + 2 * i, windows[i]->first);
        put_word(page, DAC_LINK_FORWARD + 2 * i + 1, windows[i]->count);
    }
    put_word(page, DAC_LINK_PIXELS, s->pixels);
    put_word(page, DAC_LINK_Y_STEPS, p->y.hold_ticks != 1);
#if DAC_PIXEL_TABLE
    put_word(page, DAC_LINK_PIXEL_WORD, s->pixel_table != NULL);
#endif
}

/* Step and remainder of a period, in two words. */
static void put_step(uint8_t *page, unsigned word, uint32_t period)
{
    put_word(page, word, (uint32_t)((UINT64_C(1) << 32) / period));
    put_word(page, word + 1, (uint32_t)((UINT64_C(1) << 32) % period));
}

static void put_level(uint8_t *page, int32_t gain, int64_t offset)
{
    put_word(page, DAC_LINK_GAIN, (uint32_t)gain);
    put_word(page, DAC_LINK_OFFSET_LOW, (uint32_t)offset & 0x3FFFF);
    put_word(page, DAC_LINK_OFFSET_HIGH, (uint32_t)(offset >> 18));
}

#if DAC_SLOW_PART
/* Its gain and offset take the place of those of the axis, which have no effect. */
static void put_slow(uint8_t *page, const dac_slow_part *s, uint32_t lines)
{
    put_level(page, s->gain_word, s->offset_word);
    put_word(page, DAC_LINK_SLOW_WORD, s->gain_knots | (uint32_t)s->index_bits << 8);
    put_word(page, DAC_LINK_KNOT_SPACING, s->gain_spacing);
    put_step(page, DAC_LINK_SLOW_STEP, lines);
}
#endif

static void put_axis(uint8_t *page, const dac_axis_program *a)
{
    put_step(page, DAC_LINK_PHASE_STEP, a->phase_period);
    put_word(page, DAC_LINK_PHASE_PERIOD, a->phase_period);
    put_level(page, a->gain_word, a->offset_word);
    put_word(page, DAC_LINK_CODE_MIN, (uint32_t)a->code_min);
    put_word(page, DAC_LINK_CODE_MAX, (uint32_t)a->code_max);
    put_word(page, DAC_LINK_MAX_STEP, (uint32_t)a->max_step);
    put_word(page, DAC_LINK_PARK_CODE, (uint32_t)a->park_code);
#if DAC_SHAPING
    put_word(page, DAC_LINK_SHAPING_WORD, a->shaping_order | (uint32_t)a->shaping_zero << 8);
#endif
}

static unsigned table_bytes(const dac_axis_program *a)
{
    return a->bits <= 16 ? 2 : 3; /* of a word */
}

#if DAC_SLOW_PART
static uint32_t slow_bytes(const dac_axis_program *a)
{
    const dac_slow_part *const s = a->slow;

    return s == NULL ? 0 : a->length + ((uint32_t)table_bytes(a) << s->index_bits) + UINT32_C(5) * s->gain_knots;
}

/* The words of an image have one spacing of knots. Without a second table there are no ratios. */
static bool has_image(const dac_axis_program *a)
{
    const dac_slow_part *const s = a->slow;

    return s == NULL || s->second == NULL
        || (s->ratio_knots == s->gain_knots && s->ratio_spacing == s->gain_spacing);
}
#endif

static uint8_t value_of(char digit)
{
    uint8_t value = 0;

    while (digits[value] != digit && value < 15)
        value++;
    return value;
}

static void put_hash(uint8_t *to, const char *hash)
{
    for (unsigned i = 0; i < DAC_LINK_BYTES; i++)
        to[i] = (uint8_t)(value_of(hash[2 * i]) << 4 | value_of(hash[2 * i + 1]));
}

static void announce(const dac_library_entry *entry, uint8_t *info)
{
    const dac_axis_program *const axes[] = {&entry->program.x, &entry->program.y};
    uint32_t bytes = DAC_LINK_PROGRAM;

    put_hash(info + DAC_LINK_HASH, entry->hash);
    for (unsigned axis = 0; axis < 2; axis++) {
        uint8_t *const shape = info + DAC_LINK_SHAPES + 4 * axis;
        shape[0] = axes[axis]->index_bits;
        shape[1] = axes[axis]->bits;
        shape[2] = axes[axis]->dac_bits;
        shape[3] = 0;
        bytes += axes[axis]->length * table_bytes(axes[axis]);
#if DAC_SLOW_PART
        bytes += slow_bytes(axes[axis]);
#endif
    }
#if DAC_PIXEL_TABLE
    if (entry->program.schedule.pixel_table != NULL)
        bytes += 4 * entry->program.schedule.pixels;
#endif
    dac_link_put(info + DAC_LINK_BYTES, bytes);
    dac_link_put(info + DAC_LINK_IMAGE_CRC, 0); /* computed when the image is in memory */
}

static dac_link_finding store_program(dac_link *l, const dac_program *program)
{
    uint8_t words[DAC_LINK_PROGRAM] = {0};
    dac_link_finding found = dac_link_fine();

    put_scan(words, program);
    put_axis(words + 64, &program->x);
    put_axis(words + 128, &program->y);
#if DAC_SLOW_PART
    if (program->x.slow != NULL)
        put_slow(words + 64, program->x.slow, program->schedule.frame_lines);
    if (program->y.slow != NULL)
        put_slow(words + 128, program->y.slow, program->schedule.frame_lines);
#endif
    for (unsigned i = 0; i < DAC_LINK_PROGRAM; i++)
        found = dac_link_store(l, words[i]);
    return found; /* that of the last byte */
}

static void store_word(dac_link *l, uint32_t word, unsigned bytes)
{
    for (unsigned byte = 0; byte < bytes; byte++)
        (void)dac_link_store(l, (uint8_t)(word >> 8 * byte));
}

static void store_table(dac_link *l, const dac_axis_program *a)
{
    for (uint32_t word = 0; word < a->length; word++)
        store_word(l, (uint32_t)a->table[word], table_bytes(a));
}

#if DAC_SLOW_PART
static void store_slow(dac_link *l, const dac_axis_program *a)
{
    const dac_slow_part *const s = a->slow;

    if (s == NULL)
        return;
    for (uint32_t word = 0; word < a->length; word++)
        store_word(l, s->second != NULL ? (uint32_t)s->second[word] : 0, 1);
    for (uint32_t word = 0; word < UINT32_C(1) << s->index_bits; word++)
        store_word(l, (uint32_t)s->table[word], table_bytes(a));
    for (unsigned knot = 0; knot < s->gain_knots; knot++)
        store_word(l, (uint32_t)s->gains[knot], 3);
    for (unsigned knot = 0; knot < s->gain_knots; knot++)
        store_word(l, s->second != NULL ? (uint32_t)s->ratios[knot] : 0, 2);
}
#endif

#if DAC_PIXEL_TABLE
static void store_pixels(dac_link *l, const dac_schedule *s)
{
    for (uint32_t word = 0; s->pixel_table != NULL && word < 2 * s->pixels; word++) {
        (void)dac_link_store(l, (uint8_t)s->pixel_table[word]);
        (void)dac_link_store(l, (uint8_t)(s->pixel_table[word] >> 8));
    }
}
#endif

static void put_crc(dac_link *l)
{
    dac_link_place at = {0, 0, 0, 0};
    uint32_t crc = DAC_LINK_CRC;

    while (at.part != DAC_LINK_END)
        crc = dac_link_crc(crc, dac_link_load_byte(l, &at));
    dac_link_put(l->image[l->idle].info + DAC_LINK_IMAGE_CRC, ~crc);
}

/* A compiled program goes the way of an upload too. The sequencer checks what an image does not have: the coding of the
 * converter, and the table in flash. */
static dac_link_finding load_compiled(dac_link *l, const dac_library_entry *entry)
{
    uint8_t info[DAC_LINK_INFO], payload[4];
    dac_link_answer a = {0, 0, 0, 0, payload};

    const dac_loaded loaded = dac_sequencer_load(l->sequencer, &entry->program);
    if (loaded != DAC_LOADED)
        return dac_link_because(DAC_LINK_REFUSED, (uint32_t)loaded);
#if DAC_SLOW_PART
    if (!has_image(&entry->program.x) || !has_image(&entry->program.y))
        return dac_link_because(DAC_LINK_SHAPE, has_image(&entry->program.x) ? 1 : 0);
#endif
    announce(entry, info);
    dac_link_finding found = dac_link_begin(l, info, &a);
    if (found.reason == DAC_LINK_NO_REASON)
        found = store_program(l, &entry->program);
    if (found.reason != DAC_LINK_NO_REASON)
        return found;
    store_table(l, &entry->program.x);
#if DAC_SLOW_PART
    store_slow(l, &entry->program.x);
#endif
    store_table(l, &entry->program.y);
#if DAC_SLOW_PART
    store_slow(l, &entry->program.y);
#endif
#if DAC_PIXEL_TABLE
    store_pixels(l, &entry->program.schedule);
#endif
    put_crc(l);
    return found;
}

/* The index. */

static const dac_library_entry *compiled(const dac_link *l, uint32_t number)
{
    return number < l->config->library_programs ? &l->config->library[number] : NULL;
}

#if DAC_STORE
/* The slot of a number behind those of the compiled programs, or DAC_STORE_NONE. */
static uint8_t slot_of(const dac_link *l, uint32_t number)
{
    const uint32_t slot = number - l->config->library_programs;

    return number < dac_link_numbers(l) ? (uint8_t)slot : DAC_STORE_NONE;
}
#endif

uint32_t dac_link_numbers(const dac_link *l)
{
    if (l->config == NULL)
        return 0;
#if DAC_STORE
    if (l->config->store != NULL)
        return l->config->library_programs + l->config->store->flash->slots;
#endif
    return l->config->library_programs;
}

bool dac_link_list(const dac_link *l, uint32_t number, dac_link_listing *listing)
{
    if (number >= dac_link_numbers(l))
        return false;
    const dac_library_entry *const entry = compiled(l, number);
    listing->name = NULL;
    if (entry != NULL) {
        listing->name = entry->name;
        put_hash(listing->hash, entry->hash);
        return true;
    }
#if DAC_STORE
    uint8_t info[DAC_LINK_INFO];
    if (dac_store_info(l->config->store, slot_of(l, number), info)) {
        dac_link_copy(listing->hash, info + DAC_LINK_HASH, sizeof listing->hash);
        return true;
    }
#endif
    return false;
}

static bool same_text(const char *a, const char *b)
{
    unsigned at = 0;

    while (a[at] != '\0' && a[at] == b[at])
        at++;
    return a[at] == b[at];
}

/* Whether a text is the first digits of a hash. */
static bool begins(const char *text, const uint8_t *hash)
{
    unsigned at = 0;

    for (; at < 2 * DAC_LINK_BYTES && text[at] != '\0'; at++)
        if (text[at] != digits[at % 2 == 0 ? hash[at / 2] >> 4 : hash[at / 2] & 15])
            return false;
    return at >= SHORTEST && text[at] == '\0';
}

int32_t dac_link_find(const dac_link *l, const char *name)
{
    dac_link_listing listing;

    for (uint32_t number = 0; number < dac_link_numbers(l); number++)
        if (dac_link_list(l, number, &listing)
            && ((listing.name != NULL && same_text(name, listing.name)) || begins(name, listing.hash)))
            return (int32_t)number;
    return -1;
}

static dac_link_finding load(dac_link *l, uint32_t number)
{
    const dac_library_entry *const entry = compiled(l, number);

    if (entry != NULL)
        return load_compiled(l, entry);
#if DAC_STORE
    if (l->config->store != NULL)
        return dac_link_load_slot(l, slot_of(l, number));
#endif
    return dac_link_because(DAC_LINK_NO_NUMBER, 0);
}

/* Puts a program where an upload goes, to be checked by dac_link_work(). */
static dac_link_finding start(dac_link *l, uint32_t number, uint8_t mode)
{
    const dac_link_finding found = load(l, number);

    if (found.reason != DAC_LINK_NO_REASON) {
        l->upload = DAC_LINK_NONE;
        return found;
    }
    l->upload = DAC_LINK_CHECKING;
    l->committing = l->loading = true;
    l->commit_is_last = false;
#if DAC_COMMIT_MODES
    l->commit_mode = mode;
#else
    (void)mode;
#endif
    dac_link_start_check(&l->check);
    return found;
}

static bool play(dac_link *l, uint32_t number, uint8_t mode)
{
    if (l->config == NULL || l->upload != DAC_LINK_NONE || !dac_link_permits(l))
        return false;
    return start(l, number, mode).reason == DAC_LINK_NO_REASON;
}

bool dac_link_play(dac_link *l, uint32_t number)
{
    return play(l, number, 0);
}

#if DAC_COMMIT_MODES
bool dac_link_play_at(dac_link *l, uint32_t number, dac_commit_mode mode)
{
    return play(l, number, (uint8_t)mode);
}
#endif

#if DAC_LIBRARY > 1
/* Requests of a host (docs/protocol.md, "Programs by number"). */

static uint32_t number_of(const uint8_t *payload)
{
    return payload[0] | (uint32_t)payload[1] << 8;
}

static void put_number(uint8_t *at, uint32_t number)
{
    const uint32_t most = number < 0xFFFFu ? number : 0xFFFFu;

    at[0] = (uint8_t)most;
    at[1] = (uint8_t)(most >> 8);
}

dac_link_finding dac_link_list_number(const dac_link *l, const uint8_t *payload, dac_link_answer *a)
{
    const uint32_t number = number_of(payload);
    dac_link_listing listing;
    uint8_t length = 0;

    if (number >= dac_link_numbers(l))
        return dac_link_because(DAC_LINK_NO_NUMBER, dac_link_numbers(l));
    const bool listed = dac_link_list(l, number, &listing);
    for (; listed && listing.name != NULL && length < LONGEST && listing.name[length] != '\0'; length++)
        a->payload[LISTING + length] = (uint8_t)listing.name[length];
    put_number(a->payload, dac_link_numbers(l));
    put_number(a->payload + 2, l->config->library_programs);
    a->payload[4] = listed ? 1 : 0;
    a->payload[5] = length;
    for (unsigned i = 0; i < sizeof listing.hash; i++)
        a->payload[LISTED_HASH + i] = listed ? listing.hash[i] : 0;
    a->length = (uint8_t)(LISTING + length);
    return dac_link_fine();
}

dac_link_finding dac_link_play_number(dac_link *l, const uint8_t *payload, dac_link_answer *a)
{
    const uint32_t number = number_of(payload);
    dac_link_listing listing;

    if (l->upload > DAC_LINK_RECEIVING || !dac_sequencer_writable(l->sequencer))
        return dac_link_because(DAC_LINK_BUSY, 0);
    if (!dac_link_list(l, number, &listing))
        return dac_link_because(DAC_LINK_NO_NUMBER, dac_link_numbers(l));
    if (!dac_link_permits(l))
        return dac_link_because(DAC_LINK_INTERLOCK, 0);
    l->upload = DAC_LINK_NONE; /* what was received is forgotten, as by the BEGIN of another image */
    const dac_link_finding found = start(l, number, payload[2]);
    if (found.reason == DAC_LINK_NO_REASON) {
        l->asked = l->commit_is_last = true;
        l->commit_seq = l->last.seq;
        l->commit_session = l->session;
        a->type = DAC_LINK_SILENT;
    }
    return found;
}
#endif

#endif
