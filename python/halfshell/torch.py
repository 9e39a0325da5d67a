# SPDX-License-Identifier: BSD-3-Clause
"""Neighbour lists of PyTorch tensors on the CPU: exact, with derivatives, and under torch.compile.

The search is an operator that PyTorch knows and that has no derivative: which pairs there are does
not change under an infinitesimal step. Vectors and distances are computed from its pairs by
PyTorch, so that derivatives of any order come from there.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from halfshell._convert.options import check_letters
from halfshell._convert.points import Points
from halfshell._errors import CapacityError, needs
from halfshell._functions.neighbors import entries_of
from halfshell._functions.pairs import pairs_between
from halfshell._objects.box import Box

try:
    import torch
except ModuleNotFoundError as error:
    if error.name != "torch":
        raise
    raise ImportError(f"{needs('halfshell.torch', 'torch')} (the extra halfshell[torch])") from None

__all__ = ["neighbor_list", "radius", "radius_graph"]

Tensor = Any  # torch.Tensor, also for type checkers where torch is not installed

_HALVES = (torch.float16, torch.bfloat16)
_FLOATS = (*_HALVES, torch.float32, torch.float64)


def neighbor_list(
    positions: Tensor,
    cutoff: float,
    *,
    box: Any = None,
    periodic: Any = None,
    quantities: str = "ij",
    half: bool = False,
    inclusive: bool = True,
    batch: Tensor | None = None,
) -> Tensor | tuple[Tensor, ...]:
    """Find all neighbours of each point.

    Parameters
    ----------
    positions : Tensor of float64, float32, float16 or bfloat16, shape (n, d)
        Coordinates on the CPU, any length unit, 1 <= d <= 8. They are searched as they are, without
        a copy if they are contiguous and not halves, which float32 holds exactly.
    cutoff, periodic, inclusive
        As in `halfshell.pairs`.
    box : float, array_like or Tensor, shape (d,), (d, d) or (s, d, d), or Box, optional
        As in `halfshell.pairs`. d and D can be differentiated with respect to a tensor.
    quantities : str, default "ij"
        Any of the letters ``i j d D S P``: indices, distance, vector, shift, both indices.
    half : bool, default False
        Whether to list each pair once, as `halfshell.pairs` does, and not as (i, j, S) and
        (j, i, -S).
    batch : Tensor of int, shape (n,), optional
        The system of each point, ascending; only points of the same system pair. `box` may
        have a matrix for each system, (s, d, d).

    Returns
    -------
    Tensor or tuple of Tensor
        One for each letter, in that order, ascending by (i, j, S); a bare tensor for one letter. i
        and j int64 (m,), P int64 (m, 2), S int32 (m, d); d (m,) and D (m, d) of the type of
        `positions`, with ``D = positions[j] - positions[i] + S @ box``, summed in float64.
        The decision is exact for the given coordinates; d is rounded afterwards and may exceed
        `cutoff` by a rounding error. The gradient of d is 0 where d is 0.

    Raises
    ------
    TypeError
        If `positions` is not a tensor, not on the CPU, not dense, or of another dtype.
    NotImplementedError
        Under ``torch.vmap``, as systems differ in their number of pairs: use `batch`. PyTorch
        before 2.5 raises its own error.

    Examples
    --------
    >>> import torch
    >>> from halfshell.torch import neighbor_list
    >>> x = torch.tensor([[0.0], [1.0], [3.0]], dtype=torch.float64, requires_grad=True)
    >>> i, j, d = neighbor_list(x, 1.5, box=[4.0], quantities="ijd")
    >>> i.tolist(), j.tolist()
    ([0, 0, 1, 2], [1, 2, 0, 0])
    >>> d.pow(2).sum().backward()
    >>> x.grad.flatten().tolist()
    [0.0, 4.0, -4.0]
    """
    _as_points(positions, "positions", least=2)
    check_letters(quantities)
    if isinstance(box, torch.Tensor):
        _check(box, "box")
    elif box is not None:
        box = torch.tensor(np.asarray(box.vectors if isinstance(box, Box) else box, np.float64))
    flags = None if periodic is None else np.atleast_1d(np.asarray(periodic))
    if flags is not None and (flags.dtype != bool or flags.ndim != 1):
        raise TypeError(f"periodic must be a bool or one for each axis, got {periodic!r}")
    if flags is not None and len(flags) == 1:
        flags = flags.repeat(positions.shape[1])
    _check(batch, "batch", is_batch=True)
    i, j, S = _neighbor_list(
        positions.detach(), float(cutoff), None if box is None else box.detach(),
        None if flags is None else flags.tolist(), batch, half, inclusive,
    )  # fmt: skip
    found = {"i": i, "j": j, "S": S}
    if "d" in quantities or "D" in quantities:
        D = _vectors(positions, i, j, S, box, batch)
        found["D"] = D.to(positions.dtype)
        if "d" in quantities:
            found["d"] = _lengths(D).to(positions.dtype)
    if "P" in quantities:
        found["P"] = torch.stack((i, j), 1)
    result = tuple(found[letter] for letter in quantities)
    return result if len(result) > 1 else result[0]


def radius_graph(
    x: Tensor,
    r: float,
    batch: Tensor | None = None,
    loop: bool = False,
    max_num_neighbors: int | None = None,
    flow: str = "source_to_target",
) -> Tensor:
    """Connect all points that are less than `r` apart, like PyTorch Geometric's function.

    PyTorch Geometric keeps 32 neighbours of a point by default and silently drops the others. Here
    all are kept: CapacityError, whose ``needed`` tells how many, if a point has more than
    `max_num_neighbors`, not counting loops.

    Parameters
    ----------
    x : Tensor of floats, shape (n, d) or (n,)
        Coordinates on the CPU, as `positions` of `neighbor_list`.
    r, loop, max_num_neighbors, flow
        As in PyTorch Geometric's function.
    batch : Tensor of int, shape (n,), optional
        The graph of each point, ascending; points of different graphs are not connected.

    Returns
    -------
    Tensor of int64, shape (2, m)
        ``edge_index``, ascending by the point, in the second row for "source_to_target", and then
        by its neighbour.

    Examples
    --------
    >>> import torch
    >>> from halfshell.torch import radius_graph
    >>> radius_graph(torch.tensor([0.0, 1.0, 3.0]), 2.5).tolist()
    [[1, 0, 2, 1], [0, 1, 1, 2]]
    """
    if flow not in ("source_to_target", "target_to_source"):
        raise ValueError(f"flow must be 'source_to_target' or 'target_to_source', got {flow!r}")
    x = _as_points(x, "x")
    edges = _edges(x, None, r, batch, None, loop, max_num_neighbors)
    return edges.flip(0) if flow == "source_to_target" else edges


def radius(
    x: Tensor,
    y: Tensor,
    r: float,
    batch_x: Tensor | None = None,
    batch_y: Tensor | None = None,
    max_num_neighbors: int | None = None,
) -> Tensor:
    """Find all points of `x` less than `r` from each point of `y`, like PyTorch Geometric's.

    Parameters
    ----------
    x, y : Tensor of floats, shape (n, d) and (q, d), or (n,) and (q,)
        Coordinates on the CPU, as `positions` of `neighbor_list`.
    r, max_num_neighbors
        As in `radius_graph`.
    batch_x, batch_y : Tensor of int, shape (n,) and (q,), optional
        The system of each point, ascending. A set without one is all of system 0.

    Returns
    -------
    Tensor of int64, shape (2, m)
        Indices into `y` in row 0, into `x` in row 1; ascending by both.

    Examples
    --------
    >>> import torch
    >>> from halfshell.torch import radius
    >>> radius(torch.tensor([0.0, 1.0, 3.0]), torch.tensor([0.5, 9.0]), 1.0).tolist()
    [[0, 0], [0, 1]]
    """
    return _edges(_as_points(x, "x"), _as_points(y, "y"), r, batch_x, batch_y, False,
                  max_num_neighbors)  # fmt: skip


def _check(value: Any, name: str, is_batch: bool = False) -> None:
    """TypeError unless this is a tensor that can be read: of floats, or a batch of integers."""
    if is_batch and value is None:
        return
    if not isinstance(value, torch.Tensor):
        raise TypeError(f"{name} must be a torch.Tensor, got {type(value).__name__}")
    if value.device.type != "cpu":
        raise TypeError(f"{name} must be on the CPU, but is on {value.device}: give {name}.cpu()")
    if value.layout != torch.strided:
        raise TypeError(f"{name} must be dense, got layout {value.layout}")
    dtype = value.dtype
    if is_batch:
        if dtype.is_floating_point or dtype.is_complex or dtype == torch.bool:
            raise TypeError(f"{name} must hold integers, got {dtype}")
    elif dtype not in _FLOATS:
        raise TypeError(f"{name} must be of float64, float32, float16 or bfloat16, got {dtype}")


def _as_points(value: Any, name: str, least: int = 1) -> Tensor:
    """Points in rows, of `least` axes or more."""
    _check(value, name)
    if not least <= value.ndim <= 2:
        raise ValueError(f"{name} must have shape (n, d), got {tuple(value.shape)}")
    return value[:, None] if value.ndim == 1 else value


def _edges(x: Tensor, y: Any, r: float, batch_x: Any, batch_y: Any, loop: bool, most: Any) -> Any:
    """Points of y, or of x without y, and points of x less than r from them."""
    _check(batch_x, "batch" if y is None else "batch_x", is_batch=True)
    _check(batch_y, "batch_y", is_batch=True)
    if most is not None and (isinstance(most, bool) or not isinstance(most, int) or most < 0):
        raise ValueError(f"max_num_neighbors must be None or an integer from 0 on, got {most!r}")
    y = None if y is None else y.detach()
    return _radius(x.detach(), y, float(r), batch_x, batch_y, loop, most)


def _vectors(
    positions: Tensor, i: Tensor, j: Tensor, S: Tensor, box: Tensor | None, batch: Tensor
) -> Tensor:
    D = positions[j].double() - positions[i].double()
    if box is None:
        return D
    box, S = box.double(), S.double()
    if box.ndim == 3:  # with a batch, or the search would have refused it
        box = box[batch[i]]
    return D + (S * box if box.ndim < 2 else (S[:, :, None] * box).sum(1))


def _lengths(D: Tensor) -> Tensor:
    """Lengths that neither overflow nor underflow, with derivatives of 0 where they are 0."""
    scale = D.detach().abs().amax(-1)
    zero = scale == 0.0
    scale = torch.where(zero, 1.0, scale)
    squares = (D / scale[:, None]).square().sum(-1)
    return torch.where(zero, 0.0, scale * torch.where(zero, 1.0, squares).sqrt())


def _array(tensor: Tensor | None) -> Any:
    if tensor is None:
        return None
    tensor = tensor.detach()
    return (tensor.float() if tensor.dtype in _HALVES else tensor).numpy()


def _find_neighbors(
    positions: Tensor, cutoff: float, box: Tensor, periodic: Any, batch: Tensor, half: bool,
    inclusive: bool,
) -> tuple[Tensor, ...]:  # fmt: skip
    found = entries_of(
        _array(positions), cutoff, _array(box), periodic, _array(batch), half, inclusive
    )
    # Columns of a table are for reading only, and shared by what is made of it.
    return tuple(torch.from_numpy(x if x.flags.writeable else x.copy()) for x in found)


def _find_edges(
    x: Tensor, y: Tensor | None, r: float, batch_x: Tensor | None, batch_y: Tensor | None,
    loop: bool, most: int | None,
) -> Tensor:  # fmt: skip
    """Queries i and points j of the same system, ascending by (i, j), in open space."""
    points, batch = _array(x), _array(batch_x)
    if y is None:
        i, j, _ = entries_of(points, r, None, None, batch, False, False)
    else:
        queries, query_batch = _array(y), _array(batch_y)
        if batch is not None or query_batch is not None:  # a set without one is all of system 0
            batch = np.zeros(len(points), np.int64) if batch is None else batch
            query_batch = np.zeros(len(queries), np.int64) if query_batch is None else query_batch
        i, j = pairs_between(
            Points._of(queries, "queries", batch=query_batch),
            Points._of(points, "points", batch=batch), r, inclusive=False,
        )  # fmt: skip
    needed = int(np.bincount(i).max()) if len(i) else 0
    if most is not None and needed > most:
        raise CapacityError(
            f"max_num_neighbors is {most}, but a point has {needed} neighbours, and none is "
            "left out silently: give None for all of them",
            needed,
        )
    if loop:
        own = np.arange(len(x))
        i, j = np.concatenate((i, own)), np.concatenate((j, own))
        order = np.lexsort((j, i))
        i, j = i[order], j[order]
    return torch.from_numpy(np.stack((i, j)))


def _shape_of_neighbors(positions: Tensor, *_: Any) -> tuple[Tensor, ...]:
    m = torch.library.get_ctx().new_dynamic_size()
    index = [positions.new_empty(m, dtype=torch.int64) for _ in range(2)]
    return *index, positions.new_empty((m, positions.shape[1]), dtype=torch.int32)


def _shape_of_edges(x: Tensor, *_: Any) -> Tensor:
    return x.new_empty((2, torch.library.get_ctx().new_dynamic_size()), dtype=torch.int64)


def _refuse_vmap(*_: Any) -> Any:
    raise NotImplementedError(
        "systems differ in their number of pairs, so torch.vmap cannot stack them: give all of "
        "them in one call, with batch="
    )


def _operator(name: str, schema: str, find: Any, shape: Any) -> Any:
    """Make ``torch.ops.halfshell.<name>``."""
    op = torch.library.custom_op(f"halfshell::{name}", find, mutates_args=(), schema=schema)
    op.register_fake(shape)
    if hasattr(op, "register_vmap"):  # from PyTorch 2.5 on
        op.register_vmap(_refuse_vmap)
    return op


_neighbor_list = _operator(
    "neighbor_list",
    "(Tensor positions, float cutoff, Tensor? box, bool[]? periodic, Tensor? batch, bool half, "
    "bool inclusive) -> (Tensor, Tensor, Tensor)",
    _find_neighbors,
    _shape_of_neighbors,
)
_radius = _operator(
    "radius",
    "(Tensor x, Tensor? y, float r, Tensor? batch_x, Tensor? batch_y, bool loop, "
    "int? max_num_neighbors) -> Tensor",
    _find_edges,
    _shape_of_edges,
)
