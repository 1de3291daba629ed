"""Framing of other protocols: exchanges counted by formulas, against the bytes of frames that are made here."""

import base64
import struct

import pytest
from result_rows import tables
from sections.framing import PROTOCOLS, Way, smp, xmodem, ymodem_1k

SIZES = (1, 127, 128, 129, 1023, 1024, 1025, 8384)
CRC = b"\0\0"


def blocks(data: bytes, size: int) -> list[bytes]:
    return [data[at : at + size].ljust(size, b"\x1a") for at in range(0, len(data), size)]


@pytest.mark.parametrize("size", SIZES)
def test_xmodem(size: int) -> None:
    frames = [
        b"\1" + bytes([at % 256, 255 - at % 256]) + block + b"\0" for at, block in enumerate(blocks(bytes(size), 128))
    ]
    assert xmodem(size) == [*((len(frame), 1) for frame in frames), (1, 1)]


@pytest.mark.parametrize("size", SIZES)
def test_ymodem_of_long_blocks(size: int) -> None:
    frames = [b"\2\1\xfe" + block + CRC for block in blocks(bytes(size), 1024)]
    name = b"\1\0\xff" + b"scan.bin\0".ljust(128, b"\0") + CRC
    first, last = (len(name), len(b"\6C")), (len(name), 1)
    assert ymodem_1k(size, short=False) == [first, *((len(frame), 1) for frame in frames), (1, 1), (1, 2), last]


@pytest.mark.parametrize("size", SIZES)
def test_ymodem_carries_all_bytes_and_short_ends_take_no_more(size: int) -> None:
    carried = sum({1029: 1024, 133: 128}.get(out, 0) for out, _ in ymodem_1k(size)[1:-3])
    assert size <= carried < size + 1024
    assert sum(map(sum, ymodem_1k(size))) <= sum(map(sum, ymodem_1k(size, short=False)))


def cbor(value: object) -> bytes:
    """Maps, texts, bytes and numbers, as RFC 8949 has them."""
    if isinstance(value, dict):
        return bytes([0xA0 | len(value)]) + b"".join(cbor(key) + cbor(one) for key, one in value.items())
    if isinstance(value, int):
        major, count, body = 0, value, b""
    else:
        body = value.encode() if isinstance(value, str) else value  # type: ignore[assignment]
        major, count = 0x60 if isinstance(value, str) else 0x40, len(body)
    head = bytes([major | count]) if count < 24 else b""
    for code, kind, below in ((24, ">B", 1 << 8), (25, ">H", 1 << 16), (26, ">I", 1 << 32)):
        if not head and count < below:
            head = bytes([major | code]) + struct.pack(kind, count)
    return head + body


def console(packet: bytes) -> bytes:
    """The lines of a packet."""
    whole, lines = struct.pack(">H", len(packet) + 2) + packet + CRC, b""
    for at in range(0, len(whole), 93):
        lines += (b"\4\x14" if at else b"\6\t") + base64.b64encode(whole[at : at + 93]) + b"\n"
    assert max(map(len, lines.split(b"\n"))) < 127
    return lines


def test_smp() -> None:
    """Packets of 256 bytes but for the last, whose maps are made here and cut by their lengths."""
    size, at, exchanges = 8384, 0, []
    while at < size:
        more = {"image": 0, "len": size, "sha": bytes(32)} if at == 0 else {}
        taken = min(size - at, 256)
        while len(packet := bytes(8) + cbor({**more, "off": at, "data": bytes(taken)})) > 252:
            taken -= 1
        at += taken
        exchanges.append((len(console(packet)), len(console(bytes(8) + cbor({"rc": 0, "off": at})))))
    assert smp(size) == exchanges


def test_a_share_is_payload_over_what_the_line_could_carry() -> None:
    way = Way(100_000, 0.002, 0.003)
    assert way.seconds([(10, 10), (80, 0)]) == pytest.approx(100 * 10 / 100_000 + 2 * 0.005)
    assert way.share(50, [(10, 10), (80, 0)]) == pytest.approx(0.005 / 0.020)


@pytest.mark.common
def test_the_rows_of_the_page_are_these() -> None:
    """In virtual time: the same on every machine."""
    from sections.line import HEAD, measure

    assert [dict(zip(HEAD, row, strict=True)) for row in measure().rows] == tables("line")
    assert {row["protocol"] for row in tables("line")} > set(PROTOCOLS)
