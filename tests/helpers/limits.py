"""What ends a program that hangs, and none that is merely slow.

A process that computes is limited in CPU time, of which a busy machine gives it as much as an idle one. What waits for
another process waits ``PATIENCE_S``: more than ten times what anything here takes on a machine loaded eight times over.
"""

import resource
import signal
from collections.abc import Sequence
from pathlib import Path

PATIENCE_S = 1200.0  # by the clock
ENDED = -signal.SIGXCPU  # the status of a process that has used up its CPU time


def limit(cpu_s: int) -> None:
    """End this process once it has used so many seconds of CPU time."""
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, resource.getrlimit(resource.RLIMIT_CPU)[1]))


def within(cpu_s: int, command: Sequence[str | Path]) -> list[str]:
    """The command, which ends with status ``ENDED`` once it has used so many seconds of CPU time."""
    return ["/bin/sh", "-c", 'ulimit -S -t "$0" && exec "$@"', str(cpu_s), *map(str, command)]


def program_within(cpu_s: int, program: Path) -> Path:
    """The same as a program, beside the one that it starts."""
    script = program.with_name(f"{program.name}_within")
    script.write_text(f"#!/bin/sh\nulimit -S -t {cpu_s} && exec '{program}'\n", "utf-8")
    script.chmod(0o755)
    return script
