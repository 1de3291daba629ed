"""What others wrote never steers a terminal: tried on one."""

import io
import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from editing import SCAN, edited, run, write_pair
from gwyfile.objects import GwyContainer, GwyDataField
from pseudo_terminal import on_pseudo_terminal

from tablegen.cli.shared.terminal import GuardedStream, erase, guard_streams, redraw, tell, visible

EVIL = "\x1b]0;owned\x07\x1b[31m\r\x9b2J\u202e\x7f"
SHOWN = "\\u001b]0;owned\\u0007\\u001b[31m\\u000d\\u009b2J\\u202e\\u007f"


def on_a_terminal(*arguments: str | Path, encoding: str = "utf-8") -> tuple[int, str]:
    """Status, and what a terminal gets of stdout and stderr."""
    return on_pseudo_terminal(arguments, {**os.environ, "TERM": "xterm", "PYTHONIOENCODING": encoding})


def steering(text: str) -> list[str]:
    return [c for c in text if c != "\n" and c != "\t" and (not c.isprintable())]


def test_what_is_visible() -> None:
    assert visible(EVIL) == SHOWN
    assert visible("\u00c5 \u03bcm, \u4e2d\t1\n") == "\u00c5 \u03bcm, \u4e2d\t1\n"
    assert json.loads(visible(json.dumps({"a": EVIL}, ensure_ascii=False))) == {"a": EVIL}


def test_every_control_of_unicode_is_seen() -> None:
    controls = [*range(0x20), *range(0x7F, 0xA0), *range(0x200B, 0x2010), *range(0x2028, 0x202F)]
    controls += [*range(0x2060, 0x206A), 0x061C, 0xFEFF]
    assert [c for c in controls if visible(chr(c)) == chr(c)] == [ord("\t"), ord("\n")]


class Terminal(io.StringIO):
    """A stream that says that it is one."""

    encoding = "ANSI_X3.4-1968"  # type: ignore[assignment]

    def isatty(self) -> bool:
        return True


def test_nothing_gets_past_the_guard_but_what_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    out, err = Terminal(), Terminal()
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setattr(sys, "stderr", err)
    guard_streams()
    guard_streams()
    assert isinstance(sys.stdout, GuardedStream)
    assert sys.stdout.stream is out
    sys.stdout.writelines([EVIL, "a\n"])
    tell(EVIL)
    tell(EVIL, bold=True)
    assert out.getvalue() == f"{SHOWN}a\n{SHOWN}\n\x1b[1m{SHOWN}\x1b[0m\n"
    redraw(EVIL)
    erase(3)
    assert err.getvalue() == f"\r{SHOWN}\r   \r"
    assert sys.stdout.encoding == "iso8859-1"  # beside one of ASCII click would write past the guard
    assert GuardedStream(io.TextIOWrapper(io.BytesIO(), "utf-8")).encoding == "utf-8"


def test_no_output_at_all_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    guard_streams()
    tell("a")
    assert sys.stdout is None


@pytest.mark.common
@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_a_title_of_an_image(tmp_path: Path, encoding: str) -> None:
    container = GwyContainer()
    for number in (0, 1):
        container[f"/{number}/data/title"] = EVIL
        container[f"/{number}/data"] = GwyDataField(np.eye(40))
    container.tofile(str(tmp_path / "a.gwy"))
    path = tmp_path / "a.gwy"
    status, shown = on_a_terminal(
        *("calibrate", "images", "--axis", "x", "--v-max", "100", "--pair", "50", path, path), encoding=encoding
    )
    assert status == 2
    assert "has several channels, 0 (" in shown
    assert steering(shown) == []


@pytest.mark.common
def test_a_name_of_a_file(tmp_path: Path) -> None:
    """In a message of ours, in one of click's, and of a file that is there."""
    name = EVIL.replace("/", "") + ".toml"
    status, shown = on_a_terminal("check", tmp_path / name)
    assert (status, steering(shown)) == (2, [])
    assert SHOWN in shown
    status, shown = on_a_terminal("build", "a.toml", f"--{EVIL}")
    assert (status, steering(shown)) == (2, [])
    status, shown = on_a_terminal("init", tmp_path / name)
    assert (status, steering(shown)) == (0, [])
    assert SHOWN in shown


@pytest.mark.common
def test_a_manifest(tmp_path: Path) -> None:
    assert run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-q").status == 0
    path = tmp_path / "out" / "manifest.json"
    manifest = json.loads(path.read_bytes())
    for key, value in (("tablegen", EVIL), ("formats", [EVIL]), ("name", EVIL), ("hash", EVIL)):
        path.write_text(json.dumps({**manifest, key: value}))
        status, shown = on_a_terminal("verify", tmp_path / "out", "--target", "files")
        assert (status in (2, 5, 0), steering(shown)) == (True, []), key


def test_a_key_and_a_value_of_a_scan(tmp_path: Path) -> None:
    quoted = json.dumps(EVIL)
    scan = write_pair(tmp_path, edited(SCAN, f"x.band_limit.method = {quoted}", f"+ [{quoted}]"))
    status, shown = on_a_terminal("check", scan)
    assert status == 2
    assert len(shown.splitlines()) == 2
    assert steering(shown) == []


@pytest.mark.common
def test_what_is_bold_is_so_on_a_terminal_only(tmp_path: Path) -> None:
    """Negative control too: the streams do let through what this package itself writes."""
    scan = write_pair(tmp_path)
    _, shown = on_a_terminal("show", scan, "--no-plot")
    assert shown.startswith("\x1b[1mx: ")
    assert "\x1b[1mannexin_200nm on 'hs-afm'\x1b[0m\n" in shown
    plain = run("show", scan, "--no-plot").out
    assert plain.startswith("x: ")
    assert "\nannexin_200nm on 'hs-afm'\n" in plain
