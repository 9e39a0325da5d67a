# SPDX-License-Identifier: BSD-3-Clause
"""The memory of results that are gone, kept for the next ones."""

from __future__ import annotations

from typing import SupportsIndex

from halfshell import _core
from halfshell._convert.foreign import is_a, kind_of, shown, whole_number


def clear_cache() -> None:
    """Give the memory that is kept for the next results back to the system.

    Large arrays that `pairs` returned leave their memory in a pool when they are deleted: writing
    to memory that the process already has is several times faster than writing to new memory. The
    pool holds at most the number of bytes that `set_cache_limit` allows.

    See Also
    --------
    set_cache_limit : how much may be kept.

    Examples
    --------
    >>> import halfshell as hs
    >>> hs.clear_cache()
    """
    _core.clear_cache()


def set_cache_limit(limit: SupportsIndex) -> int:
    """Set how many bytes of deleted results may be kept for the next ones.

    Parameters
    ----------
    limit : int
        Bytes, not negative; 0 keeps nothing. What is held beyond it is given back at once. The
        limit is 256 MB at first and holds for the whole process.

    Returns
    -------
    int
        The limit before.

    Raises
    ------
    TypeError
        If `limit` is not an integer.
    ValueError
        If it is negative.

    See Also
    --------
    clear_cache : give back what is held now.

    Examples
    --------
    >>> import halfshell as hs
    >>> before = hs.set_cache_limit(0)
    >>> hs.set_cache_limit(before)
    0
    """
    wanted = None if is_a(limit, bool) else whole_number(limit, "limit")
    if wanted is None:
        raise TypeError(f"limit must be a number of bytes, got {kind_of(limit)}")
    if wanted < 0:
        raise ValueError(f"limit must not be negative, got {shown(wanted)}")
    return _core.set_cache_limit(min(wanted, 2**63 - 1))
