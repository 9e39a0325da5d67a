# SPDX-License-Identifier: BSD-3-Clause
"""`Points`: coordinates, and what is known of each point."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from halfshell import _core, _show
from halfshell._convert.arrays import (
    as_array,
    as_real_array,
    in_order,
    of_shape,
    one_each,
    refuse_where,
)
from halfshell._convert.foreign import attribute, is_a, kind_of, shown
from halfshell._convert.lengths import as_number, check_lengths
from halfshell._convert.memory import refuse_large
from halfshell._convert.objects import (
    SYMBOLS,
    Parts,
    as_elements,
    parts_of,
    periodic_of,
    placeholder,
    vectors_of,
    without_placeholder,
)
from halfshell._convert.options import as_list
from halfshell._errors import brief
from halfshell._search import search

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._convert.types import ArrayLike, BoxLike, FloatArray, PeriodicLike, PointsLike

MAX_DIM = 8
MAX_POINTS = 2**31 - 1
MOST_AXES_OF_SUPPORTS = 3
LENGTHS_AND_ANGLES = (
    "six numbers may be lengths and angles: use Box.from_dimensions((a, b, c, alpha, ...))"
)
_LARGEST_RADIUS = 2.0**1022  # sums of two are finite
_SHOWN_ROWS = 5
_FIELDS = ("radii", "types", "supports", "groups", "labels", "weights", "batch")


class Labels(NamedTuple):
    """A number for each point, and what the numbers stand for, if they were given as names."""

    numbers: npt.NDArray[Any]
    names: tuple[str, ...] | None = None

    def __getitem__(self, places: Any) -> Any:
        return Labels(self.numbers[places], self.names)

    def among(self, every: Iterable[str]) -> npt.NDArray[Any]:
        """The numbers that these names have among others."""
        places = {one: k for k, one in enumerate(every)}
        own = np.array([places[one] for one in self.names or ()], self.numbers.dtype)
        return own[self.numbers] if len(self.numbers) else self.numbers

    def as_given(self) -> npt.NDArray[Any]:
        if self.names is None:
            return self.numbers
        return np.array(self.names, np.str_)[self.numbers] if self.names else np.array([], np.str_)


def _as_given(name: str) -> Any:
    """An attribute that has these labels as they were given, if there are any."""

    def given(points: Points) -> npt.NDArray[Any] | None:
        labels: Labels | None = getattr(points, name)
        return None if labels is None else labels.as_given()

    return property(given)


class Points:
    """Points and what is known of each, for `points` and `queries` of all functions.

    Parameters
    ----------
    positions : array_like of float, shape (n, d)
        Coordinates, any length unit, 1 <= d <= 8. float32 and float64 values are used as they are;
        integers, booleans and float16 are converted exactly or refused. Points may lie anywhere,
        even outside the box. ``[]`` counts as shape (0, 3). An object of another library brings its
        box, its periodicity and its elements as `types`: ``ase.Atoms``, a group or ``Universe`` of
        MDAnalysis (with the box of the present frame), a ``Structure`` or ``Molecule`` of pymatgen,
        a frame of mdtraj, a system of freud, a data frame with columns x, y and z. A list of these
        is stacked.
    box : float, array_like of float, shape (d,), (d, d) or (s, d, d), or Box, optional
        One length for all edges, a length for each, or edge vectors as rows, in the unit of
        `positions`; with `batch` also vectors for each system. None: open space. Rows of axes that
        are not periodic may be anything finite, such as zero.
    periodic : bool or sequence of bool, shape (d,) or (s, d), optional
        Which box vectors are periodic. Default: all with a box, none without.
    radii : array_like of float, shape (n,), or dict, optional
        A radius for each point, in the unit of `positions`; finite, not negative, at most 2**1022;
        or for each type, such as ``{"C": 0.76, "O": 0.66}``. The cutoff of a pair is then what
        `rule` makes of its two radii, and at most `cutoff`.
    types : array_like of int or str, shape (n,), optional
        The type of each point, for cutoffs by type and counts by type. Numbers are from 0 on.
    supports : array_like of float, shape (n, d, d), optional
        An ellipsoid around each point, as a symmetric positive definite matrix H, in the inverse
        unit of `positions`; d <= 3. `cutoff` is then the extent: a pair with the vector D counts if
        ``|H @ D| <= cutoff`` for the matrices that `rule` says. Not with `radii`.
    groups : array_like of int or str, shape (n,), optional
        Only pairs of two points of the same group count.
    labels : array_like of int or str, shape (n,), optional
        What a whole number as `exclude` goes by, such as numbers of residues.
    weights : array_like of float, shape (n,), optional
        Weights for histograms; a pair counts as the product of its two.
    batch : array_like of int, shape (n,), optional
        The system that each point belongs to, ascending from 0: only points of one system are
        pairs. `stack` makes it from a list.

    Attributes
    ----------
    positions, radii, types, supports, groups, labels, weights, batch : ndarray or None
        What was given; read-only.
    box : ndarray of float64, shape (d, d) or (s, d, d), or None
        Box vectors as rows; read-only.
    periodic : ndarray of bool, shape (d,) or (s, d), or None
        Which of them repeat; None without a box.
    n_systems : int
        The number of systems; 1 without `batch`.

    Raises
    ------
    TypeError
        If something has the wrong kind, or `positions` brings what is given again.
    ValueError
        If a shape or a value is wrong: the message says where, and what is allowed.

    Notes
    -----
    Points are immutable: arrays are copied, converted and checked once.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = hs.Points([[0.0, 0.0], [1.5, 0.0], [9.5, 0.0]], box=10.0, radii=[0.5, 1.0, 0.5])
    >>> hs.pairs(points, None)[0].tolist()
    [0, 0]
    >>> points
    Points(n=3, d=2, float64, box 10 x 10 periodic, radii from 0.5 to 1)
      0    0  0.5
      1.5  0  1
      9.5  0  0.5
    >>> hs.pairs(points.replace(radii=None), 0.6)[0].tolist()
    [0]
    """

    positions: npt.NDArray[Any]
    radii: FloatArray | None
    supports: FloatArray | None
    weights: FloatArray | None
    batch: npt.NDArray[np.int64] | None
    tells_periodic: bool  # False: what it came from does not say which axes repeat
    _axes: Any  # bits of the axes that repeat, or uint8 (s,), which tells s; 0 without a box
    _box: FloatArray | None  # (d, d) or (s, d, d)
    _elements: tuple[Any, str] | None  # atomic numbers, and what they are, until they are types
    _types: Labels | None
    _groups: Labels | None
    _labels: Labels | None

    __slots__ = tuple(__annotations__)

    #: They are no sequence of their rows.
    __iter__ = None

    #: In a notebook.
    _shown = ("positions", "box", "periodic", *_FIELDS)

    @search()
    def __init__(
        self,
        positions: PointsLike,
        *,
        box: BoxLike | None = None,
        periodic: PeriodicLike | None = None,
        radii: ArrayLike | Mapping[Any, float] | None = None,
        types: npt.ArrayLike | None = None,
        supports: ArrayLike | None = None,
        groups: npt.ArrayLike | None = None,
        labels: npt.ArrayLike | None = None,
        weights: ArrayLike | None = None,
        batch: npt.ArrayLike | None = None,
    ) -> None:
        found = Points._of(positions, "positions", box, periodic, batch)
        for name in Points.__slots__:
            setattr_(self, name, getattr(found, name))
        n, d = self.positions.shape
        if types is not None and (self._types or self._elements):
            raise ValueError(_twice("types", positions))
        for name, values in (("types", types), ("groups", groups), ("labels", labels)):
            if values is not None:
                setattr_(self, f"_{name}", _as_labels(values, name, n, name == "types"))
        if supports is not None:
            if radii is not None:
                raise ValueError("radii and supports cannot be given together")
            setattr_(self, "supports", as_supports(supports, n, d))
        if radii is not None:
            setattr_(self, "radii", self._as_radii(radii))
        if weights is not None:
            setattr_(self, "weights", _as_weights(weights, n))
        self._own_all()

    # ---- how they are made -----------------------------------------------------------------

    @staticmethod
    @brief
    def _of(
        values: Any,
        name: str = "points",
        box: Any = None,
        periodic: Any = None,
        batch: Any = None,
        ndim: int = 3,
    ) -> Points:
        """Points of what users give for them; those of an array share its memory."""
        if type(values) is Points:
            for what, given in (("box", box), ("periodic", periodic), ("batch", batch)):
                if given is not None:
                    raise ValueError(_twice(what, values))
            return values
        if type(values) in (list, tuple) and len(values) and _is_system(values[0], name):
            if batch is not None:
                raise ValueError("a list of systems brings its batch: leave batch out")
            stacked = Points._stack(values, name)
            if box is not None or periodic is not None:
                if stacked._box is not None:
                    raise ValueError(_twice("box" if box is not None else "periodic", values[0]))
                stacked = stacked.replace(box=box, periodic=periodic)
                if stacked.n_systems > len(values):
                    raise ValueError(
                        f"box and periodic must be given for the {len(values)} systems of {name}, "
                        f"got {stacked.n_systems}"
                    )
                if stacked.n_systems < len(values):  # the last are empty
                    stacked._counting(len(values))
            return stacked
        plain = NotImplemented if batch is not None else _core.scene(values, box, periodic)
        if plain is not NotImplemented:
            return Points._made(positions=plain[0], _box=plain[1], _axes=plain[2])
        parts = parts_of(values, name)
        array = as_points(values if parts is None else parts.positions, name, ndim)
        numbers = None if batch is None else _as_batch(batch, len(array))
        points = Points._made(positions=array, batch=numbers, _axes=0, tells_periodic=True)
        if parts is None:
            points._take_box(box, periodic)
        else:
            points._take_parts(parts, name, values, box, periodic)
        return points

    @staticmethod
    def _made(like: Points | None = None, **parts: Any) -> Points:
        """Points of parts that are known to be right; the rest is as of others, or None."""
        points = Points.__new__(Points)
        for slot in Points.__slots__:
            setattr_(points, slot, parts[slot] if slot in parts else getattr(like, slot, None))
        return points

    @classmethod
    def stack(cls, systems: Iterable[PointsLike]) -> Points:
        """Points of several systems, one behind the other, each with its own box.

        Parameters
        ----------
        systems : sequence
            Anything that `positions` may be, or Points, each one system without `batch`. All have
            as many dimensions, and know the same of their points.

        Returns
        -------
        Points
            With `batch`, and if any of them has a box, one for each.

        Examples
        --------
        >>> import halfshell as hs
        >>> both = hs.Points.stack([[[0.0], [1.0]], hs.Points([[0.0], [4.5]], box=5.0)])
        >>> hs.count_pairs(both, 1.0).tolist()
        [1, 1]
        """
        return cls._stack(systems, "systems")

    @classmethod
    def _stack(cls, systems: Any, name: str) -> Points:
        every = [
            cls._of(one, f"{name}[{k}]") for k, one in enumerate(as_list(systems, name, "points"))
        ]
        if not every:
            return cls(np.empty((0, 3)), batch=np.empty(0, np.int64))
        # Systems without points may be lists: only a box, or the number of columns, says more.
        ndim = {
            one.positions.shape[1] for one in every
            if len(one) or one._box is not None or one.positions.shape[1] != 3
        } or {3}  # fmt: skip
        if len(ndim) > 1:
            raise ValueError(
                f"{name} must have the same number of columns, got {sorted(ndim)}"
            )
        d = ndim.pop()
        for k, one in enumerate(every):
            if one.batch is not None:
                raise ValueError(f"{name}[{k}] must be one system, and has a batch")
        fields: dict[str, Any] = {}
        for field in _FIELDS[:-1]:
            columns = [getattr(one, field) for one in every]
            known = [column is not None for column in columns]
            if any(known) and not all(known[k] for k, one in enumerate(every) if len(one)):
                raise ValueError(
                    f"{name}[{known.index(True)}] has {field}, and {name}[{known.index(False)}] "
                    "has none: all must know the same"
                )
            if any(known):
                fields[field] = np.concatenate([c for c in columns if c is not None])
        if any(one.box is not None for one in every):
            fields["box"] = np.array(
                [np.eye(d) if one._box is None else one._box for one in every]
            )
            fields["periodic"] = flags_of(np.array([one._axes for one in every], np.uint8), d)
        positions = np.concatenate([one.positions.reshape(len(one), d) for one in every])
        batch = np.repeat(np.arange(len(every)), [len(one) for one in every])
        return cls(positions, batch=batch, **fields)._counting(len(every))

    def _take_box(self, box: Any, periodic: Any) -> None:
        ndim, has_batch = self.positions.shape[1], self.batch is not None
        for slot, part in zip(("_box", "_axes"), as_boxes(box, periodic, ndim, has_batch)):
            setattr_(self, slot, part)

    def _take_parts(self, parts: Parts, name: str, owner: Any, box: Any, periodic: Any) -> None:
        """What an object knows; `box` and `periodic` are those of the call."""
        if box is not None and _is_placeholder(parts, name, owner):
            parts = parts._replace(box=None, periodic=None)
        tells = parts.box is not None or parts.periodic is not None
        if tells and box is not None:
            raise ValueError(_twice("box", owner))
        if parts.periodic is not None and periodic is not None:
            raise ValueError(_twice("periodic", owner))
        if not tells:
            self._take_box(box, periodic)
        elif self.batch is not None:
            raise ValueError(f"{name} of type {kind_of(owner)} are one system: leave batch out")
        else:
            self._take_own_box(parts, name, owner, periodic)
        if parts.numbers is not None:
            setattr_(self, "_elements", (parts.numbers, f"{name}.numbers"))
        elif parts.types is not None:
            names = as_array(parts.types, f"elements of {name}", "hold names")
            are_numbers = names.dtype.kind in "iu" and names.size and names.min() >= 0
            if names.size and (are_numbers or as_names(names) is not None):
                known = _as_labels(names, f"elements of {name}", len(self), are_types=True)
                setattr_(self, "_types", known)

    def _take_own_box(self, parts: Parts, name: str, owner: Any, periodic: Any) -> None:
        ndim = self.positions.shape[1]
        try:
            told = periodic if parts.periodic is None else parts.periodic
            bits = as_periodic_bits(told, ndim, default=parts.periodic is None)
            rows = None if parts.box is None else vectors_of(parts.box, "box", ndim)
            if rows is not None:
                rows = as_array(rows, "box")
                rows = without_placeholder(rows, name, _is_pdb(owner, name)) if bits else None
            if rows is not None:
                setattr_(self, "_box", as_box(rows, ndim))
                setattr_(self, "_axes", bits)
                setattr_(self, "tells_periodic", told is not None)
        except (TypeError, ValueError, OverflowError) as error:
            kinds = (TypeError, OverflowError, ValueError)
            kind = next(one for one in kinds if isinstance(error, one))
            raise kind(f"the box of {name}: {error}") from error

    def _counting(self, n_systems: int) -> Points:
        """These points, told how many systems there are: the last ones may have no points."""
        if self.batch is not None and not is_a(self._axes, np.ndarray):
            setattr_(self, "_axes", np.full(n_systems, self._axes, np.uint8))
            self._axes.flags.writeable = False
        return self

    def _counting_as(self, other: Points) -> Points:
        """These points, with as many systems as others, if those are told how many."""
        return self._counting(len(other._axes)) if is_a(other._axes, np.ndarray) else self

    def _own_arrays(self, with_positions: bool = True) -> None:
        """Copies that do not change."""
        setattr_(self, "_types", self._kinds)
        for name in ("positions", "_box", "_axes", "radii", "supports", "weights", "batch"):
            array = getattr(self, name)
            if is_a(array, np.ndarray) and (with_positions or name != "positions"):
                array = np.array(array, order="C")
                array.flags.writeable = False
                setattr_(self, name, array)
        for name in ("_types", "_groups", "_labels"):
            kept = getattr(self, name)
            if kept is not None:
                kept.numbers.flags.writeable = False

    def _own_all(self) -> None:
        """Copies that do not change; ValueError for infinite coordinates, or a box that is none."""
        self._own_arrays()
        refuse_infinite(self.positions, "positions")
        if self._box is not None:
            rows = self._box.reshape(-1, *self._box.shape[-2:])
            bits = np.atleast_1d(self._axes).tolist()
            count = max(len(rows), len(bits)) if len(rows) else 0
            for s in range(count):
                try:
                    vectors = np.ascontiguousarray(rows[min(s, len(rows) - 1)])
                    _core.box_measure(vectors, bits[min(s, len(bits) - 1)])
                except ValueError as error:
                    if self._box.ndim == 2:
                        raise
                    raise ValueError(f"{error}\nin system {s}") from None

    # ---- what they tell --------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def _scene(self) -> tuple[npt.NDArray[Any], FloatArray | None, int]:
        """Positions, box vectors and bits of those that repeat, of one system."""
        if self.batch is not None:
            raise ValueError(f"points must be one system, and have a batch of {self.n_systems}")
        return self.positions, self._box, self._axes

    box: FloatArray | None = _show.attribute("_box")

    @property
    def periodic(self) -> npt.NDArray[np.bool_] | None:
        if self._box is None:
            return None
        flags = flags_of(np.atleast_1d(np.asarray(self._axes, np.uint8)), self.positions.shape[1])
        return flags if np.ndim(self._axes) else flags[0]

    types: npt.NDArray[Any] | None = _as_given("_kinds")
    groups: npt.NDArray[Any] | None = _as_given("_groups")
    labels: npt.NDArray[Any] | None = _as_given("_labels")

    @property
    def _kinds(self) -> Labels | None:
        """The types as numbers from 0 on, and their names in ascending order, if they have some."""
        if self._elements is not None:
            elements = as_elements(*self._elements, len(self))
            numbers, places = np.unique(elements, return_inverse=True)
            symbols = np.array(SYMBOLS)[numbers]
            order = np.argsort(symbols)
            ranks = np.argsort(order).astype(np.int32)
            named = Labels(ranks[places.reshape(-1)], tuple(symbols[order].tolist()))
            setattr_(self, "_types", named)
            setattr_(self, "_elements", None)
        return self._types

    @property
    def n_systems(self) -> int:
        """The number of systems: of a list, of those that have a box, or up to the largest one."""
        if self.batch is None:
            return 1
        own: Any
        for own in (self._box, self._axes):
            if is_a(own, np.ndarray) and own.ndim in (1, 3):
                return len(own)
        return 1 + int(self.batch[-1]) if len(self.batch) else 0

    def __getitem__(self, places: Any) -> Points:
        """Some of the points: a slice, a mask, or numbers of points, with a batch ascending."""
        if not is_a(places, slice):
            places = as_array(places, "Points[...]", "take a slice, a mask or numbers of points")
            if places.ndim != 1 or places.dtype.kind not in ("biu" if places.size else "biuf"):
                raise TypeError(
                    "Points[...] must take a slice, a mask or numbers of points, got shape "
                    f"{places.shape} and dtype {places.dtype}"
                )
            places = places if places.size else np.empty(0, np.int64)
        fields = self._fields()
        for name in ("positions", *_FIELDS):
            fields[name] = None if fields[name] is None else fields[name][places]
        return Points(**fields)._counting_as(self)

    def _fields(self) -> dict[str, Any]:
        """What the constructor takes."""
        return {name: getattr(self, name) for name in ("positions", "box", "periodic", *_FIELDS)}

    def replace(self, **changes: Any) -> Points:
        """Points with something else instead, or with None for nothing.

        Parameters
        ----------
        **changes
            What the constructor takes.

        Returns
        -------
        Points
        """
        fields = self._fields()
        for name in changes:
            if name not in fields:
                raise TypeError(f"Points have no {name!r}: they have {', '.join(fields)}")
        if "box" in changes:
            fields["periodic"] = None
        changed = Points(**{**fields, **changes})
        return changed if "batch" in changes else changed._counting_as(self)

    def _over(self, positions: npt.NDArray[Any]) -> Points:
        """These points, with the same positions in other memory that does not change."""
        other = Points._made(self, positions=positions)
        other._own_arrays(with_positions=False)
        return other

    def __reduce__(self) -> tuple[Any, tuple[dict[str, Any], int]]:
        return _restored, (self._fields(), self.n_systems)

    def __setattr__(self, name: str, value: object = None) -> None:
        raise AttributeError("Points are immutable: replace() gives others")

    __delattr__ = __setattr__

    def __repr__(self) -> str:
        n, d = self.positions.shape
        words = [f"n={n}, d={d}, {self.positions.dtype}"]
        if self._box is not None:
            words.append(self._shown_box())
        if self.radii is not None and n:
            words.append(f"radii from {self.radii.min():g} to {self.radii.max():g}")
        kinds = self._kinds
        if kinds is not None and n:
            few = kinds.names and len(kinds.names) <= 6
            count = len(np.unique(kinds.numbers))
            words.append("types " + " ".join(kinds.names or ()) if few else f"{count} types")
        words += [
            name for name in ("supports", "groups", "labels", "weights")
            if getattr(self, name) is not None
        ]  # fmt: skip
        if self.batch is not None:
            words.append(f"{self.n_systems} systems")
        columns = [self.positions[:_SHOWN_ROWS, axis] for axis in range(d)]
        columns += [
            getattr(self, name)[:_SHOWN_ROWS]
            for name in ("radii", "types")
            if getattr(self, name) is not None
        ]
        text = [
            [f"{value:g}" if is_a(value, np.floating) else str(value) for value in column]
            for column in columns
        ]
        widths = [max(map(len, column), default=0) for column in text]
        rows = [
            "  " + "  ".join(map(str.ljust, row, widths)).rstrip()
            for row in zip(*text, strict=True)
        ]
        more = ["  ..."] if n > _SHOWN_ROWS else []
        return "\n".join([f"Points({', '.join(words)})", *rows, *more])

    _repr_html_ = _show.html

    def _shown_box(self) -> str:
        box, d = self._box, self.positions.shape[1]
        assert box is not None
        if box.ndim == 3:
            return f"{len(box)} boxes"
        lengths = np.diag(box)
        size = (
            " x ".join(f"{length:g}" for length in lengths)
            if np.array_equal(box, np.diag(lengths)) else f"of {d} vectors"
        )  # fmt: skip
        if np.ndim(self._axes) or self._axes != (1 << d) - 1:
            return f"box {size} partly periodic"
        return f"box {size} periodic"

    # ---- columns ---------------------------------------------------------------------------

    def _as_radii(self, values: Any) -> FloatArray:
        n = len(self)
        if is_a(values, Mapping):
            values = self._radii_by_type(values)
        array = as_real_array(values, "radii", check_shape=one_each("radii", n))
        if array.dtype != np.float64:
            refuse_large(8 * array.size, array, "radii")
        radii = in_order(array, np.float64)
        if n and not (radii.min() >= 0.0 and radii.max() <= _LARGEST_RADIUS):
            check_lengths(radii, "radii")
            refuse_where(radii > _LARGEST_RADIUS, radii, "radii", "be at most 2**1022")
        return radii

    def _radii_by_type(self, values: Mapping[Any, Any]) -> FloatArray:
        kinds = self._kinds
        if kinds is None:
            raise ValueError("radii by type need types")
        lengths = {key: as_number(value, f"radii[{shown(key)}]") for key, value in values.items()}
        present, places = np.unique(kinds.numbers, return_inverse=True)
        names = present.tolist() if kinds.names is None else [kinds.names[k] for k in present]
        if "*" in names and "*" in lengths:
            raise ValueError("radii have a key '*', which means any type and is the name of one")
        for name in names:
            if name not in lengths and "*" not in lengths:
                raise ValueError(
                    f"radii must have a radius for each type, and have none for {name!r}"
                )
        table = np.array([lengths.get(name, lengths.get("*", 0.0)) for name in names])
        radii: FloatArray = table[places]
        return radii


setattr_ = object.__setattr__
_core.know("Points", Points)


def _restored(state: dict[str, Any], n_systems: int) -> Points:
    points = Points(**state)
    return points if points.n_systems == n_systems else points._counting(n_systems)


def _is_system(value: Any, name: str) -> bool:
    """Whether the first of a list is a set of points of its own, and no point."""
    if type(value) in (list, tuple):
        row: Any = value[0] if len(value) else None
        return type(row) is np.ndarray or (
            type(row) in (list, tuple)
            and not (len(row) and type(row[0]) in (list, tuple, np.ndarray))
        )
    if type(value) is np.ndarray:
        return value.ndim == 2
    return type(value) is Points or parts_of(value, name) is not None


def _is_pdb(owner: Any, name: str) -> bool:
    arrays = attribute(owner, "arrays", name)
    return is_a(arrays, dict) and "residuenames" in arrays


def _is_placeholder(parts: Parts, name: str, owner: Any) -> bool:
    """Whether the box that an object brings is none, as that of a molecule in ASE."""
    if parts.box is None:
        return False
    rows = as_array(vectors_of(parts.box), "box")
    return rows.dtype.kind in "fiu" and bool(placeholder(rows, _is_pdb(owner, name)))


def _twice(what: str, owner: Any) -> str:
    kind = "Points" if type(owner) is Points else f"points of type {kind_of(owner)}"
    return f"{kind} bring their own {what}: leave {what} out, or give arrays"


# ---- positions, boxes, periodicity ---------------------------------------------------------

@brief
def as_points(values: Any, name: str = "points", ndim: int = 3) -> npt.NDArray[Any]:
    """Coordinates of shape (n, d); a list without elements counts as n = 0, d = `ndim`."""

    def check(shape: tuple[int, ...]) -> None:
        if shape != (0,) and (len(shape) != 2 or not 1 <= shape[1] <= MAX_DIM):
            raise ValueError(
                f"{name} must have shape (n, d) with 1 <= d <= {MAX_DIM}, got {shape}"
                f"{_hint_of_shape(shape, name)}"
            )
        if shape[0] > MAX_POINTS:
            raise OverflowError(f"fewer than 2**31 {name} can be searched, got {shape[0]}")

    if type(values) not in (np.ndarray, list, tuple):
        parts = values if type(values) is Points else parts_of(values, name)
        if parts is not None:
            if parts.box is not None:
                raise ValueError(
                    f"{name} must be an array: a {kind_of(values)} brings a box, for which there "
                    "is no place here"
                )
            values = parts.positions
    array = as_real_array(values, name, check_shape=check, flags=True)
    return np.empty((0, ndim)) if array.shape == (0,) else array


def refuse_infinite(array: npt.NDArray[Any], name: str) -> None:
    refuse_where(~np.isfinite(array), array, name, "be finite")


def _hint_of_shape(shape: tuple[int, ...], name: str) -> str:
    """What may be meant by points of this shape, if it is clear."""
    if len(shape) == 2 and 1 <= shape[0] <= MAX_DIM < shape[1]:
        return f": one row for each point, as in {name}.T"
    if len(shape) == 3:
        return f": several systems are a list of arrays, as in Points.stack(list({name}))"
    if len(shape) == 1:
        return f": one point is {name}[None, :], points on a line are {name}[:, None]"
    return ""


@brief
def as_box(values: Any, ndim: int, has_batch: bool = False) -> FloatArray:
    """Box vectors as the rows of a float64 array (ndim, ndim), or of one for each system.

    values: rows, lengths, the length of all edges, or a Box; of a batch also rows of each system.
    """

    def check(shape: tuple[int, ...]) -> None:
        square = (ndim, ndim)
        of_systems = has_batch and len(shape) == 3
        if shape in ((), (ndim,), square) or (of_systems and shape[1:] == square):
            return
        hint = f": {LENGTHS_AND_ANGLES}" if shape == (6,) else ""
        if shape == (ndim * ndim,):
            hint = f": one row for each vector, as in reshape({ndim}, {ndim})"
        if len(shape) == 3 and not has_batch:
            hint = ": a box for each system needs Points with a batch"
        raise ValueError(
            f"box must have shape ({ndim},) or {square}, or "
            f"{f'one for each system (s, {ndim}, {ndim})' if of_systems else 'be one length'}, "
            f"for points in {ndim} dimensions, got {shape}{hint}"
        )

    array = as_real_array(vectors_of(values, "box", ndim), "box", "be lengths or vectors", check)
    if array.ndim == 3:
        refuse_large(8 * array.size, array, "box")
    if array.ndim >= 2:
        return in_order(array, np.float64)
    if array.ndim == 1:
        return np.diag(array.astype(np.float64))
    return np.diag(np.full(ndim, array, np.float64))


def as_periodic_bits(
    values: Any, ndim: int, default: bool, has_batch: bool = False
) -> int | npt.NDArray[np.uint8]:
    """Which axes repeat, as an integer with bit l set for box vector l; or that of each system."""
    if values is None:
        return (1 << ndim) - 1 if default else 0
    if is_a(values, (bool, np.bool_)):
        return (1 << ndim) - 1 if values else 0
    if is_a(values, (str, bytes)):
        raise TypeError(f"periodic must be a bool or {ndim} bools, got {shown(values)}")
    array = as_array(values, "periodic")
    if has_batch and array.ndim == 2:
        return _as_many_bits(array, ndim)
    if array.shape not in ((), (ndim,)) and array.dtype.kind in "biu":
        raise ValueError(f"periodic must be a bool or {ndim} bools, got shape {array.shape}")
    _check_bools(array, f"be a bool or {ndim} bools", values)
    if array.shape == ():
        return (1 << ndim) - 1 if array else 0
    return sum(1 << axis for axis in range(ndim) if array[axis])


def as_boxes(
    box: Any, periodic: Any, ndim: int, has_batch: bool
) -> tuple[FloatArray | None, int | npt.NDArray[np.uint8]]:
    """Vectors and bits of the axes that repeat, of all systems or of each one."""
    rows: FloatArray | None = None
    if box is not None:
        rows = as_box(box, ndim, has_batch)
        periodic = periodic_of(box, periodic, ndim)
    axes = as_periodic_bits(periodic, ndim, box is not None, has_batch)
    if isinstance(axes, np.ndarray) and rows is not None and rows.ndim == 3:
        if len(rows) != len(axes):
            raise ValueError(
                "box and periodic must be given for the same number of systems, got "
                f"{len(rows)} and {len(axes)}"
            )
    if box is None:
        if np.any(axes):
            raise ValueError("periodic needs a box: give box, or leave periodic out")
        return None, 0
    return rows, axes


def as_own_box(box: Any, periodic: Any, ndim: int) -> tuple[FloatArray | None, int]:
    rows, axes = as_boxes(box, periodic, ndim, has_batch=False)
    return rows, int(axes)


@brief
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
        as_real_array(vectors_of(box), "box", "be lengths or vectors", check_box)
    if len(counts) == 1 and periodic is not None and not is_a(periodic, (str, bytes)):
        axes = as_array(periodic, "periodic").shape
        counts[:0] = axes if len(axes) == 1 and 1 <= axes[0] <= MAX_DIM else ()
    ndim = counts[0]
    vectors = None if box is None else as_box(box, ndim)
    periodic = periodic_of(box, periodic, ndim)
    return ndim, vectors, int(as_periodic_bits(periodic, ndim, default=box is not None))


def _as_many_bits(flags: npt.NDArray[Any], ndim: int) -> npt.NDArray[np.uint8]:
    if flags.shape[1] != ndim:
        raise ValueError(
            f"periodic must be a bool, {ndim} bools, or these for each system, (s, {ndim}), "
            f"got shape {flags.shape}"
        )
    _check_bools(flags, "hold bools", flags.dtype)
    bits: npt.NDArray[np.uint8] = (flags != 0) @ (1 << np.arange(ndim)).astype(np.uint8)
    return np.ascontiguousarray(bits.astype(np.uint8))


def _check_bools(array: npt.NDArray[Any], must: str, got: Any) -> None:
    if array.dtype.kind != "b" and not (
        array.dtype.kind in "iu" and bool(((array == 0) | (array == 1)).all())
    ):
        raise TypeError(f"periodic must {must}, got {shown(got)}")


def flags_of(bits: npt.NDArray[np.uint8], ndim: int) -> npt.NDArray[np.bool_]:
    """Bit l of each number as entry l of its row.

    Not by shifts of a table: where memory is refused, NumPy 2.4 crashes in loops that broadcast.
    """
    rows = np.unpackbits(bits[:, None], axis=1, count=ndim, bitorder="little")
    return rows.view(np.bool_)


# ---- what is known of each point -----------------------------------------------------------

def as_names(array: npt.NDArray[Any]) -> npt.NDArray[np.str_] | None:
    """An array of strings as NumPy's own; None for what holds something else."""
    if array.dtype.kind == "T":
        array = array.astype(object)
    if array.dtype.kind == "O" and array.size and all(is_a(one, str) for one in array.flat):
        return array.astype(np.str_)
    return array if array.dtype.kind == "U" else None


def _as_labels(values: Any, name: str, n: int, are_types: bool = False) -> Labels:
    """Whole numbers, or names, which are numbered in ascending order."""
    array = as_array(values, name, "hold integers or names")
    names = as_names(array)
    one_each(name, n)(array.shape)
    if names is not None and is_a(values, (list, tuple)) and set(map(type, values)) != {str}:
        for place, one in enumerate(values):  # NumPy makes names of numbers
            if not is_a(one, str):
                raise TypeError(
                    f"{name} must be all integers or all names, got {name}[{place}] = {shown(one)}"
                )
    if names is not None:
        every, numbers = np.unique(names, return_inverse=True)
        kind = np.int32 if are_types else np.int64
        return Labels(numbers.reshape(-1).astype(kind), tuple(every.tolist()))
    if array.dtype.kind not in "iu" and n:
        raise TypeError(f"{name} must hold integers or names, got dtype {array.dtype}")
    array = array.copy() if n else np.empty(0, np.int64)  # it may change meanwhile
    if are_types:
        wrong = (array < 0) | (array >= 2**31 - 1)
        refuse_where(wrong, array, "types", "be from 0 on and below 2**31 - 1")
        return Labels(np.ascontiguousarray(array, np.int32))
    if array.dtype == np.uint64:
        refuse_where(array >= np.uint64(2**63), array, name, "be less than 2**63")
    return Labels(np.ascontiguousarray(array, np.int64))


def as_types(values: Any, n: int) -> npt.NDArray[Any]:
    return _as_labels(values, "types", n, are_types=True).as_given()


def as_supports(values: Any, n: int, d: int, name: str = "supports") -> FloatArray:
    """Symmetric matrices of finite numbers; the core decides whether they are definite."""
    if d > MOST_AXES_OF_SUPPORTS:
        raise ValueError(f"{name} are for points of 1 to 3 dimensions, got {d}")
    must = f"{name} must have shape ({n}, {d}, {d}), a matrix for each point"
    array = as_real_array(values, name, check_shape=of_shape(must, (n, d, d)))
    if array.dtype != np.float64:
        refuse_large(8 * array.size, array, name)
    matrices = in_order(array, np.float64)
    refuse_infinite(matrices, name)
    for k, a, b in np.argwhere(matrices != matrices.transpose(0, 2, 1))[:1]:
        a, b = max(a, b), min(a, b)
        raise ValueError(
            f"{name} must be symmetric, got {name}[{k}, {a}, {b}] = {matrices[k, a, b]} and "
            f"{name}[{k}, {b}, {a}] = {matrices[k, b, a]}"
        )
    return matrices


def _as_weights(values: Any, n: int) -> FloatArray:
    array = as_real_array(values, "weights", check_shape=one_each("weights", n), flags=True)
    weights = np.ascontiguousarray(array, dtype=np.float64)
    refuse_infinite(weights, "weights")
    return weights


def _as_batch(values: Any, n: int) -> npt.NDArray[np.int64]:
    """System numbers, ascending."""
    array = as_array(values, "batch", "hold integers")
    one_each("batch", n, "one number for each point")(array.shape)
    if array.dtype.kind not in "iu" and n > 0:
        raise TypeError(f"batch must hold integers, got dtype {array.dtype}")
    array = array.copy()  # it may change meanwhile
    if array.dtype.itemsize == 8 and array.dtype.kind in "iu":
        refuse_where(array >= 2**62, array, "batch", "be less than 2**62")
    numbers = in_order(array, np.int64)
    for k in np.flatnonzero(numbers[1:] < numbers[:-1])[:1]:
        raise ValueError(
            f"batch must ascend, got batch[{k}] = {numbers[k]} before {numbers[k + 1]}"
        )
    if n and numbers[0] < 0:
        raise ValueError(f"batch must be from 0 on, got batch[0] = {numbers[0]}")
    return numbers

