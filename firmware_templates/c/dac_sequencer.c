/* Requests, program changes, ticks, markers and faults. The arithmetic is in dac_axis.c. */
#include "dac_arithmetic.h"
#include "dac_axis.h"
#include "dac_barriers.h"
#include "dac_slow.h"

enum { COMMIT, WITHDRAW, ARM, TRIGGER, RESET, CLEAR_FAULTS, PARK };
#if DAC_COMMIT_MODES
enum { COMMIT_KEEP = PARK + 1, COMMIT_FRAME };
#endif
enum { NOTHING = 2 };         /* value of `playing` before the first program */
#define UNKNOWN UINT32_MAX /* position of the pixels after ticks that were played without markers */

DAC_CODE_ATTR static void clear_faults(dac_sequencer *s)
{
    s->faults = 0;
    for (int i = 0; i < DAC_FAULTS; i++)
        s->fault_counts[i] = 0;
}

/* Functions of the producer. */

/* With 0 bits, as they are before, every program is for another converter. */
static bool power_up(dac_axis *axis, const dac_converter *converter)
{
    if (!dac_axis_serves(converter))
        return false;
    axis->code = converter->power_up_code;
    axis->bits = converter->bits;
    axis->word_bits = converter->word_bits;
    axis->flip = converter->twos_complement ? UINT32_C(1) << (converter->bits - 1) : 0;
    axis->shift = (uint8_t)(converter->left_aligned ? converter->word_bits - converter->bits : 0);
    return true;
}

bool dac_sequencer_init(dac_sequencer *s, const dac_converter *x, const dac_converter *y)
{
    unsigned char *const bytes = (unsigned char *)s;

    for (size_t i = 0; i < sizeof *s; i++)
        bytes[i] = 0;
    s->pixel_rest = UNKNOWN;
    s->playing = NOTHING;
    const bool x_good = power_up(&s->x, x);
    return power_up(&s->y, y) && x_good;
}

bool dac_sequencer_writable(const dac_sequencer *s)
{
    /* In this order: a commit that is still in the queue would set `waiting`. */
    if (s->commits_answered != s->commits)
        return false;
    DAC_ACQUIRE();
    if (s->waiting)
        return false;
    DAC_ACQUIRE();
    return true;
}

unsigned dac_sequencer_idle(const dac_sequencer *s)
{
    return s->playing == 0 ? 1 : 0;
}

static bool request(dac_sequencer *s, uint8_t what, uint32_t argument)
{
    const uint8_t head = s->head;

    if ((uint8_t)(head - s->tail) == DAC_REQUESTS)
        return false;
    DAC_ACQUIRE();
    s->request[head % DAC_REQUESTS] = what;
    s->argument[head % DAC_REQUESTS] = argument;
    DAC_RELEASE();
    s->head = (uint8_t)(head + 1u);
    return true;
}

bool dac_sequencer_commit(dac_sequencer *s)
{
    /* The number tells the consumer whether the bank is still the one that was loaded. */
    if (!s->loaded || !request(s, COMMIT, s->loaded_after))
        return false;
    s->commits++;
    return true;
}

#if DAC_COMMIT_MODES
bool dac_sequencer_commit_at(dac_sequencer *s, dac_commit_mode mode)
{
    if (mode == DAC_COMMIT_LINE)
        return dac_sequencer_commit(s);
    if ((mode != DAC_COMMIT_KEEP && mode != DAC_COMMIT_FRAME) || !s->loaded
        || !request(s, mode == DAC_COMMIT_KEEP ? COMMIT_KEEP : COMMIT_FRAME, s->loaded_after))
        return false;
    s->commits = (uint8_t)(s->commits + 1u);
    return true;
}

/* Returns whether y has the same place in both programs at the start of each line. */
DAC_CODE_ATTR static bool same_frame(const dac_bank *now, const dac_bank *next)
{
#if DAC_SLOW_PART
    if ((now->y.slow == NULL) != (next->y.slow == NULL))
        return false;
#endif
    return now->schedule.line_ticks == next->schedule.line_ticks
        && now->schedule.frame_lines == next->schedule.frame_lines && now->y.holds == next->y.holds;
}

bool dac_sequencer_can_keep(const dac_sequencer *s)
{
    return s->playing == NOTHING || same_frame(&s->bank[s->playing], &s->bank[dac_sequencer_idle(s)]);
}
#endif

bool dac_sequencer_withdraw(dac_sequencer *s) { return request(s, WITHDRAW, 0); }
bool dac_sequencer_arm(dac_sequencer *s, uint32_t frames)
{
    return frames <= UINT32_C(1) << 31 && request(s, ARM, frames);
}

bool dac_sequencer_trigger(dac_sequencer *s) { return request(s, TRIGGER, 0); }

#if DAC_STORE || DAC_LINK_Z
bool dac_sequencer_starts(const dac_sequencer *s)
{
    const volatile uint8_t *const running = &s->running; /* the consumer's, which may be at work on another core */
    bool starts = false;
    uint8_t at = s->tail;

    /* In this order: a trigger that is not in the queue any more has set `running`. */
    DAC_ACQUIRE();
    for (; at != s->head; at++) {
        const uint8_t what = s->request[at % DAC_REQUESTS];
        starts = what == TRIGGER || (starts && what != PARK && what != RESET);
    }
    return starts || *running != 0;
}
#endif

bool dac_sequencer_park(dac_sequencer *s) { return request(s, PARK, 0); }
bool dac_sequencer_reset(dac_sequencer *s) { return request(s, RESET, 0); }
bool dac_sequencer_clear_faults(dac_sequencer *s) { return request(s, CLEAR_FAULTS, 0); }

/* A processor may write 32 bits in parts: read until two reads agree. */
static uint32_t settled(const volatile uint32_t *shared)
{
    uint32_t first, second = *shared;
    do {
        first = second;
        second = *shared;
    } while (first != second);
    return first;
}

dac_status dac_sequencer_status(const dac_sequencer *s)
{
    dac_status status;
    status.markers = s->markers;
    status.faults = s->faults;
    for (int i = 0; i < DAC_FAULTS; i++)
        status.fault_counts[i] = settled(&s->fault_counts[i]);
    status.swaps = settled(&s->swaps);
    status.line = settled(&s->line);
    return status;
}

/* Functions of the consumer. */

DAC_CODE_ATTR void dac_sequencer_report(dac_sequencer *s, uint8_t fault)
{
    for (int i = 0; i < DAC_FAULTS; i++)
        if (((unsigned)fault >> i & 1u) != 0 && s->fault_counts[i] != UINT32_MAX)
            s->fault_counts[i] = s->fault_counts[i] + 1;
    s->faults = (uint8_t)(s->faults | (fault & 15u));
}

DAC_CODE_ATTR static void to_start(dac_axis *axis)
{
    axis->at.low = 0;
    axis->at.high = 0;
}

/* Begins with remainders of 0, if there are any. */
DAC_CODE_ATTR static void forget(dac_axis *axis)
{
#if DAC_SHAPING
    axis->shaper.back = axis->shaper.newest = axis->shaper.older = UINT32_C(1) << (27 - axis->bits);
#else
    (void)axis;
#endif
}

/* Begins a program away from where the outputs are, and unsettled. */
DAC_CODE_ATTR static void unsettle(dac_sequencer *s)
{
    forget(&s->x);
    forget(&s->y);
    if (s->now != NULL)
        s->settle_left = s->now->schedule.settle_lines;
    s->catching_up = true;
}

/* Starts at line 0 of the active program. Without one, swap() does so again with the program that waits. */
DAC_CODE_ATTR static void begin(dac_sequencer *s)
{
#if DAC_SLOW_PART
    s->line_due = true;
#endif
    s->tick = 0;
    s->line = 0;
    to_start(&s->x);
    to_start(&s->y);
    unsettle(s);
}

DAC_CODE_ATTR static void trigger(dac_sequencer *s)
{
    if (!s->armed || s->running || (s->now == NULL && !s->waiting))
        return;
    s->armed = false;
    s->endless = s->armed_frames == 0;
    s->frames_left = s->armed_frames;
    s->running = true;
    begin(s);
}

DAC_CODE_ATTR static void park(dac_sequencer *s)
{
    s->armed = s->running = false;
}

DAC_CODE_ATTR static void act(dac_sequencer *s, uint8_t what, uint32_t argument)
{
    switch (what) {
#if DAC_COMMIT_MODES
    case COMMIT_KEEP:
    case COMMIT_FRAME:
#endif
    case COMMIT:
#if DAC_COMMIT_MODES
        s->commit = what;
#endif
        s->waiting = argument == s->swaps;
        DAC_RELEASE();
        s->commits_answered = (uint8_t)(s->commits_answered + 1u);
        break;
    case WITHDRAW:
        s->waiting = 0;
        if (s->now == NULL) /* a scan of the first program was triggered, and never plays */
            s->running = false;
        break;
    case ARM:
        s->armed = true;
        s->armed_frames = argument;
        break;
    case TRIGGER:
        trigger(s);
        break;
    case RESET:
        s->waiting = 0;
        park(s);
        clear_faults(s);
        break;
    case CLEAR_FAULTS:
        clear_faults(s);
        break;
    default:
        park(s);
        break;
    }
}

DAC_CODE_ATTR void dac_sequencer_answer(dac_sequencer *s)
{
    const uint8_t head = s->head;
    uint8_t tail = s->tail;

    if (tail == head)
        return;
    DAC_ACQUIRE();
    do {
        act(s, s->request[tail % DAC_REQUESTS], s->argument[tail % DAC_REQUESTS]);
        tail++;
    } while (tail != head);
    DAC_RELEASE();
    s->tail = tail;
}

#if DAC_COMMIT_MODES
/* Returns whether the committed program has to wait for a frame of the active scan to end. */
DAC_CODE_ATTR static bool in_frame(const dac_sequencer *s)
{
    return s->commit == COMMIT_FRAME && s->running && s->line != 0;
}

/* Returns whether the committed program continues the frame of the active one. */
DAC_CODE_ATTR static bool keeps_frame(const dac_sequencer *s)
{
    return s->commit == COMMIT_KEEP && s->running && s->now != NULL
        && same_frame(s->now, &s->bank[s->playing == 0 ? 1 : 0]);
}

/* Continues the frame with the next line of the active program. The position of y is the number of its advances times
 * their step, which depends on the length of the table too. The product takes additions alone, at most 62. */
DAC_CODE_ATTR static void keep_frame(dac_sequencer *s, const dac_position *step_before)
{
    const dac_bank *const bank = s->now;
    dac_position way = bank->y.step;

    unsettle(s);
#if DAC_SLOW_PART
    if (bank->y.slow != NULL) /* it is at the start of a line in both programs */
        return;
#endif
    if (way.high == step_before->high && way.low == step_before->low)
        return;
    to_start(&s->y);
    for (uint32_t left = bank->y.holds ? s->line : s->line * bank->schedule.line_ticks; left != 0; left >>= 1) {
        const dac_position half = way;
        if ((left & 1u) != 0)
            dac_advance(&s->y.at, &way);
        dac_advance(&way, &half);
    }
}
#endif

/* Activates the committed program, if this tick allows it. */
DAC_CODE_ATTR static bool swap(dac_sequencer *s)
{
    if (!s->waiting || (s->running && s->tick != 0))
        return false;
#if DAC_COMMIT_MODES
    if (in_frame(s))
        return false;
    const bool keeps = keeps_frame(s);
    const dac_position y_step = keeps ? s->now->y.step : s->y.at;
#endif
    s->playing = s->playing == 0 ? 1 : 0;
    s->now = &s->bank[s->playing];
    s->swaps = s->swaps + 1;
    DAC_RELEASE(); /* from here on the other bank may be written */
    s->waiting = 0;
#if DAC_COMMIT_MODES
    if (keeps) {
        keep_frame(s, &y_step);
        return true;
    }
#endif
    if (s->running)
        begin(s);
    return true;
}

DAC_CODE_ATTR static bool in(const dac_window *window, uint32_t at)
{
    return at - window->first < window->count;
}

/* Returns the number of ticks from `tick` to the next edge of a window or the turn, at most `most`. */
DAC_CODE_ATTR static uint32_t until_edge(const dac_schedule *plan, uint32_t tick, uint32_t most)
{
    const uint32_t edges[] = {plan->turn_tick, plan->forward.first, plan->forward.first + plan->forward.count,
                              plan->backward.first, plan->backward.first + plan->backward.count};
    for (unsigned i = 0; i < sizeof edges / sizeof edges[0]; i++)
        if (edges[i] - tick - 1 < most - 1)
            most = edges[i] - tick;
    return most;
}

#if DAC_PIXEL_TABLE
/* Marks the pixels of ticks in a window of a schedule with a table of them. */
DAC_CODE_ATTR static void mark_table(dac_sequencer *s, const dac_window *window, uint8_t *markers, uint32_t ticks)
{
    const dac_schedule *const plan = &s->now->schedule;

    if (s->tick == window->first) {
        s->next_pixel = plan->pixel_table + (window == &plan->forward ? 0 : plan->pixels);
        s->pixel_rest = 0;
    }
    if (s->pixel_rest == UNKNOWN)
        return;
    for (uint32_t i = 0; i < ticks; i++) {
        if (s->pixel_rest == 0) {
            s->pixel_rest = *s->next_pixel++;
            markers[i] |= DAC_PIXEL;
        }
        s->pixel_rest--;
    }
}
#endif

/* Of the ticks from s->tick on, up to `most` of them and to the next at which more than pixels changes; returns how
 * many. `clean`: nothing that this tick or an earlier one did spoils the image. */
DAC_CODE_ATTR static uint32_t mark(dac_sequencer *s, bool clean, uint8_t *markers, uint32_t most)
{
    const dac_schedule *const plan = &s->now->schedule;
    const uint32_t tick = s->tick;
    const dac_window *const window = in(&plan->forward, tick) ? &plan->forward
                                   : in(&plan->backward, tick) ? &plan->backward : NULL;
    uint8_t all = DAC_PLAYING;

    if (tick >= plan->turn_tick)
        all |= DAC_BACKWARD;
    if (window != NULL && clean && s->settle_left == 0 && (in(&plan->up, s->line) || in(&plan->down, s->line)))
        all |= DAC_VALID;
    if (most != 1)
        most = until_edge(plan, tick, most);
    for (uint32_t i = 0; i < most; i++)
        markers[i] = all;
    if (tick == 0)
        markers[0] = (uint8_t)(all | DAC_LINE | (s->line == 0 ? DAC_FRAME : 0));
    if (window == NULL)
        return most;
#if DAC_PIXEL_TABLE
    if (plan->pixel_table != NULL) {
        mark_table(s, window, markers, most);
        return most;
    }
#endif
    if (tick == window->first)
        s->pixel_rest = window->count;
    if (s->pixel_rest == UNKNOWN)
        return most;
    for (uint32_t i = 0; i < most; i++) {
        if (s->pixel_rest >= window->count) {
            s->pixel_rest -= window->count;
            markers[i] |= DAC_PIXEL;
        }
        s->pixel_rest += plan->pixels;
    }
    return most;
}

#if DAC_SLOW_PART
/* Prepares the line of the next tick, once. */
DAC_CODE_ATTR static void begin_line(dac_sequencer *s)
{
    dac_bank *const bank = &s->bank[s->playing];

    if (!s->line_due)
        return;
    s->line_due = false;
    dac_slow_begin_line(&s->x, &bank->x, s->line);
    dac_slow_begin_line(&s->y, &bank->y, s->line);
}
#endif

DAC_CODE_ATTR static void go_on(dac_sequencer *s, uint32_t ticks)
{
    const dac_bank *const bank = s->now;

    s->tick += ticks;
    if (s->tick != bank->schedule.line_ticks)
        return;
    s->tick = 0;
    if (s->settle_left != 0)
        s->settle_left--;
#if DAC_SLOW_PART
    s->line_due = true;
    if (bank->y.slow != NULL)
        to_start(&s->y);
#endif
    to_start(&s->x);
    if (bank->y.holds)
        dac_advance(&s->y.at, &bank->y.step);
    if (s->line + 1 != bank->schedule.frame_lines) {
        s->line = s->line + 1;
        return;
    }
    s->line = 0;
    to_start(&s->y);
    if (!s->endless && --s->frames_left == 0)
        s->running = false;
}

DAC_CODE_ATTR static uint8_t play(dac_sequencer *s)
{
    const dac_bank *const bank = s->now;
    uint8_t markers;
    bool outside = false;
#if DAC_SLOW_PART
    begin_line(s);
#endif
    bool reached = dac_axis_step(&s->x, &bank->x, &outside);

    reached &= dac_axis_step(&s->y, &bank->y, &outside);
    if (outside)
        dac_sequencer_report(s, DAC_FAULT_CLAMP);
    if (reached)
        s->catching_up = false;
    else if (!s->catching_up)
        dac_sequencer_report(s, DAC_FAULT_SLEW);
    (void)mark(s, reached && !s->faults, &markers, 1);
    go_on(s, 1);
    return markers;
}

DAC_CODE_ATTR static uint8_t rest(dac_sequencer *s)
{
    const dac_bank *const bank = s->now;
    bool parked = true;

    if (bank != NULL) {
        parked = dac_axis_approach(&s->x, &bank->x, bank->x.park_code);
        parked &= dac_axis_approach(&s->y, &bank->y, bank->y.park_code);
    }
    return parked ? DAC_PARKED : 0;
}

/* Plays one tick, after the requests were processed. */
DAC_CODE_ATTR static void one_tick(dac_sequencer *s, dac_tick *out)
{
    const uint8_t swapped = swap(s) ? DAC_SWAPPED : 0;

    out->markers = (uint8_t)((s->running ? play(s) : rest(s)) | swapped);
    s->markers = out->markers;
    out->faults = s->faults;
    out->x = dac_encode(&s->x, s->x.code);
    out->y = dac_encode(&s->y, s->y.code);
}

DAC_CODE_ATTR void dac_sequencer_step(dac_sequencer *s, dac_tick *out)
{
    dac_sequencer_answer(s);
    one_tick(s, out);
}

/* Plays as many ticks as both axes can in one run, at most `most`; the codes are not coded yet. */
DAC_CODE_ATTR static uint32_t run(dac_sequencer *s, dac_output *x, dac_output *y, uint32_t most)
{
    const dac_bank *const bank = s->now;
#if DAC_SLOW_PART
    begin_line(s);
#endif
#if DAC_SHAPING
    const dac_axis before = s->x;
#else
    const dac_position at = s->x.at;
    const int32_t code = s->x.code;
#if DAC_SLOW_PART
    const int64_t rise = s->x.rise;
#endif
#endif
    const uint32_t x_ticks = dac_axis_run(&s->x, &bank->x, x, most);
    const uint32_t ticks = dac_axis_run(&s->y, &bank->y, y, x_ticks);

    if (ticks != x_ticks) { /* y stopped earlier, at a tick that needs a step; x goes back */
#if DAC_SHAPING
        s->x = before; /* only who plays again finds its remainders */
        (void)dac_axis_run(&s->x, &bank->x, x, ticks);
#else
        s->x.at = at;
#if DAC_SLOW_PART
        s->x.rise = rise;
#endif
        s->x.code = ticks != 0 ? (int32_t)x[(ticks - 1) * DAC_STRIDE] : code;
        dac_axis_skip(&s->x, &bank->x, ticks);
#endif
    }
    return ticks;
}

/* Sets the markers of ticks that were played in a run, and advances to the tick after them. */
DAC_CODE_ATTR static void pass(dac_sequencer *s, uint8_t *markers, uint32_t ticks)
{
    s->catching_up = false;
    if (markers == NULL) {
        s->pixel_rest = UNKNOWN;
        s->markers = DAC_PLAYING;
        go_on(s, ticks);
        return;
    }
    while (ticks != 0) {
        const uint32_t marked = mark(s, !s->faults, markers, ticks);
        markers += marked;
        ticks -= marked;
        go_on(s, marked);
    }
    s->markers = markers[-1];
}

DAC_CODE_ATTR static void encode(const dac_axis *axis, dac_output *out, uint32_t ticks)
{
    if (axis->flip == 0 && axis->shift == 0)
        return;
    for (; ticks != 0; ticks--, out += DAC_STRIDE)
        *out = dac_encode(axis, (int32_t)*out);
}

DAC_CODE_ATTR void dac_sequencer_fill(dac_sequencer *s, dac_output *x, dac_output *y, uint8_t *markers, size_t ticks)
{
    uint32_t done, most = UINT32_C(1) << 16, wait = 0;

    dac_sequencer_answer(s);
    for (; ticks != 0; ticks -= (size_t)done, x += done * DAC_STRIDE, y += done * DAC_STRIDE) {
        done = 0;
        if (wait != 0) {
            wait--;
#if DAC_COMMIT_MODES
        } else if (s->running && (s->tick != 0 || !s->waiting || in_frame(s))) {
#else
        } else if (s->running && (s->tick != 0 || !s->waiting)) {
#endif
            const uint32_t left = s->now->schedule.line_ticks - s->tick;
            const uint32_t possible = ticks < left ? (uint32_t)ticks : left;
            const uint32_t asked = possible < most ? possible : most;
            done = run(s, x, y, asked);
            /* Ticks that x played before y refused are wasted: try a short run next, and not at once. */
            if (done != asked)
                most = DAC_RUN;
            else if (asked == most)
                most *= 2;
            wait = done != 0 ? 0 : DAC_WAIT;
        }
        if (done != 0) {
            encode(&s->x, x, done);
            encode(&s->y, y, done);
            pass(s, markers, done);
        } else {
            dac_tick one;
            one_tick(s, &one);
            *x = one.x;
            *y = one.y;
            if (markers != NULL)
                *markers = one.markers;
            done = 1;
        }
        if (markers != NULL)
            markers += done;
    }
}
