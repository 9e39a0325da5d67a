# SPDX-License-Identifier: BSD-3-Clause
"""The exceptions that have no counterpart in Python, and what errors say and show."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

#: Errors by which arguments are refused.
REFUSALS = (TypeError, ValueError, OverflowError, MemoryError)

Function = TypeVar("Function", bound="Callable[..., Any]")


class CapacityError(ValueError):
    """Arrays of `out`, or a capacity, are too small for the result.

    Attributes
    ----------
    needed : int
        The true number of pairs or, for `NeighborTable.to_padded`, of entries in the
        longest row.

    Examples
    --------
    >>> import halfshell as hs
    >>> import numpy as np
    >>> too_small = np.empty(1, np.int64), np.empty(1, np.int64)
    >>> try:
    ...     hs.pairs([[0.0], [1.0], [2.0]], 1.0, out=too_small)
    ... except hs.CapacityError as error:
    ...     print(error.needed)
    2
    """

    def __init__(self, message: str, needed: int) -> None:
        super().__init__(message)
        self.needed = needed

    def __reduce__(self) -> tuple[type[CapacityError], tuple[str, int]]:
        return type(self), (str(self), self.needed)


class StaleError(RuntimeError):
    """A pair field is out of date, as the pairs of its connectivity have changed.

    Raised by every access to a `PairField` after `Connectivity.rebuild`, ``patch`` or ``remove``.

    Examples
    --------
    >>> import halfshell as hs
    >>> c = hs.Connectivity([hs.NodeList("fluid", [[0.0], [1.0]], [1.0, 1.0])])
    >>> field = hs.PairField(c.pairs)
    >>> c.rebuild([hs.NodeList("fluid", [[0.0], [1.5]], [1.0, 1.0])])
    >>> try:
    ...     field[0]
    ... except hs.StaleError as error:
    ...     print(error)
    this field belongs to pairs before rebuild(): make a new PairField of Connectivity.pairs
    """

    def __init__(self, message: str) -> None:
        super().__init__(message)


def shorten(error: BaseException) -> None:
    """Drop the traceback of an error, before it is raised again, if all frames are of this package.

    So a refused argument is shown where the user gave it. Errors of a user's own code keep theirs.
    """
    frame = error.__traceback__
    while frame is not None:
        if not str(frame.tb_frame.f_globals.get("__name__")).startswith("halfshell."):
            return
        frame = frame.tb_next
    error.__traceback__ = None


def brief(function: Function) -> Function:
    """Decorate a function that checks arguments: its refusals do not show the frames below it."""

    @wraps(function)
    def looked(*arguments: Any, **options: Any) -> Any:
        try:
            return function(*arguments, **options)
        except REFUSALS as error:
            shorten(error)
            raise

    return cast("Function", looked)


# ---- packages that are optional --------------------------------------------------------------

def how_to_install(*packages: str) -> str:
    """Return the command that brings them, whether or not there is a release of ours."""
    return f"pip install {' '.join(packages)}"


def needs(what: str, *packages: str) -> str:
    """Return a sentence for what cannot be done without these packages."""
    return f"{what} needs {' and '.join(packages)}: {how_to_install(*packages)}"
