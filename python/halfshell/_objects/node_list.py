# SPDX-License-Identifier: BSD-3-Clause
"""`NodeList`: the nodes of one material, with their supports; and the nodes of several lists.

Nodes are numbered by list and node, among all nodes, and by rank. A node's number counts the nodes
of the lists before its own, too. Its rank is its place in the order of rows and pairs: that number,
or its place on the Z curve.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from halfshell import _core, _show
from halfshell._convert.arrays import (
    as_array,
    as_real_array,
    in_order,
    of_shape,
    one_each,
    refuse_where,
    starts_of,
)
from halfshell._convert.call import RULES, Known, Pairing
from halfshell._convert.foreign import is_a, kind_of, shown
from halfshell._convert.lengths import check_lengths
from halfshell._convert.options import as_whole
from halfshell._convert.points import as_points, as_supports, refuse_infinite
from halfshell._objects.exact import as_fractions, solved
from halfshell._settings import current

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from halfshell._convert.types import ArrayLike, FloatArray

    Array = npt.NDArray[Any]
    Bools = npt.NDArray[np.bool_]
    Ints = npt.NDArray[np.int32]
    Offsets = npt.NDArray[np.int64]

#: Supports whose product with an extent is known to the last bit, and extents that the core takes.
_SUPPORTS, _EXTENTS = (2.0**-500, 2.0**500), (2.0**-64, 2.0**64)
#: Roundings of a distance from a plane, and of a support in its units, relative to their terms.
_PLANE_ERROR = 64 * 2.0**-53
#: Squares of lengths down to this, and of their inverses, are ordinary numbers.
_LEAST = 2.0**-400


class NodeList:
    """The nodes of one list: their positions, and how far their supports reach.

    Parameters
    ----------
    name : str
        Name of the list; the lists of a `Connectivity` need different names.
    positions : array_like of float, shape (n, d)
        Coordinates, any length unit, 1 <= d <= 8; finite. ``[]`` is a list without nodes, in any
        number of dimensions.
    H : array_like of float, shape (n,) or (n, d, d)
        The smoothing length h of each node, in the unit of `positions`: its support holds all
        points within ``extent * h``, as real numbers. 0, or from 2**-500 to 2**500. Or a symmetric
        positive definite matrix for each node, in units of 1 / length, d at most 3: the support
        holds all points with ``|H @ D| <= extent``. The matrix I / h is the same as the length h.
    n_ghost : int, default 0
        Number of ghosts, which are the last nodes: copies of nodes that are elsewhere.
    ids : array_like of int, shape (n,), optional
        Numbers that identify nodes across all lists and processes, int64. A ghost has that of the
        node it copies. Default: their numbers among the nodes of all lists.

    Attributes
    ----------
    name : str
    positions : ndarray of float64, shape (n, d)
        Read-only; the given array itself, if it is float64 in C order.
    H : ndarray of float64, shape (n,) or (n, d, d)
        Read-only.
    ids : ndarray of int64, shape (n,), or None
        Read-only.
    n_nodes, n_internal, n_ghost : int
        Numbers of all nodes, of those that are not ghosts, and of ghosts.

    See Also
    --------
    Connectivity : which nodes of several lists are neighbours.

    Examples
    --------
    >>> import halfshell as hs
    >>> fluid = hs.NodeList("fluid", [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [0.6, 0.6, 0.6],
    ...                     n_ghost=1)
    >>> fluid
    NodeList('fluid', 2 nodes and 1 ghost in 2 dimensions)
    """

    __slots__ = ("H", "ids", "is_anywhere", "n_ghost", "name", "positions")

    def __init__(
        self,
        name: str,
        positions: ArrayLike,
        H: ArrayLike,
        n_ghost: int = 0,
        ids: npt.ArrayLike | None = None,
    ) -> None:
        if not is_a(name, str):
            raise TypeError(f"name must be a string, got {kind_of(name)}")
        points = as_points(positions, "positions")
        n = len(points)
        self.name = name
        self.is_anywhere = n == 0 and np.ndim(cast("Any", positions)) == 1
        self.positions = _locked(in_order(points, np.float64))
        refuse_infinite(self.positions, "positions")
        self.H = _locked(_as_supports(H, n, self.positions.shape[1]))
        self.n_ghost = as_whole(n_ghost, "n_ghost")
        if not 0 <= self.n_ghost <= n:
            must = f"n_ghost must be from 0 to {n}, the number of nodes"
            raise ValueError(f"{must}, got {shown(self.n_ghost)}")
        self.ids = None if ids is None else _locked(_as_ids(ids, n))

    @property
    def n_nodes(self) -> int:
        return len(self.positions)

    @property
    def n_internal(self) -> int:
        return self.n_nodes - self.n_ghost

    def __len__(self) -> int:
        return self.n_nodes

    _repr_html_ = _show.html

    def __repr__(self) -> str:
        ghosts = f" and {self.n_ghost} ghost{'s' * (self.n_ghost != 1)}" if self.n_ghost else ""
        nodes = f"{self.n_internal} node{'s' * (self.n_internal != 1)}"
        d = self.positions.shape[1]
        where = "" if self.is_anywhere else f" in {d} dimension{'s' * (d != 1)}"
        return f"NodeList({self.name!r}, {nodes}{ghosts}{where})"

    def between_planes(
        self,
        enter: tuple[ArrayLike, ArrayLike],
        exit: tuple[ArrayLike, ArrayLike],
        extent: float = 2.0,
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """The nodes that become ghosts at a boundary of two parallel planes, and their partners.

        Nodes that leave through `enter` come back through `exit`: the image of a node is the node
        moved by the vector from the point of the first plane to that of the second.

        Parameters
        ----------
        enter, exit : tuple of (array_like, array_like), each of shape (d,)
            A point of each plane, and its normal, of any length but zero; parallel.
        extent : float, default 2.0
            Supports reach to ``extent * h``.

        Returns
        -------
        near : ndarray of int64
            Nodes whose support touches the plane `enter`, ascending: exactly those with
            ``|n . (x - p)| <= extent * h * |n|``, or ``extent * |inv(H) @ n|``, for the real
            numbers given.
        partners : ndarray of int64
            Nodes that are within reach of the image of one of them, ascending: by the support of
            either, exactly, for the images as float64 rounds them.

        Notes
        -----
        Ghosts count like any other node. Spheral's ``setMasterList`` does the same with two planes.

        Examples
        --------
        >>> import halfshell as hs
        >>> row = hs.NodeList("row", [[0.5], [1.5], [2.5], [3.5]], [0.5] * 4)
        >>> near, partners = row.between_planes(([0.0], [1.0]), ([4.0], [1.0]))
        >>> near.tolist(), partners.tolist()
        ([0], [3])
        """
        d = self.positions.shape[1]
        factor = cast("float", as_extents(extent))
        point, normal = _as_plane(enter, "enter", d)
        other, other_normal = _as_plane(exit, "exit", d)
        a, b = ([Fraction(x) for x in one.tolist()] for one in (normal, other_normal))
        if any(a[k] * b[m] != a[m] * b[k] for k in range(d) for m in range(k)):
            raise ValueError("enter and exit must be parallel planes")
        near = np.flatnonzero(_are_touched(self.positions, self.H, factor, point, normal))
        images = self.positions[near] + (other - point)
        refuse_infinite(images, "positions")
        own = current()
        found = _core.pairs_between(
            known_by(self.positions, self.H), np.inf, None, 0, True, "exact", own.kernel,
            own.memory_limit, None, own.threads, "j", False, 8, None,
            known_by(images, self.H[near]), Pairing(RULES.index("max"), factor), "auto",
        )  # fmt: skip
        return near, np.unique(found)


def as_extents(values: Any, n: int | None = None) -> float | FloatArray:
    """How many times supports count: one for all n lists, also where all are equal, or one each."""
    must = "extent must be a number"
    must += "" if n is None else f" or have shape ({n},), one for each list"
    shapes = [(), *([] if n is None else [(n,)])]
    array = as_real_array(values, "extent", "be a number", of_shape(must, *shapes))
    wrong = ~((array >= _EXTENTS[0]) & (array <= _EXTENTS[1]))
    refuse_where(wrong, array, "extent", "be from 2**-64 to 2**64")
    every = np.unique(array).astype(np.float64)
    if len(every) > 1:
        return in_order(array, np.float64)
    return float(every[0]) if len(every) else 1.0


def known_by(points: Any, supports: FloatArray | None) -> tuple[Any, ...]:
    """Points and their supports, or radii, as the core takes them."""
    is_radii = supports is None or supports.ndim == 1
    return points, *(Known(supports) if is_radii else Known(supports=supports)), None


def _as_supports(values: Any, n: int, d: int) -> FloatArray:
    must = f"H must have shape ({n},) or ({n}, {d}, {d}), one h or matrix for each node"
    given = as_real_array(values, "H", check_shape=of_shape(must, (n,), (n, d, d)))
    if given.ndim == 3:
        supports, own = as_supports(given, n, d, "H"), current()
        try:  # whether they are definite, by a search of no points
            _core.pairs_between(
                np.empty((0, d)), np.inf, None, 0, True, "exact", own.kernel, own.memory_limit,
                None, 1, "j", False, 8, None, known_by(np.zeros((n, d)), supports),
                Pairing(RULES.index("gather"), 1.0), "auto",
            )  # fmt: skip
        except ValueError as error:
            raise ValueError(str(error).replace("query_supports", "H")) from None
        return supports
    supports = in_order(given, np.float64)
    check_lengths(supports, "H")
    least, largest = _SUPPORTS
    wrong = (supports > largest) | ((supports > 0.0) & (supports < least))
    refuse_where(wrong, supports, "H", "be 0 or from 2**-500 to 2**500")
    return supports


def _locked(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    view = array.view()
    view.flags.writeable = False
    return view


def _as_ids(values: Any, n: int) -> npt.NDArray[np.int64]:
    array = as_array(values, "ids")
    if array.size == 0 and n == 0:
        return np.empty(0, np.int64)
    if array.dtype.kind not in "iu":
        raise TypeError(f"ids must be whole numbers, got dtype {array.dtype}")
    one_each("ids", n, "one for each node")(array.shape)
    if array.dtype == np.uint64 and (array > np.iinfo(np.int64).max).any():
        raise OverflowError("ids must be less than 2**63")
    return np.ascontiguousarray(array, np.int64)


# ---- planes -----------------------------------------------------------------------------------

def _as_plane(values: Any, name: str, d: int) -> tuple[FloatArray, FloatArray]:
    """A point and a normal."""
    if not is_a(values, (tuple, list)) or len(values) != 2:
        raise ValueError(f"{name} must be a point and a normal")
    check = of_shape(f"{name} must have a point and a normal of shape ({d},)", (d,))
    point, normal = (
        in_order(as_real_array(one, name, check_shape=check), np.float64) for one in values
    )
    if not (np.isfinite(point).all() and np.isfinite(normal).all() and normal.any()):
        raise ValueError(f"{name} must be finite, and its normal must not be zero")
    return point, normal


def _are_touched(
    positions: FloatArray, supports: FloatArray, extent: float, point: FloatArray,
    normal: FloatArray,
) -> npt.NDArray[np.bool_]:  # fmt: skip
    """Whether each support touches a plane: in floats where these can tell, else in fractions."""
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        terms = (positions - point) * normal
        height, size = np.abs(terms.sum(axis=1)), np.abs(terms).sum(axis=1)
        reach, error = _reach_along(normal, supports, extent)
        margin = _PLANE_ERROR * (size + reach) + error
        within = height < reach - margin
        unsure = ~(within | (height > reach + margin)) | ~np.isfinite(margin)
        unsure |= (size < 2.0**-900) | (reach < 2.0**-900)
        unsure |= not _LEAST < np.abs(normal).max() < 1.0 / _LEAST
    n = as_fractions(normal[:, None])
    for k in np.flatnonzero(unsure):
        terms_of_k = zip(n, positions[k].tolist(), point.tolist(), strict=True)
        exact = sum((a * (Fraction(x) - Fraction(p)) for (a,), x, p in terms_of_k), Fraction(0))
        if supports.ndim == 1:
            along = [[Fraction(float(supports[k])) * a] for (a,) in n]
        else:
            along = solved(as_fractions(supports[k]), n)
        squares = sum((a * a for (a,) in along), Fraction(0))
        within[k] = exact * exact <= Fraction(extent) ** 2 * squares
    found: npt.NDArray[np.bool_] = within
    return found


def _reach_along(
    normal: FloatArray, supports: FloatArray, extent: float
) -> tuple[FloatArray, FloatArray]:
    """How far each support reaches along a normal, times its length, and a bound of the error."""
    if supports.ndim == 1:
        return extent * supports * np.sqrt((normal * normal).sum()), np.zeros(len(supports))
    spread = np.linalg.cond(supports)
    is_sure = spread < 2.0**30
    ordinary = np.where(is_sure[:, None, None], supports, np.eye(len(normal)))
    columns = np.broadcast_to(normal, (len(supports), len(normal)))[:, :, None]
    size = np.linalg.norm(np.linalg.solve(ordinary, columns)[:, :, 0], axis=1)
    is_sure &= (size > _LEAST) & (size < 1.0 / _LEAST)
    reach = extent * size
    return reach, np.where(is_sure, 2.0**-40 * spread, np.inf) * reach


# ---- nodes of several lists ------------------------------------------------------------------

class Nodes:
    """Names, counts, identities and ranks of the nodes of all lists; it does not change.

    counts, ghosts: nodes and ghosts of each list; first: the number of its first node, and at last
    that of all nodes; number: of the node of each rank, int32, or None where ranks are these
    numbers; ids: of each node by its number, or None where they are these numbers; directed:
    whether the pairs (i, j) and (j, i) are two.
    """

    __slots__ = ("_rank", "counts", "directed", "first", "ghosts", "ids", "names", "number")

    def __init__(
        self, names: tuple[str, ...], counts: Offsets, ghosts: Offsets, ids: Offsets | None,
        number: Ints | None, directed: bool,
    ) -> None:  # fmt: skip
        self.names, self.counts, self.ghosts, self.ids = names, counts, ghosts, ids
        self.first = starts_of(counts)
        self.number, self.directed = number, directed
        self._rank: Ints | None = None

    @property
    def n(self) -> int:
        return int(self.first[-1])

    @property
    def n_lists(self) -> int:
        return len(self.names)

    @property
    def internal(self) -> Offsets:
        return self.counts - self.ghosts

    def rank(self, number: Array) -> Array:
        """Ranks of nodes by their numbers."""
        if self.number is None:
            return number
        ranks = self._rank
        if ranks is None:
            ranks = np.empty(self.n, np.int32)
            ranks[self.number] = np.arange(self.n, dtype=np.int32)
            self._rank = ranks  # once it is complete: other threads look
        found: Array = ranks[number]
        return found

    def numbers(self, rank: Array) -> Array:
        return rank if self.number is None else self.number[rank]

    def is_ghost(self, rank: Array) -> Bools:
        flags = np.zeros(self.n, np.bool_)
        for end, ghosts in zip(self.first[1:], self.ghosts, strict=True):
            flags[end - ghosts : end] = True
        found: Bools = flags[self.numbers(rank)]
        return found

    def global_ids(self) -> Offsets:
        return np.arange(self.n) if self.ids is None else self.ids

    def lists(self, flags: int) -> tuple[Offsets, Offsets, Ints | None, int]:
        return self.counts, self.ghosts, self.number, flags

    def keys_of(self, first: Array, second: Array) -> Offsets:
        """A number for each pair of ranks; ascends as half lists do."""
        first, second = first.astype(np.int64), second.astype(np.int64)
        if not self.directed:
            first, second = np.minimum(first, second), np.maximum(first, second)
        keys: Offsets = first * max(self.n, 1) + second
        return keys

    def ranks_of(self, pairs: Any) -> tuple[Array, Array]:
        first = self.first.astype(np.int32)  # as all numbers are, it fits
        i_node, i_list, j_node, j_list = pairs[:4]
        return self.rank(first[i_list] + i_node), self.rank(first[j_list] + j_node)

    def exist(self, rows: Offsets) -> Bools:
        """Of rows (i_node, i_list, j_node, j_list), whether there are such nodes."""
        node, which = rows[:, ::2], rows[:, 1::2]
        known = (which >= 0) & (which < self.n_lists)
        counts = np.append(self.counts, 0)[np.where(known, which, -1)]
        found: Bools = np.all(known & (node >= 0) & (node < counts), axis=1)
        return found


def nodes_of(
    lists: Sequence[NodeList], box: FloatArray | None, directed: bool
) -> tuple[Nodes, FloatArray, FloatArray]:
    """The nodes of these lists, their positions and their supports, list after list."""
    given = [one for one in lists if not one.is_anywhere]
    dims = {one.positions.shape[1] for one in given}
    if len(dims) > 1:
        sizes = ", ".join(f"{one.name!r}: {one.positions.shape[1]}" for one in given)
        raise ValueError(f"lists must have the same number of dimensions, got {sizes}")
    d = dims.pop() if dims else 3
    some = {one.H.ndim: one.name for one in lists if one.n_nodes}
    if len(some) > 1:
        raise ValueError(
            f"H must be lengths in all lists, or matrices in all: {some[3]!r} has matrices, "
            f"{some[1]!r} has lengths, whose 1 / h is usually not a float64"
        )
    counts = np.array([one.n_nodes for one in lists], np.int64)
    if counts.sum() >= 2**31:
        raise OverflowError(f"fewer than 2**31 nodes can be searched, got {counts.sum()}")
    if box is not None:
        if counts.any() and d != len(box):
            raise ValueError(f"nodes must have {len(box)} dimensions, as box has")
        d = len(box)  # lists without nodes have any dimensions
    ids = None
    if any(one.ids is not None for one in lists):
        ids = np.concatenate([
            np.arange(start, start + one.n_nodes) if one.ids is None else one.ids
            for start, one in zip(starts_of(counts), lists, strict=False)
        ])  # fmt: skip
    ghosts = np.array([one.n_ghost for one in lists], np.int64)
    names = tuple(one.name for one in lists)
    nodes = Nodes(names, counts, ghosts, ids, None, directed)
    filled = [one for one in lists if one.n_nodes]
    return (
        nodes, _joined([one.positions for one in filled], (0, d)),
        _joined([one.H for one in filled], (0,)),
    )  # fmt: skip


def _joined(arrays: list[FloatArray], empty: tuple[int, ...]) -> FloatArray:
    if len(arrays) == 1:
        return arrays[0]
    return np.concatenate(arrays) if arrays else np.empty(empty)


def corners_of(points: FloatArray, box: FloatArray | None) -> tuple[FloatArray, FloatArray]:
    if box is None:
        return points.min(axis=0), points.max(axis=0)
    return box[0], box[1]


def morton_number(points: FloatArray, ids: Offsets, box: FloatArray | None) -> Ints:
    """The numbers of all nodes in the order of the Z curve: by key, position, id and number."""
    d = points.shape[1]
    if box is not None and box.shape[1] != d:
        raise ValueError(f"morton_box must have shape (2, {d}), got {box.shape}")
    if len(points) == 0:
        return np.empty(0, np.int32)
    low, high = corners_of(points, box)
    for place in points[((points < low) | (points > high)).any(axis=1)]:
        raise ValueError(
            f"morton_box must hold all nodes, ghosts too: {place.tolist()} is outside"
        )
    keys = _core.morton_keys(points, low, high)
    order = np.argsort(keys, kind="stable")
    same = keys[order[1:]] == keys[order[:-1]]
    tied = np.append(False, same) | np.append(same, False)
    places = np.flatnonzero(tied)
    if len(places):  # the others need no more
        who = order[places]
        order[places] = who[np.lexsort((who, ids[who], *points[who].T[::-1], keys[who]))]
    return order.astype(np.int32)
