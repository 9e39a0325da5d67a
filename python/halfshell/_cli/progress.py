# SPDX-License-Identifier: BSD-3-Clause
"""A bar that tells on a terminal how much of a long work is done."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

__all__ = ["progress_bar"]

BAR_AFTER = 0.5  # seconds without a bar


@contextmanager
def progress_bar(wanted: bool, text: str) -> Iterator[Callable[[float], None] | None]:
    """Yield a function to tell the work done, or None where no bar could be shown.

    The bar appears on a terminal only, and only once the work has taken `BAR_AFTER` seconds.
    """
    if not (wanted and sys.stderr.isatty() and find_spec("rich")):
        yield None
        return
    start = time.monotonic()
    bar: Any = None
    task: Any = None
    drawn = start

    def advance(fraction: float) -> None:
        nonlocal bar, task, drawn
        now = time.monotonic()
        if now - start < BAR_AFTER or (bar is not None and now - drawn < 0.1):
            return
        if bar is None:
            from rich.console import Console
            from rich.progress import Progress

            bar = Progress(console=Console(stderr=True), transient=True, auto_refresh=False)
            task = bar.add_task(text, total=1.0)
            bar.start()
        bar.update(task, completed=fraction, refresh=True)
        drawn = now

    try:
        yield advance
    finally:
        if bar is not None:
            bar.stop()
