"""tablegen on a pseudo-terminal."""

import fcntl
import os
import pty
import select
import struct
import subprocess
import sys
import termios
from collections.abc import Mapping, Sequence
from pathlib import Path

from limits import PATIENCE_S


def on_pseudo_terminal(
    arguments: Sequence[str | Path],
    environment: Mapping[str, str],
    columns: int | None = None,
    *,
    stderr_too: bool = True,
) -> tuple[int, str]:
    """Status, and what a terminal of so many columns gets of stdout, and of stderr too.

    ``environment`` is all of it but the kind of terminal, and UTF-8 where it names no encoding.
    """
    ours, theirs = pty.openpty()
    if columns is not None:
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    with subprocess.Popen(
        [sys.executable, "-m", "tablegen", *map(str, arguments)],
        stdin=subprocess.DEVNULL,
        stdout=theirs,
        stderr=theirs if stderr_too else subprocess.DEVNULL,
        env={"TERM": "xterm", "PYTHONIOENCODING": "utf-8", **environment},
    ) as process:
        os.close(theirs)
        shown = b""
        while select.select([ours], [], [], PATIENCE_S)[0]:
            try:
                more = os.read(ours, 65536)
            except OSError:  # the other end was closed
                break
            if not more:
                break
            shown += more
    os.close(ours)
    return process.returncode, shown.decode("utf-8").replace("\r\n", "\n")
