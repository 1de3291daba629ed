/* Tables from Fourier words: s(k) = a0 + sum_n a_n cos(n k) + b_n sin(n k), angles in units of 2 pi / length, in exact
 * integer sums, so that neither the order of the terms nor the use of their symmetries matters.
 */
#include "dac_sequencer.h"

/* Values that are the same for all words of a table. */
struct renderer {
    dac_word *table;
    const int32_t *words;      /* a0, a1..aH, b1..bH */
    const int32_t *sine;
    size_t to_cosine;          /* words from a sine to the cosine of the same angle */
    unsigned shift;            /* right shift from a 32-bit angle to an index of the sine table */
    unsigned harmonics;
    uint32_t length;
    int64_t mean;              /* a0 and half an LSB, Q4.60 */
    unsigned drop;             /* bits of the upper half of a sum below the LSB of a word */
    uint32_t half;             /* 2^(bits - 1) */
};

static inline void put(const struct renderer *r, uint32_t k, int64_t sum)
{
    int32_t word = (int32_t)(sum >> 32) >> r->drop;
    const uint32_t half = r->half;
    if ((uint32_t)word + half >= 2 * half)
        word = word < 0 ? -(int32_t)half : (int32_t)half - 1;
    r->table[k] = (dac_word)word;
}

#if DAC_SMALL

static void render(const struct renderer *r, unsigned shift)
{
    const int32_t *const b = r->words + r->harmonics;

    for (uint32_t k = 0; k < r->length; k++) {
        int64_t sum = r->mean;
        for (uint32_t n = 1; n <= r->harmonics; n++) {
            const int32_t *const sine = r->sine + ((n * k << shift) >> r->shift);
            sum += (int64_t)r->words[n] * sine[r->to_cosine] + (int64_t)b[n] * sine[0];
        }
        put(r, k, sum);
    }
}

#else

/* The terms are summed by n modulo 4, since these sums, with other signs, also belong to length/4 - k, and each of
 * these two k serves length/2 - k, length/2 + k and length - k too: eight words for one walk through the sine table. */

/* Two terms per iteration, for speed. */
#if defined(__GNUC__) && __GNUC__ >= 8 && !defined(__clang__)
#define TWICE _Pragma("GCC unroll 2")
#else
#define TWICE
#endif

/* Sums over n of words times cosines and sines, Q4.60. */
struct products {
    int64_t a_cos, b_sin, a_sin, b_cos;
};

/* n = first, first + 4.. ; n even, where a_sin and b_cos are not needed. */
static inline void even_terms(struct products *sum, const struct renderer *r, unsigned first, uint32_t angle)
{
    const int32_t *const sine = r->sine, *const cosine = sine + r->to_cosine;
    const int32_t *a = r->words + first;
    const size_t to_b = r->harmonics;
    const unsigned shift = r->shift;
    const uint32_t step = 4 * angle;
    uint32_t at = first * angle;
    int64_t a_cos = 0, b_sin = 0;

    TWICE
    for (unsigned left = (r->harmonics + 4 - first) / 4; left != 0; left--) {
        const uint32_t i = at >> shift;
        a_cos += (int64_t)a[0] * cosine[i];
        b_sin += (int64_t)a[to_b] * sine[i];
        a += 4;
        at += step;
    }
    sum->a_cos = a_cos;
    sum->b_sin = b_sin;
}

static inline void odd_terms(struct products *sum, const struct renderer *r, unsigned first, uint32_t angle)
{
    const int32_t *const sine = r->sine;
    const int32_t *a = r->words + first;
    const size_t to_b = r->harmonics, to_cosine = r->to_cosine;
    const unsigned shift = r->shift;
    const uint32_t step = 4 * angle;
    uint32_t at = first * angle;

    TWICE
    for (unsigned left = (r->harmonics + 4 - first) / 4; left != 0; left--) {
        const int32_t *const p = sine + (at >> shift);
        const int32_t s = p[0], c = p[to_cosine];
        sum->a_cos += (int64_t)a[0] * c;
        sum->a_sin += (int64_t)a[0] * s;
        sum->b_sin += (int64_t)a[to_b] * s;
        sum->b_cos += (int64_t)a[to_b] * c;
        a += 4;
        at += step;
    }
}

/* Words k, length/2 - k, length/2 + k, length - k from the sums over even and odd n at k. */
static inline void put_four(const struct renderer *r, uint32_t k, int64_t cos_even, int64_t cos_odd, int64_t sin_even,
                            int64_t sin_odd)
{
    const int64_t same = cos_even + cos_odd, other = cos_even - cos_odd;
    const int64_t sum = sin_even + sin_odd, difference = sin_even - sin_odd;
    const uint32_t half = r->length / 2;

    put(r, k, same + sum);
    put(r, half - k, other - difference);
    put(r, half + k, other + difference);
    put(r, (r->length - k) & (r->length - 1), same - sum);
}

/* The words of k and of length/4 - k. There the cosine of n k becomes the sine and the other way round if n is odd, and
 * signs change with n modulo 4. */
static void put_eight(const struct renderer *r, uint32_t k, uint32_t angle)
{
    struct products n0, n2, odd = {0, 0, 0, 0};

    odd_terms(&odd, r, 3, angle);
    odd.a_sin = -odd.a_sin;
    odd.b_cos = -odd.b_cos;
    odd_terms(&odd, r, 1, angle);
    even_terms(&n0, r, 4, angle);
    n0.a_cos += r->mean;
    even_terms(&n2, r, 2, angle);
    put_four(r, k, n0.a_cos + n2.a_cos, odd.a_cos, n0.b_sin + n2.b_sin, odd.b_sin);
    put_four(r, r->length / 4 - k, n0.a_cos - n2.a_cos, odd.a_sin, n2.b_sin - n0.b_sin, odd.b_cos);
}

static void render(const struct renderer *r, unsigned shift)
{
    for (uint32_t k = 0; k <= r->length / 8; k++)
        put_eight(r, k, k << shift);
}

#endif

static bool fits(const int32_t *words, unsigned count)
{
    uint64_t total = 0;
    while (count-- != 0)
        total += words[count] < 0 ? 0u - (uint32_t)words[count] : (uint32_t)words[count];
    return total < UINT64_C(1) << 32; /* 4.0 */
}

bool dac_synthesize(dac_word *table, uint32_t room, unsigned index_bits, unsigned bits, const int32_t *words,
                    unsigned harmonics, const int32_t *sine, unsigned sine_index_bits)
{
    struct renderer r;

    if (DAC_PROGMEM || index_bits < 3 || index_bits > 16
        || room < DAC_TABLE_ROOM(index_bits) || sine_index_bits < index_bits || sine_index_bits > 16
        || bits < 8 || bits > 24 || bits > DAC_TABLE_STORAGE_BITS || harmonics < 1
        || harmonics > 4096 || !fits(words, 2 * harmonics + 1))
        return false;
    r.table = table;
    r.sine = sine;
    r.words = words;
    r.to_cosine = (size_t)(UINT32_C(1) << sine_index_bits >> 2);
    r.shift = 32 - sine_index_bits;
    r.harmonics = harmonics;
    r.length = UINT32_C(1) << index_bits;
    r.drop = 29 - bits;
    r.half = UINT32_C(1) << (bits - 1);
    r.mean = (int64_t)words[0] * (INT64_C(1) << 30) + (INT64_C(1) << (60 - bits));
    render(&r, 32 - index_bits);
    for (unsigned i = 0; i < DAC_WORDS_BEHIND; i++)
        table[r.length + i] = table[i];
    return true;
}
