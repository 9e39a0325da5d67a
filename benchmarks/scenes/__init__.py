# SPDX-License-Identifier: BSD-3-Clause
"""The scenes that every benchmark measures: named inputs with fixed seeds, in named groups.

A scene is built when it is asked for, so listing names costs nothing:

    scene = load("pairs-1e5-k52")
    scene.points, scene.cutoff, scene.box, scene.periodic

Coordinates are the same bits on every machine, so `Scene.digest` may be compared between
machines.
"""

from scenes import named  # noqa: F401 - whose scenes are added
from scenes.scene import GROUPS, SCENES, TITLES, Limit, Scene, known, load

__all__ = ["GROUPS", "QUICK", "SCENES", "TITLES", "Limit", "Scene", "known", "load"]

# A smoke test: each kind of scene, none of them long.
QUICK = (
    "call-2", "molecule-30", "images-64", "silicon-8", "pairs-1e4-k52", "fcc-shell",
    "uniform-1e3-k50", "batch-30", "single-100",
)  # fmt: skip
