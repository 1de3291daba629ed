"""The modes of a commit: docs/sequencer.md, "Commit modes"."""

from enum import IntEnum


class CommitMode(IntEnum):
    """Where in a running scan a committed program is swapped in, and on which line it starts."""

    LINE = 0  # at the next line start, from line 0 of a frame
    KEEP = 1  # at the next line start, and the frame goes on
    FRAME = 2  # at the next frame start
