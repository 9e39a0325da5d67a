# SPDX-License-Identifier: BSD-3-Clause
"""`for_each_pair`: signature, defaults and documentation; the work is done in C."""

from __future__ import annotations

from typing import Any

from halfshell import _core
from halfshell._convert import callbacks as _callbacks
from halfshell._convert import inputs as _inputs
from halfshell._convert.options import Precision


def for_each_pair(
    points: Any,
    cutoff: Any,
    callback: Any,
    user_data: Any = None,
    *,
    box: Any = None,
    periodic: Any = None,
    inclusive: bool = True,
    precision: Precision = "exact",
    kernel: str | None = None,
    threads: int | None = None,
    memory_limit: float | None = None,
    thread_safe: bool = False,
) -> int:
    """Call a function for each pair of points within a cutoff, storing none of them.

    Parameters
    ----------
    points, cutoff, box, periodic, inclusive, precision, kernel
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
    or is subnormal. With `inclusive` d2 <= cutoff * cutoff as float64 rounds it.

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
    target = _callbacks.target_of(callback, user_data)
    array, vectors, bits = _inputs.scene(points, box, periodic)
    return _core.for_each_pair(
        array, _inputs.as_cutoff(cutoff), vectors, bits, _inputs.as_flag(inclusive, "inclusive"),
        precision, kernel, memory_limit, None, threads, target.function, target.user,
        _inputs.as_flag(thread_safe, "thread_safe"),
    )
