# SPDX-License-Identifier: BSD-3-Clause
"""The scenes of balls: exact answers, the same bits everywhere, and hard for what they say."""

import importlib.util

import numpy as np
import pytest

import halfshell as hs
from checkout import TESTS
from halfshell_report import scenes
from reach_scenes import Reaching, check

SPEC = importlib.util.spec_from_file_location("scene_files", TESTS / "scene_files.py")
scene_files = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(scene_files)

KEPT = scene_files.read()
NAMES = scenes.names(radii=True)
every_scene = pytest.mark.parametrize("name", NAMES)


@every_scene
def test_pairs_are_those_of_rational_arithmetic(name):
    for threads in (1, 2):
        found = check(Reaching(**scenes.load(name, "small").arguments), threads=threads)
        assert len(found) == KEPT[name]["small"]["pairs"]


@every_scene
def test_a_quick_scene_is_right(name):
    scene = scenes.load(name, "quick")
    i, j, S = hs.pairs(**scene.arguments, quantities="ijS")
    assert hs.verify(**scene.arguments, i=i, j=j, S=S)
    assert len(i) == KEPT[name]["quick"]["pairs"] == hs.count_pairs(**scene.arguments)


@pytest.mark.parametrize("size", scenes.SIZES)
def test_the_bits_are_those_that_are_written_down(size):
    for name in NAMES:
        scene = scenes.load(name, size)
        assert scene.n_points == KEPT[name][size]["n"]
        assert scene_files.digest(scene) == KEPT[name][size]["digest"]


def test_fields_have_the_promised_types():
    for name in NAMES:
        scene = scenes.load(name, "small")
        n, ndim = scene.points.shape
        assert scene.cutoff is None and scene.rule in ("sum", "mean", "max", "min")
        assert scene.radii.shape == (n,) and scene.radii.dtype == np.float64
        assert scene.radii.flags.c_contiguous and (scene.radii >= 0.0).all()
        assert len(scene.periodic) == ndim and 10 <= len(scene.title) <= 80
        assert len(scene.stresses) > 40
        sizes = [KEPT[name][size]["n"] for size in scenes.SIZES]
        assert sizes[0] <= 300 < sizes[1] <= 10_000 < sizes[2] <= 1_000_000


def test_the_kinds_are_apart():
    assert len(NAMES) >= 6 and not set(NAMES) & set(scenes.names())
    assert all(not scenes.load(name, "small").reach for name in scenes.names())
    of_supports = scenes.names(supports=True)
    assert of_supports and not set(of_supports) & {*NAMES, *scenes.names()}
    assert scenes.names(radii=True, supports=True) == (*NAMES, *of_supports)


def test_rounded_sums_are_wrong_on_half_of_the_pairs():
    scene = scenes.load("balls-rounded", "quick")
    n = scene.n_points // 2
    exact = hs.count_pairs(**scene.arguments)
    assert n / 3 < exact < 3 * n / 4
    assert hs.count_pairs(**scene.arguments, precision="double") == n


def test_sizes_span_six_decades():
    radii = scenes.load("balls-decades", "full").radii
    assert 0.9e6 < radii.max() / radii.min() < 1.1e6


def test_ties_are_many():
    one, other = (
        hs.count_pairs(**scenes.load(name, "quick").arguments)
        for name in ("balls-ties", "balls-ties-strict")
    )
    assert one - other > 1000
