# SPDX-License-Identifier: BSD-3-Clause
"""Points that are spread over the ranks of MPI, divided into a brick for each of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from halfshell._convert.foreign import is_a, kind_of
from halfshell._convert.points import Points
from halfshell._convert.types import BoxLike, CutoffLike, PeriodicLike, PointsLike, Rule
from halfshell._functions.bricks import (
    FIELDS,
    Brick,
    Division,
    Summary,
    Terms,
    divide,
    part_of,
    split,
    summary,
)

__all__ = ["Exchanged", "exchange"]


class Exchanged(NamedTuple):
    """What `exchange` returns on a rank.

    Attributes
    ----------
    brick : Brick
        The points that this rank owns and those that it needs, by their numbers among all points.
    points : Points
        ``brick.members``, with all that is known of them; the brick's methods take these.
    """

    brick: Brick
    points: Points


class _Given(NamedTuple):
    """What one rank says of its points, or why it has none."""

    dtype: str = ""
    summary: Summary | None = None
    terms: Terms | None = None
    error: Exception | None = None


def exchange(
    comm: Any,
    points: PointsLike,
    cutoff: CutoffLike,
    *,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    rule: Rule | None = None,
) -> Exchanged:
    """Give each rank a brick of all ranks' points; called by all ranks at once.

    Parameters
    ----------
    comm : mpi4py.MPI.Comm
        The ranks, as many as there will be bricks.
    points : array_like of float, shape (n_rank, d), or Points
        Those of this rank, with the same dtype and d on all ranks, of which the same is known;
        there may be none. They are numbered across all ranks: those of rank 0 come first.
    cutoff, box, periodic, rule
        As in `halfshell.bricks`; the same on all ranks.

    Returns
    -------
    Exchanged
        This rank's brick, which owns about as many points as the others, and its members.
        ``brick.pairs(points)`` of all ranks together is `halfshell.pairs` of all
        points, byte for byte.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `halfshell.bricks`, with the same type and message on every rank, whichever rank has
        the error; coordinates are named by their position among all points. Also if ranks differ
        in cutoff, rule, box, periodicity, d, dtype or what is known of each point.

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
    own, given = _given(points, cutoff, box, periodic, rule, comm.Get_size())
    gathered = comm.gather(given)
    division: Any = None
    if gathered is not None:
        try:
            division = _divided(gathered)
        except Exception as error:
            division = _plain(error, "")
    division = comm.bcast(division)
    if isinstance(division, Exception):
        raise division
    pieces: Any = None
    try:
        pieces = split(own, division, comm.Get_rank())
    except Exception as error:  # the others must not wait for these pieces
        pieces = _plain(error, "")
    failed = pieces if isinstance(pieces, Exception) else None
    for rank, one in enumerate(comm.allgather(failed)):
        if one is not None:
            raise _plain(one, f"rank {rank}: ")
    return Exchanged(*part_of(division, *comm.alltoall(pieces)).in_order())


def _given(
    points: Any, cutoff: Any, box: Any, periodic: Any, rule: Any, n_ranks: int
) -> tuple[Points, _Given]:
    """Arguments of this rank, with what is wrong with them, so that no other waits in vain."""
    try:
        own = Points._of(points, "points", box, periodic)
        if own.batch is not None:
            raise ValueError("exchange cannot be combined with a batch: its systems are apart")
        fields = tuple(name for name in FIELDS if getattr(own, name) is not None)
        flags = None if own.periodic is None else tuple(own.periodic.tolist())
        kept = cutoff if is_a(cutoff, Mapping) or np.ndim(cutoff) == 0 else np.array(cutoff)
        vectors = None if own.box is None else np.array(own.box)
        terms = Terms(kept, rule, vectors, flags, own.positions.shape[1], fields)
        terms.call()
        return own, _Given(own.positions.dtype.name, summary(own, n_ranks), terms)
    except Exception as error:
        return Points(np.empty((0, 1))), _Given(error=_plain(error, ""))


def _divided(given: list[_Given]) -> Division:
    for rank, one in enumerate(given):
        if one.error is not None:
            raise _plain(one.error, f"rank {rank}: ")
    first: Any = given[0].terms
    for rank, one in enumerate(given):
        terms: Any = one.terms
        if (terms.ndim, one.dtype) != (first.ndim, given[0].dtype):
            raise ValueError(
                "points must be of one width and type on all ranks, got "
                f"{first.ndim} columns of {given[0].dtype} on rank 0 and "
                f"{terms.ndim} of {one.dtype} on rank {rank}"
            )
        for name in ("cutoff", "rule", "box", "periodic", "fields"):
            mine, other = getattr(terms, name), getattr(first, name)
            if not np.array_equal(mine, other):
                what = "what is known of points" if name == "fields" else name
                told = [" ".join(repr(one.tolist() if isinstance(one, np.ndarray) else one).split())
                        for one in (other, mine)]  # fmt: skip
                raise ValueError(
                    f"{what} must be the same on all ranks, got {told[0]} on rank 0 and "
                    f"{told[1]} on rank {rank}"
                )
    summaries = [one.summary for one in given if one.summary is not None]
    return divide(first, len(given), *summaries)


def _plain(error: Exception, whose: str) -> Exception:
    """The same error without its traceback, of a kind that every process knows."""
    kinds = (TypeError, OverflowError, MemoryError, ValueError)
    kind = next((kind for kind in kinds if isinstance(error, kind)), RuntimeError)
    return kind(f"{whose}{error}")
