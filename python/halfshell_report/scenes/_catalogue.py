# SPDX-License-Identifier: BSD-3-Clause
"""What a scene is, the names of scenes, and the functions that make them."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray

from halfshell import _show
from halfshell._convert.options import as_flag
from halfshell._convert.points import Points

__all__ = [
    "SIZES", "Floats", "Motion", "Rule", "Scene", "Size", "Updates", "add", "load", "names",
    "pick",
]  # fmt: skip

Floats = NDArray[np.float64]
Size = Literal["small", "quick", "full"]
Rule = Literal["sum", "mean", "max", "min"]
_T = TypeVar("_T")

#: The sizes that a scene comes in, smallest first.
SIZES: tuple[Size, ...] = get_args(Size)


def pick(size: Size, small: _T, quick: _T, full: _T) -> _T:
    """Return what belongs to a size."""
    return {"small": small, "quick": quick, "full": full}[size]


@dataclass(frozen=True, eq=False)
class Motion:
    """How the points of a scene move, and how far a list of pairs may fall behind.

    Points attract and repel each other by a Lennard-Jones potential that is cut at the cutoff
    of the scene and shifted so that energy and force are zero there: with
    ``v(r) = 4 epsilon ((sigma / r)**12 - (sigma / r)**6)`` and the cutoff c,
    ``V(r) = v(r) - v(c) - (r - c) v'(c)`` for ``r < c``. It acts between all points, bonded
    ones too. A bond adds ``stiffness / 2 * (r - length)**2``. `dt` is meant for the
    velocity Verlet method.

    Attributes
    ----------
    velocities : ndarray of float64, shape (n, d)
        At the start, in units of length over time.
    mass : float
        Of each point.
    dt : float
        Time step.
    n_steps : int
        Steps after which the hard part is over.
    epsilon, sigma : float
        Depth and diameter of the Lennard-Jones potential.
    bonds : ndarray of int64, shape (m, 2)
        Which points a spring joins; m may be 0.
    lengths, stiffnesses : ndarray of float64, shape (m,)
        Of the springs: at rest, and force per length.
    skin : float
        The skin for which the scene is at its limit. A list of all pairs within cutoff + skin
        holds every pair within the cutoff until a point has moved skin / 2, and here it is
        needed to that very step.

    Examples
    --------
    >>> from halfshell_report import scenes
    >>> motion = scenes.load("head-on", size="small").motion
    >>> float(abs(motion.velocities).max() * motion.dt / (motion.skin / 2))
    0.1
    """

    velocities: Floats
    mass: float
    dt: float
    n_steps: int
    epsilon: float
    sigma: float
    skin: float
    bonds: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 2), np.int64))
    lengths: Floats = field(default_factory=lambda: np.empty(0))
    stiffnesses: Floats = field(default_factory=lambda: np.empty(0))

    __repr__ = _show.line
    _repr_html_ = _show.html


@dataclass(frozen=True, eq=False)
class Updates:
    """Points that are put and removed one after another, for `halfshell.DynamicCellList`.

    At first row i of the points of the scene has the key i. The cutoff of the scene is the radius
    to ask for around each position.

    Attributes
    ----------
    keys : ndarray of int64, shape (m,)
        The key that is put or removed; it may or may not be there.
    positions : ndarray of float64, shape (m, d)
        Where it is put.
    removed : ndarray of bool, shape (m,)
        Whether it is removed instead.

    Examples
    --------
    >>> from halfshell_report import scenes
    >>> updates = scenes.load("disks-touching", size="small").updates
    >>> len(updates.keys), int(updates.removed.sum())
    (300, 35)
    """

    keys: NDArray[np.int64]
    positions: Floats
    removed: NDArray[np.bool_]

    __repr__ = _show.line
    _repr_html_ = _show.html


@dataclass(frozen=True, eq=False)
class Scene:
    """One input of a search and why it is hard.

    Attributes
    ----------
    points : ndarray of float64 or float32, shape (n, d)
        Coordinates.
    cutoff : float or None
        Largest distance of a pair; None where radii or supports say it.
    box : ndarray of float64, shape (d,) or (d, d), or None
        Edge lengths, or edge vectors as rows; None: open space.
    periodic : tuple of bool, length d
        Which box vectors repeat.
    inclusive : bool
        Whether a pair at exactly the cutoff counts.
    motion : Motion or None
        For scenes that are hard when they move.
    radii : ndarray of float64, shape (n,), or None
        The radius of each point, for scenes without a cutoff.
    rule : {"sum", "mean", "max", "min"} or None
        What is made of two radii, or of two supports ("max": either, "min": both).
    supports : ndarray of float64, shape (n, d, d), or None
        The support of each point: a symmetric positive definite matrix H. D is within it where
        ``|H D| <= extent``.
    extent : float or None
        Of the supports.
    updates : Updates or None
        For scenes whose points come, go and move one at a time.
    name, title, stresses : str
        What `load` knows it by, one line that says what it is, and what it is hard for.

    Examples
    --------
    >>> from halfshell_report import scenes
    >>> scene = scenes.load("offset-1e15", size="quick")
    >>> scene.n_points, scene.ndim
    (2700, 3)
    >>> print(scene.stresses)
    Coordinates far from the origin: most of their digits are spent on the offset.
    <BLANKLINE>
    Software that bins or subtracts in float32 loses pairs. At 1e15 points lie on a grid of
    eighths, so that many pairs are at exactly the cutoff.
    """

    points: NDArray[Any]
    cutoff: Any  # a float; None with radii or supports
    box: Floats | None = None
    periodic: tuple[bool, ...] = ()
    inclusive: bool = True
    motion: Motion | None = None
    radii: Floats | None = None
    rule: Rule | None = None
    supports: Floats | None = None
    extent: float | None = None
    updates: Updates | None = None
    name: str = ""
    title: str = ""
    stresses: str = ""

    _shown = (
        "name", "title", "n_points", "ndim", "cutoff", "rule", "extent", "periodic", "inclusive"
    )  # fmt: skip
    __repr__ = _show.line
    _repr_html_ = _show.html

    @property
    def n_points(self) -> int:
        """Number of points."""
        return int(self.points.shape[0])

    @property
    def ndim(self) -> int:
        """Number of coordinates of a point."""
        return int(self.points.shape[1])

    @property
    def arguments(self) -> dict[str, Any]:
        """The arguments of `halfshell.pairs` that make up the scene."""
        return self.arguments_of(self.points)

    def arguments_of(self, points: NDArray[Any]) -> dict[str, Any]:
        """The same, for other coordinates of its points."""
        box = {"box": self.box, "periodic": self.periodic if self.box is not None else None}
        how = {"cutoff": self.cutoff, "inclusive": self.inclusive}
        if not self.reach:
            return {"points": points, **how, **box}
        own = Points(points, **box, radii=self.radii, supports=self.supports)
        cutoff = self.cutoff if self.supports is None else self.extent
        return {"points": own, **how, "cutoff": cutoff, "rule": self.rule}

    @property
    def reach(self) -> dict[str, Any]:
        """What gives each pair a reach of its own; nothing where the cutoff does."""
        if self.radii is not None:
            return {"radii": self.radii, "rule": self.rule}
        if self.supports is not None:
            return {"supports": self.supports, "extent": self.extent, "rule": self.rule}
        return {}


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
    >>> from halfshell_report import scenes
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
    >>> from halfshell_report import scenes
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
