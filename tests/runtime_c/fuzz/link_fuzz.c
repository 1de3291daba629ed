/* A whole device for libFuzzer: bytes from the line, ticks in between, and what has to hold whatever comes.
 *
 * An input is a byte of options and then commands:
 *     0x00..0x3f           so many ticks, one by one or as a buffer
 *     0x40 + type, n       a well-formed frame of this type with n bytes of payload, of the next number
 *     0x50 + type, n       the same with the number of the last one
 *     0x60, n              n bytes as they are
 *     0x61, n              an upload of a good image with changes (place, difference) in n bytes; table or Fourier
 *                          words
 *     0x62                 its COMMIT
 *     0x63, n              n times the main loop, and no more for the bytes that follow
 *     0x64                 the interlock changes
 *     0x65                 a reset
 *     0x66, n              100 n milliseconds
 *     0x67, n              the COMMIT of an upload with a mode, compiled with DAC_COMMIT_MODES=1
 *     0x68, n              a MOVE to the words of the last upload with changes (place, difference) in n bytes, compiled
 *                          with DAC_MOVE=1
 * Frames get their tags, so that a key keeps nobody from the states behind it. Compiled with DAC_SPLINE=1 uploads are
 * of cubic tables where the options say so; a shaped program is a change of word 11 of the page of an axis. Compiled
 * with DAC_LINK_Z=1 the device has a second sequencer; where the options say so its first program and uploads have z,
 * and every second change is one of the image of z. Compiled with DAC_SLOW_PART=1 uploads have slow parts where the
 * options say so, and every second change is one of the words behind the program words.
 */
#include <stdlib.h>
#include <string.h>

#include "dac_link_parts.h"

enum { X_BITS = 4, Y_BITS = 3, X_WORDS = 1 << X_BITS, Y_WORDS = 1 << Y_BITS, HARMONICS = 3 };
enum { LINE_TICKS = 24, LINES = 3 };
enum { WITH_KEY = 1, WITH_INTERLOCK = 2, WITHOUT_BOOT = 4, HURRIED = 8, FOURIER = 16, CUBIC = 32, FILL = 64, Z = 128 };
enum { SLOW = 128 };
enum { MOST_TICKS = 1500, MOST_FILL = 64, POWER_UP = 2000 };
enum { CODE_MIN = 1000, CODE_MAX = 60000, MAX_STEP = 9000, MAX_JUMP = 60000 };

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define REQUIRE(condition)                                                                                            \
    do {                                                                                                              \
        if (!(condition))                                                                                             \
            abort();                                                                                                  \
    } while (0)

static dac_sequencer sequencer;
static dac_link link_;
static dac_word x_tables[2][DAC_TABLE_ROOM(X_BITS)], y_tables[2][DAC_TABLE_ROOM(Y_BITS)];
#if DAC_LINK_Z
static dac_sequencer z_sequencer;
static dac_link z_link;
static dac_word z_tables[2][DAC_TABLE_ROOM(X_BITS)], rest_tables[2][DAC_TABLE_ROOM(Y_BITS)];
static int32_t z_words[1], rest_words[1];
static bool stopped;
#endif
static int32_t x_words[2 * HARMONICS + 1], y_words[2 * HARMONICS + 1];
static int32_t sine[5 * X_WORDS / 4];
static const uint8_t key[16] = {1, 2, 3};
static const uint8_t hash[32] = {9}, identity[4] = {4, 5, 6, 7};
static bool permits;
static uint32_t clock_ms;

static dac_word boot_x[DAC_TABLE_ROOM(X_BITS)], boot_y[DAC_TABLE_ROOM(Y_BITS)];
static dac_program boot;
static uint8_t image[DAC_LINK_PROGRAM + 2 * (X_WORDS + Y_WORDS)];
#if DAC_SLOW_PART
enum { KNOTS = 3, SLOW_BITS = 3, SLOW_WORDS = 1 << SLOW_BITS };
#define SLOW_MEMORY(axis, bits, words)                                                                                \
    static int8_t axis##_second[2][words];                                                                            \
    static dac_word axis##_slow[2][DAC_LINK_SLOW_ROOM(SLOW_BITS)], axis##_mixed[DAC_TABLE_ROOM(bits)];                 \
    static int32_t axis##_gains[2][KNOTS], axis##_moved_gains[2][KNOTS];                                              \
    static int16_t axis##_ratios[2][KNOTS]
#define SLOW_OF(axis)                                                                                                 \
    , {{axis##_second[0], axis##_slow[0], axis##_gains[0], axis##_ratios[0]},                                         \
       {axis##_second[1], axis##_slow[1], axis##_gains[1], axis##_ratios[1]}}, axis##_mixed,                          \
       {axis##_moved_gains[0], axis##_moved_gains[1]}
SLOW_MEMORY(x, X_BITS, X_WORDS);
SLOW_MEMORY(y, Y_BITS, Y_WORDS);
static uint8_t slow_image[DAC_LINK_PROGRAM + 3 * (X_WORDS + Y_WORDS) + 2 * (2 * SLOW_WORDS + 5 * KNOTS)];
#else
#define SLOW_OF(axis)
#endif
static uint8_t fourier[DAC_LINK_PROGRAM + 8 * (2 * HARMONICS + 1)];

static bool permitted(void)
{
    return permits;
}

static uint32_t milliseconds(void)
{
    return clock_ms;
}

#if DAC_LINK_Z
/* Ticks are stopped in pairs, and none comes between. */
static void stop_ticks(bool stop)
{
    REQUIRE(stop != stopped);
    stopped = stop;
}

static const dac_link_config z_config = {
    .x = {{16, 16, false, false, POWER_UP}, {CODE_MIN, CODE_MAX, MAX_STEP, MAX_JUMP}, 16, X_BITS,
          DAC_TABLE_ROOM(X_BITS), {z_tables[0], z_tables[1]}, z_words},
    .y = {{16, 16, false, false, POWER_UP}, {CODE_MIN, CODE_MAX, MAX_STEP, MAX_JUMP}, 16, Y_BITS,
          DAC_TABLE_ROOM(Y_BITS), {rest_tables[0], rest_tables[1]}, rest_words},
};
#endif

static dac_link_config config = {
    .x = {{16, 16, false, false, POWER_UP}, {CODE_MIN, CODE_MAX, MAX_STEP, MAX_JUMP}, 16, X_BITS,
          DAC_TABLE_ROOM(X_BITS), {x_tables[0], x_tables[1]}, x_words SLOW_OF(x)},
    .y = {{16, 16, false, false, POWER_UP}, {CODE_MIN, CODE_MAX, MAX_STEP, MAX_JUMP}, 16, Y_BITS,
          DAC_TABLE_ROOM(Y_BITS), {y_tables[0], y_tables[1]}, y_words SLOW_OF(y)},
    .harmonics = HARMONICS,
    .sine_index_bits = X_BITS,
    .sine = sine,
    .key = key,
    .hash = hash,
    .identity = identity,
    .identity_bytes = sizeof identity,
    .boot_persists = true,
    .milliseconds = milliseconds,
#if DAC_SLOW_PART
    .slow_knots = KNOTS,
    .slow_index_bits = SLOW_BITS,
#endif
#if DAC_LINK_Z
    .stop_ticks = stop_ticks,
#endif
};

/* A good program and its two images, made once. */

static void put_words(uint8_t *at, const uint32_t *words, unsigned count)
{
    for (unsigned i = 0; i < count; i++)
        dac_link_put(at + 4 * i, words[i]);
}

static void put_axis(uint8_t *page, uint32_t period, uint32_t harmonics)
{
    const uint64_t whole = UINT64_C(1) << 32, offset = UINT64_C(30000) << 20;
    const uint32_t words[] = {(uint32_t)(whole / period), (uint32_t)(whole % period), period, 40000,
                              (uint32_t)(offset & 0x3FFFF), (uint32_t)(offset >> 18), 2000, 58000, 8000, 20000,
                              harmonics};
    put_words(page, words, sizeof words / sizeof words[0]);
}

static void put_program(uint8_t *bytes, uint32_t harmonics)
{
    const uint32_t scan[] = {LINE_TICKS, LINES, 1, 12, 2, 8, 14, 8, 0, 2, 0, 0, 4, 0};
    put_words(bytes, scan, sizeof scan / sizeof scan[0]);
    put_axis(bytes + 64, LINE_TICKS, harmonics);
    put_axis(bytes + 128, LINE_TICKS * LINES, harmonics);
}

#if DAC_SLOW_PART
/* Words of `bytes` bytes each, the lowest first; returns what is behind them. */
static uint8_t *put_part(uint8_t *at, unsigned count, unsigned bytes, int32_t first, int32_t step)
{
    for (unsigned i = 0; i < count; i++)
        for (unsigned byte = 0; byte < bytes; byte++)
            *at++ = (uint8_t)((uint32_t)(first + (int32_t)i * step) >> 8 * byte);
    return at;
}

/* The tables of the other image with a slow part on both axes. */
static void put_slow_image(void)
{
    const uint64_t whole = UINT64_C(1) << 32;
    const uint32_t slow[] = {0, KNOTS | SLOW_BITS << 8, (LINES + KNOTS - 2) / (KNOTS - 1), (uint32_t)(whole / LINES),
                             (uint32_t)(whole % LINES)};
    const uint8_t *from = image + DAC_LINK_PROGRAM;
    uint8_t *at = slow_image + DAC_LINK_PROGRAM;

    memcpy(slow_image, image, DAC_LINK_PROGRAM);
    put_axis(slow_image + 128, LINE_TICKS, 0);
    for (unsigned axis = 0; axis < 2; axis++) {
        const unsigned words = axis == 0 ? X_WORDS : Y_WORDS;
        uint8_t *const page = slow_image + 64 * (axis + 1);
        dac_link_put(page + 4 * DAC_LINK_GAIN, 2000);
        put_words(page + 4 * DAC_LINK_SHAPING_WORD, slow, 5);
        memcpy(at, from, 2 * words);
        from += 2 * words;
        at = put_part(at + 2 * words, words, 1, -20, 5);
        at = put_part(at, SLOW_WORDS, 2, -8000, 2000);
        at = put_part(at, KNOTS, 3, 30000, 3000);
        at = put_part(at, KNOTS, 2, 1000, -700);
    }
}
#endif

static void furnish(void)
{
    /* sin(2 pi k / 16) in Q2.30 */
    static const int32_t quarter[] = {0, 410903207, 759250125, 992008094, 1073741824};
    for (int k = 0; k < 5 * X_WORDS / 4; k++) {
        const int at = k % 8 <= 4 ? k % 8 : 8 - k % 8;
        sine[k] = k % 16 < 8 ? quarter[at] : -quarter[at];
    }
    for (int k = 0; k < X_WORDS; k++)
        boot_x[k] = (dac_word)(1500 * (k < 8 ? k : 16 - k) - 6000);
    for (int k = 0; k < Y_WORDS; k++)
        boot_y[k] = (dac_word)(1000 * k - 4000);
    for (int k = 0; k < DAC_WORDS_BEHIND; k++) {
        boot_x[X_WORDS + k] = boot_x[k];
        boot_y[Y_WORDS + k] = boot_y[k];
    }
    put_program(image, 0);
    put_program(fourier, HARMONICS);
    for (int k = 0; k < X_WORDS + Y_WORDS; k++) {
        const uint16_t word = (uint16_t)(k < X_WORDS ? boot_x[k] / 2 : boot_y[k - X_WORDS]);
        image[DAC_LINK_PROGRAM + 2 * k] = (uint8_t)word;
        image[DAC_LINK_PROGRAM + 2 * k + 1] = (uint8_t)(word >> 8);
    }
#if DAC_SLOW_PART
    put_slow_image();
#endif
    for (int k = 0; k < 2 * (2 * HARMONICS + 1); k++)
        dac_link_put(fourier + DAC_LINK_PROGRAM + 4 * k, (uint32_t)(80000000 - 11000000 * k));
}

/* What has to hold. */

typedef struct {
    int32_t x, y; /* the codes of the last tick */
    uint8_t markers;
    uint32_t ticks, line_ticks; /* of the line so far, and of the whole line */
    uint32_t swaps;
    /* of the program that plays, as it was taken */
    dac_word x_table[DAC_TABLE_ROOM(X_BITS)], y_table[DAC_TABLE_ROOM(Y_BITS)];
#if DAC_SLOW_PART
    int32_t x_gains[KNOTS], y_gains[KNOTS];
#endif
} watch;

static watch watched;
#if DAC_LINK_Z
static watch z_watched;
#endif
static dac_link_reader reader;

/* How many of the first words stand behind the last. */
static uint32_t words_behind(const dac_bank_axis *axis)
{
#if DAC_SPLINE
    return axis->cubic ? 3 : 1;
#else
    (void)axis;
    return 1;
#endif
}

/* The table of a program; with a slow part others are mixed into it. */
static const dac_word *table_of(const dac_bank_axis *axis)
{
#if DAC_SLOW_PART
    if (axis->slow != NULL && axis->slow->second != NULL)
        return axis->fast;
#endif
    return axis->table;
}

#if DAC_SLOW_PART
static void keep_gains(int32_t *copy, const dac_bank_axis *axis)
{
    if (axis->slow != NULL)
        memcpy(copy, axis->slow->gains, axis->slow->gain_knots * sizeof *copy);
}

static void watch_gains(const int32_t *copy, const dac_bank_axis *axis)
{
    if (axis->slow != NULL)
        REQUIRE(memcmp(copy, axis->slow->gains, axis->slow->gain_knots * sizeof *copy) == 0);
}
#endif

static void keep_table(dac_word *copy, const dac_bank_axis *axis)
{
    memcpy(copy, table_of(axis), (axis->length + words_behind(axis)) * sizeof *copy);
    for (uint32_t k = 0; k < words_behind(axis); k++)
        REQUIRE(copy[axis->length + k] == copy[k]);
}

static void watch_memory(const dac_sequencer *s, watch *w)
{
    const dac_bank *const bank = s->now;

    if (bank == NULL)
        return;
    REQUIRE(bank->x.length <= X_WORDS && bank->y.length <= Y_WORDS);
    if (s->swaps != w->swaps) {
        w->swaps = s->swaps;
        REQUIRE(bank->x.code_min >= CODE_MIN && bank->x.code_max <= CODE_MAX && bank->x.max_step <= MAX_STEP);
        REQUIRE(bank->y.code_min >= CODE_MIN && bank->y.code_max <= CODE_MAX && bank->y.max_step <= MAX_STEP);
        keep_table(w->x_table, &bank->x);
        keep_table(w->y_table, &bank->y);
#if DAC_SLOW_PART
        keep_gains(w->x_gains, &bank->x);
        keep_gains(w->y_gains, &bank->y);
#endif
    }
    REQUIRE(memcmp(w->x_table, table_of(&bank->x), (bank->x.length + words_behind(&bank->x)) * sizeof(dac_word)) == 0);
    REQUIRE(memcmp(w->y_table, table_of(&bank->y), (bank->y.length + words_behind(&bank->y)) * sizeof(dac_word)) == 0);
#if DAC_SLOW_PART
    watch_gains(w->x_gains, &bank->x);
    watch_gains(w->y_gains, &bank->y);
#endif
}

static void watch_memories(void)
{
    watch_memory(&sequencer, &watched);
#if DAC_LINK_Z
    watch_memory(&z_sequencer, &z_watched);
#endif
}

/* `requests`: that acted before it. */
static void watch_tick(const dac_sequencer *s, watch *w, const dac_tick *tick, unsigned requests)
{
    const int32_t x = tick->x, y = tick->y;

    REQUIRE(x >= CODE_MIN && x <= CODE_MAX && y >= CODE_MIN && y <= CODE_MAX);
    REQUIRE(abs(x - w->x) <= MAX_STEP && abs(y - w->y) <= MAX_STEP);
    REQUIRE((tick->markers & (DAC_SWAPPED | DAC_PLAYING | DAC_LINE)) != (DAC_SWAPPED | DAC_PLAYING));
    /* A line is whole, and of one program, unless the scan was stopped and started again. */
    if ((tick->markers & DAC_LINE) != 0) {
        REQUIRE((w->markers & DAC_PLAYING) == 0 || requests > 1 || w->ticks == w->line_ticks);
        w->ticks = 0;
        w->line_ticks = s->now->schedule.line_ticks;
    }
    w->ticks++;
    w->markers = tick->markers;
    w->x = x;
    w->y = y;
    watch_memory(s, w);
}

/* A tick of a sequencer, which has so many requests in front of it. */
static void step(dac_sequencer *s, watch *w, dac_tick *tick)
{
    const unsigned requests = (uint8_t)(s->head - s->tail);

    dac_sequencer_step(s, tick);
    watch_tick(s, w, tick, requests);
}

#if DAC_LINK_Z
/* x, y and z are of one scan, on one tick; a z that belongs to none rests. */
static void watch_both(const dac_tick *tick, const dac_tick *of_z)
{
    const uint8_t common = DAC_PLAYING | DAC_LINE | DAC_FRAME | DAC_BACKWARD;

    if (link_.plays_z)
        REQUIRE(((tick->markers ^ of_z->markers) & common) == 0);
    else
        REQUIRE((of_z->markers & DAC_PLAYING) == 0);
}
#endif

static void work(unsigned most)
{
    int byte;

    for (bool more = true; more && most != 0; most--) {
        more = dac_link_work(&link_);
        watch_memories();
        while ((byte = dac_link_transmit(&link_)) >= 0) {
            REQUIRE(dac_link_read_byte(&reader, (uint8_t)byte) != DAC_LINK_BAD);
            more = true;
        }
    }
}

/* A buffer, which is what as many steps make of it. */
static void fill_one(dac_sequencer *s, watch *w, dac_tick *played, unsigned ticks)
{
    static dac_sequencer before, filled;
    dac_output codes[2 * MOST_FILL];
    uint8_t markers[MOST_FILL];

    memcpy(&before, s, sizeof before);
#if DAC_SLOW_PART
    dac_word x_before[DAC_TABLE_ROOM(X_BITS)], y_before[DAC_TABLE_ROOM(Y_BITS)];
    memcpy(x_before, x_mixed, sizeof x_before);
    memcpy(y_before, y_mixed, sizeof y_before);
#endif
    dac_sequencer_fill(s, codes, codes + 1, markers, ticks);
    memcpy(&filled, s, sizeof filled);
    memcpy(s, &before, sizeof before);
#if DAC_SLOW_PART
    memcpy(x_mixed, x_before, sizeof x_before);
    memcpy(y_mixed, y_before, sizeof y_before);
#endif
    for (unsigned i = 0; i < ticks; i++) {
        step(s, w, &played[i]);
        REQUIRE(played[i].x == codes[2 * i] && played[i].y == codes[2 * i + 1] && played[i].markers == markers[i]);
    }
    REQUIRE(memcmp(&filled, s, sizeof filled) == 0);
}

/* Buffers; the link works in between. */
static unsigned fill(unsigned ticks)
{
    dac_tick played[MOST_FILL];

    fill_one(&sequencer, &watched, played, ticks);
#if DAC_LINK_Z
    dac_tick of_z[MOST_FILL];
    fill_one(&z_sequencer, &z_watched, of_z, ticks);
    for (unsigned i = 0; i < ticks; i++)
        watch_both(&played[i], &of_z[i]);
#endif
    work(4 * ticks);
    return ticks;
}

static bool fills;

static unsigned tick(unsigned ticks)
{
    if (fills && ticks != 0)
        return fill(ticks);
    for (unsigned i = 0; i < ticks; i++) {
        dac_tick one;
        step(&sequencer, &watched, &one);
#if DAC_LINK_Z
        dac_tick of_z;
        REQUIRE(!stopped);
        step(&z_sequencer, &z_watched, &of_z);
        watch_both(&one, &of_z);
#endif
        work(4);
    }
    return ticks;
}

/* What is said. */

#if DAC_LINK_Z
static void start_z(uint8_t options)
{
    const bool plays = (options & Z) != 0;

    REQUIRE(dac_sequencer_init(&z_sequencer, &z_config.x.converter, &z_config.y.converter));
    REQUIRE(dac_link_init_z(&link_, &z_link, &z_config, &z_sequencer, plays) == DAC_LINK_STARTED);
    memset(&z_watched, 0, sizeof z_watched);
    z_watched.x = z_watched.y = POWER_UP;
    if (plays && !(options & WITHOUT_BOOT))
        REQUIRE(dac_sequencer_load(&z_sequencer, &boot) == DAC_LOADED && dac_sequencer_commit(&z_sequencer));
}
#endif

static void start(uint8_t options, uint32_t count)
{
    config.key_bytes = options & WITH_KEY ? sizeof key : 0;
    config.permits = options & WITH_INTERLOCK ? permitted : NULL;
    clock_ms = UINT32_MAX - 5000;
    REQUIRE(dac_sequencer_init(&sequencer, &config.x.converter, &config.y.converter));
    REQUIRE(dac_link_init(&link_, &config, &sequencer, count) == DAC_LINK_STARTED);
    memset(&watched, 0, sizeof watched);
    memset(&reader, 0, sizeof reader);
    watched.x = watched.y = POWER_UP;
#if DAC_LINK_Z
    start_z(options);
#endif
    permits = true;
    if (!(options & WITHOUT_BOOT))
        REQUIRE(dac_sequencer_load(&sequencer, &boot) == DAC_LOADED && dac_sequencer_commit(&sequencer));
}

static bool hurried;

static void feed(const uint8_t *bytes, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        dac_link_receive(&link_, bytes[i]);
        if (!hurried && i % 64 == 63)
            work(UINT32_MAX);
    }
    work(hurried ? 1 : UINT32_MAX);
}

static void say(uint8_t type, uint8_t seq, const uint8_t *payload, uint8_t count)
{
    uint8_t wire[260];

    wire[1] = type;
    wire[2] = seq;
    dac_link_put(wire + 3, 77);
    memcpy(wire + 7, payload, count);
    feed(wire, dac_link_seal(wire, (uint16_t)(6 + count)));
}

static void hello(void)
{
    static const uint8_t version = 1;
    say(DAC_LINK_HELLO, 0, &version, 1);
}

/* With the tag that it needs. */
static void say_tagged(uint8_t type, uint8_t seq, const uint8_t *payload, uint8_t count, const uint8_t *digest)
{
    uint8_t whole[6 + 244 + 16];
    dac_link_mac m;

    if (config.key_bytes == 0 || count > 200) {
        say(type, seq, payload, count);
        return;
    }
    say(DAC_LINK_CHALLENGE, 0, payload, 0);
    whole[0] = type;
    whole[1] = seq;
    dac_link_put(whole + 2, 77);
    memcpy(whole + 6, payload, count);
    dac_link_mac_begin(&m, 16, key, sizeof key);
    dac_link_mac_add(&m, link_.nonce, 16);
    dac_link_mac_add(&m, whole, (uint8_t)(6 + count));
    if (digest != NULL)
        dac_link_mac_add(&m, digest, 32);
    dac_link_mac_end(&m, whole + 6 + count);
    say(type, seq, whole + 6, (uint8_t)(count + 16));
}

#if DAC_SLOW_PART
static uint8_t sent[sizeof slow_image];
#else
static uint8_t sent[(sizeof fourier > sizeof image ? sizeof fourier : sizeof image) + sizeof image];
#endif
static size_t sent_bytes;

/* The image of z behind that of x and y, and what BEGIN says of it; returns the bytes of this. */
static uint8_t add_z(uint8_t options, uint8_t *info)
{
#if DAC_LINK_Z
    if (options & Z) {
        memcpy(sent + sent_bytes, image, sizeof image);
        sent_bytes += sizeof image;
        dac_link_put(info + 48, sizeof image);
        memcpy(info + 52, info + 40, 8);
        return 60;
    }
#endif
    (void)options;
    (void)info;
    return 48;
}

static void upload(uint8_t options, const uint8_t *changes, size_t count)
{
    uint8_t info[60] = {0}, part[4 + 240];
    const bool as_fourier = (options & FOURIER) != 0;
    const uint8_t cubic = options & CUBIC ? 128 : 0;
    const uint8_t shapes[] = {X_BITS + cubic, 16, 16, 0, Y_BITS + cubic, 16, 16, 0};
    uint32_t crc = DAC_LINK_CRC;

#if DAC_SLOW_PART
    const bool has_slow = (options & SLOW) != 0;
    const size_t first = has_slow ? sizeof slow_image : as_fourier ? sizeof fourier : sizeof image;
    memcpy(sent, has_slow ? slow_image : as_fourier ? fourier : image, first);
#else
    const size_t first = as_fourier ? sizeof fourier : sizeof image;
    memcpy(sent, as_fourier ? fourier : image, first);
#endif
    sent_bytes = first;
    memcpy(info + 40, shapes, sizeof shapes);
    const uint8_t info_bytes = add_z(options, info);
    for (size_t i = 0; i + 1 < count; i += 2) {
        uint8_t *const at = sent + (sent_bytes != first && (i & 2) != 0 ? first + changes[i] % sizeof image
                                                                      : changes[i] % first);
#if DAC_SLOW_PART
        uint8_t *const behind = sent + (DAC_LINK_PROGRAM + changes[i]) % first;
        uint8_t *const place = (i & 2) != 0 && has_slow ? behind : at;
        *place = (uint8_t)(*place + changes[i + 1]);
#else
        *at = (uint8_t)(*at + changes[i + 1]);
#endif
    }
    for (size_t i = 0; i < sent_bytes; i++)
        crc = dac_link_crc(crc, sent[i]);
    dac_link_put(info + 32, (uint32_t)sent_bytes);
    dac_link_put(info + 36, ~crc);
    say(DAC_LINK_BEGIN, 0, info, info_bytes);
    for (size_t at = 0; at < sent_bytes; at += 101) {
        const uint8_t some = (uint8_t)(sent_bytes - at < 101 ? sent_bytes - at : 101);
        dac_link_put(part, (uint32_t)at);
        memcpy(part + 4, sent + at, some);
        say(DAC_LINK_DATA, 0, part, (uint8_t)(4 + some));
    }
}

/* Bytes of a COMMIT, which may have a mode. */
static void commit(uint8_t seq, uint8_t mode, uint8_t bytes)
{
    uint8_t payload[5], digest[32];
    uint32_t crc = DAC_LINK_CRC;
    dac_link_mac m;

    dac_link_mac_begin(&m, 32, NULL, 0);
    for (size_t i = 0; i < sent_bytes; i++) {
        crc = dac_link_crc(crc, sent[i]);
        dac_link_mac_byte(&m, sent[i]);
    }
    dac_link_mac_end(&m, digest);
    dac_link_put(payload, ~crc);
    payload[4] = mode;
    say_tagged(DAC_LINK_COMMIT, seq, payload, bytes, digest);
}

#if DAC_MOVE
/* A MOVE of the program that plays, to the words of the last upload with changes; with factors if it has slow parts. */
static void move(uint8_t seq, uint8_t options, const uint8_t *changes, size_t count)
{
    uint8_t payload[DAC_LINK_MOVE_BYTES + DAC_LINK_FACTOR_BYTES] = {0};
    const uint8_t bytes = DAC_SLOW_PART && (options & SLOW) ? sizeof payload : DAC_LINK_MOVE_BYTES;

    dac_link_put(payload, dac_sequencer_status(&sequencer).swaps);
    for (unsigned axis = 0; axis < 2; axis++) {
        memcpy(payload + 4 + 12 * axis, sent + 64 * (axis + 1) + 4 * DAC_LINK_GAIN, 12);
        dac_link_put(payload + DAC_LINK_MOVE_BYTES + 4 * axis, 60000);
    }
    for (size_t i = 0; i + 1 < count; i += 2) {
        uint8_t *const at = payload + changes[i] % bytes;
        *at = (uint8_t)(*at + changes[i + 1]);
    }
    say_tagged(DAC_LINK_MOVE, seq, payload, bytes, NULL);
}
#endif

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static bool furnished;
    uint8_t seq = 0, options;
    unsigned ticks = 0;
    uint32_t starts = 0;

    if (size == 0)
        return 0;
    options = *data++;
    size--;
    if (!furnished) {
        furnish();
        /* The program of the firmware is what an upload of the good image would be. */
        start(WITHOUT_BOOT, 0);
        hurried = false;
        hello();
        upload(0, NULL, 0);
        dac_link_program_of(&link_, &boot);
        boot.x.table = boot_x;
        boot.y.table = boot_y;
        furnished = true;
    }
    start(options, starts++);
    hurried = (options & HURRIED) != 0;
    fills = (options & FILL) != 0;
    sent_bytes = 0;
    hello();
    while (size != 0 && ticks < MOST_TICKS) {
        const uint8_t command = *data++;
        size_t count;
        size--;
        if (command < 0x40) {
            ticks += tick(command);
            continue;
        }
        if (command == 0x62) {
            commit(++seq, 0, 4);
            continue;
        }
        if (command == 0x64) {
            permits = !permits;
            continue;
        }
        if (command == 0x65) {
            start(options, starts++);
            hello();
            continue;
        }
        if (size == 0)
            break;
        count = *data++;
        size--;
        if (command == 0x63) {
            work((unsigned)count);
            continue;
        }
        if (command == 0x66) {
            clock_ms += 100 * (uint32_t)count;
            continue;
        }
#if DAC_COMMIT_MODES
        if (command == 0x67) {
            commit(++seq, (uint8_t)count, 5);
            continue;
        }
#endif
        count = count < size ? count : size;
        if (command < 0x60)
            say_tagged(command & 15, command < 0x50 ? ++seq : seq, data, (uint8_t)(count < 228 ? count : 228), NULL);
        else if (command == 0x61)
            upload(options, data, count);
#if DAC_MOVE
        else if (command == 0x68)
            move(++seq, options, data, count);
#endif
        else
            feed(data, count);
        data += count;
        size -= count;
    }
    tick(40);
    work(UINT32_MAX);
    return 0;
}
