# SPDX-License-Identifier: BSD-3-Clause
"""The scenes of points that come, go and move: hard for what they say, and answered exactly."""

import numpy as np
import pytest

import dynamic_model
import halfshell as hs
from halfshell_report import scenes

NAMES = scenes.names(updates=True)
every_scene = pytest.mark.parametrize("name", NAMES)


def start(scene, storage):
    cells = hs.DynamicCellList(
        scene.ndim, scene.cutoff, box=scene.box,
        periodic=None if scene.box is None else scene.periodic, storage=storage,
        inclusive=scene.inclusive,
    )  # fmt: skip
    cells.insert_many(np.arange(scene.n_points), scene.points)
    return cells


def play(cells, updates, k, points):
    """Make one update, in the list and in a dict of positions."""
    key, position = int(updates.keys[k]), updates.positions[k]
    if updates.removed[k]:
        assert cells.remove(key) == (points.pop(key, None) is not None)
    else:
        cells.insert(key, position)
        points[key] = position


def storages(name):
    """Those that a scene can be stored in."""
    return ["hash", "all-pairs"] if name == "disks-outliers" else ["hash", "dense", "all-pairs"]


@every_scene
def test_each_state_is_that_of_rational_arithmetic(name):
    scene = scenes.load(name, "small")
    box, periodic = (scene.box, scene.periodic) if scene.box is not None else (None, None)
    lists = [start(scene, storage) for storage in storages(name)]
    model = dynamic_model.Model(scene.ndim, box, periodic, scene.inclusive)
    points = dict(enumerate(scene.points))
    for k in range(len(scene.updates.keys)):
        states = [dict(points) for _ in lists]
        for cells, state in zip(lists, states):
            play(cells, scene.updates, k, state)
        points = states[0]
        if k % 100 == 99:
            model.points.clear()
            for key, position in points.items():
                model.insert(key, position)
            centre = scene.updates.positions[k]
            expected = model.within(centre, scene.cutoff)
            for cells in lists:
                keys, shifts = cells.within(centre, scene.cutoff, shifts=True)
                assert set(zip(keys.tolist(), map(tuple, shifts.tolist()))) == expected
                assert len(keys) == len(expected)
                assert cells.any_within(centre, scene.cutoff) == bool(expected)
                dynamic_model.check_points(cells, model)


@every_scene
def test_the_last_state_is_that_of_a_search(name):
    scene = scenes.load(name, "quick")
    for storage in storages(name)[:2]:
        cells = start(scene, storage)
        points = dict(enumerate(scene.points))
        for k in range(len(scene.updates.keys)):
            play(cells, scene.updates, k, points)
        assert len(cells) == len(points) and set(cells) == points.keys()
        keys = np.array(sorted(points))
        last = np.array([points[key] for key in keys.tolist()])
        table = hs.neighbors(last, scene.cutoff, box=scene.box,
                             periodic=None if scene.box is None else scene.periodic,
                             inclusive=scene.inclusive)  # fmt: skip
        offsets, found = cells.within_many(last, scene.cutoff)
        assert np.array_equal(np.diff(offsets), table.counts + 1)  # and itself
        for row in range(0, len(keys), 7):
            within = found[offsets[row] : offsets[row + 1]].tolist()
            within.remove(keys[row])
            assert sorted(within) == sorted(keys[table[row]].tolist())
            any_other = cells.any_within(last[row], scene.cutoff, skip=int(keys[row]))
            assert any_other == (len(table[row]) > 0)


def test_far_points_are_no_dense_list():
    scene = scenes.load("disks-outliers", "small")
    cells = start(scene, "dense")
    points = {}
    with pytest.raises((ValueError, MemoryError), match="GB for its cells"):
        for k in range(len(scene.updates.keys)):
            play(cells, scene.updates, k, points)


def test_rounded_decisions_are_wrong_where_disks_touch():
    """In float32, and by whether touching counts."""
    strict, inclusive = (
        scenes.load(name, "quick") for name in ("disks-touching", "disks-touching-inclusive")
    )
    counts = [start(scene, "hash").within_many(scene.points, 5.0)[0][-1]
              for scene in (strict, inclusive)]  # fmt: skip
    assert counts[1] > counts[0] + 50
    D = hs.pairs(strict.points, 5.1, box=strict.box, quantities="D").astype(np.float32)
    rounded = int(((D * D).sum(axis=1) < np.float32(25.0)).sum())
    assert abs(rounded - hs.count_pairs(**strict.arguments)) > 50
