"""Faults of the sequencer: requests, swaps, ticks, markers, reports."""

from c_faults import Mutant, changed, removed

MUTANTS: tuple[Mutant, ...] = (
    *removed(
        "dac_sequencer.c",
        "fill",
        {
            "faults are not cleared": "    s->faults = 0;\n",
            "the place in a period goes on": "    axis->at.high = 0;\n",
            "a trigger does not disarm": "    s->armed = false;\n",
            "a program begins where the last one was": "    if (s->running)\n        begin(s);",
            "valid before it has settled": " && s->settle_left == 0",
            "lines of the way down do not image": " || in(&plan->down, s->line)",
            "every line images": " && (in(&plan->up, s->line) || in(&plan->down, s->line))",
            "pixels go on from the last window": (
                "    if (tick == window->first)\n        s->pixel_rest = window->count;\n"
            ),
            "pixels do not take off their width": "            s->pixel_rest -= window->count;\n",
            "y steps on every line": "    if (bank->y.holds)\n",
            "x stays where a longer run has left it": "        s->x.at = at;\n",
            "x's code is that of the longer run": (
                "        s->x.code = ticks != 0 ? (int32_t)x[(ticks - 1) * DAC_STRIDE] : code;\n"
            ),
        },
    ),
    *changed(
        "dac_sequencer.c",
        "fill",
        {
            "counts of faults are not cleared": ("        s->fault_counts[i] = 0;", "        (void)i;"),
            "the other set of tables is named": ("return s->playing == 0 ? 1 : 0;", "return s->playing == 1 ? 1 : 0;"),
            "the queue does not go round": (
                "s->request[head % DAC_REQUESTS] = what;",
                "s->request[head % (DAC_REQUESTS - 1)] = what;",
            ),
            "withdraw parks": ("return request(s, WITHDRAW, 0);", "return request(s, PARK, 0);"),
            "reset parks only": ("return request(s, RESET, 0);", "return request(s, PARK, 0);"),
            "faults count twice": (
                "s->fault_counts[i] = s->fault_counts[i] + 1",
                "s->fault_counts[i] = s->fault_counts[i] + 2",
            ),
            "a scan begins in mid-line": ("    s->tick = 0;\n    s->line = 0;\n", "    s->line = 0;\n"),
            "a scan begins in mid-frame": ("    s->tick = 0;\n    s->line = 0;\n", "    s->tick = 0;\n"),
            "x goes on where a scan begins": (
                "    s->line = 0;\n    to_start(&s->x);\n    to_start(&s->y);\n",
                "    s->line = 0;\n    to_start(&s->y);\n",
            ),
            "y goes on where a scan begins": ("    to_start(&s->x);\n    to_start(&s->y);\n", "    to_start(&s->x);\n"),
            "a scan does not settle": ("s->settle_left = s->now->schedule.settle_lines", "s->settle_left = 0"),
            "catching up is a fault": ("s->catching_up = true;", "s->catching_up = false;"),
            "a trigger is taken unarmed": ("if (!s->armed || s->running", "if (s->running"),
            "a trigger is taken while a scan runs": ("!s->armed || s->running || (s", "!s->armed || (s"),
            "a trigger is lost before the first program is taken": (
                "(s->now == NULL && !s->waiting)",
                "s->now == NULL",
            ),
            "every scan is without end": ("s->endless = s->armed_frames == 0", "s->endless = true"),
            "a frame too many": ("s->frames_left = s->armed_frames;", "s->frames_left = s->armed_frames + 1;"),
            "park does not disarm": ("s->armed = s->running = false;", "s->running = false;"),
            "park does not stop": ("s->armed = s->running = false;", "s->armed = false;"),
            "withdraw is ignored": ("    case WITHDRAW:\n        s->waiting = 0;", "    case WITHDRAW:"),
            "arm is ignored": ("    case ARM:\n        s->armed = true;", "    case ARM:"),
            "arm changes the scan that runs": (
                "s->armed_frames = argument;",
                "s->armed_frames = s->frames_left = argument;",
            ),
            "reset does not empty the idle bank": ("    case RESET:\n        s->waiting = 0;", "    case RESET:"),
            "reset does not stop": ("        park(s);\n        clear_faults(s);", "        clear_faults(s);"),
            "reset does not clear faults": ("        park(s);\n        clear_faults(s);", "        park(s);"),
            "requests act in the wrong order": (
                "        act(s, s->request[tail % DAC_REQUESTS], s->argument[tail % DAC_REQUESTS]);",
                (
                    "        const unsigned at = (head - 1u - (tail - s->tail)) % DAC_REQUESTS;\n"
                    "        act(s, s->request[at], s->argument[at]);"
                ),
            ),
            "a swap in mid-line": ("if (!s->waiting || (s->running && s->tick != 0))", "if (!s->waiting)"),
            "a swap only while nothing runs": ("(s->running && s->tick != 0)", "s->running"),
            "the banks do not change places": ("s->playing = s->playing == 0 ? 1 : 0;", "s->playing = 0;"),
            "the bank before goes on": (
                "    s->now = &s->bank[s->playing];\n",
                "    s->now = s->now == NULL ? &s->bank[0] : s->now;\n",
            ),
            "a program is taken again and again": ("written */\n    s->waiting = 0;", "written */"),
            "a window is a tick longer": ("at - window->first < window->count", "at - window->first <= window->count"),
            "a window begins a tick late": (
                "at - window->first < window->count",
                "at - window->first - 1 < window->count",
            ),
            "the turn is no edge": (
                "{plan->turn_tick, plan->forward.first,",
                "{plan->forward.first, plan->forward.first,",
            ),
            "the end of the forward window is no edge": (
                "plan->forward.first + plan->forward.count,\n",
                "plan->forward.first,\n",
            ),
            "the backward window is no edge": (
                "plan->backward.first, plan->backward.first + plan->backward.count",
                "0, 0",
            ),
            "edges are a tick late": ("most = edges[i] - tick;", "most = edges[i] - tick + 1;"),
            "the way back does not image": ("in(&plan->backward, tick) ? &plan->backward : NULL", "NULL"),
            "no line marker": ("all | DAC_LINE |", "all |"),
            "every line is a frame": ("(s->line == 0 ? DAC_FRAME : 0)", "DAC_FRAME"),
            "the line marker replaces the others": ("(uint8_t)(all | DAC_LINE", "(uint8_t)(DAC_PLAYING | DAC_LINE"),
            "no pixel at the first tick of a window": ("s->pixel_rest = window->count;", "s->pixel_rest = 0;"),
            "pixels are a tick late": ("s->pixel_rest >= window->count", "s->pixel_rest > window->count"),
            "nothing settles": ("        s->settle_left--;", "        (void)0;"),
            "y never steps": ("    if (bank->y.holds)\n", "    if (false)\n"),
            "a frame is a line longer": (
                "s->line + 1 != bank->schedule.frame_lines",
                "s->line != bank->schedule.frame_lines",
            ),
            "a scan plays on": (
                "        s->running = false;\n}\n\nDAC_CODE_ATTR static uint8_t play",
                "        s->frames_left = 1;\n}\n\nDAC_CODE_ATTR static uint8_t play",
            ),
            "a clamp is no fault": ("        dac_sequencer_report(s, DAC_FAULT_CLAMP);", "        (void)0;"),
            "a clamp is a slew fault": ("DAC_FAULT_CLAMP);", "DAC_FAULT_SLEW);"),
            "it catches up for ever": (
                "    if (reached)\n        s->catching_up = false;\n",
                "    if (reached) {\n    }\n",
            ),
            "holding back is no fault": ("    else if (!s->catching_up)\n", "    else if (false)\n"),
            "x does not park": ("parked = dac_axis_approach(&s->x, &bank->x, bank->x.park_code);", "parked = true;"),
            "y parks where x does": (
                "dac_axis_approach(&s->y, &bank->y, bank->y.park_code)",
                "dac_axis_approach(&s->y, &bank->y, bank->x.park_code)",
            ),
            "one axis is enough to be parked": ("parked &= dac_axis_approach(", "parked |= dac_axis_approach("),
            "never parked": ("return parked ? DAC_PARKED : 0;", "return 0;"),
            "no swap marker": ("swap(s) ? DAC_SWAPPED : 0", "swap(s) ? 0 : 0"),
            "fills do not answer requests": ("    dac_sequencer_answer(s);\n    for (;", "    for (;"),
            "runs are valid in spite of faults": (
                "mark(s, !s->faults, markers, ticks)",
                "mark(s, true, markers, ticks)",
            ),
            "a run is played before a swap": ("if (s->running && (s->tick != 0 || !s->waiting))", "if (s->running)"),
            "a fill forgets where its markers are": ("            markers += done;", "            markers += 1;"),
        },
    ),
    *removed(
        "dac_sequencer.c",
        "step",
        {
            "the last bits of a period go on": "    axis->at.low = 0;\n",
        },
    ),
    *changed(
        "dac_sequencer.c",
        "step",
        {
            "a swap in mid-line by steps": ("if (!s->waiting || (s->running && s->tick != 0))", "if (!s->waiting)"),
            "a swap a tick late": ("(s->running && s->tick != 0)", "(s->running && s->tick != 1)"),
            "the backward sweep begins a tick late": ("tick >= plan->turn_tick", "tick > plan->turn_tick"),
            "valid outside the window": ("window != NULL && clean", "clean"),
            "valid while faulty": ("window != NULL && clean && ", "window != NULL && "),
            "a line is a tick longer": (
                "s->tick != bank->schedule.line_ticks",
                "s->tick != bank->schedule.line_ticks + 1",
            ),
            "a line does not end": (
                "        return;\n    s->tick = 0;\n    if (s->settle_left",
                "        return;\n    if (s->settle_left",
            ),
            "x does not begin again": ("    to_start(&s->x);\n    if (bank->y.holds)", "    if (bank->y.holds)"),
            "y does not begin again": (
                "    s->line = 0;\n    to_start(&s->y);\n    if (!s->endless",
                "    s->line = 0;\n    if (!s->endless",
            ),
            "one axis is enough to be there": ("reached &= dac_axis_step(", "reached |= dac_axis_step("),
            "x alone decides": ("    reached &= dac_axis_step(", "    dac_axis_step("),
            "valid before it is there": ("reached && !s->faults, &markers", "!s->faults, &markers"),
            "valid in spite of an old fault": ("reached && !s->faults, &markers", "reached && !outside, &markers"),
            "steps do not answer requests": (
                "{\n    dac_sequencer_answer(s);\n    one_tick(s, out);",
                "{\n    one_tick(s, out);",
            ),
        },
    ),
    *removed(
        "dac_sequencer.c",
        "checks",
        {
            "a program that waits can be written": "    if (s->waiting)\n        return false;",
            "anything can be committed": "!s->loaded || ",
            "a commit is never waited for": "    s->commits++;\n",
            "counts wrap": " && s->fault_counts[i] != UINT32_MAX",
            "more frames than can be counted": "frames <= UINT32_C(1) << 31 && ",
            "a trigger is taken with nothing to play": " || (s->now == NULL && !s->waiting)",
            "the first program is withdrawn, and its scan runs": (
                "        if (s->now == NULL) /* a scan of the first program was triggered, and never plays */\n"
                "            s->running = false;\n"
            ),
            "requests are not taken off the queue": "    s->tail = tail;\n",
            "pixels that are not known are told": "    if (s->pixel_rest == UNKNOWN)\n        return most;\n",
            "x is not moved on after a longer run": "        dac_axis_skip(&s->x, &bank->x, ticks);\n",
            "the status has the markers of before a run": "    s->markers = markers[-1];\n",
            "the status has the markers of before a blind run": "        s->markers = DAC_PLAYING;\n",
        },
    ),
    *changed(
        "dac_sequencer.c",
        "checks",
        {
            "the code at power-up is 0": ("axis->code = converter->power_up_code", "axis->code = 0"),
            "power-up leaves what was in memory": ("        bytes[i] = 0;", "        (void)bytes;"),
            "the coding bit is one off": ("UINT32_C(1) << (converter->bits - 1)", "UINT32_C(1) << converter->bits"),
            "something plays at power-up": ("s->playing = NOTHING;", "s->playing = 0;"),
            "a commit in the queue is not waited for": ("if (s->commits_answered != s->commits)", "if (false)"),
            "the queue takes one more": (
                "(uint8_t)(head - s->tail) == DAC_REQUESTS",
                "(uint8_t)(head - s->tail) > DAC_REQUESTS",
            ),
            "the queue takes one fewer": (
                "(uint8_t)(head - s->tail) == DAC_REQUESTS",
                "(uint8_t)(head - s->tail) >= DAC_REQUESTS - 1",
            ),
            "arguments are lost": (
                "s->argument[head % DAC_REQUESTS] = argument;",
                "s->argument[head % DAC_REQUESTS] = 0;",
            ),
            "a commit that was refused waits": (
                (
                    "    if (!s->loaded || !request(s, COMMIT, s->loaded_after))\n"
                    "        return false;\n"
                    "    s->commits++;"
                ),
                (
                    "    s->commits++;\n"
                    "    if (!s->loaded || !request(s, COMMIT, s->loaded_after))\n"
                    "        return false;"
                ),
            ),
            "the status has no markers": ("status.markers = s->markers;", "status.markers = 0;"),
            "the status has no faults": ("status.faults = s->faults;", "status.faults = 0;"),
            "the status has the line for the swaps": (
                "status.swaps = settled(&s->swaps)",
                "status.swaps = settled(&s->line)",
            ),
            "only one fault is counted": ("((unsigned)fault >> i & 1u) != 0", "fault == 1u << i"),
            "a fault that there is not": ("s->faults | (fault & 15u)", "s->faults | fault"),
            "converters are not looked at": ("if (!dac_axis_serves(converter))", "if (false)"),
            "a converter of x that is refused": ("power_up(&s->y, y) && x_good", "power_up(&s->y, y)"),
            "faults are not sticky": ("s->faults = (uint8_t)(s->faults | (fault & 15u))", "s->faults = fault"),
            "what was played before can be committed again": ("s->waiting = argument == s->swaps", "s->waiting = 1"),
            "a commit is not answered": (
                "s->commits_answered = (uint8_t)(s->commits_answered + 1u)",
                "s->commits_answered = s->commits_answered",
            ),
            "one request a tick": ("    } while (tail != head);\n", "    } while (false);\n"),
            "swaps are not counted": ("s->swaps = s->swaps + 1;", "s->swaps = s->swaps;"),
            "runs do not end catching up": (
                "    s->catching_up = false;\n    if (markers == NULL)",
                "    if (markers == NULL)",
            ),
            "pixels are known after a blind fill": (
                "        s->pixel_rest = UNKNOWN;\n        s->markers",
                "        s->markers",
            ),
            "coding is left out where there is no shift": ("axis->flip == 0 && axis->shift == 0", "axis->shift == 0"),
            "alignment is left out where there is no flip": ("axis->flip == 0 && axis->shift == 0", "axis->flip == 0"),
            "a run goes on behind its line": ("ticks < left ? (uint32_t)ticks : left;", "(uint32_t)ticks;"),
            "y is coded as x": ("encode(&s->y, y, done)", "encode(&s->x, y, done)"),
            "a fill writes markers that nobody wants": (
                "            if (markers != NULL)\n                *markers",
                "                *markers",
            ),
        },
    ),
    *removed(
        "dac_sequencer.c",
        "threads",
        {
            "memory order: a bank is free before it is left": (
                "    DAC_RELEASE(); /* from here on the other bank may be written */\n"
            ),
        },
    ),
    *changed(
        "dac_sequencer.c",
        "threads",
        {
            "memory order: nothing is acquired before a bank is written": (
                "    if (s->waiting)\n        return false;\n    DAC_ACQUIRE();",
                "    if (s->waiting)\n        return false;",
            ),
            "memory order: nothing is acquired before a place in the queue": (
                "        return false;\n    DAC_ACQUIRE();\n    s->request",
                "        return false;\n    s->request",
            ),
            "memory order: a request is published before what it is about": (
                "    DAC_RELEASE();\n    s->head",
                "    s->head",
            ),
            "memory order: nothing is acquired before requests are read": ("    DAC_ACQUIRE();\n    do {", "    do {"),
            "memory order: the queue moves on before its requests are read": (
                "    DAC_RELEASE();\n    s->tail",
                "    s->tail",
            ),
        },
    ),
)

# Changes after which everything is as before, and why.
EQUIVALENT: dict[Mutant, str] = {
    Mutant(
        "pixels are known before there were any",
        "dac_sequencer.c",
        "    s->pixel_rest = UNKNOWN;\n    s->playing",
        "    s->playing",
    ): "A scan begins at its first tick, so that a window is entered by its first one, which makes them known.",
    Mutant(
        "x's code is that of the next tick", "dac_sequencer.c", "x[(ticks - 1) * DAC_STRIDE]", "x[ticks * DAC_STRIDE]"
    ): "The next tick is played at once, and its code is inside the window: the guard lets x have it either way.",
    Mutant(
        "no scan is without end", "dac_sequencer.c", "s->endless = s->armed_frames == 0", "s->endless = false"
    ): "The count of a scan without end is 0, and ends it once it has gone round: after 2^32 frames.",
    Mutant(
        "scans without end are counted",
        "dac_sequencer.c",
        "!s->endless && --s->frames_left == 0",
        "--s->frames_left == 0",
    ): "The same.",
    Mutant(
        "two shared words are read in any order",
        "dac_sequencer.c",
        "        return false;\n    DAC_ACQUIRE();\n    if (s->waiting)",
        "        return false;\n    if (s->waiting)",
        "threads",
    ): "Not equivalent where a processor swaps two loads; no machine that the tests run on does, and no "
    "memory but the two words is involved, so that ThreadSanitizer has nothing to say.",
    Mutant(
        "two shared words are written in any order",
        "dac_sequencer.c",
        "s->waiting = argument == s->swaps;\n        DAC_RELEASE();",
        "s->waiting = argument == s->swaps;",
        "threads",
    ): "The same, of two stores.",
}
