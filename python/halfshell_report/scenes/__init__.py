# SPDX-License-Identifier: BSD-3-Clause
"""Named scenes that are hard to search: exact ties, far coordinates, thin boxes, stiff steps.

Each scene is an input of `halfshell.pairs`, with the reason why it is hard. It is made on demand,
and its numbers have the same bits on every machine: they are computed from the raw stream of
PCG64 and from written constants with additions, multiplications, divisions and square roots
alone, one number at a time and in a fixed order, which IEEE arithmetic rounds in only one way.

Examples
--------
>>> import halfshell as hs
>>> from halfshell_report import scenes
>>> scene = scenes.load("fcc-shell", size="small")
>>> scene.title
'fcc crystal, cutoff on its eighth shell'
>>> scene.n_points, scene.cutoff, scene.periodic
(108, 8.0, (True, True, True))
>>> hs.count_pairs(**scene.arguments)
7560
"""

# In this order they are listed and run.
from halfshell_report.scenes import (  # noqa: F401, I001
    _basic,
    _numbers,
    _boxes,
    _density,
    _bodies,
    _motion,
)
from halfshell_report.scenes._catalogue import SIZES, Motion, Scene, Size, Updates, load, names

__all__ = ["SIZES", "Motion", "Scene", "Size", "Updates", "load", "names"]
