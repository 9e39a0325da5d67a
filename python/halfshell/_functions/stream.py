# SPDX-License-Identifier: BSD-3-Clause
"""`iter_pairs`: signature, defaults and documentation; the work is done in C."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, Protocol, TypeVar, Unpack, cast, overload

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert import inputs as _inputs
from halfshell._convert.options import Precision, SearchOptions
from halfshell._functions.pairs import Arrays, Letter

Block = TypeVar("Block", covariant=True)

# Blocks are counted by int64, and two of them must be.
_MOST_PAIRS = 2**62


class PairBlocks(Protocol[Block]):
    """For type checkers: the iterator that `iter_pairs` returns."""

    def __iter__(self) -> PairBlocks[Block]: ...
    def __next__(self) -> Block: ...
    def close(self) -> None: ...


class _StreamOptions(SearchOptions, total=False):
    """The keywords of `iter_pairs`, without `quantities`."""

    max_pairs: int
    index_dtype: npt.DTypeLike
    progress: Callable[[float], object] | None


@overload
def iter_pairs(
    points: Any, cutoff: Any, *, quantities: Literal["ij"] = "ij", **options: Unpack[_StreamOptions]
) -> PairBlocks[tuple[npt.NDArray[Any], npt.NDArray[Any]]]: ...
@overload
def iter_pairs(
    points: Any, cutoff: Any, *, quantities: Letter, **options: Unpack[_StreamOptions]
) -> PairBlocks[npt.NDArray[Any]]: ...
@overload
def iter_pairs(
    points: Any, cutoff: Any, *, quantities: str, **options: Unpack[_StreamOptions]
) -> PairBlocks[Arrays]: ...
def iter_pairs(
    points: Any,
    cutoff: Any,
    *,
    box: Any = None,
    periodic: Any = None,
    quantities: str = "ij",
    max_pairs: int = 1 << 20,
    inclusive: bool = True,
    index_dtype: npt.DTypeLike = np.int64,
    precision: Precision = "exact",
    kernel: str | None = None,
    threads: int | None = None,
    memory_limit: float | None = None,
    progress: Callable[[float], object] | None = None,
) -> PairBlocks[Any]:
    """Iterate over all pairs of points within a cutoff, in blocks of bounded size.

    Parameters
    ----------
    points, cutoff, box, periodic, quantities, inclusive, index_dtype, precision, kernel
        As in `pairs`. They are checked, and the points copied, when `iter_pairs` is called: what
        happens to them afterwards changes nothing.
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
    most = most_pairs(max_pairs)
    array, vectors, bits = _inputs.scene(points, box, periodic)
    blocks = _core.iter_pairs(
        array, _inputs.as_cutoff(cutoff), vectors, bits, _inputs.as_flag(inclusive, "inclusive"),
        precision, kernel, memory_limit, as_progress(progress), threads, quantities,
        _inputs.as_index_bytes(index_dtype), most,
    )
    return cast("PairBlocks[Any]", blocks)


def most_pairs(max_pairs: Any) -> int:
    """A number of pairs from 1 on, as the core takes it."""
    return min(_inputs.as_count(max_pairs, "max_pairs"), _MOST_PAIRS)


def as_progress(progress: Any) -> Callable[[float], object] | None:
    """What can be called, or None."""
    if progress is None or callable(progress):
        return cast("Callable[[float], object] | None", progress)
    raise TypeError(f"progress must be callable, got {type(progress).__name__}")
