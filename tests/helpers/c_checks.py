"""What the functions of the C sequencer promise, one check a function; as a program, all of them on two libraries.

A check raises ``AssertionError``. As a program they may crash or hang: with sanitizers, of mutants, for coverage.
"""

import sys
from pathlib import Path

from c_devices import Check, Libraries
from c_library import Library
from c_loading import (
    converters_that_do_not_fit,
    crowded_windows,
    offsets_that_overflow,
    other_converters,
    refusals,
    requests_that_do_not_fit,
    the_first_word_again,
    the_largest_schedules,
    words_too_wide_for_their_storage,
)
from c_playing import (
    a_fill_that_wants_no_markers,
    converter_words,
    converter_words_of_runs,
    layout,
    markers_known_again,
    one_buffer_for_both,
    renderings,
    several_programs,
)
from c_requests import (
    answers,
    banks,
    commits,
    lines_of_the_status,
    reports,
    status_of_power_up,
    the_first_trigger,
    the_queue,
)
from c_runs import (
    gains_that_fit,
    jumps_that_32_bits_do_not_tell,
    limits,
    no_run_beyond_a_limit,
    positions,
    rounding,
    runs_and_what_ends_them,
    runs_take_place,
    slew_guards,
)

CHECKS: tuple[Check, ...] = (
    layout, converter_words, converter_words_of_runs, several_programs, a_fill_that_wants_no_markers,
    markers_known_again, status_of_power_up, the_first_trigger, the_queue, answers, banks, commits, reports, refusals,
    crowded_windows, the_largest_schedules, the_first_word_again, offsets_that_overflow, other_converters,
    converters_that_do_not_fit, requests_that_do_not_fit,
    words_too_wide_for_their_storage, lines_of_the_status, one_buffer_for_both,
    runs_and_what_ends_them, rounding, no_run_beyond_a_limit, limits, gains_that_fit, slew_guards, runs_take_place,
    jumps_that_32_bits_do_not_tell, positions, renderings,
)  # fmt: skip


def main(paths: list[str]) -> int:
    """All checks on the libraries at these paths, narrow and wide; what fails is named."""
    libraries = Libraries(*(Library(Path(path)) for path in paths))
    for check in CHECKS:
        try:
            check(libraries)
        except Exception as error:  # whatever a broken runtime leads to
            sys.stdout.write(f"{check.__name__}: {error}\n")
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
