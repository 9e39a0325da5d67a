# SPDX-License-Identifier: BSD-3-Clause
"""Neighbour lists in place of those of ``matscipy.neighbours``.

The functions have matscipy's arguments, quantities, dtypes and shapes, and its rule: a pair counts
if it is closer than the cutoff, or than the sum of the radii of its two atoms (``<``). Here that is
decided for the exact values of the floats.

The order is ascending (i, j, S), always; matscipy promises ascending i alone. Points in a plane or
on a line need no cell here: matscipy shrinks one around them, which has no volume, and fails.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell.compat.ase import primitive_neighbor_list

__all__ = ["first_neighbours", "neighbour_list", "triplet_list"]

_TYPES = {"i": np.int32, "j": np.int32, "S": np.int32}


def neighbour_list(
    quantities: str,
    atoms: Any = None,
    cutoff: Any = None,
    positions: Any = None,
    cell: Any = None,
    pbc: Any = None,
    numbers: Any = None,
    cell_origin: Any = None,
) -> Any:
    """Find all neighbours of each atom, as ``matscipy.neighbours.neighbour_list`` does.

    Parameters
    ----------
    quantities : str
        Letters of what is returned, in their order: i, j, d, D, S, as in `halfshell.compat.ase`.
    atoms : ase.Atoms, optional
        The atoms; or else what they consist of, one by one:
    cutoff : float, dict or array_like of float, shape (n,)
        One length for all; one for each pair of elements, by symbol or number; or a radius for each
        atom, whose sums are the cutoffs.
    positions : array_like of float, shape (n, 3), optional
        In place of `atoms`, like the following.
    cell : array_like of float, shape (3, 3), optional
        Cell vectors as rows. Default: none, which needs no periodicity.
    pbc : bool or sequence of bool, shape (3,), optional
        Which of them repeat. Default: none.
    numbers : array_like of int, shape (n,), optional
        Atomic numbers. Default: 1.
    cell_origin : array_like of float, shape (3,), optional
        Accepted, without effect: points may lie anywhere.

    Returns
    -------
    ndarray or tuple of ndarray
        One array for each letter, a bare array for one letter: i, j int32 (m,); d float64 (m,);
        D float64 (m, 3); S int32 (m, 3). The full list, ascending by (i, j, S).

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As `halfshell.neighbors`; ValueError also for letters that are none of these, without a
        cutoff, and for `atoms` beside what they consist of.

    Examples
    --------
    >>> from ase.build import molecule
    >>> from halfshell.compat.matscipy import neighbour_list
    >>> i, j = neighbour_list("ij", molecule("H2O"), 1.2)
    >>> i.tolist(), j.tolist()
    ([0, 0, 1, 2], [1, 2, 0, 0])
    """
    if cutoff is None:
        raise ValueError("Please provide a value for the cutoff radius.")
    if atoms is not None:
        beside = {"positions": positions, "cell_origin": cell_origin, "cell": cell, "pbc": pbc}
        for name, value in {**beside, "numbers": numbers}.items():
            if value is not None:
                raise ValueError(f"You cannot provide an ASE Atoms object and {name} as well.")
        positions, cell, pbc, numbers = atoms.positions, atoms.cell, atoms.pbc, atoms.numbers
    if positions is None:
        raise ValueError("Please provide atoms or positions.")
    if pbc is None:
        pbc = False
    if cell is None:
        cell = np.zeros((3, 3))
    if numbers is None:
        numbers = np.ones(len(positions), dtype=int)
    if isinstance(cutoff, defaultdict):
        cutoff = cutoff.default_factory()  # type: ignore[misc]
    if not set(quantities) <= set("ijdDS"):
        raise ValueError("Unsupported quantity specified.")
    cell = np.asarray(cell, dtype=float)
    found = primitive_neighbor_list(
        quantities, np.broadcast_to(np.asarray(pbc, bool), 3), cell, positions, cutoff,
        numbers=numbers,
    )  # fmt: skip
    arrays = found if isinstance(found, tuple) else (found,)
    typed = tuple(
        array.astype(_TYPES.get(letter, array.dtype), copy=False)
        for letter, array in zip(quantities, arrays, strict=True)
    )
    return typed if len(typed) > 1 else typed[0]


def first_neighbours(nat: int, i: npt.ArrayLike) -> npt.NDArray[np.int32]:
    """Where the neighbours of each atom begin in a list that ascends by i.

    Parameters
    ----------
    nat : int
        Number of atoms.
    i : array_like of int, shape (m,)
        First atoms of the pairs, ascending.

    Returns
    -------
    ndarray of int32, shape (nat + 1,)
        Those of atom k are from ``first[k]`` to ``first[k + 1]``.

    Examples
    --------
    >>> from halfshell.compat.matscipy import first_neighbours
    >>> first_neighbours(4, [0, 0, 2]).tolist()
    [0, 2, 2, 3, 3]
    """
    return np.searchsorted(np.asarray(i), np.arange(nat + 1)).astype(np.int32)


def triplet_list(
    first_neighbours: npt.ArrayLike,
    abs_dr_p: npt.ArrayLike | None = None,
    cutoff: float | None = None,
    i_p: npt.ArrayLike | None = None,
    j_p: npt.ArrayLike | None = None,
) -> tuple[npt.NDArray[np.int32], ...]:
    """Find pairs of pairs with the same first atom, as ``matscipy.neighbours.triplet_list`` does.

    Parameters
    ----------
    first_neighbours : array_like of int, shape (n + 1,)
        Where the pairs of each atom begin.
    abs_dr_p : array_like of float, shape (m,), optional
        Distance of each pair; with `cutoff` only pairs that are closer than that count.
    cutoff : float, optional
        In the unit of the distances.
    i_p, j_p : array_like of int, shape (m,), optional
        Both atoms of each pair: then the pair of both second atoms is looked for as well.

    Returns
    -------
    ij_t, ik_t : ndarray of int32, shape (t,)
        Positions among the pairs, in both orders.
    jk_t : ndarray of int32, shape (t,)
        With `i_p` and `j_p`: the first pair (j, k), or -1.

    Examples
    --------
    >>> from halfshell.compat.matscipy import triplet_list
    >>> ij, ik = triplet_list([0, 2, 2, 3])
    >>> ij.tolist(), ik.tolist()
    ([0, 1], [1, 0])
    """
    from halfshell._convert.starts import starts_of
    from halfshell._objects.table_triplets import triplets

    starts = np.asarray(first_neighbours).astype(np.int64)
    if abs_dr_p is None or cutoff is None:
        ij, ik = triplets(starts, True)
    else:
        near = np.asarray(abs_dr_p) < cutoff
        kept = np.flatnonzero(near)
        ij, ik = triplets(starts_of(near)[starts], True)
        ij, ik = kept[ij], kept[ik]
    if i_p is None or j_p is None:
        return ij.astype(np.int32), ik.astype(np.int32)
    first, second = np.asarray(i_p).astype(np.int64), np.asarray(j_p).astype(np.int64)
    width = int(second.max(initial=0)) + 1
    keys = first * width + second
    order = np.argsort(keys, kind="stable")  # the first of several images comes first
    wanted = second[ij] * width + second[ik]
    at = np.searchsorted(keys[order], wanted)
    place = order[np.minimum(at, max(len(order) - 1, 0))] if len(order) else at
    jk = np.where(keys[place] == wanted, place, -1) if len(order) else at
    return ij.astype(np.int32), ik.astype(np.int32), jk.astype(np.int32)
