# SPDX-License-Identifier: BSD-3-Clause
"""`iter_pairs` and `for_each_pair`: all pairs, of which few or none are held; done in C."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, Never, Unpack, cast, overload

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.given import Chosen, Given
from halfshell._convert.options import as_flag, as_index_bytes, most_pairs
from halfshell._convert.search import as_rest, as_search_of_each
from halfshell._convert.shells import as_shells
from halfshell._convert.types import (
    Algorithm,
    ArrayLike,
    Arrays,
    BoxLike,
    Letter,
    PairBlocks,
    PairCutoff,
    PeriodicLike,
    PointsLike,
    Precision,
    ReachOptions,
    Rule,
)
from halfshell._unknown import refuse_unknown


class _StreamOptions(ReachOptions, total=False):
    """For overloads: the keywords of `iter_pairs`, without `quantities`."""

    max_pairs: int
    index_dtype: npt.DTypeLike
    progress: Callable[[float], object] | bool | None


@overload
def iter_pairs(
    points: PointsLike,
    cutoff: PairCutoff,
    *,
    quantities: Literal["ij"] = "ij",
    **options: Unpack[_StreamOptions],
) -> PairBlocks[tuple[npt.NDArray[Any], npt.NDArray[Any]]]: ...
@overload
def iter_pairs(
    points: PointsLike, cutoff: PairCutoff, *, quantities: Letter, **options: Unpack[_StreamOptions]
) -> PairBlocks[npt.NDArray[Any]]: ...
@overload
def iter_pairs(
    points: PointsLike, cutoff: PairCutoff, *, quantities: str, **options: Unpack[_StreamOptions]
) -> PairBlocks[Arrays]: ...
def iter_pairs(
    points: PointsLike,
    cutoff: PairCutoff,
    *,
    radii: ArrayLike | None = None,
    rule: Rule | None = None,
    types: npt.ArrayLike | None = None,
    supports: ArrayLike | None = None,
    extent: float | None = None,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    quantities: str = "ij",
    max_pairs: int = 1 << 20,
    inclusive: bool = True,
    index_dtype: npt.DTypeLike = np.int64,
    precision: Precision = "exact",
    algorithm: Algorithm = "auto",
    kernel: str | None = None,
    threads: int | None = None,
    memory_limit: float | None = None,
    progress: Callable[[float], object] | bool | None = None,
    groups: npt.ArrayLike | None = None,
    exclude: npt.ArrayLike | None = None,
    exclude_within: int | None = None,
    min_distance: float | None = None,
    **unknown: Never,
) -> PairBlocks[Any]:
    """Iterate over all pairs of points within a cutoff, in blocks of bounded size.

    Parameters
    ----------
    points, cutoff, radii, rule, types, supports, extent, box, periodic
        As in `pairs`. They are checked and copied when `iter_pairs` is called; later changes to
        them have no effect.
    quantities, inclusive, index_dtype, precision, algorithm, kernel
        As in `pairs`.
    max_pairs : int, default 2**20
        Number of pairs in each block except the last, which may have fewer; at least 1. Blocks of
        fewer than 65 536 pairs are cut from larger ones.
    threads : int, optional
        As in `pairs`. Threads run while a block is being made and end before it is returned.
    memory_limit : float, optional
        Bytes that the search and its buffers may take, not counting blocks already
        returned. Default: what the machine and its control group have available.
    progress : bool or callable, optional
        True: show a bar, as in `pairs`, until the iterator ends or is closed. A function is called
        now and then, at least once each time the iterator searches for more pairs, as
        ``progress(fraction)``, with the fraction of the points that are done, from 0 to 1. It
        never falls, for any number of threads, and is 1 once all pairs have been found; without
        points it is not called. An exception ends the call; the iterator can continue afterwards.
    groups, exclude, exclude_within, min_distance
        As in `pairs`.

    Returns
    -------
    iterator of ndarray or tuple of ndarray
        Each block is what `pairs` returns, in new arrays. Concatenated, the blocks are the result
        of `pairs` with ``sort=False``, in the same order, for any `max_pairs`
        and any number of threads. Without pairs there is no block. ``close()``, or deleting the
        iterator, releases all memory early.

    Raises
    ------
    TypeError, ValueError, OverflowError
        As for `pairs`, by the call itself; also TypeError or ValueError if `max_pairs` is not a
        whole number from 1 on or `progress` cannot be called. OverflowError for a shift that does
        not fit int32 is raised at its block. ValueError if two threads, or `progress`, advance the
        iterator while it is running.
    MemoryError
        If the search, or a block, would not fit `memory_limit`.

    See Also
    --------
    pairs : all pairs at once.
    for_each_pair : pass each pair to a compiled function.

    Notes
    -----
    The iterator holds the points in cells, one block, and pairs found beyond it: at most about
    256 kB for each thread and the pairs of 64 points with 4096 candidates. A returned block
    belongs to the caller; if memory is tight, delete it before you take the next one.

    Ctrl-C works between and within blocks, and takes a few milliseconds at most; the iterator
    then continues where it was.

    Examples
    --------
    >>> import numpy as np
    >>> import halfshell as hs
    >>> points = np.random.default_rng(0).random((1000, 3))
    >>> histogram = np.zeros(10, dtype=np.int64)
    >>> for d in hs.iter_pairs(points, 0.1, box=[1.0] * 3, quantities="d", max_pairs=500):
    ...     histogram += np.histogram(d, bins=10, range=(0.0, 0.1))[0]
    >>> int(histogram.sum()) == hs.count_pairs(points, 0.1, box=[1.0] * 3)
    True
    """
    if unknown:
        refuse_unknown(iter_pairs, unknown)
    most = most_pairs(max_pairs)
    rest = as_rest(inclusive, precision, kernel, memory_limit, progress, threads)
    given = Given(radii, None, rule, types, None, supports, None, extent)
    chosen = Chosen(groups, exclude, exclude_within, min_distance)
    cutoff, shells = as_shells(cutoff, quantities, precision, given)
    search, _, reach = as_search_of_each(
        points, cutoff, box, periodic, rest, given, chosen=chosen
    )
    blocks = _core.iter_pairs(
        *search, quantities, as_index_bytes(index_dtype), most, reach, algorithm, shells
    )
    return cast("PairBlocks[Any]", blocks)


def for_each_pair(
    points: PointsLike,
    cutoff: PairCutoff,
    callback: Any,
    *,
    user_data: Any = None,
    radii: ArrayLike | None = None,
    rule: Rule | None = None,
    types: npt.ArrayLike | None = None,
    supports: ArrayLike | None = None,
    extent: float | None = None,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    inclusive: bool = True,
    precision: Precision = "exact",
    algorithm: Algorithm = "auto",
    kernel: str | None = None,
    threads: int | None = None,
    memory_limit: float | None = None,
    thread_safe: bool = False,
    groups: npt.ArrayLike | None = None,
    exclude: npt.ArrayLike | None = None,
    exclude_within: int | None = None,
    min_distance: float | None = None,
    **unknown: Never,
) -> int:
    """Call a function for each pair of points within a cutoff, storing none of them.

    Parameters
    ----------
    points, cutoff, radii, rule, types, supports, extent, box, periodic
        As in `pairs`.
    inclusive, precision, algorithm, kernel
        As in `pairs`.
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
    threads : int, optional
        As in `pairs`. Without `thread_safe` they only sort the points.
    memory_limit : float, optional
        Bytes that the search may take.
    thread_safe : bool, default False
        Whether several threads may call the function at once. Then the order of the pairs
        is unspecified, and its writes to shared memory must be atomic or locked.
    groups, exclude, exclude_within, min_distance
        As in `pairs`.

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
    ValueError, OverflowError
        As for `pairs`; OverflowError also if a shift does not fit int32. ValueError if a pointer
        is NULL.
    MemoryError
        If the search itself would not fit.
    Exception
        Whatever a Python callable raises. An exception within a ctypes callback is printed by
        ctypes and not seen here.

    See Also
    --------
    iter_pairs : blocks of arrays.
    pairs : all pairs at once.

    Notes
    -----
    Each pair comes once, with ``i < j`` or oriented as in `pairs`, in the order of
    `pairs` with ``sort=False``. S is zero along axes that are not periodic. D is that of `pairs`,
    and ``d2`` is ``d * d``, rounded once, of its d: sqrt(d2) gives d back, unless d * d overflows
    or is subnormal. With `inclusive`, d2 <= cutoff * cutoff as float64 rounds it; with radii, the
    same holds for the cutoff of each pair.

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
    if unknown:
        refuse_unknown(for_each_pair, unknown)
    from halfshell._convert.callbacks import target_of  # here: iter_pairs does without

    target = target_of(callback, user_data)
    rest = as_rest(inclusive, precision, kernel, memory_limit, None, threads)
    given = Given(radii, None, rule, types, None, supports, None, extent)
    chosen = Chosen(groups, exclude, exclude_within, min_distance)
    search, _, reach = as_search_of_each(
        points, cutoff, box, periodic, rest, given, chosen=chosen
    )
    return _core.for_each_pair(
        *search, target.function, target.user, as_flag(thread_safe, "thread_safe"), reach,
        algorithm,
    )
