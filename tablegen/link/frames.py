"""Frames on a serial line: type, seq, session, payload and CRC-32 within COBS, ended by 0x00 (docs/protocol.md)."""

import struct
import zlib
from dataclasses import dataclass

_HEADER = struct.Struct("<BBI")
_CRC = struct.Struct("<I")
MAXIMUM_FRAME = 254  # before COBS, so that it adds one byte and never two
MINIMUM_FRAME = _HEADER.size + _CRC.size
MAXIMUM_PAYLOAD = MAXIMUM_FRAME - MINIMUM_FRAME
OVERHEAD = MINIMUM_FRAME + 2  # bytes of a frame on the wire beside its payload


@dataclass(frozen=True, slots=True)
class Frame:
    """A request or an answer: ``type`` and ``seq`` have 8 bits, ``session`` 32, ``payload`` at most 244 bytes."""

    type: int
    seq: int
    session: int
    payload: bytes = b""

    def encode(self) -> bytes:
        """Return the frame as it goes onto the wire, with the 0x00 that ends it.

        Raises
        ------
        ValueError
            If the payload is too long.
        """
        if len(self.payload) > MAXIMUM_PAYLOAD:
            raise ValueError(f"a payload of {len(self.payload)} bytes; at most {MAXIMUM_PAYLOAD} fit into a frame")
        body = _HEADER.pack(self.type, self.seq, self.session) + self.payload
        return cobs_encode(body + _CRC.pack(zlib.crc32(body))) + b"\0"


def decode(wire: bytes) -> Frame:
    """Decode a frame from the bytes between two 0x00 on the wire.

    Raises
    ------
    ValueError
        If it is damaged, too short or too long.
    """
    data = cobs_decode(wire)
    if not MINIMUM_FRAME <= len(data) <= MAXIMUM_FRAME:
        raise ValueError(f"{len(data)} bytes; a frame has {MINIMUM_FRAME}..{MAXIMUM_FRAME}")
    body = data[: -_CRC.size]
    (crc,) = _CRC.unpack(data[-_CRC.size :])
    if zlib.crc32(body) != crc:
        raise ValueError("the CRC is wrong")
    kind, seq, session = _HEADER.unpack_from(body)
    return Frame(kind, seq, session, body[_HEADER.size :])


class FrameReader:
    """The frames in whatever pieces a line delivers; ``bad_frames`` counts the damaged ones."""

    def __init__(self) -> None:
        self.bad_frames = 0
        self._begun = bytearray()
        self._overflown = False

    def feed(self, received: bytes) -> list[Frame]:
        """Return the frames that are complete with these bytes, in order; damaged ones are counted and dropped."""
        frames = []
        *ended, rest = received.split(b"\0")
        for piece in ended:
            self._add(piece)
            if self._begun or self._overflown:
                try:
                    if self._overflown:
                        raise ValueError("too long")
                    frames.append(decode(bytes(self._begun)))
                except ValueError:
                    self.bad_frames += 1
            self._begun.clear()
            self._overflown = False
        self._add(rest)
        return frames

    def _add(self, piece: bytes) -> None:
        """Append bytes of a frame up to its greatest length, so that endless noise takes no endless memory."""
        if len(self._begun) + len(piece) > MAXIMUM_FRAME + 1:
            self._begun.clear()
            self._overflown = True
        elif not self._overflown:
            self._begun += piece


def cobs_encode(data: bytes) -> bytes:
    """Encode at most 254 bytes by consistent overhead byte stuffing: one byte more, and no zero among them."""
    assert len(data) <= MAXIMUM_FRAME
    return b"".join(bytes([len(block) + 1]) + block for block in data.split(b"\0"))


def cobs_decode(stuffed: bytes) -> bytes:
    """Decode bytes of ``cobs_encode``, without the 0x00 that ended them.

    Raises
    ------
    ValueError
        If a distance leads past the end.
    """
    blocks = []
    at = 0
    while at < len(stuffed):
        distance = stuffed[at]
        if distance == 0 or at + distance > len(stuffed):
            raise ValueError("a distance leads past the end")
        blocks.append(stuffed[at + 1 : at + distance])
        at += distance
    return b"\0".join(blocks)
