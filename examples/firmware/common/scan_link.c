/* The link of a build. It accepts tables as long as those of the build, slow parts with as many knots and as long
 * slow tables as those of a scan at an angle that it is built from, and has the limits of that scan.
 * Options, with -D: LINK_X_INDEX_BITS and LINK_Y_INDEX_BITS for longer tables, LINK_SLOW_KNOTS and LINK_SLOW_INDEX_BITS
 * for more knots and longer slow tables of a device that is built from such a scan, LINK_HARMONICS (0: tables only),
 * LINK_MAX_JUMP in codes, DAC_LINK_RING; LINK_PERMITS, a function of the port, for an interlock; LINK_KEY_HEADER, a
 * file that defines LINK_KEY as the bytes of an array, and LINK_DEVICE, a name as a string; with a key the port has
 * random.h. With DAC_STORE=1 the port has scan_flash, and LINK_STORE_WHILE_PLAYING where writing to it does not stop
 * the processor. With DAC_LIBRARY LIBRARY and LIBRARY_UPPER are the names of a library of tablegen sweep, and
 * LIBRARY_HEADER its header. With DAC_LINK_Z the scan has the output z, and LINK_STOP_TICKS is a function of the port.
 */
#include "scan_link.h"

#include "names.h"
#include SCAN_HEADER
#if DAC_LINK_Z
#include SCAN_Z_HEADER
#endif
#if DAC_LIBRARY
#include LIBRARY_HEADER
#endif
#ifdef LINK_KEY_HEADER
#include LINK_KEY_HEADER
#include "random.h"
#endif

/* A table that is not interpolated need not have 2^n words. */
#define BITS_FOR(n) ((n) <= 8 ? 3 : (n) <= 16 ? 4 : (n) <= 32 ? 5 : (n) <= 64 ? 6 : (n) <= 128 ? 7 : (n) <= 256 ? 8 \
    : (n) <= 512 ? 9 : (n) <= 1024 ? 10 : (n) <= 2048 ? 11 : (n) <= 4096 ? 12 : (n) <= 8192 ? 13 : (n) <= 16384 ? 14 \
    : (n) <= 32768 ? 15 : 16)
#ifndef LINK_X_INDEX_BITS
#define LINK_X_INDEX_BITS BITS_FOR(CONSTANT(_X_TABLE_LENGTH))
#endif
#ifndef LINK_Y_INDEX_BITS
#define LINK_Y_INDEX_BITS BITS_FOR(CONSTANT(_Y_TABLE_LENGTH))
#endif
#ifndef LINK_HARMONICS
#define LINK_HARMONICS 64
#endif
#ifndef LINK_MAX_JUMP
#define LINK_MAX_JUMP UINT32_C(0xFFFFFF)
#endif
#if CONSTANT(_SINE_LENGTH) && LINK_HARMONICS
#define SINE NAMED(_sine)
#define SINE_BITS CONSTANT(_SINE_INDEX_BITS)
#define HARMONICS LINK_HARMONICS
#else /* a build without interpolated tables has no sine table, and cannot compute tables; nor can a small memory */
#define SINE NULL
#define SINE_BITS 0
#define HARMONICS 0
#endif

static dac_word x_tables[2][DAC_TABLE_ROOM(LINK_X_INDEX_BITS)], y_tables[2][DAC_TABLE_ROOM(LINK_Y_INDEX_BITS)];
static int32_t x_fourier[2 * HARMONICS + 1], y_fourier[2 * HARMONICS + 1];
/* A scan without operators has slow parts for z alone: its x and y have Fourier words in their place. */
#define TURNED (CONSTANT(_SLOW_PART) && !CONSTANT(_X_HARMONICS))
#define WORDS_OF(words) (sizeof(words) / sizeof(words)[0])
#define LARGER(a, b) ((a) > (b) ? (a) : (b))
#define SLOW_MEMORY(axis, bits, knots, index_bits)                                                                    \
    static int8_t axis##_second[2][UINT32_C(1) << (bits)];                                                            \
    static dac_word axis##_slow_tables[2][DAC_LINK_SLOW_ROOM(index_bits)];                                            \
    static dac_word axis##_mixed[DAC_TABLE_ROOM(bits)];                                                               \
    static int32_t axis##_gains[2][knots];                                                                            \
    static int16_t axis##_ratios[2][knots]
#define HAS_SLOW(axis)                                                                                                \
    , {{axis##_second[0], axis##_slow_tables[0], axis##_gains[0], axis##_ratios[0]},                                  \
       {axis##_second[1], axis##_slow_tables[1], axis##_gains[1], axis##_ratios[1]}}, axis##_mixed MOVES(axis)
#if DAC_MOVE && TURNED
#define MOVES(axis) , {axis##_moved_gains[0], axis##_moved_gains[1]}
#elif DAC_MOVE && DAC_SLOW_PART
#define MOVES(axis) , {NULL, NULL}
#else
#define MOVES(axis)
#endif
#if TURNED
#ifndef LINK_SLOW_KNOTS /* frames of fewer than 17 lines have fewer, and others are to be taken */
#define LINK_SLOW_KNOTS LARGER(LARGER(WORDS_OF(NAMED(_x_gains)), WORDS_OF(NAMED(_y_gains))), 17u)
#endif
#ifndef LINK_SLOW_INDEX_BITS /* behind the last word of a slow table stand its first three */
#define LINK_SLOW_INDEX_BITS BITS_FOR(LARGER(WORDS_OF(NAMED(_x_slow)), WORDS_OF(NAMED(_y_slow))) - 3)
#endif
SLOW_MEMORY(x, LINK_X_INDEX_BITS, LINK_SLOW_KNOTS, LINK_SLOW_INDEX_BITS);
SLOW_MEMORY(y, LINK_Y_INDEX_BITS, LINK_SLOW_KNOTS, LINK_SLOW_INDEX_BITS);
#if DAC_MOVE
static int32_t x_moved_gains[2][LINK_SLOW_KNOTS], y_moved_gains[2][LINK_SLOW_KNOTS];
#endif
#define SLOW_OF(axis) HAS_SLOW(axis)
#elif DAC_SLOW_PART
#define SLOW_OF(axis) , {{NULL, NULL, NULL, NULL}, {NULL, NULL, NULL, NULL}}, NULL MOVES(axis)
#else
#define SLOW_OF(axis)
#endif
static uint8_t hash[32];
#ifdef LINK_KEY
static const uint8_t key[] = {LINK_KEY};
/* No other instrument with this key has it; on hardware better a serial number. */
static const char device[] = LINK_DEVICE;
typedef char link_device_has_4_to_32_characters[sizeof device - 1 >= 4 && sizeof device - 1 <= 32 ? 1 : -1];
#endif

#if DAC_LINK_Z
#ifndef LINK_Z_INDEX_BITS /* of the table of z, and of the one that rests */
#define LINK_Z_INDEX_BITS BITS_FOR(LARGER(CONSTANT(_Z_X_TABLE_LENGTH), CONSTANT(_Z_Y_TABLE_LENGTH)))
#endif
#ifndef LINK_Z_SLOW_KNOTS
#define LINK_Z_SLOW_KNOTS LARGER(LARGER(WORDS_OF(NAMED(_z_x_gains)), WORDS_OF(NAMED(_z_y_gains))), 17u)
#endif
#ifndef LINK_Z_SLOW_INDEX_BITS
#define LINK_Z_SLOW_INDEX_BITS BITS_FOR(LARGER(WORDS_OF(NAMED(_z_x_slow)), WORDS_OF(NAMED(_z_y_slow))) - 3)
#endif
static dac_word z_tables[2][DAC_TABLE_ROOM(LINK_Z_INDEX_BITS)], rest_tables[2][DAC_TABLE_ROOM(LINK_Z_INDEX_BITS)];
SLOW_MEMORY(z, LINK_Z_INDEX_BITS, LINK_Z_SLOW_KNOTS, LINK_Z_SLOW_INDEX_BITS);
SLOW_MEMORY(rest, LINK_Z_INDEX_BITS, LINK_Z_SLOW_KNOTS, LINK_Z_SLOW_INDEX_BITS);
void LINK_STOP_TICKS(bool stopped);
#endif

#define AXIS(NAME, axis, bits) AXIS_OF(NAME, axis, bits, axis##_fourier, SLOW_OF(axis))
#define AXIS_OF(NAME, axis, bits, fourier, slow)                                                                      \
    {                                                                                                                 \
        CONVERTER(CONSTANT(NAME)), {CONSTANT(NAME##_CODE_MIN), CONSTANT(NAME##_CODE_MAX),                             \
        CONSTANT(NAME##_MAX_STEP), LINK_MAX_JUMP}, CONSTANT(NAME##_TABLE_BITS), bits, DAC_TABLE_ROOM(bits),           \
        {axis##_tables[0], axis##_tables[1]}, fourier slow                                                            \
    }

#ifdef LINK_PERMITS
bool LINK_PERMITS(void);
#endif
#if DAC_STORE
dac_store scan_store;
#endif

static const dac_link_config config = {
    .x = AXIS(_X, x, LINK_X_INDEX_BITS),
    .y = AXIS(_Y, y, LINK_Y_INDEX_BITS),
    .harmonics = HARMONICS,
    .sine_index_bits = SINE_BITS,
    .sine = SINE,
    .update_rate_hz = UPDATE_RATE_HZ,
#if TURNED
    .slow_knots = LINK_SLOW_KNOTS,
    .slow_index_bits = LINK_SLOW_INDEX_BITS,
#endif
    .hash = hash,
#ifdef LINK_PERMITS
    .permits = LINK_PERMITS,
#endif
#if DAC_STORE
    .store = &scan_store,
#ifdef LINK_STORE_WHILE_PLAYING
    .store_while_playing = true,
#endif
#endif
#if DAC_LIBRARY
    .library = JOIN(LIBRARY, _library),
    .library_programs = JOIN(LIBRARY_UPPER, _LIBRARY_PROGRAMS),
#endif
#ifdef LINK_KEY
    .key_bytes = sizeof key,
    .key = key,
    .identity = (const uint8_t *)device,
    .identity_bytes = sizeof device - 1,
    .random = random_bytes,
    .milliseconds = clock_milliseconds,
#endif
#if DAC_LINK_Z
    .stop_ticks = LINK_STOP_TICKS,
#endif
};

#if DAC_LINK_Z
static const dac_link_config config_of_z = {
    .x = AXIS_OF(_Z_X, z, LINK_Z_INDEX_BITS, NULL, HAS_SLOW(z)),
    .y = AXIS_OF(_Z_Y, rest, LINK_Z_INDEX_BITS, NULL, HAS_SLOW(rest)),
    .update_rate_hz = UPDATE_RATE_HZ,
    .slow_knots = LINK_Z_SLOW_KNOTS,
    .slow_index_bits = LINK_Z_SLOW_INDEX_BITS,
};

const dac_link_config *scan_link_of_z(void)
{
    return &config_of_z;
}
#endif

static uint8_t digit(char c)
{
    return (uint8_t)(c <= '9' ? c - '0' : c - 'a' + 10);
}

const dac_link_config *scan_link(void)
{
    const char *text = CONSTANT(_HASH);

    for (unsigned i = 0; i < sizeof hash; i++, text += 2)
        hash[i] = (uint8_t)(digit(text[0]) << 4 | digit(text[1]));
    return &config;
}
