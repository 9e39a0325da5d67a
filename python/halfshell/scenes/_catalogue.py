# SPDX-License-Identifier: BSD-3-Clause
"""The names of scenes and the functions that make them."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

from halfshell._convert.options import as_flag
from halfshell.scenes._scene import SIZES, Scene, Size

__all__ = ["add", "load", "names"]

# What says how far two points reach: one cutoff, a radius each, or a support each.
Kind = Literal["cutoff", "radii", "supports", "updates"]
_Make = TypeVar("_Make", bound=Callable[..., Scene])


@dataclass(frozen=True)
class _Entry:
    title: str
    make: Callable[..., Scene]
    arguments: tuple[Any, ...]
    kind: Kind


_ENTRIES: dict[str, _Entry] = {}


def add(entries: Mapping[str, tuple[Any, ...]], kind: Kind = "cutoff") -> Callable[[_Make], _Make]:
    """Register a function that makes scenes; its docstring says what they stress.

    `entries` holds for each name the title and what the function is called with after the size.
    """

    def keep(make: _Make) -> _Make:
        for name, (title, *arguments) in entries.items():
            if name in _ENTRIES:
                raise ValueError(f"there are two scenes {name!r}")
            _ENTRIES[name] = _Entry(title, make, tuple(arguments), kind)
        return make

    return keep


def names(*, radii: bool = False, supports: bool = False, updates: bool = False) -> tuple[str, ...]:
    """Return the names of all scenes, in the order in which they are meant to be run.

    Parameters
    ----------
    radii : bool, default False
        Those with a radius for each point instead of those with one cutoff.
    supports : bool, default False
        Those with a support for each point instead.
    updates : bool, default False
        Those whose points come, go and move one at a time. With several of these, scenes of all
        these kinds.

    Examples
    --------
    >>> from halfshell import scenes
    >>> scenes.names()[:3]
    ('uniform', 'order-random', 'order-sorted')
    >>> scenes.names(radii=True)[0]
    'balls-decades'
    >>> scenes.names(supports=True)
    ('needles', 'needles-strict')
    """
    given = {"radii": radii, "supports": supports, "updates": updates}
    asked = [kind for kind, wanted in given.items() if as_flag(wanted, kind)] or ["cutoff"]
    return tuple(name for name, entry in _ENTRIES.items() if entry.kind in asked)


def load(name: str, size: Size = "full") -> Scene:
    """Make a scene.

    Parameters
    ----------
    name : str
        One of `names`, of any kind.
    size : {"full", "quick", "small"}, default "full"
        "full": about 1e5 points, more or fewer where that shows more. "quick": some thousand,
        for a look. "small": at most 300, so that every pair can be checked in rational numbers.

    Returns
    -------
    Scene
        Made anew in each call: its arrays may be written to.

    Raises
    ------
    TypeError
        If `name` or `size` is not a string.
    ValueError
        If there is no such scene, with the nearest names, or no such size.

    Examples
    --------
    >>> from halfshell import scenes
    >>> scenes.load("needle", size="small").box.tolist()
    [1000000.0, 1.0, 1.0]
    >>> scenes.load("fcc-shel")
    Traceback (most recent call last):
    ...
    ValueError: there is no scene 'fcc-shel'; the nearest are fcc-shell, bcc-shell, sc-shell
    """
    for argument, value in (("name", name), ("size", size)):
        if not isinstance(value, str):
            raise TypeError(f"{argument} must be a string, not {type(value).__name__}")
    if name not in _ENTRIES:
        nearest = difflib.get_close_matches(name, _ENTRIES, n=3, cutoff=0.0)
        raise ValueError(f"there is no scene {name!r}; the nearest are {', '.join(nearest)}")
    if size not in SIZES:
        raise ValueError(f"size is {size!r}; it must be one of {', '.join(SIZES)}")
    entry = _ENTRIES[name]
    scene = entry.make(size, *entry.arguments)
    return replace(
        scene,
        name=name,
        title=entry.title,
        stresses=inspect.cleandoc(entry.make.__doc__ or ""),
        periodic=scene.periodic or (False,) * scene.ndim,
    )
