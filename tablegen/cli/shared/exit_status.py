"""Exit statuses of the commands, by which a script distinguishes outcomes."""

from enum import IntEnum


class ExitStatus(IntEnum):
    """Exit status of the process."""

    OK = 0
    STALE = 1
    WRONG_INPUT = 2
    BROKEN_LIMIT = 3
    CANNOT_WRITE = 4
    MISMATCH = 5
    TOOL_MISSING = 6
    NO_PORT = 7
    NO_ANSWER = 8
    REFUSED = 9
    LINK_LOST = 10
    PARTIAL = 11
    INVALID_ANSWER = 12
    UNEXPECTED = 70  # EX_SOFTWARE of sysexits.h
    INTERRUPTED = 130
