# SPDX-License-Identifier: BSD-3-Clause
"""The radial distribution function: counts over those of an ideal gas, by type, of many frames, and
its pictures."""

import math

import numpy as np
import pytest

import halfshell as hs
from calls import call

BALLS = {1: 2.0, 2: math.pi, 3: 4.0 * math.pi / 3.0, 4: math.pi**2 / 2.0}


@pytest.mark.parametrize("ndim", BALLS)
def test_an_ideal_gas_has_one_everywhere(ndim, rng):
    box = np.diag(np.full(ndim, 10.0)) + np.tril(rng.uniform(-2, 2, (ndim, ndim)), -1)
    points = rng.random((1500, ndim)) @ box
    result = hs.rdf(points, 4.0, bins=4, box=box)
    assert result.r.tolist() == [0.5, 1.5, 2.5, 3.5]
    assert result.edges.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert result.counts.tolist() == hs.pair_histogram(points, result.edges, box=box).tolist()
    volume = abs(np.linalg.det(box))
    shells = BALLS[ndim] * np.diff(result.edges**ndim)
    assert np.allclose(result.g, 2.0 * result.counts * volume / (1500**2 * shells), rtol=1e-12)
    assert np.all(np.abs(result.g - 1.0) < 0.2)


@pytest.mark.filterwarnings("error")
def test_no_points_and_absent_types_have_a_g_of_zero():
    assert hs.rdf([], 1.0, bins=2, box=[1.0] * 3).g.tolist() == [0.0, 0.0]
    one = hs.rdf([[0.0]], 0.4, bins=2, box=[1.0])
    assert one.g.tolist() == [0.0, 0.0] and one.counts.tolist() == [0, 0]
    result = call(hs.rdf, [[0.0], [0.3]], 0.4, bins=2, types=[0, 2], box=[1.0])
    assert (result.g[1] == 0.0).all() and (result.g[:, 1] == 0.0).all()
    assert result.g[0, 2].tolist() == result.g[2, 0].tolist() == [0.0, 2.5]
    none = hs.rdf(np.empty((0, 1)), 0.4, bins=2, queries=[[0.5]], box=[1.0])
    assert none.g.tolist() == [0.0, 0.0]
    named = hs.Points(np.empty((0, 1)), types=[], box=1.0)
    none = hs.rdf(named, 0.4, 2, queries=hs.Points([[0.25]], types=["c"]), by_type=True)
    assert none.types == ("c",) and none.n.tolist() == [[[0.0, 0.0]]]
    none = hs.rdf([[0.5]], 0.4, bins=2, queries=np.empty((0, 1)), box=[1.0])
    assert none.g.tolist() == [0.0, 0.0]


@pytest.mark.filterwarnings("error")
def test_shells_that_float64_does_not_hold_are_0_or_infinite():
    points = [[0.0] * 3, [1e-120] * 3, [0.5] * 3]
    result = hs.rdf(points, 4e-120, bins=2, box=[1.0] * 3)
    assert result.counts.tolist() == [1, 0] and result.g.tolist() == [math.inf, 0.0]


@pytest.mark.parametrize("power", [-600, -300, 300, 600])
@pytest.mark.filterwarnings("error")
def test_the_unit_of_length_changes_nothing(power):
    points, box = np.random.default_rng(1).random((50, 3)), np.eye(3) + 0.3 * np.eye(3, k=1)
    plain = hs.rdf(points, 0.7, 9, box=box)
    scaled = hs.rdf(np.ldexp(points, power), math.ldexp(0.7, power), 9, box=np.ldexp(box, power))
    assert scaled.g.tobytes() == plain.g.tobytes()
    assert scaled.counts.tobytes() == plain.counts.tobytes()


# ---- edges, density, finite size -------------------------------------------------------------


def test_edges_of_any_spacing(rng):
    points, box = rng.random((300, 3)), np.eye(3)
    edges = np.array([0.1, 0.15, 0.3, 0.31, 0.6])
    found = hs.rdf(points, None, edges, box=box)
    assert found.edges.tolist() == edges.tolist()
    assert np.array_equal(found.counts, hs.pair_histogram(points, edges, box=box))
    assert found.r.tolist() == (0.5 * (edges[1:] + edges[:-1])).tolist()
    volumes = BALLS[3] * np.diff(edges**3)
    assert np.allclose(found.g, 2.0 * found.counts / (300**2 * volumes), rtol=1e-12)
    even = hs.rdf(points, 0.6, np.linspace(0.0, 0.6, 7), box=box)
    assert even.g.tobytes() == hs.rdf(points, 0.6, 6, box=box).g.tobytes()
    for given in (edges.tolist(), tuple(edges), edges[::-1][::-1]):
        assert np.array_equal(hs.rdf(points, 0.6, given, box=box).counts, found.counts)
    for cutoff, bins, error, message in (
        (0.5, edges, ValueError, "cutoff must be None, or the last edge of bins, 0.6, got 0.5"),
        (None, 10, TypeError, "None goes with edges"),
        (None, [0.2, 0.1], ValueError, "bins must be ascending"),
        (None, [0.2], ValueError, "bins"),
        (0.5, np.ones((2, 2)), ValueError, r"bins must have shape \(bins \+ 1,\)"),
    ):
        with pytest.raises(error, match=message):
            hs.rdf(points, cutoff, bins, box=box)


def test_a_density_in_place_of_that_of_a_box(rng):
    for ndim, ball in BALLS.items():
        points = rng.random((200, ndim)) * 2.0
        boxed = hs.rdf(points, 0.5, 5, box=[2.0] * ndim)
        same = hs.rdf(points, 0.5, 5, box=[2.0] * ndim, density=200.0 / 2.0**ndim)
        assert np.allclose(boxed.g, same.g, rtol=1e-13)
        found = hs.rdf(points, 0.5, 5, density=3.0)  # open space
        shells = ball * np.diff(found.edges**ndim)
        assert np.array_equal(found.counts, hs.pair_histogram(points, found.edges))
        assert np.allclose(found.g, 2.0 * found.counts / (200 * 3.0 * shells), rtol=1e-13)
        assert np.allclose(found.n, np.cumsum(found.counts) * 2.0 / 200)
    slab = hs.rdf(points, 0.5, 5, box=[2.0] * 4, periodic=[True, False, False, True], density=1.0)
    assert slab.counts.sum() > 0
    for wrong in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="density"):
            hs.rdf(points, 0.5, 5, density=wrong)
    with pytest.raises(TypeError, match="density must be a number"):
        hs.rdf(points, 0.5, 5, density="thin")


def test_a_finite_gas_has_fewer_pairs(rng):
    box = [1.0, 1.0]
    points, types = rng.random((7, 2)), [0, 0, 1, 1, 1, 1, 0]
    plain, finite = (
        hs.rdf(points, 0.4, 3, box=box),
        hs.rdf(points, 0.4, 3, box=box, finite_size=True),
    )
    assert np.array_equal(plain.counts, finite.counts)
    assert np.allclose(finite.expected * 7, plain.expected * 6, rtol=1e-14)
    typed = hs.Points(points, types=types, box=box)
    plain = hs.rdf(typed, 0.4, 3, by_type=True)
    finite = hs.rdf(typed, 0.4, 3, by_type=True, finite_size=True)
    ratios = finite.expected[:, :, 0] / plain.expected[:, :, 0]
    assert np.allclose(ratios, [[2 / 3, 1.0], [1.0, 3 / 4]], rtol=1e-14)
    asked = {"queries": points, "box": box}
    plain, finite = (
        hs.rdf(points, 0.4, 3, **asked),
        hs.rdf(points, 0.4, 3, finite_size=True, **asked),
    )
    assert np.array_equal(plain.expected, finite.expected)
    many = [hs.rdf(rng.random((5, 2)), 0.4, 1, box=box, finite_size=True) for _ in range(4000)]
    assert abs(sum(many).g[0] - 1.0) < 0.02  # 0.8 without


# ---- by type, and n(r) -------------------------------------------------------------------------


NAMES = np.array(["Si", "O", "Na"])
BOXES = {
    "2-D": np.array([[1.0, 0.0], [0.3, 0.9]]),
    "3-D": np.array([[1.0, 0.0, 0.0], [0.2, 1.1, 0.0], [-0.4, 0.1, 0.8]]),
}


@pytest.fixture(params=BOXES)
def box(request):
    return BOXES[request.param]


def scene(rng, box, n=60):
    return rng.random((n, len(box))) @ box, rng.integers(0, 3, n)


def around(points, types, queries, query_types, r, box, same):
    """The mean number of points of each type within r of a query of each type."""
    table = np.zeros((3, 3))
    for a in range(3):
        for b in range(3):
            asking, found = queries[query_types == a], points[types == b]
            n = hs.count_pairs(found, r, queries=asking, box=box, inclusive=False)
            itself = len(asking) if same and a == b else 0
            table[a, b] = (n - itself) / len(asking)
    return table


def test_n_is_what_points_have_around_them(rng, box):
    points, kinds = scene(rng, box)
    result = call(hs.rdf, points, 1.3, 7, types=kinds, box=box)
    plain = hs.rdf(points, 1.3, 7, box=box)
    assert result.n_centers.tolist() == np.bincount(kinds, minlength=3).tolist()
    assert plain.n_centers == len(points) and plain.types is None
    for k, r in enumerate(result.edges[1:-1]):
        found = around(points, kinds, points, kinds, r, box, same=True)
        assert np.allclose(result.n[:, :, k], found, rtol=1e-15)
        mean = hs.coordination(points, r, box=box, inclusive=False).mean()
        assert math.isclose(plain.n[k], mean, rel_tol=1e-15)
    assert math.isclose(plain.n[-1], hs.coordination(points, 1.3, box=box).mean())


def test_two_types_are_asked_for_by_name(rng, box):
    points, kinds = scene(rng, box)
    result = call(hs.rdf, points, 1.3, 7, types=NAMES[kinds], box=box)
    for a, one in enumerate(result.types):
        for b, other in enumerate(result.types):
            part = result[one, other]
            assert part.types is None and part.g.shape == (7,)
            assert np.array_equal(part.counts, result.counts[a, b])
            assert part.g.tobytes() == result.g[a, b].tobytes()
            assert part.n.tobytes() == result.n[a, b].tobytes()
            assert part.is_half == (a == b)
    numbered = call(hs.rdf, points, 1.3, 7, types=kinds, box=box)
    assert np.array_equal(numbered[np.int64(0), 2].counts, numbered.counts[0, 2])


def test_what_is_no_type_is_refused():
    result = call(hs.rdf, [[0.0], [0.5]], 0.4, 2, types=["A", "B"], box=[1.0])
    for wrong in (("A", "C"), (0, 1), ("A", None), (["A"], "B")):
        with pytest.raises(KeyError, match="not one of the types 'A', 'B'"):
            result[wrong]
    for wrong in ("A", 0, ("A",), ("A", "B", "A"), ["A", "B"]):
        with pytest.raises(TypeError, match=r"two types are needed, as in result\[a, b\]"):
            result[wrong]
    many = call(hs.rdf, [[0.0], [0.5]], 0.4, 2, types=[0, 30], box=[1.0])
    for wrong in ((0, 31), (0, -1), (0, True), (0.0, 1)):
        with pytest.raises(KeyError, match=r"not one of the types 0, .*, \.\.\."):
            many[wrong]
    with pytest.raises(TypeError, match=r"no types: rdf\(..., by_type=True\)"):
        hs.rdf([[0.0], [0.5]], 0.4, 2, box=[1.0])["A", "B"]


# ---- frames --------------------------------------------------------------------------------


def test_frames_add_up(rng, box):
    frames = [scene(rng, box, n) for n in (60, 0, 1, 45)]
    boxes = [box, 1.1 * box, box, 0.9 * box]
    each = [
        call(hs.rdf, x, 1.3, 7, types=kinds, box=one)
        for (x, kinds), one in zip(frames, boxes, strict=True)
    ]
    total = sum(each)
    counts, centers = np.zeros((3, 3, 7), np.int64), np.zeros(3, np.int64)
    expected = np.zeros((3, 3, 7))
    for one in each:
        t = len(one.types)
        counts[:t, :t] += one.counts
        expected[:t, :t] += one.expected
        centers[:t] += one.n_centers
    assert total.n_frames == 4 and total.types == (0, 1, 2)
    assert np.array_equal(total.counts, counts) and total.counts.dtype == np.int64
    assert np.array_equal(total.n_centers, centers)
    assert np.allclose(total.g * expected, counts, rtol=1e-14)
    twice = 1 + np.eye(3, dtype=int)[:, :, None]
    n = np.cumsum(twice * counts, axis=2) / centers[:, None, None]
    assert np.allclose(total.n, n, rtol=1e-14)


def test_what_cannot_be_added_is_refused():
    points, how = [[0.0], [0.5]], {"box": [1.0]}
    plain = call(hs.rdf, points, 0.4, 2, **how)
    named = call(hs.rdf, points, 0.4, 2, types=["A", "B"], **how)
    others = {
        "same edges": call(hs.rdf, points, 0.4, 3, **how),
        "with queries": call(hs.rdf, points, 0.4, 2, queries=points, **how),
        "with types and without": named,
    }
    for text, other in others.items():
        with pytest.raises(ValueError, match=text):
            plain + other
    with pytest.raises(ValueError, match="names and numbers"):
        named + call(hs.rdf, points, 0.4, 2, types=[0, 1], **how)
    for wrong in (1, 0.0, None, "A", plain.counts):
        with pytest.raises(TypeError):
            wrong + plain
    with pytest.raises(TypeError):
        plain + 1


# ---- pictures, by what they hold ---------------------------------------------------------------


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
    typed = call(hs.rdf, points, 0.4, bins=20, types=np.arange(200) % 3, box=[1.0] * 3)
    assert typed.plot(own) is own
    assert legend(own) == ["0-0", "0-1", "0-2", "1-1", "1-2", "2-2"]
    assert own.get_legend().get_title().get_text() == "types"
    own.clear()
    queries = {"queries": points[:50], "query_types": np.arange(50) % 2}
    typed = call(hs.rdf, points, 0.4, bins=20, types=np.arange(200) % 2, box=[1.0] * 3, **queries)
    assert len(legend(typed.plot(own))) == 4  # [a, b] is not [b, a]
    own.clear()
    sparse = call(hs.rdf, points, 0.4, bins=20, types=3 * (np.arange(200) % 2), box=[1.0] * 3)
    assert legend(sparse.plot(own)) == ["0-0", "0-3", "3-3"]  # types 1 and 2 have no points


def test_names_and_coordination(pyplot, points):
    names = np.where(np.arange(200) < 50, "Si", "O")
    result = call(hs.rdf, points, 0.4, bins=20, types=names, box=[1.0] * 3)
    assert legend(result.plot()) == ["O-O", "O-Si", "Si-Si"]
    axes = result.plot(quantity="n", unit="nm")
    assert legend(axes) == ["O around O", "Si around O", "O around Si", "Si around Si"]
    assert axes.get_ylabel() == "n(r)" and axes.get_xlabel() == "distance r / nm"
    assert axes.get_lines()[2].get_ydata().tolist() == [0.0, *result["Si", "O"].n]
    assert axes.get_lines()[2].get_xdata().tolist() == result.edges.tolist()
    part = result["Si", "O"].plot()
    assert part.get_legend() is None and len(part.get_lines()) == 2
