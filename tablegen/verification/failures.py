"""Why nothing could be played."""


class ToolMissing(Exception):
    """A simulator or a compiler, or the Python side of one, is not installed; says what to install."""


class SimulationFailed(Exception):
    """What plays did not compile, or ended without results; carries the end of the log."""
