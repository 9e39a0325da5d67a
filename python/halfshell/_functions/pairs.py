# SPDX-License-Identifier: BSD-3-Clause
"""`pairs`: signature, defaults, documentation; the work is done in C."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast, overload

import numpy as np

from halfshell import _core
from halfshell._convert.batch import as_systems
from halfshell._convert.given import Chosen, Given
from halfshell._convert.options import AUTO, RAISE, as_flag, as_index_bytes, as_room
from halfshell._convert.quick import quick
from halfshell._convert.scene import check_apart
from halfshell._convert.search import as_rest, as_search_of_each, with_bar
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
@quick(_core.pairs, "quantities", "sort", "index_dtype", "out")
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
    progress: Callable[[float], object] | bool | None = None,
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
        anywhere, even outside the box. ``[]`` counts as shape (0, 3). An object with
        ``positions``, ``cell`` and ``pbc``, such as ``ase.Atoms``, or a ``Structure`` of pymatgen
        brings its own box and periodicity; an MDAnalysis ``AtomGroup`` or ``Universe`` brings the
        current frame's box.
    cutoff : float, array_like of float, shape (k,) or (t, t), dict or None
        Largest distance of a pair, in the unit of `points`; finite, not negative. It may be
        larger than the box. With `radii` or `supports`, a further limit, or None; with `types`,
        one for each pair of types. Several ascending cutoffs, shape (k,), go with the letter
        ``k``; the pairs are those within the last one.
    radii : array_like of float, shape (n,), optional
        A radius for each point, in the unit of `points`; finite, not negative, at most 2**1022.
        The cutoff of a pair is then what `rule` makes of its two radii, but at most `cutoff`.
    rule : {"sum", "mean", "max", "min"}, optional
        How the two radii of a pair combine: their sum, half of it, the larger or the smaller one.
        Default: "sum", so that pairs are balls that touch. With `supports`, "max" (default) means
        within the support of either point, "min" within both.
    types : array_like of int or str, shape (n,), optional
        The type of each point. `cutoff` is then a symmetric table with a row for each type from 0
        on, or a dict such as ``{(0, 1): 1.5}`` or ``{("H", "O"): 1.2}``. A key holds for both
        orders; two types without a key form no pairs. With a dict, an object such as
        ``ase.Atoms`` brings its elements as types.
    supports : array_like of float, shape (n, d, d), optional
        An ellipsoid around each point, as a symmetric positive definite matrix H, in the
        inverse unit of `points`; d <= 3. A pair with the vector D counts if
        ``|H[i] @ D| <= extent`` or ``|H[j] @ D| <= extent``; with `rule` "min", if both hold.
    extent : float, optional
        How far `supports` reach, without a unit; finite, not negative.
    box : float, array_like of float, shape (d,) or (d, d), or Box, optional
        One length for all edges, a length for each, or edge vectors as rows, in the unit of
        `points`; finite. None: open space. Rows of axes that are not periodic may be anything
        finite, such as zero. A freud box, with its periodicity, and a frame of mdtraj or
        MDAnalysis, for its box alone, are accepted too.
    periodic : bool or sequence of bool, shape (d,), optional
        Which box vectors are periodic. Default: all with a box, none without.
    quantities : str, default "ij"
        Any of the letters ``i j d D S P``, each at most once: indices, distance, vector, shift,
        both indices. Only these are computed. With several cutoffs also ``k``: the number, from 0
        on, of the smallest cutoff that the pair is within, decided exactly; not with `radii`,
        `types`, `supports`, `batch`, or a `precision` other than "exact".
    inclusive : bool, default True
        Whether a pair at exactly its cutoff counts, be it `cutoff` or the limit set by radii,
        types or supports.
    sort : bool, default False
        Sort by (i, j, S), ascending. Otherwise the order is reproducible but not specified.
    index_dtype : numpy.int64 or numpy.int32, default numpy.int64
        Type of i, j and P.
    out : ndarray or tuple of ndarray, optional
        Arrays to write to, one for each letter of `quantities`, with the type and shape of the
        result, C-contiguous, not overlapping each other or any input. They may be longer than
        the result; entries beyond it keep their values.
    capacity : int, optional
        Length of all returned arrays, at least 1, whatever the number of pairs m; for compilers
        that need fixed shapes. After the m pairs comes padding: i, j and P are n, S and D zero,
        d is infinite, k is the number of cutoffs.
    on_overflow : {"raise", "flag"}, default "raise"
        What happens if the capacity is too small: "raise" raises `CapacityError`; "flag" returns
        m after the arrays, in every case. If m exceeds the capacity, the arrays hold no pair at
        all: a list is never cut short.
    precision : {"exact", "double", "single"}, default "exact"
        "exact" decides for the exact real values of the inputs. The others make one rounded
        comparison, as most libraries do, and exist for comparison: "double" uses a fixed
        formula in float64; "single" uses float32 relative to the centre of a group of points, so
        that its answer near the cutoff also depends on the other points and their order.
    algorithm : {"auto", "all-pairs", "grid", "hash", "hierarchy"}, default "auto"
        How pairs are searched for. It may change time, memory and, without `sort`, the order, but
        not the pairs. "all-pairs" tests every pair. "grid" sorts the points into cells, as many as
        suit the number of points, so they are large if the points are far apart. "hash" stores
        only occupied cells, of which there may be any number. "hierarchy" divides the points by
        the size of their radius, or by type, and searches each two parts in cells of their own;
        without either there is one part. With `radii` or `types` the first three search once, with
        the largest cutoff, but search more than 8 types in pairs. "auto" takes what is expected to
        be fastest; `explain` tells which, and why.
    kernel : str, optional
        One of ``kernels()``; for tests and timing. All give identical arrays. Default: the value
        of the environment variable HALFSHELL_KERNEL at import, otherwise the best.
    threads : int, optional
        Maximum number of threads, at most four for each core; work of less than about half a
        millisecond uses one. Default: one for small scenes, otherwise the value of the environment
        variable ``OMP_NUM_THREADS``, or the number of cores that this process may run on.
        The arrays are the same for any number. Threads end before the call returns.
    memory_limit : float, optional
        Bytes that search and result may take. Default: what the machine has available.
    progress : bool or callable, optional
        True: show a bar in a long search, on a terminal by rich or in a notebook. A function is
        called now and then as ``progress(fraction)``, from 0 to 1, never falling; not by a
        search of a few milliseconds. An exception ends the search.
    batch : array_like of int, shape (n,), optional
        Many systems in one call: the system of each point, ascending from 0 or above; numbers may
        be skipped. Only points of the same system pair. The result is that of one call for
        each system, in ascending order, but i and j number the points of all systems. All other
        arguments hold for every system, except that `box` may have shape (s, d, d), `periodic`
        (s, d) and `cutoff` (s,), one for each system; then every number in `batch` is less than s.
        A `box` with two axes is one box for all: give the edge lengths of each system as diagonals
        of (s, d, d). Threads share out the systems. Give `radii`, `types` or `supports` for all
        points; `cutoff` is then a limit for all systems or each, or the table or dict for all.
    touching : array_like of int, shape (k,), optional
        Point numbers, each once: find only pairs that contain one of these points, for moves of a
        few. Once all points are in cells, the time depends on the number of these points. With
        ``sort=False`` pairs are in the order of `touching`, then of the other point; a pair of two
        of these points comes with the lower one. Not with `batch`, ``k`` or `precision` "single".
    groups : array_like of int or str, shape (n,), optional
        A label for each point: only pairs of equal labels count.
    exclude : array_like of int, shape (k, 2), or of int or str, shape (n,), optional
        Pairs of point numbers to leave out, in any order, such as bonds; or a label for each
        point, to leave out pairs of equal labels. A pair is left out in its nearest image only,
        decided exactly; of equally near images, in the one with the lexicographically least
        S, as seen from the point of the lower number. Images of a point itself count.
    exclude_within : int, optional
        With numbers as labels: leave out pairs whose labels differ by at most this number.
    min_distance : float, optional
        Leave out pairs that are closer than this, decided exactly; finite, not negative. Not
        with `precision` "single".

    Returns
    -------
    ndarray or tuple of ndarray
        One array per letter of `quantities`, in that order; a bare array for one letter. With
        `out`, views of its filled parts; with ``on_overflow="flag"``, a tuple of the arrays and
        the number of pairs. With m pairs: ``i``, ``j`` of `index_dtype`, shape (m,), with
        ``i < j``, or ``i == j`` for a point and its own image; ``d`` float64 (m,); ``D`` float64
        (m, d); ``S`` int32 (m, d); ``P`` of `index_dtype` (m, 2); ``k`` int32 (m,). In real
        arithmetic ``D = points[j] - points[i] + S @ box``.

        Each pair occurs once (half list): for ``i == j`` the first nonzero component of S is
        positive. (i, i, S = 0) is no pair; coincident points are pairs at distance 0. d is within
        1 ulp and never on the wrong side of the cutoff; each component of D is within 1 ulp of d.

        With radii, distances are compared with the exact result of `rule`, not a rounded one: radii
        0.1 and 0.2 do not touch at a distance of 0.30000000000000004, although that is their sum in
        Python. d is on the right side of the rounded sum, ``radii[i] + radii[j]``; without
        `inclusive` it may be equal to it.

    Raises
    ------
    TypeError
        If an argument is of the wrong kind: strings, complex numbers, long double, objects that
        cannot be converted to an array, flags that are not bools, a `progress` that cannot be
        called.
    ValueError
        If a coordinate or box entry is not finite or is masked, `cutoff` is negative or not finite,
        an integer beyond 2**53 is not a float64, the periodic box vectors are exactly linearly
        dependent or so skewed or different in length that float64 cannot place points along the
        short ones, or a shape does not fit; if the value of `quantities`, `index_dtype`,
        `precision` or `kernel` is not one of those allowed; if `quantities` has the letter k
        without several cutoffs, or these descend or are empty; if `touching` has a number that is
        not a point's, or repeats one; if `memory_limit` is negative; if `periodic` is given without
        `box`, or `box` or `periodic` with an object that brings its own; if `batch` is not
        ascending or has a negative number or one without a box or cutoff; if a radius is negative,
        not finite, above 2**1022 or, unless 0, below 2**-1021 with `rule` "mean", as its half may
        not be a float64; if `rule` is given without `radii`, or is one of the directed rules of
        `neighbors`; if a table of cutoffs is not symmetric, a dict contradicts itself or names an
        unknown element, or a type is not in the table; if a support is not finite, not symmetric
        or, decided exactly, not positive definite, or reaches further than 2**1022; if two of
        `radii`, `types` and `supports` are given; if there is not one label for each point,
        `exclude` has a number that is not a point's, `exclude_within` is negative or without
        labels, or `min_distance` is negative or not finite.
    CapacityError
        If `capacity` or an array of `out` is too small; its ``needed`` tells the length. The
        contents of `out` are then unspecified.
    OverflowError
        If there are 2**31 points or more, a number is too large for float64, or `quantities` has S
        and a shift does not fit int32; also if a point lies more than 2**51 box vectors away in a
        box that is not axis-aligned, or in any box with S in `quantities`; and if, with `precision`
        "double", points lie so many boxes away that rounding errors pass the cutoff.
    MemoryError
        If the result would not fit `memory_limit`: usually decided from a sample before the
        search, otherwise during it.

    See Also
    --------
    count_pairs : the number of pairs, without storing them.
    iter_pairs : the same pairs in blocks, if all of them would not fit.
    verify : check a list of pairs, from any library.

    Notes
    -----
    Points are sorted into cells, each cell's neighbourhood is gathered once, and pairs are tested
    in float32 with a proven error bound. Distances too close to the cutoff to tell are decided in
    float64, then double-word arithmetic [1]_, then integers, so that no pair is missed or
    invented. For evenly spread points the time is proportional to n plus the number of
    pairs; for strongly clustered points it is more. Memory does not depend on the volume.

    If you come from ASE: its lists are full and leave out pairs at exactly the cutoff. Here each
    pair is listed once; pass ``inclusive=False``. From SciPy: `box` may be one number too.

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

    Balls that touch, and cutoffs by type, with none for types 0 and 0:

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
    if isinstance(progress, bool):
        return cast("Arrays", with_bar(pairs, locals()))
    box = box.vectors if type(box) is Box else box
    is_bound = capacity is not None or on_overflow is not RAISE
    room = as_room(capacity, on_overflow, out) if is_bound else None
    if batch is None and touching is None and (
        radii is None and types is None and rule is None and supports is None and extent is None
        and algorithm is AUTO
        and groups is None and exclude is None and exclude_within is None and min_distance is None
    ):
        # `quick` has answered plain calls; here a Box has become an array, or there is a capacity.
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
        raise ValueError(f"touching cannot be combined with {other}")
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
