# SPDX-License-Identifier: BSD-3-Clause
"""The argument `progress` of long searches, and the bar that ``progress=True`` shows."""

from __future__ import annotations

import sys
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from halfshell._convert.foreign import kind_of
from halfshell._errors import needs

BAR_AFTER = 0.5  # seconds without a bar
_BETWEEN = 0.1  # seconds from one drawing to the next


class ProgressBar:
    """Show what fraction of some work is done: by rich on a terminal, as HTML in a notebook.

    The bar appears once the work has taken `BAR_AFTER` seconds, and goes away with `close`, at the
    fraction 1, or with the object. If there is neither terminal nor notebook, nothing is shown.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._start = self._drawn = time.monotonic()
        self._notebook = _in_notebook()
        self._is_shown = self._notebook or sys.stderr.isatty()
        self._draw: Callable[[float], None] | None = None
        self._finish: Callable[[], object] = lambda: None

    def __call__(self, fraction: float) -> None:
        if fraction >= 1.0:
            self.close()
            return
        now = time.monotonic()
        if not self._is_shown or now - self._start < BAR_AFTER:
            return
        if self._draw is None:
            self._draw, stop = (_on_page if self._notebook else _on_terminal)(self._text)
            self._finish = weakref.finalize(self, stop)  # at the latest when Python ends
        elif now - self._drawn < _BETWEEN:
            return
        self._draw(fraction)
        self._drawn = now

    def close(self) -> None:
        """Take the bar away; a later call of the object shows none."""
        self._is_shown = False
        self._finish()


def as_progress(progress: Any, text: str = "searching") -> Callable[[float], object] | None:
    """What is to be called with the fraction done: a new bar for True, nothing for False."""
    if progress is None or progress is False:
        return None
    if progress is True:
        if find_spec("rich") is None and not _in_notebook():
            raise ImportError(needs("progress=True", "rich"))
        return ProgressBar(text)
    if not callable(progress):
        raise TypeError(f"progress must be callable or a bool, got {kind_of(progress)}")
    return progress  # type: ignore[no-any-return]


def _in_notebook() -> bool:
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return hasattr(shell, "kernel")


def _on_terminal(text: str) -> tuple[Callable[[float], None], Callable[[], None]]:
    """Begin a bar on standard error; what draws a fraction, and what takes the bar away."""
    from rich.console import Console
    from rich.progress import Progress

    bar = Progress(console=Console(stderr=True), transient=True, auto_refresh=False)
    task = bar.add_task(text, total=1.0)
    bar.start()
    return lambda fraction: bar.update(task, completed=fraction, refresh=True), bar.stop


def _on_page(text: str) -> tuple[Callable[[float], None], Callable[[], None]]:
    """Begin a bar in the output of the present cell of a notebook; what it returns is as above."""
    import IPython.display

    page: Any = IPython.display
    shown = page.display(page.HTML(""), display_id=True)

    def draw(fraction: float) -> None:
        bar = f'<progress max="1" value="{fraction:.3f}" style="width: 20em"></progress>'
        shown.update(page.HTML(f"{text} {bar} {fraction:.0%}"))

    return draw, lambda: shown.update(page.HTML(""))


# ---- of the command line ---------------------------------------------------------------------

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
