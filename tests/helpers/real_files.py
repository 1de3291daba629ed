"""The folder of real files of others, for tests beside the project."""

import os
from pathlib import Path

VARIABLE = "TABLEGEN_REAL"
ABSENT = f"no real files here: set {VARIABLE} to a folder of them; tests over real files have run over nothing"
_BESIDE = Path(__file__).parents[3] / "shared" / "real"


def real_folder() -> Path | None:
    """Return the folder that the environment names, else that beside the project; None where neither is there."""
    named = os.environ.get(VARIABLE)
    for folder in (Path(named),) if named else (_BESIDE, _BESIDE.parents[2] / "shared" / "real"):
        if folder.is_dir():
            return folder
    return None
