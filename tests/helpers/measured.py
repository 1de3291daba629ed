"""Run tablegen, and write into a file how many bytes of memory it held at most: ``measured.py FILE ARGUMENTS...``.

The ``ru_maxrss`` of a child counts what its parent held when it forked; the kernel's ``VmHWM`` begins anew with a
program.
"""

import atexit
import re
import sys
from pathlib import Path


def command(file: Path) -> list[str]:
    """What goes before the arguments of tablegen."""
    return [sys.executable, __file__, str(file)]


def _write(file: Path) -> None:
    found = re.search(r"^VmHWM:\s*(\d+) kB$", Path("/proc/self/status").read_text("ascii"), re.MULTILINE)
    assert found is not None
    file.write_text(str(int(found[1]) << 10), "ascii")


if __name__ == "__main__":
    from tablegen.cli import main

    atexit.register(_write, Path(sys.argv.pop(1)).absolute())
    main()
