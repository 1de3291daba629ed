/* An image in memory: its program words, then tables or Fourier words where the application has them. */
#include "dac_link_parts.h"

static unsigned word_bytes(unsigned word_bits)
{
    return word_bits <= 16 ? 2 : 3;
}

static uint32_t most_of(const dac_link_config *config, const dac_link_axis *axis)
{
    const uint32_t bytes = word_bytes(axis->word_bits);
#if DAC_SLOW_PART
    const uint32_t slow = (UINT32_C(1) << axis->index_bits) + (bytes << config->slow_index_bits)
                        + config->slow_knots * UINT32_C(5);
    const uint32_t table = (bytes << axis->index_bits) + (config->slow_knots != 0 ? slow : 0);
#else
    const uint32_t table = bytes << axis->index_bits;
#endif
    const uint32_t fourier = config->harmonics ? 4 * (2 * (uint32_t)config->harmonics + 1) : 0;
    return table > fourier ? table : fourier;
}

uint32_t dac_link_most_bytes(const dac_link_config *config)
{
#if DAC_PIXEL_TABLE
    const uint32_t pixels = UINT32_C(4) * config->table_pixels;
#else
    const uint32_t pixels = 0;
#endif
    return DAC_LINK_PROGRAM + most_of(config, &config->x) + most_of(config, &config->y) + pixels;
}

uint32_t dac_link_table_words(const dac_link_image *image, unsigned axis)
{
    const unsigned index_bits = dac_link_index_bits(image, axis);

    if (index_bits != 0)
        return UINT32_C(1) << index_bits;
    return dac_link_program_word(image, axis + 1, DAC_LINK_PHASE_PERIOD);
}

static dac_link_part table_of(const dac_link_image *image, unsigned axis)
{
    const uint8_t bytes = (uint8_t)word_bytes(dac_link_shape(image, axis)[1]);
    const dac_link_part part = {dac_link_table_words(image, axis), bytes, 0};
    return part;
}

#if DAC_SLOW_PART
enum { TABLE, SECOND, SLOW_TABLE, GAINS, RATIOS };

/* Whether the device plays the slow part of an axis, if it has one. */
static bool has_room_for_slow(const dac_link *l, const dac_link_image *image, unsigned axis)
{
    const uint32_t slow = dac_link_slow_word(l, image, axis), knots = slow & 255u, index_bits = slow >> 8;
    const unsigned most = (dac_link_shape(image, axis)[0] & DAC_CUBIC) != 0 ? 14 : 8;

    return slow == 0
        || (knots >= 2 && knots <= l->config->slow_knots && index_bits >= 3 && index_bits <= l->config->slow_index_bits
            && dac_link_shape(image, axis)[0] != 0 && dac_link_index_bits(image, axis) <= most
            && dac_link_shape(image, axis)[1] <= 21);
}

/* The parts of an axis behind its table; without a slow part they have no words. */
static void list_slow(const dac_link *l, const dac_link_image *image, unsigned axis, dac_link_part *parts)
{
    const uint32_t slow = dac_link_slow_word(l, image, axis), knots = slow & 127u;
    const dac_link_part none = {0, 1, 0};
    const dac_link_part second = {parts[TABLE].words, 1, 0};
    const dac_link_part table = {UINT32_C(1) << (slow >> 8 & 15u), (uint8_t)word_bytes(dac_link_shape(image, axis)[1]),
                                 0};
    const dac_link_part gains = {knots, 3, 0}, ratios = {knots, 2, 0};

    parts[SECOND] = slow != 0 ? second : none;
    parts[SLOW_TABLE] = slow != 0 ? table : none;
    parts[GAINS] = slow != 0 ? gains : none;
    parts[RATIOS] = slow != 0 ? ratios : none;
}

/* The slow part of an axis of the upload, as the sequencer wants it. */
static void place_slow(dac_link *l, unsigned axis)
{
    const dac_link_image *const image = &l->image[l->idle];
    const dac_link_axis *const here = dac_link_axis_of(l, axis);
    const dac_link_slow *const memory = &here->slow[l->idle];
    const uint32_t slow = dac_link_slow_word(l, image, axis);
    dac_slow_part *const s = &l->slow[l->idle][axis];

    s->gains = memory->gains;
    s->ratios = memory->ratios;
    s->second = memory->second;
    s->mixed = here->mixed;
    s->table = memory->table;
    s->gain_spacing = s->ratio_spacing = dac_link_program_word(image, axis + 1, DAC_LINK_KNOT_SPACING);
    s->gain_knots = s->ratio_knots = (uint8_t)(slow & 127u);
    s->index_bits = (uint8_t)(slow >> 8 & 15u);
    s->gain_word = (int32_t)dac_link_program_word(image, axis + 1, DAC_LINK_GAIN);
    s->offset_word = dac_link_offset_word(image, axis);
}
#endif

#if DAC_PIXEL_TABLE
#define PIXEL_PART (DAC_LINK_END - 1)

static bool has_room_for_pixels(const dac_link *l, const dac_link_image *image)
{
    const uint32_t word = dac_link_pixel_word(l, image), pixels = dac_link_program_word(image, 0, DAC_LINK_PIXELS);

    return word == 0 || (word == 1 && pixels >= 1 && pixels <= l->config->table_pixels);
}

/* The table of pixels: of the trace, then of the retrace. Without one it has no words. */
static dac_link_part pixels_of(const dac_link *l, const dac_link_image *image)
{
    const uint32_t words = 2 * dac_link_program_word(image, 0, DAC_LINK_PIXELS);
    const dac_link_part part = {dac_link_pixel_word(l, image) != 0 ? words : 0, 2, 0};
    return part;
}
#endif

static uint32_t bytes_of(const dac_link_part *parts)
{
    uint32_t bytes = 0;

    for (unsigned i = 0; i < DAC_LINK_PARTS; i++)
        bytes += parts[i].words * parts[i].bytes;
    return bytes;
}

/* The program words are complete: computes what follows them. */
static dac_link_finding lay_out(dac_link *l)
{
    const dac_link_image *const image = &l->image[l->idle];
    uint32_t bytes = DAC_LINK_PROGRAM;

    for (unsigned axis = 0; axis < 2; axis++) {
        const uint32_t harmonics = dac_link_program_word(image, axis + 1, DAC_LINK_ORDER);
        const bool renders = dac_link_shape(image, axis)[0] != 0 && dac_link_slow_word(l, image, axis) == 0;
        const uint32_t most = renders ? l->config->harmonics : 0;
        dac_link_part *const part = axis == 0 ? l->x_part : l->y_part;
        const dac_link_part fourier = {2 * harmonics + 1, 4, (uint16_t)harmonics};
        if (harmonics > most)
            return dac_link_because(DAC_LINK_HARMONICS, most);
        *part = harmonics ? fourier : table_of(image, axis);
#if DAC_SLOW_PART
        list_slow(l, image, axis, part);
        place_slow(l, axis);
#endif
    }
    for (unsigned axis = 0; axis < 2; axis++) {
        if (dac_link_table_words(image, axis) > UINT32_C(1) << dac_link_axis_of(l, axis)->index_bits)
            return dac_link_because(DAC_LINK_SHAPE, axis);
#if DAC_SLOW_PART
        if (!has_room_for_slow(l, image, axis))
            return dac_link_because(DAC_LINK_SHAPE, axis);
#endif
    }
    bytes += bytes_of(l->x_part) + bytes_of(l->y_part);
#if DAC_PIXEL_TABLE
    if (!has_room_for_pixels(l, image))
        return dac_link_because(DAC_LINK_SHAPE, 0);
    l->y_part[DAC_LINK_PARTS] = pixels_of(l, image);
    bytes += 2 * l->y_part[DAC_LINK_PARTS].words;
#endif
    return bytes == dac_link_get(image->info + DAC_LINK_BYTES) ? dac_link_fine()
                                                              : dac_link_because(DAC_LINK_LENGTH, bytes);
}

/* A part behind the program words. */
static const dac_link_part *part_at(unsigned part, const dac_link_part *x, const dac_link_part *y)
{
    return part <= DAC_LINK_PARTS ? x + (part - 1) : y + (part - 1 - DAC_LINK_PARTS);
}

static unsigned axis_at(unsigned part)
{
    return part <= DAC_LINK_PARTS ? 0 : 1;
}

/* Advances to the next byte, for parts of these sizes. */
static void next(dac_link_place *at, const dac_link_part *x, const dac_link_part *y)
{
    static const dac_link_part program = {DAC_LINK_PROGRAM, 1, 0};
    const dac_link_part *const part = at->part == 0 ? &program : part_at(at->part, x, y);

    if (++at->byte != part->bytes)
        return;
    at->byte = 0;
    at->held = 0;
    if (++at->word != part->words)
        return;
    at->word = 0;
    do
        at->part++;
    while (at->part != DAC_LINK_END && part_at(at->part, x, y)->words == 0);
}

static int32_t extended(uint32_t word, unsigned bytes)
{
    const unsigned shift = 32 - 8 * bytes;
    return (int32_t)(word << shift) >> shift;
}

/* A word of a part, in the memory of an image. */
static void put_word(const dac_link_axis *axis, unsigned image, unsigned part, uint32_t at, int32_t word)
{
#if DAC_SLOW_PART
    switch ((part - 1) % DAC_LINK_PARTS) {
    case SECOND:
        axis->slow[image].second[at] = (int8_t)word;
        return;
    case SLOW_TABLE:
        axis->slow[image].table[at] = (dac_word)word;
        return;
    case GAINS:
        axis->slow[image].gains[at] = word;
        return;
    case RATIOS:
        axis->slow[image].ratios[at] = (int16_t)word;
        return;
    default:
        break;
    }
#else
    (void)part;
#endif
    axis->table[image][at] = (dac_word)word;
}

static int32_t word_at(const dac_link_axis *axis, unsigned image, unsigned part, uint32_t at)
{
#if DAC_SLOW_PART
    switch ((part - 1) % DAC_LINK_PARTS) {
    case SECOND:
        return axis->slow[image].second[at];
    case SLOW_TABLE:
        return axis->slow[image].table[at];
    case GAINS:
        return axis->slow[image].gains[at];
    case RATIOS:
        return axis->slow[image].ratios[at];
    default:
        break;
    }
#else
    (void)part;
#endif
    return axis->table[image][at];
}

/* A word of a part of the program that plays. */
static int32_t playing_word(const dac_link *l, unsigned part, uint32_t at)
{
    const unsigned axis = axis_at(part);

#if DAC_LINK_MOVES_SLOW
    if (l->moved && (part - 1) % DAC_LINK_PARTS == GAINS)
        return l->slow[DAC_LINK_MOVED_SLOW + l->moved_slow][axis].gains[at];
#endif
    return word_at(dac_link_axis_of(l, axis), l->playing, part, at);
}

dac_link_finding dac_link_store(dac_link *l, uint8_t byte)
{
    dac_link_place *const at = &l->place;

    if (at->part == 0) {
        dac_link_finding found = dac_link_fine();
        l->image[l->idle].program[at->word] = byte;
        if (at->word == DAC_LINK_PROGRAM - 1)
            found = lay_out(l);
        l->received++;
        next(at, l->x_part, l->y_part);
        return found;
    }
    const dac_link_part *const part = part_at(at->part, l->x_part, l->y_part);
    const dac_link_axis *const axis = dac_link_axis_of(l, axis_at(at->part));
    at->held |= (uint32_t)byte << 8 * at->byte;
    if (at->byte == part->bytes - 1) {
        if (part->harmonics)
            axis->fourier[at->word] = extended(at->held, 4);
#if DAC_PIXEL_TABLE
        else if (at->part == PIXEL_PART)
            l->config->pixel_ticks[l->idle][at->word] = (uint16_t)at->held;
#endif
        else
            put_word(axis, l->idle, at->part, at->word, extended(at->held, part->bytes));
    }
    l->received++;
    next(at, l->x_part, l->y_part);
    return dac_link_fine();
}

uint8_t dac_link_load_byte(const dac_link *l, dac_link_place *at)
{
    const unsigned shift = 8u * at->byte;
    uint32_t word;

    if (at->part == 0) {
        word = l->image[l->idle].program[at->word];
#if DAC_PIXEL_TABLE
    } else if (at->part == PIXEL_PART) {
        word = l->config->pixel_ticks[l->idle][at->word];
#endif
    } else {
        const dac_link_axis *const axis = dac_link_axis_of(l, axis_at(at->part));
        const bool fourier = part_at(at->part, l->x_part, l->y_part)->harmonics != 0;
        word = (uint32_t)(fourier ? axis->fourier[at->word] : word_at(axis, l->idle, at->part, at->word));
    }
    next(at, l->x_part, l->y_part);
    return (uint8_t)(word >> shift);
}

#if DAC_LINK_Z
uint32_t dac_link_read_back_bytes(const dac_link *l)
{
    const dac_link_image *const image = &l->image[l->playing];
    uint32_t bytes = DAC_LINK_PROGRAM;

    for (unsigned axis = 0; axis < 2; axis++) {
        dac_link_part part[DAC_LINK_PARTS];
        part[0] = table_of(image, axis);
#if DAC_SLOW_PART
        list_slow(l, image, axis, part);
#endif
        bytes += bytes_of(part);
    }
#if DAC_PIXEL_TABLE
    bytes += 2 * pixels_of(l, image).words;
#endif
    return bytes;
}
#endif

uint8_t dac_link_read_back(const dac_link *l, uint32_t offset, uint8_t *bytes, uint8_t count)
{
    const dac_link_image *const image = &l->image[l->playing];
    dac_link_part x[DAC_LINK_PARTS], y[DAC_LINK_Y_PARTS];
    dac_link_place at = {0, 0, offset, 0};
    uint8_t done = 0;

    x[0] = table_of(image, 0);
    y[0] = table_of(image, 1);
#if DAC_SLOW_PART
    list_slow(l, image, 0, x);
    list_slow(l, image, 1, y);
#endif
#if DAC_PIXEL_TABLE
    y[DAC_LINK_PARTS] = pixels_of(l, image);
#endif
    if (offset >= DAC_LINK_PROGRAM) {
        uint32_t rest = offset - DAC_LINK_PROGRAM;
        for (at.part = 1; at.part != DAC_LINK_END; at.part++) {
            const dac_link_part *const part = part_at(at.part, x, y);
            if (rest < part->words * part->bytes) {
                at.word = rest / part->bytes;
                at.byte = (uint8_t)(rest % part->bytes);
                break;
            }
            rest -= part->words * part->bytes;
        }
    }
    for (; done != count && at.part != DAC_LINK_END; done++) {
        const unsigned shift = 8u * at.byte;
        uint32_t word;
#if DAC_PIXEL_TABLE
        if (at.part == PIXEL_PART)
            word = l->config->pixel_ticks[l->playing][at.word];
        else
#endif
        if (at.part != 0)
            word = (uint32_t)playing_word(l, at.part, at.word);
        else if (at.word >= 64 && at.word % 64 / 4 == DAC_LINK_ORDER)
            word = 0; /* the active program plays a table, even if Fourier words were sent */
        else
            word = image->program[at.word];
        bytes[done] = (uint8_t)(word >> shift);
        next(&at, x, y);
    }
    return done;
}

void dac_link_program_of(const dac_link *l, dac_program *p)
{
    const dac_link_image *const image = &l->image[l->idle];
    dac_schedule *const s = &p->schedule;
    dac_window *const windows[] = {&s->forward, &s->backward, &s->up, &s->down};

    s->line_ticks = dac_link_program_word(image, 0, DAC_LINK_LINE_TICKS);
    s->frame_lines = dac_link_program_word(image, 0, DAC_LINK_FRAME_LINES);
    s->settle_lines = dac_link_program_word(image, 0, DAC_LINK_SETTLE_LINES);
    s->turn_tick = dac_link_program_word(image, 0, DAC_LINK_TURN_TICK);
    s->pixels = dac_link_program_word(image, 0, DAC_LINK_PIXELS);
#if DAC_PIXEL_TABLE
    s->pixel_table = dac_link_pixel_word(l, image) != 0 ? l->config->pixel_ticks[dac_link_tables(l)] : NULL;
#endif
    for (unsigned i = 0; i < 4; i++) {
        windows[i]->first = dac_link_program_word(image, 0, DAC_LINK_FORWARD + 2 * i);
        windows[i]->count = dac_link_program_word(image, 0, DAC_LINK_FORWARD + 2 * i + 1);
    }
    for (unsigned axis = 0; axis < 2; axis++) {
        const dac_link_axis *const here = dac_link_axis_of(l, axis);
        const uint8_t *const shape = dac_link_shape(image, axis);
        dac_axis_program *const a = axis == 0 ? &p->x : &p->y;
        const unsigned page = axis + 1, guard = shape[1] > 21 ? 25u - shape[1] : 4u;
        const bool held = axis == 1 && dac_link_program_word(image, 0, DAC_LINK_Y_STEPS) != 0;
        a->table = here->table[dac_link_tables(l)];
        a->length = dac_link_table_words(image, axis);
        a->storage_bits = DAC_TABLE_STORAGE_BITS;
        a->bits = shape[1];
        a->index_bits = shape[0];
        a->phase_period = dac_link_program_word(image, page, DAC_LINK_PHASE_PERIOD);
        a->hold_ticks = held ? s->line_ticks : 1;
        a->gain_word = (int32_t)dac_link_program_word(image, page, DAC_LINK_GAIN);
        a->offset_word = dac_link_offset_word(image, axis);
        a->gain_q = (uint8_t)(16u + shape[1] + guard - shape[2]);
        a->code_min = (int32_t)dac_link_program_word(image, page, DAC_LINK_CODE_MIN);
        a->code_max = (int32_t)dac_link_program_word(image, page, DAC_LINK_CODE_MAX);
        a->park_code = (int32_t)dac_link_program_word(image, page, DAC_LINK_PARK_CODE);
        a->max_step = (int32_t)dac_link_program_word(image, page, DAC_LINK_MAX_STEP);
        a->dac_bits = shape[2];
        a->word_bits = here->converter.word_bits;
        a->twos_complement = here->converter.twos_complement;
        a->left_aligned = here->converter.left_aligned;
#if DAC_SHAPING
        a->shaping_order = dac_link_program_word(image, page, DAC_LINK_SHAPING_WORD) & 3;
        a->shaping_zero = (uint8_t)(dac_link_program_word(image, page, DAC_LINK_SHAPING_WORD) >> 8);
#endif
#if DAC_SLOW_PART
        a->slow = dac_link_slow_word(l, image, axis) != 0 ? &l->slow[dac_link_slow_at(l)][axis] : NULL;
#endif
    }
}
