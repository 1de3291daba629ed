"""The errors between a host and a device, each with what to do about it in its message."""

from tablegen.base.installation import install_advice


class LinkError(Exception):
    """The base class of the errors of a link; the message is for people."""


class SerialMissing(LinkError):
    """The missing installation of pyserial."""

    def __init__(self) -> None:
        super().__init__(f"pyserial is missing; {install_advice('serial')}")


class NoPort(LinkError):
    """The failure to open a port."""


class NoAnswer(LinkError):
    """The silence of a port that was opened: no device speaks the protocol on it."""


class LinkLost(LinkError):
    """The loss of a device that did answer, or of its port."""


class Silent(LinkLost):
    """The silence of a device that did answer, on a port that is there: opening it again could reset what it plays."""


class OutOfTime(LinkError):
    """The end of the time for a request, although the device answers."""


class NotPlaying(LinkError):
    """The playback of something else than the upload that the device took."""


class Unsuitable(LinkError):
    """A scan that the device would refuse; nothing was sent. ``objections`` are all reasons."""

    def __init__(self, objections: list[str]) -> None:
        super().__init__("\n".join(objections))
        self.objections = objections


class Refused(LinkError):
    """The refusal of a request by the device.

    ``request``, ``reason`` and ``detail`` are numbers as in docs/protocol.md, ``explanation`` says what to do.
    """

    def __init__(self, request: int, reason: int, detail: int, explanation: str) -> None:
        super().__init__(explanation)
        self.request, self.reason, self.detail, self.explanation = request, reason, detail, explanation


class NotUnderstood(LinkError):
    """An answer that is not as docs/protocol.md has it."""

    def __init__(self, what: str, remedy: str = "do the versions of tablegen and firmware match?") -> None:
        super().__init__(f"the device sent an invalid answer: {what}; {remedy}")
