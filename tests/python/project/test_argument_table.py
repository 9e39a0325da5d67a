# SPDX-License-Identifier: BSD-3-Clause
"""docs/arguments.md says which function takes what: its tables are made from the functions, and
each hole has a reason. ``python tests/python/project/test_argument_table.py`` writes the page."""

import inspect
import sys
from pathlib import Path

import numpy as np

import halfshell as hs

PAGE = Path(__file__).parents[3] / "docs" / "arguments.md"

POINTS = np.random.default_rng(3).random((12, 3)) * 2.0
CUBE = [2.0, 2.0, 2.0]
LIST = hs.pairs(hs.Points(POINTS, box=CUBE, batch=np.arange(12) // 6), 0.9)


def explained(found):
    return repr(found), found.measured["pairs"]


#: A call for each function: of points with all that is known of them, and what else is given.
CALLS = {
    "pairs": lambda p, c=0.9, **how: hs.pairs(p, c, sort=True, **how),
    "pairs_between": lambda p, c=0.9, **how: hs.pairs_between(p, p, c, **how),
    "neighbors": lambda p, c=0.9, **how: list(hs.neighbors(p, c, **how)),
    "nearest": lambda p, c=None, **how: hs.nearest(p, 3, **how),
    "count_pairs": lambda p, c=0.9, **how: hs.count_pairs(p, c, **how),
    "coordination": lambda p, c=0.9, **how: hs.coordination(p, c, **how),
    "pair_histogram": lambda p, c=None, **how: hs.pair_histogram(p, [0.0, 0.5, 0.9], **how),
    "rdf": lambda p, c=None, **how: hs.rdf(p, 0.9, **how).g,
    "clusters": lambda p, c=0.5, **how: hs.clusters(p, c, **how).labels,
    "iter_pairs": lambda p, c=0.9, **how: list(hs.iter_pairs(p, c, **how)),
    "for_each_pair": lambda p, c=0.9, **how: hs.for_each_pair(p, c, lambda *pair: None, **how),
    "trajectory_pairs": lambda p, c=0.9, **how: list(hs.trajectory_pairs([p], c, **how)),
    "verify": lambda p, c=0.9, **how: hs.verify(p, c, *LIST, **how).n_expected,
    "explain": lambda p, c=0.9, **how: explained(hs.explain(p, c, measure=True, **how)),
    "measure": lambda p, c=None, **how: hs.measure(p, *LIST, **how),
    "bricks": lambda p, c=0.9, **how: [b.pairs(p) for b in hs.bricks(p, c, 2, **how)],
}
KEYWORDS = (
    *("queries", "box", "periodic", "rule", "exclude", "min_distance", "indices", "inclusive"),
    *("quantities", "index_dtype", "threads", "progress"),
)
#: What is known of points, what goes with it, and what each field changes.
HALF = np.arange(12) % 2
FIELDS = {
    "radii": ({"radii": 0.1 + 0.2 * HALF}, {}),
    "types": ({"types": HALF}, {"c": {(0, 1): 0.8}}),
    "supports": ({"supports": np.eye(3) * (1.0 + HALF)[:, None, None]}, {}),
    "groups": ({"groups": HALF}, {}),
    "labels": ({"labels": HALF}, {"exclude": 0}),
    "weights": ({"weights": 1.0 + HALF}, {}),
    "batch": ({"batch": np.arange(12) // 6, "box": [np.diag(CUBE), np.eye(3)]}, {}),
    "several cutoffs": ({}, {"c": [0.5, 0.9], "quantities": "jk"}),
}  # fmt: skip


def plain(found):
    """Something that == compares."""
    if isinstance(found, (list, tuple)):
        return [plain(one) for one in found]
    return found.tolist() if isinstance(found, np.ndarray) else found


def matters(function, field):
    """Whether a call is answered, and not as without this."""
    known, how = FIELDS[field]
    if (
        "quantities" in how
        and "quantities" not in inspect.signature(getattr(hs, function)).parameters
    ):
        how = {"c": how["c"]}
    points = hs.Points(POINTS, box=CUBE)
    try:
        found = CALLS[function](points.replace(**known), **how)
    except (TypeError, ValueError):
        return False
    return plain(found) != plain(CALLS[function](points))


#: Why functions do not take something.
REASONS = {
    "`pairs_between` takes queries": {
        "pairs iter_pairs for_each_pair trajectory_pairs explain": "queries",
    },
    "Rows are those of the queries: give these alone": {"pairs_between": "indices"},
    "`pairs` and `neighbors` find those of some points, which are few": {
        "for_each_pair": "indices",
    },
    "Some points are given as queries": {"rdf": "indices"},
    "It plans the search of all points": {"explain": "indices"},
    "Clusters are of one set, and whole": {"clusters": "queries indices"},
    "The nearest go by distance, up to `max_distance`, not by a reach of each pair": {
        "nearest": "rule radii types supports",
    },
    "Bins have edges: the last one is the cutoff, and closed": {
        "pair_histogram rdf": "rule inclusive radii types supports several",
    },
    "The result has a fixed form": {
        "count_pairs coordination pair_histogram rdf clusters for_each_pair verify":
        "quantities index_dtype",
        "measure": "index_dtype",
    },
    "Given pairs are measured, whatever they are": {
        "measure": "rule exclude min_distance indices inclusive radii types supports groups labels "
        "several",
    },
    "`pair_histogram` sums weights": {
        "pairs pairs_between neighbors nearest count_pairs coordination rdf clusters iter_pairs "
        "for_each_pair trajectory_pairs verify explain measure bricks": "weights",
    },
    "The form of the callback is fixed, and has no shell": {"for_each_pair": "several"},
    "Each cutoff has a list of its own, which is verified by itself": {"verify": "several"},
    "Clusters and bricks have one reach": {"clusters bricks": "several"},
    "It has a number of neighbours in place of a cutoff": {"nearest": "several"},
    "The callback itself can tell how far it is": {"for_each_pair": "progress"},
    "Each system has a plan and bricks of its own": {"explain bricks": "batch"},
    "Methods of each brick take it": {
        "bricks": "exclude min_distance inclusive quantities threads labels",
    },
    "`bricks` only divides the points": {"bricks": "queries indices index_dtype progress"},
}  # fmt: skip
WORDS = {"several": "several cutoffs"}


def reasons():
    """{(function, argument): number of the reason}."""
    return {
        (function, WORDS.get(argument, argument)): number
        for number, holes in enumerate(REASONS.values(), 1)
        for functions, arguments in holes.items()
        for function in functions.split()
        for argument in arguments.split()
    }


def taken():
    """{(function, argument): whether it is taken}."""
    found = {}
    for function in CALLS:
        parameters = inspect.signature(getattr(hs, function)).parameters
        found |= {(function, one): one in parameters for one in KEYWORDS}
        found |= {(function, one): matters(function, one) for one in FIELDS}
    return found


def table(found, columns):
    why = reasons()
    lines = ["| | " + " | ".join(f"`{c}`" if c[:4] != "seve" else c for c in columns) + " |"]
    lines.append("| --- |" + " :-: |" * len(columns))
    for function in CALLS:
        cells = [
            "•" if found[function, column] else str(why.get((function, column), "?"))
            for column in columns
        ]
        lines.append(f"| `{function}` | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def page():
    found = taken()
    text = "\n".join(f"{k}. {reason}." for k, reason in enumerate(REASONS, 1))
    return f"""# Which function takes what

A dot: taken, with the same meaning everywhere. A number: not taken, for the reason below of that
number. These tables are made from the functions.

## Arguments

{table(found, KEYWORDS)}

Methods of `CellList` take what the functions of the same names take, but for `box` and `periodic`,
which are those of the list. {{class}}`~halfshell.settings` holds for all.

## What is known of points

What `Points` may have beside positions, box and periodicity, and several cutoffs at once. By
`types` means a cutoff for each two types; `labels` go with `exclude`.

{table(found, FIELDS)}

## Why not

{text}
"""


def test_each_hole_has_a_reason_and_nothing_else():
    holes = {one for one, is_taken in taken().items() if not is_taken}
    assert sorted(holes - reasons().keys()) == []
    assert sorted(reasons().keys() - holes) == []


def test_the_page_is_what_the_functions_say():
    assert PAGE.read_text() == page(), "run tests/python/project/test_argument_table.py"


if __name__ == "__main__":
    PAGE.write_text(page())
    sys.exit("?" in PAGE.read_text())
