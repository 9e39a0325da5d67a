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
    progress: Callable[[float], object] | None


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
    progress: Callable[[float], object] | None = None,
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
        As in `pairs`. They are checked and copied when `iter_pairs` is called: what happens to
        them afterwards changes nothing.
    quantities, inclusive, index_dtype, precision, algorithm, kernel
        As in `pairs`.
    max_pairs : int, default 2**20
        Pairs in each block but the last, which has what is left; at least 1. Blocks of fewer than
        65 536 pairs are cut from larger ones.
    threads : int, optional
        As in `pairs`. Threads work while a block is being made and end before it is returned.
    memory_limit : float, optional
        Bytes that the search and what it holds ready may take, not counting blocks that were
        returned. Default: what the machine and its control group have available.
    progress : callable, optional
        Called now and then, at least once for each time that pairs are looked for, as
        ``progress(fraction)``: the part of the points that has been dealt with, from 0 to 1. It
        never falls, for any number of threads, and is 1 once all pairs have been found; without
        points it is not called. An exception ends the call, and the iterator can go on.
    groups, exclude, exclude_within, min_distance
        As in `pairs`.

    Returns
    -------
    iterator of ndarray or tuple of ndarray
        Each block is what `pairs` returns, new arrays that are the caller's. One after the other
        they are the result of `pairs` with ``sort=False``, in the same order, for any `max_pairs`
        and any number of threads. Without pairs there is no block. ``close()`` gives back all
        memory early; so does forgetting the iterator.

    Raises
    ------
    TypeError, ValueError, OverflowError
        As `pairs`, by the call itself; also TypeError or ValueError if `max_pairs` is no whole
        number from 1 on or `progress` cannot be called. OverflowError for a shift that does not
        fit int32 comes with the block it would be in. ValueError if two threads ask one iterator
        at a time, or `progress` asks it.
    MemoryError
        If the search, or a block, would not fit `memory_limit`.

    See Also
    --------
    pairs : all pairs at once.
    for_each_pair : hand each pair to a compiled function.

    Notes
    -----
    The iterator holds the points in cells, one block, and what was found beyond it: at most about
    256 kB for each thread and the pairs of 64 points with 4096 candidates. A block that was
    returned belongs to the caller; drop it before asking for the next one where memory is tight.

    Ctrl-C works between blocks and within them, in at most some milliseconds; the iterator can be
    asked again afterwards and goes on where it was.

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
        What to call. A compiled function has the C signature ::

            int f(int64_t i, int64_t j, const int32_t *S, const double *D, double d2, void *user)

        where ``S`` and ``D`` have d entries and are valid during the call only, and anything but
        0 ends the search. It is called without Python's lock; it must return, and may itself
        search. Its types are checked as far as `callback` tells them. Any other callable is
        called as ``callback(i, j, S, D, d2)`` with ints, a tuple of d ints, a tuple of d floats
        and a float; a true result ends the search, an exception ends it and is raised here.
    user_data : optional
        The pointer ``user``: a ctypes or cffi pointer, an address as int, or an array or another
        contiguous buffer, whose memory is passed as it is. None: NULL, or what a
        `LowLevelCallable` brings. Not for Python callables.
    threads : int, optional
        As in `pairs`. Without `thread_safe` they only sort the points.
    memory_limit : float, optional
        Bytes that the search may take.
    thread_safe : bool, default False
        Declares that several threads may call the function at once. Then the order of the pairs
        is unspecified, and what it writes to must be atomic or guarded.
    groups, exclude, exclude_within, min_distance
        As in `pairs`.

    Returns
    -------
    int
        The number of pairs that the function was called for, the one that ended the search
        included.

    Raises
    ------
    TypeError
        If `callback` is none of these or has another signature, which the message shows;
        otherwise as `pairs`.
    ValueError, OverflowError
        As `pairs`; OverflowError also if a shift does not fit int32. ValueError if a pointer is
        NULL.
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
    Each pair comes once, with ``i < j`` or the orientation that `pairs` says, in the order of
    `pairs` with ``sort=False``. S is zero where the box does not repeat. D is that of `pairs`,
    and ``d2`` is ``d * d``, rounded once, of its d: sqrt(d2) gives d back, unless d * d overflows
    or is subnormal. With `inclusive` d2 <= cutoff * cutoff as float64 rounds it, and so with
    radii of their reach.

    The function runs with round-to-nearest and without flushing of subnormal numbers. Ctrl-C is
    looked for between calls, once for some ten thousand pairs. When a function ends the search on
    threads, the others may still visit pairs of a few hundred points each.

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
