"""Faults of one axis: table, rounding, clamp, slew guard; and the same by runs."""

from c_faults import Mutant, changed, removed

MUTANTS: tuple[Mutant, ...] = (
    *changed(
        "dac_arithmetic.h",
        "fill",
        {
            "the carry of the position is lost": ("(low < step->low ? 1u : 0u)", "0u"),
            "the sample is rounded down": ("((int32_t)1 << (14u - (guard)))", "((int32_t)0)"),
            "the sample's ties are rounded down": (
                "((int32_t)1 << (14u - (guard)))",
                "(((int32_t)1 << (14u - (guard))) - 1)",
            ),
            "the rise has no guard bits": (">> (15u - guard);", ">> 15u;"),
            "the word has no guard bits": ("here * ((int32_t)1 << guard)", "here"),
        },
    ),
    *changed(
        "dac_arithmetic.h",
        "wide",
        {
            "wide words have narrow guard bits": (
                "#define DAC_GUARD(bank) ((bank)->guard)",
                "#define DAC_GUARD(bank) 4",
            ),
        },
    ),
    *changed(
        "dac_arithmetic.h",
        "checks",
        {
            "a carry too many": ("low < step->low", "low <= step->low"),
            "two's complement is not coded": ("((uint32_t)code ^ axis->flip)", "((uint32_t)code)"),
            "words are not aligned": ("<< axis->shift)", "<< 0)"),
        },
    ),
    *changed(
        "dac_run.h",
        "fill",
        {
            "a run's window reaches below the limit": (
                "(uint32_t)(base - bank->code_min) <= (uint32_t)bank->run_room",
                "base <= bank->code_min + bank->run_room",
            ),
            "runs do not heed the limits": ("(uint32_t)(base - bank->code_min) <= (uint32_t)bank->run_room", "true"),
            "a run that ends early is a whole one": ("ticks < DAC_RUN ? ticks : DAC_RUN", "DAC_RUN"),
        },
    ),
    *changed(
        "dac_run.h",
        "step",
        {
            "a step reads no next word": ("bank->table[index + 1]", "bank->table[index]"),
        },
    ),
    *changed(
        "dac_run.h",
        "checks",
        {
            "the window of runs has one code too much room": (
                "bank->code_max - bank->code_min + 1 -",
                "bank->code_max - bank->code_min + 2 -",
            ),
            "a run's window reaches above the limit": (
                "<= (uint32_t)bank->run_room;",
                "<= (uint32_t)bank->run_room + 1;",
            ),
        },
    ),
    *changed(
        "dac_short.h",
        "short",
        {
            "short: the sample is rounded down": (
                "(UINT32_C(1) << (DAC_ABOVE - 1)) - (origin << DAC_ABOVE)",
                "0u - (origin << DAC_ABOVE)",
            ),
        },
    ),
    *removed(
        "dac_axis.c",
        "fill",
        {
            "the position does not follow a run": "        dac_axis_skip(axis, bank, played);\n",
        },
    ),
    *changed(
        "dac_axis.c",
        "fill",
        {
            "runs do not heed the slew guard": ("if (out_of_window >> bank->run_bits != 0)", "if (false)"),
            "a run's window is twice as wide": (
                "if (out_of_window >> bank->run_bits != 0)",
                "if (out_of_window >> (bank->run_bits + 1) != 0)",
            ),
            "only the last code of a run counts": (
                "out_of_window |= (uint32_t)(code - base)",
                "out_of_window = (uint32_t)(code - base)",
            ),
            "a run begins where the last one was refused": (
                "axis->code = code;\n        done += length;",
                "done += length;",
            ),
            "the first code of a run is not compared": (
                "    if (bank->run_entry != 0 && !may_enter(axis, bank))\n        return 0;\n",
                "",
            ),
            "runs move y while it is held": ("step = bank->holds ? 0 : ", "step = "),
            "y is skipped while it is held": (
                "    if (bank->holds)\n        return;\n    const uint64_t first",
                "    const uint64_t first",
            ),
            "a skip loses its upper carry": (
                "bank->step.high * ticks + (uint32_t)(second >> 32)",
                "bank->step.high * ticks",
            ),
        },
    ),
    *changed(
        "dac_arithmetic.h",
        "cubic",
        {
            "a spline's sums are rounded down": (" + (int32_t)((uint32_t)product >> 31);", ";"),
            "a spline's ties are rounded down": (
                "(int32_t)((uint32_t)product >> 31)",
                "((uint32_t)product > UINT32_C(0x80000000) ? 1 : 0)",
            ),
            "a spline's value has no middle": ("2 * ends + 8 * second", "2 * ends + 4 * second"),
            "a spline's slope is the way to the next word": ("12 * (third - first)", "12 * (third - second)"),
            "a spline has no curvature": ("24 * (ends - 2 * second)", "0"),
            "a spline is quadratic": ("16 * (fourth - first + 3 * (second - third))", "0"),
        },
    ),
    *changed(
        "dac_arithmetic.h",
        "cubic short",
        {
            "short: a spline's sums are rounded down": ("((sum + 512) >> 10)", "(sum >> 10)"),
            "short: a spline's ties are rounded down": ("((sum + 512) >> 10)", "((sum + 511) >> 10)"),
            "short: a spline has half of its fraction": (" + (value * by.lower >> 9)", ""),
            "short: a spline's fraction loses a bit above": ("(fraction) >> 9)", "(fraction) >> 9 & 0xffu)"),
            "short: a spline's fraction loses a bit in the middle": ("& 0x1ffu", "& 0xffu"),
        },
    ),
    *changed(
        "dac_axis.c",
        "cubic short",
        {
            "short: runs of lines are those of splines": (
                "    if (bank->cubic)\n        return play_spline",
                "    return play_spline",
            ),
        },
    ),
    *changed(
        "dac_short.h",
        "cubic short",
        {
            "short: a run's spline begins a segment late": (
                "track = dac_track_of(table, at, s.step)",
                "track = dac_track_of(table + 1, at, s.step)",
            ),
            "short: a run's spline rises by a unit more": (
                "dac_track_next(&track) - origin",
                "dac_track_next(&track) - origin + 1u",
            ),
            "short: a run of a spline is not held in its window": (
                "            if (b.out_of_window >> kind.bits >> bank->run_bits != 0 || ",
                "            if (",
            ),
        },
    ),
    *changed(
        "dac_axis.c",
        "cubic",
        {
            "runs of lines are those of splines": (
                "    if (bank->cubic)\n        return play_cubic",
                "    return play_cubic",
            ),
        },
    ),
    *changed(
        "dac_run.h",
        "cubic",
        {
            "runs of splines begin with the segment after it": (
                "words = table + (at >> 50);",
                "words = table + (at >> 50) + 1;",
            ),
            "runs of splines go on with the same segment": ("words + (goes_on ? 1 : 0)", "words"),
            "runs of splines leave a segment out": ("words + (goes_on ? 1 : 0)", "words + 1"),
            "runs of splines stay in a segment": ("track->segment = dac_segment_of(track->next++);", "(void)0;"),
            "runs of splines begin a tick early": ("(at - step) << 14", "at << 14"),
            "runs of splines have a bit less of fraction": (
                "(uint32_t)(track->way >> 46)",
                "(uint32_t)(track->way >> 47) << 1",
            ),
            "steps of splines are those of lines": ("    if (bank->cubic) {\n", "    if (false) {\n"),
        },
    ),
    *removed(
        "dac_axis.c",
        "step",
        {
            "there is no guard upwards": "rise > most ? most :",
        },
    ),
    *changed(
        "dac_axis.c",
        "step",
        {
            "the guard lets a code too many pass upwards": ("rise > most ? most :", "rise > most ? most + 1 :"),
            "there is no guard downwards": ("rise < -most ? -most : rise", "rise"),
            "the guard is one off downwards": ("rise < -most ? -most", "rise < -most ? 1 - most"),
            "a code is always there": ("return axis->code == target;", "return true;"),
            "nothing is held at code_min": ("code < bank->code_min ? bank->code_min : code >", "code >"),
            "nothing is held at code_max": (": code > bank->code_max ? bank->code_max : code;", ": code;"),
            "the upper limit is one off": (
                "code > bank->code_max ? bank->code_max",
                "code >= bank->code_max ? bank->code_max - 1",
            ),
            "the lower limit is one off": (
                "code < bank->code_min ? bank->code_min :",
                "code <= bank->code_min ? bank->code_min + 1 :",
            ),
            "what is held is no fault": ("        *outside = true;", "        *outside = *outside;"),
            "what is not held is a fault": ("if (clamped != code)", "if (clamped == code)"),
            "y moves on while it is held": ("    if (!bank->holds)\n        dac_advance", "    dac_advance"),
            "the position does not move": (
                "    if (!bank->holds)\n        dac_advance",
                "    if (false)\n        dac_advance",
            ),
        },
    ),
    *removed(
        "dac_short.h",
        "short",
        {
            "short: the slew guard is not heeded": "b.out_of_window >> kind.bits >> bank->run_bits != 0 || ",
            "short: the first of two words is lost": "            low += (uint32_t)here << 15;\n",
            "short: codes follow no run": (
                "            axis->code = kind.shaped ? (int32_t)b.out[-DAC_STRIDE] : (int32_t)b.last;\n"
            ),
        },
    ),
    *changed(
        "dac_short.h",
        "short",
        {
            "short: only the last code counts": ("    b->out_of_window |= value;", "    b->out_of_window = value;"),
            "short: a window is twice as wide": (
                "b.out_of_window >> kind.bits >> bank->run_bits != 0",
                "b.out_of_window >> kind.bits >> bank->run_bits > 1",
            ),
            "short: two words for all ticks": ("(at + (DAC_RUN - 1) * s.step) >> 47 == at >> 47", "true"),
            "short: two words for too many ticks": ("(DAC_RUN - 1) * s.step", "DAC_RUN / 2 * s.step"),
            "short: the offset is lost": ("+ (uint32_t)(offset >> DAC_FINE) - ", "- "),
        },
    ),
    *changed(
        "dac_arithmetic.h",
        "wide short",
        {
            "wide: a product loses a bit of the value": ("(uint32_t)value & 0x3fffu", "(uint32_t)value & 0x1fffu"),
            "wide: a step of the rule is rounded down": ("((sum + 16) >> 5)", "(sum >> 5)"),
            "wide: a line rises by half": ("(2 * unit)", "unit"),
        },
    ),
    *changed(
        "dac_short.h",
        "wide short",
        {
            "wide: the lower bits of the gain are lost": ("b->fine_gain * rise + b->fine_rest", "b->fine_rest"),
            "wide: the origin has no lower bits": ("b.fine_gain * origin + ", ""),
            "wide: a carry is lost": ("(uint32_t)((int32_t)b.fine_rest >> DAC_FINE)", "0"),
        },
    ),
    *removed(
        "dac_axis.c",
        "checks",
        {
            "a converter of 7 bits": "c->bits >= 8 && ",
            "a converter of 25 bits": "c->bits <= 24 && ",
            "a converter whose word is too short": "c->bits <= c->word_bits && ",
            "a code below zero at power-up": "c->power_up_code >= 0 && ",
            "a code too high at power-up": " && c->power_up_code < INT32_C(1) << c->bits",
        },
    ),
    *changed(
        "dac_axis.c",
        "checks",
        {
            "a converter too wide for its storage": (
                "c->word_bits <= DAC_OUTPUT_STORAGE_BITS\n        && ",
                "true\n        && ",
            ),
            "runs step by steps rounded down": (
                "(uint64_t)bank->step.high << 32 | bank->step.low >> 32) + 1",
                "(uint64_t)bank->step.high << 32 | bank->step.low >> 32)",
            ),
            "runs are as long as one likes": (
                "ticks - done < bank->run_most ? ticks - done : bank->run_most",
                "ticks - done",
            ),
            "a second run overwrites the first": ("out + done * DAC_STRIDE, most)", "out, most)"),
            "a skip loses its middle carry": ("+ (first >> 32);", ";"),
            "a skip loses its lowest bits": ("second << 32 | (first & 0xffffffffu)", "second << 32"),
        },
    ),
    *changed(
        "dac_axis.c",
        "checks",
        {
            "the first code of a run may rise by one more": ("rise <= bank->run_entry", "rise <= bank->run_entry + 1"),
            "the first code of a run may fall by one more": (
                "rise >= -bank->run_entry",
                "rise >= -bank->run_entry - 1",
            ),
        },
    ),
    *removed(
        "dac_short.h",
        "checks short",
        {
            "short: a wide rise is not seen": " || b.rise_or > 2 * spread - 1",
        },
    ),
    *changed(
        "dac_short.h",
        "checks short",
        {
            "short: only the last rise counts": ("    b->rise_or |= rise;", "    b->rise_or = rise;"),
            "short: a run may begin anywhere": (
                "(first + half) >> bank->run_bits != 0",
                "false",
            ),
        },
    ),
)

# Changes after which everything is as before, and why.
EQUIVALENT: dict[Mutant, str] = {
    Mutant(
        "a run's window is centred above the code", "dac_axis.c", "base = code - bank->run_half", "base = code"
    ): "The window is as wide, has the last code in it, and is held inside the limits; it is left sooner.",
    Mutant(
        "runs begin at positions rounded down",
        "dac_axis.c",
        "(uint64_t)axis->at.high << 32 | axis->at.low >> 32) + 1",
        "(uint64_t)axis->at.high << 32 | axis->at.low >> 32)",
    ): "Where a position is a whole fraction the parts cut off from start and steps add up to a whole unit, "
    "which the steps, rounded up, make good; where it is none it is further from one than any unit.",
}
