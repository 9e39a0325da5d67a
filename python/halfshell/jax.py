# SPDX-License-Identifier: BSD-3-Clause
"""Neighbour lists of JAX arrays: exact, of a fixed size, under jit, vmap and grad.

The search is a callback to the host, which gives the pairs alone; vectors and distances are
computed from them by JAX, so that derivatives of any order come from there.
"""

from __future__ import annotations

import math
import operator
from typing import Any, NamedTuple

import numpy as np

from halfshell import _show
from halfshell._convert.foreign import shown
from halfshell._errors import needs
from halfshell._functions.neighbors import entries_of
from halfshell._objects.box import Box

try:
    import jax
    import jax.numpy as jnp
except ModuleNotFoundError as error:
    if error.name != "jax":
        raise
    raise ImportError(f"{needs('halfshell.jax', 'jax')} (the extra halfshell[jax])") from None

__all__ = ["NeighborList", "neighbor_list"]

Array = Any  # jax.Array, also for type checkers where JAX is not installed


@_show.shown
class NeighborList(NamedTuple):
    """The result of `neighbor_list`: entries up to `needed`, then padding up to the capacity.

    Attributes
    ----------
    i, j : Array of int32, shape (capacity,)
        Indices, ascending by (i, j, S); the number of points beyond the last entry.
    S : Array of int32, shape (capacity, d)
        Shifts; 0 beyond the last entry.
    D : Array of the type of the positions, shape (capacity, d)
        ``positions[j] - positions[i] + S @ box``; 0 beyond the last entry.
    d : Array of the type of the positions, shape (capacity,)
        Lengths of D; infinite beyond the last entry. Where d is 0, its gradient is 0.
    needed : Array of int32, shape ()
        The true number of entries, whether or not they fit; 2**31 - 1 if there are more than that.
    overflow : Array of bool, shape ()
        Whether `needed` is above the capacity: then entries are missing.

    Examples
    --------
    >>> from halfshell.jax import NeighborList
    >>> NeighborList._fields
    ('i', 'j', 'S', 'D', 'd', 'needed', 'overflow')
    """

    i: Array
    j: Array
    S: Array
    D: Array
    d: Array
    needed: Array
    overflow: Array


def neighbor_list(
    positions: Array,
    cutoff: Any,
    *,
    capacity: int,
    box: Any = None,
    periodic: Any = None,
    half: bool = False,
    inclusive: bool = True,
) -> NeighborList:
    """Find all neighbours of each point, in arrays of a fixed length.

    Parameters
    ----------
    positions : Array of float32 or float64, shape (n, d)
        Coordinates, any length unit, 1 <= d <= 8. The search is exact for the numbers that reach
        it; but JAX converts its inputs to float32 unless ``jax_enable_x64`` is set.
    cutoff : float or Array, shape ()
        Largest distance of a pair. A Python or NumPy number stays float64, a JAX array keeps its
        own type.
    capacity : int
        The length of the result. If there are more entries, the first ones are returned and
        `overflow` is set.
    box : float, array_like or Array, shape (d,) or (d, d), or Box, optional
        As in `halfshell.pairs`. A JAX array keeps its own type in the search, and derivatives with
        respect to it exist; other values are searched as float64.
    periodic, inclusive
        As in `halfshell.pairs`.
    half : bool, default False
        Whether to list each pair once, as `halfshell.pairs` does, and not as (i, j, S) and
        (j, i, -S).

    Returns
    -------
    NeighborList
        i, j, S, D, d, the number of entries needed, and whether it exceeds `capacity`.

    Raises
    ------
    TypeError, ValueError
        If `positions` or `capacity` are of the wrong type or shape. Numbers that `halfshell.pairs`
        refuses are found in the callback; inside ``jax.jit``, JAX raises this as its own error.

    Notes
    -----
    ``jax.vmap`` searches all systems in one callback. Under ``jax.jit`` the arrays go to the
    host and back in each call, even from an accelerator.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from halfshell.jax import neighbor_list
    >>> found = neighbor_list(jnp.array([[0.0], [1.0], [3.0]]), 1.5, capacity=6, box=[4.0])
    >>> found.i.tolist(), found.j.tolist(), found.d.tolist()
    ([0, 0, 1, 2, 3, 3], [1, 2, 0, 0, 3, 3], [1.0, 1.0, 1.0, 1.0, inf, inf])
    >>> int(found.needed), bool(found.overflow)
    (4, False)
    """
    positions = jnp.asarray(positions)
    if positions.dtype not in (np.float32, np.float64):
        raise TypeError(f"positions must be of float32 or float64, got {positions.dtype}")
    if positions.ndim != 2:
        raise ValueError(f"positions must have shape (n, d), got {positions.shape}")
    capacity = operator.index(capacity)
    if not 0 <= capacity < 2**31:
        raise ValueError(f"capacity must be from 0 to 2**31 - 1, got {shown(capacity)}")
    n, dim = positions.shape
    if isinstance(box, Box):
        box = box.vectors
    if box is not None and not isinstance(box, jax.Array):
        box = np.asarray(box, np.float64)
    traced = [x for x in (cutoff, box) if isinstance(x, jax.Array)]

    def search(points: Any, *rest: Any) -> tuple[Any, ...]:
        """Find the entries of each system that vmap gives, in arrays with its leading axes."""
        left = iter(map(np.asarray, rest))
        own_cutoff = next(left) if isinstance(cutoff, jax.Array) else np.asarray(cutoff)
        own_box = next(left) if isinstance(box, jax.Array) else box
        lead = points.shape[:-2]
        s = math.prod(lead)
        systems = np.asarray(points).reshape(s, n, dim)
        cutoffs = np.broadcast_to(own_cutoff, lead).reshape(s)
        boxes: Any = [own_box] * s
        if isinstance(box, jax.Array):
            boxes = own_box.reshape(s, *box.shape)
        i, j = (np.full((s, capacity), n, np.int32) for _ in range(2))
        S, needed = np.zeros((s, capacity, dim), np.int32), np.empty(s, np.int32)
        for k, (system, reach, edges) in enumerate(zip(systems, cutoffs, boxes)):
            found = entries_of(system, float(reach), edges, periodic, None, half, inclusive)
            m = min(len(found[0]), capacity)
            for column, values in zip((i, j, S), found):
                column[k, :m] = values[:m]
            needed[k] = min(len(found[0]), 2**31 - 1)
        return tuple(x.reshape((*lead, *x.shape[1:])) for x in (i, j, S, needed))

    shapes = [
        jax.ShapeDtypeStruct(shape, np.int32)
        for shape in ((capacity,), (capacity,), (capacity, dim), ())
    ]
    given = [jax.lax.stop_gradient(x) for x in (positions, *traced)]
    i, j, S, needed = jax.pure_callback(search, shapes, *given, vmap_method="broadcast_all")
    valid = jnp.arange(capacity) < needed
    D, d = _measure(positions, i, j, S, box, valid)
    return NeighborList(i, j, S, D, d, needed, needed > capacity)


def _measure(positions: Array, i: Array, j: Array, S: Array, box: Any, valid: Array) -> Any:
    """D and d, without a derivative that is not finite where there is no entry or no length."""
    if not len(positions):
        return jnp.zeros(S.shape, positions.dtype), jnp.full(i.shape, jnp.inf, positions.dtype)
    i, j = jnp.where(valid, i, 0), jnp.where(valid, j, 0)
    D = positions[j] - positions[i]
    if box is not None:
        vectors, shifts = jnp.asarray(box, positions.dtype), S.astype(positions.dtype)
        D += shifts * vectors if vectors.ndim < 2 else (shifts[:, :, None] * vectors).sum(1)
    scale = jax.lax.stop_gradient(jnp.abs(D).max(-1))
    some = scale > 0.0
    scale = jnp.where(some, scale, 1.0)
    squares = jnp.where(some, ((D / scale[:, None]) ** 2).sum(-1), 1.0)
    d = jnp.where(some, scale * jnp.sqrt(squares), 0.0)
    return D, jnp.where(valid, d, jnp.inf)
