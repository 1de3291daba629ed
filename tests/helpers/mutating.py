"""Files of users, damaged by a seed: bytes that change, go, or come twice, and what programs stumble over."""

import json
import random
from collections.abc import Iterator
from typing import Any

# Numbers that overflow or vanish, controls that steer a terminal, brackets without end, kinds that do not fit.
WORDS = (
    b"1e-320", b"-1e308", b"1e999", b"nan", b"inf", b"0", b"-1", b"9" * 400, b"1" * 5000, b"\x1b]0;owned\x07",
    b"\x1b[2J", b"\r", b"\x00", b"\x9b31m", "\u202e".encode(), b"[" * 5000, b"{\"a\":" * 2000, b"a." * 3000, b"'''",
    b'"', b"#", b",", b";", b"\t", b"\n", b"\n\n[", b"true", b"null", b"\xff\xfe", b"\xef\xbb\xbf", b"1979-05-27",
    b"%s" * 50, b"x" * 3000,
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    5, -1, 0, 1e-320, -1e308, 1e308, 2**31, 2**63, -(2**70), 10**4000, 0.5, True, None, "", "\x1b]0;owned\x07\r\x9b",
    "\u202eevil", "x" * 5000, "../../etc/passwd", "dac_link", [], {}, [[]] * 50, {"z": 5}, "nan", float("inf"),
    float("nan"), [0] * 3000, [1e-320] * 32,
)  # fmt: skip


def damaged(content: bytes, random: random.Random) -> bytes:
    """One to four damages; random bytes of a text are characters, so that more than its encoding is tried."""
    made, plain = bytearray(content), content.isascii()
    for _ in range(random.randint(1, 4)):
        at = random.randrange(len(made) + 1)
        end = min(at + random.choice((1, 2, 8, 100, 5000)), len(made))
        match random.randrange(6):
            case 0:
                made[at:end] = bytes(
                    random.randrange(32, 127) if plain else random.randrange(256) for _ in made[at:end]
                )
            case 1:
                made[at:at] = random.choice(WORDS)
            case 2:
                made[at:end] = random.choice(WORDS)
            case 3:
                made[at:at] = made[at:end] * random.randint(1, 3)
            case 4:
                del made[at:end]
            case _ if made:
                made[at % len(made)] ^= 1 << random.randrange(8)
    return bytes(made[: random.randrange(len(made) + 1)] if random.random() < 0.05 else made)


def damaged_json(content: bytes, random: random.Random) -> bytes:
    """One to three values of a document in JSON replaced, removed or put elsewhere."""
    document = json.loads(content)
    for _ in range(random.randint(1, 3)):
        holder, key = random.choice(list(_places(document)))
        match random.randrange(4):
            case 0 if isinstance(holder, dict):
                del holder[key]
            case 1 if isinstance(holder, dict):
                holder[random.choice(("z", "\x1b[2J", "x" * 3000, str(key)))] = random.choice(VALUES)
            case _:
                holder[key] = random.choice(VALUES)
        if not document:
            break
    return json.dumps(document).encode()


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Every place of a document; of long lists only the first and the last."""
    if isinstance(value, dict):
        inner = list(value.items())
    elif isinstance(value, list):
        inner = [(i, value[i]) for i in sorted({0, len(value) - 1}) if value]
    else:
        return
    for key, child in inner:
        yield value, key
        yield from _places(child)
