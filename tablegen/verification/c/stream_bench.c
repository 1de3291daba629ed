/* Plays a script on the C sequencer and captures every tick, as stream_bench.v does with the Verilog one.
 *
 * The words of the script are those of tablegen.verification.play.stream, 64 bits each: what to do in the upper four
 * bits. The bench is both sides of the sequencer. Where it runs is the business of whoever gives it words and takes its
 * captures: bench_read(), bench_write() are theirs. With BENCH_FILL it can play ticks by dac_sequencer_fill() as far as
 * a command lets them; a capture then has no faults, since a fill tells them only at its end. With BENCH_EMITTED the
 * program is that of an emitted header, unless a commit says that it is another, which the script wrote; and a tick is
 * two captures: converter words of up to 32 bits, then markers and faults. After the ticks come the counts of faults,
 * then the states that the script asked for, four captures each (the last is 0: what a converter holds is not the
 * sequencer's business), and with BENCH_EMITTED the constants of the header.
 */
#include "dac_sequencer.h"
#include "stream_bench.h"

enum { END, WAIT, WRITE, REQUEST, PERIOD, SHAPE, STATE, EXTRA };              /* commands */
enum { PROGRAM, X_TABLE, Y_TABLE, X_FOURIER, Y_FOURIER, SINE, REGIONS };      /* regions of a write */
enum { RESET = 1, COMMIT = 2, WITHDRAW = 4, ARM = 8, TRIGGER = 16, PARK = 32, CLEAR_FAULTS = 64, UNDERRUN = 128,
       UNFIT = 256 };
enum { PAGE = 16, SCAN = 0, X = PAGE, Y = 2 * PAGE };                         /* pages of the registers */
enum { STATES = 160, STATE_WORDS = 4, WRITABLE = 1, REFUSED = 2, COMMITTED = 4 };  /* states */

static dac_sequencer sequencer;
static dac_word x_table[2][BENCH_TABLE_WORDS + DAC_WORDS_BEHIND], y_table[2][BENCH_TABLE_WORDS + DAC_WORDS_BEHIND];

static uint32_t period, until, ticks_due, commits_in;

static void capture(const dac_tick *tick)
{
#ifdef BENCH_EMITTED
    bench_write((uint64_t)tick->y << 32 | tick->x);
    bench_write((uint64_t)tick->faults << 8 | tick->markers);
#else
    bench_write((uint64_t)tick->faults << 56 | (uint64_t)tick->markers << 48 | (uint64_t)tick->y << 24 | tick->x);
#endif
}

#ifdef BENCH_FILL
static bool fills;

/* Lengths of all kinds, the same in every run. */
static uint32_t some(uint32_t most)
{
    static uint32_t state = 12345;
    state = state * 1664525u + 1013904223u;
    const uint32_t n = 1 + (state >> 16) % BENCH_FILL;
    return n < most ? n : most;
}
#endif

/* Plays the ticks that are due: before anything that might change them. */
static void play(void)
{
    dac_tick tick;
#ifdef BENCH_FILL
    static dac_output codes[2 * BENCH_FILL];
    static uint8_t markers[BENCH_FILL];
    while (fills && ticks_due != 0) {
        const uint32_t n = some(ticks_due);
        dac_sequencer_fill(&sequencer, codes, codes + 1, markers, n);
        for (uint32_t i = 0; i < n; i++) {
            tick.x = codes[2 * i];
            tick.y = codes[2 * i + 1];
            tick.markers = markers[i];
            tick.faults = 0;
            capture(&tick);
        }
        ticks_due -= n;
    }
#endif
    for (; ticks_due != 0; ticks_due--) {
        dac_sequencer_step(&sequencer, &tick);
        capture(&tick);
    }
}

static void pass(uint32_t clocks)
{
    while (clocks-- != 0) {
        if (period != 0 && until-- == 0) {
            ticks_due++;
            until = period - 1;
        }
        if (commits_in != 0 && --commits_in == 0) {
            play();
            bench_check(dac_sequencer_commit(&sequencer), "commit");
        }
    }
}

static uint32_t registers[3 * PAGE];
static dac_converter x_converter, y_converter;
static unsigned x_bits, x_index_bits, y_bits, y_index_bits;
static uint64_t states[STATES * STATE_WORDS];
static unsigned states_stored;
static bool refused; /* a program was refused since another one waits */

#ifdef BENCH_EMITTED

static const dac_word *rendered(const dac_axis_program *p, const bench_axis *axis, dac_word *table)
{
    if (axis->fourier == NULL)
        return p->table;
    bench_check(p->length <= BENCH_TABLE_WORDS, "a table of this length");
    bench_check(dac_synthesize(table, BENCH_TABLE_WORDS + DAC_WORDS_BEHIND, p->index_bits & ~(unsigned)DAC_CUBIC,
                               p->bits, axis->fourier, axis->harmonics, bench_sine, bench_sine_index_bits),
                "dac_synthesize");
    return table;
}

static void emitted(dac_program *p, unsigned idle)
{
    *p = *bench_program;
    p->x.table = rendered(&p->x, &bench_x, x_table[idle]);
    p->y.table = rendered(&p->y, &bench_y, y_table[idle]);
}

static void shape(uint64_t word)
{
    (void)word;
    x_converter = *bench_x_converter;
    y_converter = *bench_y_converter;
    x_bits = bench_program->x.bits;
    x_index_bits = bench_program->x.index_bits;
    y_bits = bench_program->y.bits;
    y_index_bits = bench_program->y.index_bits;
}

#else

static int32_t x_fourier[BENCH_FOURIER_WORDS], y_fourier[BENCH_FOURIER_WORDS], sine[BENCH_SINE_WORDS];
static uint32_t sine_words;

static void render(dac_word *table, unsigned index_bits, unsigned bits, const int32_t *fourier, unsigned harmonics)
{
    unsigned sine_index_bits = 0;
    while (UINT32_C(5) << sine_index_bits < 4 * sine_words)
        sine_index_bits++;
    bench_check(dac_synthesize(table, BENCH_TABLE_WORDS + DAC_WORDS_BEHIND, index_bits & ~(unsigned)DAC_CUBIC, bits,
                               fourier, harmonics, sine, sine_index_bits),
                "synthesize");
}

/* Converter and tables, before anything else. */
static void shape(uint64_t word)
{
    x_converter.bits = x_converter.word_bits = (uint8_t)(word & 31);
    y_converter = x_converter;
    x_bits = word >> 5 & 31;
    x_index_bits = (word >> 10 & 31) | (word >> 25 & 1 ? DAC_CUBIC : 0);
    y_bits = word >> 15 & 31;
    y_index_bits = (word >> 20 & 31) | (word >> 26 & 1 ? DAC_CUBIC : 0);
}

#endif

static void power_up(uint64_t word)
{
    x_converter.power_up_code = (int32_t)(word & 0xffffff);
    y_converter.power_up_code = (int32_t)(word >> 24 & 0xffffff);
    dac_sequencer_init(&sequencer, &x_converter, &y_converter);
}

static dac_window window(unsigned at)
{
    const dac_window w = {registers[at], registers[at + 1]};
    return w;
}

static dac_axis_program axis(unsigned page, dac_word *table, const dac_converter *converter, unsigned bits,
                             unsigned index_bits)
{
    const uint32_t *const r = registers + page;
    dac_axis_program p;

    p.table = table;
    p.storage_bits = DAC_TABLE_STORAGE_BITS;
    p.bits = (uint8_t)bits;
    p.index_bits = (uint8_t)index_bits;
    p.phase_period = r[2];
    p.length = index_bits ? UINT32_C(1) << (index_bits & ~(unsigned)DAC_CUBIC) : r[2];
    p.hold_ticks = page == Y && registers[13] ? registers[0] : 1;
    p.gain_word = (int32_t)r[3];
    p.offset_word = (int64_t)(int32_t)r[5] * (INT64_C(1) << 18) + r[4];
    p.gain_q = (uint8_t)(16 + bits + (bits > 21 ? 25 - bits : 4) - converter->bits);
    p.code_min = (int32_t)r[6];
    p.code_max = (int32_t)r[7];
    p.max_step = (int32_t)r[8];
    p.park_code = (int32_t)r[9];
    p.dac_bits = converter->bits;
    p.word_bits = converter->word_bits;
    p.twos_complement = converter->twos_complement;
    p.left_aligned = converter->left_aligned;
#if DAC_SHAPING
    p.shaping_order = r[11] & 3;
    p.shaping_zero = (uint8_t)(r[11] >> 8);
#endif
    return p;
}

static void written(dac_program *p, unsigned idle)
{
    p->schedule.line_ticks = registers[0];
    p->schedule.frame_lines = registers[1];
    p->schedule.settle_lines = registers[2];
    p->schedule.turn_tick = registers[3];
    p->schedule.forward = window(4);
    p->schedule.backward = window(6);
    p->schedule.up = window(8);
    p->schedule.down = window(10);
    p->schedule.pixels = registers[12];
#if DAC_PIXEL_TABLE
    p->schedule.pixel_table = NULL;
#endif
    bench_check(DAC_SHAPING || (registers[X + 11] == 0 && registers[Y + 11] == 0), "a runtime that shapes");
    p->x = axis(X, x_table[idle], &x_converter, x_bits, x_index_bits);
    p->y = axis(Y, y_table[idle], &y_converter, y_bits, y_index_bits);
    if (p->x.length <= BENCH_TABLE_WORDS && p->y.length <= BENCH_TABLE_WORDS) {
        for (unsigned i = 0; i < DAC_WORDS_BEHIND; i++) {
            x_table[idle][p->x.length + i] = x_table[idle][i];
            y_table[idle][p->y.length + i] = y_table[idle][i];
        }
    }
#ifndef BENCH_EMITTED
    if (registers[X + 10] != 0)
        render(x_table[idle], x_index_bits, x_bits, x_fourier, registers[X + 10]);
    if (registers[Y + 10] != 0)
        render(y_table[idle], y_index_bits, y_bits, y_fourier, registers[Y + 10]);
#endif
}

/* An `unfit` program has to be refused: the state that is asked for next says so. */
static void load(uint32_t variation, bool unfit)
{
    static const char *const outcomes[] = {
        "", "load: DAC_BUSY", "load: DAC_OTHER_CONVERTER",
        "load: DAC_BAD_SCHEDULE", "load: DAC_BAD_TABLE",
        "load: DAC_BAD_PERIOD", "load: DAC_BAD_OUTPUT",
        "load: DAC_OTHER_STORAGE", "load: DAC_BAD_SHAPING",
    };
    dac_program p;
    const unsigned idle = dac_sequencer_idle(&sequencer);

#ifdef BENCH_EMITTED
    if (!variation)
        emitted(&p, idle);
    else
#endif
        written(&p, idle);
    (void)variation;
    const dac_loaded outcome = dac_sequencer_load(&sequencer, &p);
    if (unfit) {
        refused |= outcome != DAC_LOADED;
        return;
    }
    bench_check(outcome == DAC_LOADED, outcomes[outcome]);
}

/* What waits is not to be replaced: a host would be told that the sequencer is busy. */
static void refuse(void)
{
    dac_program p;

    written(&p, dac_sequencer_idle(&sequencer));
    p.x.table = x_table[0];
    p.y.table = y_table[0];
    p.x.park_code = p.x.code_min;
    if (dac_sequencer_load(&sequencer, &p) == DAC_BUSY)
        refused = true;
}

static void write(unsigned region, uint32_t address, uint32_t data)
{
    play();
    if (!dac_sequencer_writable(&sequencer))
        dac_sequencer_answer(&sequencer); /* no ticks come that would */
    if (!dac_sequencer_writable(&sequencer)) {
        refuse();
        return;
    }
    const unsigned idle = dac_sequencer_idle(&sequencer);
    switch (region) {
    case PROGRAM:
        registers[address] = data;
        break;
    case X_TABLE:
        bench_check(address < BENCH_TABLE_WORDS, "a table of this length");
        x_table[idle][address] = (dac_word)data;
        break;
    case Y_TABLE:
        bench_check(address < BENCH_TABLE_WORDS, "a table of this length");
        y_table[idle][address] = (dac_word)data;
        break;
#ifndef BENCH_EMITTED
    case X_FOURIER:
        x_fourier[address] = (int32_t)data;
        break;
    case Y_FOURIER:
        y_fourier[address] = (int32_t)data;
        break;
    case SINE:
        sine[address] = (int32_t)data;
        if (sine_words <= address)
            sine_words = address + 1;
        break;
#endif
    default:
        bench_check(false, "a write");
    }
}

/* What the sequencer says of itself; that of a state that was not there before it is 0. */
static void state(void)
{
    play();
    dac_sequencer_answer(&sequencer);
    const dac_status status = dac_sequencer_status(&sequencer);
    const bool writable = dac_sequencer_writable(&sequencer);
    uint64_t *const words = states + STATE_WORDS * states_stored;

    bench_check(states_stored < STATES, "so many states");
    words[0] = (uint64_t)status.faults << 8 | (refused ? REFUSED : 0) | (writable ? WRITABLE : COMMITTED);
    words[1] = (uint64_t)status.fault_counts[1] << 32 | status.fault_counts[0];
    words[2] = (uint64_t)status.fault_counts[3] << 32 | status.fault_counts[2];
    words[3] = 0;
    states_stored++;
}

static void request(unsigned mask, uint32_t frames)
{
    play();
    if (mask & (WITHDRAW | RESET))
        commits_in = 0;
    if (mask & WITHDRAW)
        bench_check(dac_sequencer_withdraw(&sequencer), "withdraw");
    if (mask & (CLEAR_FAULTS | RESET))
        refused = false;
    if (mask & CLEAR_FAULTS)
        bench_check(dac_sequencer_clear_faults(&sequencer), "clear_faults");
    if (mask & ARM)
        bench_check(dac_sequencer_arm(&sequencer, frames), "arm");
    if (mask & TRIGGER)
        bench_check(dac_sequencer_trigger(&sequencer), "trigger");
    if (mask & PARK)
        bench_check(dac_sequencer_park(&sequencer), "park");
    if (mask & RESET)
        bench_check(dac_sequencer_reset(&sequencer), "reset");
    if (mask & UNDERRUN)
        dac_sequencer_report(&sequencer, DAC_FAULT_UNDERRUN);
    if (mask & COMMIT && !(mask & (WITHDRAW | RESET))) {
        if (dac_sequencer_writable(&sequencer))
            load(frames, mask & UNFIT);
        commits_in = mask & UNFIT ? 0 : 1;
    }
}

/* The first two words are the shape and the codes at power-up; then commands. After them come four captures, the counts
 * of faults, and those of states. */
void bench_play(bool fill)
{
    uint64_t word;

#ifdef BENCH_FILL
    fills = fill;
#else
    (void)fill;
#endif
    shape(bench_read());
    power_up(bench_read());
    while ((word = bench_read()) != END) {
        switch (word >> 60) {
        case WAIT:
            pass((uint32_t)word);
            break;
        case WRITE:
            if ((word >> 48 & 15) != SINE)
                pass(1);
            write(word >> 48 & 15, word >> 32 & 0xffff, (uint32_t)word);
            break;
        case REQUEST:
            pass(1);
            request(word >> 16 & 511, word & 0xffff);
            break;
        case STATE:
            pass(1);
            state();
            break;
        case EXTRA:
            pass(1);
            play();
            dac_sequencer_report(&sequencer, DAC_FAULT_OVERRUN);
            break;
        default:
            pass(1);
            period = (uint32_t)word;
            until = 0;
        }
    }
    play();
    const dac_status status = dac_sequencer_status(&sequencer);
    for (int i = 0; i < DAC_FAULTS; i++)
        bench_write(status.fault_counts[i]);
    for (unsigned i = 0; i < STATE_WORDS * states_stored; i++)
        bench_write(states[i]);
#ifdef BENCH_EMITTED
    for (unsigned i = 0; i < BENCH_CONSTANTS; i++)
        bench_write((uint64_t)bench_constants[i]);
    for (unsigned i = 0; i < BENCH_HASH_DIGITS; i++)
        bench_write((unsigned char)bench_hash[i]);
#endif
}
