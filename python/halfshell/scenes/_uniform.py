# SPDX-License-Identifier: BSD-3-Clause
"""The scene that is not hard."""

from __future__ import annotations

import numpy as np

from halfshell.scenes._catalogue import add
from halfshell.scenes._make import CUBE, cube
from halfshell.scenes._scene import Scene, Size


@add({"uniform": ("points uniform in a periodic cube",)})
def uniform(size: Size) -> Scene:
    """Nothing: the reference that the others are held against. About 52 neighbours a point."""
    points, edge = cube(size, 1)
    return Scene(points, 5.0, np.full(3, edge), CUBE)
