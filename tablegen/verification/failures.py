"""The errors of a playback that did not happen."""


class ToolMissing(Exception):
    """A missing simulator or compiler, or the Python side of one; the message has what to install."""


class SimulationFailed(Exception):
    """The failure of a playback to compile or to end with results; carries the end of the log."""
