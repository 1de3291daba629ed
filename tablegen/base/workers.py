"""Run one function on many arguments in worker processes, and yield results as they come.

A worker is a new interpreter that takes pickled tasks from its stdin: no fork of a program with threads, and no module
of the caller that is imported again. It runs in a session of its own, so that Ctrl-C reaches this program alone, which
then ends its workers in order.
"""

import contextlib
import json
import os
import pickle
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from typing import IO, Any, TypeVar

from tablegen.base.interruption import endings_interrupt

Result = TypeVar("Result")
SHARE = 0.9  # of the cores
_START = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from tablegen.base.workers import serve; serve()"


class WorkerDied(Exception):
    """A process ended in the middle of its task: it was killed, or memory was exhausted."""


def default_jobs() -> int:
    """Return nine tenths of the cores that this process may use, at least one."""
    try:
        cores = len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        cores = os.cpu_count() or 1
    return max(1, int(SHARE * cores))


def results(
    function: Callable[..., Result], tasks: Iterable[tuple[Any, ...]], jobs: int
) -> Iterator[tuple[int, "Result | Exception"]]:
    """Yield the number of each task and its result or exception, in the order in which they end.

    ``function`` is one of a module; arguments and results are pickled. Tasks are assigned as workers become free.
    With one job everything runs here. If the caller stops, the workers are ended and waited for.
    """
    if jobs <= 1:
        for number, task in enumerate(tasks):
            yield number, _attempt(function, task)
        return
    pool = _Pool(function, jobs)
    try:
        running = 0
        for task in enumerate(tasks):
            pool.give(*task)
            running += 1
            if running > jobs:  # one waits, so that no worker does
                yield pool.take()
                running -= 1
        for _ in range(running):
            yield pool.take()
    finally:
        pool.end()


def _attempt(function: Callable[..., Result], task: tuple[Any, ...]) -> "Result | Exception":
    try:
        return function(*task)
    except Exception as error:
        return error


class _Pool:
    """Workers, a thread for each that exchanges messages with it, and the queues of tasks and results."""

    def __init__(self, function: Callable[..., Any], jobs: int) -> None:
        self._function, self._jobs = function, jobs
        self._tasks: queue.SimpleQueue[tuple[int, tuple[Any, ...]] | None] = queue.SimpleQueue()
        self._results: queue.SimpleQueue[tuple[int, Any]] = queue.SimpleQueue()
        self._threads: list[threading.Thread] = []
        self._lock = threading.Lock()  # of what follows
        self._running: set[subprocess.Popen[bytes]] = set()
        self._ended = False

    def give(self, number: int, task: tuple[Any, ...]) -> None:
        """Queue a task, and start another worker if there may be one."""
        self._tasks.put((number, task))
        if len(self._threads) < self._jobs:
            self._threads.append(threading.Thread(target=self._work, daemon=True))
            self._threads[-1].start()

    def take(self) -> tuple[int, Any]:
        """Return the next result, and wait for it."""
        return self._results.get()

    def end(self) -> None:
        """End all workers, and wait for them: one that writes ends when its files are in place."""
        with self._lock:
            self._ended = True
            for worker in self._running:
                worker.terminate()
        for _ in self._threads:
            self._tasks.put(None)
        for thread in self._threads:
            thread.join()

    def _work(self) -> None:
        """Serve a worker until the pool ends; start another one where it dies."""
        worker: subprocess.Popen[bytes] | None = None
        while (item := self._tasks.get()) is not None and not self._ended:
            number, task = item
            try:
                message = pickle.dumps((self._function, task))
                worker = worker or self._started()
                result = _exchanged(worker, message)
            except (EOFError, OSError) as error:
                status = self._close(worker) if worker is not None else None
                worker = None
                why = f"the process of this task ended with status {status}" if status is not None else str(error)
                result = WorkerDied(why)
            except Exception as error:  # what cannot be pickled
                result = error
            self._results.put((number, result))
        if worker is not None:
            self._close(worker)

    def _started(self) -> "subprocess.Popen[bytes]":
        environment = {"OPENBLAS_NUM_THREADS": "1", **os.environ}
        command = [sys.executable, "-c", _START, json.dumps(sys.path)]
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        with self._lock:
            if self._ended:
                raise EOFError
            worker = subprocess.Popen(command, **pipes, env=environment, start_new_session=True)
            self._running.add(worker)
        return worker

    def _close(self, worker: "subprocess.Popen[bytes]") -> int:
        """Close the pipes of a worker, which ends it, and wait; return its status."""
        assert worker.stdin is not None
        assert worker.stdout is not None
        for pipe in (worker.stdin, worker.stdout):
            with contextlib.suppress(OSError):
                pipe.close()
        status = worker.wait()
        with self._lock:
            self._running.discard(worker)
        return status


def _exchanged(worker: "subprocess.Popen[bytes]", message: bytes) -> Any:
    assert worker.stdin is not None
    assert worker.stdout is not None
    worker.stdin.write(message)
    worker.stdin.flush()
    return pickle.load(worker.stdout)


def serve() -> None:
    """Run a worker: tasks from stdin, results to stdout, until the input ends or a signal comes."""
    source: IO[bytes] = sys.stdin.buffer
    sink = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # the output of a third-party format is no result
    try:
        with endings_interrupt():
            while True:
                function, task = pickle.load(source)
                result = _attempt(function, task)
                try:
                    answer = pickle.dumps(result)
                except Exception as error:  # a third-party exception that cannot be pickled
                    answer = pickle.dumps(RuntimeError(f"{type(result).__name__}: {result} ({error})"))
                sink.write(answer)
                sink.flush()
    except (EOFError, KeyboardInterrupt, BrokenPipeError):
        os._exit(0)
