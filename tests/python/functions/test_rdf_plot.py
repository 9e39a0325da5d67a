# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of g(r) and n(r), by what they hold."""

import sys

import numpy as np
import pytest

import halfshell as hs


@pytest.fixture
def pyplot():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


@pytest.fixture
def points(rng):
    return rng.random((200, 3))


def legend(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def test_one_line_without_types(pyplot, points):
    result = hs.rdf(points, 0.4, bins=20, box=[1.0] * 3)
    axes = result.plot()
    assert axes.get_lines()[0].get_ydata().tolist() == result.g.tolist()
    assert axes.get_xlim() == (0.0, 0.4) and axes.get_ylim()[0] == 0.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("distance r", "g(r)")
    assert axes.get_legend() is None
    assert result.plot(unit="Å").get_xlabel() == "distance r / Å"


def test_a_line_for_each_two_types(pyplot, points):
    own = pyplot.subplots()[1]
    typed = hs.rdf(points, 0.4, bins=20, types=np.arange(200) % 3, box=[1.0] * 3)
    assert typed.plot(own) is own
    assert legend(own) == ["0-0", "0-1", "0-2", "1-1", "1-2", "2-2"]
    assert own.get_legend().get_title().get_text() == "types"
    own.clear()
    queries = {"queries": points[:50], "query_types": np.arange(50) % 2}
    typed = hs.rdf(points, 0.4, bins=20, types=np.arange(200) % 2, box=[1.0] * 3, **queries)
    assert len(legend(typed.plot(own))) == 4  # [a, b] is not [b, a]
    own.clear()
    sparse = hs.rdf(points, 0.4, bins=20, types=3 * (np.arange(200) % 2), box=[1.0] * 3)
    assert legend(sparse.plot(own)) == ["0-0", "0-3", "3-3"]  # types 1 and 2 have no points


def test_names_and_coordination(pyplot, points):
    names = np.where(np.arange(200) < 50, "Si", "O")
    result = hs.rdf(points, 0.4, bins=20, types=names, box=[1.0] * 3)
    assert legend(result.plot()) == ["O-O", "O-Si", "Si-Si"]
    axes = result.plot(quantity="n", unit="nm")
    assert legend(axes) == ["O around O", "Si around O", "O around Si", "Si around Si"]
    assert axes.get_ylabel() == "n(r)" and axes.get_xlabel() == "distance r / nm"
    assert axes.get_lines()[2].get_ydata().tolist() == [0.0, *result["Si", "O"].n_r]
    assert axes.get_lines()[2].get_xdata().tolist() == result.edges.tolist()
    part = result["Si", "O"].plot()
    assert part.get_legend() is None and len(part.get_lines()) == 2


def test_infinite_values_and_no_points(pyplot):
    near = hs.rdf([[0.0] * 3, [1e-120] * 3], 4e-120, bins=2, box=[1.0] * 3)
    assert np.isnan(near.plot().get_lines()[0].get_ydata()).tolist() == [True, False]
    none = hs.rdf(np.empty((0, 1)), 0.4, bins=2, types=[], box=[1.0])
    assert none.plot().get_legend() is None


def test_other_quantities_are_refused(pyplot):
    result = hs.rdf([[0.0], [0.5]], 0.4, bins=2, box=[1.0])
    with pytest.raises(ValueError, match="quantity"):
        result.plot(quantity="G")


def test_without_matplotlib_an_error_names_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    result = hs.rdf([[0.0], [0.5]], 0.4, bins=2, box=[1.0])
    with pytest.raises(ImportError, match=r"plot needs matplotlib: pip install matplotlib$"):
        result.plot()
