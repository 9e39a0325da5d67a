# SPDX-License-Identifier: BSD-3-Clause
"""Neighbour lists in place of those of ``matscipy.neighbours``.

The functions have matscipy's arguments, quantities, dtypes, shapes and types of errors, and its
rule: a pair counts if it is closer than the cutoff, or than the sum of the radii of its two atoms
(``<``). Here that is decided for the exact values of the floats. `neighbour_matrix` is in the
package matscipy-neighbours alone, whose other functions are as those of matscipy.

The order is ascending (i, j, S), always; matscipy promises ascending i alone. Points in a plane or
on a line need no cell here: matscipy shrinks one around them, which has no volume, and fails.
"""

from __future__ import annotations

import operator
from collections import defaultdict
from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt
from ase.data import atomic_numbers

import halfshell as hs
from halfshell import _core
from halfshell.compat.ase import listed, reach_of

__all__ = [
    "coordination",
    "first_neighbours",
    "get_jump_indicies",
    "mic",
    "neighbour_list",
    "neighbour_matrix",
    "triplet_list",
]

_TYPES = {"i": np.int32, "j": np.int32, "d": float, "D": float, "S": np.int32}


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
    """Find all neighbours of each atom; see ``matscipy.neighbours.neighbour_list``.

    `cutoff` may also be a symmetric matrix with a row for each atomic number. `cell_origin` has no
    effect: points may lie anywhere.

    Examples
    --------
    >>> from ase.build import molecule
    >>> from halfshell.compat.matscipy import neighbour_list
    >>> i, j = neighbour_list("ij", molecule("H2O"), 1.2)
    >>> i.tolist(), j.tolist()
    ([0, 0, 1, 2], [1, 2, 0, 0])
    """
    if not isinstance(quantities, str):
        raise TypeError(f"quantities must be a string, got {type(quantities).__name__}")
    scene, cutoff = _scene(atoms, cutoff, positions, cell, pbc, numbers, cell_origin)
    if not _TYPES.keys() >= set(quantities):
        raise ValueError("Unsupported quantity specified.")
    arrays = listed(quantities, **scene, cutoff=cutoff, self_interaction=False, types=_TYPES)
    return arrays[0] if len(arrays) == 1 else arrays


def _scene(
    atoms: Any, cutoff: Any, positions: Any = None, cell: Any = None, pbc: Any = None,
    numbers: Any = None, cell_origin: Any = None,
) -> tuple[dict[str, Any], Any]:  # fmt: skip
    """What ASE's function takes: atoms or what they consist of, and a cutoff."""
    if cutoff is None:
        raise ValueError("Please provide a value for the cutoff radius.")
    if atoms is not None:
        parts = {"positions": positions, "cell": cell, "pbc": pbc, "numbers": numbers,
                 "cell_origin": cell_origin}  # fmt: skip
        for name, value in parts.items():
            if value is not None:
                raise ValueError(f"You cannot provide an ASE Atoms object and {name} as well.")
        positions, pbc, numbers = atoms.positions, atoms.pbc, atoms.numbers
        cell = getattr(atoms.cell, "array", atoms.cell)  # itself, not a copy
    if positions is None:
        raise ValueError("Please provide atoms or positions.")
    n = len(positions)
    pbc = np.asarray(False if pbc is None else pbc, bool)
    pbc = pbc if pbc.shape == (3,) else np.broadcast_to(pbc, 3)
    if cell is None and pbc.any():
        raise ValueError("Please provide a cell: pbc says that it repeats.")
    cell = np.zeros((3, 3)) if cell is None else np.asarray(cell, dtype=float)
    numbers = np.ones(n, dtype=int) if numbers is None else np.asarray(numbers)
    if len(numbers) != n:
        raise TypeError(f"There must be a number for each of {n} atoms, got {len(numbers)}.")
    positions = positions if n else np.empty((0, 3))
    scene = {"positions": positions, "cell": cell, "pbc": pbc, "numbers": numbers}
    return scene, _cutoff(cutoff, numbers)


def _cutoff(cutoff: Any, numbers: npt.NDArray[Any]) -> Any:
    if type(cutoff) is float:
        return cutoff
    if isinstance(cutoff, defaultdict):
        cutoff = cutoff.default_factory()  # type: ignore[misc]
    if isinstance(cutoff, Mapping):
        for key in {key for pair in cutoff for key in pair if isinstance(key, str)}:
            if key not in atomic_numbers:
                raise ValueError(f"There is no element {key!r}, as in the dict of cutoffs.")
        return {(one, other): float(length) for (one, other), length in cutoff.items()}
    if np.ndim(cutoff) == 0:
        return float(cutoff)
    lengths = np.asarray(cutoff, dtype=float)
    if lengths.ndim == 1 and len(lengths) != len(numbers):
        raise TypeError(
            f"There must be a radius for each of {len(numbers)} atoms, got {len(lengths)}."
        )
    if lengths.ndim != 2:
        return lengths
    kinds = np.unique(numbers).tolist()
    if not np.array_equal(lengths, lengths.T) or any(not 0 <= k < len(lengths) for k in kinds):
        raise ValueError(
            "A matrix of cutoffs must be symmetric, and have a row for each atomic number up to "
            f"the largest one, got shape {lengths.shape} for the numbers {kinds}."
        )
    return {pair: lengths[pair] for pair in product(kinds, repeat=2)}


def _points(atoms: Any, cutoff: Any, **parts: Any) -> tuple[hs.Points, Any]:
    """Points and cutoff of halfshell."""
    scene, cutoff = _scene(atoms, cutoff, **parts)
    cutoff, each = reach_of(cutoff, scene["numbers"])
    return hs.Points(scene["positions"], box=scene["cell"], periodic=scene["pbc"], **each), cutoff


def coordination(
    structure: Any = None, cutoff: Any = None, **parts: Any
) -> npt.NDArray[np.int64]:
    """Count the neighbours of each atom; see ``matscipy.neighbours.coordination``.

    There is a number for each atom; matscipy's array ends with the last one that has neighbours.
    parts: what atoms consist of, as in `neighbour_list`.

    Examples
    --------
    >>> from ase.build import molecule
    >>> from halfshell.compat.matscipy import coordination
    >>> coordination(molecule("H2O"), 1.2).tolist()
    [2, 1, 1]
    """
    points, cutoff = _points(structure, cutoff, **parts)
    return hs.coordination(points, cutoff, inclusive=False)


def neighbour_matrix(
    atoms: Any = None,
    cutoff: Any = None,
    max_neighbours: int | None = None,
    *,
    device: Any = None,
    array_namespace: Any = None,
    **parts: Any,
) -> tuple[Any, Any, Any]:
    """List neighbours in rows of one length; see ``matscipy_neighbours.neighbour_matrix``.

    Only the device "cpu" is there. CapacityError, a ValueError, if an atom has more than
    `max_neighbours`; ``needed`` tells how many.

    Examples
    --------
    >>> from ase.build import molecule
    >>> from halfshell.compat.matscipy import neighbour_matrix
    >>> idx, dist, count = neighbour_matrix(molecule("H2O"), 1.2, 3)
    >>> idx.tolist(), count.tolist()
    ([[1, 2, 0], [0, 0, 0], [0, 0, 0]], [2, 1, 1])
    """
    if max_neighbours is None:
        raise ValueError("Please provide max_neighbours (the row capacity).")
    if device not in (None, "cpu"):
        raise ValueError(f"device must be None or 'cpu', got {device!r}")
    points, cutoff = _points(atoms, cutoff, **parts)
    table = hs.neighbors(points, cutoff, quantities="jD", inclusive=False)
    idx, dist = (table.to_padded(max_neighbours, 0, quantity=letter) for letter in "jD")
    made = idx, dist, table.counts
    if array_namespace in (None, "dlpack"):
        return made
    idx, dist, count = (array_namespace.from_dlpack(array) for array in made)
    return idx, dist, count


def mic(dr: npt.ArrayLike, cell: Any, pbc: Any = None) -> npt.NDArray[np.float64]:
    """Replace vectors by their shortest images; see ``matscipy.neighbours.mic``.

    That rounds multiples of the cell vectors, which may give a longer image in a skewed cell; as in
    matscipy-neighbours, the shortest one is found in any cell, and with the least shift of several.
    Which one it is, is decided exactly.

    Examples
    --------
    >>> import numpy as np
    >>> from halfshell.compat.matscipy import mic
    >>> mic([[0.75, 0.0, 0.0], [0.75, 0.0, 1.25]], np.eye(3), [True, True, False]).tolist()
    [[-0.25, 0.0, 0.0], [-0.25, 0.0, 1.25]]
    """
    vectors = np.asarray(dr, dtype=float)
    box = np.asarray(cell, dtype=float)
    dim = vectors.shape[-1] if vectors.ndim else 0
    if box.shape != (dim, dim):
        raise ValueError(f"cell must have shape ({dim}, {dim}) as dr demands, got {box.shape}")
    periodic = np.broadcast_to(np.asarray(True if pbc is None else pbc, bool), dim)
    found = hs.nearest(
        np.zeros((1, dim)), 1, queries=-vectors.reshape(-1, dim), box=box, periodic=periodic,
        quantities="D",
    )  # fmt: skip
    return found.reshape(vectors.shape)


def first_neighbours(nat: int, i: npt.ArrayLike) -> npt.NDArray[np.int32]:
    """Where the neighbours of each atom begin; see ``matscipy.neighbours.first_neighbours``.

    As there, it is -1, not 0, for atoms before the first one that has neighbours. ValueError if `i`
    does not ascend from 0 or more, where matscipy returns something.

    Examples
    --------
    >>> from halfshell.compat.matscipy import first_neighbours
    >>> first_neighbours(4, [0, 0, 2]).tolist()
    [0, 2, 2, 3, 3]
    >>> first_neighbours(3, [1, 1, 2]).tolist()
    [-1, 0, 2, 3]
    """
    nat, rows = operator.index(nat), np.asarray(i).astype(np.int64)
    if rows.ndim != 1 or (np.diff(rows, prepend=0) < 0).any():
        raise ValueError("i must be one row of numbers that ascend, from 0 or more")
    first = np.searchsorted(rows, np.arange(nat + 1)).astype(np.int32)
    if len(rows):
        first[: min(int(rows[0]), max(nat, 0))] = -1
    return first


def get_jump_indicies(sorted: npt.ArrayLike) -> npt.NDArray[np.int32]:
    """Where each number begins in a list; see ``matscipy.neighbours.get_jump_indicies``.

    ValueError if the list does not ascend from 0 in steps of at most 1; matscipy then returns what
    was in memory.

    Examples
    --------
    >>> from halfshell.compat.matscipy import get_jump_indicies
    >>> get_jump_indicies([0, 0, 1, 1, 1]).tolist()
    [0, 2, 5]
    """
    rows = np.asarray(sorted).astype(np.int64)
    steps = np.diff(rows)
    if rows.ndim != 1 or rows[:1].any() or ((steps < 0) | (steps > 1)).any():
        raise ValueError("the numbers must be one row that ascends from 0 in steps of at most 1")
    return first_neighbours(int(rows[-1]) + 1 if len(rows) else 1, rows)


def triplet_list(
    first_neighbours: npt.ArrayLike,
    abs_dr_p: npt.ArrayLike | None = None,
    cutoff: float | None = None,
    i_p: npt.ArrayLike | None = None,
    j_p: npt.ArrayLike | None = None,
) -> tuple[npt.NDArray[np.int32], ...]:
    """Find pairs of pairs with the same first atom; see ``matscipy.neighbours.triplet_list``.

    Examples
    --------
    >>> from halfshell.compat.matscipy import triplet_list
    >>> ij, ik = triplet_list([0, 2, 2, 3])
    >>> ij.tolist(), ik.tolist()
    ([0, 1], [1, 0])
    """
    if (abs_dr_p is None or cutoff is None) and (i_p is None or j_p is None):
        found = _core.triplets(first_neighbours)
        if found is not None:
            return found

    from halfshell._convert.arrays import starts_of
    from halfshell._objects.neighbor_table import triplets_of

    starts = np.maximum(np.asarray(first_neighbours).astype(np.int64), 0)
    if abs_dr_p is None or cutoff is None:
        ij, ik = triplets_of(starts, True)
    else:
        near = np.asarray(abs_dr_p) < cutoff
        kept = np.flatnonzero(near)
        ij, ik = triplets_of(starts_of(near)[starts], True)
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
