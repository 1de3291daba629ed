"""Share of a line's rate that is payload, by the framing of protocols that wait for each answer.

Sources: XMODEM and YMODEM: C. Forsberg, "XMODEM/YMODEM Protocol Reference", 1988, sections 4 to 7. SMP: the pages "SMP
Transport Specification" (UART and console) and "SMP Protocol Specification" of Zephyr's documentation; the image upload
of group 1, command 1, with the maximum of 127 bytes a frame and the default buffer of 256 bytes a packet.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import ceil

BITS = 10  # of a byte on the wire: a start and a stop bit


@dataclass(frozen=True)
class Way:
    """A line: its rate, and the latencies from host to device and back, s."""

    baud: int
    out_s: float
    back_s: float

    def seconds(self, exchanges: "list[tuple[int, int]]") -> float:
        """Of exchanges in turn: bytes out, then bytes back."""
        wire = sum(out + back for out, back in exchanges) * BITS / self.baud
        return wire + len(exchanges) * (self.out_s + self.back_s)

    def share(self, payload: int, exchanges: "list[tuple[int, int]]") -> float:
        """Of the rate of the line from host to device."""
        return payload * BITS / self.baud / self.seconds(exchanges)


def xmodem(payload: int) -> list[tuple[int, int]]:
    """SOH, number, its complement, 128 bytes, a check sum; an ACK each. EOT and its ACK.

    The NAK with which the receiver begins is left out.
    """
    return [(132, 1)] * ceil(payload / 128) + [(1, 1)]


def ymodem_1k(payload: int, short: bool = True) -> list[tuple[int, int]]:
    """STX, number, its complement, 1024 bytes, CRC-16; an ACK each.

    What is left at the end goes in ``short`` blocks of 128 where these take less, or in a long one. Before all of them
    block 0 with the name and the length, answered by ACK and C; behind them EOT twice, answered by NAK and by ACK with
    C, and an empty block 0.
    """
    whole, rest = divmod(payload, 1024)
    blocks = ceil(rest / 128)
    ends = [(133, 1)] * blocks if short and blocks * 133 < 1029 else [(1029, 1)] * (rest > 0)
    return [(133, 2), *[(1029, 1)] * whole, *ends, (1, 1), (1, 2), (133, 1)]


def _cbor_unsigned(value: int) -> int:
    """Bytes of a number in CBOR."""
    return 1 if value < 24 else 2 if value < 256 else 3 if value < 65536 else 5


def _cbor_text(text: str) -> int:
    return 1 + len(text)  # all keys here are shorter than 24


def _console(body: int) -> int:
    """Bytes on the console of a packet: frames of 127 bytes at most, two of mark, base64, a newline.

    Before encoding the packet has its length in front and a CRC-16 behind.
    """
    whole = 2 + body + 2
    bytes_out = 0
    while whole > 0:
        taken = min(whole, 93)  # 124 characters of base64
        bytes_out += 2 + 4 * ceil(taken / 3) + 1
        whole -= taken
    return bytes_out


_HEADER = 8  # of a packet of SMP
_PACKET = 256  # bytes of a packet, with its length and CRC-16: CONFIG_MCUMGR_SMP_UART_MTU
_DIGEST = 32


def smp(payload: int) -> list[tuple[int, int]]:
    """Image uploads: a map of "off" and "data", at first with "image", "len", "sha" too; answers of "rc" and "off"."""
    exchanges, at = [], 0
    while at < payload:
        fixed = _HEADER + 1 + _cbor_text("off") + _cbor_unsigned(at) + _cbor_text("data") + 2
        if at == 0:
            fixed += _cbor_text("image") + 1 + _cbor_text("len") + _cbor_unsigned(payload)
            fixed += _cbor_text("sha") + 2 + _DIGEST
        taken = min(payload - at, _PACKET - 4 - fixed)
        at += taken
        answer = _HEADER + 1 + _cbor_text("rc") + 1 + _cbor_text("off") + _cbor_unsigned(at)
        exchanges.append((_console(fixed + taken), _console(answer)))
    return exchanges


PROTOCOLS: dict[str, tuple[str, Callable[[int], list[tuple[int, int]]]]] = {  # name: what checks it, its exchanges
    "XMODEM": ("sum of 8 bits", xmodem),
    "YMODEM-1K, its end in short blocks": ("CRC-16", ymodem_1k),
    "YMODEM-1K, long blocks alone": ("CRC-16", partial(ymodem_1k, short=False)),
    "SMP over a console (mcumgr)": ("CRC-16, SHA-256", smp),
}
