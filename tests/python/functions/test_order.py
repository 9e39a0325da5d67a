# SPDX-License-Identifier: BSD-3-Clause
"""The order of the pairs: fixed by the scene, and ascending on request."""

import itertools
import subprocess
import sys

import numpy as np
import pytest

import halfshell as hs
from oracles import BOX_KINDS, random_scene, same_arrays


def assert_ascending(i, j, S):
    rows = np.concatenate([i[:, None], j[:, None], S], axis=1).tolist()
    assert rows == sorted(rows)


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_sorted_pairs_ascend_by_i_then_j_then_shift(kind, rng):
    for ndim, kernel in itertools.product((1, 2, 3, 5), hs.kernels()):
        for n, neighbours in ((1, 60), (3, 60), (40, 30), (400, 8)):
            points, cutoff, box, _ = random_scene(rng, n, ndim, kind, neighbours, spread=2)
            how = {"box": box, "quantities": "ijS", "sort": True, "kernel": kernel}
            assert_ascending(*hs.pairs(points, cutoff, **how))


def test_sorted_when_one_pair_of_points_occurs_with_many_shifts():
    for kernel in hs.kernels():
        i, j, S = hs.pairs(
            [[0.1, 0.2], [0.6, 0.9], [0.3, 0.3]], 3.0, box=[1.0, 1.0], quantities="ijS",
            sort=True, kernel=kernel,
        )  # fmt: skip
        assert len(i) > 100
        assert (S < 0).any() and (S > 1).any()
        assert_ascending(i, j, S)


def test_sorting_carries_every_quantity_along(rng):
    for kernel in hs.kernels():
        points, cutoff, box, _ = random_scene(rng, 300, neighbours=20)
        plain = hs.pairs(points, cutoff, box=box, quantities="ijSdDP", kernel=kernel)
        ordered = hs.pairs(points, cutoff, box=box, quantities="ijSdDP", sort=True, kernel=kernel)
        i, j, S = plain[:3]
        order = np.lexsort([*S.T[::-1], j, i])
        assert same_arrays(tuple(x[order] for x in plain), ordered)


@pytest.mark.parametrize("ndim", [1, 2, 3, 6])
def test_every_kernel_returns_the_same_bytes_in_the_same_order(ndim, rng):
    for sort in (False, True):
        for n in (2, 33, 500):
            points, cutoff, box, _ = random_scene(rng, n, ndim, neighbours=15)
            for dtype in (np.float64, np.float32):
                for frame in (box, None):
                    results = [
                        hs.pairs(
                            points.astype(dtype),
                            cutoff,
                            box=frame,
                            quantities="ijSdD",
                            sort=sort,
                            kernel=name,
                        )
                        for name in [*hs.kernels(), None]
                    ]
                    assert all(same_arrays(results[0], other) for other in results[1:])


def test_the_order_is_the_same_in_each_run_of_the_interpreter(rng):
    script = """
import hashlib
import numpy as np
import halfshell as hs
points = np.random.default_rng(5).random((3000, 3))
found = hs.pairs(points, 0.08, box=[1.0, 1.0, 1.0], quantities="ijSdD")
print(hashlib.sha256(b"".join(a.tobytes() for a in found)).hexdigest())
"""
    runs = [
        subprocess.run(
            [sys.executable, "-c", script], capture_output=True, text=True, check=True
        ).stdout
        for _ in range(2)
    ]
    assert runs[0] == runs[1] and len(runs[0].strip()) == 64


def test_results_do_not_depend_on_earlier_searches(rng):
    # Recycled memory must not leak from one search into the next.
    points, cutoff, box, _ = random_scene(rng, 200, neighbours=20)
    first = hs.pairs(points, cutoff, box=box, quantities="ijSdD")
    for n in (1000, 3, 50):
        hs.pairs(rng.random((n, 2)), 0.3, quantities="ijdD")
    assert same_arrays(hs.pairs(points, cutoff, box=box, quantities="ijSdD"), first)
