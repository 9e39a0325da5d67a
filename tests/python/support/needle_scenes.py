# SPDX-License-Identifier: BSD-3-Clause
"""The pairs of the scenes of needles, by fractions."""

from fractions import Fraction

import numpy as np


def is_reached(H, extent, rule, i, j, vector, inclusive=True):
    """Whether i and j are a pair by their supports, at this D of float64."""
    D = [Fraction(x) for x in vector.tolist()]
    limit = Fraction(extent) ** 2
    judged = []
    for matrix in (H[i].tolist(), H[j].tolist()):
        square = sum(sum(Fraction(a) * x for a, x in zip(row, D)) ** 2 for row in matrix)
        judged.append(square <= limit if inclusive else square < limit)
    return all(judged) if rule == "min" else any(judged)


def needle_pairs(scene):
    """All (i, j, *S), ascending: in a cube so large that each pair has one image, and i < j.

    The places are whole numbers of 2**-31, and so is the edge: D is exact in float64.
    """
    edge = scene.box[0]
    longest = 1.01 * scene.extent / np.linalg.eigvalsh(scene.supports).min()
    assert longest < edge / 2.0
    assert (scene.points * 2.0**31 % 1.0 == 0.0).all() and edge * 2.0**31 % 1.0 == 0.0
    i, j = np.triu_indices(scene.n_points, 1)
    D = scene.points[j] - scene.points[i]
    S = -np.rint(D / edge)
    D += S * edge
    near = np.flatnonzero(np.linalg.norm(D, axis=1) <= longest)
    return sorted(
        (int(i[k]), int(j[k]), *S[k].astype(int).tolist())
        for k in near
        if is_reached(
            scene.supports, scene.extent, scene.rule, i[k], j[k], D[k], scene.inclusive
        )
    )
