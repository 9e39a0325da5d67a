# SPDX-License-Identifier: BSD-3-Clause
"""Run by mpiexec on each rank: `halfshell.mpi` against one search, and what it refuses."""

import sys

import numpy as np
from mpi4py import MPI

import halfshell as hs
from brick_scenes import LETTERS, every_scene, in_order, rows_of, same, without_rule
from halfshell.mpi import exchange

COMM = MPI.COMM_WORLD
RANK, SIZE = COMM.rank, COMM.size


def answers():
    """Every scene, spread unevenly, with what is known of its points; rank 0 compares."""
    for name, (known, cutoff, scene, which) in every_scene().items():
        n, rest = len(known["positions"]), without_rule(which)
        places = [n * k * k // SIZE**2 for k in range(SIZE + 1)]
        own = hs.Points(**rows_of(known, slice(places[RANK], places[RANK + 1])), **scene)
        assert sum(COMM.allgather(len(own))) == n
        brick, held = exchange(COMM, own, cutoff, rule=which.get("rule"))
        found = COMM.gather(brick.pairs(held, quantities=LETTERS, **rest))
        counts = COMM.allreduce(brick.count_pairs(held, **rest))
        rows = COMM.gather((brick.owned, brick.neighbors(held, **rest).counts))
        if RANK == 0:
            points = hs.Points(**known, **scene)
            expected = hs.pairs(points, cutoff, quantities=LETTERS, sort=True, **which)
            columns = [np.concatenate(column) for column in zip(*found, strict=True)]
            assert same(in_order(columns), expected), name
            assert counts == len(expected[0]), name
            of_each = np.zeros(n, np.int64)
            for owned, row in rows:
                of_each[owned] = row
            assert np.array_equal(of_each, hs.coordination(points, cutoff, **which)), name


def refusals():
    """What is wrong on the last rank is raised on all of them, in one sentence."""
    points, last = np.zeros((5, 3)), RANK == SIZE - 1
    spoilt = points.copy()
    spoilt[2, 1] = np.nan
    cases = [
        ((spoilt if last else points, 1.0), {}, ValueError, f"points[{5 * SIZE - 3}, 1]"),
        ((["a"] if last else points, 1.0), {}, TypeError, f"rank {SIZE - 1}: points"),
        ((points, -1.0), {}, ValueError, "cutoff"),
        ((points, np.nan), {}, ValueError, "got nan"),
        ((points, "1" if last else 1.0), {}, TypeError, f"rank {SIZE - 1}: cutoff"),
        ((points, 1.0), {"box": [1.0, 0.0, 1.0]}, ValueError, "vector 1 of box is zero"),
        ((points, 1.0), {"periodic": last}, ValueError, "periodic needs a box"),
    ]
    if SIZE > 1:
        box = {"box": [1.0, 1.0, 2.0 if last else 1.0]}
        mixed = {"box": [1.0] * 3, "periodic": [True, True, last]}
        narrow = points.astype(np.float32) if last else points
        flat = points[:, :2] if last else points
        cases += [
            ((points, 2.0 if last else 1.0), {}, ValueError, "cutoff must be the same"),
            ((points, 1.0), box, ValueError, "box must be the same"),
            ((points, 1.0), {} if last else {"box": 1.0}, ValueError, "box must be the same"),
            ((points, 1.0), mixed, ValueError, "periodic must be the same"),
            ((narrow, 1.0), {}, ValueError, "one width and type"),
            ((flat, 1.0), {}, ValueError, "one width and type"),
            ((hs.Points(points, radii=[0.5] * 5), 1.0), {"rule": "max" if last else "min"},
             ValueError, "rule must be the same"),
            ((hs.Points(points, labels=[1] * 5) if last else points, 1.0), {}, ValueError,
             "what is known of points must be the same"),
        ]
    for arguments, options, kind, words in cases:
        try:
            exchange(COMM, *arguments, **options)
        except kind as error:
            assert type(error) is kind and words in str(error), error
            said = COMM.allgather(str(error))
            assert len(set(said)) == 1
        else:
            raise AssertionError(words)


if __name__ == "__main__":
    try:
        {"answers": answers, "refusals": refusals}[sys.argv[1]]()
    except BaseException:
        sys.excepthook(*sys.exc_info())
        sys.stderr.flush()
        COMM.Abort(1)
