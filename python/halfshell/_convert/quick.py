# SPDX-License-Identifier: BSD-3-Clause
"""Calls with the usual arguments go to C at once.

Python takes as long to fill in thirty keywords that were left out as a search of thirty points.
"""

from __future__ import annotations

from functools import wraps
from typing import TYPE_CHECKING, Any, TypeVar, cast

from halfshell import _core

if TYPE_CHECKING:
    from collections.abc import Callable

Function = TypeVar("Function", bound="Callable[..., Any]")

_SHARED = (
    "points", "cutoff", "box", "periodic", "inclusive", "precision", "kernel", "memory_limit",
    "progress", "threads",
)  # fmt: skip


def quick(search: Callable[..., Any], *own: str) -> Callable[[Function], Function]:
    """Decorate a function of points, cutoff and keywords that asks a search of the core.

    own: the keywords that the search takes beyond those that all searches share. Calls with other
    ones, and those in which something is not plain (plain.h), the function answers.
    """

    def decorate(function: Function) -> Function:
        known = function.__kwdefaults__ or {}
        names = _SHARED + own
        usual = tuple(map(known.get, names))
        places = {name: k for k, name in enumerate(names) if name in known}

        @wraps(function)
        def call(points: Any, cutoff: Any, **options: Any) -> Any:
            result = _core.quick(search, usual, places, points, cutoff, options)
            return function(points, cutoff, **options) if result is NotImplemented else result

        return cast("Function", call)

    return decorate
