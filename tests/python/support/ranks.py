# SPDX-License-Identifier: BSD-3-Clause
"""Run by mpiexec on each rank: `halfshell.mpi` against one search, and what it refuses."""

import sys

import numpy as np
from mpi4py import MPI

import halfshell as hs
from brick_scenes import LETTERS, in_order, known_scenes, rows_of, same, scenes, serial
from halfshell.mpi import exchange

COMM = MPI.COMM_WORLD
RANK, SIZE = COMM.rank, COMM.size


def answers():
    """Every scene, spread unevenly; rank 0 compares."""
    for name, (points, cutoff, scene) in scenes().items():
        places = [len(points) * k * k // SIZE**2 for k in range(SIZE + 1)]
        own = points[places[RANK] : places[RANK + 1]]
        assert sum(COMM.allgather(len(own))) == len(points)
        brick, held = exchange(COMM, own, cutoff, **scene)
        found = COMM.gather(brick.pairs(held, quantities=LETTERS))
        counts = COMM.allreduce(brick.count_pairs(held))
        rows = COMM.gather((brick.owned, brick.neighbors(held).counts))
        if RANK == 0:
            expected = serial(points, cutoff, scene)
            columns = [np.concatenate(column) for column in zip(*found, strict=True)]
            assert same(in_order(columns), expected), name
            assert counts == len(expected[0]), name
            of_each = np.zeros(len(points), np.int64)
            for owned, row in rows:
                of_each[owned] = row
            assert np.array_equal(of_each, hs.coordination(points, cutoff, **scene)), name


def known():
    """Radii, types and so on go with their points."""
    for name, (fields, cutoff, scene, which) in known_scenes().items():
        n = len(fields["positions"])
        own = rows_of(fields, slice(n * RANK // SIZE, n * (RANK + 1) // SIZE))
        rest = {key: value for key, value in which.items() if key != "rule"}
        brick, held = exchange(
            COMM, hs.Points(**own, **scene), cutoff, rule=which.get("rule")
        )
        found = COMM.gather(brick.pairs(held, quantities=LETTERS, **rest))
        if RANK == 0:
            expected = hs.pairs(
                hs.Points(**fields, **scene), cutoff, quantities=LETTERS, sort=True, **which
            )
            columns = [np.concatenate(column) for column in zip(*found, strict=True)]
            assert same(in_order(columns), expected) and len(expected[0]), name


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
        {"answers": answers, "known": known, "refusals": refusals}[sys.argv[1]]()
    except BaseException:
        sys.excepthook(*sys.exc_info())
        sys.stderr.flush()
        COMM.Abort(1)
