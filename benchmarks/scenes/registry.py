# SPDX-License-Identifier: BSD-3-Clause
"""Names of scenes, the groups they are in, and what is known of each beforehand.

A scene is a function that makes it and a name; it is built when it is asked for. `known.csv`
holds the number of pairs and the first digits of the digest of every scene up to a million
points. `benchmarks/check_scenes.py` counts the pairs by other means and compares.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

from scenes.scene import Scene

__all__ = ["GROUPS", "SCENES", "add", "known", "load"]

Make = Callable[[str], Scene]

SCENES: dict[str, Make] = {}

# What the groups are for; their scenes are added by the modules of this package.
TITLES = {
    "main": "the scenes with a wanted ratio",
    "growth": "cost a point from 1e4 to 1e7 points",
    "S1": "uniform periodic cubes: neighbours 6 to 400, points 1e3 to 1e7",
    "S2": "water: molecules at the density of the liquid",
    "S3": "crystals with a shell at the cutoff, and 1e-12 beside it",
    "S4": "much empty space: slab, droplet, two distant clusters",
    "S5": "clustered points in open space",
    "S6": "contacts: close packing, grains of sizes 1 to 10",
    "S7": "two dimensions",
    "S8": "narrow angles, and boxes shorter than two cutoffs",
    "S9": "batches of small systems",
    "S10": "single calls on few points: median and 99th percentile",
    "S11": "rows of all neighbours, and two sets",
    "S12": "histograms of distances",
    "S13": "input order: random, sorted, and the worst",
    "S14": "one thread and two",
    "S15": "the k nearest points",
    "S16": "a reach for each pair, by radii or types",
}
GROUPS: dict[str, list[str]] = {group: [] for group in TITLES}


def add(group: str, name: str = "") -> Callable[[Make], Make]:
    """Register a function that makes the scene of the name that it is given.

    Without `name` the scene bears the function's name, underscores written as hyphens.
    """

    def keep(make: Make) -> Make:
        full = name or make.__name__.replace("_", "-")
        SCENES[full] = make
        GROUPS[group].append(full)
        return make

    return keep


@cache
def known() -> dict[str, tuple[int, str]]:
    """Return the number of pairs and the digits of the digest, by scene."""
    with (Path(__file__).parent / "known.csv").open(newline="", encoding="utf-8") as file:
        return {row["scene"]: (int(row["pairs"]), row["digest"]) for row in csv.DictReader(file)}


def load(name: str) -> Scene:
    """Build the scene of this name. Raises KeyError with the names that there are."""
    if name not in SCENES:
        raise KeyError(f"no scene {name!r}; there are {', '.join(SCENES)}")
    scene = SCENES[name](name)
    if name in known():
        scene = replace(scene, n_pairs=known()[name][0])
    return scene
