# SPDX-License-Identifier: BSD-3-Clause
"""Points, box and periodicity, and queries beside them, as the core takes them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.arrays import as_array, as_real_array, in_order
from halfshell._convert.foreign import attribute, is_a, kind_of, shown
from halfshell._errors import shorten

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._convert.types import FloatArray, PointArray

    OwnBox = tuple[FloatArray | None, int]  # and the bits of the axes that repeat

MAX_DIM = 8
MAX_POINTS = 2**31 - 1
LENGTHS_AND_ANGLES = (
    "six numbers may be lengths and angles: use Box.from_dimensions((a, b, c, alpha, ...))"
)
_MISSING = object()
_UNTOLD = -1  # bits of a box that does not say which axes repeat


def as_points(values: Any, name: str = "points", ndim: int = 3) -> PointArray:
    """Points of shape (n, d); a list without elements counts as n = 0, d = `ndim`."""

    def check(shape: tuple[int, ...]) -> None:
        if shape != (0,) and (len(shape) != 2 or not 1 <= shape[1] <= MAX_DIM):
            raise ValueError(
                f"{name} must have shape (n, d) with 1 <= d <= {MAX_DIM}, got {shape}"
                f"{_hint_of_shape(values, shape, name)}"
            )
        if shape[0] > MAX_POINTS:
            raise OverflowError(f"fewer than 2**31 {name} can be searched, got {shape[0]}")

    if type(values) not in (np.ndarray, list, tuple):  # a Molecule of pymatgen has no box
        places = attribute(values, "cart_coords", name, _MISSING)
        values = values if places is _MISSING or brings_its_box(values, name) else places
    array = as_real_array(values, name, check_shape=check)
    return np.empty((0, ndim)) if array.shape == (0,) else array


def _hint_of_shape(values: Any, shape: tuple[int, ...], name: str) -> str:
    """What may be meant by points of this shape, if it is clear."""
    if type(values) in (list, tuple) and values and brings_its_box(values[0], name):
        return ": several systems are one array of points, with batch"
    if brings_its_box(values, name):
        return f": a {kind_of(values)} brings a box, for which there is no place here: give arrays"
    if len(shape) == 2 and 1 <= shape[0] <= MAX_DIM < shape[1]:
        return f": one row for each point, as in {name}.T"
    if len(shape) == 1:
        return f": one point is {name}[None, :], points on a line are {name}[:, None]"
    return ""


def vectors_of(values: Any, name: str = "box", ndim: int | None = None) -> Any:
    """The vectors of a Box, or of another object that has some; else the object itself."""
    if type(values) in (np.ndarray, list, tuple, float, int):
        return values
    vectors = attribute(values, "vectors", name, _MISSING)
    if vectors is not _MISSING:
        return vectors
    from halfshell._convert.foreign_box import foreign_vectors  # which few calls need

    return foreign_vectors(values, name, ndim)


def as_box(values: Any, ndim: int) -> FloatArray:
    """Box vectors as the rows of a float64 array (ndim, ndim).

    values: rows, lengths, the length of all edges, or a Box.
    """

    def check(shape: tuple[int, ...]) -> None:
        if shape not in ((), (ndim,), (ndim, ndim)):
            hint = f": {LENGTHS_AND_ANGLES}" if shape == (6,) else ""
            if shape == (ndim * ndim,):
                hint = f": one row for each vector, as in reshape({ndim}, {ndim})"
            raise ValueError(
                f"box must have shape ({ndim},) or ({ndim}, {ndim}), or be one length, for points "
                f"in {ndim} dimensions, got {shape}{hint}"
            )

    array = as_real_array(vectors_of(values, "box", ndim), "box", "be lengths or vectors", check)
    if array.ndim == 2:
        return in_order(array, np.float64)
    if array.ndim == 1:
        return np.diag(array.astype(np.float64))
    if is_a(values, (bool, np.bool_)):
        raise TypeError(f"box must be lengths or vectors, got {values}; see periodic")
    return np.diag(np.full(ndim, array, np.float64))


def as_periodic_bits(values: Any, ndim: int, default: bool) -> int:
    """Which axes repeat, as an integer with bit l set for box vector l."""
    if values is None:
        return (1 << ndim) - 1 if default else 0
    if is_a(values, (bool, np.bool_)):
        return (1 << ndim) - 1 if values else 0
    if is_a(values, (str, bytes)):
        raise TypeError(f"periodic must be a bool or {ndim} bools, got {shown(values)}")
    array = as_array(values, "periodic")
    if array.shape not in ((), (ndim,)) and array.dtype.kind in "biu":
        raise ValueError(f"periodic must be a bool or {ndim} bools, got shape {array.shape}")
    if array.dtype.kind != "b" and not (
        array.dtype.kind in "iu" and bool(((array == 0) | (array == 1)).all())
    ):
        raise TypeError(f"periodic must be a bool or {ndim} bools, got {shown(values)}")
    if array.shape == ():
        return (1 << ndim) - 1 if array else 0
    return sum(1 << axis for axis in range(ndim) if array[axis])


def flags_of(bits: npt.NDArray[np.uint8], ndim: int) -> npt.NDArray[np.bool_]:
    """Bit l of each number as entry l of its row.

    Not by shifts of a table: where memory is refused, NumPy 2.4 crashes in loops that broadcast.
    """
    rows = np.unpackbits(bits[:, None], axis=1, count=ndim, bitorder="little")
    return rows.view(np.bool_)


def periodic_of(box: Any, periodic: Any, ndim: int) -> Any:
    """What was given, or else what the box says of itself, if it does."""
    if periodic is not None or type(box) in (np.ndarray, list, tuple, float, int):
        return periodic
    from halfshell._convert.foreign_box import foreign_periodic

    return foreign_periodic(box, ndim)


def as_own_box(box: Any, periodic: Any, ndim: int) -> OwnBox:
    """Box vectors, or None, and periodic bits, which need a box."""
    if box is not None:
        periodic = periodic_of(box, periodic, ndim)
        return as_box(box, ndim), as_periodic_bits(periodic, ndim, default=True)
    if as_periodic_bits(periodic, ndim, default=False):
        raise ValueError("periodic needs a box: give box, or leave periodic out")
    return None, 0


def as_box_alone(box: Any, periodic: Any) -> tuple[int, FloatArray | None, int]:
    """Dimensions, box vectors and periodic bits for points that come later.

    The box says how many dimensions there are, or else `periodic`; 3 if neither does.
    """
    counts = [3]

    def check_box(shape: tuple[int, ...]) -> None:
        if len(shape) > 2 or len(set(shape)) > 1 or not all(1 <= d <= MAX_DIM for d in shape):
            raise ValueError(
                f"box must have shape (d,) or (d, d) with 1 <= d <= {MAX_DIM}, or be one length, "
                f"got {shape}"
            )
        counts[:0] = shape

    if box is not None:
        try:
            as_real_array(vectors_of(box), "box", "be lengths or vectors", check_box)
        except Exception as error:
            shorten(error)
            raise
    if len(counts) == 1 and not is_a(periodic, (str, bytes)):
        axes = as_array(periodic, "periodic").shape
        counts[:0] = axes if len(axes) == 1 and 1 <= axes[0] <= MAX_DIM else ()
    ndim = counts[0]
    vectors = None if box is None else as_box(box, ndim)
    periodic = periodic_of(box, periodic, ndim)
    return ndim, vectors, as_periodic_bits(periodic, ndim, default=box is not None)


def brings_its_box(points: Any, name: str = "points") -> bool:
    """Whether points are an object with ``positions``, ``cell`` and ``pbc``, like ASE's Atoms.

    Or a Structure of pymatgen, or a universe or a group of atoms of MDAnalysis.
    """
    if type(points) in (np.ndarray, list, tuple):
        return False
    if any(
        all(attribute(points, part, name, _MISSING) is not _MISSING for part in parts)
        for parts in (("positions", "cell", "pbc"), ("cart_coords", "lattice"))
    ):
        return True
    from halfshell._convert.atom_groups import is_group  # which few calls need

    return is_group(points, name)


def _group(points: Any, name: str) -> tuple[Any, Any] | None:
    """Positions and box vectors of a group of MDAnalysis; None for what is like ASE's Atoms."""
    from halfshell._convert.atom_groups import is_group, of_group
    from halfshell._convert.foreign_box import without_placeholder

    if not is_group(points, name):
        return None
    positions, vectors = of_group(points, name)
    return positions, without_placeholder(vectors, name)


def _own_scene(
    atoms: Any, name: str = "points", ndim: int = 3
) -> tuple[PointArray, FloatArray | None, int]:
    """`as_scene` of an object that brings its box."""
    places = attribute(atoms, "positions", name, _MISSING)
    owner, cell = atoms, "cell"
    if places is _MISSING:  # a Structure of pymatgen
        places = attribute(atoms, "cart_coords", name)
        owner, cell = attribute(atoms, "lattice", "box"), "matrix"
    array = as_points(places, name, ndim)
    ndim = array.shape[1]
    try:
        bits = as_periodic_bits(attribute(owner, "pbc", "periodic"), ndim, default=False)
        if not bits:
            return array, None, 0
        from halfshell._convert.foreign_box import without_placeholder

        arrays = attribute(atoms, "arrays", name)
        is_pdb = is_a(arrays, dict) and "residuenames" in arrays
        given = as_array(attribute(owner, cell, "box"), "box")
        vectors = without_placeholder(given, name, is_pdb)
        return (array, None, 0) if vectors is None else (array, as_box(vectors, ndim), bits)
    except (TypeError, ValueError, OverflowError) as error:
        kinds = (TypeError, OverflowError, ValueError)
        kind = next(one for one in kinds if isinstance(error, one))
        raise kind(f"the box of {name}: {error}") from error


def as_scene(
    points: Any, box: Any, periodic: Any, ndim: int = 3
) -> tuple[PointArray, FloatArray | None, int]:
    """Points, box and periodic bits; from an ASE-like object all three. `ndim`: of an empty list.

    An object with ``positions``, ``cell`` and ``pbc`` brings its own box, so giving one is an
    error. Groups of MDAnalysis may bring none, and do not say which axes repeat.
    """
    try:
        if brings_its_box(points):
            group = _group(points, "points")
            if group is not None and (group[1] is None or box is None):
                array = as_points(group[0], ndim=ndim)
                own = box if group[1] is None else group[1]
                return array, *as_own_box(own, periodic, array.shape[1])
            if box is not None or periodic is not None:
                given = "box" if box is not None else "periodic"
                raise ValueError(
                    f"points of type {kind_of(points)} bring their own box: leave {given} out"
                )
            return _own_scene(points, ndim=ndim)
        array = as_points(points, ndim=ndim)
        return array, *as_own_box(box, periodic, array.shape[1])
    except Exception as error:
        shorten(error)
        raise


def as_queries(
    queries: Any, name: str = "queries", ndim: int = 3
) -> tuple[PointArray, OwnBox | None]:
    """Queries as points, and the box that they bring, if they are an ASE-like object."""
    if brings_its_box(queries, name):
        group = _group(queries, name)
        if group is not None:
            array = as_points(group[0], name, ndim)
            own = None if group[1] is None else (as_box(group[1], array.shape[1]), _UNTOLD)
            return array, own
        array, vectors, bits = _own_scene(queries, name, ndim)
        return array, (vectors, bits)
    return as_points(queries, name, ndim), None


def check_own_box(name: str, own: OwnBox | None, of_points: OwnBox) -> None:
    """ValueError if queries bring a box that is not that of the points."""
    if own is not None and not _same_box(own, of_points):
        raise ValueError(
            f"{name} bring a box that is not that of points: give arrays, and box and periodic"
        )


def as_two_sets(
    queries: Any, points: Any, box: Any, periodic: Any
) -> tuple[PointArray, PointArray, FloatArray | None, int]:
    """Queries, points, box and periodic bits.

    The box of an ASE-like object holds for both sets: where both are such objects, they must agree.
    """
    asking, own = as_queries(queries)
    array, vectors, bits = as_scene(points, box, periodic, asking.shape[1])
    if len(asking) == 0 and own is None:
        asking = as_points(queries, "queries", array.shape[1])
    if asking.shape[1] != array.shape[1]:
        raise ValueError(
            "queries and points must have the same number of columns, got shapes "
            f"{asking.shape} and {array.shape}"
        )
    check_own_box("queries", own, (vectors, bits))
    return asking, array, vectors, bits


def as_sets(
    queries: Any, points: Any, box: Any, periodic: Any
) -> tuple[PointArray | None, PointArray, FloatArray | None, int]:
    """As `as_two_sets`, where there may be no queries."""
    try:
        if queries is None:
            return None, *as_scene(points, box, periodic)
        return as_two_sets(queries, points, box, periodic)
    except Exception as error:
        shorten(error)
        raise


def _same_box(one: OwnBox, other: OwnBox) -> bool:
    """Whether the same axes repeat by the same vectors."""
    if one[1] == _UNTOLD:
        if other[0] is None:
            return False
        one = one[0], other[1]
    if one[1] != other[1]:
        return False
    if one[0] is None or other[0] is None:
        return True  # no axis repeats
    return all(
        np.array_equal(a, b) for k, (a, b) in enumerate(zip(one[0], other[0])) if one[1] >> k & 1
    )


def check_apart(out: Any, **inputs: Any) -> None:
    """Raise ValueError if an array of `out` may share memory with an input, which it names.

    For inputs as they were given: the core checks what they were converted to.
    """
    outputs = out if isinstance(out, tuple) else (out,)
    for name, values in inputs.items():
        for array in outputs:
            if (
                isinstance(array, np.ndarray)
                and isinstance(values, np.ndarray)
                and np.may_share_memory(array, values)
            ):
                raise ValueError(f"out must not share memory with {name}")
