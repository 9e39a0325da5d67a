# SPDX-License-Identifier: BSD-3-Clause
"""Stand-ins for `ase.neighborlist`: the same calls, answered by `halfshell.neighbors`.

As in ASE a pair counts below its cutoff, not at it. In ASE rounded distances decide, here the real
numbers do. Entries are sorted by (i, j, S), where ASE promises i alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

try:
    import ase.neighborlist as original
    from ase.data import atomic_numbers
    from ase.neighborlist import first_neighbors, natural_cutoffs
except ImportError as error:  # pragma: no cover
    raise ImportError("halfshell.compat.ase needs ASE: pip install ase") from error

from halfshell._functions.neighbors import neighbors

__all__ = [
    "NeighborList",
    "NewPrimitiveNeighborList",
    "PrimitiveNeighborList",
    "first_neighbors",
    "natural_cutoffs",
    "neighbor_list",
    "primitive_neighbor_list",
]

_LETTERS = "ijdDS"
_NAMES = {"j": "indices", "d": "distances", "D": "vectors", "S": "shifts"}


class _Reach:
    """What a cutoff means: keywords of `neighbors`, and which atoms reach themselves."""

    def __init__(self, cutoff: Any, n: int, numbers: Any) -> None:
        self.cutoff: Any = cutoff
        self.options: dict[str, Any] = {}
        if isinstance(cutoff, Mapping):
            if numbers is None:
                raise TypeError("cutoffs of elements need the numbers of the atoms")
            self._by_number(cutoff, np.asarray(numbers))
        elif np.ndim(cutoff) == 0:
            self.itself = np.full(n, float(cutoff) > 0.0)
        else:
            radii = np.asarray(cutoff)
            self.cutoff, self.options = None, {"radii": radii}
            self.itself = radii > 0.0

    def _by_number(self, cutoff: Mapping[Any, float], numbers: npt.NDArray[Any]) -> None:
        kinds, types = np.unique(numbers, return_inverse=True)
        table = np.zeros((len(kinds), len(kinds)))  # no distance is below 0
        place = {int(number): t for t, number in enumerate(kinds)}
        for (a, b), length in cutoff.items():
            p, q = (place.get(atomic_numbers.get(x, x)) for x in (a, b))
            if p is not None and q is not None:
                table[p, q] = table[q, p] = length
        self.cutoff, self.options = table, {"types": types}
        self.itself = table.diagonal()[types] > 0.0


def _with_atoms_themselves(
    columns: dict[str, npt.NDArray[Any]], itself: npt.NDArray[np.bool_]
) -> dict[str, npt.NDArray[Any]]:
    """The entries with (i, i, 0) for these atoms, where (i, j, S) has its place for them."""
    atoms = np.flatnonzero(itself)
    i, j, shifts = columns["i"], columns["j"], columns["S"]
    negative = np.zeros(len(i), np.bool_)  # is the first entry of S that is not 0 negative?
    for k in range(3):
        negative = np.where((shifts[:, :k] == 0).all(1) & (shifts[:, k] < 0), True, negative)
    before = (j < i) | ((j == i) & negative)
    row = np.searchsorted(i, atoms)
    place = row + np.bincount(i[before], minlength=len(itself))[atoms]
    put = {"i": atoms, "j": atoms}
    return {
        name: np.insert(column, place, put.get(name, 0), axis=0)
        for name, column in columns.items()
    }


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
    """All neighbours of each atom, as `ase.neighborlist.primitive_neighbor_list` lists them.

    Parameters
    ----------
    quantities : str
        Some of ``i j d D S``, in any order.
    pbc : sequence of bool or bool
    cell : (3, 3) array_like
        Box vectors in rows.
    positions : (n, 3) array_like
    cutoff : float, dict or (n,) array_like
        One cutoff; one for each two elements, by numbers or symbols; or radii, whose sums count.
        Pairs of elements that are not in the dict are no neighbours.
    numbers : (n,) array_like of int, optional
        Atomic numbers, for a dict.
    self_interaction : bool, default False
        Whether an atom within its cutoff of itself is its own neighbour with S = 0.
    use_scaled_positions : bool, default False
        Whether `positions` are multiples of the box vectors.
    max_nbins : float
        Not looked at: memory follows the atoms here.

    Returns
    -------
    ndarray or tuple of ndarray
        i, j int64 (m,); d float64 (m,); D float64 (m, 3); S int64 (m, 3), with
        ``D = positions[j] - positions[i] + S @ cell``; sorted by (i, j, S).

    Raises
    ------
    TypeError
        For a dict without `numbers`.
    ValueError
        For any other letter, and for what `halfshell.neighbors` refuses: NaN, a negative cutoff,
        box vectors that are linearly dependent.

    Examples
    --------
    >>> import numpy as np
    >>> from halfshell.compat.ase import primitive_neighbor_list
    >>> i, j, S = primitive_neighbor_list("ijS", True, np.eye(3), [[0.5, 0.5, 0.5]], 1.01)
    >>> len(i), S[0].tolist()
    (6, [-1, 0, 0])
    """
    if set(quantities) - set(_LETTERS):
        raise ValueError("Unsupported quantity specified.")
    points = np.asarray(positions, np.float64).reshape(-1, 3)
    if use_scaled_positions:
        points = points @ np.asarray(cell)
    n = len(points)
    reach = _Reach(cutoff, n, numbers) if n > 0 else None
    wanted = set(quantities) | {"j"} | ({"S"} if self_interaction else set())
    if reach is None:
        columns: dict[str, npt.NDArray[Any]] = {
            "i": np.zeros(0, np.int64), "j": np.zeros(0, np.int64), "d": np.zeros(0),
            "D": np.zeros((0, 3)), "S": np.zeros((0, 3), np.int64),
        }  # fmt: skip
    else:
        letters = "".join(letter for letter in "jdDS" if letter in wanted)
        table = neighbors(
            points, reach.cutoff, box=cell, periodic=pbc, quantities=letters, inclusive=False,
            **reach.options,
        )  # fmt: skip
        columns = {letter: getattr(table, _NAMES[letter]) for letter in letters}
        columns["i"] = np.repeat(np.arange(n), np.diff(table.offsets))
        if self_interaction:
            columns = _with_atoms_themselves(columns, reach.itself)
    if "S" in columns:
        columns["S"] = columns["S"].astype(np.int64)
    found = tuple(_own(columns[letter]) for letter in quantities)
    return found[0] if len(found) == 1 else found


def _own(column: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Tables may not be written to; what ASE returns may."""
    return column if column.flags.writeable else column.copy()


def neighbor_list(
    quantities: str, a: Any, cutoff: Any, self_interaction: bool = False, max_nbins: float = 1e6
) -> Any:
    """All neighbours of each atom of `ase.Atoms`: see `primitive_neighbor_list`.

    Parameters
    ----------
    quantities, cutoff, self_interaction, max_nbins
        As in `primitive_neighbor_list`.
    a : ase.Atoms
        Its positions, cell (completed where vectors are zero), pbc and numbers are used.

    Returns
    -------
    ndarray or tuple of ndarray
        As `primitive_neighbor_list`.

    Raises
    ------
    ValueError
        As `primitive_neighbor_list`.

    Examples
    --------
    >>> from ase.build import bulk
    >>> from halfshell.compat.ase import neighbor_list
    >>> i, d = neighbor_list("id", bulk("Cu", "fcc", a=3.6), 2.6)
    >>> len(i), round(float(d.mean()), 4)
    (12, 2.5456)
    """
    return primitive_neighbor_list(
        quantities, a.pbc, a.get_cell(complete=True), a.positions, cutoff, a.numbers,
        self_interaction,
    )  # fmt: skip


class PrimitiveNeighborList(original.NewPrimitiveNeighborList):
    """`ase.neighborlist.PrimitiveNeighborList`, and the newer one, with lists made here.

    Parameters, attributes and methods are those of ASE: a list is built with cutoff radii that are
    `skin` larger, and again once an atom has moved by more than `skin` since. Neighbours of each
    atom come in the order of (j, S).

    Examples
    --------
    >>> from ase.build import bulk
    >>> from halfshell.compat.ase import PrimitiveNeighborList
    >>> atoms = bulk("Cu", "fcc", a=3.6)
    >>> found = PrimitiveNeighborList([1.3], skin=0.0, self_interaction=False, bothways=True)
    >>> found.update(atoms.pbc, atoms.cell, atoms.positions), len(found.get_neighbors(0)[0])
    (True, 12)
    """

    def build(self, pbc: Any, cell: Any, positions: Any, numbers: Any = None) -> None:
        """Build the list for these positions."""
        self.pbc = np.array(pbc, copy=True)
        self.cell = np.array(cell, copy=True)
        self.positions = np.array(positions, copy=True)
        i, j, shifts = primitive_neighbor_list(
            "ijS", pbc, cell, positions, self.cutoffs, numbers, self.self_interaction,
            self.use_scaled_positions,
        )  # fmt: skip
        if not self.bothways:  # S points forwards, or atoms of one image ascend
            first = shifts[np.arange(len(i)), (shifts != 0).argmax(1)]
            kept = (first > 0) | ((first == 0) & (i <= j))
            i, j, shifts = i[kept], j[kept], shifts[kept]
        self.pair_first, self.pair_second, self.offset_vec = i, j, shifts
        self.first_neigh = first_neighbors(len(self.positions), i)
        self.nupdates += 1

    @property
    def neighbors(self) -> list[npt.NDArray[Any]]:
        """Of each atom: the other atoms."""
        return [self.get_neighbors(a)[0] for a in range(len(self.positions))]

    @property
    def displacements(self) -> list[npt.NDArray[Any]]:
        """Of each atom: the shifts of the others."""
        return [self.get_neighbors(a)[1] for a in range(len(self.positions))]


NewPrimitiveNeighborList = PrimitiveNeighborList


class NeighborList(original.NeighborList):
    """`ase.neighborlist.NeighborList` with `PrimitiveNeighborList` of this module as default.

    Examples
    --------
    >>> from ase.build import molecule
    >>> from halfshell.compat.ase import NeighborList, natural_cutoffs
    >>> water = molecule("H2O")
    >>> found = NeighborList(natural_cutoffs(water), self_interaction=False, bothways=True)
    >>> found.update(water), found.get_neighbors(0)[0].tolist()
    (True, [1, 2])
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
