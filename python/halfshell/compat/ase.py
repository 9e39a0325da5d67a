# SPDX-License-Identifier: BSD-3-Clause
"""Neighbour lists in place of those of ``ase.neighborlist``.

All have ASE's arguments, units, dtypes and shapes, and its rule: a pair counts if it is closer
than the cutoff, or than the sum of the radii of its two atoms (``<``). Here that is decided for
the exact values of the floats, while ASE compares rounded distances with rounded sums. So the lists
differ if rounding decides ASE's.

The order is ascending (i, j, S), always. ASE promises ascending i alone.

Refused with ValueError, where ASE returns something: coordinates, cells and cutoffs that are not
finite, negative radii, radii that are not one for each atom, and periodic cell vectors that are
linearly dependent. `max_nbins` is accepted and has no effect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from numbers import Real
from typing import Any

import ase.neighborlist as _owner
import numpy as np
import numpy.typing as npt
from ase.cell import Cell
from ase.data import atomic_numbers
from ase.neighborlist import first_neighbors, natural_cutoffs

import halfshell as hs
from halfshell._functions.neighbors import pairs_of_rows

__all__ = [
    "NeighborList",
    "NewPrimitiveNeighborList",
    "PrimitiveNeighborList",
    "build_neighbor_list",
    "first_neighbors",
    "natural_cutoffs",
    "neighbor_list",
    "primitive_neighbor_list",
]

_TYPES = {"i": int, "j": int, "d": float, "D": float, "S": int}


def neighbor_list(
    quantities: str,
    a: Any,
    cutoff: Any,
    self_interaction: bool = False,
    max_nbins: float = 1e6,
) -> Any:
    """Find all neighbours of each atom; see ``ase.neighborlist.neighbor_list``.

    `cutoff` may be a length, a dict of pairs of elements, by symbol or number, where the later of
    two entries for the same pair holds, or a radius for each atom. A length of zero or less has no
    neighbours.

    Examples
    --------
    >>> from ase.build import molecule
    >>> from halfshell.compat.ase import neighbor_list
    >>> i, j = neighbor_list("ij", molecule("H2O"), 1.2)
    >>> i.tolist(), j.tolist()
    ([0, 0, 1, 2], [1, 2, 0, 0])
    >>> neighbor_list("j", molecule("H2O"), {("H", "H"): 1.6}).tolist()
    [2, 1]
    """
    return primitive_neighbor_list(
        quantities, a.pbc, _cell_of(a), a.positions, cutoff,
        numbers=a.numbers, self_interaction=self_interaction, max_nbins=max_nbins,
    )  # fmt: skip


def _cell_of(atoms: Any) -> Any:
    """The cell, with ASE's vectors in place of zeros, which would round a vector that is alone."""
    cell = atoms.get_cell()
    missing = ~cell.any(axis=1)
    if missing.any():
        cell[missing] = atoms.get_cell(complete=True)[missing]
    return cell


def primitive_neighbor_list(
    quantities: str,
    pbc: Any,
    cell: Any,
    positions: Any,
    cutoff: Any,
    numbers: Any = None,
    self_interaction: bool = False,
    use_scaled_positions: bool = False,
    max_nbins: float = 1e6,
) -> Any:
    """Find all neighbours of each point; see ``ase.neighborlist.primitive_neighbor_list``.

    Cell vectors that do not repeat may be zero. Scaled positions times the cell, rounded to float64
    as in ASE, are what is searched.

    Examples
    --------
    >>> import numpy as np
    >>> from halfshell.compat.ase import primitive_neighbor_list
    >>> S = primitive_neighbor_list("S", [True, False, False], np.eye(3), np.zeros((1, 3)), 1.5)
    >>> S.tolist()
    [[-1, 0, 0], [1, 0, 0]]
    """
    letters = list(quantities)
    if not _TYPES.keys() >= set(letters):
        raise ValueError(f"quantities must be of the letters i j d D S, got {quantities!r}")
    if use_scaled_positions and len(positions):
        positions = np.dot(positions, cell)
    arrays = listed(letters, pbc, cell, positions, cutoff, numbers, self_interaction, _TYPES)
    return arrays[0] if len(arrays) == 1 else arrays


def listed(
    letters: Sequence[str],
    pbc: Any,
    cell: Any,
    positions: Any,
    cutoff: Any,
    numbers: Any,
    self_interaction: bool,
    types: Mapping[str, type],
) -> tuple[npt.NDArray[Any], ...]:
    """The arrays of these letters, in these types, and the caller's to write to."""
    n = len(positions)
    if n == 0:
        return tuple(np.empty((0, 3) if one in "DS" else 0, types[one]) for one in letters)
    length, each = reach_of(cutoff, numbers)
    box: dict[str, Any] = {"box": np.asarray(cell), "periodic": pbc}
    points = positions
    if each:
        points, box = hs.Points(positions, **box, **each), {}
    wanted = "".join(letters if len({*letters}) == len(letters) else dict.fromkeys(letters)) or "j"
    # As a query each point finds itself, if its reach is above zero.
    try:
        found = pairs_of_rows(
            points, length, queries=points if self_interaction else None, inclusive=False,
            quantities=wanted, index_dtype=np.int32 if types["j"] is np.int32 else np.int64, **box,
        )  # fmt: skip
    except (TypeError, ValueError):
        hs.Points(points, **box)  # which says by their names what is wrong with these
        raise
    columns = (found,) if len(wanted) == 1 else found
    if types["S"] is not np.int32:
        columns = [one.astype(types[k], copy=False) for k, one in zip(wanted, columns)]
    if len(wanted) == len(letters):
        return tuple(columns)  # in their order
    arrays = dict(zip(wanted, columns))
    return tuple([arrays[letter] for letter in letters])


def reach_of(cutoff: Any, numbers: Any) -> tuple[Any, dict[str, Any]]:
    """The cutoff of halfshell, and what `halfshell.Points` are to know of each atom."""
    if type(cutoff) is float:
        return max(cutoff, 0.0), {}
    if isinstance(cutoff, Mapping):
        if numbers is None:
            raise TypeError("numbers must be given if cutoff is a dict")
        kinds, types = np.unique(np.asarray(numbers), return_inverse=True)
        places = {kind: place for place, kind in enumerate(kinds.tolist())}
        table: dict[tuple[int, int], Any] = {}
        for (one, other), length in cutoff.items():
            a, b = (places.get(atomic_numbers.get(key, key)) for key in (one, other))
            if a is not None and b is not None:
                table[min(a, b), max(a, b)] = _not_negative(length)
        return table, {"types": types}
    if np.ndim(cutoff) == 0:
        return _not_negative(cutoff), {}
    return None, {"radii": cutoff}


def _not_negative(length: Any) -> Any:
    """0 for what is less, within which there are no pairs; all else is for halfshell to judge."""
    length = length[()] if isinstance(length, np.ndarray) else length
    is_number = type(length) is float or isinstance(length, Real)
    return 0.0 if is_number and float(length) < 0.0 else length


class NewPrimitiveNeighborList(_owner.NewPrimitiveNeighborList):
    """A subclass of ``ase.neighborlist.NewPrimitiveNeighborList``, which documents it.

    With ``bothways=False`` each pair is listed once: as the one of (i, j, S) and (j, i, -S) in
    which the first nonzero component of S is positive, or i <= j where S is zero. Neighbours
    ascend by (j, S), also with ``sorted=False``.

    Examples
    --------
    >>> from ase.build import bulk
    >>> from halfshell.compat.ase import NewPrimitiveNeighborList
    >>> atoms = bulk("Cu", "fcc", a=3.6)
    >>> nl = NewPrimitiveNeighborList([1.3], skin=0.0, self_interaction=False)
    >>> nl.update(atoms.pbc, atoms.get_cell(), atoms.positions)
    True
    >>> indices, offsets = nl.get_neighbors(0)
    >>> len(indices)
    6
    """

    def build(self, pbc: Any, cell: Any, positions: Any, numbers: Any = None) -> None:
        """Build the list for these positions, whatever has moved."""
        self.pbc = np.array(pbc, copy=True)
        self.cell = np.array(cell, copy=True)
        self.positions = np.array(positions, copy=True)
        self.pair_first, self.pair_second, self.offset_vec = _half_or_full(self, self.positions)
        self.first_neigh = _starts(self.pair_first, len(self.positions))
        self.nupdates += 1


class PrimitiveNeighborList(_owner.PrimitiveNeighborList):
    """A subclass of ``ase.neighborlist.PrimitiveNeighborList``, which documents it.

    Pairs and their order are those of `NewPrimitiveNeighborList`; ASE's own two classes differ.

    Examples
    --------
    >>> import numpy as np
    >>> from halfshell.compat.ase import PrimitiveNeighborList
    >>> nl = PrimitiveNeighborList([0.5, 0.5], skin=0.1, self_interaction=False)
    >>> nl.update([False, False, False], np.eye(3), np.array([[0, 0, 0], [0, 0, 1.0]]))
    True
    >>> nl.get_neighbors(0)[0].tolist(), nl.get_neighbors(1)[0].tolist()
    ([1], [])
    """

    def build(self, pbc: Any, cell: Any, coordinates: Any) -> None:
        """Build the list for these coordinates, whatever has moved."""
        self.pbc = np.array(pbc, copy=True)
        self.cell = Cell(cell)
        self.coordinates = np.array(coordinates, copy=True)
        i, j, S = _half_or_full(self, self.coordinates)
        starts = _starts(i, len(self.coordinates)).tolist()
        rows = [slice(a, b) for a, b in pairwise(starts)]
        self.neighbors = [j[row] for row in rows]
        self.displacements = [S[row] for row in rows]
        self.nupdates += 1


def _starts(i: npt.NDArray[Any], n: int) -> npt.NDArray[Any]:
    """As `first_neighbors`, whose time grows with the longest run of atoms without neighbours."""
    return np.searchsorted(i, np.arange(n + 1))


def _half_or_full(nl: Any, positions: Any) -> Any:
    """Arrays i, j, S of a list with these attributes."""
    if len(nl.cutoffs) != len(positions):
        raise ValueError(f"Wrong number of cutoff radii: {len(nl.cutoffs)} != {len(positions)}")
    i, j, S = primitive_neighbor_list(
        "ijS", nl.pbc, np.asarray(nl.cell), positions, nl.cutoffs,
        self_interaction=nl.self_interaction, use_scaled_positions=nl.use_scaled_positions,
    )  # fmt: skip
    if nl.bothways:
        return i, j, S
    x, y, z = S.T
    first = np.where(x != 0, x, np.where(y != 0, y, z))
    kept = (first > 0) | ((first == 0) & (i <= j))
    return i[kept], j[kept], S[kept]


class NeighborList(_owner.NeighborList):
    """A subclass of ``ase.neighborlist.NeighborList``, which documents it.

    ASE's own classes work as `primitive`, too.

    Examples
    --------
    >>> from ase.build import molecule
    >>> from halfshell.compat.ase import NeighborList
    >>> atoms = molecule("CO")
    >>> nl = NeighborList([0.76, 0.66], self_interaction=False)
    >>> nl.update(atoms)
    True
    >>> indices, offsets = nl.get_neighbors(0)
    >>> indices.tolist(), offsets.tolist()
    ([1], [[0, 0, 0]])
    """

    def __init__(
        self,
        cutoffs: Any,
        skin: float = 0.3,
        sorted: bool = False,
        self_interaction: bool = True,
        bothways: bool = False,
        primitive: Any = PrimitiveNeighborList,
    ) -> None:
        super().__init__(cutoffs, skin, sorted, self_interaction, bothways, primitive)

    def update(self, atoms: Any) -> bool:
        """Take the atoms of the next step; see ``ase.neighborlist.NeighborList.update``."""
        updated: bool = self.nl.update(atoms.pbc, _cell_of(atoms), atoms.positions)
        return updated


def build_neighbor_list(atoms: Any, cutoffs: Any = None, **kwargs: Any) -> NeighborList:
    """Build a `NeighborList` for these atoms; see ``ase.neighborlist.build_neighbor_list``.

    Examples
    --------
    >>> from ase.build import molecule
    >>> from halfshell.compat.ase import build_neighbor_list
    >>> build_neighbor_list(molecule("H2O"), self_interaction=False).get_neighbors(0)[0].tolist()
    [1, 2]
    """
    nl = NeighborList(natural_cutoffs(atoms) if cutoffs is None else cutoffs, **kwargs)
    nl.update(atoms)
    return nl
