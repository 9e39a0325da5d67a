# SPDX-License-Identifier: BSD-3-Clause
"""Memory: whether arrays that Python makes would fit, and what is kept of deleted results.

The core checks its own allocations.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from halfshell import _core, _show
from halfshell._convert.foreign import exact_number, is_a, kind_of, shown, whole_number

if TYPE_CHECKING:
    import numpy.typing as npt

SMALL = 1 << 26  # bytes; below them the system is not asked what is left


def refuse_unavailable(needed: int, what: str) -> None:
    """MemoryError before results that would make the machine swap, or fit no address space."""
    if needed > SMALL and needed > _core.available_memory():
        raise MemoryError(f"{what} would take {gigabytes(needed)} GB, more than is available")


def gigabytes(n_bytes: int) -> str:
    return f"{n_bytes / 1e9:.3g}" if n_bytes < 2**1000 else "more than 1e+290"


def refuse_large(needed: int, array: npt.NDArray[Any], name: str) -> None:
    """MemoryError before a copy that would make the machine swap: views may be huge."""
    if needed > SMALL:
        what = f"{name} of shape {array.shape} and dtype {array.dtype}, copied,"
        refuse_unavailable(needed, what)


@_show.shown
class CacheInfo(NamedTuple):
    """What `cache_info` returns.

    Attributes
    ----------
    held : int
        Bytes of deleted results, and of what calls have worked in, that are kept for the next ones.
    limit : int
        Bytes that may be kept: what `set_cache_limit` said last, 512 MB at first.

    Examples
    --------
    >>> import halfshell as hs
    >>> hs.clear_cache()
    >>> held, limit = hs.cache_info()
    >>> held
    0
    """

    held: int
    limit: int


def cache_info() -> CacheInfo:
    """Tell how much memory of deleted results and finished calls is kept, and how much may be.

    Returns
    -------
    CacheInfo
        A named tuple ``(held, limit)``, in bytes, for the whole process. Arrays that are still in
        use do not count.

    See Also
    --------
    clear_cache : release the memory that is kept now.
    set_cache_limit : how much may be kept.

    Examples
    --------
    >>> import numpy as np
    >>> import halfshell as hs
    >>> i, j = hs.pairs(np.random.default_rng(0).random((5000, 3)), 0.1)
    >>> del i, j
    >>> hs.cache_info().held > 0
    True
    >>> hs.clear_cache()
    >>> hs.cache_info().held
    0
    """
    return CacheInfo(*_core.cache_info())


def clear_cache() -> None:
    """Give the memory that is kept for the next results back to the system.

    Large arrays that `pairs` returned leave their memory in a pool when they are deleted: writing
    to memory that the process already has is several times faster than writing to new memory. The
    pool holds at most the number of bytes that `set_cache_limit` allows.

    See Also
    --------
    cache_info : how much is kept now.
    set_cache_limit : how much may be kept.

    Examples
    --------
    >>> import halfshell as hs
    >>> hs.clear_cache()
    """
    _core.clear_cache()


def set_cache_limit(limit: float) -> int:
    """Set how many bytes of deleted results may be kept for the next ones.

    Parameters
    ----------
    limit : float
        Bytes, not negative; 0 keeps nothing. Memory kept beyond it is released at once. The
        limit is 512 MB at first and holds for the whole process.

    Returns
    -------
    int
        The limit before.

    Raises
    ------
    TypeError
        If `limit` is not a number.
    ValueError
        If it is negative, or not a number (NaN).

    See Also
    --------
    cache_info : how much is kept now, and the limit.
    clear_cache : release the memory that is kept now.

    Examples
    --------
    >>> import halfshell as hs
    >>> before = hs.set_cache_limit(0)
    >>> hs.set_cache_limit(before)
    0
    """
    wanted = exact_number(limit)
    if wanted is None:  # what stands for an integer
        wanted = whole_number(limit, "limit")
    if wanted is None or is_a(wanted, bool):
        raise TypeError(f"limit must be a number of bytes, got {kind_of(limit)}")
    if not wanted >= 0:
        raise ValueError(f"limit must not be negative, got {shown(wanted)}")
    return _core.set_cache_limit(int(min(wanted, 2**63 - 1)))
