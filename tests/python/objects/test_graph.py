# SPDX-License-Identifier: BSD-3-Clause
"""`NeighborTable.graph` gives what the formulas of graph networks take, as they write them."""

import numpy as np
import pytest

import halfshell as hs
from oracles import BOX_KINDS, random_scene


def mace_vectors(positions, edge_index, shifts):
    """As mace.modules.utils.get_edge_vectors_and_lengths has it."""
    sender, receiver = edge_index
    return positions[receiver] - positions[sender] + shifts


def nequip_vectors(pos, edge_index, cell, edge_cell_shift):
    """As nequip.data.AtomicDataDict.with_edge_vectors has it."""
    edge_vec = pos[edge_index[1]] - pos[edge_index[0]]
    return edge_vec + np.einsum("ni,ij->nj", edge_cell_shift, cell)


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_the_formulas_of_graph_networks_hold(kind, rng):
    for ndim in (1, 2, 3, 4):
        points, cutoff, box, periodic = random_scene(rng, 40, ndim, kind, neighbours=8, spread=1)
        cell = np.eye(ndim) if box is None else box
        table = hs.neighbors(points, cutoff, box=box, periodic=periodic, quantities="SjDd")
        graph = table.graph()
        edge_index, shifts, vectors, distances = graph
        assert edge_index.shape == (2, table.n_entries) and edge_index.dtype == table.indices.dtype
        assert np.array_equal(edge_index, table.edge_index())
        assert shifts.dtype == np.int32 and vectors.dtype == np.float64
        close = {"rtol": 0.0, "atol": 1e-12 * (1.0 + np.abs(points).max() + np.abs(cell).max())}
        found = mace_vectors(points, edge_index, shifts @ cell)
        np.testing.assert_allclose(found, vectors, **close)
        found = nequip_vectors(points, edge_index, cell, shifts)
        np.testing.assert_allclose(found, vectors, **close)
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), distances, rtol=1e-12)
        # The formula for S and D of the table itself, in the docstring of edge_index.
        j, i = table.edge_index()
        found = points[j] - points[i] + table.shifts @ cell
        np.testing.assert_allclose(found, table.vectors, **close)
        assert not np.signbit(vectors[vectors == 0.0]).any()


def test_targets_may_be_queries(rng):
    points, queries = rng.random((30, 3)), rng.random((9, 3)) + 0.5
    table = hs.neighbors(points, 0.6, queries=queries, box=np.eye(3), quantities="jDS")
    edge_index, shifts, vectors, distances = table.graph()
    found = queries[edge_index[1]] - points[edge_index[0]] + shifts @ np.eye(3)
    np.testing.assert_allclose(found, vectors, atol=1e-14)
    assert distances is None and len(vectors) > 9


def test_what_is_lacking_is_named():
    for letters in ("j", "jd", "jD", "jS", "DS"):
        table = hs.neighbors([[0.0], [1.0]], 1.0, quantities=letters)
        with pytest.raises(AttributeError, match="quantities='jDS'"):
            table.graph()


def test_a_graph_without_edges():
    graph = hs.neighbors(np.empty((0, 3)), 1.0, quantities="jdDS").graph()
    assert isinstance(graph, hs.Graph)
    assert [part.shape for part in graph] == [(2, 0), (0, 3), (0, 3), (0,)]
