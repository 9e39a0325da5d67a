# SPDX-License-Identifier: BSD-3-Clause
"""What the adapter of a library that lists pairs is given, and what is known about the library.

An adapter runs its library on one thread, in the cheapest mode that gives the same answer:
half lists where there are any, indices alone where only indices are wanted, and input of
the type that the library works on, converted beforehand. Whatever a caller has to do for each
new set of points (building a tree or a grid) is part of the call.

Libraries are imported when they are first used; a missing one is reported, not an error.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["Call", "Library", "Question", "in_space", "wrapped"]

Call = Callable[[], Any]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Question:
    """The pairs of which points, in which box. Other classes with these attributes will do.

    `task` is "pairs" or "count"; `batch` numbers the system of each point, or is None. With
    `radii`, one a point, pairs are those of balls that touch; with `supports` H, a matrix a point,
    those with ``|H D| <= extent`` for either point, or by the `rule` "min" for both. No reach
    passes the cutoff.
    """

    points: Floats  # (n, d)
    cutoff: float
    rows: Floats | None = None  # the box as row vectors (d, d), or None: open space
    periodic: tuple[bool, ...] = ()
    quantities: str = "ij"
    task: str = "pairs"
    batch: Any = None
    radii: Floats | None = None
    supports: Floats | None = None
    extent: float | None = None
    rule: str | None = None

    @property
    def n(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def dim(self) -> int:
        """Number of coordinates of a point."""
        return int(self.points.shape[1])

    @property
    def box(self) -> Floats | None:
        """The box again, under the name that tells open space."""
        return self.rows

    @property
    def orthorhombic(self) -> bool:
        """Whether the box vectors that repeat are along the coordinate axes."""
        if self.rows is None:
            return True
        rows = self.rows * ~np.eye(self.dim, dtype=np.bool_)
        return not np.any(rows[list(self.periodic)])

    @property
    def has_images(self) -> bool:
        """Whether a pair of points may be within the cutoff in more than one image."""
        if self.rows is None or not any(self.periodic):
            return False
        rows = self.rows[list(self.periodic)]
        sizes = np.abs(rows).max(axis=1)  # so that no square overflows or vanishes
        units = rows / sizes[:, None]
        duals = np.linalg.solve(units @ units.T, units)
        heights = 1.0 / np.linalg.norm(duals, axis=1)  # in sizes
        return bool(np.any(heights / 2.0 <= self.cutoff / sizes))


class Library(ABC):
    """What is known about a library, and how it is called.

    A question is a `Question` or a scene of the benchmarks.
    """

    name: ClassVar[str]
    distribution: ClassVar[str]
    module: ClassVar[str]
    inclusive: ClassVar[bool] = False  # whether a pair at exactly the cutoff counts
    full: ClassVar[bool] = False  # whether a pair comes in both directions
    own_images_twice: ClassVar[bool] = False  # whether (i, i, S) does, in a half list
    quantities: ClassVar[str] = "ij"
    dims: ClassVar[tuple[int, ...]] = (3,)
    flat: ClassVar[bool] = False  # whether a plane can be given as a slab open in z
    open_space: ClassVar[bool] = True
    some_axes: ClassVar[bool] = True  # whether only some axes may repeat
    triclinic: ClassVar[bool] = True
    images: ClassVar[bool] = True
    radii: ClassVar[bool] = False  # whether points may have one each, and touch by their sum
    supports: ClassVar[bool] = False  # whether points may have one each
    inside: ClassVar[bool] = False  # whether points must lie in the box
    counts_alone: ClassVar[bool] = False  # no list of pairs at all
    float_bits: ClassVar[int] = 53
    tolerance: ClassVar[float] = 0.0  # relative, beyond rounding
    remark: ClassVar[str] = ""  # what a reader of its errors should know
    remark_on_radii: ClassVar[str] = ""  # and of those where points have radii
    remark_on_supports: ClassVar[str] = ""  # or supports

    def version(self) -> str | None:
        """Return the installed version, None where it is missing or cannot be imported."""
        try:
            importlib.import_module(self.module)
            return importlib.metadata.version(self.distribution)
        except ImportError:
            return None

    def refuses(self, question: Any) -> str | None:
        """Say what of the question this library does not offer, or return None."""
        if question.dim not in self.dims and not (question.dim < 3 and self.flat):
            return f"{question.dim} dimension{'s' if question.dim > 1 else ''}"
        if question.box is None and not self.open_space:
            return "open space"
        if question.box is not None and not self.some_axes and not all(question.periodic):
            return "some axes periodic, some open"
        if not question.orthorhombic and not self.triclinic:
            return "triclinic box"
        if question.has_images and not self.images:
            return "several images of one pair"
        if question.radii is not None and not self.radii:
            return "a radius for each point"
        if question.supports is not None and not self.supports:
            return "a support for each point"
        if question.task == "count":
            return None
        lacking = set(question.quantities) - set(self.quantities)
        if lacking or self.counts_alone:
            return f"quantities {''.join(sorted(lacking)) or question.quantities}"
        return None

    @abstractmethod
    def prepare(self, question: Any) -> Call:
        """Convert the input, and return the call that is to be timed."""

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return i and j of a result. Default: the first two arrays."""
        return result[0], result[1]

    def shifts(self, result: Any) -> Any:
        """Return S of a result for quantities "ijS" or "ijdDS". Default: the last array."""
        return result[-1]

    def distances(self, result: Any) -> Any:
        """Return d of a result for quantities that begin with "ijd". Default: the third."""
        return result[2]

    def vectors(self, result: Any) -> Any:
        """Return D of a result for quantities that begin with "ijdD". Default: the fourth."""
        return result[3]


def in_space(question: Any) -> tuple[Floats, Floats | None, list[bool]]:
    """Points, rows of the box and periodic axes, what is flat laid at 0 in a slab open there."""
    rows, periodic = question.rows, list(question.periodic) or [False] * question.dim
    if question.dim == 3:
        return question.points, rows, periodic
    open_axes = 3 - question.dim
    points = np.zeros((question.n, 3))
    points[:, : question.dim] = question.points
    if rows is None:
        return points, None, [False] * 3
    slab = np.diag(np.full(3, 2.0 * question.cutoff or 1.0))
    slab[: question.dim, : question.dim] = rows
    return points, slab, [*periodic, *[False] * open_axes]


def wrapped(question: Question) -> tuple[Question, bool]:
    """Fold points into the box in float64; return whether any was outside."""
    if question.rows is None or not any(question.periodic):
        return question, False
    periodic = np.array(question.periodic)
    points = question.points
    if question.orthorhombic:
        lengths = np.where(periodic, np.diag(question.rows), 1.0)
        outside = periodic & ((points < 0.0) | (points >= lengths))
        folded = points - np.floor(points / lengths) * lengths
        folded[folded >= lengths] = 0.0  # rounded up to the face
        folded[folded < 0.0] = 0.0
        folded = np.where(outside, folded, points)
    else:
        rows = question.rows[periodic]
        size = np.abs(rows).max()
        turns = np.floor((points / size) @ np.linalg.pinv(rows / size))
        outside = turns != 0.0
        folded = points - turns @ rows
    return (replace(question, points=folded), True) if outside.any() else (question, False)
