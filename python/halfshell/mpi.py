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
from halfshell._functions.brick_pieces import Piece, part_of, split
from halfshell._functions.brick_plan import Division, Summary, divide, summary
from halfshell._functions.counts import count_pairs
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
    """What one rank says of its points, or why it has none."""

    ndim: int
    dtype: str
    summary: Summary | None
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
        This rank's brick, which owns about as many points as the others, and the coordinates of
        its members. ``brick.pairs(points)`` of all ranks together is `halfshell.pairs` of all
        points, byte for byte.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `halfshell.bricks`, with the same type and message on every rank, whichever rank has
        the error; coordinates are named by their position among all points. Also if ranks differ
        in cutoff, box, periodicity, d or dtype.

    Notes
    -----
    No rank holds all coordinates: bricks are cut by a sample of each rank's points, and every rank
    sends its points to those whose bricks own or need them.

    Examples
    --------
    With one rank, or in a program that is started by ``mpiexec -n 4 python program.py``:

    >>> from mpi4py import MPI                                           # doctest: +SKIP
    >>> from halfshell.mpi import exchange                               # doctest: +SKIP
    >>> brick, held = exchange(MPI.COMM_WORLD, points, 1.0, box=box)     # doctest: +SKIP
    >>> i, j = brick.pairs(held)                                         # doctest: +SKIP
    >>> n = MPI.COMM_WORLD.allreduce(len(i))                             # doctest: +SKIP
    """
    if not all(hasattr(comm, name) for name in ("gather", "bcast", "allgather", "alltoall")):
        raise TypeError(
            f"comm must be a communicator of mpi4py (the extra halfshell[mpi]), got {kind_of(comm)}"
        )
    array, given = _given(points, cutoff, box, periodic, comm.Get_size())
    gathered = comm.gather(given)
    answer: Division | Exception | None = None
    if gathered is not None:
        try:
            answer = _divided(gathered)
        except Exception as found:
            answer = _plain(found, "")
    answer = comm.bcast(answer)
    if isinstance(answer, Exception):
        raise answer
    division: Any = answer
    pieces: list[Piece] = []
    error = None
    try:
        pieces = split(array, division, comm.Get_rank())
    except Exception as found:  # the others must not wait for these pieces
        error = _plain(found, "")
    for rank, one in enumerate(comm.allgather(error)):
        if one is not None:
            raise _plain(one, f"rank {rank}: ")
    return Exchanged(*part_of(division, *comm.alltoall(pieces)).in_order())


def _given(
    points: Any, cutoff: Any, box: Any, periodic: Any, n_ranks: int
) -> tuple[npt.NDArray[Any], _Given]:
    """Arguments of this rank, with what is wrong with them, so that no other waits in vain."""
    try:
        array = as_points(points)
        ndim, dtype = array.shape[1], array.dtype.name
        vectors, bits = as_own_box(box, periodic, ndim)
        shown = None if vectors is None else np.ascontiguousarray(vectors, np.float64).tobytes()
        short = summary(array, n_ranks)
        return array, _Given(ndim, dtype, short, as_cutoff(cutoff), shown, bits, None)
    except Exception as error:
        return np.empty((0, 1)), _Given(0, "", None, 0.0, None, 0, _plain(error, ""))


def _divided(given: list[_Given]) -> Division:
    for rank, one in enumerate(given):
        if one.error is not None:
            raise _plain(one.error, f"rank {rank}: ")
    first = given[0]
    for rank, one in enumerate(given):
        if (one.ndim, one.dtype) != (first.ndim, first.dtype):
            raise ValueError(
                "points must be of one width and type on all ranks, got "
                f"{first.ndim} columns of {first.dtype} on rank 0 and "
                f"{one.ndim} of {one.dtype} on rank {rank}"
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
    ndim, vectors, flags = first.ndim, None, None
    if first.box is not None:
        vectors = np.frombuffer(first.box).reshape(ndim, ndim)
        flags = [bool(first.periodic >> k & 1) for k in range(ndim)]
    # Refuses what a search would refuse.
    count_pairs(np.empty((0, ndim)), first.cutoff, box=vectors, periodic=flags)
    summaries = [one.summary for one in given if one.summary is not None]
    return divide(first.cutoff, len(given), vectors, tuple(flags or [False] * ndim), *summaries)


def _plain(error: Exception, whose: str) -> Exception:
    """The same error without its traceback, of a kind that every process knows."""
    kinds = (TypeError, OverflowError, MemoryError, ValueError)
    kind = next((kind for kind in kinds if isinstance(error, kind)), RuntimeError)
    return kind(f"{whose}{error}")
