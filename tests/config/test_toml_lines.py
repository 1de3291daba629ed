"""The locator of keys against an independent oracle: documents whose writer notes where it puts each key.

A document is drawn as a tree and laid out at random: dotted keys, headers before or after those of their sub-tables,
arrays of tables, inline tables, arrays over several lines with comments, strings of all four kinds.
"""

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tablegen.base.input_errors import Rejected
from tablegen.base.toml import parse_toml, read_toml

Path_ = tuple[str | int, ...]

settings.register_profile("toml", derandomize=True, deadline=None, max_examples=120)
STEADY = settings.get_profile("toml")

NASTY = "ab1-_ .\"'#[]{}=,\\\t\u00e9\u2028\U0001f600\x7f\n"
PLAIN_VALUES = (
    "1", "-17", "0xFF", "1_000", "3.5e3", "-inf", "nan", "true", "false",
    "1979-05-27", "1979-05-27 07:32:00", "1979-05-27T07:32:00.999-07:00", "07:32:00",
)  # fmt: skip
BASIC_PIECES = ("", "a", " ", "#", "[x]", "{", "}", "=", ",", "'", "'''", '\\"', "\\\\", "\\n", "\\u00e9", "\U0001f600")
LITERAL_PIECES = ("", "a", " ", "#", "[x]", "{", "}", "=", ",", '"', '"""', "\\", "\\\\", "\\u00", "\u00e9")
LONG_BASIC_PIECES = (*BASIC_PIECES, '"', '""', "\n", "\n\n", "\\\n   ", "\\\n\n.", "[[y]]\n", "z = 1\n")
LONG_LITERAL_PIECES = (*LITERAL_PIECES, "'", "''", "\n", "\n\n", "\\\n   ", "[[y]]\n", "z = 1\n")
COMMENTS = ("#", '# ] } " \'\'\' """ = [[x]]', "# \u00e9 a = 1", '#"')


@dataclass
class Leaf:
    """A value that is no table and no array, as it is written."""

    text: str


@dataclass
class Table:
    """A table, as yet without a layout."""

    items: dict[str, "Node"]


@dataclass
class Array:
    """An array; one of tables alone may become an array of tables."""

    items: list["Node"]


Node = Leaf | Table | Array


@dataclass
class Writer:
    """Text so far, the line it has reached, and where each key was put."""

    draw: st.DrawFn
    text: str = ""
    line: int = 1
    places: dict[Path_, int] = field(default_factory=dict)

    def put(self, text: str) -> None:
        self.text += text
        self.line += text.count("\n")

    def note(self, path: Path_) -> None:
        self.places.setdefault(path, self.line)

    def chance(self) -> bool:
        return self.draw(st.booleans())

    def one_of(self, *choices: str) -> str:
        return self.draw(st.sampled_from(choices))

    def blank(self) -> None:
        """Nothing, spaces or a tab."""
        self.put(self.one_of("", " ", "\t ", "  "))

    def end_line(self) -> None:
        self.blank()
        self.put(self.one_of("", "", *COMMENTS) + "\n")
        if self.chance():
            self.put(self.one_of("\n", "  \n\n", "# [a]\n", "\t# b = 'c'\n"))

    def key(self, key: str) -> None:
        ways = []
        if re.fullmatch("[A-Za-z0-9_-]+", key):
            ways.append(key)
        if not re.search("['\n\x7f]", key):
            ways.append(f"'{key}'")
        ways.append('"' + "".join(self._escaped(c) for c in key) + '"')
        self.put(self.one_of(*ways))

    def _escaped(self, character: str) -> str:
        short = {"\n": "\\n", "\t": "\\t", '"': '\\"', "\\": "\\\\"}
        if character in short:
            return short[character]
        code = ord(character)
        long = f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08X}"
        return long if character == "\x7f" or self.draw(st.integers(0, 4)) == 0 else character

    def keys(self, path: Path_, first: int) -> None:
        """The dotted key path[first:], numbers left out; its parts are noted by the caller."""
        parts = [part for part in path[first:] if isinstance(part, str)]
        for i, part in enumerate(parts):
            if i:
                self.blank()
                self.put(".")
                self.blank()
            self.key(part)


def write_value(writer: Writer, path: Path_, node: Node, one_line: bool) -> None:
    """What stands after ``=``; ``one_line`` inside inline tables, where only values may go over several lines."""
    match node:
        case Leaf():
            writer.put(node.text)
        case Array():
            writer.put("[")
            for i, item in enumerate(node.items):
                array_gap(writer)
                writer.note((*path, i))
                write_value(writer, (*path, i), item, one_line)
                if i + 1 < len(node.items) or writer.chance():
                    array_gap(writer)
                    writer.put(",")
            array_gap(writer)
            writer.put("]")
        case Table():
            writer.put("{")
            for i, (key, item) in enumerate(node.items.items()):
                writer.put("," if i else "")
                writer.blank()
                write_pair(writer, (*path, key), len(path), item, one_line=True)
            writer.blank()
            writer.put("}")


def array_gap(writer: Writer) -> None:
    writer.put(writer.one_of("", "", " ", "\n", "\n  \n", " # ] ,\n", '# """\n# [\n'))


def write_pair(writer: Writer, path: Path_, first: int, node: Node, one_line: bool) -> None:
    """``path[first:] = node``, where a table may go on as dotted keys if it is alone on its line."""
    for end in range(first + 1, len(path) + 1):
        writer.note(path[:end])
    if isinstance(node, Table) and len(node.items) == 1 and writer.chance():
        ((key, item),) = node.items.items()
        write_pair(writer, (*path, key), first, item, one_line)
        return
    writer.keys(path, first)
    writer.blank()
    writer.put("=")
    writer.blank()
    write_value(writer, path, node, one_line)


def write_dotted(writer: Writer, path: Path_, first: int, table: Table) -> None:
    """A table as a dotted key a line."""
    for key, item in table.items.items():
        if isinstance(item, Table) and item.items and writer.chance():
            write_dotted(writer, (*path, key), first, item)
        else:
            writer.blank()
            write_pair(writer, (*path, key), first, item, one_line=False)
            writer.end_line()


def write_table(writer: Writer, path: Path_, table: Table, header: str) -> None:
    """A table with its header ("", "[" or "[["), its pairs, and its sub-tables under headers of their own."""
    inside: list[tuple[str, Node]] = []
    below: list[tuple[str, Table | Array]] = []
    for key, item in table.items.items():
        tables = isinstance(item, Table) or (item.items and all(isinstance(i, Table) for i in item.items)) \
            if not isinstance(item, Leaf) else False  # fmt: skip
        if tables and writer.chance():
            assert isinstance(item, Table | Array)
            below.append((key, item))
        else:
            inside.append((key, item))

    # A header may stand after those of its sub-tables, and be left out where it has nothing to say.
    late = header == "[" and bool(below) and writer.chance()
    silent = header == "[" and bool(below) and not inside and writer.chance()
    if late:
        write_below(writer, path, below)
    if header and not silent:
        write_header(writer, path, header)
    for key, item in inside:
        if isinstance(item, Table) and item.items and writer.chance():
            write_dotted(writer, (*path, key), len(path), item)
        else:
            writer.blank()
            write_pair(writer, (*path, key), len(path), item, one_line=False)
            writer.end_line()
    if not late:
        write_below(writer, path, below)


def write_header(writer: Writer, path: Path_, header: str) -> None:
    writer.blank()
    for end in range(1, len(path)):
        writer.note(path[:end])
    writer.places[path] = writer.line  # its own header is where a table stands, whoever named it before
    writer.put(header)
    writer.blank()
    writer.keys(path, 0)
    writer.blank()
    writer.put("]" * len(header))
    writer.end_line()


def write_below(writer: Writer, path: Path_, below: list[tuple[str, Table | Array]]) -> None:
    for key, item in below:
        if isinstance(item, Table):
            write_table(writer, (*path, key), item, "[")
            continue
        for i, element in enumerate(item.items):
            assert isinstance(element, Table)
            for end in range(1, len(path) + 1):
                writer.note(path[:end])
            if i == 0:
                writer.blank()
                writer.note((*path, key))
            write_table(writer, (*path, key, i), element, "[[")


def strings() -> st.SearchStrategy[str]:
    """String values of all four kinds, as they are written."""

    def joined(pieces: tuple[str, ...]) -> st.SearchStrategy[str]:
        return st.lists(st.sampled_from(pieces), max_size=6).map("".join)

    def long(pieces: tuple[str, ...], quote: str) -> st.SearchStrategy[str]:
        # Up to two quotes in a row are text, even just before the closing three.
        body = joined(pieces).map(lambda s: re.sub(f"{quote}{{3,}}", quote * 2, s))
        last = st.sampled_from(("-", "- ", "-" + quote, "-" + quote * 2))
        return st.tuples(body, last).map(lambda p: quote * 3 + "".join(p) + quote * 3)

    return st.one_of(
        joined(BASIC_PIECES).map(lambda s: f'"{s}"'),
        joined(LITERAL_PIECES).map(lambda s: f"'{s}'"),
        long(LONG_BASIC_PIECES, '"'),
        long(LONG_LITERAL_PIECES, "'"),
    )


def nodes() -> st.SearchStrategy[Node]:
    """Values of any kind."""
    leaves = st.one_of(st.sampled_from(PLAIN_VALUES), strings()).map(Leaf)
    return st.recursive(
        leaves, lambda node: st.one_of(tables(node), tables(node), arrays(node), arrays(tables(node))), max_leaves=14
    )


def tables(node: st.SearchStrategy[Any]) -> st.SearchStrategy[Table]:
    keys = st.one_of(st.sampled_from("abcd"), st.text(st.sampled_from(NASTY), max_size=4))
    return st.dictionaries(keys, node, max_size=4).map(Table)


def arrays(node: st.SearchStrategy[Any]) -> st.SearchStrategy[Array]:
    return st.lists(node, max_size=3).map(Array)


@st.composite
def documents(draw: st.DrawFn) -> tuple[str, dict[str, int]]:
    """A document, and the line of each of its keys."""
    writer = Writer(draw)
    writer.put(writer.one_of("", "\n", "# first\n\n", "   \n"))
    write_table(writer, (), draw(tables(nodes())), "")
    if writer.chance():
        writer.text = writer.text.rstrip("\n")  # a file need not end with a line end
    return writer.text, {spelled(path): line for path, line in writer.places.items()}


def spelled(path: Path_) -> str:
    """A path as messages show it."""
    shown = ""
    for part in path:
        if isinstance(part, int):
            shown += f"[{part}]"
            continue
        bare = part != "" and all(c in "-_" or (c.isascii() and c.isalnum()) for c in part)
        quoted = '"' + part.encode("unicode_escape").decode("ascii").replace('"', '\\"') + '"'
        shown += ("." if shown else "") + (part if bare else quoted)
    return shown


def every_path(value: Any, path: Path_ = ()) -> Iterator[Path_]:
    """The paths of everything inside a parsed document."""
    inside: list[tuple[str | int, Any]] = []
    if isinstance(value, dict):
        inside = list(value.items())
    elif isinstance(value, list):
        inside = list(enumerate(value))
    for key, item in inside:
        yield (*path, key)
        yield from every_path(item, (*path, key))


def located(folder: Path, content: str | bytes) -> dict[str, int]:
    file = folder / "scan.toml"
    file.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_toml(file, "scan.toml")[1].lines


def refused(folder: Path, content: str | bytes) -> str:
    """What is said of a file that cannot be read: one message."""
    with pytest.raises(Rejected) as caught:
        located(folder, content)
    (problem,) = caught.value.problems
    return str(problem)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder for all documents of this file."""
    return tmp_path_factory.mktemp("toml")


@pytest.mark.rest
@STEADY
@given(documents())
def test_every_key_is_found_on_its_line_and_nothing_else(folder: Path, document: tuple[str, dict[str, int]]) -> None:
    text, lines = document
    assert set(lines) == {spelled(path) for path in every_path(tomllib.loads(text))}, "the writer of this test errs"
    assert located(folder, text) == lines


@pytest.mark.rest
@settings(STEADY, max_examples=50)
@given(documents())
def test_line_ends_of_windows_change_nothing(folder: Path, document: tuple[str, dict[str, int]]) -> None:
    text, lines = document
    assert located(folder, text.replace("\n", "\r\n")) == lines


@pytest.mark.common
@settings(STEADY, max_examples=100)
@given(documents(), st.data())
def test_a_syntax_error_is_reported_on_its_line(
    folder: Path, document: tuple[str, dict[str, int]], data: st.DataObject
) -> None:
    text = document[0].rstrip("\n")
    wrong = data.draw(st.sampled_from(("x y = 1", 'x = "a', "= 1", "x = ", "x = 1 2", "[x", "x = 'a", "x = 01", "]")))
    line = text.count("\n") + 2
    assert refused(folder, f"{text}\n{wrong}\nlast = 1\n").startswith(f"scan.toml:{line}: not TOML: ")


@pytest.mark.rest
@settings(STEADY, max_examples=50)
@given(documents(), st.sampled_from((b"\xff", b"\xc3(", b"\xed\xa0\x80", b"\xf8\x88")))
def test_a_byte_that_is_not_utf8_is_reported_on_its_line(
    folder: Path, document: tuple[str, dict[str, int]], wrong: bytes
) -> None:
    text = document[0].rstrip("\n")
    message = refused(folder, text.encode() + b"\n# " + wrong + b"\nlast = 1\n")
    assert message == f"scan.toml:{text.count(chr(10)) + 2}: byte 0x{wrong[0]:02x} is not UTF-8"


def test_an_unfinished_file_is_reported_at_its_last_line(folder: Path) -> None:
    assert refused(folder, "a = 1\nb = [1,\n2,\n\n") == ("scan.toml:3: not TOML: Invalid value at the end of the file")


def test_a_byte_order_mark_is_named(folder: Path) -> None:
    assert refused(folder, b"\xef\xbb\xbfa = 1\n") == (
        "scan.toml:1: begins with a byte order mark, which TOML does not have; save it as UTF-8 without one"
    )


def test_a_key_given_twice_is_reported_where_it_is_given_again(folder: Path) -> None:
    assert refused(folder, "[a]\nb = 1\n\n[a]\n").startswith("scan.toml:4: not TOML: Cannot declare ('a',) twice")


def test_a_header_after_those_of_its_sub_tables_is_where_the_table_stands(folder: Path) -> None:
    assert located(folder, "[a.b]\nc = 1\n\n[a]\nd = 2\n") == {"a": 4, "a.b": 1, "a.b.c": 2, "a.d": 5}


def test_keys_that_look_alike_are_told_apart(folder: Path) -> None:
    lines = located(folder, '"a b".\'c d\' = 1\n"a b\\".\\"c d" = 2\n')
    assert lines == {'"a b"': 1, '"a b"."c d"': 1, '"a b\\".\\"c d"': 2}


@pytest.mark.parametrize("nested", ["[" * 5000 + "]" * 5000, "{a=" * 5000 + "1" + "}" * 5000, "[" * 300_000])
def test_thousands_of_brackets_are_refused(folder: Path, nested: str) -> None:
    assert refused(folder, f"a = {nested}\n") == "scan.toml: nested too deeply for a configuration"


def test_a_moderately_deep_array_is_located_to_its_bottom(folder: Path) -> None:
    lines = located(folder, "a = " + "[\n" * 50 + "]" * 50)
    assert lines["a" + "[0]" * 49] == 50
    assert len(lines) == 50


def test_a_huge_hexadecimal_number_is_read(folder: Path) -> None:
    assert located(folder, "a = 0x" + "f" * 50_000 + "\nb = 1\n") == {"a": 1, "b": 2}


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a = 1\nb = {n}\n", 2),
        ("# {n}\na = '{n}'\n[b]\nc = [1,\n -{n}]\n", 5),
        ("a = { b = 1, c = +{n} }", 1),
        ("a = '''\n{n}\n'''\nb = {n}", 4),
    ],
)
def test_a_huge_decimal_number_is_reported_on_its_line(folder: Path, text: str, line: int) -> None:
    message = refused(folder, text.replace("{n}", "1" * 5000))
    assert message == f"scan.toml:{line}: a number of 5000 digits is too long"


def test_an_oversized_file_is_not_even_parsed(folder: Path) -> None:
    assert refused(folder, b"#" * ((1 << 20) + 1)) == (
        "scan.toml: cannot be read: above 1 MiB, which is the most that a scan, scanner or operator file may have"
    )
    assert located(folder, b"#" * (1 << 20)) == {}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("b = 1\n" + "a." * 20 + "a = 1", "scan.toml:2: a key of 21 parts; at most 20 are read"),
        ("[" + "'a' . " * 20_000 + "a]", "scan.toml:1: a key of 20001 parts; at most 20 are read"),
        ('y = { a = """x"""", ' + '"\\"" .' * 20 + "a = 1 }", "scan.toml:1: a key of 21 parts; at most 20 are read"),
        ("x = ''''a'''''\n" + "a." * 20 + "a = [", "scan.toml:2: a key of 21 parts; at most 20 are read"),
        (
            "".join(f"[k{i}.b.c]\n" for i in range(17_000)),
            "scan.toml:16667: the dotted keys so far have 50001 parts; at most 50000 are read",
        ),
    ],
)
def test_keys_that_would_fill_the_memory_are_refused(folder: Path, text: str, said: str) -> None:
    assert refused(folder, text) == said


@pytest.mark.parametrize("quoted", ['"{}"', "'{}'", '"""\n{}"""', "'''{}'''", '"\\"{}"', '""\n# {}', '"""a"""" # {}'])
def test_dots_in_texts_and_comments_make_no_key(folder: Path, quoted: str) -> None:
    assert located(folder, "a = " + quoted.format("a." * 30 + "a") + "\nb = 1.5\n").keys() == {"a", "b"}


def test_twenty_parts_are_read(folder: Path) -> None:
    assert len(located(folder, "a." * 19 + "a = 1")) == 20


def test_a_missing_file_and_a_folder_are_named(folder: Path) -> None:
    for path, why in ((folder / "absent.toml", "No such file or directory"), (folder, "Is a directory")):
        with pytest.raises(Rejected) as caught:
            read_toml(path, "scan.toml")
        assert [str(problem) for problem in caught.value.problems] == [f"scan.toml: cannot be read: {why}"]


def test_an_endless_device_is_given_up() -> None:
    with pytest.raises(Rejected) as caught:
        read_toml(Path("/dev/zero"), "scan.toml")
    assert str(caught.value) == "scan.toml: cannot be read: a device, where a regular file is needed"


def test_values_are_those_of_the_standard_library(folder: Path) -> None:
    file = folder / "scan.toml"
    file.write_text("a.b = 1979-05-27T07:32:00\n", encoding="utf-8")
    assert read_toml(file, "scan.toml")[0] == {"a": {"b": datetime(1979, 5, 27, 7, 32)}}


def test_values_of_a_text_that_is_read_again_are_its_own() -> None:
    """A caller may change what it got; another text or name is another file."""
    text = "[x]\nsizes = [1, 2]\n"
    (first, file), (again, _) = parse_toml(text, "a.toml"), parse_toml(text, "a.toml")
    first["x"]["sizes"].append(3)
    assert again == parse_toml(text, "a.toml")[0] == {"x": {"sizes": [1, 2]}}
    assert (file.line_of("x.sizes"), parse_toml(f"\n{text}", "a.toml")[1].line_of("x.sizes")) == (2, 3)
    assert parse_toml(text, "b.toml")[1].name == "b.toml"
