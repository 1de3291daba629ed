"""The plan as files: every emitter renders integers that were made once, and computes nothing."""

from tablegen.emit.render import render
from tablegen.emit.write import CannotWrite, write_files

__all__ = ["CannotWrite", "render", "write_files"]
