# SPDX-License-Identifier: BSD-3-Clause
"""Other libraries, each in a process of its own, which may fail without harm."""

from __future__ import annotations

import contextlib
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Any, Self

from halfshell._extras import how_to_install
from halfshell_report.measure.worker import receive, send
from halfshell_report.peers import LIBRARIES

__all__ = ["PeerProcess"]

_START = 120.0  # seconds in which a library must have been imported


class PeerProcess:
    """One library in a process that is started again after it died.

    Parameters
    ----------
    name : str
        One of `halfshell_report.peers.LIBRARIES`.
    give_up : float
        Seconds that one scene may take.
    budget : float
        Seconds that all scenes together may take; those beyond are left out.
    command : sequence of str, optional
        What to start in place of `worker`, for tests.
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
        worker = [sys.executable, "-m", "halfshell_report.measure.worker", name]
        self._command = list(command or worker)
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
