# SPDX-License-Identifier: BSD-3-Clause
"""Scenes that are searched in parts, and what one search says of them."""

import numpy as np

import halfshell as hs

LETTERS = "ijdDSP"

# A box for which LAPACK has no inverse.
NO_INVERSE = np.array(
    [[6687355403199.516, 2068641513505.0], [668735540.3192828, 206864151.35029313]]
)


def scenes():
    """Name -> points, cutoff, box and periodicity."""
    rng = np.random.default_rng(3)
    points = rng.random((240, 3)) * 9.0 - 2.0
    skewed = np.array([[4.0, 0.0, 0.0], [1.5, 3.0, 0.0], [-0.5, 0.75, 5.0]])
    lattice = np.stack(np.meshgrid(*[np.arange(6.0)] * 2), -1).reshape(-1, 2)
    far = np.repeat([0.0, 1e9, -3e12], 80)[:, None]
    return {
        "open": (points, 0.9, {}),
        "mixed": (points, 0.9, {"box": skewed, "periodic": [True, False, True]}),
        "skewed": (points, 0.7, {"box": skewed}),
        "images": (points[:9], 3.3, {"box": np.eye(3)}),
        "single": (points.astype(np.float32), 0.9, {"box": [7.0, 8.0, 9.0]}),
        "whole numbers": (lattice.astype(np.int32), 1.0, {"box": [6.0, 6.0]}),
        "clusters": (points + far, 0.8, {}),
        "on the cuts": (lattice, 1.0, {"box": [6.0, 6.0]}),
        "eight axes": (rng.random((14, 8)), 0.9, {"box": 1.0}),
        "one axis": (points[:, :1], 0.05, {"box": 5.0}),
        "one point": (np.ones((1, 3)), 1.5, {"box": 1.0}),
        "none": (np.empty((0, 3)), 1.0, {"box": 1.0}),
        **dict(_of_any_size()),
        **dict(_in_skewed_boxes()),
    }


def _of_any_size():
    """The same scenes in units from among the smallest numbers to among the largest."""
    points = np.random.default_rng(4).integers(-30, 90, (120, 3)) / 8.0
    left_handed = np.array([[0.0, 8.0, 0.0], [6.0, 1.5, 0.0], [0.0, -2.0, 7.0]])
    for exponent in (-1060, -800, -540, 535, 541, 1016):
        unit = 2.0**exponent
        for kind, box, periodic in (
            ("upright", np.diag([8.0, -7.0, 9.0]), [True, True, True]),
            ("oblique", left_handed, [True, exponent % 2 == 0, True]),
        ):
            scene = {"box": box * unit, "periodic": periodic}
            yield f"{kind}, 2**{exponent}", (points * unit, 1.25 * unit, scene)
    yield "open, 2**1016", (points * 2.0**1016, 1.25 * 2.0**1016, {})
    thin = {"box": np.diag([2.0**400, 2.0**-400]), "periodic": [False, True]}
    yield "lengths far apart", (points[:, :2] * [2.0**397, 2.0**-397], 2.0**-400, thin)


def _in_skewed_boxes():
    """Boxes whose vectors are long sums of short ones, or nearly depend on each other."""
    rng = np.random.default_rng(5)
    for number, ndim in enumerate((1, 2, 3, 3, 5)):
        box = rng.normal(size=(ndim, ndim)) + 3.0 * np.eye(ndim)
        points, cutoff = rng.random((120, ndim)) @ box, 0.3 * ndim
        for k in range(1, ndim):
            box[k] += int(rng.integers(-3000, 3000)) * box[k - 1]
        periodic = [True] * ndim if ndim < 5 else [k != 2 for k in range(ndim)]
        scene = {"box": box, "periodic": periodic}
        yield f"sheared {number}", (points, cutoff, scene)
    flat = np.array([[3.0, 1.0], [3.0 / 7.0, 1.0 / 7.0 + 2.0**-30]])
    yield "nearly flat", (rng.random((120, 2)) @ flat, 1e-7, {"box": flat})
    yield "flat for LAPACK", (rng.random((120, 2)) * 60.0, 4.0, {"box": NO_INVERSE})


def same(found, expected):
    """Whether arrays are the same, byte for byte."""
    return len(found) == len(expected) and all(
        one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
        for one, other in zip(found, expected, strict=True)
    )


def in_order(columns):
    """Columns of `LETTERS`, ascending by (i, j, S)."""
    place = np.lexsort((*columns[4].T[::-1], columns[1], columns[0]))
    return [column[place] for column in columns]


def serial(points, cutoff, options):
    """All pairs by one search, ascending."""
    return hs.pairs(points, cutoff, quantities=LETTERS, sort=True, **options)


def known_scenes():
    """Name -> what is known of each point, cutoff, box, and which pairs count."""
    rng = np.random.default_rng(11)
    n = 150
    points = rng.random((n, 3)) * 6.0 - 1.0
    skewed = {"box": np.array([[4.0, 0.0, 0.0], [1.5, 3.0, 0.0], [-0.5, 0.75, 5.0]])}
    radii = rng.random(n) * 0.5
    radii[7] = 1.5
    elements = rng.choice(["A", "B", "Si"], n)
    elements[rng.random(n) < 0.9] = "B"  # some bricks and chunks have no "A"
    pairs = hs.pairs(points, 0.9, quantities="P", **skewed)[::3]
    grid = np.stack(np.meshgrid(*[np.arange(6.0)] * 2), -1).reshape(-1, 2)
    halves = hs.pairs(np.arange(8.0)[:, None], 4.0, box=8.0, quantities="P")
    a = rng.normal(size=(n, 3, 3))
    supports = a @ a.transpose(0, 2, 1) + 2.0 * np.eye(3)
    supports += supports.transpose(0, 2, 1)
    shape = {"positions": points, "supports": supports}
    by_name = {("A", "*"): 1.2, ("Si", "Si"): 0.8, ("B", "B"): 0.5}
    table = np.array([[0.4, 0.9, 0.0], [0.9, 0.5, 0.7], [0.0, 0.7, 1.1]])
    balls = {"positions": points, "radii": radii}
    return {
        "radii": (balls, None, skewed, {}),
        "the larger radius, at most": (balls, 1.0, {}, {"rule": "max"}),
        "half of the sum": (balls, None, skewed, {"rule": "mean", "exclude": pairs}),
        "by name": ({"positions": points, "types": elements}, by_name, skewed, {}),
        "a table of names": ({"positions": points, "types": elements}, table, {}, {}),
        "by number": (
            {"positions": points, "types": rng.integers(0, 3, n)}, {(0, 1): 0.9, (2, 2): 1.1},
            skewed, {"min_distance": 0.3},
        ),
        "supports": (shape, 2.0, skewed, {}),
        "in both supports": (shape, 2.5, {}, {"rule": "min"}),
        "groups": ({"positions": points, "groups": elements}, 0.9, skewed, {}),
        "labels": ({"positions": points, "labels": np.arange(n) // 4}, 0.9, skewed, {"exclude": 1}),
        "names of labels": ({"positions": points, "labels": elements}, 0.9, {}, {"exclude": 0}),
        "excluded pairs": ({"positions": points}, 0.9, skewed, {"exclude": pairs}),
        "two nearest images": (
            {"positions": np.arange(8.0)[[3, 0, 6, 1, 7, 5, 2, 4], None]}, 5.0, {"box": 8.0},
            {"exclude": halves},
        ),
        "on the cuts": (
            {"positions": grid, "radii": np.full(36, 0.5), "groups": grid[:, 0].astype(int) // 3},
            None, {"box": [6.0, 6.0], "periodic": [True, False]}, {"min_distance": 1.0},
        ),
    }  # fmt: skip


def every_scene():
    """Name -> what is known of each point, cutoff, box, and which pairs count."""
    plain = {name: ({"positions": points}, cutoff, scene, {})
             for name, (points, cutoff, scene) in scenes().items()}  # fmt: skip
    return plain | {f"{name}, known": scene for name, scene in known_scenes().items()}


def without_rule(which):
    return {key: value for key, value in which.items() if key != "rule"}


def rows_of(known, some):
    """What is known of some of the points."""
    return {name: values[some] for name, values in known.items()}
