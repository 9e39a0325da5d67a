# SPDX-License-Identifier: BSD-3-Clause
"""The contract of kUPS's neighbour lists, one test for each promise of docs/systems/kups.md."""

import itertools
from fractions import Fraction

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import halfshell as hs
from calls import call
from definition import rows_that_count

#: Cells in which the original's cell list loses pairs, with cutoffs for which it does.
LOSSY = {
    "skewed": (4.0 * np.array([[5.0, 0.0, 0.0], [3.8, 3.2, 0.0], [3.5, 2.9, 3.3]]), 1.5),
    "sheared": (np.array([[10.0, 0.0, 0.0], [5.0, 10.0, 0.0], [0.0, 0.0, 10.0]]), 1.0),
    "hexagonal": (np.array([[10.0, 0.0, 0.0], [5.0, 75.0**0.5, 0.0], [0.0, 0.0, 10.0]]), 1.6),
}
MODES = {
    "vacuum": (False, False, False), "wire": (False, False, True), "slab": (True, True, False),
    "bulk": (True, True, True),
}  # fmt: skip


def by_rule(points, cutoff, box, periodic=(True, True, True)):
    """Both directions of each pair that the rule keeps: strict, images counted one by one,
    (i, i, 0) never."""
    points = hs.Points(points, box=box, periodic=periodic)
    return set(rows_that_count(points, cutoff, inclusive=False))


def edges(points, cutoff, **options):
    """All edges of `halfshell.neighbors`, strict, as the original's self graph has them."""
    table = call(hs.neighbors, points, cutoff, quantities="jS", inclusive=False, **options)
    i, j, S = table.to_pairs(quantities="ijS")
    found = list(zip(i.tolist(), j.tolist(), map(tuple, S.tolist())))
    assert len(set(found)) == len(found)
    return set(found)


@pytest.mark.parametrize("name", LOSSY)
def test_no_edge_is_lost_in_skewed_cells(name):
    box, cutoff = LOSSY[name]
    points = np.random.default_rng(0).random((500, 3)) @ box
    # Nearest images are all that there are, and each distance is far from the cutoff or exact.
    i, j = np.triu_indices(500, 1)
    d, S = hs.measure(points, i, j, box=box, quantities="dS")
    near = d < cutoff
    assert (np.abs(d - cutoff) > 1e-12).all()
    how = {"box": box, "inclusive": False, "quantities": "ijS", "sort": True}
    for algorithm in ("all-pairs", "grid", "hash", "hierarchy"):
        found = call(hs.pairs, points, cutoff, algorithm=algorithm, **how)
        for ours, theirs in zip(found, (i[near], j[near], S[near])):
            assert_array_equal(ours, theirs)


def test_the_original_bins_by_another_length():
    """Its bins follow the row norms of the inverse; widths of cells are one over column norms."""
    box, cutoff = LOSSY["skewed"]
    inverse = np.linalg.inv(box)
    theirs = np.trunc(1.0 / np.linalg.norm(inverse, axis=1) / cutoff)
    heights = hs.Box(box).perpendicular_heights
    assert np.allclose(heights, 1.0 / np.linalg.norm(inverse, axis=0))
    assert (heights / theirs < cutoff).any()  # bins thinner than the cutoff: 27 are too few
    assert (heights / np.floor(heights / cutoff) >= cutoff).all()


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("shape", ["cubic", "skewed"])
def test_every_mode_of_periodicity(mode, shape):
    periodic = MODES[mode]
    box = np.diag([4.0, 4.0, 4.0]) if shape == "cubic" else LOSSY["skewed"][0] / 5.0
    points = np.random.default_rng(1).random((14, 3)) @ box
    expected = by_rule(points, 1.5, box, periodic)
    assert len(expected) > 10
    assert edges(points, 1.5, box=box, periodic=periodic) == expected
    assert all(s == 0 or flag for _, _, S in expected for s, flag in zip(S, periodic))


@pytest.mark.parametrize("ratio", [0.37, 0.63, 0.88, 1.19])
@pytest.mark.parametrize("name", LOSSY)
def test_image_windows(ratio, name):
    """Cutoffs by the least height of the cell: all images, each once, from wherever one counts."""
    box = LOSSY[name][0] / 4.0
    cutoff = ratio * float(hs.Box(box).perpendicular_heights.min())
    points = np.random.default_rng(2).random((3, 3)) @ box
    expected = by_rule(points, cutoff, box)
    assert edges(points, cutoff, box=box) == expected
    assert expected == {(j, i, tuple(-s for s in S)) for i, j, S in expected}
    # Whole box vectors change S by what was added, and no edge.
    turns = np.random.default_rng(3).integers(-1, 2, (3, 3))
    moved = by_rule(points + turns @ box, cutoff, box)
    assert edges(points + turns @ box, cutoff, box=box) == moved


def test_the_cutoff_is_strict_where_that_is_asked_for():
    points = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [0.0, 0.0, 9.0]])
    box = np.eye(3) * 20.0
    assert edges(points, 5.0, box=box) == set()
    assert edges(points, np.nextafter(5.0, 6.0), box=box) == {(0, 1, (0,) * 3), (1, 0, (0,) * 3)}
    assert hs.count_pairs(points, 5.0, box=box) == 1


@pytest.mark.parametrize("far", [-1e-17, -20.0, 20.0, 1e6])
@pytest.mark.parametrize("periodic", [(True, True, False), (False, False, True), (False,) * 3])
def test_points_outside_of_open_axes(far, periodic):
    """The page of the seed dropped them, later versions bin them at the edge; here they are points
    like others."""
    box = np.eye(3) * 6.0
    points = np.random.default_rng(5).random((12, 3)) * 6.0
    points[:4] += np.where(periodic, 0.0, far)
    assert edges(points, 2.0, box=box, periodic=periodic) == by_rule(points, 2.0, box, periodic)


def nearest_image(points, i, j, box, near):
    """The first image, in ascending order, of those that are nearest to point i."""
    rows = [[Fraction(x) for x in row] for row in np.asarray(box, float).tolist()]
    along = [Fraction(b) - Fraction(a) for a, b in zip(points[i].tolist(), points[j].tolist())]
    sizes = {
        S: sum((along[k] + sum(s * row[k] for s, row in zip(S, rows))) ** 2 for k in range(3))
        for S in near
    }
    return min(near, key=lambda S: (sizes[S], S))


@pytest.mark.parametrize("ratio", [0.37, 0.88])
@pytest.mark.parametrize("name", LOSSY)
def test_labels_are_those_of_the_original(ratio, name):
    """Edges within one inclusion label, without the minimum images of equal exclusion labels."""
    box = LOSSY[name][0] / 4.0
    cutoff = ratio * float(hs.Box(box).perpendicular_heights.min())
    points = np.random.default_rng(4).random((6, 3)) @ box
    inclusion, exclusion = [0, 0, 0, 1, 1, 1], [0, 0, 1, 2, 2, 2]
    images = list(itertools.product(range(-2, 3), repeat=3))
    expected = {
        (i, j, S)
        for i, j, S in by_rule(points, cutoff, box)
        if inclusion[i] == inclusion[j]
        and not (
            i != j and exclusion[i] == exclusion[j]
            and S == nearest_image(points, i, j, box, images)
        )
    }  # fmt: skip
    found = edges(points, cutoff, box=box, groups=inclusion, exclude=exclusion)
    assert found == expected
    # Labels of their own take out (i, i, 0) alone, which is no edge here.
    assert edges(points, cutoff, box=box, exclude=range(6)) == edges(points, cutoff, box=box)
