"""Measures tablegen beside what others use, into benchmarks/results.md: all sections, or those of ``--only``.

Of what is not run again the page keeps what it has. A section whose tool is missing fails with its name; the status is
then 1. Usage: python benchmarks/results.py [--only SECTION]...
"""

import argparse
import importlib
import os
import re
import sys
from pathlib import Path

from sections.section import HELPERS

sys.path.insert(0, str(HELPERS))

PAGE = Path(__file__).with_name("results.md")
SECTIONS = ("startup", "planning", "waveforms", "tables", "instructions", "cells", "line", "verify")
INTRODUCTION = """# Results

This page compares tablegen with what others use. It is for people who choose, and for developers who change what it
measures. `make bench` writes it; `make bench ONLY=line` measures one section again. Each row is one run. Times are CPU
times, as ratios, so that they can be compared between machines; where we are behind, a note says so.

"""


def changed(page: str, name: str, section: str) -> str:
    """The page with a section put in the place of its former self, or at its place in the order."""
    parts = {one: found[0] for one in SECTIONS if (found := re.search(marked(one), page, re.DOTALL))}
    parts[name] = section
    return INTRODUCTION + "\n".join(parts[one] for one in SECTIONS if one in parts)


def marked(name: str) -> str:
    """The pattern of a section."""
    return rf"<!-- {name} -->\n.*?<!-- /{name} -->\n"


def main() -> int:
    """Measure, and write after each section; the status is 1 if one of them failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", action="append", choices=SECTIONS, help="this section; may be given again")
    parser.add_argument("--print", action="store_true", dest="shown", help="print, and leave the page as it is")
    given = parser.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # of what is measured, too: its threads would only spin
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # an editable installation would be compiled at every start
    status = 0
    for name in given.only or SECTIONS:
        print(f"{name} ...", file=sys.stderr)
        try:
            section = importlib.import_module(f"sections.{name}").measure().markdown(name)
        except Exception as error:  # of any tool: the other sections are measured all the same
            print(f"{name}: {type(error).__name__}: {error}", file=sys.stderr)
            status = 1
            continue
        if given.shown:
            print(section)
        else:
            PAGE.write_text(changed(PAGE.read_text("utf-8") if PAGE.exists() else "", name, section), "utf-8")
    return status


if __name__ == "__main__":
    sys.exit(main())
