# SPDX-License-Identifier: BSD-3-Clause
"""Each pair once: `pairs`, `pairs_between`, in blocks `iter_pairs`, by call `for_each_pair`."""

from __future__ import annotations

from _thread import allocate_lock
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast, overload

import numpy as np

from halfshell import _core
from halfshell._convert.foreign import is_a
from halfshell._convert.options import as_flag, as_index_bytes, most_pairs
from halfshell._search import search

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Literal, Unpack

    import numpy.typing as npt

    from halfshell._convert.call import Call
    from halfshell._convert.types import (
        Arrays,
        CutoffLike,
        Letter,
        ListOptions,
        Options,
        OptionsOfPoints,
        Out,
        PointsLike,
    )

    class _PairOptions(OptionsOfPoints, ListOptions, total=False):
        """For overloads: the keywords of `pairs`, without `quantities`."""

    class _BetweenOptions(Options, total=False):
        """For overloads: the keywords of `pairs_between`, without `quantities`."""

        index_dtype: npt.DTypeLike
        out: Out | None

    class _BlockOptions(OptionsOfPoints, total=False):
        """For overloads: the keywords of `iter_pairs`, without `quantities`."""

        index_dtype: npt.DTypeLike
        max_pairs: int


# ---- pairs ---------------------------------------------------------------------------------

@overload
def pairs(
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    quantities: Literal["ij"] = "ij",
    **options: Unpack[_PairOptions],
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]: ...
@overload
def pairs(
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    quantities: Letter,
    **options: Unpack[_PairOptions],
) -> npt.NDArray[Any]: ...
@overload
def pairs(
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    quantities: str,
    **options: Unpack[_PairOptions],
) -> Arrays: ...
@search("pairs")
def pairs(
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    quantities: str = "ij",
    index_dtype: npt.DTypeLike = np.int64,
    sort: bool = False,
    out: Out | None = None,
    **search: Any,
) -> Arrays:
    """Find every pair of points within a cutoff, each once.

    Parameters
    ----------
    {points, shells, box, periodic, rule, exclude, min_distance}
    indices : array_like of int, shape (r,), optional
        Only pairs that have at least one of these points, each named once. The time depends on
        their number, once all points are in cells.
    {inclusive}
    quantities : str, default "ij"
        Any of the letters ``i j d D S P``, each at most once: indices, distance, vector, shift,
        both indices. Only these are computed. With several cutoffs also ``k``: the number, from 0
        on, of the smallest cutoff that the pair is within, decided exactly.
    {index_dtype}
    sort : bool, default False
        Sort by (i, j, S), ascending. Otherwise the order is reproducible but not specified.
    out : ndarray or tuple of ndarray, optional
        Arrays to write to, one for each letter of `quantities`, with the type and shape of the
        result, C-contiguous, not overlapping each other or any input. They may be longer than the
        result; entries beyond it keep their values.
    {threads, progress}

    Returns
    -------
    ndarray or tuple of ndarray
        One array per letter of `quantities`, in that order; a bare array for one letter. With
        `out`, views of its filled parts. With m pairs: ``i``, ``j`` of `index_dtype`, shape (m,),
        with ``i < j``, or ``i == j`` for a point and its own image; ``d`` float64 (m,); ``D``
        float64 (m, d); ``S`` int32 (m, d); ``P`` of `index_dtype` (m, 2); ``k`` int32 (m,). In real
        arithmetic ``D = points[j] - points[i] + S @ box``.

        Each pair occurs once (half list): for ``i == j`` the first nonzero component of S is
        positive. (i, i, S = 0) is no pair; coincident points are pairs at distance 0. d is within
        1 ulp and never on the wrong side of the cutoff; each component of D is within 1 ulp of d.
        Systems of a batch come one after the other, with numbers among all points.

    Raises
    ------
    TypeError
        If an argument is of the wrong kind: strings, complex numbers, long double, flags that are
        not bools.
    ValueError
        If a value or a shape is wrong. The message says where, and what is allowed: among others
        coordinates that are not finite, a negative cutoff, periodic box vectors that are exactly
        linearly dependent, or so skewed that float64 cannot place points along the short ones.
    CapacityError
        If an array of `out` is too small; its ``needed`` tells the length. The contents of `out`
        are then unspecified.
    OverflowError
        If there are 2**31 points or more, a number is too large for float64, or a shift that is
        wanted does not fit int32.
    MemoryError
        If the result would not fit: usually decided from a sample before the search, otherwise
        during it.

    See Also
    --------
    pairs_between : pairs of two sets.
    neighbors : both directions, as a table with a row for each point.
    count_pairs : the number of pairs, without storing them.
    iter_pairs : the same pairs in blocks, if all of them would not fit.
    verify : check a list of pairs, from any library.
    settings : precision, algorithm, kernel and memory limit of searches.

    Notes
    -----
    Points are sorted into cells, each cell's neighbourhood is gathered once, and pairs are tested
    in float32 with a proven error bound. Distances too close to the cutoff to tell are decided in
    float64, then double-word arithmetic [1]_, then integers, so that no pair is missed or
    invented. For evenly spread points the time is proportional to n plus the number of pairs; for
    strongly clustered points it is more. Memory does not depend on the volume.

    With radii, distances are compared with the exact result of `rule`, not a rounded one: radii
    0.1 and 0.2 do not touch at a distance of 0.30000000000000004, although that is their sum in
    Python. Of images that are equally near, `exclude` means the one with the lexicographically
    least S, as seen from the point of the lower number.

    If you come from ASE: its lists are full and leave out pairs at exactly the cutoff. Here each
    pair is listed once; pass ``inclusive=False``.

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

    >>> i, j, d, S = hs.pairs([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]], 1.5, box=4.0,
    ...                       quantities="ijdS", sort=True)
    >>> i.tolist(), j.tolist(), d.tolist(), S.tolist()
    ([0, 0], [1, 2], [1.0, 1.0], [[0, 0], [-1, 0]])

    Balls that touch, and cutoffs by type, with none for types A and A:

    >>> balls = hs.Points([[0.0], [1.0], [3.0]], radii=[0.25, 0.75, 1.0], types=["A", "A", "B"])
    >>> hs.pairs(balls, None, quantities="P").tolist()
    [[0, 1]]
    >>> hs.pairs(balls.replace(radii=None), {("A", "B"): 2.0}, quantities="P").tolist()
    [[1, 2]]

    Only the pairs of a point that has moved:

    >>> hs.pairs([[0.0], [1.0], [2.0], [3.0]], 1.0, indices=[2], quantities="P").tolist()
    [[1, 2], [2, 3]]

    A bonded pair is left out, and no pair is nearer than 0.5:

    >>> i, j = hs.pairs([[0.0], [1.0], [2.0], [2.25]], 1.5, exclude=[[0, 1]], min_distance=0.5)
    >>> i.tolist(), j.tolist()
    ([1, 1], [2, 3])

    Two systems in one call, which do not see each other:

    >>> i, j = hs.pairs([[[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]]], 1.5)
    >>> i.tolist(), j.tolist()
    ([0, 2], [1, 3])
    """
    from halfshell._convert.call import check_shells, shells_of, take  # for what C does not convert

    several = shells_of(quantities)
    check_apart(out, quantities, points=points, cutoff=cutoff, **search)
    call = take(points, cutoff, several=several, **search)
    check_shells(call, quantities)
    wanted = quantities, as_flag(sort, "sort"), as_index_bytes(index_dtype), out
    if call.indices is not None:
        from halfshell._functions.indices import pairs_of_some  # few calls need it

        return pairs_of_some(call, *wanted)
    return pairs_wanted(call, *wanted)


def pairs_wanted(
    call: Call, quantities: str, sort: bool, index_bytes: int, out: Any
) -> Arrays:
    """The pairs of a call."""
    wanted = quantities, sort, index_bytes, out
    end = call.pairing, call.settings.algorithm, call.shells
    return cast("Arrays", call.run(_core.pairs, *wanted, *end))


def check_apart(out: Any, quantities: str, **inputs: Any) -> None:
    """ValueError if an array of `out` may share memory with an input, which it names."""
    outputs = out if is_a(out, tuple) else (out,)
    for name, values in inputs.items():
        for letter, array in zip(str.__str__(quantities), outputs, strict=False):
            both = is_a(array, np.ndarray) and is_a(values, np.ndarray)
            if both and np.may_share_memory(array, values):
                raise ValueError(f"out for {letter!r} must not share memory with {name}")


# ---- pairs of two sets ---------------------------------------------------------------------

@overload
def pairs_between(
    queries: PointsLike,
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    quantities: Literal["ij"] = "ij",
    **options: Unpack[_BetweenOptions],
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]: ...
@overload
def pairs_between(
    queries: PointsLike,
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    quantities: Letter,
    **options: Unpack[_BetweenOptions],
) -> npt.NDArray[Any]: ...
@overload
def pairs_between(
    queries: PointsLike,
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    quantities: str,
    **options: Unpack[_BetweenOptions],
) -> Arrays: ...
@search("pairs_between", lacks="indices")
def pairs_between(
    queries: PointsLike,
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    quantities: str = "ij",
    index_dtype: npt.DTypeLike = np.int64,
    out: Out | None = None,
    **search: Any,
) -> Arrays:
    """Find every pair of a query and a point within a cutoff.

    Parameters
    ----------
    queries : array_like of float, shape (q, d), or Points
        Coordinates of queries, in the unit of `points` and with as many columns. They may lie
        anywhere. float32 and float64 may be mixed: each number is used as it is.
    {points, shells, box, periodic, rule, exclude, min_distance, inclusive}
    quantities : str, default "ij"
        Any of the letters ``i j d D S P``, each at most once, as in `pairs`; with several cutoffs
        also ``k``.
    {index_dtype}
    out : ndarray or tuple of ndarray, optional
        As in `pairs`.
    {threads, progress}

    Returns
    -------
    ndarray or tuple of ndarray
        As `pairs`: i is the number of a query, j that of a point, and in real arithmetic
        ``D = points[j] - queries[i] + S @ box``. Ascending (i, j, S).

        Nothing is left out: a query that coincides with a point is its neighbour at distance 0,
        even if you pass one array as both, and each image of a point within the cutoff is a pair.

    Raises
    ------
    TypeError, ValueError, CapacityError, OverflowError, MemoryError
        As for `pairs`. ValueError also if `queries` and `points` differ in their number of columns
        or in their box, or one of them lacks what `rule` or `cutoff` go by.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]]
    >>> i, j, d = hs.pairs_between([[0.5, 0.0], [9.0, 9.0]], points, 1.0, quantities="ijd")
    >>> i.tolist(), j.tolist(), d.tolist()
    ([0, 0], [0, 1], [0.5, 0.5])

    Each point is found by a query at the same place:

    >>> i, j = hs.pairs_between(points, points, 1.0)
    >>> i.tolist(), j.tolist()
    ([0, 0, 1, 1, 2], [0, 1, 0, 1, 2])

    A radius for each query:

    >>> queries = hs.Points(points[:2], radii=[1.0, 2.0])
    >>> i, j = hs.pairs_between(queries, points, None, rule="gather")
    >>> i.tolist(), j.tolist()
    ([0, 0, 1, 1, 1], [0, 1, 0, 1, 2])
    """
    from halfshell._convert.call import check_shells, shells_of, take  # as above

    several = shells_of(quantities)
    check_apart(out, quantities, queries=queries, points=points, cutoff=cutoff, **search)
    call = take(points, cutoff, queries, directed=True, several=several, **search)
    check_shells(call, quantities)
    found = call.run(
        _core.pairs_between, quantities, True, as_index_bytes(index_dtype), out, call.query_set,
        call.pairing, call.settings.algorithm, call.shells,
    )  # fmt: skip
    return cast("Arrays", found)


# ---- none or few of them held --------------------------------------------------------------

#: Pairs that are made into Python objects at a time, for a Python callable.
_CALLED_AT_A_TIME = 512

Block = TypeVar("Block", covariant=True)


class PairBlocks(Generic[Block]):
    """The iterator that `iter_pairs` returns."""

    def __init__(self, stream: Any, progress: Any) -> None:
        self._stream, self._progress, self._lock = stream, progress, allocate_lock()

    def __iter__(self) -> PairBlocks[Block]:
        return self

    def __next__(self) -> Block:
        return cast("Block", self._take(False))

    def close(self) -> None:
        """Give back all memory; no block follows."""
        self._take(True)

    def __reduce__(self) -> Any:
        raise TypeError("a search that goes on cannot be copied or pickled: call iter_pairs again")

    def _take(self, closes: bool) -> Any:
        if not self._lock.acquire(blocking=False):  # a hook that asks, or another thread
            raise ValueError("iter_pairs is already looking for the next block")
        try:
            block = None
            if self._stream is not None and not closes:
                block = _core.next_block(self._stream, self._progress)
            if block is None:
                self._stream = self._progress = None
        finally:
            self._lock.release()
        if block is None and not closes:
            raise StopIteration
        return block


@overload
def iter_pairs(
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    quantities: Literal["ij"] = "ij",
    **options: Unpack[_BlockOptions],
) -> PairBlocks[tuple[npt.NDArray[Any], npt.NDArray[Any]]]: ...
@overload
def iter_pairs(
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    quantities: Letter,
    **options: Unpack[_BlockOptions],
) -> PairBlocks[npt.NDArray[Any]]: ...
@overload
def iter_pairs(
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    quantities: str,
    **options: Unpack[_BlockOptions],
) -> PairBlocks[Arrays]: ...
@search("iter_pairs", finish=lambda found, *_, **__: PairBlocks(*found))
def iter_pairs(
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    quantities: str = "ij",
    index_dtype: npt.DTypeLike = np.int64,
    max_pairs: int = 1 << 20,
    **search: Any,
) -> PairBlocks[Any]:
    """Iterate over all pairs of points within a cutoff, in blocks of bounded size.

    Parameters
    ----------
    {points, shells, box, periodic, rule, exclude, min_distance}
    indices : array_like of int, shape (r,), optional
        As in `pairs`.
    {inclusive}
    quantities : str, default "ij"
        As in `pairs`.
    {index_dtype}
    max_pairs : int, default 2**20
        Number of pairs in each block except the last, which may have fewer; at least 1. Blocks of
        fewer than 65 536 pairs are cut from larger ones.
    threads : int, optional
        As in `pairs`. Threads run while a block is being made and end before it is returned.
    progress : bool or callable, optional
        As in `pairs`, with the fraction of the points that are done, until the iterator ends or is
        closed. An exception ends the call; the iterator can continue afterwards, but for
        `indices`.

    Returns
    -------
    iterator of ndarray or tuple of ndarray
        Each block is what `pairs` returns, in new arrays. Concatenated, the blocks are the result
        of `pairs` with ``sort=False``, in the same order, for any `max_pairs` and any number of
        threads. Without pairs there is no block. ``close()``, or deleting the iterator, releases
        all memory early.

    Raises
    ------
    TypeError, ValueError, OverflowError
        As for `pairs`, by the call itself. OverflowError for a shift that does not fit int32 is
        raised at its block. ValueError if two threads, or `progress`, advance the iterator while it
        is running.

    Notes
    -----
    Arguments are checked and copied when `iter_pairs` is called; later changes to them have no
    effect. The iterator holds the points in cells, one block, and pairs found beyond it: at most
    about 256 kB for each thread and the pairs of 64 points with 4096 candidates. A returned block
    belongs to the caller; if memory is tight, delete it before you take the next one.

    Ctrl-C works between and within blocks, and takes a few milliseconds at most; the iterator then
    continues where it was.

    Examples
    --------
    >>> import numpy as np
    >>> import halfshell as hs
    >>> points = np.random.default_rng(0).random((1000, 3))
    >>> histogram = np.zeros(10, dtype=np.int64)
    >>> for d in hs.iter_pairs(points, 0.1, box=1.0, quantities="d", max_pairs=500):
    ...     histogram += np.histogram(d, bins=10, range=(0.0, 0.1))[0]
    >>> int(histogram.sum()) == hs.count_pairs(points, 0.1, box=1.0)
    True
    """
    from halfshell._convert.call import check_shells, shells_of, take  # as above

    most = most_pairs(max_pairs)
    call = take(points, cutoff, several=shells_of(quantities), **search)
    check_shells(call, quantities)
    index_bytes = as_index_bytes(index_dtype)
    if call.indices is not None:
        from halfshell._convert.call import Known, Pairing  # few calls need them
        from halfshell._functions.indices import blocks_of_some
        from halfshell._objects.exact import copied

        call.points = call.points.replace()  # a copy, as the caller's arrays may change
        call.known = Known(*copied(tuple(call.known)))
        call.pairing = call.pairing and Pairing(*copied(tuple(call.pairing)))
        call.shells, call.system_cutoffs = copied((call.shells, call.system_cutoffs))
        parts = blocks_of_some(call, quantities, index_bytes)
        return cast("PairBlocks[Any]", _in_blocks(parts, quantities, most))
    own = quantities, index_bytes, most, call.pairing, call.settings.algorithm, call.shells
    return PairBlocks(*_core.iter_pairs(*call.core, *own))


def _in_blocks(parts: Iterator[Any], quantities: str, most: int) -> Iterator[Any]:
    """Columns of some pairs at a time, as blocks of one length."""
    held: list[list[npt.NDArray[Any]]] = [[] for _ in quantities]
    n_held = 0
    for columns in parts:
        for column, kept in zip(columns, held, strict=True):
            kept.append(column)
        n_held += len(columns[0])
        if n_held >= most:
            whole = [np.concatenate(kept) for kept in held]
            for first in range(0, n_held - most + 1, most):
                yield _as_block([column[first : first + most].copy() for column in whole])
            n_held %= most
            held = [[column[len(column) - n_held :]] for column in whole]
    if n_held:
        yield _as_block([np.concatenate(kept) for kept in held])


def _as_block(columns: list[npt.NDArray[Any]]) -> Any:
    return columns[0] if len(columns) == 1 else tuple(columns)


@search(lacks="indices progress")
def for_each_pair(
    points: PointsLike,
    cutoff: CutoffLike,
    callback: Any,
    *,
    user_data: Any = None,
    thread_safe: bool = False,
    **search: Unpack[Options],
) -> int:
    """Call a function for each pair of points within a cutoff, storing none of them.

    Parameters
    ----------
    {points, cutoff}
    callback : scipy.LowLevelCallable, numba cfunc, ctypes or cffi function pointer, or callable
        The function to call. A compiled function has the C signature ::

            int f(int64_t i, int64_t j, const int32_t *S, const double *D, double d2, void *user)

        where ``S`` and ``D`` have d entries and are valid during the call only. Any return value
        but 0 ends the search. The function runs without the GIL; it must return, and may itself
        search. Its types are checked as far as `callback` reveals them. Any other callable is
        called as ``callback(i, j, S, D, d2)`` with ints, a tuple of d ints, a tuple of d floats
        and a float; a true result ends the search, an exception ends it and is raised here.
    user_data : optional
        The pointer ``user``: a ctypes or cffi pointer, an address as int, or an array or another
        contiguous buffer, whose memory is passed directly. None: NULL, or the pointer of a
        `LowLevelCallable`. Not for Python callables.
    {box, periodic, rule, exclude, min_distance, inclusive}
    thread_safe : bool, default False
        Whether several threads may call a compiled function at once. Then the order of the pairs
        is unspecified, and its writes to shared memory must be atomic or locked.
    threads : int, optional
        As in `pairs`. For a Python callable, which one thread calls, they find the pairs. For
        others they only sort the points, unless `thread_safe`.

    Returns
    -------
    int
        The number of pairs for which the function was called, including the one that ended the
        search.

    Raises
    ------
    TypeError
        If `callback` is none of these or has another signature, which the message shows;
        otherwise as for `pairs`.
    ValueError, OverflowError, MemoryError
        As for `pairs`; OverflowError also if a shift does not fit int32. ValueError if a pointer
        is NULL.
    Exception
        Whatever a Python callable raises. An exception within a ctypes callback is printed by
        ctypes and not seen here.

    Notes
    -----
    Each pair comes once, with ``i < j`` or oriented as in `pairs`, in the order of
    `pairs` with ``sort=False``. Systems of a batch come one after the other, with numbers among all
    points. S is zero along axes that are not periodic. D is that of `pairs`,
    and ``d2`` is ``d * d``, rounded once, of its d: sqrt(d2) gives d back, unless d * d overflows
    or is subnormal. With `inclusive`, d2 <= cutoff * cutoff as float64 rounds it.

    The function runs with round-to-nearest and without flushing of subnormal numbers. Ctrl-C is
    checked between calls, about once in ten thousand pairs. If the function ends the search in
    one thread, the others may still visit pairs of a few hundred points each.

    Examples
    --------
    >>> import halfshell as hs
    >>> bonds = []
    >>> hs.for_each_pair([[0.0], [1.0], [2.5]], 1.5,
    ...                  lambda i, j, S, D, d2: bonds.append((i, j, D, d2)))
    2
    >>> sorted(bonds)
    [(0, 1, (1.0,), 1.0), (1, 2, (1.5,), 2.25)]
    """
    from halfshell._convert.call import take  # as above
    from halfshell._convert.callbacks import target_of  # few calls need it

    target = target_of(callback, user_data)
    call = take(points, cutoff, **search)
    is_safe, end = as_flag(thread_safe, "thread_safe"), (call.pairing, call.settings.algorithm)
    if target is not None:
        found = call.run(_core.for_each_pair, target.function, target.user, is_safe, *end)
        return cast("int", found)
    own = "ijSDd", 8, _CALLED_AT_A_TIME
    blocks: PairBlocks[Any] = PairBlocks(*_core.iter_pairs(*call.core, *own, *end, None))
    n_pairs = 0
    for i, j, S, D, d in blocks:
        squares = [length * length for length in d.tolist()]
        vectors = zip(*S.T.tolist(), strict=True), zip(*D.T.tolist(), strict=True)
        for pair in zip(i.tolist(), j.tolist(), *vectors, squares, strict=True):
            n_pairs += 1
            if callback(*pair):
                return n_pairs
    return n_pairs
