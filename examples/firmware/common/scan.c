/* The programs of a build. */
#include "scan.h"

#include "names.h"
#include SCAN_HEADER
#if DAC_LINK_Z
#include SCAN_Z_HEADER
#endif

#if !DAC_SLOW_PART
const dac_program scan_whole = PROGRAM(SCAN_UPPER, SCAN);
#endif
const dac_converter scan_x_converter = CONVERTER(CONSTANT(_X));
const dac_converter scan_y_converter = CONVERTER(CONSTANT(_Y));
#if DAC_LINK_Z
const dac_converter scan_z_converter = CONVERTER(CONSTANT(_Z_X));
const dac_converter scan_z_rest_converter = CONVERTER(CONSTANT(_Z_Y));
#endif

#if CONSTANT(_SLOW_PART)
bool scan_half(dac_program *program, unsigned place)
{
    *program = scan_whole;
    (void)place;
    return false;
}
#else
static dac_word x_tables[2][CONSTANT(_X_TABLE_LENGTH) + 1], y_tables[2][CONSTANT(_Y_TABLE_LENGTH) + 1];

static bool halve(dac_axis_program *axis, dac_word *table, const int32_t *words, unsigned harmonics)
{
    axis->gain_word /= 2;
    if (axis->index_bits == 0)
        return true; /* a direct table cannot be computed here: use the table of the whole scan */
    axis->table = table;
#if CONSTANT(_SINE_LENGTH)
    return dac_synthesize(table, axis->length + 1, axis->index_bits, axis->bits, words, harmonics, NAMED(_sine),
                          CONSTANT(_SINE_INDEX_BITS));
#else
    (void)words;
    (void)harmonics;
    return false;
#endif
}

bool scan_half(dac_program *program, unsigned place)
{
    *program = scan_whole;
    return halve(&program->x, x_tables[place], NAMED(_x_fourier), CONSTANT(_X_HARMONICS))
        && halve(&program->y, y_tables[place], NAMED(_y_fourier), CONSTANT(_Y_HARMONICS));
}
#endif
