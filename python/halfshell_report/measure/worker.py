# SPDX-License-Identifier: BSD-3-Clause
"""The process in which other libraries run: ``python -m halfshell_report.measure.worker NAME``.

A library may raise, hang, abort or eat the memory; none of that may reach the report. Requests
and replies are pickled dicts, each after its length in eight bytes. Replies go to what was
standard output; whatever a library prints goes to standard error.
"""

from __future__ import annotations

import os
import pickle
import struct
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import IO, Any

import numpy as np

from halfshell_report.measure.timing import Timing, take_turns

__all__ = ["LENGTH", "main", "receive", "send"]

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

        with open("/proc/meminfo", encoding="ascii") as lines:
            free = next(line for line in lines if line.startswith("MemAvailable:"))
        limit = int(_MEMORY_SHARE * int(free.split()[1]) * 1024)
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    except (ImportError, OSError, StopIteration, ValueError):
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
    from halfshell_report.peers import Question, wrapped

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


def main(name: str) -> int:
    """Answer requests until the other side closes; return the exit status."""
    # To be set before any library is imported.
    for variable in ("OMP", "RAYON", "OPENBLAS", "MKL", "NUMEXPR", "NUMBA", "TBB"):
        os.environ[f"{variable}_NUM_THREADS"] = "1"
    replies = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    requests = sys.stdin.buffer
    from halfshell_report.peers import LIBRARIES

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


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
