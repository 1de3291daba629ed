/* A whole device on this machine. */
#include "link_device.h"

#include <stdlib.h>
#include <string.h>

/* Interlocks have no argument: that of the device which works now. */
static bool permits_now;

static bool permits(void)
{
    return permits_now;
}

/* So has a clock: one for all devices. */
static uint32_t milliseconds_now;

static uint32_t milliseconds(void)
{
    return milliseconds_now;
}

void device_set_clock(uint32_t now)
{
    milliseconds_now = now;
}

static void *place(size_t count, size_t size)
{
    void *const memory = calloc(count, size);
    if (memory == NULL)
        abort();
    return memory;
}

static void furnish(dac_link_axis *axis, const dac_converter *converter, const uint32_t *limits, uint8_t word_bits,
                    uint8_t index_bits, uint16_t harmonics)
{
    axis->converter = *converter;
    axis->limits.code_min = limits[0];
    axis->limits.code_max = limits[1];
    axis->limits.max_step = limits[2];
    axis->limits.max_jump = limits[3];
    axis->word_bits = word_bits;
    axis->index_bits = index_bits;
    axis->room = DAC_TABLE_ROOM(index_bits);
    for (unsigned i = 0; i < 2; i++)
        axis->table[i] = place(DAC_TABLE_ROOM(index_bits), sizeof(dac_word));
    axis->fourier = place(2u * harmonics + 1, sizeof(int32_t));
#if DAC_SLOW_PART
    for (unsigned i = 0; i < 2; i++) {
        axis->slow[i].second = place((size_t)1 << index_bits, 1);
        axis->slow[i].table = place(DAC_LINK_SLOW_ROOM(SLOW_INDEX_BITS), sizeof(dac_word));
        axis->slow[i].gains = place(SLOW_KNOTS, sizeof(int32_t));
        axis->slow[i].ratios = place(SLOW_KNOTS, sizeof(int16_t));
    }
    axis->mixed = place(DAC_TABLE_ROOM(index_bits), sizeof(dac_word));
#endif
#if DAC_LINK_MOVES_SLOW
    for (unsigned i = 0; i < 2; i++)
        axis->moved_gains[i] = place(SLOW_KNOTS, sizeof(int32_t));
#endif
}

#if DAC_LINK_Z
/* The ticks of this device come from this thread: it only looks that they are stopped in pairs. */
static bool stopped_now;
static uint32_t stops;

static void stop_ticks(bool stopped)
{
    if (stopped == stopped_now)
        abort();
    stopped_now = stopped;
    stops += stopped;
}
#endif

device *device_new(const device_setup *setup, uint32_t boot)
{
    device *const d = place(1, sizeof *d);
    dac_link_config *const c = &d->config;

    d->setup = *setup;
    furnish(&c->x, &setup->x_converter, setup->x_limits, setup->x_word_bits, setup->x_index_bits, setup->harmonics);
    furnish(&c->y, &setup->y_converter, setup->y_limits, setup->y_word_bits, setup->y_index_bits, setup->harmonics);
#if DAC_SLOW_PART
    c->slow_knots = SLOW_KNOTS;
    c->slow_index_bits = SLOW_INDEX_BITS;
#endif
#if DAC_PIXEL_TABLE
    c->table_pixels = TABLE_PIXELS;
    for (unsigned i = 0; i < 2; i++)
        c->pixel_ticks[i] = place((size_t)2 * TABLE_PIXELS, sizeof(uint16_t));
#endif
    c->harmonics = setup->harmonics;
    c->sine = setup->sine;
    c->sine_index_bits = setup->sine_index_bits;
    c->update_rate_hz = setup->update_rate_hz;
    c->window = setup->window;
    c->key = d->setup.key;
    c->key_bytes = setup->key_bytes;
    c->hash = setup->knows_hash ? d->setup.hash : NULL;
    c->permits = setup->has_interlock ? permits : NULL;
    c->random = setup->random;
    c->identity = d->setup.identity;
    c->identity_bytes = setup->identity_bytes;
    c->boot_persists = setup->boot_persists;
    c->milliseconds = milliseconds;
#if DAC_LINK_Z
    c->stop_ticks = stop_ticks;
#endif
    d->permits = true;
    device_start(d, boot);
    return d;
}

#if DAC_SLOW_PART
/* From now on the link has no memory for slow parts. */
void device_refuse_slow(device *d)
{
    d->config.slow_knots = 0;
}

static void free_slow(const dac_link_axis *axis)
{
    for (unsigned i = 0; i < 2; i++) {
        free(axis->slow[i].second);
        free(axis->slow[i].table);
        free(axis->slow[i].gains);
        free(axis->slow[i].ratios);
    }
    free(axis->mixed);
#if DAC_LINK_MOVES_SLOW
    for (unsigned i = 0; i < 2; i++)
        free(axis->moved_gains[i]);
#endif
}
#endif

#if DAC_LINK_Z
/* From now on the device has a second sequencer, and starts again. */
dac_link_started device_add_z(device *d, const device_setup *setup, bool plays)
{
    dac_link_config *const c = &d->z_config;

    furnish(&c->x, &setup->x_converter, setup->x_limits, setup->x_word_bits, setup->x_index_bits, 0);
    furnish(&c->y, &setup->y_converter, setup->y_limits, setup->y_word_bits, setup->y_index_bits, 0);
#if DAC_SLOW_PART
    c->slow_knots = SLOW_KNOTS;
    c->slow_index_bits = SLOW_INDEX_BITS;
#endif
    d->z_boot_program = setup->boot_program;
    d->has_z = true;
    d->plays_z = plays;
    device_start(d, d->boot);
    return d->started;
}

static void start_z(device *d)
{
    memset(&d->z_log, 0, sizeof d->z_log);
    d->apart = 0;
    if (!dac_sequencer_init(&d->z_sequencer, &d->z_config.x.converter, &d->z_config.y.converter))
        abort();
    d->started = dac_link_init_z(&d->link, &d->z_link, &d->z_config, &d->z_sequencer, d->plays_z);
    if (d->z_boot_program != NULL
        && (dac_sequencer_load(&d->z_sequencer, d->z_boot_program) != DAC_LOADED
            || !dac_sequencer_commit(&d->z_sequencer)))
        abort();
}

/* A request of the application: 0 park, 1 arm, 2 trigger. */
bool device_request(device *d, unsigned request, uint32_t frames)
{
    return request == 0 ? dac_link_park(&d->link)
         : request == 1 ? dac_link_arm(&d->link, frames) : dac_link_trigger(&d->link);
}

uint32_t device_stops(void)
{
    return stops;
}

uint32_t device_apart(const device *d)
{
    return d->apart;
}

/* From now on every tick is noted; with NULL none. */
void device_watch(device *d, tick_record *to)
{
    d->watched = to;
    d->watched_ticks = 0;
}

size_t device_z_records(device *d, line_record *records)
{
    const size_t count = d->z_records;
    if (records != NULL && count != 0) {
        memcpy(records, d->z_record, count * sizeof *records);
        d->z_records = 0;
    }
    return count;
}

/* Why a link gets no z that has one fault in its configuration; 0 is none. */
dac_link_started device_z_refusal(device *d, unsigned fault)
{
    static dac_link first, second;
    static dac_sequencer sequencer;
    dac_link_config c = d->config, z = d->z_config;
    dac_link *with = &second;
    dac_sequencer *of_z = &sequencer;

    switch (fault) {
    case 1: z.x.word_bits = 7; break;
    case 2: z.key_bytes = 16; z.key = d->setup.key; z.identity = d->setup.identity; z.identity_bytes = 4;
            z.boot_persists = true; z.milliseconds = milliseconds; break;
    case 3: z.harmonics = 1; z.sine = d->setup.sine; z.sine_index_bits = 16; break;
    case 4: z.permits = permits; break;
    case 5: c.stop_ticks = NULL; break;
    case 6: of_z = &d->sequencer; break;
    case 7: c.x.word_bits = 7; break;
#if DAC_PIXEL_TABLE
    case 8: z.table_pixels = 1; z.pixel_ticks[0] = c.pixel_ticks[0]; z.pixel_ticks[1] = c.pixel_ticks[1]; break;
#endif
    default: break;
    }
    (void)dac_link_init(&first, &c, &d->sequencer, 0);
    return dac_link_init_z(&first, with, &z, of_z, false);
}

static void free_z(device *d)
{
    for (unsigned i = 0; i < 2; i++) {
        free(d->z_config.x.table[i]);
        free(d->z_config.y.table[i]);
    }
#if DAC_SLOW_PART
    free_slow(&d->z_config.x);
    free_slow(&d->z_config.y);
#endif
    free(d->z_config.x.fourier);
    free(d->z_config.y.fourier);
    free(d->z_record);
}
#endif

void device_delete(device *d)
{
#if DAC_LINK_Z
    free_z(d);
#endif
    for (unsigned i = 0; i < 2; i++) {
        free(d->config.x.table[i]);
        free(d->config.y.table[i]);
    }
#if DAC_SLOW_PART
    free_slow(&d->config.x);
    free_slow(&d->config.y);
#endif
#if DAC_PIXEL_TABLE
    free(d->config.pixel_ticks[0]);
    free(d->config.pixel_ticks[1]);
#endif
    free(d->config.x.fourier);
    free(d->config.y.fourier);
    free(d->record);
    free(d);
}

void device_start(device *d, uint32_t boot)
{
    memset(&d->log, 0, sizeof d->log);
    d->sent = 0;
    d->boot = boot;
    if (!dac_sequencer_init(&d->sequencer, &d->config.x.converter, &d->config.y.converter))
        abort();
#if DAC_STORE
    d->config.store = d->flash.slots != 0 && dac_store_open(&d->store, &d->flash) == DAC_STORE_DONE ? &d->store : NULL;
#endif
    d->started = dac_link_init(&d->link, &d->config, &d->sequencer, boot);
#if DAC_LINK_Z
    if (d->has_z && d->started == DAC_LINK_STARTED)
        start_z(d);
#endif
#if DAC_STORE
    if (dac_link_load_kept(&d->link))
        return;
#endif
    if (d->setup.boot_program == NULL)
        return;
    if (dac_sequencer_load(&d->sequencer, d->setup.boot_program) != DAC_LOADED || !dac_sequencer_commit(&d->sequencer))
        abort();
}

#if DAC_STORE
/* From now on the device has a flash, and starts again. */
void device_keep(device *d, const dac_store_flash *flash, bool while_playing)
{
    d->flash = *flash;
    d->config.store_while_playing = while_playing;
    device_start(d, d->boot);
}
#endif

#if DAC_LIBRARY
/* From now on the device has one compiled program more; all that it points to stays where it is. */
void device_compile(device *d, const char *name, const char *hash, const dac_program *program)
{
    dac_library_entry *const entry = &d->compiled[d->config.library_programs];

    if (d->config.library_programs == COMPILED)
        abort();
    entry->name = name;
    entry->hash = hash;
    entry->program = *program;
    d->config.library = d->compiled;
    d->config.library_programs++;
}

bool device_play(device *d, uint32_t number)
{
    permits_now = d->permits;
    return dac_link_play(&d->link, number);
}

#if DAC_COMMIT_MODES
bool device_play_at(device *d, uint32_t number, uint32_t mode)
{
    permits_now = d->permits;
    return dac_link_play_at(&d->link, number, (dac_commit_mode)mode);
}
#endif

uint32_t device_numbers(const device *d)
{
    return dac_link_numbers(&d->link);
}

bool device_list(const device *d, uint32_t number, dac_link_listing *listing)
{
    return dac_link_list(&d->link, number, listing);
}

int32_t device_find(const device *d, const char *name)
{
    return dac_link_find(&d->link, name);
}
#endif

void device_permit(device *d, bool permitted)
{
    d->permits = permitted;
}

/* Nothing leaves. */
void device_stall(device *d, bool stalled)
{
    d->stalled = stalled;
}

/* Into the ring; returns how many had room. */
size_t device_feed(device *d, const uint8_t *bytes, size_t count)
{
    size_t taken = 0;
    for (size_t i = 0; i < count; i++)
        taken += dac_link_receive(&d->link, bytes[i]);
    return taken;
}

/* The main loop, so many times, or until there is nothing to do; returns how many times it went round. */
unsigned device_run(device *d, unsigned most)
{
    unsigned times = 0;
    int byte;

    permits_now = d->permits;
    for (bool more = true; more && times != most; times++) {
        more = dac_link_work(&d->link);
        while (!d->stalled && (byte = dac_link_transmit(&d->link)) >= 0) {
            if (d->sent == OUT)
                abort();
            d->out[d->sent++] = (uint8_t)byte;
            more = true;
        }
    }
    return times;
}

static void keep(line_record **records, size_t *count, size_t *room, const line_record *ended)
{
    if (*count == *room) {
        *room = 2 * *room + 64;
        *records = realloc(*records, *room * sizeof **records);
        if (*records == NULL)
            abort();
    }
    (*records)[(*count)++] = *ended;
}

#if DAC_LINK_Z
/* The tick of z that belongs to one of x and y. */
static void tick_z(device *d, const dac_tick *of_x_y)
{
    const uint8_t markers = of_x_y->markers;
    const uint8_t common = DAC_PLAYING | DAC_LINE | DAC_FRAME | DAC_BACKWARD;
    const uint8_t faults = dac_sequencer_status(&d->z_sequencer).faults;
    dac_tick tick;
    line_record ended;

    if (stopped_now)
        abort();
    dac_sequencer_step(&d->z_sequencer, &tick);
    if (d->watched != NULL) {
        const tick_record record = {of_x_y->x, of_x_y->y, tick.x, markers, tick.markers};
        d->watched[d->watched_ticks++] = record;
    }
    if (line_tick(&d->z_log, tick.x, tick.y, tick.markers, faults, &ended))
        keep(&d->z_record, &d->z_records, &d->z_room, &ended);
    if (d->link.plays_z && ((tick.markers ^ markers) & common) != 0)
        d->apart++;
    if (!d->link.plays_z && (tick.markers & DAC_PLAYING) != 0)
        d->apart++;
}
#endif

/* So many samples, after each of them the main loop at most `work` times. */
void device_tick(device *d, uint32_t ticks, unsigned work)
{
    for (; ticks != 0; ticks--) {
        dac_tick tick;
        line_record ended;
        const uint8_t faults = dac_sequencer_status(&d->sequencer).faults;
        dac_sequencer_step(&d->sequencer, &tick);
        if (line_tick(&d->log, tick.x, tick.y, tick.markers, faults, &ended))
            keep(&d->record, &d->records, &d->room, &ended);
#if DAC_LINK_Z
        if (d->has_z)
            tick_z(d, &tick);
#endif
        device_run(d, work);
    }
}

/* Requests act, as on a core that is about to ask for samples; no tick follows. */
void device_answer(device *d)
{
    dac_sequencer_answer(&d->sequencer);
#if DAC_LINK_Z
    if (d->has_z)
        dac_sequencer_answer(&d->z_sequencer);
#endif
}

size_t device_take(device *d, uint8_t *bytes)
{
    const size_t sent = d->sent;
    if (bytes != NULL) {
        memcpy(bytes, d->out, sent);
        d->sent = 0;
    }
    return sent;
}

size_t device_records(device *d, line_record *records)
{
    const size_t count = d->records;
    if (records != NULL && count != 0) {
        memcpy(records, d->record, count * sizeof *records);
        d->records = 0;
    }
    return count;
}

/* Damage to the memory of the upload in hand. */
void device_poke(device *d, unsigned axis, uint32_t word, int32_t value)
{
    const dac_link_part *const part = axis == 0 ? d->link.x_part : d->link.y_part;
    const dac_link_axis *const here = dac_link_axis_of(&d->link, axis);
    if (part->harmonics != 0)
        here->fourier[word] = value;
    else
        here->table[d->link.idle][word] = (dac_word)value;
}

void device_report(device *d, uint8_t fault)
{
    dac_sequencer_report(&d->sequencer, fault);
}

dac_link_started device_started(const device *d)
{
    return d->started;
}

/* Why a link does not start whose configuration has one fault; fault 0 is none. */
dac_link_started device_refusal(const device *d, unsigned fault)
{
    static dac_link link;
    dac_link_config c = d->config;
    dac_link_axis *const axes[] = {&c.x, &c.y};

    for (unsigned i = 0; i < 2; i++) {
        dac_link_axis *const a = axes[i];
        const unsigned at = fault - 1 - i * AXIS_FAULTS;
        const uint32_t codes = UINT32_C(1) << a->converter.bits;
        switch (at) {
        case 0: a->converter.bits = 7; break;
        case 1: a->converter.bits = 25; break;
        case 2: a->converter.word_bits = (uint8_t)(a->converter.bits - 1); break;
        case 3: a->converter.word_bits = DAC_OUTPUT_STORAGE_BITS + 1; break;
        case 4: a->converter.power_up_code = -1; break;
        case 5: a->converter.power_up_code = (int32_t)codes; break;
        case 6: a->limits.code_min = a->limits.code_max + 1; break;
        case 7: a->limits.code_max = codes; break;
        case 8: a->limits.max_step = 0; break;
        case 9: a->word_bits = 7; break;
        case 10: a->word_bits = 25; break;
        case 11: a->word_bits = DAC_TABLE_STORAGE_BITS + 1; break;
        case 12: a->index_bits = 2; break;
        case 13: a->index_bits = 17; a->room = DAC_TABLE_ROOM(17); break;
        case 14: a->room--; break;
        case 15: a->table[0] = NULL; break;
        case 16: a->table[1] = NULL; break;
        case 17: a->table[1] = a->table[0]; break;
        case 18: a->fourier = NULL; break;
        case 19: c.sine_index_bits = (uint8_t)(a->index_bits - 1); break;
        default: break;
        }
    }
    switch (fault - 2 * AXIS_FAULTS) {
    case 1: c.harmonics = 4097; break;
    case 2: c.sine = NULL; break;
    case 3: c.sine_index_bits = 17; break;
    case 4: c.key_bytes = 15; break;
    case 5: c.key_bytes = 33; break;
    case 6: c.key = NULL; break;
    case 7: c.identity = NULL; break;
    case 8: c.identity_bytes = 3; break;
    case 9: c.identity_bytes = 33; break;
    case 10: c.random = NULL; c.boot_persists = false; break;
    case 11: c.milliseconds = NULL; break;
#if DAC_SLOW_PART
    case 12: c.slow_knots = 1; break;
    case 13: c.slow_knots = 66; break;
    case 14: c.slow_index_bits = 2; break;
    case 15: c.slow_index_bits = 15; break;
    case 16: c.x.slow[0].second = NULL; break;
    case 17: c.x.slow[1].table = NULL; break;
    case 18: c.y.slow[0].gains = NULL; break;
    case 19: c.y.slow[1].ratios = NULL; break;
    case 20: c.x.mixed = NULL; break;
    case 21: c.y.mixed = NULL; break;
    case 22: c.y.mixed = c.x.mixed; break;
#endif
#if DAC_PIXEL_TABLE
    case 23: c.pixel_ticks[0] = NULL; break;
    case 24: c.pixel_ticks[1] = NULL; break;
    case 25: c.pixel_ticks[1] = c.pixel_ticks[0]; break;
    case 26: c.table_pixels = 0; c.pixel_ticks[0] = NULL; break; /* none */
#endif
#if DAC_LINK_MOVES_SLOW
    case 27: c.x.moved_gains[0] = NULL; break;
    case 28: c.y.moved_gains[1] = NULL; break;
    case 29: c.y.moved_gains[0] = c.x.moved_gains[1]; break;
    case 30:
        for (unsigned i = 0; i < 2; i++)
            c.x.moved_gains[i] = c.y.moved_gains[i] = NULL; /* none */
        break;
#endif
    default: break;
    }
    const dac_link_started started = dac_link_init(&link, &c, (dac_sequencer *)&d->sequencer, 0);
    (void)dac_link_receive(&link, 0);
    if (started != DAC_LINK_STARTED && dac_link_work(&link))
        abort();
    return started;
}

uint32_t device_lost(const device *d)
{
    return d->link.lost;
}

int32_t device_table(const device *d, unsigned axis, unsigned which, uint32_t word)
{
    return dac_link_axis_of(&d->link, axis)->table[which][word];
}

size_t device_sizes(unsigned which)
{
    const size_t sizes[] = {sizeof(line_record), sizeof(device_setup), sizeof(dac_link), DAC_LINK_RING,
                            sizeof(dac_link_mac)};
    return sizes[which];
}
