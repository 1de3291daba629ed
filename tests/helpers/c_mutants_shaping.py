"""Faults of shaped output: what is fed back, what is remembered and when it is forgotten; the same by runs."""

from c_faults import Mutant, changed

# The copies of the fast path for all converters, by place.
_FOR_ALL = {
    "shaped wide": ("return PLAY(bank->order,", "return PLAY({},"),
    "shaped wide short": ("return PLAY(bank->order,", "return PLAY({},"),
    "shaped wide few": ("FEEDER(feed_any, bank->order,", "FEEDER(feed_any, {},"),
}
_ORDERS = {
    "other converters feed back by the first order": "1",
    "other converters have no second order": "bank->order == 2 ? 3u : bank->order",
    "other converters have no third order": "bank->order == 3 ? 2u : bank->order",
}

MUTANTS: tuple[Mutant, ...] = (
    *(
        Mutant(breaks, "dac_shaping.c", old, new.format(order), where)
        for where, (old, new) in _FOR_ALL.items()
        for breaks, order in _ORDERS.items()
    ),
    *changed(
        "dac_shaping.c",
        "shaped wide few",
        {
            "other converters have another remainder": (
                "FEEDER(feed_any, bank->order, bank->remainder_bits,",
                "FEEDER(feed_any, bank->order, bank->remainder_bits + 1,",
            ),
        },
    ),
    *changed(
        "dac_run.h",
        "shaped",
        {
            "the second order feeds back as the first": ("next.back = next.newest + rise;", "next.back = next.newest;"),
            "the zero is rounded up": ("(weight * (int32_t)rise) >> 6", "(weight * (int32_t)rise + 63) >> 6"),
            "the zero is another": ("((bank)->zero + 64)", "((bank)->zero / 2 + 64)"),
            "the zero has no weight of its own": ("((bank)->zero + 64)", "((bank)->zero)"),
            "the third remainder is the second": ("next.back = last.older +", "next.back = last.newest +"),
            "the second remainder is the third": ("next.older = last.newest;", "next.older = last.older;"),
        },
    ),
    *changed(
        "dac_shaping.c",
        "shaped",
        {
            "a tick has half a code less": (
                " + bank->offset - ((int64_t)1 << (bank->gain_q - 1));",
                " + bank->offset;",
            ),
            "a tick's remainder has a bit more": (
                "fed, (UINT32_C(1) << bits) - 1, bank",
                "fed, (UINT32_C(2) << bits) - 1, bank",
            ),
            "the window of a shaped run is twice as wide": (
                "if (out_of_window >> bits >> bank->run_bits != 0)\n            break;",
                "if (out_of_window >> bits >> bank->run_bits > 1)\n            break;",
            ),
            "only the last code of a shaped run counts": (
                "            out_of_window |= fed;",
                "            out_of_window = fed;",
            ),
        },
    ),
    *changed(
        "dac_shaping.c",
        "shaped few",
        {
            "few: a block is not held in its window": (
                "    if (out_of_window >> bits >> bank->run_bits != 0)\n        return false;\n",
                "",
            ),
            "few: only the last code of a block counts": ("    out_of_window |= fed;  ", "    out_of_window = fed;  "),
            "few: a block forgets its remainders": ("    axis->shaper = shaper;\n    axis->code", "    axis->code"),
            "few: a block's codes are not followed": (
                "    axis->code = (int32_t)out[-DAC_STRIDE];\n    return",
                "    return",
            ),
            "few: values have a bit more": ("(values[k] >> DAC_BELOW)", "(values[k] >> (DAC_BELOW - 1))"),
            "few: all is fed back by the highest order": (
                "remainder_bits == 12 && bank->order == 3)",
                "remainder_bits == 12)",
            ),
            "few: what is left of a block goes by fours": ("fours && end - values == DAC_RUN", "fours"),
            "few: one of four ticks is played twice": ("            FEED(2)\n", "            FEED(1)\n"),
            "few: the codes of four ticks lie closer": ("out[(k) * DAC_STRIDE]", "out[k]"),
        },
    ),
    *changed(
        "dac_short.h",
        "shaped few",
        {
            "few: blocks follow each other on the same place": ("            b.out = b.stop;\n", ""),
            "few: a block that is refused is played": (
                "b.rise_or > 2 * spread - 1 || !kind.feeder(axis",
                "kind.feeder(axis",
            ),
        },
    ),
    *changed(
        "dac_short.h",
        "shaped short",
        {
            "short: a shaped run is not held in its window": (
                "b.out_of_window >> kind.bits >> bank->run_bits != 0 || b.rise_or",
                "b.rise_or",
            ),
            "short: a shaped run may begin anywhere": (
                "first + (half >> 1) >= half",
                "false",
            ),
            "short: a shaped run's sample is rounded down": (
                "(UINT32_C(1) << (DAC_ABOVE - 1)) - (origin << DAC_ABOVE)",
                "0u - (origin << DAC_ABOVE)",
            ),
            "short: a shaped run loses its offset": ("scaled ? bank->run_offset : bank->offset", "bank->offset"),
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
            "what shaping adds to a step is forgotten": (
                "    aside = b->order < 2 ? b->order : 2 + (b->zero + 63) / 64;\n",
                "",
            ),
            "what shaping adds to the first code is forgotten": ("p->max_step - aside", "p->max_step"),
        },
    ),
)
