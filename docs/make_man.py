"""Write the manual pages of all commands. Usage: python docs/make_man.py [FOLDER], by default build/man

MANPATH=build/man: man tablegen build
"""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from command_pages import CommandPage, pages

from tablegen.version import __version__

FOLDER = Path(__file__).parents[1] / "build" / "man"


def manual(page: CommandPage) -> str:
    """A page in the language of man(7)."""
    title = page.file.upper()
    lines = [f'.TH "{title}" "1" "" "tablegen {__version__}" "tablegen"', ".SH NAME"]
    lines += [f"{_text(page.file)} \\- {_text(page.short or 'straight scans of piezo scanners')}", ".SH SYNOPSIS"]
    lines += [f".B {_text(page.name)}", _text(page.usage.removeprefix(page.name).strip()), ".SH DESCRIPTION"]
    for part in page.parts:
        lines += [".PP", ".nf", _text(part.text), ".fi"] if part.as_it_is else [".PP", _text(part.text)]
    for title, rows in (("COMMANDS", page.commands), ("OPTIONS", page.options)):
        if rows:
            lines.append(f".SH {title}")
        for row in rows:
            lines += [
                ".TP",
                f"\\fB{_text(row.name)}\\fR",
                _text(f"{row.text} [{row.extra}]" if row.extra else row.text),
            ]
    above = page.name.rpartition(" ")[0].replace(" ", "-")
    others = [above] if above else []
    others += [f"{page.file}-{row.name}" for row in page.commands]
    if others:
        lines += [".SH SEE ALSO", ",\n".join(f"\\fB{_text(name)}\\fR(1)" for name in others)]
    return "\n".join(lines) + "\n"


def _text(text: str) -> str:
    """As roff reads it: a hyphen is a minus where it is typed, and no line begins with a command."""
    escaped = text.replace("\\", "\\e").replace("-", "\\-")
    escaped = escaped.replace("'", "\\(aq").replace("`", "\\(ga").replace("^", "\\(ha").replace("~", "\\(ti")
    return re.sub(r"^(?=\.)", r"\\&", escaped, flags=re.MULTILINE)


def main(folder: Path) -> None:
    """Write all pages."""
    target = folder / "man1"
    target.mkdir(parents=True, exist_ok=True)
    for page in pages():
        (target / f"{page.file}.1").write_text(manual(page), "utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
