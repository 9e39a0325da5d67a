# SPDX-License-Identifier: BSD-3-Clause
"""The scenes of balls and of needles: exact answers, and hard for what they say."""

import importlib.util

import numpy as np
import pytest

import halfshell as hs
from calls import call
from checkout import TESTS
from halfshell._check.reference import reach_by_radii, reference_pairs
from halfshell_report import scenes
from needle_scenes import needle_pairs
from oracles import triples

SPEC = importlib.util.spec_from_file_location("scene_files", TESTS / "scene_files.py")
scene_files = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(scene_files)

KEPT = scene_files.read()
BALLS, NEEDLES = scenes.names(radii=True), scenes.names(supports=True)


@pytest.mark.parametrize("name", BALLS)
def test_balls_are_paired_as_by_rational_arithmetic(name):
    given = scenes.load(name, "small")
    reach = reach_by_radii(given.radii, given.rule)
    expected = reference_pairs(given.points, reach, given.box, given.periodic, given.inclusive)
    assert len(expected) == KEPT[name]["small"]["pairs"]
    for threads in (1, 2):
        how = {**given.arguments, "quantities": "ijS", "sort": True, "threads": threads}
        for kernel in hs.kernels():
            assert triples(*call(hs.pairs, **how, kernel=kernel)) == expected


@pytest.mark.parametrize("name", NEEDLES)
def test_needles_are_paired_as_by_rational_arithmetic(name):
    scene = scenes.load(name, "small")
    expected = needle_pairs(scene)
    both = expected + [(j, i, *(-s for s in S)) for i, j, *S in expected]
    for kernel, threads in zip(hs.kernels(), (1, 2, 1, 2)):
        how = {**scene.arguments, "kernel": kernel, "threads": threads}
        assert rows_of(*call(hs.pairs, **how, quantities="ijS", sort=True)) == expected
        assert call(hs.count_pairs, **how) == len(expected) == KEPT[name]["small"]["pairs"]
        table = call(hs.neighbors, **how, quantities="jS")
        assert rows_of(*table.to_pairs(quantities="ijS")) == sorted(both)


def rows_of(i, j, S):
    return list(zip(i.tolist(), j.tolist(), *S.T.tolist(), strict=True))


@pytest.mark.parametrize("name", BALLS + NEEDLES)
def test_a_quick_scene_is_right(name):
    scene = scenes.load(name, "quick")
    i, j, S = hs.pairs(**scene.arguments, quantities="ijS")
    assert hs.verify(**scene.arguments, i=i, j=j, S=S)
    assert len(i) == KEPT[name]["quick"]["pairs"] == hs.count_pairs(**scene.arguments)


def test_rounded_sums_are_wrong_on_half_of_the_pairs():
    scene = scenes.load("balls-rounded", "quick")
    n = scene.n_points // 2
    assert n / 3 < hs.count_pairs(**scene.arguments) < 3 * n / 4
    assert call(hs.count_pairs, **scene.arguments, precision="double") == n


@pytest.mark.parametrize("name", NEEDLES)
def test_needles_are_long_and_turned_and_float64_decides_many_wrongly(name):
    scene = scenes.load(name, "quick")
    values, axes = np.linalg.eigh(scene.supports)
    assert np.allclose(values[:, 1:] / values[:, :1], 1e6, rtol=1e-6)
    along = np.abs(axes[:, :, 0])
    assert along.max() < 0.9999  # along no axis of the box
    assert len(np.unique(np.round(along, 9), axis=0)) > 30
    exact, rounded = (
        set(zip(*(x.tolist() for x in call(hs.pairs, **scene.arguments, precision=precision))))
        for precision in ("exact", "double")
    )
    assert len(exact ^ rounded) > 50
    assert exact - rounded and rounded - exact
