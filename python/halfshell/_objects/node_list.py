# SPDX-License-Identifier: BSD-3-Clause
"""`NodeList`: the nodes of one material, with their supports."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from halfshell import _core, _show
from halfshell._convert.arrays import as_array, as_real_array, in_order
from halfshell._convert.foreign import kind_of
from halfshell._convert.lengths import as_positive, check_lengths
from halfshell._convert.options import as_whole
from halfshell._convert.rules import reach_by_radii, reach_by_supports
from halfshell._convert.scene import as_points
from halfshell._convert.supports import MOST_AXES, as_matrices

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._convert.types import ArrayLike, FloatArray, Reach

#: Between these the product with an extent is known to the last bit.
_LEAST_SUPPORT, _LARGEST_SUPPORT = 2.0**-500, 2.0**500
#: Extents that the core takes.
_LEAST_EXTENT, _LARGEST_EXTENT = 2.0**-64, 2.0**64
#: Roundings of a distance from a plane, and of a support in its units, relative to their terms.
_PLANE_ERROR = 64 * 2.0**-53


class NodeList:
    """The nodes of one list: where they are, and how far their supports reach.

    Parameters
    ----------
    name : str
        What the list is called; a `Connectivity` needs names that differ.
    positions : array_like of float, shape (n, d)
        Coordinates, any length unit, 1 <= d <= 8; finite. ``[]`` is a list without nodes, in any
        number of dimensions.
    H : array_like of float, shape (n,) or (n, d, d)
        The smoothing length h of each node, in the unit of `positions`: its support holds all
        points within ``extent * h``, as real numbers. 0, or from 2**-500 to 2**500. Or a symmetric
        positive definite matrix for each node, in units of 1 / length, d at most 3: the support
        holds all points with ``|H @ D| <= extent``. The matrix I / h is the same as the length h.
    n_ghost : int, default 0
        How many nodes, the last ones, are ghosts: copies of nodes that are elsewhere.
    ids : array_like of int, shape (n,), optional
        Numbers that tell nodes of all lists and processes apart, int64. A ghost has that of the
        node it copies. Default: their numbers among the nodes of all lists.

    Attributes
    ----------
    name : str
    positions : ndarray of float64, shape (n, d)
        Read-only; the array that was given, if it is one of float64 in C order.
    H : ndarray of float64, shape (n,) or (n, d, d)
        Read-only.
    ids : ndarray of int64, shape (n,), or None
        Read-only.
    n_nodes, n_internal, n_ghost : int
        Nodes, those that are no ghosts, and ghosts.

    Raises
    ------
    TypeError
        If an argument is of the wrong kind.
    ValueError
        If a shape does not fit, a position is not finite, a support is negative, not finite, out
        of range or no symmetric positive definite matrix, or `n_ghost` is less than 0 or more than
        n.

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
        self.H = _locked(_as_supports(H, n, self.positions.shape[1]))
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
        """The nodes that a boundary of two parallel planes makes ghosts of, and their partners.

        What leaves through `enter` comes back through `exit`: a node's image is the node moved by
        the vector from the point of the first plane to that of the second.

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
        Ghosts count as any other node. This is what Spheral's ``setMasterList`` does with two
        planes.

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
        point, normal = _as_plane(enter, "enter", d)
        other, other_normal = _as_plane(exit, "exit", d)
        if not _are_parallel(normal, other_normal):
            raise ValueError("enter and exit must be parallel planes")
        near = np.flatnonzero(self._touches(point, normal, factor))
        images = self.positions[near] + (other - point)
        _refuse_infinite(images)
        found = _core.pairs_between(
            self.positions, np.inf, None, 0, True, "exact", None, None, None, None, "j", False, 8,
            None, images, reach_of("max", self.H, factor, self.H[near]), "auto",
        )  # fmt: skip
        return near, np.unique(found)

    def _touches(self, point: FloatArray, normal: FloatArray, extent: float) -> npt.NDArray[Any]:
        """Whether each support touches a plane: in floats where these can tell."""
        with np.errstate(over="ignore", invalid="ignore", under="ignore"):
            terms = (self.positions - point) * normal
            height = np.abs(terms.sum(axis=1))
            size = np.abs(terms).sum(axis=1)
            reach, error = _reach_along(normal, self.H, extent)
            margin = _PLANE_ERROR * (size + reach) + error
            within = height < reach - margin
            unsure = ~(within | (height > reach + margin)) | ~np.isfinite(margin)
            unsure |= (size < 2.0**-900) | (reach < 2.0**-900)
        for k in np.flatnonzero(unsure):
            within[k] = _touches_exactly(self.positions[k], point, normal, self.H[k], extent)
        found: npt.NDArray[Any] = within
        return found


def as_extent(value: Any) -> float:
    """How many times supports count."""
    extent = as_positive(value, "extent")
    if not _LEAST_EXTENT <= extent <= _LARGEST_EXTENT:
        raise ValueError(f"extent must be from 2**-64 to 2**64, got {extent}")
    return extent


def _locked(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A view that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


def _refuse_infinite(points: FloatArray) -> None:
    if not np.isfinite(points).all():
        i, k = np.argwhere(~np.isfinite(points))[0]
        raise ValueError(f"positions must be finite, got positions[{i}, {k}] = {points[i, k]}")


def reach_of(
    rule: str, supports: FloatArray, extent: float, of_queries: FloatArray | None = None
) -> Reach:
    """What the core takes for a reach by such supports."""
    if supports.ndim == 1:
        return reach_by_radii(rule, supports, of_queries, extent)
    return reach_by_supports(rule, supports, of_queries, extent)


def _as_supports(values: Any, n: int, d: int) -> FloatArray:
    def check(shape: tuple[int, ...]) -> None:
        if shape not in ((n,), (n, d, d)):
            raise ValueError(
                f"H must have shape ({n},) or ({n}, {d}, {d}), one h or matrix for each node, got "
                f"{shape}"
            )

    given = as_real_array(values, "H", check_shape=check)
    if given.ndim == 3:
        if d > MOST_AXES:
            raise ValueError(f"H can be matrices in 1 to {MOST_AXES} dimensions, got {d}")
        matrices = as_matrices(given, "H", "node", n, d)
        _refuse_indefinite(matrices)
        return matrices
    supports = in_order(given, np.float64)
    check_lengths(supports, "H")
    wrong = (supports > _LARGEST_SUPPORT) | ((supports > 0.0) & (supports < _LEAST_SUPPORT))
    for k in np.flatnonzero(wrong):
        raise ValueError(f"H must be 0 or from 2**-500 to 2**500, got H[{k}] = {supports[k]}")
    return supports


def _refuse_indefinite(matrices: FloatArray) -> None:
    """ValueError for a matrix that is surely not positive definite; the core decides the rest."""
    try:
        np.linalg.cholesky(matrices)
    except np.linalg.LinAlgError:
        for k in np.flatnonzero(np.linalg.eigvalsh(matrices)[:, 0] <= 0.0):
            raise ValueError(
                f"H must be positive definite, got H[{k}] = {matrices[k].tolist()}"
            ) from None


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


def _as_plane(values: Any, name: str, d: int) -> tuple[FloatArray, FloatArray]:
    """A point and a normal."""
    if not isinstance(values, (tuple, list)) or len(values) != 2:
        raise ValueError(f"{name} must be a point and a normal")

    def check(shape: tuple[int, ...]) -> None:
        if shape != (d,):
            raise ValueError(f"{name} must have a point and a normal of shape ({d},), got {shape}")

    point, normal = (
        in_order(as_real_array(one, name, check_shape=check), np.float64) for one in values
    )
    if not (np.isfinite(point).all() and np.isfinite(normal).all() and normal.any()):
        raise ValueError(f"{name} must be finite, and its normal must not be zero")
    return point, normal


def _are_parallel(normal: FloatArray, other: FloatArray) -> bool:
    a, b = ([Fraction(float(x)) for x in one] for one in (normal, other))
    return all(a[k] * b[m] == a[m] * b[k] for k in range(len(a)) for m in range(k))


def _touches_exactly(
    x: FloatArray, point: FloatArray, normal: FloatArray, h: Any, extent: float
) -> bool:
    n = [Fraction(float(one)) for one in normal]
    height = sum(
        (
            a * (Fraction(float(b)) - Fraction(float(c)))
            for a, b, c in zip(n, x, point, strict=True)
        ),
        Fraction(0),
    )
    if np.ndim(h) == 0:
        n = [Fraction(float(h)) * a for a in n]
    else:
        n = _solved([[Fraction(float(a)) for a in row] for row in h], n)
    return height * height <= Fraction(extent) ** 2 * sum((a * a for a in n), Fraction(0))


def _reach_along(
    normal: FloatArray, supports: FloatArray, extent: float
) -> tuple[FloatArray, FloatArray]:
    """How far each support reaches along a normal, times its length, and a bound of the error."""
    if supports.ndim == 1:
        return extent * supports * np.sqrt((normal * normal).sum()), np.zeros(len(supports))
    spread = np.linalg.cond(supports)
    columns = np.broadcast_to(normal, (len(supports), len(normal)))[:, :, None]
    reach = extent * np.linalg.norm(np.linalg.solve(supports, columns)[:, :, 0], axis=1)
    return reach, np.where(spread < 2.0**30, 2.0**-40 * spread, np.inf) * reach


def _solved(matrix: list[list[Fraction]], right: list[Fraction]) -> list[Fraction]:
    """The solution of a system that has one, by elimination."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    d = len(rows)
    for k in range(d):
        pivot = next(m for m in range(k, d) if rows[m][k] != 0)
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [value / rows[k][k] for value in rows[k]]
        for m in range(d):
            if m != k:
                rows[m] = [a - rows[m][k] * b for a, b in zip(rows[m], rows[k], strict=True)]
    return [row[d] for row in rows]
