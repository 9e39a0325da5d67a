# SPDX-License-Identifier: BSD-3-Clause
"""`pairs`: signature, defaults, documentation; the work is done in C."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast, overload

import numpy as np

from halfshell import _core
from halfshell._convert.batch import as_systems
from halfshell._convert.given import Chosen, Given
from halfshell._convert.options import AUTO, RAISE, as_flag, as_index_bytes, as_room
from halfshell._convert.scene import check_apart
from halfshell._convert.search import as_rest, as_search_of_each
from halfshell._convert.shells import as_shells
from halfshell._objects.box import Box
from halfshell._unknown import refuse_unknown

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Literal, Never, Unpack

    import numpy.typing as npt

    from halfshell._convert.types import (
        Algorithm,
        ArrayLike,
        Arrays,
        BoxLike,
        Letter,
        Out,
        PairCutoff,
        PairOptions,
        PeriodicLike,
        PointsLike,
        Precision,
        Rule,
    )


@overload
def pairs(
    points: PointsLike,
    cutoff: npt.ArrayLike | PairCutoff,
    *,
    quantities: Literal["ij"] = "ij",
    on_overflow: Literal["raise"] = "raise",
    **options: Unpack[PairOptions],
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]: ...
@overload
def pairs(
    points: PointsLike,
    cutoff: npt.ArrayLike | PairCutoff,
    *,
    quantities: Letter,
    on_overflow: Literal["raise"] = "raise",
    **options: Unpack[PairOptions],
) -> npt.NDArray[Any]: ...
@overload
def pairs(
    points: PointsLike,
    cutoff: npt.ArrayLike | PairCutoff,
    *,
    quantities: str,
    on_overflow: Literal["raise"] = "raise",
    **options: Unpack[PairOptions],
) -> Arrays: ...
@overload
def pairs(
    points: PointsLike,
    cutoff: npt.ArrayLike | PairCutoff,
    *,
    quantities: str = "ij",
    on_overflow: Literal["flag"],
    **options: Unpack[PairOptions],
) -> tuple[Any, ...]: ...
def pairs(
    points: PointsLike,
    cutoff: npt.ArrayLike | PairCutoff,
    *,
    radii: ArrayLike | None = None,
    rule: Rule | None = None,
    types: npt.ArrayLike | None = None,
    supports: ArrayLike | None = None,
    extent: float | None = None,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    quantities: str = "ij",
    inclusive: bool = True,
    sort: bool = False,
    index_dtype: npt.DTypeLike = np.int64,
    out: Out | None = None,
    capacity: int | None = None,
    on_overflow: Literal["raise", "flag"] = "raise",
    precision: Precision = "exact",
    algorithm: Algorithm = "auto",
    kernel: str | None = None,
    threads: int | None = None,
    memory_limit: float | None = None,
    progress: Callable[[float], object] | None = None,
    batch: npt.ArrayLike | None = None,
    touching: npt.ArrayLike | None = None,
    groups: npt.ArrayLike | None = None,
    exclude: npt.ArrayLike | None = None,
    exclude_within: int | None = None,
    min_distance: float | None = None,
    **unknown: Never,
) -> Arrays | tuple[Any, ...]:
    """Find every pair of points within a cutoff, each once.

    Parameters
    ----------
    points : array_like of float, shape (n, d)
        Coordinates, any length unit, 1 <= d <= 8. float32 and float64 values are used as they
        are; integers, booleans and float16 are converted exactly or refused. Points may lie
        anywhere, also outside the box. ``[]`` counts as shape (0, 3). An object with
        ``positions``, ``cell`` and ``pbc``, such as ``ase.Atoms``, brings its own box and
        periodicity; an ``AtomGroup`` or ``Universe`` of MDAnalysis the box of its present frame.
    cutoff : float, array_like of float, shape (k,) or (t, t), dict or None
        Largest distance of a pair, in the unit of `points`; finite, not negative. It may be
        larger than the box. With `radii` or `supports` a further limit, or None; with `types` one
        for each pair of types. Several, shape (k,), ascending, with the letter ``k``: the pairs
        are those of the last one.
    radii : array_like of float, shape (n,), optional
        A radius for each point, in the unit of `points`; finite, not negative, at most 2**1022. A
        pair then counts within what `rule` makes of the two radii, and within `cutoff`, if any.
    rule : {"sum", "mean", "max", "min"}, optional
        How far a pair of `radii` reaches: their sum, half of it, the larger or the smaller one.
        Default: "sum", by which balls touch. With `supports` "max", the default: within one of the
        two, or "min": within both.
    types : array_like of int or str, shape (n,), optional
        The type of each point. `cutoff` is then a symmetric table with a row for each type from 0
        on, or a dict such as ``{(0, 1): 1.5}`` or ``{("H", "O"): 1.2}``, where a key counts both
        ways and types that it does not pair are no pairs. With a dict, an object such as
        ``ase.Atoms`` brings its elements as types.
    supports : array_like of float, shape (n, d, d), optional
        The ellipsoid that each point reaches, as a symmetric positive definite matrix H, in the
        inverse unit of `points`; d <= 3. A pair counts if ``|H[i] @ D| <= extent`` or
        ``|H[j] @ D| <= extent``, D being its vector; `rule` "min": if both hold.
    extent : float, optional
        How far `supports` reach, without a unit; finite, not negative.
    box : float, array_like of float, shape (d,) or (d, d), or Box, optional
        The length of all edges, their lengths, or edge vectors as rows, in the unit of `points`;
        finite. None: open space. Rows of axes that are not periodic may be anything finite, such
        as zero. A box of freud, with its periodicity, and a frame of mdtraj or MDAnalysis, for its
        box alone, are taken too.
    periodic : bool or sequence of bool, shape (d,), optional
        Which box vectors repeat. Default: all with a box, none without.
    quantities : str, default "ij"
        Any of the letters ``i j d D S P``, each at most once: indices, distance, vector, shift,
        both indices. Only these are computed. With several cutoffs also ``k``: the innermost one
        that holds the pair, from 0 on, decided exactly at each; not with `radii`, `types`,
        `supports`, `batch`, nor a `precision` other than "exact".
    inclusive : bool, default True
        Whether a pair at exactly `cutoff`, or at exactly its reach by radii, types or supports,
        counts.
    sort : bool, default False
        Ascending (i, j, S). Otherwise the order is fixed by the scene but not specified.
    index_dtype : numpy.int64 or numpy.int32, default numpy.int64
        Type of i, j and P.
    out : ndarray or tuple of ndarray, optional
        Where to write: one array for each letter of `quantities`, of the type and, but for its
        length, the shape of the result, C-contiguous, apart from each other and from all inputs.
        They may be longer than the result; what lies beyond it keeps its values.
    capacity : int, optional
        Give all arrays this length, at least 1, whatever the number of pairs m, as compilers of
        arrays want it. What is behind the m pairs is none: i, j and P are n there, S and D zero,
        d is infinite, k is the number of cutoffs.
    on_overflow : {"raise", "flag"}, default "raise"
        With a capacity that is too small, raise `CapacityError`; or never, and return m as well,
        behind the arrays. If m is then above the capacity, the arrays hold no pair at all: a list
        is never cut.
    precision : {"exact", "double", "single"}, default "exact"
        "exact" decides by the real numbers that the inputs are. The others decide by one rounded
        comparison, as most libraries do, and exist to be compared with: "double" by a fixed
        formula in float64; "single" in float32 relative to the centre of a group of neighbouring
        points, so that its answer near the cutoff also depends on the other points and their
        order.
    algorithm : {"auto", "all-pairs", "grid", "hash", "hierarchy"}, default "auto"
        How the pairs are looked for, which may change time, memory and, without `sort`, the order,
        but not the pairs. "all-pairs" tests every pair; "grid" sorts the points into cells, whose
        number is in proportion to that of the points, so that they are large where the points
        are far apart; "hash" stores only cells that hold points, of any number; "hierarchy"
        divides the points by the size of their radius, or by type, and searches each two parts
        with cells of their own: one part, where neither is given. With `radii` or `types` the
        first three search once, with the largest reach; but more than 8 types in pairs.
        "auto" takes what is expected to be quickest; `explain` says which, and why.
    kernel : str, optional
        One of ``kernels()``; for tests and timing. All give identical arrays. Default: what the
        environment variable HALFSHELL_KERNEL said when halfshell was imported, otherwise the best.
    threads : int, optional
        The most threads to use, at most four for each core; work of less than about half a
        millisecond has one. Default: one for small scenes, else the number in the environment
        variable ``OMP_NUM_THREADS``, or as many as there are cores that this process may run on.
        The arrays are the same for any number. Threads end before the call returns.
    memory_limit : float, optional
        Bytes that search and result may take. Default: what the machine and its control group
        have available.
    progress : callable, optional
        Called now and then as ``progress(fraction)``, with the part of the work that is done, from
        0 to 1; it never falls. A search that takes but some milliseconds may not call it. An
        exception ends the search and is raised here.
    batch : array_like of int, shape (n,), optional
        Many systems in one call: the system of each point, ascending from 0 or above; numbers may
        be left out. Points pair within their system only, and the result is that of one call for
        each system, in ascending order, with i and j numbering all points. All else
        holds for every system, but `box` may have shape (s, d, d), one a system, `periodic` (s, d),
        `cutoff` (s,); then every number in `batch` is less than s. A `box` with two axes is one box
        for all: give edge lengths of each system as the diagonals of (s, d, d). Threads share the
        systems out. With `radii`, `types` or `supports`, one for each point of all systems,
        `cutoff` is a further limit, of all or one a system, or the table or dict of all.
    touching : array_like of int, shape (k,), optional
        Numbers of points, each once: only pairs with one of these, for moves of a few. They are
        found from these points, whose number the time follows once all points are in cells. With
        ``sort=False`` they come in the order of `touching`, those of one point by the other one; a
        pair of two of these points comes with the lower one. Not with `batch`, the letter ``k`` or
        `precision` "single".
    groups : array_like of int or str, shape (n,), optional
        A label for each point: only pairs of equal labels count.
    exclude : array_like of int, shape (k, 2), or of int or str, shape (n,), optional
        Pairs of point numbers, in any order, that do not count, such as bonds; or a label for each
        point: pairs of equal labels do not. They are left out in their nearest image alone,
        decided exactly; of images that are equally near in that with the lexicographically least
        S, as seen from the point of the lower number. Images of a point itself count.
    exclude_within : int, optional
        With numbers as labels: pairs whose labels differ by at most so much do not count.
    min_distance : float, optional
        Pairs that are nearer than this, decided exactly, do not count; finite, not negative. Not
        with `precision` "single".

    Returns
    -------
    ndarray or tuple of ndarray
        One array per letter of `quantities`, in that order; a bare array for one letter. With
        `out`, views of its filled parts; with ``on_overflow="flag"`` a tuple of all of them and
        the number of pairs. With m pairs: ``i``, ``j`` of `index_dtype`, shape (m,), with
        ``i < j``, or ``i == j`` for a point and its own image; ``d`` float64 (m,); ``D`` float64
        (m, d); ``S`` int32 (m, d); ``P`` of `index_dtype` (m, 2); ``k`` int32 (m,). In real
        arithmetic ``D = points[j] - points[i] + S @ box``.

        Each pair occurs once (half list): for ``i == j`` the first nonzero component of S is
        positive. (i, i, S = 0) is no pair; coincident points are pairs at distance 0. d is within
        1 ulp and never on the wrong side of the cutoff; each component of D is within 1 ulp of d.

        With radii the real number that `rule` makes of them is compared, not a rounded sum: 0.1
        and 0.2 do not touch at a distance of 0.30000000000000004, though Python adds them up to
        that. d is on the right side of the float64 next to that number, ``radii[i] + radii[j]``;
        without `inclusive` it may be equal to it.

    Raises
    ------
    TypeError
        If an argument is of the wrong kind: strings, complex numbers, long double, objects that
        cannot be converted to an array, flags that are not bools, a `progress` that cannot be
        called.
    ValueError
        If a coordinate or box entry is not finite or is masked, `cutoff` is negative or not finite,
        an integer is beyond 2**53 and no float64, the periodic box vectors are exactly linearly
        dependent or so skewed or different in length that float64 does not place points along the
        short ones, or a shape does not fit; if `quantities`, `index_dtype`, `precision` or `kernel`
        is none of those offered; if `quantities` has the letter k without several cutoffs, or these
        descend or are none; if `touching` names no point, or one twice; if `memory_limit` is
        negative; if `periodic` is given without `box`, or `box` or `periodic` beside an object that
        brings its own; if `batch` is not ascending or has a negative number or one that there is no
        box or cutoff for; if a radius is negative, not finite, above 2**1022 or, not being 0, below
        2**-1021 with `rule` "mean", as its half may be no float64; if `rule` is given without
        `radii`, or has a direction, as those of `neighbors` may; if a table of cutoffs is not
        symmetric, a dict is in contradiction or names no element, or a type is none of the table;
        if a support is not finite, not symmetric or, decided exactly, not positive definite, or
        reaches further than 2**1022; if two of `radii`, `types` and `supports` are given together;
        if labels are not one a point, `exclude` has a number that is no point's, `exclude_within`
        is negative or without labels, or `min_distance` is negative or not finite.
    CapacityError
        If `capacity` or an array of `out` is too small; it carries ``needed``. What `out` holds is
        unspecified then.
    OverflowError
        If there are 2**31 points or more, a number is too large for float64, or `quantities` has S
        and a shift does not fit int32; also if a point lies more than 2**51 box vectors away in a
        box that is not axis-aligned, or in any box with S in `quantities`; and if, with `precision`
        "double", points lie so many boxes away that rounding errors pass the cutoff.
    MemoryError
        If the result would not fit `memory_limit`: as a rule decided from a sample before the
        search, otherwise during the search.

    See Also
    --------
    count_pairs : the number of pairs, without storing them.
    iter_pairs : the same pairs in blocks, where all of them would not fit.
    verify : check a list of pairs, from any library.

    Notes
    -----
    Points are sorted into cells, each cell's neighbourhood is gathered once, and pairs are tested
    in float32 with a proven error bound; what is too near the cutoff to tell is decided in
    float64, double-word arithmetic [1]_ and at last in integers, so that no pair is missed or
    invented. Scenes of evenly spread points take time in proportion to n plus the number of
    pairs, strongly clustered ones more. Memory does not depend on the volume.

    If you come from ASE: its lists are full and strict, so ask for ``inclusive=False``, and note
    that each pair is here once. If you come from SciPy: `box` may be one number, as ``boxsize``.

    References
    ----------
    .. [1] Shewchuk, J. R. (1997). Adaptive precision floating-point arithmetic and fast robust
       geometric predicates. Discrete & Computational Geometry 18, 305-363.

    Examples
    --------
    >>> import halfshell as hs
    >>> i, j = hs.pairs([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]], 1.5)
    >>> i.tolist(), j.tolist()
    ([0], [1])

    In a periodic box the first and the last point are neighbours too:

    >>> i, j, d, S = hs.pairs([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]], 1.5, box=[4.0, 4.0],
    ...                       quantities="ijdS", sort=True)
    >>> i.tolist(), j.tolist(), d.tolist(), S.tolist()
    ([0, 0], [1, 2], [1.0, 1.0], [[0, 0], [-1, 0]])

    Balls that touch, and cutoffs by type, of which 0 and 0 have none:

    >>> i, j = hs.pairs([[0.0], [1.0], [3.0]], None, radii=[0.25, 0.75, 1.0])
    >>> i.tolist(), j.tolist()
    ([0], [1])
    >>> i, j = hs.pairs([[0.0], [1.0], [3.0]], {(0, 1): 2.0}, types=[0, 0, 1])
    >>> i.tolist(), j.tolist()
    ([1], [2])

    Arrays of a fixed length, with what is needed:

    >>> i, j, d, needed = hs.pairs([[0.0], [1.0], [3.0]], 1.5, quantities="ijd", capacity=3,
    ...                            on_overflow="flag")
    >>> i.tolist(), j.tolist(), d.tolist(), needed
    ([0, 3, 3], [1, 3, 3], [1.0, inf, inf], 1)

    Only the pairs of a point that has moved:

    >>> i, j = hs.pairs([[0.0], [1.0], [2.0], [3.0]], 1.0, touching=[2])
    >>> i.tolist(), j.tolist()
    ([1, 2], [2, 3])

    A bonded pair is left out, and no pair is nearer than 0.5:

    >>> i, j = hs.pairs([[0.0], [1.0], [2.0], [2.25]], 1.5, exclude=[[0, 1]], min_distance=0.5)
    >>> i.tolist(), j.tolist()
    ([1, 1], [2, 3])

    Two systems in one call, which do not see each other:

    >>> i, j = hs.pairs([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0], [0.0, 1.0]], 1.5,
    ...                 batch=[0, 0, 1, 1])
    >>> i.tolist(), j.tolist()
    ([0, 2], [1, 3])
    """
    if unknown:
        refuse_unknown(pairs, unknown)
    box = box.vectors if type(box) is Box else box
    room = None
    if capacity is not None or on_overflow is not RAISE:
        room = as_room(capacity, on_overflow, out)
    if batch is None and touching is None and (
        radii is None and types is None and rule is None and supports is None and extent is None
        and algorithm is AUTO
        and groups is None and exclude is None and exclude_within is None and min_distance is None
    ):
        # A small search takes as long as a handful of Python operations: none are made where the
        # arguments need no conversion.
        result: Any = _core.plain(
            _core.pairs, points, cutoff, box, periodic, inclusive, precision, kernel, memory_limit,
            progress, threads, quantities, sort, index_dtype, out, None, AUTO, None, room,
        )
        if result is not NotImplemented:
            return cast("Arrays", result)
    check_apart(
        out, points=points, cutoff=cutoff, box=box, batch=batch, radii=radii, types=types,
        supports=supports, touching=touching, groups=groups, exclude=exclude,
    )  # fmt: skip
    rest = as_rest(inclusive, precision, kernel, memory_limit, progress, threads)
    given = Given(radii, None, rule, types, None, supports, None, extent)
    chosen = Chosen(groups, exclude, exclude_within, min_distance)
    cutoff, shells = as_shells(cutoff, quantities, precision, given, batch)
    wanted = quantities, as_flag(sort, "sort"), as_index_bytes(index_dtype), out
    if touching is not None and not (batch is None and shells is None and room is None):
        other = "batch" if batch is not None else "capacity" if shells is None else "the letter k"
        raise ValueError(f"touching does not go with {other}")
    if batch is None:
        every = points, cutoff, box, periodic, rest, given
        search, _, reach = as_search_of_each(*every, chosen=chosen)
        if touching is None:
            return _core.pairs(*(*search, *wanted, reach, algorithm, shells, room))
        from halfshell._convert.touching import pairs_touching  # here: others do without

        return pairs_touching(search, search[0], touching, wanted, reach, algorithm)
    scene, own, reach, _ = as_systems(
        points, cutoff, box, periodic, batch, given, chosen, precision
    )
    end = (reach, algorithm) if room is None else (reach, algorithm, room)
    return _core.batch_pairs(*(*scene, *rest, *wanted, *own, *end))
