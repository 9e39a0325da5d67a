# SPDX-License-Identifier: BSD-3-Clause
"""What a user's mistake is answered: the keyword that is meant, and a short traceback."""

import inspect

import numpy as np
import pytest

import halfshell as hs
from boundary import called_with, frames_of_ours
from calls import call

POINTS = np.random.default_rng(0).random((10, 3))

CALLS = {
    "pairs": lambda x, **how: call(hs.pairs, x, 1.0, **how),
    "pairs_between": lambda x, **how: call(hs.pairs_between, x, POINTS, 1.0, **how),
    "neighbors": lambda x, **how: call(hs.neighbors, x, 1.0, **how),
    "coordination": lambda x, **how: call(hs.coordination, x, 1.0, **how),
    "count_pairs": lambda x, **how: call(hs.count_pairs, x, 1.0, **how),
    "nearest": lambda x, **how: call(hs.nearest, x, 2, **how),
    "pair_histogram": lambda x, **how: call(hs.pair_histogram, x, [0.0, 1.0], **how),
    "rdf": lambda x, **how: call(hs.rdf, x, 1.0, **{"box": 5.0, **how}),
    "iter_pairs": lambda x, **how: list(call(hs.iter_pairs, x, 1.0, **how)),
    "for_each_pair": lambda x, **how: call(hs.for_each_pair, x, 1.0, print, **how),
    "clusters": lambda x, **how: call(hs.clusters, x, 1.0, **how),
    "explain": lambda x, **how: call(hs.explain, x, 1.0, **how),
    "measure": lambda x, **how: call(hs.measure, x, [0], [1], **how),
    "bricks": lambda x, **how: call(hs.bricks, x, 1.0, 2, **how),
    "trajectory_pairs": lambda x, **how: list(call(hs.trajectory_pairs, [x], 1.0, **how)),
    "CellList": lambda x, **how: hs.CellList(x, 1.0, **how),
    "VerletList": lambda x, **how: hs.VerletList(1.0, 0.1, **how).update(x),
}


MEANT = {"pbc": "periodic", "cell": "box", "boxsize": "box", "workers": "threads"}


@pytest.mark.parametrize("name", [name for name in CALLS if name.islower()])
def test_keywords_of_other_libraries_are_answered_with_ours(name):
    known = inspect.signature(getattr(hs, name)).parameters
    for theirs, ours in MEANT.items():
        if ours not in known:
            continue
        with pytest.raises(TypeError) as refused:
            CALLS[name](POINTS, **{theirs: None})
        assert str(refused.value) == (
            f"{name}() got an unexpected keyword argument {theirs!r}: did you mean {ours}=?"
        )


#: Keywords that there were -> what stands in their place.
OLD = {
    **{name: f"set it around the call, with hs.settings({name}=...)"
       for name in ("kernel", "algorithm", "precision", "memory_limit")},
    **{name: f"it is known of the points: hs.Points(points, {name}=...)"
       for name in ("radii", "types", "supports", "groups", "weights", "batch")},
    **{f"query_{name}": f"it is known of the points: hs.Points(queries, {name}=...)"
       for name in ("radii", "types", "supports", "groups", "weights", "batch")},
    "query_exclude": "labels are those of hs.Points(queries, labels=...)",
    "capacity": "out= takes arrays of a fixed length, and halfshell.jax has fixed shapes",
    "on_overflow": "out= takes arrays of a fixed length, and halfshell.jax has fixed shapes",
    "exclude_within": "did you mean exclude=?", "extent": "did you mean cutoff=?",
    "touching": "did you mean indices=?", "winding": "Clusters.spans is there in every case",
    "r_max": "did you mean cutoff=?",
}  # fmt: skip


@pytest.mark.parametrize("old", OLD)
def test_old_keywords_are_answered_with_what_stands_in_their_place(old):
    meant = OLD[old].removeprefix("did you mean ").removesuffix("=?")
    for name in (*CALLS, "verify"):
        function = getattr(hs, name)
        if meant != OLD[old] and meant not in inspect.signature(function).parameters:
            continue  # it has no such argument
        with pytest.raises(TypeError, match=f"unexpected keyword argument '{old}'") as refused:
            called_with(name, function, **{old: None})
        assert str(refused.value).endswith(OLD[old]), name
        assert frames_of_ours(refused.value) <= 5


class Universe:
    trajectory = ()


#: What newcomers try -> what the message says besides what is wrong.
HINTS = {
    r"got \(3, 10\): one row for each point, as in points\.T$": lambda: hs.pairs(POINTS.T, 1.0),
    r"got \(3,\): one point is points\[None, :\]": lambda: hs.pairs(POINTS[0], 1.0),
    r"points on a line are queries\[:, None\]$": lambda: hs.neighbors(
        POINTS, 1.0, queries=POINTS[:, 0]
    ),
    r"as in reshape\(3, 3\)$": lambda: hs.pairs(POINTS, 1.0, box=np.eye(3).ravel()),
    r"one length does not say how many dimensions$": lambda: hs.Box(5.0),
    r"keys, such as \('Si', 'O'\), got 'Si-O'$": lambda: call(
        hs.pairs, POINTS, {"Si-O": 1.0}, types=["Si"] * 10
    ),
    r"use np\.flatnonzero\(indices\)$": lambda: hs.neighbors(
        POINTS, 1.0, indices=POINTS[:, 0] > 0.5
    ),
    r"got indices\[1\] = 10$": lambda: hs.neighbors(POINTS, 1.0, indices=[0, 10]),
    r"one pair is \[\[i, j\]\]$": lambda: hs.pairs(POINTS, 1.0, exclude=[0, 1]),
    r"a radius for each point is one of Points\(radii=\.\.\.\)": lambda: hs.neighbors(
        POINTS, np.ones(10)
    ),
    r"\(i is the row itself\), got 'ijd'$": lambda: hs.neighbors(POINTS, 1.0, quantities="ijd"),
    r"cutoff must be None, or the last edge of bins, 2\.0, got 1\.0$": lambda: hs.rdf(
        POINTS, 1.0, bins=[0.0, 2.0], box=5.0
    ),
    r"did you mean neighbors\?$": lambda: hs.neighbours,
    r"no point is its own neighbour, unless queries= are the points$": lambda: hs.neighbors(
        POINTS, 1.0, include_self=True
    ),
    r"got Universe: pass its trajectory$": lambda: hs.trajectory_pairs(Universe(), 1.0),
    r"^a NeighborTable is what neighbors\(\) returns": lambda: hs.NeighborTable([0], [1]),
    r"'sort': it is an argument of pairs and trajectory_pairs$": lambda: hs.neighbors(
        POINTS, 1.0, sort=True
    ),
    r"'touching': did you mean indices=\?$": lambda: hs.pairs(POINTS, 1.0, touching=[1]),
    r"'radii': it is known of the points: hs\.Points\(points, radii=\.\.\.\)$": lambda: hs.pairs(
        POINTS, None, radii=[1.0] * 10
    ),
    r"'query_types': it is known of the points: hs\.Points\(queries, types=": lambda: hs.neighbors(
        POINTS, 1.0, queries=POINTS, query_types=[0] * 10
    ),
    r"'kernel': set it around the call, with hs\.settings\(kernel=": lambda: hs.pairs(
        POINTS, 1.0, kernel="scalar"
    ),
    r"argument 'zzz'$": lambda: hs.pairs(POINTS, 1.0, zzz=1),
    r"takes 2 positional .* 3 were given: points, cutoff; others by name, such as quantities=$":
        lambda: hs.pairs("ijd", POINTS, 1.0),
    r"'rule': the nearest go by distance alone: find more, and drop some$":
        lambda: hs.nearest(POINTS, 2, rule="max"),
    r"'range': the last edge is the cutoff$": lambda: hs.pair_histogram(
        POINTS, [0.0, 1.0], range=(0.0, 1.0)
    ),
    r"got \(\): as from np\.linspace\(0\.0, cutoff, bins \+ 1\)$": lambda: hs.pair_histogram(
        POINTS, 50
    ),
    r"'full': pairs has each pair once, neighbors from both sides$": lambda: hs.pairs(
        POINTS, 1.0, full=True
    ),
    r"'block_size': did you mean max_pairs=\?$": lambda: hs.iter_pairs(POINTS, 1.0, block_size=9),
    r"settings\(\) takes 0 .* 1 were given: none; others by name, such as kernel=$":
        lambda: hs.settings("scalar"),
    r"'thread': did you mean threads=\?$": lambda: hs.settings(thread=1),
    r"quantities must be a string of letters, got list$": lambda: hs.pairs(
        POINTS, 1.0, quantities=["i", "j"]
    ),
    r"points are those of update\(points\)$": lambda: hs.VerletList(POINTS, 1.0),
    r"must be a number: points are those": lambda: hs.VerletList(hs.Points(POINTS), 1.0),
    r"of pairs P: i, j = P\.T$": lambda: hs.verify(POINTS, 1.0, np.zeros((1, 2), int)),
    r"got str; to write a file: plot\(\)\.figure\.savefig\(file\)$": lambda: hs.rdf(
        POINTS, 1.0, box=5.0
    ).plot("g.png"),
    r"each library has a module, ase, ": lambda: hs.compat.cKDTree,
    r"are a list of arrays, as in Points\.stack\(list\(points\)\)$": lambda: hs.pairs(
        np.zeros((2, 3, 3)), 1.0
    ),
}


@pytest.mark.parametrize("hint", HINTS)
def test_common_mistakes_are_answered_with_what_is_meant(hint):
    with pytest.raises((TypeError, ValueError, AttributeError), match=hint):
        HINTS[hint]()


def test_points_are_told_what_others_call_what_they_know():
    for theirs, ours in [
        ("cell", "box"), ("pbc", "periodic"), ("radius", "radii"), ("species", "types"),
        ("symbols", "types"), ("resids", "labels"), ("masses", "weights"), ("type", "types"),
    ]:  # fmt: skip
        with pytest.raises(TypeError, match=rf"Points\(\) got .*: did you mean {ours}=\?$"):
            hs.Points(POINTS, **{theirs: None})


def test_names_of_other_libraries_are_answered_with_ours():
    for theirs, ours in [
        ("neighbor_list", "neighbors"), ("find_pairs", "pairs"), ("cKDTree", "CellList"),
        ("knn", "nearest"), ("RDF", "rdf"), ("gr", "rdf"), ("DBSCAN", "clusters"),
        ("distances", "measure"), ("Lattice", "Box"), ("quartz", "structures.alpha_quartz"),
    ]:  # fmt: skip
        with pytest.raises(AttributeError, match=f"'{theirs}': did you mean {ours}\\?"):
            getattr(hs, theirs)
        assert eval(f"hs.{ours}")
    with pytest.raises(AttributeError, match=r"halfshell\.compat\.scipy has a cKDTree like the"):
        hs.cKDTree  # noqa: B018


def test_tables_by_frame_are_no_frames():
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame(POINTS, columns=["x", "y", "z"]).assign(frame=np.arange(10) // 5)
    groups = table.groupby("frame")
    for frames in (table, groups):
        with pytest.raises(TypeError, match=r"\(part for _, part in table\.groupby\(column\)\)"):
            next(hs.trajectory_pairs(frames, 1.0, box=5.0))
    found = hs.trajectory_pairs((part for _, part in groups), 1.0)
    assert [len(i) for i, j in found] == hs.count_pairs(
        hs.Points(table, batch=table["frame"]), 1.0
    ).tolist()
    with pytest.raises(ValueError, match="points must have a column x beside y, got x_0, y, z"):
        hs.pairs(table.rename(columns={"x": "x_0"}), 1.0)
