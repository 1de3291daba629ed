/* An image in memory: its program words, then tables or Fourier words where the application has them. */
#include "dac_link_parts.h"

static unsigned word_bytes(unsigned word_bits)
{
    return word_bits <= 16 ? 2 : 3;
}

static uint32_t most_of(const dac_link_config *config, const dac_link_axis *axis)
{
    const uint32_t table = (uint32_t)word_bytes(axis->word_bits) << axis->index_bits;
    const uint32_t fourier = config->harmonics ? 4 * (2 * (uint32_t)config->harmonics + 1) : 0;
    return table > fourier ? table : fourier;
}

uint32_t dac_link_most_bytes(const dac_link_config *config)
{
    return DAC_LINK_PROGRAM + most_of(config, &config->x) + most_of(config, &config->y);
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

/* The program words are complete: computes what follows them. */
static dac_link_finding lay_out(dac_link *l)
{
    const dac_link_image *const image = &l->image[l->idle];
    uint32_t bytes = DAC_LINK_PROGRAM;

    for (unsigned axis = 0; axis < 2; axis++) {
        const uint32_t harmonics = dac_link_program_word(image, axis + 1, DAC_LINK_ORDER);
        const uint32_t most = dac_link_shape(image, axis)[0] ? l->config->harmonics : 0;
        dac_link_part *const part = axis == 0 ? &l->x_part : &l->y_part;
        const dac_link_part fourier = {2 * harmonics + 1, 4, (uint16_t)harmonics};
        if (harmonics > most)
            return dac_link_because(DAC_LINK_HARMONICS, most);
        *part = harmonics ? fourier : table_of(image, axis);
    }
    for (unsigned axis = 0; axis < 2; axis++)
        if (dac_link_table_words(image, axis) > UINT32_C(1) << dac_link_axis_of(l, axis)->index_bits)
            return dac_link_because(DAC_LINK_SHAPE, axis);
    bytes += l->x_part.words * l->x_part.bytes + l->y_part.words * l->y_part.bytes;
    return bytes == dac_link_get(image->info + DAC_LINK_BYTES) ? dac_link_fine()
                                                              : dac_link_because(DAC_LINK_LENGTH, bytes);
}

/* Advances to the next byte, for parts of these sizes. */
static void next(dac_link_place *at, const dac_link_part *x, const dac_link_part *y)
{
    static const dac_link_part program = {DAC_LINK_PROGRAM, 1, 0};
    const dac_link_part *const part = at->part == 0 ? &program : at->part == 1 ? x : y;

    if (++at->byte != part->bytes)
        return;
    at->byte = 0;
    at->held = 0;
    if (++at->word != part->words)
        return;
    at->word = 0;
    at->part++;
    if (at->part == 1 && x->words == 0) /* no valid program has this, but an image may */
        at->part++;
    if (at->part == 2 && y->words == 0)
        at->part++;
}

static int32_t extended(uint32_t word, unsigned bytes)
{
    const unsigned shift = 32 - 8 * bytes;
    return (int32_t)(word << shift) >> shift;
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
        next(at, &l->x_part, &l->y_part);
        return found;
    }
    const dac_link_part *const part = at->part == 1 ? &l->x_part : &l->y_part;
    const dac_link_axis *const axis = dac_link_axis_of(l, at->part - 1u);
    at->held |= (uint32_t)byte << 8 * at->byte;
    if (at->byte == part->bytes - 1) {
        if (part->harmonics)
            axis->fourier[at->word] = extended(at->held, 4);
        else
            axis->table[l->idle][at->word] = (dac_word)extended(at->held, part->bytes);
    }
    l->received++;
    next(at, &l->x_part, &l->y_part);
    return dac_link_fine();
}

uint8_t dac_link_load_byte(const dac_link *l, dac_link_place *at)
{
    const unsigned shift = 8u * at->byte;
    uint32_t word;

    if (at->part == 0) {
        word = l->image[l->idle].program[at->word];
    } else {
        const dac_link_axis *const axis = dac_link_axis_of(l, at->part - 1u);
        const bool fourier = (at->part == 1 ? &l->x_part : &l->y_part)->harmonics != 0;
        word = (uint32_t)(fourier ? axis->fourier[at->word] : axis->table[l->idle][at->word]);
    }
    next(at, &l->x_part, &l->y_part);
    return (uint8_t)(word >> shift);
}

uint8_t dac_link_read_back(const dac_link *l, uint32_t offset, uint8_t *bytes, uint8_t count)
{
    const dac_link_image *const image = &l->image[l->playing];
    const dac_link_part x = table_of(image, 0), y = table_of(image, 1);
    const uint32_t x_bytes = x.words * x.bytes;
    dac_link_place at = {0, 0, offset, 0};
    uint8_t done = 0;

    if (offset >= DAC_LINK_PROGRAM) {
        const bool in_x = offset - DAC_LINK_PROGRAM < x_bytes;
        const uint32_t rest = offset - DAC_LINK_PROGRAM - (in_x ? 0 : x_bytes), size = in_x ? x.bytes : y.bytes;
        at.part = in_x ? 1 : rest < y.words * y.bytes ? 2 : 3;
        at.word = rest / size;
        at.byte = (uint8_t)(rest % size);
    }
    for (; done != count && at.part != 3; done++) {
        const unsigned shift = 8u * at.byte;
        uint32_t word;
        if (at.part != 0)
            word = (uint32_t)dac_link_axis_of(l, at.part - 1u)->table[l->playing][at.word];
        else if (at.word >= 64 && at.word % 64 / 4 == DAC_LINK_ORDER)
            word = 0; /* the active program plays a table, even if Fourier words were sent */
        else
            word = image->program[at.word];
        bytes[done] = (uint8_t)(word >> shift);
        next(&at, &x, &y);
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
    s->pixel_table = NULL;
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
        a->table = here->table[l->idle];
        a->length = dac_link_table_words(image, axis);
        a->storage_bits = DAC_TABLE_STORAGE_BITS;
        a->bits = shape[1];
        a->index_bits = shape[0];
        a->phase_period = dac_link_program_word(image, page, DAC_LINK_PHASE_PERIOD);
        a->hold_ticks = held ? s->line_ticks : 1;
        a->gain_word = (int32_t)dac_link_program_word(image, page, DAC_LINK_GAIN);
        a->offset_word = (int64_t)(int32_t)dac_link_program_word(image, page, DAC_LINK_OFFSET_HIGH) * (INT64_C(1) << 18)
                       + dac_link_program_word(image, page, DAC_LINK_OFFSET_LOW);
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
        a->slow = NULL;
#endif
    }
}
