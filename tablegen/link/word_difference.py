"""Differences between the words of a device and those of a scan, by their names."""

from dataclasses import dataclass, replace

import numpy as np

from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS, SCAN_WORDS, SLOW_WORDS
from tablegen.link.prepare import PreparedScan
from tablegen.link.program_image import PROGRAM_BYTES, ImagePart, ProgramImage, parts_of, pixel_part

_SIGNED = {"gain", "offset_high"}


@dataclass(frozen=True, slots=True)
class Difference:
    """A word that differs; ``address`` is that of its first byte in the image, ``actual`` None beyond the end."""

    word: str
    address: int
    expected: int
    actual: int | None

    def __str__(self) -> str:
        if self.actual is None:
            return f"its image ends before {self.word} (byte {self.address})"
        return f"{self.word} (byte {self.address}) is {self.actual}, not {self.expected}"


def differences(scan: PreparedScan, image: bytes) -> list[Difference]:
    """Return all words of an image of a device that are not those of the scan, in order.

    Each axis is compared in the form in which the device holds it, words or Fourier words.
    """
    expected = scan.like(image)
    first, second = expected.first, expected.second
    if second is None:
        return _differences(first, image)
    size = len(first.data)
    differing = _differences(first, image[:size])
    of_z = _differences(second, image[size:])
    return differing + [replace(each, word=f"z, {each.word}", address=size + each.address) for each in of_z]


def _differences(expected: ProgramImage, image: bytes) -> list[Difference]:
    differing = []
    ours, theirs = _words(expected.data), _words(image)
    for index, word in enumerate(ours):
        there = theirs[index] if index < len(theirs) else None
        if there != word:
            name = _name(index)
            differing.append(
                Difference(
                    name, 4 * index, _signed_word(name, word), None if there is None else _signed_word(name, there)
                )
            )
    at = PROGRAM_BYTES
    data, info = expected.data, expected.info
    parts: list[tuple[str, ImagePart]] = [("x", part) for part in parts_of(ours, 1, info.x)]
    parts += [("y", part) for part in parts_of(ours, 2, info.y)]
    for page, part in [*parts, ("scan", pixel_part(ours))]:
        end, signed = at + part.length * part.size, page != "scan"
        there_words = _decoded(image[at:end], part.size, signed)
        for index, word in enumerate(_decoded(data[at:end], part.size, signed)):
            other = there_words[index] if index < len(there_words) else None
            if other != word:
                name = f"{page}: {part.name} word {index}"
                differing.append(Difference(name, at + part.size * index, word, other))
        at = end
    if len(image) > at:
        differing.append(Difference("after the last word", at, 0, len(image) - at))
    return differing


def _words(data: bytes) -> list[int]:
    head = data[:PROGRAM_BYTES]
    return [int(word) for word in np.frombuffer(head[: len(head) // 4 * 4], dtype="<u4")]


def _name(index: int) -> str:
    page, word = divmod(index, PAGE_WORDS)
    names = (*AXIS_WORDS, *SLOW_WORDS) if page else (*SCAN_WORDS, "pixel_table")
    return f"{('scan', 'x', 'y')[page]}: {names[word] if word < len(names) else f'unused word {word}'}"


def _signed_word(name: str, word: int) -> int:
    return word - (1 << 32) if name[3:] in _SIGNED and word >> 31 else word


def _decoded(data: bytes, size: int, signed: bool) -> list[int]:
    whole = len(data) // size * size
    return [int.from_bytes(data[at : at + size], "little", signed=signed) for at in range(0, whole, size)]
