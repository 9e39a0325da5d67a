# SPDX-License-Identifier: BSD-3-Clause
# ruff: noqa: F811 - `bench` is a fixture
"""The scenes of the benchmarks are what they say: same bits, right numbers of pairs."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from benchmark_modules import bench, only_in_a_checkout  # noqa: F401
from checkout import BENCHMARKS

pytestmark = [pytest.mark.slow, only_in_a_checkout]


def test_scenes_are_the_same_bits_everywhere(bench: SimpleNamespace) -> None:
    wrong = [
        name for name, (_, digest) in bench.scenes.known().items()
        if bench.scenes.load(name).digest()[:16] != digest
    ]  # fmt: skip
    assert wrong == []


def test_bits_of_the_main_scenes_do_not_change_between_versions(bench: SimpleNamespace) -> None:
    # Published figures are for these; the file of digests must not be rewritten to fit.
    for name, digest in {
        "pairs-1e5-k52": "3e7ebaaea2290d9a",
        "pairs-1e5-k419": "89b7f67896d21537",
        "pairs-1e4-k52": "591c588ebe613318",
        "triclinic-1e4-k52": "22250674d028a6ef",
        "open-1e4": "9eb8f351d6b964f9",
        "plane-1e5-k20": "acfd44725c8b2005",
        "clusters-1e5": "b0ada625a20bf5e8",
        "molecule-30": "ecf10619ec12ac10",
        "images-64": "286f0c9fc8dafefb",
        "silicon-8": "5be367769c9fca4a",
        "fcc-shell": "bdcfc5de21d8b36c",
    }.items():
        assert bench.scenes.known()[name][1] == digest, name


def test_scenes_keep_their_promises(bench: SimpleNamespace) -> None:
    for name in bench.scenes.known():
        if "uniform-1e6" in name:
            continue  # the same but for the size
        scene = bench.scenes.load(name)
        assert scene.name == name
        assert scene.points.dtype == np.float64
        assert scene.points.flags.c_contiguous
        assert len(scene.periodic) == (0 if scene.box is None else scene.dim)
        assert set(scene.peers) <= set(bench.peers.PEERS)
        assert {limit.other for limit in scene.limits} <= {*bench.scenes.SCENES, ""}
        labels = [limit.label for limit in scene.limits]
        assert len(set(labels)) == len(labels)
        if scene.rows is not None and scene.batch is None:
            fractions = scene.points @ np.linalg.inv(scene.rows)
            assert fractions.min() >= 0.0
            assert fractions.max() < 1.0
        if scene.about_pairs:
            assert scene.n_pairs == pytest.approx(scene.about_pairs, rel=0.02)
    with pytest.raises(KeyError, match="no scene 'nothing'"):
        bench.scenes.load("nothing")


def test_groups_hold_every_scene_and_have_titles(bench: SimpleNamespace) -> None:
    scenes = bench.scenes
    assert set(scenes.GROUPS) == set(scenes.TITLES)
    assert all(scenes.GROUPS.values())
    assert {name for names in scenes.GROUPS.values() for name in names} == set(scenes.SCENES)
    assert set(scenes.QUICK) <= set(scenes.SCENES)
    readme = (BENCHMARKS / "README.md").read_text()
    assert [group for group in scenes.GROUPS if f"`{group}`" not in readme] == []
