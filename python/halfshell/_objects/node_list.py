# SPDX-License-Identifier: BSD-3-Clause
"""`NodeList`: the nodes of one material, with their supports."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from halfshell import _core, _show
from halfshell._convert.arrays import as_array, in_order
from halfshell._convert.foreign import kind_of
from halfshell._convert.options import as_whole
from halfshell._convert.scene import as_points
from halfshell._objects.node_planes import are_parallel, as_plane, touched_by
from halfshell._objects.node_supports import as_extent, as_supports, reach_of

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._convert.types import ArrayLike, FloatArray


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

    Raises
    ------
    TypeError
        If an argument is of the wrong kind.
    ValueError
        If a shape does not fit, a position is not finite, a support is negative, not finite, out
        of range or not a symmetric positive definite matrix, or `n_ghost` is less than 0 or more
        than n.

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
        if not isinstance(name, str):
            raise TypeError(f"name must be a string, got {kind_of(name)}")
        points = as_points(positions, "positions")
        n = len(points)
        self.name = name
        self.is_anywhere = n == 0 and np.ndim(cast("Any", positions)) == 1
        self.positions = _locked(in_order(points, np.float64))
        _refuse_infinite(self.positions)
        self.H = _locked(as_supports(H, n, self.positions.shape[1]))
        self.n_ghost = _as_ghosts(n_ghost, n)
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

        Raises
        ------
        ValueError
            If a shape does not fit, a number is not finite, a normal is zero, or the planes are
            not parallel.

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
        factor = as_extent(extent)
        point, normal = as_plane(enter, "enter", d)
        other, other_normal = as_plane(exit, "exit", d)
        if not are_parallel(normal, other_normal):
            raise ValueError("enter and exit must be parallel planes")
        near = np.flatnonzero(touched_by(self.positions, self.H, factor, point, normal))
        images = self.positions[near] + (other - point)
        _refuse_infinite(images)
        found = _core.pairs_between(
            self.positions, np.inf, None, 0, True, "exact", None, None, None, None, "j", False, 8,
            None, images, reach_of("max", self.H, factor, self.H[near]), "auto",
        )  # fmt: skip
        return near, np.unique(found)


def _locked(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A view that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


def _refuse_infinite(points: FloatArray) -> None:
    for i, k in np.argwhere(~np.isfinite(points)):
        raise ValueError(f"positions must be finite, got positions[{i}, {k}] = {points[i, k]}")


def _as_ghosts(value: Any, n: int) -> int:
    number = as_whole(value, "n_ghost")
    if not 0 <= number <= n:
        raise ValueError(f"n_ghost must be from 0 to {n}, the number of nodes, got {number}")
    return number


def _as_ids(values: Any, n: int) -> npt.NDArray[np.int64]:
    array = as_array(values, "ids")
    if array.size == 0 and n == 0:
        return np.empty(0, np.int64)
    if array.dtype.kind not in "iu":
        raise TypeError(f"ids must be whole numbers, got dtype {array.dtype}")
    if array.shape != (n,):
        raise ValueError(f"ids must have shape ({n},), one for each node, got {array.shape}")
    if array.dtype == np.uint64 and (array > np.iinfo(np.int64).max).any():
        raise OverflowError("ids must be less than 2**63")
    return np.ascontiguousarray(array, np.int64)
