"""``python -m tablegen``."""

from tablegen.cli import main

main()
