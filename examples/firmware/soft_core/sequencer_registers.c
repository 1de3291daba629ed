/* The producer's functions of dac_sequencer.h, for the sequencer in the FPGA: this file takes the place of
 * dac_sequencer.c, and the link does not see the difference. dac_program.c still checks a program and keeps it in
 * `sequencer`, where the link finds what plays. The linker's --wrap puts __wrap_dac_sequencer_load around its
 * dac_sequencer_load, so that a program that is loaded is also written to the registers.
 *
 * With DAC_LINK_Z there are two of these sequencers. Ticks go on while the link has them stopped: what it requests of
 * both meanwhile is written at the end, with one write for both. */
#include "dac_registers.h"
#include "scan.h"
#include "soft_core.h"

enum { NO_PROGRAM = 2 };        /* `playing` before the first program */
enum { UNDER_WAY = 64 };        /* reads of a register, longer than a sample is on its way through the sequencer */
enum { PAGE = 16, WORDS = 48 }; /* of a program: the page of the scan, of x and of y */
enum { GAIN = 3, KNOTS = 12 };  /* of the page of an axis: gain and offset, and the words of a slow part */
#if DAC_SLOW_PART
enum { SLOW_PART = 4 * 8192 };  /* bytes from a part of a slow part to the next */
#define MOST_SPACING UINT32_C(0x1FFFF)
#endif

dac_sequencer sequencer;
#if DAC_LINK_Z
dac_sequencer sequencer_of_z;
#define IS_Z(s) ((s) == &sequencer_of_z)
#define OF(s) (IS_Z(s) ? OF_Z : 0u) /* what the offsets of its registers begin with */
#else
#define OF(s) ((void)(s), 0u)
#endif

static uint32_t status_of(const dac_sequencer *s)
{
    return SEQUENCER(OF(s) + DAC_STATUS_ADDRESS);
}

/* Programs that were taken; banks take turns. */
static uint32_t swaps(const dac_sequencer *s)
{
#if DAC_LINK_Z
    dac_sequencer *const own = IS_Z(s) ? &sequencer_of_z : &sequencer;
    const uint32_t taken = IS_Z(s) ? SYSTEM_Z_SWAPS : SYSTEM_SWAPS;
#else
    dac_sequencer *const own = &sequencer;
    const uint32_t taken = SYSTEM_SWAPS;
    (void)s;
#endif

    own->swaps = taken;
    own->playing = (uint8_t)(taken == 0 ? NO_PROGRAM : (taken - 1) & 1);
    return taken;
}

/* Waits until a sample that was the first of a program has been counted. */
static void let_samples_pass(void)
{
    for (unsigned i = 0; i < UNDER_WAY; i++)
        (void)SEQUENCER(DAC_STATUS_ADDRESS);
}

static bool power_up(dac_axis *axis, const dac_converter *converter, uint32_t offset)
{
    axis->bits = converter->bits;
    axis->word_bits = converter->word_bits;
    axis->flip = converter->twos_complement ? UINT32_C(1) << (converter->bits - 1) : 0;
    axis->shift = (uint8_t)(converter->left_aligned ? converter->word_bits - converter->bits : 0);
    return (SEQUENCER(offset + DAC_FEATURES_ADDRESS) & DAC_FEATURES_DAC_BITS_MASK) == converter->bits;
}

bool dac_sequencer_init(dac_sequencer *s, const dac_converter *x, const dac_converter *y)
{
    (void)swaps(s);
    return SEQUENCER(OF(s) + DAC_IDENTITY_ADDRESS) == DAC_IDENTITY_VALUE
        && SEQUENCER(OF(s) + DAC_VERSION_ADDRESS) == DAC_VERSION_VALUE && power_up(&s->x, x, OF(s))
        && power_up(&s->y, y, OF(s));
}

/* A program that was committed waits until it is counted, which is later than the registers free its bank. */
static bool waits(const dac_sequencer *s)
{
    if (s->waiting == 0 || swaps(s) != s->loaded_after)
        return false;
#if DAC_LINK_Z
    if ((status_of(s) & DAC_STATUS_WRITABLE_MASK) != 0) {
        let_samples_pass(); /* it is counted, or the hardware has withdrawn it, since the other sequencer refused */
        return false;
    }
#endif
    return true;
}

bool dac_sequencer_writable(const dac_sequencer *s)
{
    return !waits(s) && (status_of(s) & DAC_STATUS_WRITABLE_MASK) != 0;
}

unsigned dac_sequencer_idle(const dac_sequencer *s)
{
    return swaps(s) & 1;
}

dac_status dac_sequencer_status(const dac_sequencer *s)
{
    dac_status now;

    /* Before the swaps: a line of the old program, if these have not grown. */
#if DAC_LINK_Z
    now.line = IS_Z(s) ? SYSTEM_Z_LINE : SYSTEM_LINE;
#else
    now.line = SYSTEM_LINE;
#endif
    now.swaps = swaps(s);
    const uint32_t state = status_of(s);
    now.markers = (uint8_t)((state & DAC_STATUS_PLAYING_MASK ? DAC_PLAYING : 0)
                            | (state & DAC_STATUS_PARKED_MASK ? DAC_PARKED : 0));
    now.faults = (uint8_t)SEQUENCER(OF(s) + DAC_FAULTS_ADDRESS);
    for (unsigned i = 0; i < DAC_FAULTS; i++)
        now.fault_counts[i] = SEQUENCER(OF(s) + DAC_SLEW_COUNT_ADDRESS + 4 * i);
    return now;
}

/* Whether the tables of the hardware are of this mode and width: interpolated ones have exactly its length. */
static bool fits(const dac_axis_program *p, uint32_t shape)
{
    const uint32_t degree = (shape & DAC_X_SHAPE_DEGREE_MASK) >> DAC_X_SHAPE_DEGREE_SHIFT;
    const uint32_t index_bits = (shape & DAC_X_SHAPE_INDEX_BITS_MASK) >> DAC_X_SHAPE_INDEX_BITS_SHIFT;
    const uint32_t word_bits = (shape & DAC_X_SHAPE_WORD_BITS_MASK) >> DAC_X_SHAPE_WORD_BITS_SHIFT;

    if (p->bits != word_bits)
        return false;
    if (degree == 0)
        return p->index_bits == 0 && p->length <= UINT32_C(1) << index_bits;
    return p->index_bits == index_bits + (degree == 3 ? (uint32_t)DAC_CUBIC : 0);
}

static void put_schedule(uint32_t *page, const dac_program *p)
{
    const dac_schedule *const s = &p->schedule;
    const uint32_t words[] = {
        s->line_ticks, s->frame_lines, s->settle_lines, s->turn_tick, s->forward.first, s->forward.count,
        s->backward.first, s->backward.count, s->up.first, s->up.count, s->down.first, s->down.count, s->pixels,
        p->y.hold_ticks != 1,
    };

    for (unsigned i = 0; i < sizeof words / sizeof words[0]; i++)
        page[i] = words[i];
}

/* Step and remainder of a period: 2^32 by its length. */
static void put_period(uint32_t *words, uint32_t length)
{
    const uint32_t step = UINT32_MAX / length, remainder = UINT32_MAX % length + 1;

    words[0] = remainder == length ? step + 1 : step;
    words[1] = remainder == length ? 0 : remainder;
}

static void put_scale(uint32_t *words, int32_t gain_word, int64_t offset_word)
{
    words[0] = (uint32_t)gain_word;
    words[1] = (uint32_t)(offset_word & 0x3FFFF);
    words[2] = (uint32_t)(offset_word >> 18);
}

static void put_axis(uint32_t *page, const dac_axis_program *p)
{
    const uint32_t words[] = {
        p->phase_period,
        0,
        0,
        0,
        (uint32_t)p->code_min,
        (uint32_t)p->code_max,
        (uint32_t)p->max_step,
        (uint32_t)p->park_code,
        0,
#if DAC_SHAPING
        p->shaping_order | (uint32_t)p->shaping_zero << 8,
#endif
    };

    put_period(page, p->phase_period);
    for (unsigned i = 0; i < sizeof words / sizeof words[0]; i++)
        page[2 + i] = words[i];
    put_scale(page + GAIN, p->gain_word, p->offset_word);
}

static void write_table(uint32_t offset, const dac_axis_program *p)
{
    for (uint32_t i = 0; i < p->length; i++)
        SEQUENCER(offset + 4 * i) = (uint32_t)p->table[i];
}

#if DAC_SLOW_PART
/* Whether the hardware has room for a slow part. Its gains and ratios are at the same lines. */
static bool slow_fits(const dac_slow_part *slow, uint32_t offset)
{
    const uint32_t shape = SEQUENCER(offset + DAC_MEMORY_SHAPE_ADDRESS);
    const uint32_t index_bits =
        (shape & DAC_MEMORY_SHAPE_SLOW_INDEX_BITS_MASK) >> DAC_MEMORY_SHAPE_SLOW_INDEX_BITS_SHIFT;

    return slow->index_bits <= index_bits && slow->gain_spacing <= MOST_SPACING
        && (slow->second == NULL
            || (slow->ratio_knots == slow->gain_knots && slow->ratio_spacing == slow->gain_spacing));
}

/* The clocks in which the hardware works out a line of an axis: "A slow part" of docs/verilog.md. */
static uint32_t line_clocks(const dac_axis_program *p)
{
    return 467 + 2 * (p->slow->gain_knots - UINT32_C(2)) + 2u * p->slow->index_bits + 11 * p->length;
}

/* The next line is worked out while a line plays, in all clocks but two of each tick. */
static bool line_is_long_enough(const dac_program *p)
{
    return (uint64_t)p->schedule.line_ticks * (CLOCKS_PER_TICK - 2) >= line_clocks(&p->x) + line_clocks(&p->y);
}

/* Gain and offset of the slow table take the place of those of the axis. */
static void put_slow(uint32_t *page, const dac_slow_part *slow, uint32_t lines)
{
    put_scale(page + GAIN, slow->gain_word, slow->offset_word);
    page[KNOTS] = slow->gain_knots | (uint32_t)slow->index_bits << 8;
    page[KNOTS + 1] = slow->gain_spacing;
    put_period(page + KNOTS + 2, lines);
}

static void write_slow(uint32_t offset, const dac_axis_program *p)
{
    const dac_slow_part *const slow = p->slow;

    for (uint32_t i = 0; i < p->length; i++)
        SEQUENCER(offset + 4 * i) = slow->second != NULL ? (uint32_t)slow->second[i] : 0;
    for (uint32_t i = 0; i < UINT32_C(1) << slow->index_bits; i++)
        SEQUENCER(offset + SLOW_PART + 4 * i) = (uint32_t)slow->table[i];
    for (uint32_t i = 0; i < slow->gain_knots; i++) {
        SEQUENCER(offset + 2 * SLOW_PART + 4 * i) = (uint32_t)slow->gains[i];
        SEQUENCER(offset + 3 * SLOW_PART + 4 * i) = slow->second != NULL ? (uint32_t)slow->ratios[i] : 0;
    }
}
#endif

/* Whether the hardware plays the slow parts of a program: it has them on both axes, or on none. */
static bool slow_parts_fit(const dac_program *p, uint32_t offset)
{
    const bool slow = (SEQUENCER(offset + DAC_FEATURES_ADDRESS) & DAC_FEATURES_SLOW_PART_MASK) != 0;

#if DAC_SLOW_PART
    if (slow)
        return p->x.slow != NULL && p->y.slow != NULL && slow_fits(p->x.slow, offset) && slow_fits(p->y.slow, offset);
    return p->x.slow == NULL && p->y.slow == NULL;
#else
    (void)p;
    return !slow;
#endif
}

dac_loaded __real_dac_sequencer_load(dac_sequencer *s, const dac_program *program);
dac_loaded __wrap_dac_sequencer_load(dac_sequencer *s, const dac_program *program);

/* Checks a program, and writes it into the idle bank of the hardware. */
dac_loaded __wrap_dac_sequencer_load(dac_sequencer *s, const dac_program *program)
{
    uint32_t words[WORDS] = {0};
    const uint32_t of = OF(s);
    const dac_loaded loaded = __real_dac_sequencer_load(s, program);

    if (loaded != DAC_LOADED)
        return loaded;
    s->waiting = 0;
    s->loaded = 0;
    if (program->schedule.line_ticks < 8 || program->schedule.frame_lines > UINT32_C(1) << 16
        || program->schedule.settle_lines > 255)
        return DAC_BAD_SCHEDULE;
    if (!fits(&program->x, SEQUENCER(of + DAC_X_SHAPE_ADDRESS))
        || !fits(&program->y, SEQUENCER(of + DAC_Y_SHAPE_ADDRESS)))
        return DAC_BAD_TABLE;
    if (!slow_parts_fit(program, of))
        return DAC_BAD_SLOW_PART;
#if DAC_SLOW_PART
    if (program->x.slow != NULL && !line_is_long_enough(program))
        return DAC_BAD_SCHEDULE;
#endif
    put_schedule(words, program);
    put_axis(words + PAGE, &program->x);
    put_axis(words + 2 * PAGE, &program->y);
#if DAC_SLOW_PART
    if (program->x.slow != NULL) {
        put_slow(words + PAGE, program->x.slow, program->schedule.frame_lines);
        put_slow(words + 2 * PAGE, program->y.slow, program->schedule.frame_lines);
    }
#endif
    SEQUENCER(of + DAC_COMMAND_ADDRESS) = DAC_COMMAND_WITHDRAW_MASK; /* what may have been there, and did not fit */
    for (unsigned i = 0; i < WORDS; i++)
        SEQUENCER(of + DAC_PROGRAM_ADDRESS + 4 * i) = words[i];
    write_table(of + DAC_X_TABLE_ADDRESS, &program->x);
    write_table(of + DAC_Y_TABLE_ADDRESS, &program->y);
#if DAC_SLOW_PART
    if (program->x.slow != NULL) {
        write_slow(of + DAC_X_SLOW_ADDRESS, &program->x);
        write_slow(of + DAC_Y_SLOW_ADDRESS, &program->y);
    }
#endif
    s->loaded = 1;
    return DAC_LOADED;
}

/* Whether a commit has been accepted. A tick may have taken its program already; or the interlock has opened, or a word
 * did not fit. */
static bool accepted(const dac_sequencer *s)
{
    const uint32_t state = status_of(s);

    if ((state & DAC_STATUS_COMMITTED_MASK) != 0)
        return true;
#if DAC_SLOW_PART
    if ((state & (DAC_STATUS_REFUSED_MASK | DAC_STATUS_WRITABLE_MASK)) == 0)
        return true; /* its first line is worked out before it counts as committed */
#endif
    let_samples_pass();
    return swaps(s) != s->loaded_after;
}

/* Takes a commit back that was not accepted, or one that waits. */
static void forget(dac_sequencer *s)
{
    SEQUENCER(OF(s) + DAC_COMMAND_ADDRESS) =
        DAC_COMMAND_WITHDRAW_MASK
        | (status_of(s) & DAC_STATUS_REFUSED_MASK ? DAC_COMMAND_CLEAR_FAULTS_MASK : 0);
    s->waiting = 0;
}

#if DAC_LINK_Z
/* What is requested of x and y, and of z, while ticks are stopped for the link. */
typedef struct {
    uint32_t command, frames;
    bool arms;
} dac_requests;
static dac_requests requests[2];
static bool collects;

static void command_at(uint32_t offset, uint32_t command)
{
    if (command != 0)
        SEQUENCER(offset + DAC_COMMAND_ADDRESS) = command;
}

/* What became of a commit or a withdrawal of both. */
static void settle_both(uint32_t of_both)
{
    if ((of_both & DAC_COMMAND_COMMIT_MASK) != 0 && !(accepted(&sequencer) && accepted(&sequencer_of_z))) {
        forget(&sequencer);
        forget(&sequencer_of_z);
    }
    if ((of_both & DAC_COMMAND_WITHDRAW_MASK) != 0) {
        let_samples_pass(); /* they may have been taken just before */
        if (waits(&sequencer))
            sequencer.waiting = 0;
        if (waits(&sequencer_of_z))
            sequencer_of_z.waiting = 0;
    }
}

/* `stop_ticks` of the link. A request of one of them alone follows those of both: a commit without z, where both have
 * been parked. */
void requests_to_both(bool begin)
{
    dac_requests *const x_y = &requests[0], *const z = &requests[1];

    collects = begin;
    if (begin) {
        x_y->command = z->command = 0;
        x_y->arms = z->arms = false;
        return;
    }
    const uint32_t of_both = x_y->command & z->command;
    if (x_y->arms)
        SEQUENCER((z->arms ? OF_BOTH : 0) + DAC_ARM_ADDRESS) = x_y->frames;
    command_at(OF_BOTH, of_both);
    command_at(0, x_y->command & ~of_both);
    command_at(OF_Z, z->command & ~of_both);
    settle_both(of_both);
    if ((x_y->command & ~of_both & DAC_COMMAND_COMMIT_MASK) != 0 && !accepted(&sequencer))
        forget(&sequencer);
}

bool dac_sequencer_starts(const dac_sequencer *s)
{
    return (status_of(s) & DAC_STATUS_RUNNING_MASK) != 0;
}
#endif

/* Writes a command, or keeps it for later; returns whether it has been written. */
static bool command(dac_sequencer *s, uint32_t mask)
{
#if DAC_LINK_Z
    if (collects) {
        requests[IS_Z(s)].command |= mask;
        return false;
    }
#endif
    SEQUENCER(OF(s) + DAC_COMMAND_ADDRESS) = mask;
    return true;
}

/* The modes of the registers have the numbers of dac_commit_mode. */
bool dac_sequencer_commit_at(dac_sequencer *s, dac_commit_mode mode)
{
    if (!s->loaded || (unsigned)mode > DAC_COMMIT_FRAME)
        return false;
    s->waiting = 1;
    if (!command(s, DAC_COMMAND_COMMIT_MASK | (uint32_t)mode << DAC_COMMAND_COMMIT_MODE_SHIFT) || accepted(s))
        return true;
    forget(s);
    return false;
}

bool dac_sequencer_commit(dac_sequencer *s)
{
    return dac_sequencer_commit_at(s, DAC_COMMIT_LINE);
}

bool dac_sequencer_can_keep(const dac_sequencer *s)
{
    return swaps(s) == 0 || (status_of(s) & DAC_STATUS_CAN_KEEP_MASK) != 0;
}

bool dac_sequencer_withdraw(dac_sequencer *s)
{
    if (!command(s, DAC_COMMAND_WITHDRAW_MASK))
        return true;
    let_samples_pass(); /* it may have been taken just before */
    if (waits(s))
        s->waiting = 0;
    return true;
}

bool dac_sequencer_arm(dac_sequencer *s, uint32_t frames)
{
    if (frames > DAC_ARM_FRAMES_MASK)
        return false;
#if DAC_LINK_Z
    if (collects) {
        requests[IS_Z(s)].arms = true;
        requests[IS_Z(s)].frames = frames;
        return true;
    }
#endif
    SEQUENCER(OF(s) + DAC_ARM_ADDRESS) = frames;
    return true;
}

bool dac_sequencer_trigger(dac_sequencer *s)
{
    (void)command(s, DAC_COMMAND_TRIGGER_MASK);
    return true;
}

bool dac_sequencer_park(dac_sequencer *s)
{
    (void)command(s, DAC_COMMAND_PARK_MASK);
    return true;
}

bool dac_sequencer_clear_faults(dac_sequencer *s)
{
    (void)command(s, DAC_COMMAND_CLEAR_FAULTS_MASK);
    return true;
}
