"""Parse TOML text to plain values, and locate the line of every key.

The standard library parses and validates, but gives no lines, so a second, lenient walk over the text, which is
known to be valid by then, notes the line of each key.
"""

import re
import tomllib
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any

from tablegen.base.input_errors import Document, Problem, Rejected
from tablegen.base.reading import CONFIGURATION, read_text

_BARE_KEY = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_")
_ESCAPES = {"b": "\b", "t": "\t", "n": "\n", "f": "\f", "r": "\r", '"': '"', "\\": "\\"}
# Parts of one dotted key, whose memory in the parser grows with their square; the deepest of the schema has 7. Parts
# of all keys of three parts or more, since each part takes the parser a kilobyte.
_MAXIMUM_PARTS, _MAXIMUM_PARTS_OF_ALL = 20, 50_000
_MAXIMUM_DIGITS = 4300  # digits of a decimal number that Python converts
_FILES_REMEMBERED, _MOST_REMEMBERED = 4, 1 << 16  # files that are not parsed twice, and characters of one


def read_toml(path: Path, name: str) -> tuple[dict[str, Any], Document]:
    """Return the values of a file and the places of its keys; ``name`` is that of the file in messages.

    Raises
    ------
    Rejected
        If it cannot be read or is not TOML.
    """
    try:
        text = read_text(path, CONFIGURATION)
    except OSError as error:
        raise Rejected([Problem(name, 0, "", f"cannot be read: {error.strerror or error}")]) from None
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise Rejected([Problem(name, line, "", f"byte 0x{error.object[error.start]:02x} is not UTF-8")]) from None
    if text.startswith("\ufeff"):
        why = "begins with a byte order mark, which TOML does not have; save it as UTF-8 without one"
        raise Rejected([Problem(name, 1, "", why)])
    return parse_toml(text, name)


def parse_toml(text: str, name: str) -> tuple[dict[str, Any], Document]:
    """Return the values of TOML text and the places of its keys.

    Raises
    ------
    Rejected
        If it is not TOML.
    """
    text = text.replace("\r\n", "\n")
    try:
        if len(text) > _MOST_REMEMBERED:
            return _parsed(text, name)
        values, document = _remembered(text, name)
        return deepcopy(values), document
    except tomllib.TOMLDecodeError as error:
        raise Rejected([_syntax_problem(name, text, str(error))]) from None
    except RecursionError:
        raise Rejected([Problem(name, 0, "", "nested too deeply for a configuration")]) from None
    except ValueError:  # the parser does not convert the longest decimal numbers, and does not say where they are
        line, digits = _long_number(text)
        raise Rejected([Problem(name, line, "", f"a number of {digits} digits is too long")]) from None


def _parsed(text: str, name: str) -> tuple[dict[str, Any], Document]:
    _refuse_long_keys(text, name)
    values = tomllib.loads(text)
    return values, Document(name, _KeyLines(text).locate())


# A scan that is changed while it plays is read again at each change, with its scanner, and neither text is another.
_remembered = lru_cache(maxsize=_FILES_REMEMBERED)(_parsed)


_PART = r"""(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
# Comments and texts are skipped; whatever else has dots between its parts may be a key. A text that is not closed
# is skipped too, so that none is scanned twice.
_KEYS = (
    r"""(?s)#[^\n]*+|"{3}(?:[^"\\]|\\.|"(?!""))*+(?:"{3,5})?|'{3}(?:[^']|'(?!''))*+(?:'{3,5})?"""
    rf"""|(?P<key>{_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{2,}}+)"""
    r"""|[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\[^\n])*+"?|'[^'\n]*+'?"""
)


def _refuse_long_keys(text: str, name: str) -> None:
    """Raise ``Rejected`` at the first key that has too many parts; the text need not be valid."""
    dots = [line.count(".") for line in text.split("\n")]
    if max(dots) < _MAXIMUM_PARTS and 2 * sum(dots) < _MAXIMUM_PARTS_OF_ALL:
        return  # no line has such a key, nor all lines so many parts: most files need no closer look
    total = 0
    for match in re.finditer(_KEYS, text):
        if match["key"]:
            parts = len(re.findall(_PART, match["key"], re.DOTALL))
            total += parts
            if parts <= _MAXIMUM_PARTS and total <= _MAXIMUM_PARTS_OF_ALL:
                continue
            line = text.count("\n", 0, match.start()) + 1
            why = f"a key of {parts} parts; at most {_MAXIMUM_PARTS} are read"
            if parts <= _MAXIMUM_PARTS:
                why = f"the dotted keys so far have {total} parts; at most {_MAXIMUM_PARTS_OF_ALL} are read"
            raise Rejected([Problem(name, line, "", why)])


def _syntax_problem(name: str, text: str, message: str) -> Problem:
    head, has_place, place = message.rpartition(" (at ")
    if not has_place:
        return Problem(name, 0, "", f"not TOML: {message}")
    if place.startswith("line "):
        line = int(place[5:].split(",")[0])
        return Problem(name, line, "", f"not TOML: {head}, column {place.split('column ')[1].rstrip(')')}")
    if head == 'Expected "\'"':  # the parser looked for the closing quote to the end: the last quote is the opening one
        line = text.count("\n", 0, text.rindex("'")) + 1
        return Problem(name, line, "", "not TOML: a text in single quotes is not closed")
    return Problem(name, max(text.rstrip("\n").count("\n") + 1, 1), "", f"not TOML: {head} at the end of the file")


def _long_number(text: str) -> tuple[int, int]:
    """Return line and digits of the first decimal number that is too long to convert; the text before it is valid."""
    try:
        _KeyLines(text).locate()
    except _LongNumber as number:
        return number.line, number.digits
    raise AssertionError("no other value is refused by its size")  # pragma: no cover


def join_key(prefix: str, key: str) -> str:
    """Return ``x.table`` for ``x`` and ``table``; a key that is not bare is quoted."""
    part = key
    if not key or not _BARE_KEY.issuperset(key):
        part = '"' + key.encode("unicode_escape").decode().replace('"', '\\"') + '"'
    return f"{prefix}.{part}" if prefix else part


class _LongNumber(Exception):
    def __init__(self, line: int, digits: int) -> None:
        self.line, self.digits = line, digits
        super().__init__()


class _KeyLines:
    """One walk over valid TOML text that notes on which line each key stands."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0
        self._line = 1
        self._lines: dict[str, int] = {}
        self._elements: dict[str, int] = {}  # number of elements so far, of each array of tables

    def locate(self) -> dict[str, int]:
        table = ""
        self._skip(" \t\n")
        while self._at < len(self._text):
            if self._text.startswith("[[", self._at):
                table = self._header(2)
            elif self._text[self._at] == "[":
                table = self._header(1)
            else:
                self._pair(table)
            self._skip(" \t\n")
        return self._lines

    def _header(self, brackets: int) -> str:
        self._advance(brackets)
        keys = self._key()
        path = ""
        for depth, key in enumerate(keys):
            path = join_key(path, key)
            if brackets == 2 and depth == len(keys) - 1:
                self._lines.setdefault(path, self._line)
                self._elements[path] = self._elements.get(path, 0) + 1
            if path in self._elements:
                path += f"[{self._elements[path] - 1}]"
            self._lines.setdefault(path, self._line)
        self._lines[path] = self._line  # though a header of a sub-table may have named it before
        self._skip(" \t")
        self._advance(brackets)
        return path

    def _pair(self, table: str) -> None:
        line = self._line
        path = table
        for key in self._key():
            path = join_key(path, key)
            self._lines.setdefault(path, line)
        self._skip(" \t")
        self._advance(1)  # =
        self._value(path)

    def _key(self) -> list[str]:
        keys = []
        while True:
            self._skip(" \t")
            if self._text[self._at] in "\"'":
                keys.append(self._string())
            else:
                start = self._at
                while self._at < len(self._text) and self._text[self._at] in _BARE_KEY:
                    self._at += 1
                keys.append(self._text[start : self._at])
            self._skip(" \t")
            if self._text[self._at] != ".":
                return keys
            self._advance(1)

    def _value(self, path: str) -> None:
        self._skip(" \t")
        opening = self._text[self._at]
        if opening in "\"'":
            self._string()
        elif opening == "[":
            self._array(path)
        elif opening == "{":
            self._inline_table(path)
        else:
            start = self._at
            while self._at < len(self._text) and self._text[self._at] not in ",]}#\n":
                self._at += 1
            number = self._text[start : self._at].strip("+- \t").replace("_", "")
            if len(number) > _MAXIMUM_DIGITS and number.isdigit():
                raise _LongNumber(self._line, len(number))

    def _array(self, path: str) -> None:
        self._advance(1)
        index = 0
        while True:
            self._skip(" \t\n,")
            if self._text[self._at] == "]":
                return self._advance(1)
            element = f"{path}[{index}]"
            self._lines[element] = self._line
            self._value(element)
            index += 1

    def _inline_table(self, path: str) -> None:
        self._advance(1)
        while True:
            self._skip(" \t\n,")
            if self._text[self._at] == "}":
                return self._advance(1)
            self._pair(path)

    def _string(self) -> str:
        quote = self._text[self._at]
        if self._text.startswith(quote * 3, self._at):
            end = self._at + 3
            while not self._text.startswith(quote * 3, end):
                end += 2 if quote == '"' and self._text[end] == "\\" else 1
            end += 3
            while end < len(self._text) and self._text[end] == quote:  # quotes just before the closing three
                end += 1
            body = self._text[self._at + 3 : end - 3]
        else:
            end = self._at + 1
            while self._text[end] != quote:
                end += 2 if quote == '"' and self._text[end] == "\\" else 1
            body = self._text[self._at + 1 : end]
            end += 1
        self._advance(end - self._at)
        return _unescape(body) if quote == '"' else body

    def _skip(self, blanks: str) -> None:
        """Skip the given blanks, and comments where a line may end."""
        while self._at < len(self._text):
            character = self._text[self._at]
            if character in blanks:
                self._advance(1)
            elif character == "#" and "\n" in blanks:
                end = self._text.find("\n", self._at)
                self._at = len(self._text) if end < 0 else end
            else:
                return

    def _advance(self, count: int) -> None:
        self._line += self._text.count("\n", self._at, self._at + count)
        self._at += count


def _unescape(body: str) -> str:
    if "\\" not in body:
        return body
    out, at = [], 0
    while at < len(body):
        if body[at] != "\\":
            out.append(body[at])
            at += 1
            continue
        code = body[at + 1]
        digits = {"u": 4, "U": 8}.get(code, 0)
        if digits:
            out.append(chr(int(body[at + 2 : at + 2 + digits], 16)))
        else:
            out.append(_ESCAPES.get(code, code))
        at += 2 + digits
    return "".join(out)
