"""Keep plays of Verilog by content for a session, so that tests of the same design simulate it once."""

import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any
from unittest.mock import patch

import kept_objects

from tablegen.verification import process_group
from tablegen.verification.play.session import BuildSession, make_session

Job = tuple[Path, Mapping[str, Any]]


@contextmanager
def kept_plays() -> Iterator[None]:
    """Let ``tablegen verify`` in this process take a play that another test has made of the same files.

    What a play is made of are its job, all files in its folder and all that its job names; where these differ in a
    byte, it is simulated. A play that fails is not kept, nor is one with a frame beside it.
    """
    with patch("tablegen.verification.verilog.target.worker", _KeptWorker()):
        yield


@contextmanager
def own_program_alone() -> Iterator[None]:
    """Let ``tablegen verify`` in this process play the build's own program, without requests on short ones before.

    That takes a fifth of the time, and is enough to find what is wrong in the files of a build.
    """

    def alone(*arguments: Any, **options: Any) -> BuildSession:
        return make_session(*arguments, **{"requests": False, **options})

    with patch("tablegen.verification.verilog.target.make_session", alone):
        yield


class _KeptWorker:
    """What the Verilog target asks of ``process_group``."""

    @staticmethod
    def run_all(module: str, jobs: Sequence[Job]) -> list[dict[str, Any]]:
        """Return what the jobs return, and put into their folders what they write there."""
        if len(jobs) > 1:
            return process_group.run_all(module, jobs)
        ((folder, job),) = jobs
        place = kept_objects.folder() / f"play_{_key(module, folder, job)}"
        if not place.is_dir():
            (status,) = process_group.run_all(module, jobs)
            _keep(place, folder, status)
        else:
            shutil.copytree(place / "files", folder, dirs_exist_ok=True)
            status = json.loads((place / "status.json").read_text("ascii"))
        return [status]


def _key(module: str, folder: Path, job: Mapping[str, Any]) -> str:
    """Return a hash of all that a play is made of, wherever its folder is."""
    named = {Path(source) for source in job["sources"]}
    digest = sha256(json.dumps([module, job], sort_keys=True).replace(str(folder), "").encode())
    for path in sorted(named | {path for path in folder.rglob("*") if path.is_file()}):
        digest.update(repr((str(path).replace(str(folder), ""), path.read_bytes())).encode())
    return digest.hexdigest()


def _keep(place: Path, folder: Path, status: Mapping[str, Any]) -> None:
    unfinished = place.with_suffix(f".{os.getpid()}")
    shutil.copytree(folder, unfinished / "files", ignore=shutil.ignore_patterns("tmp"))
    (unfinished / "status.json").write_text(json.dumps(status), "ascii")
    try:
        unfinished.rename(place)
    except OSError:  # another process has kept it meanwhile
        shutil.rmtree(unfinished)
