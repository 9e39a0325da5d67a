# SPDX-License-Identifier: BSD-3-Clause
"""What pairs are compared with where each has a reach of its own, for the truth (`pairs`).

`Balls` are points with a radius each, `Ellipsoids` those with a support. Another reach needs a
class with the same attributes and methods, and is chosen in `reach_of`.
"""

from __future__ import annotations

from typing import Any, TypeAlias

from halfshell_report.truth.balls import Balls
from halfshell_report.truth.ellipsoids import Ellipsoids

__all__ = ["Balls", "Ellipsoids", "Reach", "reach_of"]

Reach: TypeAlias = Balls | Ellipsoids


def reach_of(scene: Any) -> Reach | None:
    """The reach of a scene of `scenes`; None where one cutoff holds for all pairs."""
    if scene.radii is not None:
        return Balls(scene.radii, scene.rule)
    if scene.supports is not None:
        return Ellipsoids(scene.supports, scene.extent, scene.rule)
    return None
