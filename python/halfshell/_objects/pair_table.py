# SPDX-License-Identifier: BSD-3-Clause
"""`PairTable`: every pair of nodes of a connectivity, once; `PairField`: numbers for each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell import _show
from halfshell._convert.arrays import as_array, as_real_array, of_shape
from halfshell._convert.foreign import is_a, kind_of, shown
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.options import as_count, as_dtype, as_whole
from halfshell._errors import StaleError

if TYPE_CHECKING:
    from halfshell._convert.types import FloatArray
    from halfshell._objects.node_list import Nodes

    Ints = npt.NDArray[np.int32]


class Pair(NamedTuple):
    """Two nodes, each by its number in its list and by its list."""

    i_node: int
    i_list: int
    j_node: int
    j_list: int


@_show.shown
class Columns(NamedTuple):
    """Both nodes of all pairs, and S where there is a box that repeats."""

    i_node: Ints
    i_list: Ints
    j_node: Ints
    j_list: Ints
    shifts: Ints | None


class PairTable:
    """Every pair of nodes that are neighbours, each once.

    Made by `Connectivity`, as its attribute ``pairs``. Only `coupling` can be changed; all other
    arrays are read-only, and made from the rows when you first access one of them.

    Attributes
    ----------
    i_node, i_list, j_node, j_list : ndarray of int32, shape (m,)
        The numbers of both nodes in their lists, and of their lists.
    shifts : ndarray of int32, shape (m, d)
        S of each pair, in a periodic box: D = x_j - x_i + S @ box.
    coupling : ndarray of float64, shape (m,)
        A number for each pair, 1 at first. It takes no memory, and cannot be written to, until
        it is assigned to: ``pairs.coupling = 1.0``.

    Raises
    ------
    AttributeError
        If there are no shifts.

    See Also
    --------
    PairField : numbers of your own for each pair.

    Notes
    -----
    The lower (list, node) comes first, but an internal node comes before a ghost. Pairs ascend by
    the lower and the higher of the two. With ``order="morton"`` both go by the order of the nodes
    on the Z curve. With the rules "gather" and "scatter", (i, j) is there if j is in the row of i,
    and (j, i) is another pair; pairs ascend by i and j.

    ``pairs[k]`` is pair k as a tuple (i_node, i_list, j_node, j_list), and ``len(pairs)`` the
    number of pairs.

    Examples
    --------
    >>> import halfshell as hs
    >>> c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0]], [1.0, 1.0]),
    ...                      hs.NodeList("b", [[2.5]], [1.0])])
    >>> c.pairs
    PairTable(2 pairs)
    >>> c.pairs[1]
    Pair(i_node=1, i_list=0, j_node=0, j_list=1)
    >>> c.pairs.index((0, 1, 1, 0))
    1
    """

    __slots__ = ("__weakref__", "_columns", "_coupling", "_keys", "_make", "_nodes", "_outdated")

    def __init__(self, nodes: Nodes, make: Callable[[], Columns]) -> None:
        self._nodes = nodes
        self._make: Callable[[], Columns] | None = make
        self._columns: Columns | None = None
        self._coupling: FloatArray | None = None
        self._keys: npt.NDArray[np.int64] | None = None
        self._outdated: str | None = None  # by what

    @property
    def _made(self) -> Columns:
        """The columns, which are made when they are first looked at."""
        make = self._make  # before the columns are looked at, which come before it goes
        columns = self._columns
        if columns is None:
            assert make is not None
            self._columns = columns = make()
            self._make = None
        return columns

    i_node: Ints = _show.attribute("_made.i_node")
    i_list: Ints = _show.attribute("_made.i_list")
    j_node: Ints = _show.attribute("_made.j_node")
    j_list: Ints = _show.attribute("_made.j_list")

    @property
    def shifts(self) -> Ints:
        shifts = self._made.shifts
        if shifts is None:
            raise AttributeError("these pairs have no shifts: there is no periodic box")
        return shifts

    @property
    def coupling(self) -> FloatArray:
        if self._coupling is None:
            ones: FloatArray = np.broadcast_to(np.ones(()), (len(self),))
            return ones
        return self._coupling

    @coupling.setter
    def coupling(self, values: npt.ArrayLike) -> None:
        array = as_real_array(values, "coupling", "be a number", flags=True)
        must = f"coupling must be a number or have shape ({len(self)},)"
        of_shape(must, (), (len(self),))(array.shape)
        self._coupling = np.array(np.broadcast_to(array, (len(self),)), np.float64)

    def __len__(self) -> int:
        return len(self.i_node)

    def __getitem__(self, k: int) -> Pair:
        k = self._number(k)
        return Pair(*(int(column[k]) for column in self._made[:4]))

    def __iter__(self) -> Iterator[Pair]:
        return (self[k] for k in range(len(self)))

    _repr_html_ = _show.html

    def __repr__(self) -> str:
        return f"PairTable({len(self)} pair{'s' * (len(self) != 1)})"

    def view(self) -> npt.NDArray[Any]:
        """All pairs as a new structured array, with the fields i_node, i_list, j_node, j_list of
        int32 and coupling of float64.
        """
        names = Columns._fields[:4]
        table = np.empty(len(self), [*((name, np.int32) for name in names), ("coupling", float)])
        for name in (*names, "coupling"):
            table[name] = getattr(self, name)
        return table

    def index(self, pair: npt.ArrayLike, shift: npt.ArrayLike | None = None) -> Any:
        """The position of a pair in the table, with its nodes in any order.

        Parameters
        ----------
        pair : array_like of int, shape (4,) or (k, 4)
            (i_node, i_list, j_node, j_list), or several such rows. With the rules "gather" and
            "scatter" the order counts.
        shift : array_like of int, shape (d,), optional
            S of a single pair that the table has in several images.

        Returns
        -------
        int, or ndarray of int64, shape (k,)
            By binary search: the first call makes an index of 8 bytes per pair.

        Raises
        ------
        KeyError
            If a pair is not in the table.
        TypeError, ValueError
            If these are not pairs, a pair occurs in several images and `shift` does not tell
            which, or `shift` is given without a periodic box.
        """
        rows, nodes = as_pair_rows(pair, "pair", single=True), self._nodes
        if not nodes.exist(rows).all():
            raise KeyError(f"there is no such node: {pair!r}")
        if self._keys is None:
            self._keys = nodes.keys_of(*nodes.ranks_of(self._made))
        wanted = nodes.keys_of(*nodes.ranks_of(rows.T))
        first = np.searchsorted(self._keys, wanted)
        end = np.searchsorted(self._keys, wanted, side="right")
        for k in np.flatnonzero(first == end):
            raise KeyError(f"{tuple(rows[k].tolist())} is no pair")
        if shift is not None:
            return self._index_of_image(int(first[0]), int(end[0]), rows, shift)
        for k in np.flatnonzero(end - first > 1):
            several = tuple(rows[k].tolist())
            raise ValueError(f"{several} is a pair in several images: choose one by shift")
        return int(first[0]) if np.ndim(pair) == 1 else first.astype(np.int64)

    def _index_of_image(self, first: int, end: int, rows: npt.NDArray[Any], shift: Any) -> int:
        """The place, from first to end, of a pair and a shift."""
        given, shifts = as_array(shift, "shift"), self._made.shifts
        if shifts is None:
            raise ValueError("shift is for periodic boxes: these pairs have none")
        if given.dtype.kind not in "iu" or given.shape != shifts.shape[1:] or len(rows) != 1:
            raise ValueError(
                f"shift must be {shifts.shape[1]} whole numbers, and pair a single one"
            )
        pair = tuple(rows[0].tolist())
        turned = (*pair[2:], *pair[:2])
        for k in range(first, end):
            image = shifts[k].astype(np.int64)
            if self[k] == pair and (image == given).all():
                return k
            if not self._nodes.directed and self[k] == turned and (image == -given).all():
                return k
        raise KeyError(f"there is no pair of these nodes with the shift {given.tolist()}")

    def _number(self, k: Any) -> int:
        number = as_whole(k, "the number of a pair")
        if not -len(self) <= number < len(self):
            raise IndexError(f"there are {len(self)} pairs, got {shown(number)}")
        return number % len(self)


def as_pair_rows(values: Any, name: str, single: bool = False) -> npt.NDArray[np.int64]:
    """Rows (i_node, i_list, j_node, j_list); single: one such row is as good."""
    array = as_array(values, name)
    if array.shape == (0,) and not single:
        return np.empty((0, 4), np.int64)
    if array.size and array.dtype.kind not in "iu":
        raise TypeError(f"{name} must hold whole numbers, got dtype {array.dtype}")
    if array.ndim not in ((1, 2) if single else (2,)) or array.shape[-1] != 4:
        shapes = "(4,) or (k, 4)" if single else "(k, 4)"
        raise ValueError(
            f"{name} must have shape {shapes}: i_node, i_list, j_node, j_list; got {array.shape}"
        )
    if array.dtype == np.uint64:  # those that int64 does not have are no numbers of nodes or lists
        array = np.minimum(array, np.uint64(2**63 - 1))
    return np.atleast_2d(array).astype(np.int64)


# ---- numbers for each pair -------------------------------------------------------------------

class PairField:
    """One value, or several, for each pair of a `PairTable`.

    Parameters
    ----------
    pairs : PairTable
        The pairs of a connectivity.
    dtype : dtype_like, default numpy.float64
        Type of the values.
    n_elements : int, default 1
        Values for each pair.

    Attributes
    ----------
    values : ndarray of `dtype`, shape (m,), or (m, n_elements) if there are several
        All values, zero at first; can be written to.
    pairs : PairTable

    Raises
    ------
    StaleError
        On every access after the connectivity has been rebuilt or patched, or pairs have been
        removed. An array taken from `values` before that is a plain NumPy array, and stays.

    Notes
    -----
    ``field[k]`` is the value of pair k, or its row of values; ``field[i_node, i_list, j_node,
    j_list]`` that of a pair, as `PairTable.index` finds it. Slices, masks and arrays of numbers
    select as they do in ``values``. All of them can be assigned to.

    Examples
    --------
    >>> import halfshell as hs
    >>> c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0], [2.0]], [0.5] * 3)])
    >>> force = hs.PairField(c.pairs)
    >>> force[0, 0, 1, 0] = 2.5
    >>> force[1, 0, 0, 0], force[0], force.values.tolist()
    (np.float64(2.5), np.float64(2.5), [2.5, 0.0])
    """

    __slots__ = ("_pairs", "_values", "n_elements")

    def __init__(
        self, pairs: PairTable, dtype: npt.DTypeLike = np.float64, n_elements: int = 1
    ) -> None:
        if not is_a(pairs, PairTable):
            raise TypeError(f"pairs must be a PairTable, got {kind_of(pairs)}")
        self.n_elements = as_count(n_elements, "n_elements")
        self._pairs = pairs
        self._refuse_stale()
        refuse_unavailable(
            len(pairs) * self.n_elements, f"values with n_elements = {shown(n_elements)}"
        )
        shape = (len(pairs),) if self.n_elements == 1 else (len(pairs), self.n_elements)
        self._values: npt.NDArray[Any] = np.zeros(
            shape, as_dtype(dtype, "dtype", "one of NumPy's")
        )

    @property
    def values(self) -> npt.NDArray[Any]:
        self._refuse_stale()
        return self._values

    @property
    def pairs(self) -> PairTable:
        self._refuse_stale()
        return self._pairs

    def __len__(self) -> int:
        return len(self.values)

    def __iter__(self) -> Iterator[Any]:
        return iter(self.values)

    _repr_html_ = _show.html

    def __repr__(self) -> str:
        state = ", stale: its pairs are no more" if self._pairs._outdated else ""
        return f"PairField({len(self._values)} x {self.n_elements} {self._values.dtype}{state})"

    def __getitem__(self, key: Any) -> Any:
        return self.values[self._place(key)]

    def __setitem__(self, key: Any, value: Any) -> None:
        self.values[self._place(key)] = value

    def zero(self) -> None:
        """Set all values to zero."""
        self.values[...] = 0

    def copy(self) -> PairField:
        """Another field of these pairs, with the same values."""
        other = PairField(self.pairs, self._values.dtype, self.n_elements)
        other._values[...] = self._values
        return other

    def _place(self, key: Any) -> Any:
        if is_a(key, Pair) or (is_a(key, tuple) and len(key) == 4):
            return self._pairs.index(key)
        return key

    def _refuse_stale(self) -> None:
        if self._pairs._outdated is not None:
            raise StaleError(
                f"this field belongs to pairs before {self._pairs._outdated}(): "
                "make a new PairField of Connectivity.pairs"
            )
