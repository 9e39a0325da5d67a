# SPDX-License-Identifier: BSD-3-Clause
# ruff: noqa: F811 - `bench` is a fixture
"""The scenes of the benchmarks are what they say: same bits, right numbers of pairs."""

from __future__ import annotations

import re
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


def test_every_scene_but_the_largest_is_known(bench: SimpleNamespace) -> None:
    unknown = set(bench.scenes.SCENES) - set(bench.scenes.known())
    assert unknown == {name for name in bench.scenes.SCENES if "-1e7" in name}
    assert set(bench.scenes.known()) <= set(bench.scenes.SCENES)


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


def test_the_guide_says_what_is_wanted(bench: SimpleNamespace) -> None:
    """A second name of a row is what the first ends with, or what follows it."""
    scenes = bench.scenes
    readme = (BENCHMARKS / "README.md").read_text()
    rows = re.findall(r"^\| (`.*) \|.*\| ([\d, ]+) \|$", readme, re.MULTILINE)
    for cell, wanted in rows:
        first, *endings = re.findall("`(.*?)`", cell)
        others = [first.rpartition("-")[0] + ending for ending in endings]
        names = [first, *(one if one in scenes.SCENES else first + ending
                          for one, ending in zip(others, endings, strict=True))]  # fmt: skip
        assert [scenes.load(name).want for name in names] == [float(x) for x in wanted.split(",")]
    assert len(rows) > 10


@pytest.mark.parametrize(
    "name",
    ["uniform-1e4-k50", "uniform-1e5-k6", "pairs-1e4-k52", "triclinic-1e4-k52", "open-1e4",
     "clusters-1e5", "narrow-1e4", "plane-1e5-k8", "plane-1e5-k30", "packing-131k", "slab-1e5",
     "droplet-1e5", "two-clusters-open", "two-clusters-periodic", "lognormal-1e5", "plummer-1e5",
     "equal-2000", "one-cell-2000", "outlier-1e5", "batch-30", "growth-1e4-sorted", "rows-1e4-k52",
     "between-1e5", "between-few", "between-halves", "balls-equal-1e5", "balls-1to10-1e5",
     "types-3-1e5", "graded-1e5"],
)  # fmt: skip
def test_pair_numbers_of_larger_scenes_are_those_of_a_tree(
    bench: SimpleNamespace, name: str
) -> None:  # fmt: skip
    pytest.importorskip("scipy")
    scene = bench.scenes.load(name)
    assert bench.check_scenes.count_pairs(scene) == scene.n_pairs


def test_a_reach_belongs_to_each_pair(bench: SimpleNamespace) -> None:
    for name in bench.scenes.GROUPS["S16"]:
        scene = bench.scenes.load(name)
        assert scene.has_reach and (scene.radii is None) != (scene.types is None)
        if scene.types is not None:
            assert scene.table.max() == scene.cutoff and np.array_equal(scene.table, scene.table.T)
            assert set(scene.types.tolist()) == set(range(len(scene.table)))
            continue
        assert len(scene.radii) == scene.n and scene.radii.min() > 0.0
        both = np.sort(scene.radii)[-2:]
        assert scene.cutoff >= (both.sum() if scene.rule == "sum" else both[1])
    graded = bench.scenes.load("graded-1e5")
    x = np.maximum(np.linalg.norm(graded.points, axis=1), 1e-4)
    rho = graded.n / (8.0 * np.pi * x**2.5)
    assert np.allclose(graded.radii, (150.0 / (4.0 * np.pi * rho)) ** (1.0 / 3.0), rtol=1e-12)


def test_pairs_are_judged_by_their_own_reach(bench: SimpleNamespace) -> None:
    scene = bench.scenes.Scene(
        "s", "", np.array([[0.0], [0.3], [3.0]]), 2.1, radii=np.array([0.1, 0.2, 2.0])
    )
    is_pair = bench.agreement.is_pair
    # The real sum of 0.1 and 0.2 is more than 0.3, as float64 has them.
    assert is_pair(scene, 0, 1, None, True)[0] and not is_pair(scene, 1, 2, None, True)[0]
    assert is_pair(scene, 1, 2, None, True)[1] == pytest.approx((2.7**2 / 2.2**2 - 1) * 1.1 / 2.1)


@pytest.mark.parametrize("name", ["batch-1e4-open", "batch-1e4-periodic"])
def test_batches_are_made_of_the_systems_that_they_say(bench: SimpleNamespace, name: str) -> None:
    scene = bench.scenes.load(name)
    systems = scene.systems()
    sizes = [system.n for system in systems]
    assert (len(systems), min(sizes), max(sizes), sum(sizes)) == (10_000, 20, 100, scene.n)
    for number in (0, 4321, 9999):
        system = systems[number]
        first = sum(sizes[:number])
        assert np.array_equal(system.points, scene.points[first : first + system.n])
        edge = (10.0 * system.n) ** (1.0 / 3.0)
        assert system.points.min() >= 0.0
        assert system.points.max() < edge
        if system.rows is not None:
            assert np.allclose(system.rows, edge * np.eye(3), rtol=1e-14)
            assert np.array_equal(scene.rows_at(first), system.rows)
    assert scene.orthorhombic


@pytest.mark.parametrize(
    ("name", "quarters", "bases"),
    [("fcc-tie", 8, 4), ("fcc-shell", 8, 4), ("diamond-shell", 8, 8)],
)
def test_pair_numbers_of_crystals_lie_between_strict_and_inclusive(
    bench: SimpleNamespace, name: str, quarters: int, bases: int
) -> None:  # fmt: skip
    scene = bench.scenes.load(name)
    sites = np.rint(scene.points * (4.0 / scene.cutoff * quarters / 4.0)).astype(np.int64)
    length = round(float(scene.box[0]) * quarters / scene.cutoff)
    near = []
    for site in sites[:bases]:
        step = (sites - site + length // 2) % length - length // 2
        near.append(np.sum(step * step, axis=1))
    strict = scene.n * (np.sum(np.array(near) < quarters**2) - bases) // bases // 2
    inclusive = scene.n * (np.sum(np.array(near) <= quarters**2) - bases) // bases // 2
    assert strict < scene.n_pairs <= inclusive
    if name == "fcc-tie":
        assert scene.n_pairs == inclusive
    # A hair beside the shell rounding decides nothing.
    assert bench.scenes.load(f"{name}-below").n_pairs == strict
    assert bench.scenes.load(f"{name}-above").n_pairs == inclusive


def test_orders_of_input_are_orders_of_the_same_points(bench: SimpleNamespace) -> None:
    drawn = bench.scenes.load("order-random").points
    for name in ("order-sorted", "order-strided"):
        points = bench.scenes.load(name).points
        assert np.array_equal(np.sort(points[:, 0]), np.sort(drawn[:, 0]))
        assert np.array_equal(np.sort(points.sum(axis=1)), np.sort(drawn.sum(axis=1)))
