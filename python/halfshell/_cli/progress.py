# SPDX-License-Identifier: BSD-3-Clause
"""A bar that tells on a terminal how much of a long work is done."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from halfshell._convert.progress import ProgressBar

__all__ = ["progress_bar"]


@contextmanager
def progress_bar(wanted: bool, text: str) -> Iterator[Callable[[float], None] | None]:
    """Yield a function to tell the work done, or None where no bar could be shown."""
    if not (wanted and sys.stderr.isatty() and find_spec("rich")):
        yield None
        return
    bar = ProgressBar(text)
    try:
        yield bar
    finally:
        bar.close()
