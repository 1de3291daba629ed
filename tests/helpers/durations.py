"""Measure the CPU time of every test, its children included, for `make durations`.

The name of the file to write is in the environment variable `DURATIONS`.  A fixture that several tests share is counted
for the first of them.
"""

import os
import resource
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import pytest


def cpu_seconds() -> tuple[float, float]:
    """Return the CPU seconds of this process, and of its children that have ended."""
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime, children.ru_utime + children.ru_stime


class Durations:
    """The CPU seconds of each test: setup, call and teardown, in this process and in its children."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.tests: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0, 0.0])
        self.last = cpu_seconds()

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_logstart(self) -> None:
        """Begin with a test: what passed between two tests is no test's."""
        self.last = cpu_seconds()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self) -> Iterator[None]:
        """Put the CPU seconds since the last report into this one, which goes to the process that writes them."""
        report = yield
        now = cpu_seconds()
        report.cpu_seconds = [after - before for after, before in zip(now, self.last, strict=True)]
        self.last = now
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Add the CPU seconds of a report to those of its test."""
        own, children = getattr(report, "cpu_seconds", (0.0, 0.0))
        test = self.tests[report.nodeid]
        test[0] += own
        test[1] += children
        test[2] += own + children if report.when == "setup" else 0.0

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Write the table, in the process that has all reports."""
        if not hasattr(session.config, "workerinput"):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.write_text(written(self.tests))


def written(tests: dict[str, list[float]]) -> str:
    """Return the table: by folder, by file, then each test, the longest first."""
    groups: dict[str, dict[str, list[float]]] = {"folder": {}, "file": {}}
    for name, (own, children, _) in tests.items():
        file = name.split("::")[0]
        for kind, key in (("folder", str(PurePosixPath(file).parent)), ("file", file)):
            group = groups[kind].setdefault(key, [0.0, 0.0, 0])
            for index, value in enumerate((own, children, 1)):
                group[index] += value
    whole = sum(own + children for own, children, _ in tests.values())
    lines = [f"CPU seconds of {len(tests)} tests: {whole:.1f}"]
    for kind, rows in groups.items():
        lines += ["", f"{'all':>9} {'own':>9} {'children':>9} {'tests':>6}  {kind}"]
        for name, (own, children, count) in sorted(rows.items(), key=lambda row: -row[1][0] - row[1][1]):
            lines.append(f"{own + children:9.2f} {own:9.2f} {children:9.2f} {count:6.0f}  {name}")
    lines += ["", f"{'all':>9} {'own':>9} {'children':>9} {'setup':>6}  test"]
    for name, (own, children, setup) in sorted(tests.items(), key=lambda row: -row[1][0] - row[1][1]):
        lines.append(f"{own + children:9.2f} {own:9.2f} {children:9.2f} {setup:6.2f}  {name}")
    return "\n".join(lines) + "\n"


def pytest_configure(config: pytest.Config) -> None:
    """Measure, in every process that runs tests."""
    config.pluginmanager.register(Durations(Path(os.environ.get("DURATIONS", "build/durations.txt")).absolute()))
