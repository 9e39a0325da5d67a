# SPDX-License-Identifier: BSD-3-Clause
"""The edges of kUPS's own neighbour lists are those that are found here."""

from typing import NamedTuple

import numpy as np
import pytest

import halfshell as hs
from calls import call

kups = pytest.importorskip(
    "kups.core.neighborlist", reason="kups is not installed: it asks for Python 3.13"
)
jax = pytest.importorskip("jax")
jnp = jax.numpy

from kups.core.capacity import FixedCapacity  # noqa: E402
from kups.core.cell import Cell, TriclinicFrame  # noqa: E402
from kups.core.data import Index, Table  # noqa: E402
from kups.core.typing import ExclusionId, InclusionId, ParticleId, SystemId  # noqa: E402
from kups.core.utils.jax import dataclass  # noqa: E402

SHEARED = np.array([[5.0, 0.0, 0.0], [1.0, 4.5, 0.0], [0.5, 0.7, 5.2]])
MODES = [(True,) * 3, (True, True, False), (False, False, True), (False,) * 3]


@dataclass
class Points:
    positions: jax.Array
    system: Index
    inclusion: Index
    exclusion: Index


@dataclass
class Systems:
    cell: Cell


class Given(NamedTuple):
    """Points of one or more systems, and their labels."""

    x: np.ndarray
    batch: np.ndarray
    groups: np.ndarray
    labels: np.ndarray


@pytest.fixture(autouse=True)
def wide():
    with jax.enable_x64(True):
        yield


def given(n, boxes, seed, n_labels=None):
    rng = np.random.default_rng(seed)
    batch = np.sort(rng.integers(0, len(boxes), n))
    x = np.einsum("na,nab->nb", rng.random((n, 3)), boxes[batch])
    labels = np.arange(n) if n_labels is None else rng.integers(0, n_labels, n)
    groups = np.zeros(n, int) if n_labels is None else rng.integers(0, 2, n)
    return Given(x, batch, groups, labels)


def table_of(points, n_systems, n_labels):
    return Table.arange(
        Points(
            jnp.asarray(points.x), Index.integer(points.batch, n=n_systems, label=SystemId),
            Index.integer(points.groups, n=2, label=InclusionId),
            Index.integer(points.labels, n=n_labels, label=ExclusionId),
        ),
        label=ParticleId,
    )  # fmt: skip


def edges(kind, points, boxes, periodic, cutoffs, queries=None):
    """As a set of (i, j, S): keys and queries, or points twice."""
    n_labels = 1 + max(one.labels.max() for one in (points, queries) if one is not None)
    cutoffs = Table.arange(jnp.asarray(cutoffs), label=SystemId)
    few, many = FixedCapacity(400), FixedCapacity(4000)  # what does not fit would be left out
    find = (
        kups.CellListNeighborList(few, few, many, many, cutoffs) if kind == "cells"
        else kups.DenseNearestNeighborList(few, few, many, cutoffs)
    )  # fmt: skip
    frame = TriclinicFrame.from_matrix(jnp.asarray(boxes))
    systems = Table.arange(Systems(Cell(frame, periodic=periodic)), label=SystemId)
    more = {}
    if queries is not None:
        more["queries"] = table_of(queries, len(boxes), n_labels)
    found = find(table_of(points, len(boxes), n_labels), systems, **more)
    ends = np.asarray(found.indices.indices)
    shifts = np.asarray(found.shifts)[:, 0].astype(int)
    is_edge = ends[:, 0] < len(points.x)
    rows = np.hstack((ends[is_edge], shifts[is_edge])).tolist()
    assert len(rows) == len({tuple(row) for row in rows})
    return {tuple(row) for row in rows}


def as_set(i, j, S):
    return {tuple(row) for row in np.column_stack((i, j, S)).tolist()}


def ours(points, box, periodic, cutoff, **more):
    table = call(
        hs.neighbors,
        points.x,
        cutoff,
        box=box,
        periodic=periodic,
        quantities="jS",
        inclusive=False,
        **more,
    )
    return as_set(*table.to_pairs(quantities="ijS"))


@pytest.mark.parametrize("kind", ["cells", "dense"])
@pytest.mark.parametrize("periodic", MODES)
def test_edges_in_every_mode_of_periodicity(kind, periodic):
    points = given(70, SHEARED[None], 1)
    for cutoff in (1.4, 3.1):  # the second passes half the box
        if kind == "cells" and cutoff > 2.0:
            continue  # cells of the original are as wide as the cutoff: dense lists are for these
        expected = edges(kind, points, SHEARED[None], periodic, [cutoff])
        assert expected == ours(points, SHEARED, periodic, cutoff) and expected


@pytest.mark.parametrize("kind", ["cells", "dense"])
def test_systems_with_boxes_and_cutoffs_of_their_own(kind):
    other = np.array([[5.5, 0.0, 0.0], [-0.8, 5.0, 0.0], [1.2, -0.6, 4.8]])
    boxes = np.array([SHEARED, np.diag([6.0, 5.0, 4.5]), other])
    cutoffs = np.array([1.3, 1.1, 1.45])
    points = given(150, boxes, 2)
    expected = edges(kind, points, boxes, (True,) * 3, cutoffs)
    assert expected == ours(points, boxes, None, cutoffs, batch=points.batch) and expected


@pytest.mark.parametrize("kind", ["cells", "dense"])
def test_labels(kind):
    points = given(80, SHEARED[None], 3, n_labels=9)
    expected = edges(kind, points, SHEARED[None], (True,) * 3, [1.6])
    chosen = {"groups": points.groups, "exclude": points.labels}
    assert expected == ours(points, SHEARED, None, 1.6, **chosen)
    assert expected < ours(points, SHEARED, None, 1.6)


@pytest.mark.parametrize("kind", ["cells", "dense"])
def test_two_sets(kind):
    points, queries = given(90, SHEARED[None], 4), given(25, SHEARED[None], 5)
    queries = queries._replace(labels=queries.labels + 90)  # no label is that of a point
    found = edges(kind, points, SHEARED[None], (True, False, True), [1.5], queries)
    i, j, S = hs.pairs_between(
        points.x, queries.x, 1.5, box=SHEARED, periodic=(True, False, True), quantities="ijS",
        inclusive=False,
    )  # fmt: skip
    assert found == as_set(i, j, S) and found
