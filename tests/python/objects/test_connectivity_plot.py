# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a connectivity: each node, ghost and pair is in them."""

import numpy as np
import pytest

import halfshell as hs

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")


@pytest.fixture
def axes():
    from matplotlib import pyplot

    figure, ax = pyplot.subplots()
    yield ax
    pyplot.close(figure)


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
def test_all_nodes_and_pairs_are_drawn(axes, d, matrices):
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


def test_pairs_in_a_box_are_drawn_to_the_image(axes):
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
