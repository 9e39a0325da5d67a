# SPDX-License-Identifier: BSD-3-Clause
"""What the shells around a point would have of an ideal gas, over which g(r) is taken."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.marks import Marks
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.types import FloatArray, PointArray
from halfshell._objects.radial_distribution import ratio

_OF_TYPES = 6  # of g(r) of each two types, and what makes it


def refuse_types(marks: Marks, n_bins: int) -> None:
    """MemoryError for more types than g(r) of each two would fit."""
    if marks.types is not None:
        refuse_unavailable(_OF_TYPES * 8 * marks.n_types**2 * n_bins, "g(r) of all types")


def known_types(
    marks: Marks, names: tuple[str, ...] | None
) -> tuple[str, ...] | tuple[int, ...] | None:
    """What the types of a result are called."""
    if marks.types is not None and names is None:
        return tuple(range(marks.n_types))
    return names


def over_ideal_gas(
    counts: npt.NDArray[Any], partners: float, shares: FloatArray
) -> FloatArray:
    """g(r): counts over what each shell would have of so many pairs; 0 where there are none."""
    return ratio(counts, in_shells(np.array([partners]), shares))


def in_shells(partners: FloatArray, shares: FloatArray) -> FloatArray:
    """What each shell has of them. Shares may be infinite: none of them are none everywhere."""
    found = np.zeros(np.broadcast_shapes(partners.shape, shares.shape))
    with np.errstate(over="ignore", under="ignore"):
        np.multiply(partners, shares, out=found, where=partners > 0.0)
    return found


def shell_shares(
    vectors: FloatArray | None, bits: int, edges: FloatArray
) -> FloatArray:
    """The part of the box that lies between two spheres, for each bin.

    In a unit of about the size of the box, a power of two: volumes of boxes in other units may be
    too large or too small for a float64.
    """
    if vectors is None or bits != (1 << len(vectors)) - 1:
        raise ValueError(
            "rdf needs a box that is periodic along every axis, for the density of the points; "
            "pair_histogram counts without one"
        )
    power = -int(np.frexp(np.abs(vectors).max())[1])
    volume: float = _core.box_measure(np.ldexp(vectors, power), bits)[1]
    ndim = len(vectors)
    with np.errstate(over="ignore", under="ignore", invalid="ignore", divide="ignore"):
        shells: FloatArray = np.diff(np.ldexp(edges, power) ** ndim)
        return unit_ball(ndim) * shells / volume


def unit_ball(ndim: int) -> float:
    """The volume of a ball of radius 1."""
    volume = 2.0 if ndim % 2 else 1.0
    for k in range(2 + ndim % 2, ndim + 1, 2):
        volume *= 2.0 * math.pi / k
    return volume


def centers(n: int, queries: PointArray | None, marks: Marks) -> npt.NDArray[np.int64]:
    """How many points, or queries, have neighbours that are counted; with types, of each."""
    asking = marks.types if queries is None else marks.query_types
    if asking is None:
        return np.array(n if queries is None else len(queries))
    return np.bincount(asking, minlength=marks.n_types)


def partners(n: int, q: int | None, marks: Marks) -> npt.NDArray[np.float64]:
    """Pairs that each shell would share out, with types of each two of them; one axis more for
    shells. q: the number of queries, or None."""
    if marks.types is None:
        return np.array([0.5 * n * n if q is None else float(q) * n])
    of_points = np.bincount(marks.types, minlength=marks.n_types).astype(np.float64)
    if marks.query_types is not None:
        of_queries = np.bincount(marks.query_types, minlength=marks.n_types)
        return np.outer(of_queries, of_points)[:, :, np.newaxis]
    pairs: npt.NDArray[np.float64] = np.outer(of_points, of_points)
    pairs[np.diag_indices(len(of_points))] *= 0.5
    return pairs[:, :, np.newaxis]
