# SPDX-License-Identifier: BSD-3-Clause
"""Points that are spread over the ranks of MPI, divided into a brick for each of them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell._convert.foreign import kind_of
from halfshell._convert.lengths import as_cutoff
from halfshell._convert.scene import as_own_box, as_points
from halfshell._convert.types import BoxLike, Number, PeriodicLike, PointsLike
from halfshell._functions import brick_tasks
from halfshell._objects.brick import Brick

__all__ = ["Exchanged", "exchange"]


class Exchanged(NamedTuple):
    """What `exchange` returns on a rank.

    Attributes
    ----------
    brick : Brick
        The points that this rank owns and those that it needs, by their numbers among all points.
    points : ndarray of float, shape (m + k, d)
        Coordinates of ``brick.members``, which the brick's methods take.
    """

    brick: Brick
    points: npt.NDArray[Any]


class _Given(NamedTuple):
    """What one rank brings, or why it can bring nothing."""

    points: npt.NDArray[Any] | None
    cutoff: float
    box: bytes | None
    periodic: int
    error: Exception | None


def exchange(
    comm: Any,
    points: PointsLike,
    cutoff: Number,
    *,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
) -> Exchanged:
    """Give each rank a brick of all ranks' points; called by all ranks at once.

    Parameters
    ----------
    comm : mpi4py.MPI.Comm
        The ranks, as many as there will be bricks.
    points : array_like of float, shape (n_rank, d)
        Coordinates of this rank, with the same dtype and d on all ranks; there may be none.
        Points are numbered across all ranks: those of rank 0 come first.
    cutoff, box, periodic
        As in `halfshell.bricks`; the same on all ranks.

    Returns
    -------
    Exchanged
        This rank's brick and the coordinates of its members. ``brick.pairs(points)`` of all
        ranks together is `halfshell.pairs` of all points, byte for byte.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `halfshell.bricks`, with the same type and message on every rank, whichever rank has
        the error; coordinates are named by their position among all points. Also if ranks differ
        in cutoff, box, periodicity, d or dtype.

    Notes
    -----
    Rank 0 gathers all coordinates and divides them; several copies of them must fit in its memory.

    Examples
    --------
    With one rank, or in a program that is started by ``mpiexec -n 4 python program.py``:

    >>> from mpi4py import MPI                                           # doctest: +SKIP
    >>> from halfshell.mpi import exchange                               # doctest: +SKIP
    >>> brick, held = exchange(MPI.COMM_WORLD, points, 1.0, box=box)     # doctest: +SKIP
    >>> i, j = brick.pairs(held)                                         # doctest: +SKIP
    >>> n = MPI.COMM_WORLD.allreduce(len(i))                             # doctest: +SKIP
    """
    if not all(hasattr(comm, name) for name in ("gather", "bcast", "scatter")):
        raise TypeError(
            f"comm must be a communicator of mpi4py (the extra halfshell[mpi]), got {kind_of(comm)}"
        )
    gathered = comm.gather(_given(points, cutoff, box, periodic))
    parts: list[brick_tasks.Part] | None = None
    error: Exception | None = None
    if gathered is not None:
        try:
            parts = _divided(gathered)
        except Exception as found:
            error = _plain(found, "")
    error = comm.bcast(error)
    if error is not None:
        raise error
    part = comm.scatter(parts)
    return Exchanged(part.brick, part.points)


def _given(points: Any, cutoff: Any, box: Any, periodic: Any) -> _Given:
    """Arguments of this rank, with what is wrong with them, so that no other waits in vain."""
    try:
        array = as_points(points)
        vectors, bits = as_own_box(box, periodic, array.shape[1])
        shown = None if vectors is None else np.ascontiguousarray(vectors, np.float64).tobytes()
        return _Given(np.ascontiguousarray(array), as_cutoff(cutoff), shown, bits, None)
    except Exception as error:
        return _Given(None, 0.0, None, 0, _plain(error, ""))


def _divided(given: list[_Given]) -> list[brick_tasks.Part]:
    for rank, one in enumerate(given):
        if one.error is not None:
            raise _plain(one.error, f"rank {rank}: ")
    arrays = [one.points for one in given if one.points is not None]
    first, points = given[0], arrays[0]
    for rank, (one, array) in enumerate(zip(given, arrays, strict=True)):
        if array.shape[1] != points.shape[1] or array.dtype != points.dtype:
            raise ValueError(
                "points must be of one width and type on all ranks, got "
                f"{points.shape[1]} columns of {points.dtype} on rank 0 and "
                f"{array.shape[1]} of {array.dtype} on rank {rank}"
            )
        if one.cutoff != first.cutoff and not math.isnan(first.cutoff):
            raise ValueError(
                f"cutoff must be the same on all ranks, got {first.cutoff} on rank 0 and "
                f"{one.cutoff} on rank {rank}"
            )
        for name, mine, other in (
            ("box", one.box, first.box), ("periodic", one.periodic, first.periodic),
        ):  # fmt: skip
            if mine != other:
                raise ValueError(
                    f"{name} must be the same on all ranks; rank {rank} has another than rank 0"
                )
    scene: dict[str, Any] = {}
    if first.box is not None:
        ndim = points.shape[1]
        scene["box"] = np.frombuffer(first.box).reshape(ndim, ndim)
        scene["periodic"] = [bool(first.periodic >> k & 1) for k in range(ndim)]
    return brick_tasks.divided(
        arrays, points.shape[1], points.dtype, first.cutoff, len(given), scene
    )


def _plain(error: Exception, whose: str) -> Exception:
    """The same error without its traceback, of a kind that every process knows."""
    kinds = (TypeError, OverflowError, MemoryError, ValueError)
    kind = next((kind for kind in kinds if isinstance(error, kind)), RuntimeError)
    return kind(f"{whose}{error}")
