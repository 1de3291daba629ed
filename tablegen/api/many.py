"""Build many scans in worker processes: results as they complete, with errors as values."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tablegen.api.build import Build, build, load
from tablegen.base.workers import default_jobs, results
from tablegen.config.load import Setup
from tablegen.config.variants import Variant
from tablegen.config.variants import variants as library_and_variants

Scans = Iterable["str | Path | Setup | Variant"]


@dataclass(frozen=True, repr=False)
class BuildOutcome:
    """Outcome of one scan of many: a build, or the error that prevented it."""

    number: int
    """Its place in the sources, from 0."""
    source: "str | Path | Setup | Variant"
    build: Build | None
    error: Exception | None
    """``Rejected``, ``BrokenLimit``, ``CannotWrite``, or whatever else was raised."""

    @property
    def name(self) -> str:
        """The name of the scan, or its path where it could not be read."""
        if self.build is not None:
            return self.build.name
        if isinstance(self.source, Setup):
            return self.source.scan.name
        return self.source.name if isinstance(self.source, Variant) else str(self.source)

    def __repr__(self) -> str:
        state = repr(self.build).partition("\n")[0] + ">" if self.build is not None else f"{self.error}"
        return f"<tablegen outcome {self.number}: {state}>"


def variants(path: str | Path, settings: Mapping[str, Iterable[Any]] | None = None) -> list[Variant]:
    """Every scan of a file: of its ``[[scans]]``, or the file itself, with each combination of the settings.

    Parameters
    ----------
    path : str or Path
        Scan file.
    settings : mapping of sequences, optional
        Values by keys of the scan file: ``{"x.size_nm": range(50, 1001, 50)}``.

    Returns
    -------
    list of Variant
        Each with a ``name``, the ``settings`` that differ, and a ``setup``, which raises ``Rejected`` for a wrong scan.

    Raises
    ------
    Rejected
        The file cannot be read, or two scans have the same name.

    Examples
    --------
    >>> [one.settings for one in tablegen.variants("scan.toml", {"x.size_nm": [100, 150]})]
    [{'x.size_nm': 100}, {'x.size_nm': 150}]
    """
    return library_and_variants(path, settings or {})[1]


def build_many(
    sources: Scans,
    out: str | Path | None = None,
    *,
    formats: Sequence[str] | None = None,
    jobs: int | None = None,
) -> Iterator[BuildOutcome]:
    """Build many scans in parallel processes, and yield each as it completes, its error in place of a build.

    Parameters
    ----------
    sources : iterable of path, Setup or Variant
        Read as workers become free, and not stored, so that memory does not grow with their number.
    out : str or Path, optional
        Directory; each is written into ``out/NAME``, as by ``build``.
    formats : sequence of str, optional
        Output formats; those of the scan files unless given.
    jobs : int, optional
        Number of processes: nine tenths of the cores unless given; with 1 all builds run in this process.

    Yields
    ------
    BuildOutcome
        Number and name of a scan, its ``build`` or its ``error``.

    Raises
    ------
    Exception
        Whatever ``sources`` raises; what goes wrong with one scan is the ``error`` of its outcome.

    Examples
    --------
    >>> scans = tablegen.variants("scan.toml", {"x.size_nm": [100, 150]})
    >>> sorted(one.name for one in tablegen.build_many(scans, jobs=1))
    ['annexin_200nm_size_nm_100', 'annexin_200nm_size_nm_150']
    """
    pending: dict[int, str | Path | Setup | Variant] = {}

    def tasks() -> Iterator[tuple[Setup | Exception, str | None, Sequence[str] | None]]:
        for number, source in enumerate(sources):
            pending[number] = source
            yield _setup(source), None if out is None else str(out), formats

    for number, outcome in results(_built, tasks(), default_jobs() if jobs is None else jobs):
        source = pending.pop(number)
        if isinstance(outcome, Exception):
            yield BuildOutcome(number, source, None, outcome)
        else:
            yield BuildOutcome(number, source, outcome, None)


def _setup(source: "str | Path | Setup | Variant") -> Setup | Exception:
    try:
        if isinstance(source, Variant):
            return source.setup
        return source if isinstance(source, Setup) else load(source)
    except Exception as error:
        return error


def _built(setup: Setup | Exception, out: str | None, formats: Sequence[str] | None) -> Build:
    """Build in a worker; raise the error of the setup again."""
    if isinstance(setup, Exception):
        raise setup
    built = build(setup, None if out is None else Path(out) / setup.scan.name, formats=formats)
    built.__dict__.pop("files", None)  # ten times the size of the rest; the build makes them again on demand
    return built
