# SPDX-License-Identifier: Apache-2.0
"""Chunks of work on the workers of a Dask client, and what may happen to them."""

from __future__ import annotations

import asyncio
import math
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, TypeVar

from .. import _core
from .._core import Error

try:
    import distributed
    from distributed import Client, as_completed
    from distributed.comm.core import CommClosedError
    from distributed.scheduler import KilledWorker
except ImportError as missing:  # pragma: no cover
    raise ImportError(
        'blindcorner.cluster needs Dask: pip install "blindcorner[cluster]"'
    ) from missing

Item = TypeVar("Item")

#: Chunks that wait for each worker thread. More would only fill the scheduler's memory.
AHEAD = 3
#: How long a scheduler that is gone may take to come back, s.
PATIENCE = 600.0
#: Time between attempts to reach it, s.
RETRY = 1.0



class SchedulerLost(Exception):
    """The scheduler went away, and with it what it knew of tasks."""


#: Exceptions that calls of a scheduler that is gone raise.
UNREACHABLE = (CommClosedError, OSError, TimeoutError, asyncio.CancelledError)


class Progress:
    """Done, rate and time left, on the standard error stream: one line that changes on a terminal,
    else a line now and then."""

    def __init__(self, label: str, total: int, shown: bool) -> None:
        self.label, self.total, self.shown = label, total, shown
        self.done = 0
        self.start = time.monotonic()
        self.drawn = -math.inf
        self.terminal = sys.stderr.isatty()

    def line(self) -> str:
        seconds = time.monotonic() - self.start
        text = f"{self.done}/{self.total} {self.label}"
        if self.done and seconds > 0:
            rate = self.done / seconds
            left = round((self.total - self.done) / rate)
            text += f"  {rate:.3g}/s  {left // 3600}:{left // 60 % 60:02}:{left % 60:02} left"
        return text

    def advance(self, steps: int) -> None:
        self.done += steps
        now = time.monotonic()
        interval = 0.1 if self.terminal else 10.0
        if not self.shown or (now - self.drawn < interval and self.done < self.total):
            return
        self.drawn = now
        print(f"\r\x1b[K{self.line()}" if self.terminal else self.line(), file=sys.stderr,
              end="" if self.terminal and self.done < self.total else "\n", flush=True)


def tell(text: str, shown: bool) -> None:
    if shown:
        print(f"blindcorner: {text}", file=sys.stderr, flush=True)


def threads_of(client: Client) -> int:
    """Worker threads that the scheduler knows, at least 1."""
    return max(1, sum(client.nthreads().values()))


def chunk_size(items: int, threads: int, most: int) -> int:
    """Items of a task: some ten tasks for each thread, so that the last ones end together."""
    return max(1, min(most, items // (10 * threads)))


def chunks(items: Sequence[Item], size: int) -> Iterator[list[Item]]:
    for first in range(0, len(items), size):
        yield list(items[first:first + size])


def limit_threads(pid: int) -> None:
    """In a worker, gives the library as many threads as the worker has for tasks. Does nothing in
    the process ``pid`` that asks, because that process sets its own number of threads."""
    if os.getpid() == pid:
        return
    try:
        threads = distributed.get_worker().state.nthreads
    except (ValueError, AttributeError):
        threads = 1
    _core.set_threads(min(int(threads), 1024))


class Connection:
    """A client and, after the scheduler was started again, a new client to the same address."""

    def __init__(self, client: Client, shown: bool) -> None:
        self.client = client
        self.own = False
        self.shown = shown
        self.address = client.scheduler.address if client.scheduler is not None else None
        link = client.dashboard_link
        tell(f"scheduler {self.address}, {threads_of(client)} worker threads, dashboard {link}", shown)

    def again(self) -> None:
        """Waits for the scheduler. Raises Error when it does not come back."""
        tell(f"the scheduler {self.address} is gone; waiting for it", self.shown)
        end = time.monotonic() + PATIENCE
        self.close()
        while time.monotonic() < end:
            try:
                client = Client(self.address, timeout=5, set_as_default=False)
                client.wait_for_workers(1, timeout=max(5.0, end - time.monotonic()))
            except UNREACHABLE:
                time.sleep(RETRY)
                continue
            self.client, self.own = client, True
            tell(f"the scheduler {self.address} is back", self.shown)
            return
        raise Error(
            f"scheduler {self.address}: did not come back within {PATIENCE:.0f} s; the same call goes "
            "on from the journal"
        )

    def close(self) -> None:
        """Closes the client if this object made it."""
        if self.own:
            self.client.close(timeout=2)
            self.own = False


def run_chunks(
    client: Client,
    remaining: Callable[[], Sequence[Any]],
    size: int,
    task: Callable[..., Any],
    arguments: tuple[Any, ...],
    keep: Callable[[Any], int],
    label: str,
    progress: bool,
) -> None:
    """Runs ``task(*arguments, chunk)`` for chunks of ``remaining()`` until nothing remains.

    ``keep`` puts what a task returned on disk, and returns the number of its items. Tasks of a
    worker that dies begin again on another one (Dask does that). If the scheduler itself was
    started again, what still remains is handed out again. Raises what a task or ``keep`` raised.
    """
    items = remaining()
    connection = Connection(client, progress)
    bar = Progress(label, len(items), progress)
    try:
        while items:
            size_now = size or chunk_size(len(items), threads_of(connection.client), 64)
            try:
                _run_once(connection.client, list(chunks(items, size_now)), task, arguments, keep, bar)
            except SchedulerLost:
                connection.again()
            items = remaining()
    finally:
        connection.close()


def _run_once(client: Client, waiting: list[list[Any]], task: Callable[..., Any],
              arguments: tuple[Any, ...], keep: Callable[[Any], int], bar: Progress) -> None:
    most = AHEAD * threads_of(client)
    todo = iter(waiting)

    pending: set[Any] = set()

    def submit(number: int) -> list[Any]:
        try:
            more = [
                client.submit(task, *arguments, chunk, pure=False)
                for _, chunk in zip(range(number), todo)
            ]
        except UNREACHABLE as error:
            raise SchedulerLost from error
        pending.update(more)
        return more

    try:
        finished = as_completed(submit(most))
        for future in finished:
            value = _value(future)
            pending.discard(future)
            future.release()
            finished.update(submit(1))
            bar.advance(keep(value))
    except BaseException:
        _cancel(client, pending)
        raise


def _value(future: Any) -> Any:
    """What a task returned. Raises its Error, or SchedulerLost if nobody knows the task any
    more."""
    if future.status == "error":
        error = future.exception()
        if isinstance(error, KilledWorker):
            raise Error(
                "workers died again and again on the same chunk: their logs say why (memory?); the "
                "same call goes on from the journal"
            ) from None
        if isinstance(error, Error):
            raise error
        raise Error(f"a worker failed: {error!r}") from error
    if future.status != "finished":
        raise SchedulerLost
    try:
        return future.result()
    except UNREACHABLE as error:
        raise SchedulerLost from error


def _cancel(client: Client, futures: Iterable[Any]) -> None:
    try:
        client.cancel(list(futures), force=True)
    except Exception:  # the scheduler may be the one that is gone
        pass
