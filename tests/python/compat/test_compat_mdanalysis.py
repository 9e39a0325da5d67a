# SPDX-License-Identifier: BSD-3-Clause
"""`halfshell.compat.mdanalysis` gives what MDAnalysis gives, but for its rounding."""

from fractions import Fraction

import numpy as np
import pytest

distances = pytest.importorskip("MDAnalysis.lib.distances", reason="MDAnalysis is not installed")
from halfshell.compat import mdanalysis as ours  # noqa: E402

BOXES = {
    "open": None,
    "zeros": np.zeros(6, np.float32),
    "ortho": np.array([10, 12, 9, 90, 90, 90], np.float32),
    "triclinic": np.array([10, 12, 11, 80, 75, 100], np.float32),
}


def assert_same(found, wanted, cutoffs):
    """Pairs and distances, but for pairs so near to a cutoff that rounding decides."""
    near = [
        {tuple(map(int, pair)): d for pair, d in zip(*result, strict=True)}
        for result in (found, wanted)
    ]
    assert all(len(table) == len(result[0]) for table, result in zip(near, (found, wanted)))
    for pair in near[0].keys() ^ near[1].keys():
        d = near[0].get(pair, near[1].get(pair))
        assert min(abs(d - cutoff) for cutoff in cutoffs) < 1e-5
    for pair in near[0].keys() & near[1].keys():
        assert near[0][pair] == pytest.approx(near[1][pair], abs=2e-5)
    assert found[0].dtype == np.intp and found[1].dtype == np.float64
    assert found[0].shape == (len(found[1]), 2)


def scatter(rng, n, dtype=np.float32):
    return rng.uniform(-8.0, 20.0, (n, 3)).astype(dtype)


# Which method is named changes nothing of ours.
METHODS = [None, "bruteforce", "nsgrid", "pkdtree"]


@pytest.mark.parametrize("name, method", [*zip(BOXES, METHODS), *zip(BOXES, METHODS[::-1])])
def test_pairs_of_one_set(name, method, rng):
    box = BOXES[name]
    theirs = None if name == "zeros" else box
    for n, largest, least in [(300, 2.5, None), (300, 3.0, 1.5), (12, 4.0, None), (1, 2.0, None)]:
        points = scatter(rng, n)
        found = ours.self_capped_distance(points, largest, least, box, method)
        wanted = distances.self_capped_distance(points, largest, least, theirs, "bruteforce")
        assert_same(found, wanted, [largest, least or largest])
        assert (found[0][:, 0] < found[0][:, 1]).all()
        alone = ours.self_capped_distance(points, largest, least, box, return_distances=False)
        assert np.array_equal(alone, found[0])


@pytest.mark.parametrize(
    "name, dtype", [*zip(BOXES, [np.float32, np.float64] * 2), ("triclinic", np.float32)]
)
def test_pairs_of_two_sets(name, dtype, rng):
    box = BOXES[name]
    theirs = None if name == "zeros" else box
    for q, n, largest, least in [(40, 200, 3.0, None), (40, 200, 3.0, 2.0), (1, 5, 4.0, None)]:
        queries, points = scatter(rng, q, dtype), scatter(rng, n, dtype)
        found = ours.capped_distance(queries, points, largest, least, box)
        wanted = distances.capped_distance(queries, points, largest, least, theirs, "bruteforce")
        assert_same(found, wanted, [largest, least or largest])
    one = ours.capped_distance(points[0], points, 4.0, box=box)
    assert_same(one, distances.capped_distance(points[0], points, 4.0, box=theirs), [4.0])


OPEN_AXES = [
    [10, 0, 0, 90, 90, 90], [10, 12, 0, 90, 90, 90], [0, 0, 9, 90, 90, 90], [0, 0, 0, 90, 90, 90],
    [-10, 12, 9, 90, 90, 90], [1e-8, 12, 9, 90, 90, 90], [10, 12, 0, 80, 75, 100],
    [10, 12, 9, 0, 0, 0], [10, 12, 9, 30, 30, 90], [10, 12, 9, 90, 90, 180], [0] * 6,
]  # fmt: skip


def test_axes_without_a_length_are_open(rng):
    """With right angles these alone, and all where there is no such triclinic box."""
    for box in OPEN_AXES:
        points = scatter(rng, 60)
        for cutoff, least in ((3.0, None), (3.0, 2.0), (7.0, None), (np.inf, 4.0)):
            cutoffs = [min(cutoff, 1e3), least or cutoff]
            found = ours.self_capped_distance(points, cutoff, least, box)
            wanted = distances.self_capped_distance(
                points, min(cutoff, 1e3), least, box, method="bruteforce"
            )
            assert_same(found, wanted, cutoffs)
            found = ours.capped_distance(points[:9], points, cutoff, least, box)
            wanted = distances.capped_distance(
                points[:9], points, cutoff, least, box, method="bruteforce"
            )
            assert_same(found, wanted, cutoffs)


@pytest.mark.parametrize("name", BOXES)
def test_an_infinite_cutoff_finds_all_pairs(name, rng):
    points = scatter(rng, 30)
    for cutoff in (np.inf, 1e30, 1e6, 40.0):
        i, j = ours.self_capped_distance(points, cutoff, box=BOXES[name])[0].T
        found = set(zip(i.tolist(), j.tolist(), strict=True))
        assert found == {(a, b) for b in range(30) for a in range(b)} and len(i) == 435
        theirs = None if name == "zeros" else BOXES[name]
        found = ours.capped_distance(points[:9], points, cutoff, box=BOXES[name])
        assert len(found[0]) == 270
        wanted = distances.capped_distance(points[:9], points, cutoff, box=theirs)
        assert_same(found, wanted, [0.0])
    for same in (np.zeros((3, 3), np.float32), points[:1]):
        assert (
            len(ours.self_capped_distance(same, np.inf, box=BOXES[name])[0]) == (len(same) == 3) * 3
        )
    with pytest.raises(ValueError, match="points must be finite"):
        ours.self_capped_distance(points * np.float32(np.nan), np.inf, box=BOXES[name])
    for wrong in (np.nan, -np.inf):
        if wrong < 0:
            assert len(ours.self_capped_distance(points, wrong, box=BOXES[name])[0]) == 0
            continue
        with pytest.raises(ValueError, match="cutoff must be finite"):
            ours.self_capped_distance(points, wrong, box=BOXES[name])


@pytest.mark.parametrize("name", BOXES)
def test_pairs_at_the_lesser_cutoff_are_those_of_the_real_numbers(name):
    """Distances that are rounded up to the cutoff, and down to it, each decided by fractions."""
    rng = np.random.default_rng(3)
    decided = set()
    for _ in range(40):
        points = (rng.integers(1, 100, (2, 3)) / 30.0).astype(np.float32)
        a, b = ([Fraction(x) for x in point] for point in points.tolist())
        square = sum((y - x) ** 2 for x, y in zip(a, b, strict=True))
        least = float(np.sqrt(float(square)))
        for cutoff in (np.nextafter(least, 0.0), least, np.nextafter(least, 9.0)):
            beyond = Fraction(float(cutoff)) ** 2 < square
            decided.add(beyond)
            found = ours.self_capped_distance(points, 9.0, cutoff, BOXES[name])
            assert len(found[0]) == beyond
            found = ours.capped_distance(points[:1], points[1:], 9.0, cutoff, BOXES[name])
            assert len(found[0]) == beyond
    assert decided == {False, True}
    two = np.zeros((2, 3), np.float32)
    for least, kept in ((0.0, 0), (-1.0, 1), (-5e-324, 1), (np.nan, 0), (np.inf, 0)):
        assert len(ours.self_capped_distance(two, 1.0, least, BOXES[name])[0]) == kept


def test_what_the_original_refuses():
    points = np.zeros((3, 3), np.float32)
    for module in (ours, distances):
        with pytest.raises(ValueError, match="alpha, beta, gamma"):
            module.self_capped_distance(points, 1.0, box=[1.0, 1.0, 1.0])
        with pytest.raises(KeyError, match="nonsense"):
            module.self_capped_distance(points, 1.0, method="nonsense")
        with pytest.raises(ValueError, match="shape"):
            module.self_capped_distance(np.zeros((3, 2), np.float32), 1.0)
        with pytest.raises(TypeError):
            module.capped_distance("points", points, 1.0)
        for backend in ("nonsense", ""):
            with pytest.raises(ValueError, match="backend"):
                module.self_capped_distance(points, 1.0, backend=backend)
            with pytest.raises(ValueError, match="backend"):
                module.capped_distance(points, points, 1.0, backend=backend)
        for backend in ("serial", "Serial", "OpenMP"):
            assert len(module.self_capped_distance(points, 1.0, backend=backend)[0]) == 3
    with pytest.raises(ValueError, match="NaN"):
        ours.self_capped_distance(points, 1.0, box=[np.nan, 1.0, 1.0, 90.0, 90.0, 90.0])
