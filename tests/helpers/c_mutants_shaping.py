"""Faults of shaped output: what is fed back, what is remembered and when it is forgotten; the same by runs."""

from c_faults import Mutant, changed

MUTANTS: tuple[Mutant, ...] = (
    *changed(
        "dac_shaping.c",
        "shaped",
        {
            "the second order feeds back as the first": ("next.back = next.newest + rise;", "next.back = next.newest;"),
            "the zero is rounded up": ("(zero * (int32_t)rise) >> 6", "(zero * (int32_t)rise + 63) >> 6"),
            "the zero is another": ("(zero * (int32_t)rise) >> 6", "(zero * (int32_t)rise) >> 5"),
            "the third remainder is the second": ("last.older - last.newest + next.newest", "next.newest"),
            "the second remainder is the third": ("next.older = last.newest;", "next.older = last.older;"),
            "a tick has half a code less": (
                " + bank->offset - ((int64_t)1 << (bank->gain_q - 1));",
                " + bank->offset;",
            ),
            "a tick's remainder has a bit more": (
                "fed, (UINT32_C(1) << bits) - 1, bank",
                "fed, (UINT32_C(2) << bits) - 1, bank",
            ),
            "the window of a shaped run is twice as wide": (
                "if (strayed >> bits >> bank->run_bits != 0)",
                "if (strayed >> bits >> bank->run_bits > 1)",
            ),
            "only the last code of a shaped run counts": ("            strayed |= fed;", "            strayed = fed;"),
        },
    ),
    *changed(
        "dac_shaping.c",
        "shaped short",
        {
            "short: a shaped run is not held in its window": (
                "strayed >> bits >> bank->run_bits != 0 || risen",
                "risen",
            ),
            "short: a shaped run may begin anywhere": (
                "if ((uint32_t)((int32_t)unrounded - axis->code + bank->run_half) >> bank->run_bits != 0)",
                "if (false)",
            ),
            "short: a shaped run's sample is rounded down": (
                "(UINT32_C(1) << (DAC_ABOVE - 1)) - (origin << DAC_ABOVE)",
                "0u - (origin << DAC_ABOVE)",
            ),
            "short: a shaped run loses its offset": ("+ (uint32_t)bank->run_offset - ", "- "),
        },
    ),
    *changed(
        "dac_sequencer.c",
        "shaped",
        {
            "a program begins with other remainders": ("UINT32_C(1) << (27 - axis->bits)", "0"),
            "y begins with the remainders of the old program": ("    forget(&s->y);\n", ""),
            "x keeps the remainders of ticks that y refused": (
                "        (void)dac_axis_run(&s->x, &bank->x, x, ticks);\n",
                "        const dac_shaper kept = s->x.shaper;\n        (void)dac_axis_run(&s->x, &bank->x, x, ticks);\n"
                "        s->x.shaper = kept;\n",
            ),
        },
    ),
    *changed(
        "dac_program.c",
        "shaped",
        {
            "a shaped run's gain has other fraction bits": (
                "b->run_gain = p->gain_word * (INT32_C(1) << up);",
                "b->run_gain = p->gain_word * (INT32_C(1) << (up - 1));",
            ),
            "a remainder has other bits": ("(uint8_t)(28 - p->dac_bits)", "(uint8_t)(27 - p->dac_bits)"),
            "there are no zeros": ("b->zero = p->shaping_zero;", "b->zero = 0;"),
        },
    ),
)
