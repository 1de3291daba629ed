"""The plan as files: every emitter renders integers that were made once, and computes nothing."""

from tablegen.emit.render import render, runtime_files
from tablegen.emit.write import CannotWrite, write_files

__all__ = ["CannotWrite", "render", "runtime_files", "write_files"]
