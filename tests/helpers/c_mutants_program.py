"""Faults of loading a program: what is refused, and what is derived."""

from c_faults import Mutant, changed, removed

MUTANTS: tuple[Mutant, ...] = (
    *changed(
        "dac_program.c",
        "fill",
        {
            "the quotient loses bits to its upper word": (
                "quotient.high << 1 | (uint32_t)(quotient.low >> 63)",
                "quotient.high << 1",
            ),
            "the division ends a bit early": ("if (zeros-- == 0)", "if (zeros-- == 1)"),
            "the gain of runs has other fraction bits": (
                "b->run_gain = p->gain_word * (INT32_C(1) << left)",
                "b->run_gain = p->gain_word * (INT32_C(1) << (left - 1))",
            ),
            "runs may be wider than the slew guard": ("if (widest > p->max_step)", "if (false)"),
            "the window of runs is twice as wide": ("(widest + 1) >> (bits + 1)", "(widest + 1) >> bits"),
            "the window of runs is one too wide": ("(widest + 1) >> (bits + 1)", "(widest + 2) >> (bits + 1)"),
            "a direct table stands still": ("{UINT32_C(1) << 15, 0}", "{0, 0}"),
            "y is never held": ("b->holds = p->hold_ticks != 1", "b->holds = 0"),
            "x has the program of y": ("derive(&bank->x, &p->x)", "derive(&bank->x, &p->y)"),
            "a window is widened where the slew guard acts": ("    if (step > allowed)\n        return bits;\n", ""),
            "the samples of words have no guard bits": (
                "UINT32_C(1) << b->guard; /* of a sample",
                "UINT32_C(1); /* of a sample",
            ),
            "the bank that plays is written": ("&s->bank[dac_sequencer_idle(s)]", "&s->bank[!dac_sequencer_idle(s)]"),
            "a program is committed for the first swap only": ("s->loaded_after = s->swaps", "s->loaded_after = 0"),
        },
    ),
    *removed(
        "dac_program.c",
        "step",
        {
            "the code is rounded down": "+ ((int64_t)1 << (p->gain_q - 1))",
        },
    ),
    *changed(
        "dac_program.c",
        "step",
        {
            "the step is rounded down": ("        dac_advance(&quotient, &one);", "        (void)one;"),
            "the fraction loses a bit": (
                "power_divided(79u + (CUBIC(p) ? 3u : 0u) + INDEX_BITS(p)",
                "power_divided(78u + INDEX_BITS(p)",
            ),
        },
    ),
    *removed(
        "dac_program.c",
        "checks",
        {
            "a window may begin behind its line": "window->first <= length && ",
            "a frame of no lines": "p->frame_lines != 0 && ",
            "more pixels than ticks of the trace": "has_pixels(&p->forward, p->pixels) && ",
            "more pixels than ticks of the retrace": " && has_pixels(&p->backward, p->pixels)",
            "a window without ticks has no pixels": "window->count == 0 || ",
            "forward is not looked at": "inside(&p->forward, p->line_ticks) && ",
            "backward is not looked at": "&& inside(&p->backward, p->line_ticks)",
            "up is not looked at": "inside(&p->up, p->frame_lines) && ",
            "down is not looked at": "&& inside(&p->down, p->frame_lines)",
            "no table": "p->table != NULL && ",
            "words of 25 bits": "p->bits <= (CUBIC(p) ? 21 : 24) && ",
            "words of another storage": "p->storage_bits == DAC_TABLE_STORAGE_BITS && ",
            "words that their storage does not hold": " && p->bits <= DAC_TABLE_STORAGE_BITS",
            "a direct table that is too long": " && p->length <= UINT32_C(1) << 17",
            "2^17 words": "INDEX_BITS(p) <= (CUBIC(p) ? 14 : 16) && ",
            "an interpolated table of any length": " && p->length == UINT32_C(1) << INDEX_BITS(p)",
            "x is held": "p->x.hold_ticks == 1 && ",
            "y is held for any time": "p->y.hold_ticks == ticks && ",
            "y is held for any number of lines": " && p->y.phase_period == lines",
            "a gain that is too low": "p->gain_word >= -(INT32_C(1) << 17) && ",
            "codes below 0": "0 <= p->code_min && ",
            "parking below the limits": "p->code_min <= p->park_code && ",
            "no step": "p->max_step >= 1 && ",
            "a step that is too large": " && p->max_step < INT32_C(1) << 24",
            "any bits of a code": "p->dac_bits == axis->bits && ",
            "any coding": "p->twos_complement == (axis->flip != 0) && ",
            "any alignment": " && shifted == (axis->shift != 0)",
            "alignment matters where there is no room": " && p->word_bits != p->dac_bits",
            "a program for no converter": "axis->bits != 0 && ",
            "a bank is written while it waits": "    if (!dac_sequencer_writable(s))\n        return DAC_BUSY;\n",
            "nobody knows that a program was loaded": "    s->loaded = 1;\n",
        },
    ),
    *changed(
        "dac_program.c",
        "checks",
        {
            "a window may end behind its line": ("window->count <= length - window->first", "true"),
            "a window may be a tick too long": (
                "window->count <= length - window->first",
                "window->count <= length - window->first + 1",
            ),
            "a line of no ticks": (
                "p->line_ticks - 1 < UINT32_C(1) << 24",
                "p->line_ticks <= UINT32_C(1) << 24 && p->line_ticks + 1",
            ),
            "a line of too many ticks": ("p->line_ticks - 1 < UINT32_C(1) << 24", "p->line_ticks != 0"),
            "a frame of too many ticks": ("p->frame_lines <= INT32_MAX / p->line_ticks", "true"),
            "a turn behind the line": ("p->turn_tick <= p->line_ticks", "true"),
            "the last word and the first are not compared": (
                "for (uint32_t i = 0; i < p->length; i++) {",
                "for (uint32_t i = 0; i + 1 < p->length; i++) {",
            ),
            "only falling words are steep": (
                "if (way > steepest)",
                "if (way > steepest && p->table[i] > p->table[i + 1])",
            ),
            "an advance is a word": ("(uint64_t)b->step.high + 1; ", "UINT64_C(32768);    "),
            "runs where the gain does not fit": (
                "largest_gain(p) > (uint32_t)INT32_MAX >> left",
                "largest_gain(p) > (uint32_t)INT32_MAX >> left << 1",
            ),
            "words of 7 bits": ("p->bits >= 8", "p->bits >= 7"),
            "any word behind the last one": (
                "DAC_TABLE_WORD(p->table[p->length]) == DAC_TABLE_WORD(p->table[0])",
                "true",
            ),
            "a direct table of any length": ("return p->length == p->phase_period && ", "return "),
            "4 words": ("INDEX_BITS(p) >= 3", "INDEX_BITS(p) >= 2"),
            "x has any period": ("p->x.phase_period == ticks", "p->x.phase_period != 0"),
            "y has any period": ("p->y.phase_period == ticks * lines", "p->y.phase_period != 0"),
            "a gain that is too high": ("p->gain_word < INT32_C(1) << 17", "true"),
            "any gain_q": ("p->gain_q == 16u + p->bits + guard_bits(p) - p->dac_bits", "true"),
            "parking above the limits": ("p->park_code <= p->code_max", "true"),
            "codes that the converter has not got": ("p->code_max < INT32_C(1) << p->dac_bits", "true"),
            "any bits of a word": ("p->word_bits == axis->word_bits", "true"),
            "a period of one advance": ("if (rest >= divisor) {", "if (rest >= divisor && divisor != 1) {"),
            "the offset of runs has other fraction bits": (
                "b->run_offset = b->offset * ((int64_t)1 << left)",
                "b->run_offset = b->offset * ((int64_t)1 << (left - 1))",
            ),
            "wrong guard bits of wide words": ("? 25u - p->bits : 4u", "? 24u - p->bits : 4u"),
            "ties of the code are rounded down": (
                "+ ((int64_t)1 << (p->gain_q - 1))",
                "+ ((int64_t)1 << (p->gain_q - 1)) - 1",
            ),
            "x is not looked at": ("if (x != DAC_LOADED || y != DAC_LOADED)", "if (y != DAC_LOADED)"),
            "y is not looked at": ("if (x != DAC_LOADED || y != DAC_LOADED)", "if (x != DAC_LOADED)"),
            "the converter is not looked at": ("!same_converter(p, axis) ?", "false ?"),
            "the table is not looked at": ("!good_table(p) ?", "false ?"),
            "the output is not looked at": ("!good_output(p) ?", "false ?"),
        },
    ),
    *changed(
        "dac_program.c",
        "checks short",
        {
            "short: a rise may be twice as wide": ("b->run_spread = 31 + DAC_FINE;", "b->run_spread = 32 + DAC_FINE;"),
            "short: a gain below zero": ("p->gain_word < 0 ? -p->gain_word : p->gain_word", "p->gain_word"),
            "short: a rise of more bits than there are": (
                "if (b->run_spread > 19 + DAC_FINE)\n        b->run_spread = 19 + DAC_FINE;",
                "if (b->run_spread > 21)\n        b->run_spread = 21;",
            ),
        },
    ),
)

# Changes after which everything is as before, and why.
EQUIVALENT: dict[Mutant, str] = {
    Mutant(
        "the division misses a remainder", "dac_program.c", "if (rest >= divisor) {", "if (rest > divisor) {", "step"
    ): "A rest that equals the divisor stays so: all further bits are ones, and rounding up carries through them.",
}
