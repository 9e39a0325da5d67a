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

from collections.abc import Mapping
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

_EMPTY: dict[str, tuple[type, tuple[int, ...]]] = {
    "i": (int, (0,)),
    "j": (int, (0,)),
    "d": (float, (0,)),
    "D": (float, (0, 3)),
    "S": (int, (0, 3)),
}


def neighbor_list(
    quantities: str,
    a: Any,
    cutoff: Any,
    self_interaction: bool = False,
    max_nbins: float = 1e6,
) -> Any:
    """Find all neighbours of each atom, as ``ase.neighborlist.neighbor_list`` does.

    Parameters
    ----------
    quantities : str
        Letters of what is returned, in their order: i and j, the indices of a pair; d, its
        distance; D, its vector; S, its shift, with
        ``D = a.positions[j] - a.positions[i] + S @ a.cell``. A letter may repeat.
    a : ase.Atoms
        The atoms, with their cell and periodicity. They may lie outside the cell. Cell vectors that
        are zero are completed by ``a.get_cell(complete=True)``, as in ASE.
    cutoff : float, dict or array_like of float, shape (n,)
        In the unit of the positions: one length for all; one for each pair of elements, by symbol
        or atomic number, such as ``{("H", "C"): 1.2, (6, 6): 1.85}``, where other pairs do not
        count and the later of two entries for the same pair holds; or a radius for each atom, whose
        sums are the cutoffs. A length of zero or less has no neighbours; radii are not negative.
    self_interaction : bool, default False
        Whether each atom is its own neighbour, at S = 0 and distance 0, where its cutoff is above
        zero.
    max_nbins : float, optional
        Accepted for ASE's sake, without effect.

    Returns
    -------
    ndarray or tuple of ndarray
        One array for each letter, a bare array for one letter: i, j int64 (m,); d float64 (m,);
        D float64 (m, 3); S int64 (m, 3). The full list, with (i, j, S) and (j, i, -S), ascending
        by (i, j, S).

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As `halfshell.neighbors`; ValueError also for letters that are none of these.

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
        quantities, a.pbc, a.get_cell(complete=True), a.positions, cutoff,
        numbers=a.numbers, self_interaction=self_interaction, max_nbins=max_nbins,
    )  # fmt: skip


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
    """Find all neighbours of each point, as ``ase.neighborlist.primitive_neighbor_list`` does.

    Parameters
    ----------
    quantities, cutoff, self_interaction, max_nbins
        As in `neighbor_list`.
    pbc : bool or sequence of bool, shape (3,)
        Which cell vectors repeat.
    cell : array_like of float, shape (3, 3)
        Cell vectors as rows. Those that do not repeat may be zero.
    positions : array_like of float, shape (n, 3)
        Coordinates, in the unit of the cell.
    numbers : array_like of int, shape (n,), optional
        Atomic numbers, which a dict of cutoffs needs.
    use_scaled_positions : bool, default False
        Whether `positions` are multiples of the cell vectors. Their product with the cell, rounded
        to float64 as in ASE, is what is searched.

    Returns
    -------
    ndarray or tuple of ndarray
        As `neighbor_list`.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As `neighbor_list`; TypeError also for a dict without `numbers`.

    Examples
    --------
    >>> import numpy as np
    >>> from halfshell.compat.ase import primitive_neighbor_list
    >>> S = primitive_neighbor_list("S", [True, False, False], np.eye(3), np.zeros((1, 3)), 1.5)
    >>> S.tolist()
    [[-1, 0, 0], [1, 0, 0]]
    """
    letters = list(quantities)
    if not _EMPTY.keys() >= set(letters):
        raise ValueError(f"quantities must be of the letters i j d D S, got {quantities!r}")
    found: dict[str, npt.NDArray[Any]]
    if len(positions) == 0:
        found = {one: np.empty(shape, dtype) for one, (dtype, shape) in _EMPTY.items()}
    else:
        if use_scaled_positions:
            positions = np.dot(positions, cell)
        length, each = _reach(cutoff, numbers)
        points = hs.Points(positions, box=np.asarray(cell), periodic=pbc, **each)
        wanted = "".join(dict.fromkeys(letters)) or "i"
        # As a query each point finds itself, if its reach is above zero.
        table = hs.neighbors(
            points, length, queries=points if self_interaction else None, inclusive=False,
            quantities=wanted.replace("i", "") or "j",
        )  # fmt: skip
        arrays = table.to_pairs(quantities=wanted)
        columns = arrays if isinstance(arrays, tuple) else (arrays,)
        found = {  # in ASE's type, and the caller's to write to
            one: np.require(array, _EMPTY[one][0], "W")
            for one, array in zip(wanted, columns, strict=True)
        }
    arrays = tuple(found[letter] for letter in letters)
    return arrays[0] if len(arrays) == 1 else arrays


def _reach(cutoff: Any, numbers: Any) -> tuple[Any, dict[str, Any]]:
    """The cutoff of halfshell, and what `halfshell.Points` are to know of each atom."""
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
    return 0.0 if isinstance(length, Real) and float(length) < 0.0 else length


class NewPrimitiveNeighborList(_owner.NewPrimitiveNeighborList):
    """In place of ``ase.neighborlist.NewPrimitiveNeighborList``, of which it is a subclass.

    Parameters, attributes and methods are ASE's. With ``bothways=False`` each pair is listed once:
    as the one of (i, j, S) and (j, i, -S) in which the first nonzero component of S is positive, or
    i <= j where S is zero. Neighbours ascend by (j, S), also with ``sorted=False``.

    Parameters
    ----------
    cutoffs : array_like of float, shape (n,)
        A radius for each atom; atoms whose spheres overlap are neighbours.
    skin : float, default 0.3
        Added to each radius; the list is used again until an atom has moved farther than this.
    sorted : bool, default False
        Without effect, for lists are always sorted.
    self_interaction : bool, default True
        Whether an atom is its own neighbour.
    bothways : bool, default False
        Whether both atoms of a pair have it.
    use_scaled_positions : bool, default False
        Whether positions are multiples of the cell vectors.

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
    """In place of ``ase.neighborlist.PrimitiveNeighborList``, of which it is a subclass.

    Parameters, attributes and methods are ASE's. With ``bothways=False`` each pair is listed once,
    at the same atom as in `NewPrimitiveNeighborList`; ASE does not specify which atom that is, and
    its own two classes differ. Neighbours ascend by (j, S), even with ``sorted=False``.

    Parameters
    ----------
    cutoffs, skin, sorted, self_interaction, bothways, use_scaled_positions
        As for `NewPrimitiveNeighborList`.

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
    """In place of ``ase.neighborlist.NeighborList``, of which it is a subclass.

    Parameters, attributes and methods are ASE's, and so is the skin: until an atom has moved
    farther than it the list of before is returned, with pairs that may be beyond the cutoff.

    Parameters
    ----------
    cutoffs, skin, sorted, self_interaction, bothways
        As for `NewPrimitiveNeighborList`.
    primitive : type, default PrimitiveNeighborList
        The class that does the work. ASE's own classes work too, as they do in ASE.

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


def build_neighbor_list(atoms: Any, cutoffs: Any = None, **kwargs: Any) -> NeighborList:
    """Build a `NeighborList` for these atoms, as ``ase.neighborlist.build_neighbor_list`` does.

    Parameters
    ----------
    atoms : ase.Atoms
        The atoms.
    cutoffs : array_like of float, shape (n,), optional
        A radius for each atom. Default: `natural_cutoffs`.
    **kwargs
        Passed to `NeighborList`.

    Returns
    -------
    NeighborList
        The list, updated for `atoms`.

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
