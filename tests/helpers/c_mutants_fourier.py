"""Faults of tables from Fourier words."""

from c_faults import Mutant, changed, removed

MUTANTS: tuple[Mutant, ...] = (
    *removed(
        "dac_fourier.c",
        "checks",
        {
            "the mean is not rounded": " + (INT64_C(1) << (60 - bits))",
            "odd sines keep their sign": "    odd.a_sin = -odd.a_sin;\n",
            "odd cosines keep their sign": "    odd.b_cos = -odd.b_cos;\n",
            "the mean is lost": "    n0.a_cos += r->mean;\n",
            "the first word does not stand behind the last": (
                "    for (unsigned i = 0; i < DAC_WORDS_BEHIND; i++)\n        table[r.length + i] = table[i];\n"
            ),
            "a table without room is rendered": "room < DAC_TABLE_ROOM(index_bits) || ",
        },
    ),
    *changed(
        "dac_fourier.c",
        "checks",
        {
            "words are not saturated": ("if ((uint32_t)word + half >= 2 * half)", "if (false)"),
            "saturated to the wrong end": (
                "word < 0 ? -(int32_t)half : (int32_t)half - 1",
                "word > 0 ? -(int32_t)half : (int32_t)half - 1",
            ),
            "the highest word is one too high": (": (int32_t)half - 1;", ": (int32_t)half;"),
            "words that could overflow are rendered": ("return total < UINT64_C(1) << 32;", "return true;"),
            "the second harmonic for the fourth": ("even_terms(&n0, r, 4, angle)", "even_terms(&n0, r, 2, angle)"),
            "words are half as high": ("r.drop = 29 - bits", "r.drop = 30 - bits"),
        },
    ),
    *changed(
        "dac_fourier.c",
        "checks small",
        {
            "small: a sine for a cosine": ("sine[r->to_cosine] + (int64_t)b[n]", "sine[0] + (int64_t)b[n]"),
            "small: half an LSB too few": ("int64_t sum = r->mean;", "int64_t sum = 0;"),
        },
    ),
)
