"""The cache of compiled templates: what is taken from it, what is not, and that no build depends on it."""

import marshal
import os
from collections.abc import Iterator
from pathlib import Path

import jinja2
import pytest
from editing import EXAMPLES

import tablegen
from tablegen.base import user_cache
from tablegen.base.resources import resource_folder
from tablegen.base.user_cache import private_folder
from tablegen.emit import template_cache, templates
from tablegen.emit.template_cache import TEMPLATES, TemplateCache

EXAMPLE = EXAMPLES / "annexin_200nm.toml"
SHOUT = compile("def root(context, *_):\n    yield 'not ours'\nblocks = {}\ndebug_info = ''\nname = 'c'", "x", "exec")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The cache of this test; no template that it compiled or took stays for the tests after it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    yield tmp_path / "cache" / "tablegen" / "templates"
    templates._environment.cache_clear()


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The templates that Jinja compiles from now on, by name."""
    names: list[str] = []
    before = jinja2.Environment.compile

    def compile_(self: jinja2.Environment, source: str, name: str, *more: str) -> object:
        names.append(name)
        return before(self, source, name, *more)

    monkeypatch.setattr(jinja2.Environment, "compile", compile_)
    return names


def built() -> dict[str, bytes]:
    """The files of the example, by templates that this process has not compiled before."""
    templates._environment.cache_clear()
    return dict(tablegen.build(EXAMPLE).files)


def test_a_second_build_compiles_nothing(cache: Path, compiled: list[str]) -> None:
    first = built()
    assert len(compiled) == len(list(cache.iterdir())) >= 3
    compiled.clear()
    assert built() == first
    assert compiled == []
    assert cache.stat().st_mode & 0o077 == 0
    assert all(path.stat().st_mode & 0o077 == 0 for path in cache.iterdir())


@pytest.mark.common
@pytest.mark.parametrize("how", ["empty", "cut", "a bit", "code of another template", "code of ours, no digest"])
def test_what_was_not_written_so_is_compiled_again(cache: Path, compiled: list[str], how: str) -> None:
    first = built()
    paths = sorted(cache.iterdir())
    before = [path.read_bytes() for path in paths]
    for path, content, other in zip(paths, before, [*before[1:], before[0]], strict=True):
        wrong = {
            "empty": b"",
            "cut": content[: len(content) // 2],
            "a bit": content[:-3] + bytes([content[-3] ^ 1]) + content[-2:],
            "code of another template": other,
            "code of ours, no digest": content[:32] + marshal.dumps(SHOUT),
        }[how]
        path.write_bytes(wrong)
    count = len(compiled)
    compiled.clear()
    assert built() == first
    assert len(compiled) == count
    assert [path.read_bytes() for path in paths] == before  # they are mended


def _others_folder(cache: Path) -> None:
    cache.chmod(0o777)


def _others_files(cache: Path) -> None:
    for path in cache.iterdir():
        path.chmod(0o666)


def _a_link(cache: Path) -> None:
    cache.symlink_to(cache.rename(cache.with_name("elsewhere")))


def _of_nobody(cache: Path) -> None:
    os.chown(cache, 65534, 65534)


@pytest.mark.common
@pytest.mark.parametrize(
    "given",
    [
        _others_folder,
        _others_files,
        _a_link,
        pytest.param(_of_nobody, marks=pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")),
    ],
)
def test_what_others_can_write_is_not_run(
    cache: Path, compiled: list[str], monkeypatch: pytest.MonkeyPatch, given
) -> None:
    """Even with a right digest: it has no secret in it."""
    first = built()
    loaded = []
    monkeypatch.setattr(template_cache.Bucket, "bytecode_from_string", lambda *_: loaded.append(1))
    assert private_folder(TEMPLATES.folder) == cache
    given(cache)
    count = len(compiled)
    compiled.clear()
    assert built() == first
    assert len(compiled) == count
    assert loaded == []


def test_it_would_be_run_where_nobody_else_can_write(cache: Path, compiled: list[str]) -> None:
    """Negative control: what the digest stands for is what is run."""
    first = built()
    cached = TemplateCache(templates._SETTINGS)
    source = (resource_folder("firmware_templates") / "c" / "tables.c.j2").read_text()
    name = "c/tables.c.j2"
    bucket = template_cache.Bucket(
        jinja2.Environment(),
        cached.get_cache_key(name, str(resource_folder("firmware_templates") / name)),
        cached.get_source_checksum(source),
    )
    bucket.code = SHOUT
    for path in cache.iterdir():
        path.unlink()
    cached.dump_bytecode(bucket)
    second = built()
    assert {key for key in first if first[key] != second[key]} >= {"annexin_200nm.c"}


@pytest.mark.common
@pytest.mark.parametrize("what", ["_", "sys.version", "jinja2.__version__"])
def test_another_version_compiles_again(
    cache: Path, compiled: list[str], monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    first = built()
    count = len(compiled)
    compiled.clear()
    if what == "_":
        monkeypatch.setattr(template_cache, "MAGIC_NUMBER", b"\0\0\0\0")
    elif what == "sys.version":
        monkeypatch.setattr(template_cache.sys, "version", "3.99")
    else:
        monkeypatch.setattr(jinja2, "__version__", "3.0.99")
    assert built() == first
    assert len(compiled) == count


def test_a_cache_that_cannot_be_made_costs_nothing(cache: Path, compiled: list[str]) -> None:
    cache.parent.parent.mkdir()
    cache.parent.write_text("a file in its place")
    first = built()
    assert first
    assert built() == first


def test_it_does_not_grow_without_end(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(TEMPLATES, "most", 4)
    cache.mkdir(parents=True, mode=0o700)
    for age in range(10):
        path = cache / f"{age:040d}"
        path.write_bytes(b"old")
        os.utime(path, (1000 + age, 1000 + age))
    built()
    left = sorted(path.name for path in cache.iterdir())
    assert len(left) == 4
    assert f"{0:040d}" not in left


def test_a_full_disk_leaves_no_half_of_a_file(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(user_cache.os, "replace", full)
    first = tablegen.build(EXAMPLE)
    templates._environment.cache_clear()
    assert "annexin_200nm.c" in first.files
    assert list(cache.iterdir()) == []


def test_no_filter_is_worked_out_when_a_template_is_compiled() -> None:
    """What is compiled would else depend on filters, which are not in its digest."""
    called: list[str] = []
    folder = resource_folder("firmware_templates")
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(folder), **templates._SETTINGS)
    for name in [*environment.filters, "literal", "range", "type", "wide", "is_wide"]:
        environment.filters[name] = lambda *_, name=name: called.append(name)
    names = [path.relative_to(folder).as_posix() for path in folder.rglob("*.j2")]
    assert len(names) >= 5
    for name in names:
        environment.get_template(name)
    assert called == []
    environment.from_string("{{ 5 | literal }}")
    assert called  # the control
