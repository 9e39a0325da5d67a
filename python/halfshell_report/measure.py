# SPDX-License-Identifier: BSD-3-Clause
"""What is measured: our own calls, and other libraries, each in a process of its own.

A library may raise, hang, abort or eat the memory; none of that may reach the report. `PeerProcess`
starts a process that runs `serve`, and starts it again after it died. Requests and replies are
pickled dicts, each after its length in eight bytes. Replies go to what was standard output;
whatever a library prints goes to standard error.
"""

from __future__ import annotations

import contextlib
import gc
import os
import pickle
import platform
import queue
import random
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextvars import copy_context
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from statistics import median
from types import TracebackType
from typing import IO, Any, Self

import numpy as np

import halfshell as hs
from halfshell import _core
from halfshell._errors import how_to_install
from halfshell._machine import cpu_name, usable_cpus
from halfshell_report.accuracy import Answer
from halfshell_report.peers import LIBRARIES, Question, pin_threads, wrapped

__all__ = [
    "METHODS", "PRECISIONS", "REUSE", "Patience", "PeerProcess", "Timing", "answer_of",
    "calls_of", "machine_facts", "options_of", "serve", "take_turns", "under",
]  # fmt: skip


def machine_facts() -> dict[str, str]:
    """Return columns for every row: when and where it was measured, and with what."""
    import scipy

    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": f"{platform.system()} {platform.machine()}",
        "cpu": cpu_name(),
        "cores": str(usable_cpus()),
        "threads": "1",
        "kernel": str(_core.default_kernel()),
        "halfshell": hs.__version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
    }


_TURN = 2e-3  # seconds that a turn lasts at least, so that short calls are made often
_MOST = 100  # calls in a turn


@dataclass(frozen=True)
class Patience:
    """How often a call is timed at most, and how long that may take, in seconds."""

    repeats: int = 7
    seconds: float = 2.0


@dataclass(frozen=True)
class Timing:
    """Seconds of one call: median and least over all calls, each timed by itself."""

    median: float
    least: float
    repeats: int


def take_turns(calls: Mapping[str, Callable[[], Any]], patience: Patience) -> dict[str, Timing]:
    """Time calls against each other; results are dropped.

    Every call gets at least one turn, and no further one once `patience.seconds` for each call
    are over.
    """
    order = random.Random(0)
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    begin = time.perf_counter()
    for turn in range(patience.repeats):
        names = list(calls)
        order.shuffle(names)
        for name in names:
            if turn and time.perf_counter() - begin > patience.seconds * len(calls):
                continue
            seconds[name] += _one_turn(calls[name])
    return {name: Timing(median(some), min(some), len(some)) for name, some in seconds.items()}


def _one_turn(call: Callable[[], Any]) -> list[float]:
    """Seconds of each of some calls, without the garbage collector."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        spent: list[float] = []
        while sum(spent) < _TURN and len(spent) < _MOST:
            start = time.perf_counter()
            call()
            spent.append(time.perf_counter() - start)
        return spent
    finally:
        if was_on:
            gc.enable()


#: Of `halfshell.settings`.
PRECISIONS = ("exact", "double", "single")
#: Ways to keep one list for several steps: rebuilt in time, or by the clock.
REUSE = ("verlet", "stale")
#: Every method that can be asked for by name.
METHODS = (*PRECISIONS, "float32", *REUSE)

# Rounding a scene's coordinates may collapse it: then all points are pairs of each other, and
# a list that passes this is no longer an answer to the question.
_MOST_BYTES = 4e9


def options_of(method: str, scene: Any) -> dict[str, Any]:
    """Return the arguments of `halfshell.pairs` for a method and a scene.

    Raises ValueError if the method would change nothing, or the points do not fit float32.
    """
    points = scene.points
    if method == "float32":
        if points.dtype == np.float32:
            raise ValueError("the points are float32 as they are")
        with np.errstate(over="ignore", under="ignore"):
            points = points.astype(np.float32)
        if not np.isfinite(points).all():
            raise ValueError("coordinates beyond the range of float32")
    return {**scene.arguments_of(points), "threads": 1}


def answer_of(method: str, options: dict[str, Any]) -> Answer:
    """Ask for everything."""
    with hs.settings(memory_limit=_MOST_BYTES, **_settings_of(method)):
        i, j, d, D, S = hs.pairs(**options, quantities="ijdDS")
    return Answer(i, j, S, d, D, inclusive=options["inclusive"])


def calls_of(method: str, options: dict[str, Any]) -> dict[str, Callable[[], Any]]:
    """Return the calls to be timed: i and j alone, and with d and D."""
    return {
        "ij": under(_settings_of(method), partial(hs.pairs, **options)),
        "with_d": under(_settings_of(method), partial(hs.pairs, **options, quantities="ijdD")),
    }


def _settings_of(method: str) -> dict[str, Any]:
    return {"precision": method} if method in PRECISIONS[1:] else {}


def under(settings: Mapping[str, Any], call: Callable[[], Any]) -> Callable[[], Any]:
    """Return a call that is made within `halfshell.settings`: itself, if there are none."""
    if not settings:
        return call
    context = copy_context()
    context.run(hs.settings(**settings).__enter__)
    return partial(context.run, call)


LENGTH = struct.Struct("<Q")
_MEMORY_SHARE = 0.5  # of what is available when the process starts
_MOST_ROWS = 40  # times the true pairs of both directions, and some: a list that is no answer


def send(stream: IO[bytes], message: Any) -> None:
    """Write one message."""
    data = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    stream.write(LENGTH.pack(len(data)))
    stream.write(data)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """Read one message; EOFError at the end of the stream."""
    head = stream.read(LENGTH.size)
    if len(head) < LENGTH.size:
        raise EOFError
    (size,) = LENGTH.unpack(head)
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return pickle.loads(data)


def _limit_memory() -> None:
    """Make a library that allocates too much fail, before the system ends a process."""
    try:
        import resource

        limit = int(_MEMORY_SHARE * _core.available_memory())
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    except (ImportError, OSError, ValueError):
        return  # not on every system


def _answer(library: Any, question: Any, result: Any) -> dict[str, Any]:
    """Return plain arrays of all that a library tells."""
    i, j = library.indices(result)
    found: dict[str, Any] = {"i": np.array(i, np.int64), "j": np.array(j, np.int64)}
    if "d" in library.quantities:
        found["d"] = np.array(library.distances(result))
    if "D" in library.quantities:
        found["D"] = np.array(library.vectors(result))[:, : question.dim]
    if "S" in library.quantities:
        found["S"] = np.array(library.shifts(result)).astype(np.int64)[:, : question.dim]
    return found


def _handle(library: Any, request: dict[str, Any]) -> dict[str, Any]:
    """Carry out one request: the answer, and how long it takes."""
    asked = Question(request["points"], request["cutoff"], request["rows"], request["periodic"])
    asked = replace(asked, **request.get("reach", {}))
    reason = library.refuses(asked)
    if reason is not None:
        return {"status": "not offered", "note": reason}
    folded = False
    if library.inside:
        asked, folded = wrapped(asked)
    offered = "".join(letter for letter in "ijdDS" if letter in library.quantities)
    calls = {
        name: library.prepare(replace(asked, quantities=letters))
        for name, letters in (("ij", "ij"), ("all", offered), ("with_d", offered.rstrip("S")))
    }
    if "d" not in offered:
        del calls["with_d"]
    first, _ = _timed(calls["ij"])
    second, result = _timed(calls["all"])
    answer = _answer(library, asked, result)
    if len(answer["i"]) > _MOST_ROWS * (request["pairs"] + 100_000):
        n_rows = len(answer["i"])
        return {"status": "failed", "note": f"gave {n_rows:,} rows for {request['pairs']:,} pairs"}
    del result, calls["all"]
    timings = {"ij": Timing(first, first, 1), "with_d": Timing(second, second, 1)}
    if first < request["patience"].seconds:  # of a slow library the first call has to do
        timings = take_turns(calls, request["patience"])
    return {
        "status": "ok", "answer": answer, "folded": folded,
        "timings": {name: timings[name] for name in calls},
    }  # fmt: skip


def _timed(call: Callable[[], Any]) -> tuple[float, Any]:
    start = time.perf_counter()
    result = call()
    return time.perf_counter() - start, result


def serve(name: str) -> int:
    """Answer requests until the other side closes; return the exit status."""
    pin_threads()
    replies = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    requests = sys.stdin.buffer
    library = LIBRARIES[name]
    send(replies, {"version": library.version()})
    _limit_memory()
    while True:
        try:
            request = receive(requests)
        except EOFError:
            return 0
        try:
            reply = _handle(library, request)
        except Exception as error:  # a library may refuse a scene in any way
            text = "".join(c if c.isprintable() else " " for c in str(error))
            note = f"{type(error).__name__}: {' '.join(text.split())}"[:200]
            reply = {"status": "failed", "note": note}
        send(replies, reply)


_SERVE = "import sys; from halfshell_report.measure import serve; sys.exit(serve(sys.argv[1]))"
_START = 120.0  # seconds in which a library must have been imported


class PeerProcess:
    """One library in a process that is started again after it died.

    Parameters
    ----------
    name : str
        One of `peers.LIBRARIES`.
    give_up : float
        Seconds that one scene may take.
    budget : float
        Seconds that all scenes together may take; those beyond are left out.
    command : sequence of str, optional
        What to start in place of `serve`, for tests.
    """

    def __init__(
        self,
        name: str,
        give_up: float,
        budget: float = float("inf"),
        command: Sequence[str] | None = None,
    ) -> None:
        self.name = name
        self.library = LIBRARIES[name]
        self._command = list(command or [sys.executable, "-c", _SERVE, name])
        self.version: str | None = None
        self._give_up = give_up
        self._left = budget
        self._process: subprocess.Popen[bytes] | None = None
        self._replies: queue.Queue[Any] = queue.Queue()
        self._greeted = False
        self._errors = tempfile.TemporaryFile()
        self._start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stop()
        self._errors.close()

    def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """Put one question; the reply has a "status" whatever happens."""
        if self._left <= 0.0:
            return {"status": "left out", "note": "the time for this library is used up"}
        greeting = self._greeting()
        if greeting is not None:
            return greeting
        start = time.monotonic()
        try:
            send(self._stream("stdin"), request)
            reply = self._replies.get(timeout=self._give_up)
        except queue.Empty:
            self._stop()
            reply = {"status": "timed out", "note": f"no answer within {self._give_up:g} s"}
        except OSError:
            reply = None
        self._left -= time.monotonic() - start
        return self._crashed() if reply is None else dict(reply)

    def wait(self) -> None:
        """Wait until the library is imported, so that this disturbs no measurement."""
        self._greeting()

    def _greeting(self) -> dict[str, Any] | None:
        """Wait for the library to be imported; return a reply if it is not."""
        if self._process is None:
            self._start()
        if not self._greeted:
            try:
                hello = self._replies.get(timeout=_START)
            except queue.Empty:
                self._stop()
                return {"status": "timed out", "note": "was not imported"}
            if hello is None:
                return self._crashed()
            self.version = hello["version"]
            self._greeted = True
        if self.version is None:
            package = self.library.distribution
            return {"status": "not installed", "note": how_to_install(package)}
        return None

    def _start(self) -> None:
        self._replies = queue.Queue()
        self._greeted = False
        self._process = subprocess.Popen(
            self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors
        )
        threading.Thread(
            target=_listen, args=(self._stream("stdout"), self._replies), daemon=True
        ).start()

    def _stream(self, name: str) -> Any:
        return getattr(self._process, name)

    def _stop(self) -> int | None:
        """End the process, which is ours, and return its exit status."""
        process, self._process = self._process, None
        if process is None:
            return None
        if process.stdin is not None:
            with contextlib.suppress(OSError):
                process.stdin.close()  # the other side ends by itself, unless it is at work
        try:
            process.wait(timeout=0.2)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        return process.returncode

    def _crashed(self) -> dict[str, Any]:
        """Say how the process ended; the next question starts a new one."""
        status = self._stop() or 0
        if status < 0:
            how = f"ended by {signal.Signals(-status).name}"
        else:
            how = f"ended with status {status}"
        self._errors.seek(0)
        said = self._errors.read().decode(errors="replace").strip().splitlines()
        last = "".join(c if c.isprintable() else " " for c in said[-1]).strip() if said else ""
        told = f": {last[:150]}" if last else ""
        self._errors.seek(0)
        self._errors.truncate()
        return {"status": "crashed", "note": f"the process {how}{told}"}


def _listen(stream: Any, replies: queue.Queue[Any]) -> None:
    """Hand on replies, and None at the end."""
    while True:
        try:
            reply = receive(stream)
        except (EOFError, OSError, ValueError):
            replies.put(None)
            stream.close()
            return
        replies.put(reply)
