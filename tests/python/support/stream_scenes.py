# SPDX-License-Identifier: BSD-3-Clause
"""Small scenes for functions that hand pairs out bit by bit."""

import numpy as np

BOX = np.array([[1.0, 0.0, 0.0], [0.3, 0.9, 0.0], [-0.4, 0.2, 1.1]])


def scenes():
    """Points, cutoff and keywords: 1 to 5 dimensions, open, periodic, tilted, with images."""
    rng = np.random.default_rng(5)
    for d in range(1, 6):
        points = rng.random((80, d))
        yield f"open {d}-D", points, 0.4, {}
        yield f"box {d}-D", points, 0.3, {"box": np.ones(d)}
    points = rng.random((60, 3))
    yield "triclinic", points, 0.4, {"box": BOX}
    yield "mixed", points, 0.4, {"box": BOX, "periodic": [True, False, True]}
    yield "images", points[:20], 1.7, {"box": BOX}
    yield "float32", points.astype(np.float32), 0.4, {"box": [1.0] * 3}
    yield "lattice, exclusive", np.indices((5, 5, 5)).reshape(3, -1).T, 1.0, {"inclusive": False}
    yield "coincident", np.zeros((30, 2)), 0.0, {}
    yield "none", points, 0.0, {}
    yield "no points", points[:0], 1.0, {}
    yield "one point", points[:1], 1.0, {"box": [2.0] * 3}


SCENES = {name: rest for name, *rest in scenes()}
