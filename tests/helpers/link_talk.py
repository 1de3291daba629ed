"""What a host says, without a host: wire bytes of requests, and answers as they stood in their frames."""

import hashlib
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

from tablegen.link.frames import Frame, FrameReader
from tablegen.link.messages import ANSWER, REFUSAL, VERSION, Refusal, Request
from tablegen.link.model_device import tag
from tablegen.link.program_image import ProgramImage

SESSION = 0x1BADCAFE


IDENTITY = b"device 1"


def derived_nonce(key: bytes, boot: int, count: int, identity: bytes = IDENTITY) -> bytes:
    """The nonce of a device without random numbers: of its boot, the count-th."""
    message = bytes([len(identity)]) + identity + struct.pack("<II", boot, count)
    return hashlib.blake2s(message, key=key, digest_size=16).digest()


@dataclass
class Talk:
    """Requests of one session; acting ones are numbered."""

    session: int = SESSION
    key: bytes = b""
    seq: int = 0
    reader: FrameReader = field(default_factory=FrameReader)

    def request(self, kind: int, payload: bytes = b"", acts: bool = False) -> bytes:
        """A request as it goes onto the wire."""
        if acts:
            self.seq = (self.seq + 1) & 0xFF
        return Frame(kind, self.seq, self.session, payload).encode()

    def hello(self) -> bytes:
        """The first request."""
        return self.request(Request.HELLO, bytes([VERSION]))

    def upload(self, image: ProgramImage, size: int = 240) -> Iterator[bytes]:
        """BEGIN and every DATA."""
        yield self.request(Request.BEGIN, image.info.pack())
        for at in range(0, len(image.data), size):
            yield self.request(Request.DATA, struct.pack("<I", at) + image.data[at : at + size])

    def commit(self, image: ProgramImage, nonce: bytes = b"") -> bytes:
        """The request that puts it in force, with a tag where there is a nonce."""
        return self.acting(Request.COMMIT, struct.pack("<I", image.info.image_crc), nonce, image.data)

    def acting(self, kind: int, payload: bytes = b"", nonce: bytes = b"", image: bytes | None = None) -> bytes:
        """A request of the next number, with a tag where there is a nonce."""
        seq = (self.seq + 1) & 0xFF
        given = tag(self.key, nonce, Frame(kind, seq, self.session, payload), image) if nonce else b""
        return self.request(kind, payload + given, acts=True)

    def answers(self, wire: bytes) -> list[Frame]:
        """The frames in what a device has sent."""
        return self.reader.feed(wire)

    def refusals(self, wire: bytes) -> list[tuple[int, int]]:
        """Reasons and details; what is no refusal is left out."""
        unpacked = [Refusal.unpack(frame.payload) for frame in self.answers(wire) if frame.type == REFUSAL]
        return [(each.reason, each.detail) for each in unpacked]


def is_answer(frame: Frame, kind: int) -> bool:
    """Whether a request of this type was done."""
    return frame.type == kind | ANSWER
