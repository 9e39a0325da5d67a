# SPDX-License-Identifier: BSD-3-Clause
"""The periodic box as an object: named constructors, its measures, and wrapping."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell import _core, _show
from halfshell._convert.arrays import as_real_array, of_shape
from halfshell._convert.memory import refuse_large
from halfshell._convert.objects import vectors_of
from halfshell._convert.points import (
    LENGTHS_AND_ANGLES,
    MAX_DIM,
    as_box,
    as_periodic_bits,
    as_points,
)
from halfshell._search import document

if TYPE_CHECKING:
    import numpy.typing as npt
    from matplotlib.axes import Axes

    from halfshell._convert.types import ArrayLike, BoxLike, PeriodicLike, PointsLike


class Box:
    """A periodic box, for the `box` argument of all functions.

    Parameters
    ----------
    vectors : array_like of float, shape (d, d) or (d,), or Box
        Box vectors as rows, or edge lengths along the coordinate axes, in the unit of the points;
        1 <= d <= 8. Six bare numbers are refused, as they may be lengths and angles: use
        `from_dimensions`, or `orthorhombic` for six lengths. Any orientation and handedness;
        the vectors must be linearly independent, which is decided exactly.

    Attributes
    ----------
    vectors : ndarray of float64, shape (d, d)
        The box vectors as rows; read-only.

    Raises
    ------
    TypeError
        If the entries are not real numbers, or are long doubles.
    ValueError
        If an entry is not finite, the vectors are exactly linearly dependent, or the shape does
        not fit or is (6,).

    Notes
    -----
    A box is immutable. Boxes with equal vectors are equal, and may be keys of a dict.

    Examples
    --------
    >>> import halfshell as hs
    >>> box = hs.Box.from_lengths_angles((2.0, 3.0, 4.0), (90.0, 90.0, 90.0))
    >>> box.volume
    24.0
    >>> wrapped, shifts = box.wrap([[2.5, -1.0, 3.0]])
    >>> wrapped.tolist(), shifts.tolist()
    ([[0.5, 2.0, 3.0]], [[-1, 1, 0]])
    """

    __slots__ = ("_heights", "_vectors", "_volume")
    _shown = ("vectors", "volume", "perpendicular_heights")

    def __init__(self, vectors: BoxLike) -> None:
        array = as_real_array(vectors_of(vectors), "box")
        if (
            array.ndim not in (1, 2)
            or not 1 <= array.shape[0] <= MAX_DIM
            or array.shape[0] != array.shape[-1]
        ):
            hint = ": one length does not say how many dimensions" if array.ndim == 0 else ""
            raise ValueError(
                f"box must have shape (d,) or (d, d) with 1 <= d <= {MAX_DIM}, "
                f"got {array.shape}{hint}"
            )
        if array.shape == (6,):
            raise ValueError(
                f"box must not be six bare numbers: {LENGTHS_AND_ANGLES}, or "
                "Box.orthorhombic for six lengths"
            )
        own = as_box(array, array.shape[0]).copy()
        own.flags.writeable = False
        self._vectors = own
        self._heights, self._volume = _core.box_measure(own, (1 << own.shape[0]) - 1)
        self._heights.flags.writeable = False

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> Box:
        """Box vectors as the rows of a matrix.

        Parameters
        ----------
        matrix : array_like of float, shape (d, d)
            Box vectors as rows, in the unit of the points; 1 <= d <= 8.

        Returns
        -------
        Box

        Raises
        ------
        TypeError, ValueError
            As the constructor; ValueError also if `matrix` is not square.

        Examples
        --------
        >>> import halfshell as hs
        >>> hs.Box.from_matrix([[2.0, 0.0], [1.0, 3.0]]).volume
        6.0
        """
        array = as_real_array(matrix, "matrix")
        if array.ndim != 2:
            raise ValueError(f"matrix must have shape (d, d), got {array.shape}")
        return cls(array)

    @classmethod
    def orthorhombic(cls, *lengths: float) -> Box:
        """Edges along the coordinate axes.

        Parameters
        ----------
        *lengths : float
            Edge lengths, in the unit of the points, one for each of 1 to 8 dimensions; or one
            sequence of them. Not zero.

        Returns
        -------
        Box

        Raises
        ------
        TypeError, ValueError
            As the constructor; ValueError also if there are no lengths or more than 8.

        Examples
        --------
        >>> import halfshell as hs
        >>> hs.Box.orthorhombic(10.0, 10.0, 20.0).volume
        2000.0
        """
        only: Any = lengths[0] if len(lengths) == 1 else lengths
        array = np.atleast_1d(as_real_array(only, "lengths"))
        if array.ndim != 1:
            raise ValueError(f"lengths must have shape (d,), got {array.shape}")
        return cls(np.diag(array) if 1 <= len(array) <= MAX_DIM else array)

    @classmethod
    def from_lengths_angles(cls, lengths: ArrayLike, angles: ArrayLike) -> Box:
        """Crystallographic cell: the first vector along x, the second in the xy plane.

        Parameters
        ----------
        lengths : array_like of float, shape (3,) or (2,)
            Edge lengths (a, b, c), or (a, b) in two dimensions, in the unit of the points.
        angles : array_like of float, shape (3,) or (1,) or a number
            Angles in degrees: alpha between b and c, beta between a and c, gamma between a and b;
            in two dimensions gamma alone. Cosines of 60, 90 and 120 degrees are exact.

        Returns
        -------
        Box

        Raises
        ------
        TypeError, ValueError
            As the constructor; ValueError also if there are not 3 and 3 or 2 and 1 of them, a
            length is not positive, an angle is not between 0 and 180 degrees, or no cell has these.

        Examples
        --------
        >>> import halfshell as hs
        >>> hs.Box.from_lengths_angles((2.0, 4.0), 90.0).vectors.tolist()
        [[2.0, 0.0], [0.0, 4.0]]
        """
        edges = as_real_array(lengths, "lengths").astype(np.float64)
        degrees = np.atleast_1d(as_real_array(angles, "angles").astype(np.float64))
        if (edges.shape, degrees.shape) not in (((3,), (3,)), ((2,), (1,))):
            raise ValueError(
                "lengths and angles must be 3 and 3 numbers, or 2 and 1 in two dimensions, got "
                f"shapes {edges.shape} and {degrees.shape}"
            )
        if not (np.isfinite(edges).all() and (edges > 0).all()):
            raise ValueError(f"lengths must be finite and positive, got {edges.tolist()}")
        if not ((degrees > 0) & (degrees < 180)).all():
            raise ValueError(f"angles must be between 0 and 180 degrees, got {degrees.tolist()}")
        if len(edges) == 2:
            angle = float(degrees[0])
            directions = [[1.0, 0.0], [_cosine(angle), math.sin(math.radians(angle))]]
        else:
            directions = _directions(degrees.tolist())
        return cls(np.array(directions) * edges[:, None])

    @classmethod
    def from_dimensions(cls, dimensions: ArrayLike) -> Box:
        """Crystallographic cell from six numbers, like ASE's `cellpar`, MDAnalysis's `dimensions`.

        Parameters
        ----------
        dimensions : array_like of float, shape (6,)
            (a, b, c, alpha, beta, gamma): lengths in the unit of the points, angles in degrees.

        Returns
        -------
        Box
            That of `from_lengths_angles`.

        Raises
        ------
        TypeError, ValueError
            As `from_lengths_angles`; MDAnalysis has zeros if there is no box.

        Examples
        --------
        >>> import halfshell as hs
        >>> hs.Box.from_dimensions([2.0, 3.0, 4.0, 90.0, 90.0, 90.0])
        Box([[2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 4.0]])
        """
        array = as_real_array(dimensions, "dimensions")
        must = "dimensions must be six numbers, a, b, c, alpha, beta and gamma, of shape (6,)"
        of_shape(must, (6,))(array.shape)
        return cls.from_lengths_angles(array[:3], array[3:])

    vectors: npt.NDArray[np.float64] = _show.attribute("_vectors")
    volume: float = _show.attribute("_volume")
    perpendicular_heights: npt.NDArray[np.float64] = _show.attribute("_heights")

    def wrap(
        self, points: PointsLike, periodic: PeriodicLike | None = None
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
        """Move points into the box by whole box vectors.

        Parameters
        ----------
        points : array_like of float, shape (n, d)
            Coordinates, in the unit of the box.
        periodic : bool or sequence of bool, shape (d,), optional
            Along which box vectors to move. Default: all. The others are ignored.

        Returns
        -------
        wrapped : ndarray of float64, shape (n, d)
            ``points + shifts @ box``, with each fraction along a box vector in [0, 1) up to
            rounding. Along a box vector that is parallel to a coordinate axis the coordinate is
            never rounded up to the length itself.
        shifts : ndarray of int64, shape (n, d)
            Whole box vectors added.

        Raises
        ------
        TypeError
            If `points` or `periodic` is of the wrong kind: strings, complex numbers, long double.
        ValueError
            If a coordinate is not finite, or `points` or `periodic` does not have the d of the
            box.
        OverflowError
            If a point lies more than 2**51 box vectors away.

        Examples
        --------
        >>> import halfshell as hs
        >>> box = hs.Box([[2.0, 0.0], [1.0, 4.0]])
        >>> wrapped, shifts = box.wrap([[2.5, 1.0], [1.5, -1.0]])
        >>> wrapped.tolist(), shifts.tolist()
        ([[0.5, 1.0], [2.5, 3.0]], [[-1, 0], [0, 1]])
        >>> wrapped, shifts = hs.Box([2.0, 4.0]).wrap([[2.5, 5.0]], periodic=[True, False])
        >>> wrapped.tolist()
        [[0.5, 5.0]]
        """
        array = as_points(points)
        ndim = self.vectors.shape[0]
        if array.shape[1] != ndim:
            raise ValueError(f"points must have shape (n, {ndim}) for this box, got {array.shape}")
        refuse_large(16 * array.size, array, "points")
        return _core.box_wrap(
            array, self.vectors, int(as_periodic_bits(periodic, ndim, default=True))
        )

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return np.array(self.vectors, dtype=dtype, copy=copy)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Box) and np.array_equal(self.vectors, other.vectors)

    def __hash__(self) -> int:
        # Numbers, not bytes: 0.0 and -0.0 are equal, whatever the rounding mode.
        return hash(tuple(self.vectors.ravel().tolist()))

    def __reduce__(self) -> tuple[type[Box], tuple[npt.NDArray[np.float64]]]:
        # Copies are built anew: arrays that are unpickled or deep-copied can be written to.
        return type(self), (self.vectors,)

    def __repr__(self) -> str:
        return f"Box({self.vectors.tolist()})"

    def __str__(self) -> str:
        edges = " x ".join(f"{math.hypot(*row):.6g}" for row in self.vectors.tolist())
        return f"box with edges {edges}, volume {self.volume:.6g}"

    _repr_html_ = _show.html

    @document
    def plot(self, ax: Axes | None = None, *, unit: str | None = None) -> Axes:
        """Draw the edges of the box, with a corner at the origin, and name its vectors.

        Parameters
        ----------
        {ax, unit}

        {drawn}
        ValueError
            If the box has more than three dimensions, or axes do not fit.
        """
        from halfshell._objects.pictures import draw_whole_box

        return draw_whole_box(self._vectors, ax, unit)


def _cosine(degrees: float) -> float:
    """Cosine that is exact for the angles of orthogonal and hexagonal cells."""
    exact = {60.0: 0.5, 90.0: 0.0, 120.0: -0.5}
    return exact.get(degrees, math.cos(math.radians(degrees)))


def _directions(angles: list[float]) -> list[list[float]]:
    """Unit vectors along a, b and c in the usual orientation."""
    if not 2.0 * max(angles) < sum(angles) < 360.0:
        raise ValueError(f"no cell has the angles {angles}")
    cos_alpha, cos_beta, cos_gamma = (_cosine(angle) for angle in angles)
    sin_gamma = math.sin(math.radians(angles[2]))
    # The smallest angles have a sine of 0.
    c_y = (cos_alpha - cos_beta * cos_gamma) / sin_gamma if sin_gamma else math.inf
    square = 1.0 - cos_beta**2 - c_y * c_y
    if square <= 0.0:
        raise ValueError(f"no cell in float64 has the angles {angles}: it is too flat")
    return [
        [1.0, 0.0, 0.0],
        [cos_gamma, sin_gamma, 0.0],
        [cos_beta, c_y, math.sqrt(square)],
    ]


_core.know("Box", Box)
