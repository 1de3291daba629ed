"""Text from templates: numbers are spelled by filters in Python, and no template computes."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from tablegen.base.resources import resource_folder
from tablegen.numerics.arrays import Ints

_WORDS_PER_ROW = 10
_SETTINGS: dict[str, Any] = {
    "trim_blocks": True,
    "lstrip_blocks": True,
    "keep_trailing_newline": True,
    "autoescape": False,
}


def template(
    name: str, context: Mapping[str, Any], literal: Callable[[int], str], **filters: Callable[..., object]
) -> bytes:
    """Render a template of ``firmware_templates/``; ``literal`` is the filter that spells an integer."""
    text: str = _environment(literal, tuple(filters.items())).get_template(name).render(context)
    return text.encode("ascii")


def template_text(
    text: str, context: Mapping[str, Any], literal: Callable[[int], str], **filters: Callable[..., object]
) -> bytes:
    """Render a template that is given as text; ``literal`` is the filter that spells an integer."""
    rendered: str = _environment(literal, tuple(filters.items())).from_string(text).render(context)
    return rendered.encode("ascii")


@cache
def _environment(literal: Callable[[int], str], filters: tuple[tuple[str, Callable[..., object]], ...]) -> Any:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined  # not needed to check what was rendered

    from tablegen.emit.template_cache import TemplateCache

    environment = Environment(
        loader=FileSystemLoader(resource_folder("firmware_templates")),
        undefined=StrictUndefined,
        bytecode_cache=TemplateCache(_SETTINGS),
        **_SETTINGS,
    )
    environment.filters |= {"literal": literal, **dict(filters)}
    return environment


def comment_safe(text: str) -> str:
    """Return text on one line of ASCII that can neither begin nor end a comment, nor continue a line."""
    plain = text.encode("unicode_escape").decode("ascii").replace("\\", "/")
    return plain.replace("*/", "* /").replace("/*", "/ *").replace("?", ".").rstrip()  # ??/ is a backslash in C99


def rows(words: Ints | list[str]) -> list[str]:
    """Format words as lines of text, ten a line, with commas between.

    Parameters
    ----------
    words
        Integers, shape (n,), or their texts.

    Returns
    -------
    list of str
        The lines, without a comma at their ends.
    """
    values = words if isinstance(words, list) else [str(word) for word in words.tolist()]
    return [", ".join(values[i : i + _WORDS_PER_ROW]) for i in range(0, len(values), _WORDS_PER_ROW)]
