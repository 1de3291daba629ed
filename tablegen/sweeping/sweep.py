"""Many scans of one scan file, built as a library of programs with one index."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from tablegen.base.workers import default_jobs
from tablegen.config.settings import Setting
from tablegen.config.variants import variants
from tablegen.sweeping.run import ScanLibrary, run


def sweep(
    scan: str | Path,
    settings: "Mapping[str, Iterable[Any]] | Sequence[Setting]" = (),
    out: str | Path = "library",
    *,
    formats: Sequence[str] | None = None,
    jobs: int | None = None,
    strict: bool = False,
    only_check: bool = False,
    progress: Callable[[int, int], object] = lambda _count, _total: None,
) -> ScanLibrary:
    """Build many scans of one file as a library: a folder each, one runtime, and one index in JSON, C and Verilog.

    Parameters
    ----------
    scan : str or Path
        Scan file; its ``[[scans]]`` are built, or the file itself.
    settings : mapping of sequences
        Values by keys of the scan file, ``{"x.size_nm": [50, 100]}``; every combination is built.
    out : str or Path
        Directory of the library; what is up to date there is not built again.
    formats : sequence of str, optional
        Output formats; those of the scan file unless given.
    jobs : int, optional
        Number of processes; nine tenths of the cores unless given.
    strict : bool
        True if a scan with a warning counts as failed.
    only_check : bool
        True to write nothing, and to list what differs in ``different``.
    progress : callable
        Called with the number of scans that are done, and with that of all.

    Returns
    -------
    ScanLibrary
        ``built``, ``current``, ``failed`` with the reasons, and ``removed``.

    Raises
    ------
    Rejected
        The scan file cannot be read, or a setting is wrong. Errors of single scans are in ``failed``.
    CannotWrite
        The directory cannot be written.

    Examples
    --------
    >>> library = tablegen.sweep("scan.toml", {"x.size_nm": [190, 200]}, "library", jobs=1)
    >>> len(library.built), library.failed
    (2, [])
    """
    library = planned_library(scan, settings, out)
    build_library(library, formats=formats, jobs=jobs, strict=strict, only_check=only_check, progress=progress)
    return library


def planned_library(
    scan: str | Path, settings: "Mapping[str, Iterable[Any]] | Sequence[Setting]", out: str | Path
) -> ScanLibrary:
    """Return the scans of a library before any is built.

    Raises
    ------
    Rejected
        If the scan file or a setting is wrong.
    """
    name, scans = variants(scan, settings)
    return ScanLibrary(name, scans, Path(out))


def build_library(library: ScanLibrary, *, jobs: int | None, **options: Any) -> None:
    """Build programs that are missing or outdated; ``options`` are those of ``sweep``.

    Raises
    ------
    CannotWrite
        If the directory cannot be written.
    """
    run(library, jobs=jobs or default_jobs(), **options)
