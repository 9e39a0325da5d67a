# SPDX-License-Identifier: BSD-3-Clause
"""The scenes of needles: exact answers, the same bits everywhere, and hard for what they say."""

import importlib.util

import numpy as np
import pytest

import halfshell as hs
from checkout import TESTS
from halfshell_report import scenes
from needle_scenes import needle_pairs

SPEC = importlib.util.spec_from_file_location("scene_files", TESTS / "scene_files.py")
scene_files = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(scene_files)

KEPT = scene_files.read()
NAMES = scenes.names(supports=True)
every_scene = pytest.mark.parametrize("name", NAMES)


def rows_of(i, j, S):
    return list(zip(i.tolist(), j.tolist(), *S.T.tolist(), strict=True))


@pytest.mark.parametrize("threads", [1, 2])
@every_scene
def test_pairs_are_those_of_rational_arithmetic(name, threads):
    for kernel in hs.kernels():
        scene = scenes.load(name, "small")
        how = {**scene.arguments, "kernel": kernel, "threads": threads}
        expected = needle_pairs(scene)
        assert rows_of(*hs.pairs(**how, quantities="ijS", sort=True)) == expected
        assert hs.count_pairs(**how) == len(expected) == KEPT[name]["small"]["pairs"]
        table = hs.neighbors(**how, quantities="jS")
        both = expected + [(j, i, *(-s for s in S)) for i, j, *S in expected]
        assert rows_of(*table.to_pairs(quantities="ijS")) == sorted(both)


@every_scene
def test_a_quick_scene_is_right(name):
    scene = scenes.load(name, "quick")
    i, j, S = hs.pairs(**scene.arguments, quantities="ijS")
    assert hs.verify(**scene.arguments, i=i, j=j, S=S)
    assert len(i) == KEPT[name]["quick"]["pairs"] == hs.count_pairs(**scene.arguments)


@pytest.mark.parametrize("size", scenes.SIZES)
@every_scene
def test_the_bits_are_those_that_are_written_down(name, size):
    scene = scenes.load(name, size)
    assert scene.n_points == KEPT[name][size]["n"]
    assert scene_files.digest(scene) == KEPT[name][size]["digest"]
    assert hs.count_pairs(**scene.arguments) == KEPT[name][size]["pairs"]


@every_scene
def test_fields_have_the_promised_types(name):
    scene = scenes.load(name, "small")
    n, ndim = scene.points.shape
    assert scene.cutoff is None and scene.radii is None and scene.rule in ("max", "min")
    assert scene.supports.shape == (n, ndim, ndim) and scene.supports.dtype == np.float64
    assert scene.supports.flags.c_contiguous
    assert np.array_equal(scene.supports, scene.supports.transpose(0, 2, 1))
    assert set(scene.reach) == {"supports", "extent", "rule"}
    assert len(scene.periodic) == ndim and 10 <= len(scene.title) <= 80
    sizes = [KEPT[name][size]["n"] for size in scenes.SIZES]
    assert sizes[0] <= 300 < sizes[1] <= 10_000 < sizes[2] <= 1_000_000


@every_scene
def test_needles_are_a_million_times_as_long_as_thick_and_turned(name):
    supports = scenes.load(name, "quick").supports
    values, axes = np.linalg.eigh(supports)
    assert np.allclose(values[:, 1:] / values[:, :1], 1e6, rtol=1e-6)
    along = np.abs(axes[:, :, 0])
    assert along.max() < 0.9999  # along no axis of the box
    assert len(np.unique(np.round(along, 9), axis=0)) > 30


@every_scene
def test_float64_decides_many_wrongly(name):
    scene = scenes.load(name, "quick")
    exact, rounded = (
        set(zip(*(x.tolist() for x in hs.pairs(**scene.arguments, precision=precision))))
        for precision in ("exact", "double")
    )
    assert len(exact ^ rounded) > 50
    assert exact - rounded and rounded - exact


def test_ties_are_many():
    scene = scenes.load("needles", "quick")
    on_surfaces = hs.count_pairs(**scene.arguments) - hs.count_pairs(
        **{**scene.arguments, "inclusive": False}
    )
    assert on_surfaces > 100
