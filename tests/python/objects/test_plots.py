# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of pairs, tables, cells, boxes and a connectivity, by what they hold."""

import sys

import numpy as np
import pytest

import halfshell as hs
from calls import call

BOXES = {
    1: np.array([[4.0]]),
    2: np.array([[4.0, 0.0], [1.5, 3.0]]),
    3: np.array([[4.0, 0.0, 0.0], [1.5, 3.0, 0.0], [-0.5, 0.2, 5.0]]),
}


@pytest.fixture
def pyplot():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


@pytest.fixture(params=BOXES)
def scene(request, rng):
    box = BOXES[request.param]
    return rng.random((40, len(box))) @ box, box


def segments(collection):
    """Both ends of each line; in three dimensions before they are projected."""
    found = getattr(collection, "_segments3d", None)
    return np.array(collection.get_segments() if found is None else found)


def dots(collection):
    if hasattr(collection, "_offsets3d"):
        return np.column_stack([np.asarray(part) for part in collection._offsets3d])
    return np.asarray(collection.get_offsets())


def labels(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def names(axes, ndim):
    return [getattr(axes, f"get_{name}label")() for name in "xyz"[:ndim]]


# ---- pairs ---------------------------------------------------------------------------------


def test_pairs_are_lines_to_their_images(pyplot, scene):
    points, box = scene
    ndim = len(box)
    i, j, S, D = hs.pairs(points, 1.0, box=box, quantities="ijSD")
    axes = hs.plot_pairs(points, i, j, S, box=box, unit="Å")
    inside, outside, edges, drawn = axes.collections
    at_home = ~S.any(axis=1)
    assert 0 < at_home.sum() < len(S)
    for lines, some in ((inside, at_home), (outside, ~at_home)):
        ends = segments(lines)[..., :ndim]
        assert np.allclose(ends[:, 0], points[i[some]])
        assert np.allclose(ends[:, 1], points[i[some]] + D[some])
    assert len(segments(edges)) == ndim * 2 ** (ndim - 1)
    assert np.allclose(dots(drawn)[:, :ndim], points)
    assert names(axes, ndim) == [f"{name} / Å" for name in "xyz"[:ndim]]
    for lines in (inside, outside, edges):  # nothing is cut off
        for k, name in enumerate("xyz"[:ndim]):
            low, high = getattr(axes, f"get_{name}lim")()
            assert low <= segments(lines)[..., k].min() <= segments(lines)[..., k].max() <= high
    axes.figure.canvas.draw()


def test_types_have_colours_and_names(pyplot, scene):
    points, box = scene
    kinds = np.array(["O", "Si"])[np.arange(40) % 2]
    axes = call(hs.plot_pairs, points, [], [], types=kinds, box=box)
    assert labels(axes) == ["O", "Si"]
    assert [len(dots(some)) for some in axes.collections[3:]] == [20, 20]
    assert labels(call(hs.plot_pairs, points, [], [], types=np.arange(40) % 3)) == ["0", "1", "2"]


def test_what_cannot_be_drawn_is_refused(pyplot):
    flat = pyplot.subplots()[1]
    with pytest.raises(ValueError, match="up to 3 dimensions, and the points 4"):
        hs.plot_pairs(np.zeros((2, 4)), [0], [1])
    with pytest.raises(ValueError, match='axes of projection="3d"'):
        hs.plot_pairs(np.zeros((2, 3)), [0], [1], ax=flat)
    solid = pyplot.figure().add_subplot(projection="3d")
    with pytest.raises(ValueError, match="axes of two dimensions"):
        hs.plot_pairs(np.zeros((2, 2)), [0], [1], ax=solid)
    with pytest.raises(ValueError, match=r"types must have shape \(2,\)"):
        call(hs.plot_pairs, np.zeros((2, 2)), [0], [1], types=["A"])
    with pytest.raises(TypeError, match="integers or names"):
        call(hs.plot_pairs, np.zeros((2, 2)), [0], [1], types=[0.5, 1.0])
    many = np.zeros(200_001, int)
    with pytest.raises(ValueError, match="at most 200000 pairs"):
        hs.plot_pairs(np.zeros((2, 2)), many, many + 1)
    for wrong in ([0, 5], [0.5, 0.5]):
        with pytest.raises((TypeError, ValueError, IndexError)):
            hs.plot_pairs(np.zeros((2, 2)), wrong, [1, 1])


# ---- tables --------------------------------------------------------------------------------


def test_a_row_of_a_table(pyplot, scene):
    points, box = scene
    ndim = len(box)
    table = hs.neighbors(points, 1.2, box=box, quantities="jD")
    axes = table.plot(7, unit="nm")
    j, D = table[7]
    lines, center, near = axes.collections
    assert np.allclose(segments(lines)[:, 1, :ndim], D) and not segments(lines)[:, 0].any()
    assert np.allclose(dots(near)[:, :ndim], D) and not dots(center).any()
    assert labels(axes) == ["row 7", f"{len(j)} neighbours"]
    if len(j) <= 40:
        assert sorted(int(text.get_text()) for text in axes.texts) == sorted(j.tolist())
    assert names(axes, ndim) == [f"{name} / nm" for name in "xyz"[:ndim]]
    axes.figure.canvas.draw()


def test_neighbours_by_type_and_rows_without_any(pyplot, scene):
    points, box = scene
    own = pyplot.figure().add_subplot(projection="3d" if len(box) == 3 else None)
    kinds = np.array(["O", "Si"])[np.arange(40) % 2]
    table = hs.neighbors(points, 1.5, box=box, quantities="jD")
    assert table.plot(-1, types=kinds, ax=own) is own
    j = table[-1][0]
    of_each = [(int((kinds[j] == kind).sum()), kind) for kind in ("O", "Si")]
    assert labels(own) == ["row 39", *(f"{n} {kind}" for n, kind in of_each if n)]
    alone = hs.neighbors(points[:1], 0.1, quantities="D").plot()
    assert labels(alone) == ["row 0", "0 neighbours"]
    alone.figure.canvas.draw()


def test_tables_that_cannot_be_drawn(pyplot):
    points = np.zeros((3, 2))
    with pytest.raises(AttributeError, match="has no vectors"):
        hs.neighbors(points, 1.0).plot()
    table = hs.neighbors(points, 1.0, quantities="jD")
    with pytest.raises(IndexError):
        table.plot(3)
    with pytest.raises(TypeError):
        table.plot("a")
    with pytest.raises(ValueError, match=r"types must have shape \(3,\)"):
        table.plot(types=[0])
    with pytest.raises(AttributeError, match="has no indices"):
        hs.neighbors(points, 1.0, quantities="D").plot(types=[0, 0, 0])


# ---- cells and boxes -----------------------------------------------------------------------


@pytest.mark.parametrize("periodic", [True, False])
def test_points_have_the_colour_of_their_cell(pyplot, rng, scene, periodic):
    points, box = scene
    points = np.concatenate((points, points + 3 * box[0]))
    cells = hs.CellList(points, 0.9, cell_size=0.9, box=box, periodic=periodic)
    axes = cells.plot(unit="Å")
    drawn = axes.collections[-1]
    wrapped = hs.Box(box).wrap(points)[0] if periodic else points
    assert np.allclose(dots(drawn)[:, : len(box)], wrapped[cells.order])
    if len(box) == 3:
        assert len(axes.images) == 0
        n_cells = int((np.diff(cells.cell_start) > 0).sum())
        assert len(segments(axes.collections[0])) == 12 * n_cells
    else:
        (area,) = axes.images
        colours = np.ma.compressed(area.get_array())
        assert colours.min() >= 0 and colours.max() < 8
        if periodic:
            assert len(np.unique(colours)) >= min(2, max(cells.shape))
    assert names(axes, len(box))[0] == "x / Å"
    axes.figure.canvas.draw()


def test_no_points_in_cells(pyplot):
    for ndim in (1, 2, 3):
        for how in ({}, {"box": np.ones(ndim)}):
            axes = hs.CellList(np.empty((0, ndim)), 0.5, **how).plot()
            assert len(dots(axes.collections[-1])) == 0
            axes.figure.canvas.draw()
    with pytest.raises(ValueError, match="up to 3 dimensions"):
        hs.CellList(np.zeros((2, 5)), 0.5).plot()


@pytest.mark.parametrize("ndim", BOXES)
def test_a_box(pyplot, ndim):
    axes = hs.Box(BOXES[ndim]).plot(unit="Å")
    (edges,) = axes.collections
    assert len(segments(edges)) == ndim * 2 ** (ndim - 1)
    corners = {tuple(row) for row in np.round(segments(edges)[..., :ndim].reshape(-1, ndim), 9)}
    assert len(corners) == 2**ndim
    assert [text.get_text() for text in axes.texts] == [" a", " b", " c"][:ndim]
    axes.figure.canvas.draw()
    with pytest.raises(ValueError, match="up to 3 dimensions"):
        hs.Box(np.eye(4)).plot()


def test_without_matplotlib_an_error_names_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    points = [[0.0, 0.0], [1.0, 0.0]]
    table = hs.neighbors(points, 1.0, quantities="D")
    for draw in (
        table.plot, hs.CellList(points, 1.0).plot, hs.Box([1.0, 1.0]).plot,
        lambda: hs.plot_pairs(points, [0], [1]), hs.rdf(points, 0.4, 2, box=2.0).plot,
    ):  # fmt: skip
        with pytest.raises(ImportError, match=r"plot needs matplotlib: pip install matplotlib$"):
            draw()


# ---- a connectivity ------------------------------------------------------------------------


def lists_of(d, matrices=False):
    rng = np.random.default_rng(d)
    x = rng.random((30, d))
    H = np.tile(np.eye(d) * 4.0, (30, 1, 1)) if matrices else np.full(30, 0.15)
    return [
        hs.NodeList("water & ice", x[:20], H[:20], 5), hs.NodeList("<wall>", x[20:], H[20:]),
        hs.NodeList("none", [], []),
    ]  # fmt: skip


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("matrices", [False, True])
def test_all_nodes_and_pairs_are_drawn(pyplot, d, matrices):
    axes = pyplot.subplots()[1]
    from matplotlib.collections import EllipseCollection, LineCollection

    lists = lists_of(d, matrices)
    c = hs.Connectivity(lists)
    assert c.plot(ax=axes, axes=(0, d - 1) if d > 1 else (0, 1)) is axes
    lines = next(one for one in axes.collections if isinstance(one, LineCollection))
    assert len(lines.get_segments()) == len(c.pairs)
    drawn = [one for one in axes.collections if not isinstance(one, LineCollection)]
    supports = [one for one in drawn if isinstance(one, EllipseCollection)]
    dots = [one for one in drawn if not isinstance(one, EllipseCollection)]
    assert [len(one.get_offsets()) for one in dots] == [15, 5, 10, 0, 0, 0]
    assert [len(one.get_offsets()) for one in supports] == [20, 10]
    assert np.allclose(dots[0].get_offsets()[:, 0], lists[0].positions[:15, 0])
    if d > 1:
        assert np.allclose(supports[0].get_widths(), 1.0 if matrices else 0.6)


def test_pairs_in_a_box_are_drawn_to_the_image(pyplot):
    axes = pyplot.subplots()[1]
    c = hs.Connectivity([hs.NodeList("a", [[0.1, 0.5], [0.9, 0.5]], [0.2] * 2)], box=1.0)
    c.plot(ax=axes)
    (start, end), *_ = axes.collections[0].get_segments()
    assert abs(start[0] - end[0]) == pytest.approx(0.2)


def test_a_notebook_shows_a_row_for_each_list():
    c = hs.Connectivity(lists_of(2), overlap=True)
    html = c._repr_html_()
    assert html.count("<tr>") == 4
    assert "water &amp; ice" in html
    assert "&lt;wall&gt;" in html
    assert "with overlap" in html
    assert "0 pairs" in hs.Connectivity([])._repr_html_()
