"""Files of instruments that nobody here has made, outside the tree: a folder that the environment names, or none."""

import os
from pathlib import Path

from building import REPOSITORY

VARIABLE = "TABLEGEN_REAL"
_BESIDE = REPOSITORY.parent / "shared" / "real"


def real_folder() -> Path | None:
    """Return the folder that ``TABLEGEN_REAL`` names, else the one beside the tree; None where there is none."""
    named = os.environ.get(VARIABLE)
    folder = Path(named) if named else _BESIDE
    return folder if folder.is_dir() else None
