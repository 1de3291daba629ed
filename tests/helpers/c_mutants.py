"""Faults put into the C sequencer, each of which the tests have to find; run as a program it lists them.

A mutant is tried where it shows: by scripts that are played by fills or by steps, with words of 16 bits or of 32, by
the checks of the functions, or between two threads. As a program it needs ``PYTHONPATH=hdl_tests/helpers``.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import mutants
from c_benches import FILL, words_of
from c_library import compile_both
from c_scripts import IN_C, LONG, everything, long_periods, long_play
from c_scripts import LONG_PERIODS as PERIODS
from c_threads import compile_threads
from c_threads import play as play_threads
from limits import ENDED, program_within, within
from mutants import Verdict

from tablegen.resources import c_runtime
from tablegen.verification.bench import SequencerShape
from tablegen.verification.c_bench import CBench, defines
from tablegen.verification.simulate import SimulationFailed
from tablegen.verification.stream import Script, compare

HERE = Path(__file__).parent
OPTIONS = ("-std=c99", "-O1", "-DDAC_WAIT=0")  # as many runs as can be
CHECKS = {"checks": (), "checks small": ("-DDAC_SMALL=1",), "checks short": ("-DDAC_LONG_MULTIPLY=0",)}
PLAY_S, CHECK_S = 20, 120  # of CPU time: what does not hang takes a second of it, and two
_PROGRAMS = 3000  # between two threads


@dataclass(frozen=True)
class Mutant(mutants.Mutant):
    """A fault in a file, by its whole name; ``where`` is one of ``PLACES``."""

    where: str = "fill"

    @property
    def path(self) -> Path:
        return next(path for path in c_runtime() if path.name == self.file)


@cache
def scripts(where: str) -> tuple[tuple[Script, SequencerShape], ...]:
    """What the benches play; the same every time."""
    if where == "wide":
        names = ("bits_20", "bits_24", "dac_24_words_8")
        long = [(long_play(name, 9000), LONG[name][0]) for name in names]
        return (*long, (IN_C["bits_24"].script("bits_24"), IN_C["bits_24"].shape))
    shape = SequencerShape(16, 1, 4, 16, 1, 3, 16)
    return (
        (everything(shape, 1, 500), shape),
        *((long_play(name, 12_000), LONG[name][0]) for name in ("bits_16", "bits_8", "direct", "many_lines")),
        (long_play("longest_table", 12_000), LONG["longest_table"][0]),
        (long_play("bits_16", 20_000, 1), LONG["bits_16"][0]),
        (long_periods(1 << 16, 3641, 12_000), PERIODS),
        (long_periods(1 << 16, 30_000, 3000), PERIODS),
        (long_periods(1 << 8, 300, 12_000), PERIODS),
    )


def runtime_with(mutant: Mutant | None, folder: Path) -> list[Path]:
    """A copy of the runtime, with a mutant in it or with none."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in c_runtime():
        text = mutant.source if mutant is not None and mutant.file == path.name else path.read_text("utf-8")
        (folder / path.name).write_text(text, "utf-8")
    return [folder / path.name for path in c_runtime()]


def judge(mutant: Mutant | None, folder: Path, where: str = "") -> Verdict:
    """Try a mutant in its place, or the runtime as it is in a place."""
    where = mutant.where if mutant is not None else where
    runtime = runtime_with(mutant, folder / "runtime")
    if where == "threads":
        for seed in range(1, 4):
            done = play_threads(compile_threads(folder, "gcc", True, runtime), _PROGRAMS, seed)
            if done.returncode:
                return Verdict(True, {66: "a race", ENDED: "hangs"}.get(done.returncode, done.stderr.strip()))
        return Verdict(False, "")
    if where in CHECKS:
        options = (*OPTIONS, *CHECKS[where])
        return _check(compile_both(folder, options=options, runtime=runtime))
    return _play(where, folder, runtime)


def _check(paths: tuple[Path, ...]) -> Verdict:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = within(CHECK_S, [sys.executable, HERE / "c_checks.py", *paths])
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode == ENDED:
        return Verdict(True, "hangs")
    if done.returncode == 1 and done.stdout:
        return Verdict(True, done.stdout.partition(":")[0])
    return Verdict(done.returncode != 0, "crash" if done.returncode else "")


def _play(where: str, folder: Path, runtime: list[Path]) -> Verdict:
    fill = 0 if where == "step" else FILL
    playing = scripts("wide" if where == "wide" else "fill")
    chosen = defines(playing[0][1], fill) | ({"DAC_LONG_MULTIPLY": 0} if where == "short" else {})
    bench = CBench(playing[0][1], folder, "gcc", OPTIONS, runtime, chosen=chosen)
    bench.program = program_within(PLAY_S, bench.program)
    for script, shape in playing:
        words = words_of(script, shape)
        try:
            played = bench.run(words)
        except SimulationFailed as error:
            return Verdict(True, str(error))
        expected = script.expected if not fill else [word & (1 << 56) - 1 for word in script.expected]
        mismatch = compare(expected, played.capture)
        if mismatch is not None:
            return Verdict(True, f"tick {mismatch.tick}")
        if played.counts[:2] != script.counts:
            return Verdict(True, "fault counts")
    return Verdict(False, "")


def _of(file: str, *rows: tuple[str, ...]) -> Iterator[Mutant]:
    for breaks, old, new, *where in rows:
        yield Mutant(breaks, file, old, new, *where)


def _axis() -> Iterator[Mutant]:
    """Table, rounding, clamp, slew guard; and the same by runs."""
    yield from _of(
        "dac_axis.h",
        ("the carry of the position is lost", "(low < step->low ? 1u : 0u)", "0u"),
        ("a carry too many", "low < step->low", "low <= step->low", "checks"),
        ("the sample is rounded down", "((dac_wide)1 << (14u - (guard)))", "((dac_wide)0)"),
        (
            "the sample's ties are rounded down",
            "((dac_wide)1 << (14u - (guard)))",
            "(((dac_wide)1 << (14u - (guard))) - 1)",
        ),
        ("the rise has no guard bits", ">> (15u - guard);", ">> 15u;"),
        ("the word has no guard bits", "(dac_wide)here * ((dac_wide)1 << guard)", "(dac_wide)here"),
        (
            "wide words have narrow guard bits",
            "#define DAC_GUARD(bank) ((bank)->guard)",
            "#define DAC_GUARD(bank) 4",
            "wide",
        ),
        ("two's complement is not coded", "((uint32_t)code ^ axis->flip)", "((uint32_t)code)", "checks"),
        ("words are not aligned", "<< axis->shift)", "<< 0)", "checks"),
    )
    yield from _of(
        "dac_axis.c",
        ("the guard lets a code too many pass upwards", "rise > most ? most :", "rise > most ? most + 1 :", "step"),
        ("there is no guard upwards", "rise > most ? most :", "", "step"),
        ("there is no guard downwards", "rise < -most ? -most : rise", "rise", "step"),
        ("the guard is one off downwards", "rise < -most ? -most", "rise < -most ? 1 - most", "step"),
        ("a code is always there", "return axis->code == target;", "return true;", "step"),
        ("a converter of 7 bits", "c->bits >= 8 && ", "", "checks"),
        ("a converter of 25 bits", "c->bits <= 24 && ", "", "checks"),
        ("a converter whose word is too short", "c->bits <= c->word_bits && ", "", "checks"),
        (
            "a converter too wide for its storage",
            "c->word_bits <= DAC_OUTPUT_STORAGE_BITS\n        && ",
            "true\n        && ",
            "checks",
        ),
        ("a code below zero at power-up", "c->power_up_code >= 0 && ", "", "checks"),
        ("a code too high at power-up", " && c->power_up_code < INT32_C(1) << c->bits", "", "checks"),
        ("a step reads no next word", "bank->table[index + 1]", "bank->table[index]", "step"),
        ("nothing is held at code_min", "code < bank->code_min ? bank->code_min : code >", "code >", "step"),
        ("nothing is held at code_max", ": code > bank->code_max ? bank->code_max : code;", ": code;", "step"),
        (
            "the upper limit is one off",
            "code > bank->code_max ? bank->code_max",
            "code >= bank->code_max ? bank->code_max - 1",
            "step",
        ),
        (
            "the lower limit is one off",
            "code < bank->code_min ? bank->code_min :",
            "code <= bank->code_min ? bank->code_min + 1 :",
            "step",
        ),
        ("what is held is no fault", "        *outside = true;", "        *outside = *outside;", "step"),
        ("what is not held is a fault", "if (clamped != code)", "if (clamped == code)", "step"),
        ("y moves on while it is held", "    if (!bank->holds)\n        dac_advance", "    dac_advance", "step"),
        (
            "the position does not move",
            "    if (!bank->holds)\n        dac_advance",
            "    if (false)\n        dac_advance",
            "step",
        ),
        (
            "a run's window reaches below the limit",
            "(uint32_t)(base - bank->code_min) <= (uint32_t)bank->run_room",
            "base <= bank->code_min + bank->run_room",
        ),
        (
            "a run's window reaches above the limit",
            "<= (uint32_t)bank->run_room;",
            "<= (uint32_t)bank->run_room + 1;",
            "checks",
        ),
        (
            "runs do not heed the limits",
            "(uint32_t)(base - bank->code_min) <= (uint32_t)bank->run_room",
            "true",
        ),
        ("runs do not heed the slew guard", "if (strayed >> bank->run_bits != 0)", "if (false)"),
        (
            "a run's window is twice as wide",
            "if (strayed >> bank->run_bits != 0)",
            "if (strayed >> (bank->run_bits + 1) != 0)",
        ),
        (
            "only the last code of a run counts",
            "strayed |= (uint32_t)(code - base)",
            "strayed = (uint32_t)(code - base)",
        ),
        (
            "a run begins where the last one was refused",
            "axis->code = code;\n        done += length;",
            "done += length;",
        ),
        ("a run that ends early is a whole one", "ticks < DAC_RUN ? ticks : DAC_RUN", "DAC_RUN"),
        (
            "runs step by steps rounded down",
            "(uint64_t)bank->step.high << 32 | bank->step.low >> 32) + 1",
            "(uint64_t)bank->step.high << 32 | bank->step.low >> 32)",
            "checks",
        ),
        ("runs move y while it is held", "step = bank->holds ? 0 : ", "step = "),
        ("the position does not follow a run", "        dac_axis_skip(axis, bank, played);\n", ""),
        (
            "runs are as long as one likes",
            "ticks - done < bank->run_most ? ticks - done : bank->run_most",
            "ticks - done",
            "checks",
        ),
        ("a second run overwrites the first", "out + done * DAC_STRIDE, most)", "out, most)"),
        (
            "y is skipped while it is held",
            "    if (bank->holds)\n        return;\n    const uint64_t first",
            "    const uint64_t first",
        ),
        ("a skip loses its middle carry", "+ (first >> 32);", ";", "checks"),
        (
            "a skip loses its upper carry",
            "bank->step.high * ticks + (uint32_t)(second >> 32)",
            "bank->step.high * ticks",
        ),
        ("a skip loses its lowest bits", "second << 32 | (first & 0xffffffffu)", "second << 32", "checks"),
        (
            "short: the sample is rounded down",
            "(UINT32_C(1) << (ABOVE - 1)) - (origin << ABOVE)",
            "0u - (origin << ABOVE)",
            "short",
        ),
        ("short: a wide rise is not seen", " || risen > 2 * spread - 1", "", "checks short"),
        ("short: only the last rise counts", "    risen |= rise; ", "    risen = rise; ", "checks short"),
        ("short: only the last code counts", "    strayed |= last; ", "    strayed = last; ", "short"),
        ("short: the slew guard is not heeded", "strayed >> gain_q >> bank->run_bits != 0 || ", "", "short"),
        (
            "short: a window is twice as wide",
            "strayed >> gain_q >> bank->run_bits != 0",
            "strayed >> gain_q >> bank->run_bits > 1",
            "short",
        ),
        (
            "short: a run may begin anywhere",
            "if ((uint32_t)((int32_t)code - axis->code + bank->run_half) >> bank->run_bits != 0)",
            "if (false)",
            "checks short",
        ),
        ("short: two words for all ticks", "(at + block) >> 47 == at >> 47", "true", "short"),
        ("short: two words for too many ticks", "(DAC_RUN - 1) * step", "DAC_RUN / 2 * step", "short"),
        ("short: the first of two words is lost", "            low += (uint32_t)here << 15;\n", "", "short"),
        ("short: the offset is lost", "+ (uint32_t)bank->offset - ", "- ", "short"),
        ("short: codes follow no run", "        axis->code = (int32_t)last;\n", "", "short"),
    )


def _program() -> Iterator[Mutant]:
    """What is refused, and what is derived."""
    yield from _of(
        "dac_program.c",
        ("a window may begin behind its line", "window->first <= length && ", "", "checks"),
        ("a window may end behind its line", "window->count <= length - window->first", "true", "checks"),
        (
            "a window may be a tick too long",
            "window->count <= length - window->first",
            "window->count <= length - window->first + 1",
            "checks",
        ),
        (
            "a line of no ticks",
            "p->line_ticks - 1 < UINT32_C(1) << 24",
            "p->line_ticks <= UINT32_C(1) << 24 && p->line_ticks + 1",
            "checks",
        ),
        ("a line of too many ticks", "p->line_ticks - 1 < UINT32_C(1) << 24", "p->line_ticks != 0", "checks"),
        ("a frame of no lines", "p->frame_lines != 0 && ", "", "checks"),
        ("a frame of too many ticks", "p->frame_lines <= INT32_MAX / p->line_ticks", "true", "checks"),
        ("a turn behind the line", "p->turn_tick <= p->line_ticks", "true", "checks"),
        ("more pixels than ticks", " && p->pixels <= p->line_ticks", "", "checks"),
        ("forward is not looked at", "inside(&p->forward, p->line_ticks) && ", "", "checks"),
        ("backward is not looked at", "&& inside(&p->backward, p->line_ticks)", "", "checks"),
        ("up is not looked at", "inside(&p->up, p->frame_lines) && ", "", "checks"),
        ("down is not looked at", "&& inside(&p->down, p->frame_lines)", "", "checks"),
        ("no table", "p->table != NULL && ", "", "checks"),
        ("words of 7 bits", "p->bits >= 8", "p->bits >= 7", "checks"),
        ("words of 25 bits", "p->bits <= 24 && ", "", "checks"),
        (
            "any word behind the last one",
            "good_length(p) && p->table[p->length] == p->table[0]",
            "good_length(p)",
            "checks",
        ),
        ("words of another storage", "p->storage_bits == DAC_TABLE_STORAGE_BITS && ", "", "checks"),
        ("words that their storage does not hold", " && p->bits <= DAC_TABLE_STORAGE_BITS", "", "checks"),
        ("a direct table of any length", "return p->length == p->phase_period && ", "return ", "checks"),
        ("a direct table that is too long", " && p->length <= UINT32_C(1) << 17", "", "checks"),
        ("4 words", "p->index_bits >= 3", "p->index_bits >= 2", "checks"),
        ("2^17 words", "p->index_bits <= 16 && ", "", "checks"),
        ("an interpolated table of any length", " && p->length == UINT32_C(1) << p->index_bits", "", "checks"),
        ("x is held", "p->x.hold_ticks == 1 && ", "", "checks"),
        ("x has any period", "p->x.phase_period == ticks", "p->x.phase_period != 0", "checks"),
        ("y has any period", "p->y.phase_period == ticks * lines", "p->y.phase_period != 0", "checks"),
        ("y is held for any time", "p->y.hold_ticks == ticks && ", "", "checks"),
        ("y is held for any number of lines", " && p->y.phase_period == lines", "", "checks"),
        ("a gain that is too low", "p->gain_word >= -(INT32_C(1) << 17) && ", "", "checks"),
        ("a gain that is too high", "p->gain_word < INT32_C(1) << 17", "true", "checks"),
        ("any gain_q", "p->gain_q == 16u + p->bits + guard_bits(p) - p->dac_bits", "true", "checks"),
        ("codes below 0", "0 <= p->code_min && ", "", "checks"),
        ("parking below the limits", "p->code_min <= p->park_code && ", "", "checks"),
        ("parking above the limits", "p->park_code <= p->code_max", "true", "checks"),
        ("codes that the converter has not got", "p->code_max < INT32_C(1) << p->dac_bits", "true", "checks"),
        ("no step", "p->max_step >= 1 && ", "", "checks"),
        ("a step that is too large", " && p->max_step < INT32_C(1) << 24", "", "checks"),
        ("any bits of a code", "p->dac_bits == axis->bits && ", "", "checks"),
        ("any bits of a word", "p->word_bits == axis->word_bits", "true", "checks"),
        ("any coding", "p->twos_complement == (axis->flip != 0) && ", "", "checks"),
        ("any alignment", " && shifted == (axis->shift != 0)", "", "checks"),
        ("alignment matters where there is no room", " && p->word_bits != p->dac_bits", "", "checks"),
        (
            "converter words that their storage does not hold",
            "&& p->word_bits <= DAC_OUTPUT_STORAGE_BITS",
            "",
            "checks",
        ),
        ("the step is rounded down", "        dac_advance(&quotient, &one);", "        (void)one;", "step"),
        (
            "the quotient loses bits to its upper word",
            "quotient.high << 1 | (uint32_t)(quotient.low >> 63)",
            "quotient.high << 1",
        ),
        ("a period of one advance", "quotient.low = divisor == 1;", "quotient.low = 0;", "checks"),
        ("runs where the gain does not fit", "if (left > 14)", "if (left > 40)", "wide"),
        (
            "the gain of runs has other fraction bits",
            "b->run_gain = p->gain_word * (INT32_C(1) << left)",
            "b->run_gain = p->gain_word * (INT32_C(1) << (left - 1))",
        ),
        (
            "the offset of runs has other fraction bits",
            "b->run_offset = b->offset * ((int64_t)1 << left)",
            "b->run_offset = b->offset * ((int64_t)1 << (left - 1))",
            "checks",
        ),
        ("short: a rise may be twice as wide", "b->run_spread = 31;", "b->run_spread = 32;", "checks short"),
        ("short: a gain below zero", "p->gain_word < 0 ? -p->gain_word : p->gain_word", "p->gain_word", "checks short"),
        (
            "short: a rise of more bits than there are",
            "if (b->run_spread > 19)\n        b->run_spread = 19;",
            "if (b->run_spread > 21)\n        b->run_spread = 21;",
            "checks short",
        ),
        ("runs may be wider than the slew guard", "if (widest > p->max_step)", "if (false)"),
        ("the window of runs is twice as wide", "(widest + 1) >> (b->run_bits + 1)", "(widest + 1) >> b->run_bits"),
        (
            "the window of runs is one too wide",
            "(widest + 1) >> (b->run_bits + 1)",
            "(widest + 2) >> (b->run_bits + 1)",
        ),
        (
            "the window of runs has one code too much room",
            "p->code_max - p->code_min + 1 -",
            "p->code_max - p->code_min + 2 -",
            "checks",
        ),
        ("the fraction loses a bit", "power_divided(79u + p->index_bits", "power_divided(78u + p->index_bits", "step"),
        ("a direct table stands still", "{UINT32_C(1) << 15, 0}", "{0, 0}"),
        ("y is never held", "b->holds = p->hold_ticks != 1", "b->holds = 0"),
        ("wrong guard bits of wide words", "? 25u - p->bits : 4u", "? 24u - p->bits : 4u", "checks"),
        ("the code is rounded down", "+ ((int64_t)1 << (p->gain_q - 1))", "", "step"),
        (
            "ties of the code are rounded down",
            "+ ((int64_t)1 << (p->gain_q - 1))",
            "+ ((int64_t)1 << (p->gain_q - 1)) - 1",
            "checks",
        ),
        ("x has the program of y", "derive(&bank->x, &p->x)", "derive(&bank->x, &p->y)"),
        (
            "a bank is written while it waits",
            "    if (!dac_sequencer_writable(s))\n        return DAC_BUSY;\n",
            "",
            "checks",
        ),
        ("x's converter is not looked at", "!same_converter(&p->x, &s->x) || ", "", "checks"),
        ("y's table is not looked at", " || !good_table(&p->y)", "", "checks"),
        ("x's output is not looked at", "!good_output(&p->x) || ", "", "checks"),
        ("the bank that plays is written", "&s->bank[dac_sequencer_idle(s)]", "&s->bank[!dac_sequencer_idle(s)]"),
        ("nobody knows that a program was loaded", "    s->loaded = 1;\n", "", "checks"),
        ("a program is committed for the first swap only", "s->loaded_after = s->swaps", "s->loaded_after = 0"),
    )


def _sequencer() -> Iterator[Mutant]:
    """Requests, swaps, ticks, markers, faults."""
    yield from _of(
        "dac_sequencer.c",
        ("faults are not cleared", "    s->faults = 0;\n", ""),
        ("counts of faults are not cleared", "        s->fault_counts[i] = 0;", "        (void)i;"),
        ("the code at power-up is 0", "axis->code = converter->power_up_code", "axis->code = 0", "checks"),
        ("power-up leaves what was in memory", "        bytes[i] = 0;", "        (void)bytes;", "checks"),
        (
            "the coding bit is one off",
            "UINT32_C(1) << (converter->bits - 1)",
            "UINT32_C(1) << converter->bits",
            "checks",
        ),
        ("something plays at power-up", "s->playing = NOTHING;", "s->playing = 0;", "checks"),
        ("a commit in the queue is not waited for", "if (s->commits_answered != s->commits)", "if (false)", "checks"),
        ("a program that waits can be written", "    if (s->waiting)\n        return false;", "", "checks"),
        ("the other set of tables is named", "return s->playing == 0 ? 1 : 0;", "return s->playing == 1 ? 1 : 0;"),
        (
            "the queue takes one more",
            "(uint8_t)(head - s->tail) == DAC_REQUESTS",
            "(uint8_t)(head - s->tail) > DAC_REQUESTS",
            "checks",
        ),
        (
            "the queue takes one fewer",
            "(uint8_t)(head - s->tail) == DAC_REQUESTS",
            "(uint8_t)(head - s->tail) >= DAC_REQUESTS - 1",
            "checks",
        ),
        (
            "the queue does not go round",
            "s->request[head % DAC_REQUESTS] = what;",
            "s->request[head % (DAC_REQUESTS - 1)] = what;",
        ),
        (
            "arguments are lost",
            "s->argument[head % DAC_REQUESTS] = argument;",
            "s->argument[head % DAC_REQUESTS] = 0;",
            "checks",
        ),
        ("anything can be committed", "!s->loaded || ", "", "checks"),
        (
            "a commit that was refused waits",
            "    if (!s->loaded || !request(s, COMMIT, s->loaded_after))\n        return false;\n    s->commits++;",
            "    s->commits++;\n    if (!s->loaded || !request(s, COMMIT, s->loaded_after))\n        return false;",
            "checks",
        ),
        ("a commit is never waited for", "    s->commits++;\n", "", "checks"),
        ("withdraw parks", "return request(s, WITHDRAW, 0);", "return request(s, PARK, 0);"),
        ("reset parks only", "return request(s, RESET, 0);", "return request(s, PARK, 0);"),
        ("the status has no markers", "status.markers = s->markers;", "status.markers = 0;", "checks"),
        ("the status has no faults", "status.faults = s->faults;", "status.faults = 0;", "checks"),
        (
            "the status has the line for the swaps",
            "status.swaps = settled(&s->swaps)",
            "status.swaps = settled(&s->line)",
            "checks",
        ),
        ("only one fault is counted", "((unsigned)fault >> i & 1u) != 0", "fault == 1u << i", "checks"),
        ("counts wrap", " && s->fault_counts[i] != UINT32_MAX", "", "checks"),
        (
            "faults count twice",
            "s->fault_counts[i] = s->fault_counts[i] + 1",
            "s->fault_counts[i] = s->fault_counts[i] + 2",
        ),
        ("more frames than can be counted", "frames <= UINT32_C(1) << 31 && ", "", "checks"),
        ("a fault that there is not", "s->faults | (fault & 15u)", "s->faults | fault", "checks"),
        ("converters are not looked at", "if (good) {", "if (true) {", "checks"),
        ("faults are not sticky", "s->faults = (uint8_t)(s->faults | (fault & 15u))", "s->faults = fault", "checks"),
        ("the last bits of a period go on", "    axis->at.low = 0;\n", "", "step"),
        ("the place in a period goes on", "    axis->at.high = 0;\n", ""),
        ("a scan begins in mid-line", "    s->tick = 0;\n    s->line = 0;\n", "    s->line = 0;\n"),
        ("a scan begins in mid-frame", "    s->tick = 0;\n    s->line = 0;\n", "    s->tick = 0;\n"),
        (
            "x goes on where a scan begins",
            "    s->line = 0;\n    to_start(&s->x);\n    to_start(&s->y);\n",
            "    s->line = 0;\n    to_start(&s->y);\n",
        ),
        ("y goes on where a scan begins", "    to_start(&s->x);\n    to_start(&s->y);\n", "    to_start(&s->x);\n"),
        ("a scan does not settle", "s->settle_left = s->now->schedule.settle_lines", "s->settle_left = 0"),
        ("catching up is a fault", "s->catching_up = true;", "s->catching_up = false;"),
        ("a trigger is taken unarmed", "if (!s->armed || s->running", "if (s->running"),
        ("a trigger is taken while a scan runs", "!s->armed || s->running || s->now", "!s->armed || s->now"),
        ("a trigger is taken with nothing to play", " || s->now == NULL", "", "checks"),
        ("a trigger does not disarm", "    s->armed = false;\n", ""),
        ("every scan is without end", "s->endless = s->armed_frames == 0", "s->endless = true"),
        ("a frame too many", "s->frames_left = s->armed_frames;", "s->frames_left = s->armed_frames + 1;"),
        ("park does not disarm", "s->armed = s->running = false;", "s->running = false;"),
        ("park does not stop", "s->armed = s->running = false;", "s->armed = false;"),
        (
            "what was played before can be committed again",
            "s->waiting = argument == s->swaps",
            "s->waiting = 1",
            "checks",
        ),
        (
            "a commit is not answered",
            "s->commits_answered = (uint8_t)(s->commits_answered + 1u)",
            "s->commits_answered = s->commits_answered",
            "checks",
        ),
        ("withdraw is ignored", "    case WITHDRAW:\n        s->waiting = 0;", "    case WITHDRAW:"),
        ("arm is ignored", "    case ARM:\n        s->armed = true;", "    case ARM:"),
        (
            "arm changes the scan that runs",
            "s->armed_frames = argument;",
            "s->armed_frames = s->frames_left = argument;",
        ),
        ("reset does not empty the idle bank", "    case RESET:\n        s->waiting = 0;", "    case RESET:"),
        ("reset does not stop", "        park(s);\n        clear_faults(s);", "        clear_faults(s);"),
        ("reset does not clear faults", "        park(s);\n        clear_faults(s);", "        park(s);"),
        (
            "requests act in the wrong order",
            "        act(s, s->request[tail % DAC_REQUESTS], s->argument[tail % DAC_REQUESTS]);",
            "        const unsigned at = (head - 1u - (tail - s->tail)) % DAC_REQUESTS;\n"
            "        act(s, s->request[at], s->argument[at]);",
        ),
        ("one request a tick", "    } while (tail != head);\n", "    } while (false);\n", "checks"),
        ("requests are not taken off the queue", "    s->tail = tail;\n", "", "checks"),
        ("a swap in mid-line", "if (!s->waiting || (s->running && s->tick != 0))", "if (!s->waiting)"),
        ("a swap in mid-line by steps", "if (!s->waiting || (s->running && s->tick != 0))", "if (!s->waiting)", "step"),
        ("a swap a tick late", "(s->running && s->tick != 0)", "(s->running && s->tick != 1)", "step"),
        ("a swap only while nothing runs", "(s->running && s->tick != 0)", "s->running"),
        ("the banks do not change places", "s->playing = s->playing == 0 ? 1 : 0;", "s->playing = 0;"),
        (
            "the bank before goes on",
            "    s->now = &s->bank[s->playing];\n",
            "    s->now = s->now == NULL ? &s->bank[0] : s->now;\n",
        ),
        ("swaps are not counted", "s->swaps = s->swaps + 1;", "s->swaps = s->swaps;", "checks"),
        ("a program is taken again and again", "written */\n    s->waiting = 0;", "written */"),
        ("a program begins where the last one was", "    if (s->running)\n        begin(s);", ""),
        ("a window is a tick longer", "at - window->first < window->count", "at - window->first <= window->count"),
        ("a window begins a tick late", "at - window->first < window->count", "at - window->first - 1 < window->count"),
        ("the turn is no edge", "{plan->turn_tick, plan->forward.first,", "{plan->forward.first, plan->forward.first,"),
        (
            "the end of the forward window is no edge",
            "plan->forward.first + plan->forward.count,\n",
            "plan->forward.first,\n",
        ),
        ("the backward window is no edge", "plan->backward.first, plan->backward.first + plan->backward.count", "0, 0"),
        ("edges are a tick late", "most = edges[i] - tick;", "most = edges[i] - tick + 1;"),
        ("the backward sweep begins a tick late", "tick >= plan->turn_tick", "tick > plan->turn_tick", "step"),
        ("the way back does not image", "in(&plan->backward, tick) ? &plan->backward : NULL", "NULL"),
        ("valid outside the window", "window != NULL && clean", "clean", "step"),
        ("valid while faulty", "window != NULL && clean && ", "window != NULL && ", "step"),
        ("valid before it has settled", " && s->settle_left == 0", ""),
        ("lines of the way down do not image", " || in(&plan->down, s->line)", ""),
        ("every line images", " && (in(&plan->up, s->line) || in(&plan->down, s->line))", ""),
        ("no line marker", "all | DAC_LINE |", "all |"),
        ("every line is a frame", "(s->line == 0 ? DAC_FRAME : 0)", "DAC_FRAME"),
        ("the line marker replaces the others", "(uint8_t)(all | DAC_LINE", "(uint8_t)(DAC_PLAYING | DAC_LINE"),
        (
            "pixels go on from the last window",
            "    if (tick == window->first)\n        s->pixel_rest = window->count;\n",
            "",
        ),
        ("no pixel at the first tick of a window", "s->pixel_rest = window->count;", "s->pixel_rest = 0;"),
        (
            "pixels that are not known are told",
            "    if (s->pixel_rest == UNKNOWN)\n        return most;\n",
            "",
            "checks",
        ),
        ("pixels are a tick late", "s->pixel_rest >= window->count", "s->pixel_rest > window->count"),
        ("pixels do not take off their width", "            s->pixel_rest -= window->count;\n", ""),
        (
            "a line is a tick longer",
            "s->tick != bank->schedule.line_ticks",
            "s->tick != bank->schedule.line_ticks + 1",
            "step",
        ),
        (
            "a line does not end",
            "        return;\n    s->tick = 0;\n    if (s->settle_left",
            "        return;\n    if (s->settle_left",
            "step",
        ),
        ("nothing settles", "        s->settle_left--;", "        (void)0;"),
        ("x does not begin again", "    to_start(&s->x);\n    if (bank->y.holds)", "    if (bank->y.holds)", "step"),
        ("y steps on every line", "    if (bank->y.holds)\n", ""),
        ("y never steps", "    if (bank->y.holds)\n", "    if (false)\n"),
        (
            "a frame is a line longer",
            "s->line + 1 != bank->schedule.frame_lines",
            "s->line != bank->schedule.frame_lines",
        ),
        (
            "y does not begin again",
            "    s->line = 0;\n    to_start(&s->y);\n    if (!s->endless",
            "    s->line = 0;\n    if (!s->endless",
            "step",
        ),
        (
            "a scan plays on",
            "        s->running = false;\n}\n\nstatic uint8_t play",
            "        s->frames_left = 1;\n}\n\nstatic uint8_t play",
        ),
        ("one axis is enough to be there", "reached &= dac_axis_step(", "reached |= dac_axis_step(", "step"),
        ("x alone decides", "    reached &= dac_axis_step(", "    dac_axis_step(", "step"),
        ("a clamp is no fault", "        dac_sequencer_report(s, DAC_FAULT_CLAMP);", "        (void)0;"),
        ("a clamp is a slew fault", "DAC_FAULT_CLAMP);", "DAC_FAULT_SLEW);"),
        (
            "it catches up for ever",
            "    if (reached)\n        s->catching_up = false;\n",
            "    if (reached) {\n    }\n",
        ),
        ("holding back is no fault", "    else if (!s->catching_up)\n", "    else if (false)\n"),
        ("valid before it is there", "reached && !s->faults, &markers", "!s->faults, &markers", "step"),
        ("valid in spite of an old fault", "reached && !s->faults, &markers", "reached && !outside, &markers", "step"),
        ("x does not park", "parked = dac_axis_approach(&s->x, &bank->x, bank->x.park_code);", "parked = true;"),
        (
            "y parks where x does",
            "dac_axis_approach(&s->y, &bank->y, bank->y.park_code)",
            "dac_axis_approach(&s->y, &bank->y, bank->x.park_code)",
        ),
        ("one axis is enough to be parked", "parked &= dac_axis_approach(", "parked |= dac_axis_approach("),
        ("never parked", "return parked ? DAC_PARKED : 0;", "return 0;"),
        ("no swap marker", "swap(s) ? DAC_SWAPPED : 0", "swap(s) ? 0 : 0"),
        (
            "steps do not answer requests",
            "{\n    dac_sequencer_answer(s);\n    one_tick(s, out);",
            "{\n    one_tick(s, out);",
            "step",
        ),
        ("fills do not answer requests", "    dac_sequencer_answer(s);\n    for (;", "    for (;"),
        ("x stays where a longer run has left it", "        s->x.at = at;\n", ""),
        (
            "x's code is that of the longer run",
            "        s->x.code = ticks != 0 ? (int32_t)x[(ticks - 1) * DAC_STRIDE] : code;\n",
            "",
        ),
        ("x is not moved on after a longer run", "        dac_axis_skip(&s->x, &bank->x, ticks);\n", "", "checks"),
        (
            "runs do not end catching up",
            "    s->catching_up = false;\n    if (markers == NULL)",
            "    if (markers == NULL)",
            "checks",
        ),
        (
            "pixels are known after a blind fill",
            "        s->pixel_rest = UNKNOWN;\n        s->markers",
            "        s->markers",
            "checks",
        ),
        ("runs are valid in spite of faults", "mark(s, !s->faults, markers, ticks)", "mark(s, true, markers, ticks)"),
        ("the status has the markers of before a run", "    s->markers = markers[-1];\n", "", "checks"),
        ("the status has the markers of before a blind run", "        s->markers = DAC_PLAYING;\n", "", "checks"),
        (
            "coding is left out where there is no shift",
            "axis->flip == 0 && axis->shift == 0",
            "axis->shift == 0",
            "checks",
        ),
        (
            "alignment is left out where there is no flip",
            "axis->flip == 0 && axis->shift == 0",
            "axis->flip == 0",
            "checks",
        ),
        ("a run is played before a swap", "if (s->running && (s->tick != 0 || !s->waiting))", "if (s->running)"),
        ("a run goes on behind its line", "ticks < left ? (uint32_t)ticks : left;", "(uint32_t)ticks;", "checks"),
        ("y is coded as x", "encode(&s->y, y, done)", "encode(&s->x, y, done)", "checks"),
        (
            "a fill writes markers that nobody wants",
            "            if (markers != NULL)\n                *markers",
            "                *markers",
            "checks",
        ),
        ("a fill forgets where its markers are", "            markers += done;", "            markers += 1;"),
        (
            "memory order: nothing is acquired before a bank is written",
            "    if (s->waiting)\n        return false;\n    DAC_ACQUIRE();",
            "    if (s->waiting)\n        return false;",
            "threads",
        ),
        (
            "memory order: nothing is acquired before a place in the queue",
            "        return false;\n    DAC_ACQUIRE();\n    s->request",
            "        return false;\n    s->request",
            "threads",
        ),
        (
            "memory order: a request is published before what it is about",
            "    DAC_RELEASE();\n    s->head",
            "    s->head",
            "threads",
        ),
        (
            "memory order: nothing is acquired before requests are read",
            "    DAC_ACQUIRE();\n    do {",
            "    do {",
            "threads",
        ),
        (
            "memory order: the queue moves on before its requests are read",
            "    DAC_RELEASE();\n    s->tail",
            "    s->tail",
            "threads",
        ),
        (
            "memory order: a bank is free before it is left",
            "    DAC_RELEASE(); /* from here on the other bank may be written */\n",
            "",
            "threads",
        ),
    )


def _fourier() -> Iterator[Mutant]:
    """Tables from Fourier words."""
    yield from _of(
        "dac_fourier.c",
        ("words are not saturated", "if ((uint32_t)word + half >= 2 * half)", "if (false)", "checks"),
        (
            "saturated to the wrong end",
            "word < 0 ? -(int32_t)half : (int32_t)half - 1",
            "word > 0 ? -(int32_t)half : (int32_t)half - 1",
            "checks",
        ),
        ("the highest word is one too high", ": (int32_t)half - 1;", ": (int32_t)half;", "checks"),
        ("words that could overflow are rendered", "return total < UINT64_C(1) << 32;", "return true;", "checks"),
        ("the mean is not rounded", " + (INT64_C(1) << (60 - bits))", "", "checks"),
        ("small: a sine for a cosine", "sine[r->to_cosine] + (int64_t)b[n]", "sine[0] + (int64_t)b[n]", "checks small"),
        ("small: half an LSB too few", "int64_t sum = r->mean;", "int64_t sum = 0;", "checks small"),
        ("odd sines keep their sign", "    odd.a_sin = -odd.a_sin;\n", "", "checks"),
        ("odd cosines keep their sign", "    odd.b_cos = -odd.b_cos;\n", "", "checks"),
        (
            "the second harmonic for the fourth",
            "even_terms(&n0, r, 4, angle)",
            "even_terms(&n0, r, 2, angle)",
            "checks",
        ),
        ("the mean is lost", "    n0.a_cos += r->mean;\n", "", "checks"),
        ("words are half as high", "r.drop = 29 - bits", "r.drop = 30 - bits", "checks"),
        ("the first word does not stand behind the last", "    table[r.length] = table[0];\n", "", "checks"),
        ("a table without room is rendered", "room < DAC_TABLE_ROOM(index_bits) || ", "", "checks"),
    )


MUTANTS: tuple[Mutant, ...] = (*_axis(), *_program(), *_sequencer(), *_fourier())

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
    ): "Where a position is a whole fraction the parts cut off from start and steps add up to a whole unit, which the "
    "steps, rounded up, make good; where it is none it is further from one than any unit.",
    Mutant(
        "the division misses a remainder", "dac_program.c", "if (rest >= divisor) {", "if (rest > divisor) {", "step"
    ): "A rest that equals the divisor stays so: all further bits are ones, and rounding up carries through them.",
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
    ): "Not equivalent where a processor swaps two loads; no machine that the tests run on does, and no memory but the "
    "two words is involved, so that ThreadSanitizer has nothing to say.",
    Mutant(
        "two shared words are written in any order",
        "dac_sequencer.c",
        "s->waiting = argument == s->swaps;\n        DAC_RELEASE();",
        "s->waiting = argument == s->swaps;",
        "threads",
    ): "The same, of two stores.",
}
PLACES = ("fill", "step", "wide", "short", *CHECKS, "threads")


if __name__ == "__main__":
    mutants.print_list(judge, MUTANTS, "file", "where")
