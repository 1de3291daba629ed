"""What can go wrong between a host and a device, each with what to do about it in its message."""

from tablegen.base.installation import install_advice


class LinkError(Exception):
    """The base of them all; the message is for people."""


class SerialMissing(LinkError):
    """pyserial is not installed."""

    def __init__(self) -> None:
        super().__init__(f"pyserial is missing; {install_advice('serial')}")


class NoPort(LinkError):
    """The port cannot be opened."""


class NoAnswer(LinkError):
    """The port is there, and nobody speaks the protocol on it."""


class LinkLost(LinkError):
    """A device that did answer does no more, or its port has gone."""


class Silent(LinkLost):
    """The port is there, but a device that did answer does no more: opening it again could reset what it plays."""


class OutOfTime(LinkError):
    """The device answers, but what was asked for did not come about before the deadline."""


class NotPlaying(LinkError):
    """The device took an upload, and plays something else."""


class Unsuitable(LinkError):
    """The device would refuse this scan; nothing was sent. ``objections`` are all that was found."""

    def __init__(self, objections: list[str]) -> None:
        super().__init__("\n".join(objections))
        self.objections = objections


class Refused(LinkError):
    """The device refused a request.

    ``request``, ``reason`` and ``detail`` are numbers as in docs/protocol.md, ``explanation`` says what to do.
    """

    def __init__(self, request: int, reason: int, detail: int, explanation: str) -> None:
        super().__init__(explanation)
        self.request, self.reason, self.detail, self.explanation = request, reason, detail, explanation


class NotUnderstood(LinkError):
    """The device answers, but not as docs/protocol.md has it."""

    def __init__(self, what: str, remedy: str = "do the versions of tablegen and firmware match?") -> None:
        super().__init__(f"the device sent an invalid answer: {what}; {remedy}")
