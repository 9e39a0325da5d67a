# SPDX-License-Identifier: BSD-3-Clause
"""`Points`: what they hold and refuse, their parts and stacks, and that all searches take them."""

import copy
import pickle

import numpy as np
import pytest

import halfshell as hs
from calls import FIELDS
from oracles import same_arrays

RNG = np.random.default_rng(7)
X = RNG.random((12, 2))
SKEWED = np.array([[1.0, 0.0], [0.4, 0.9]])
KNOWN = {
    "box": SKEWED, "periodic": [True, False], "radii": RNG.uniform(0.1, 0.4, 12),
    "types": np.array(["Si", "O", "Na"] * 4), "groups": [1, 1, 2] * 4, "labels": ["a", "b"] * 6,
    "weights": RNG.random(12),
}  # fmt: skip


def alike(one, other):
    """Whether two hold the same bits."""
    fields = ("positions", "box", "periodic", *FIELDS)
    return all(same(getattr(one, name), getattr(other, name)) for name in fields)


def same(a, b):
    return a is b or (a is not None and b is not None and same_arrays(a, b))


# ---- what they hold ------------------------------------------------------------------------


def test_attributes_are_what_was_given():
    points = hs.Points(X, **KNOWN)
    assert len(points) == 12 and points.n_systems == 1 and points.batch is points.supports is None
    assert same_arrays(points.positions, X) and same_arrays(points.box, SKEWED)
    assert points.periodic.tolist() == [True, False] and points.periodic.dtype == bool
    assert points.radii.dtype == points.weights.dtype == np.float64
    for name in ("radii", "types", "groups", "labels", "weights"):
        assert getattr(points, name).tolist() == np.asarray(KNOWN[name]).tolist()
    assert hs.Points(X, types=[3] * 12).types.dtype == np.int32
    assert hs.Points(X, groups=np.arange(12, dtype=np.uint8)).groups.dtype == np.int64
    bare = hs.Points(X.astype(np.float32))
    assert bare.positions.dtype == np.float32 and bare.box is bare.periodic is bare.types is None
    assert hs.Points(X, box=2.0).box.tolist() == [[2.0, 0.0], [0.0, 2.0]]
    assert hs.Points([]).positions.shape == (0, 3)
    assert hs.Points(bare).positions.dtype == np.float32  # Points of Points
    narrow = hs.Points(X, supports=np.tile(np.eye(2, dtype=np.float32), (12, 1, 1)))
    balls = hs.Points(X, radii=np.arange(12, dtype=np.float32))
    assert narrow.supports.dtype == balls.radii.dtype == np.float64
    names = np.array(["b", "a"], np.dtypes.StringDType())
    assert hs.Points([[0.0], [1.0]], types=names).types.tolist() == ["b", "a"]


def test_they_do_not_change():
    given = {name: np.array(value) for name, value in KNOWN.items()}
    x = X.copy()
    points = hs.Points(x, **given)
    x[:] = 0.0
    for array in given.values():
        array[...] = array.flat[0]
    assert alike(points, hs.Points(X, **KNOWN))
    for name in ("positions", "box", "radii", "weights"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(points, name)[0] = 1.0
    for change in (lambda: setattr(points, "radii", None), lambda: delattr(points, "radii")):
        with pytest.raises(AttributeError, match=r"Points are immutable: replace\(\) gives others"):
            change()
    points.types[:] = "X"  # a copy
    assert alike(points, hs.Points(X, **KNOWN))


def test_pickles_and_copies():
    systems = hs.Points.stack(
        [hs.Points(X, radii=[0.1] * 12, box=1.0), hs.Points(X, radii=[0.2] * 12)]
    )
    supports = hs.Points(X, supports=np.tile(np.eye(2), (12, 1, 1)))
    for points in (hs.Points(X, **KNOWN), systems, supports, hs.Points([]), hs.Points(X, box=1.0)):
        for again in (pickle.loads(pickle.dumps(points)), copy.copy(points), copy.deepcopy(points)):
            assert type(again) is hs.Points and alike(points, again)
    again = pickle.loads(pickle.dumps(systems))
    assert same_arrays(hs.pairs(again, None), hs.pairs(systems, None))


def test_parts():
    points = hs.Points(X, **KNOWN)
    numbers = np.array([7, 2, 2, 11])
    for places in (
        slice(3, 9),
        slice(None, None, -2),
        X[:, 0] > 0.5,
        numbers,
        numbers.tolist(),
        [],
    ):
        part, rows = points[places], np.arange(12)[places]
        rows = rows.astype(int)
        expected = {name: np.asarray(KNOWN[name])[rows] for name in FIELDS if name in KNOWN}
        assert alike(part, hs.Points(X[rows], box=SKEWED, periodic=[True, False], **expected))
    for wrong in (3, np.int64(3), (slice(None), 0), ((0, 1), (2, 3)), None, "a", [None]):
        with pytest.raises(TypeError, match=r"Points\[...\] must take a slice, a mask or numbers"):
            points[wrong]
    systems = hs.Points(X, batch=np.repeat([0, 2], 6), box=np.stack([SKEWED] * 3))
    assert systems[4:8].batch.tolist() == [0, 0, 2, 2] and systems[4:8].n_systems == 3
    with pytest.raises(ValueError, match="batch must ascend"):
        systems[::-1]


def test_replaced():
    points = hs.Points(X, **KNOWN)
    assert alike(points.replace(), points)
    assert points.replace(radii=None).radii is None
    assert points.replace(box=3.0).periodic.tolist() == [True, True]
    assert points.replace(box=None).periodic is None
    assert points.replace(periodic=True).periodic.tolist() == [True, True]
    moved = points.replace(positions=X + 1.0)
    assert (
        np.array_equal(moved.positions, X + 1.0) and moved.types.tolist() == points.types.tolist()
    )
    with pytest.raises(ValueError, match=r"types must have shape \(3,\)"):
        points.replace(positions=X[:3])
    with pytest.raises(TypeError, match="Points have no 'color': they have positions, box, peri"):
        points.replace(color=1)


def test_how_they_show_themselves():
    small = hs.Points([[0.0, 1.5], [2.0, 3.0]])
    assert repr(small) == "Points(n=2, d=2, float64)\n  0  1.5\n  2  3"
    assert repr(hs.Points([])) == "Points(n=0, d=3, float64)"
    first, *rows = repr(hs.Points(X, **KNOWN)).splitlines()
    assert first.startswith("Points(n=12, d=2, float64, box of 2 vectors partly periodic, radii ")
    assert first.endswith("types Na O Si, groups, labels, weights)")
    assert len(rows) == 6 and rows[0].endswith("Si") and rows[-1] == "  ..."
    systems = hs.Points.stack([hs.Points(X, box=1.0), X, X])
    assert ", 3 boxes, 3 systems)" in repr(systems)
    assert "box 2 x 2 periodic, 12 types" in repr(hs.Points(X, box=2.0, types=range(12)))


# ---- radii by type -------------------------------------------------------------------------


def test_radii_by_type():
    names, numbers = ["C", "O", "C"], [4, 1, 4]
    x = X[:3]
    assert hs.Points(x, types=names, radii={"C": 0.5, "O": 0.25}).radii.tolist() == [0.5, 0.25, 0.5]
    assert hs.Points(x, types=numbers, radii={4: 0.5, 1: 0.25}).radii.tolist() == [0.5, 0.25, 0.5]
    others = {"C": 0.5, "*": 1.0, "Xe": 9.0}
    assert hs.Points(x, types=names, radii=others).radii.tolist() == [0.5, 1.0, 0.5]
    assert hs.Points([], types=[], radii={"C": 1.0}).radii.shape == (0,)
    for radii, types, error, message in (
        ({"C": 0.5}, names, ValueError, "have none for 'O'"),
        ({4: 0.5}, numbers, ValueError, "have none for 1"),
        ({"C": 0.5}, None, ValueError, "radii by type need types"),
        ({"C": -0.5, "O": 1.0}, names, ValueError, r"radii\[0\] = -0.5"),
        ({"C": "wide", "O": 1.0}, names, TypeError, r"radii\['C'\] must be a number"),
        ({"C": [1.0], "O": 1.0}, names, TypeError, r"radii\['C'\] must be a number"),
    ):
        with pytest.raises(error, match=message):
            hs.Points(x, types=types, radii=radii)


# ---- stacks --------------------------------------------------------------------------------


def test_stacks_are_systems_one_behind_the_other():
    one = hs.Points(X, types=["A", "B"] * 6, box=SKEWED, periodic=[False, True])
    other = hs.Points(X[:5] + 3.0, types=["C"] * 5)
    none = hs.Points(np.empty((0, 2)))
    systems = hs.Points.stack([one, none, other])
    assert systems.n_systems == 3 and systems.batch.tolist() == [0] * 12 + [2] * 5
    assert systems.types.tolist() == ["A", "B"] * 6 + ["C"] * 5
    assert systems.box.shape == (3, 2, 2) and same_arrays(systems.box[0], SKEWED)
    assert systems.periodic.tolist() == [[False, True], [False, False], [False, False]]
    found = hs.pairs(systems, 0.4, quantities="P", sort=True)
    parts = [
        hs.pairs(one, 0.4, quantities="P", sort=True),
        hs.pairs(other, 0.4, quantities="P", sort=True),
    ]
    assert np.array_equal(found, np.concatenate([parts[0], parts[1] + 12]))
    assert hs.count_pairs(systems, 0.4).tolist() == [len(parts[0]), 0, len(parts[1])]
    assert hs.Points.stack([]).n_systems == 0
    assert hs.Points.stack(x for x in (X, X)).n_systems == 2


@pytest.mark.parametrize(("systems", "error", "message"), [
    ([X, np.zeros((2, 3))], ValueError, r"the same number of columns, got \[2, 3\]"),
    ([hs.Points(X, radii=[1.0] * 12), X], ValueError, r"systems\[0\] has radii, and systems"),
    ([X, hs.Points(X, batch=[0] * 12)], ValueError, r"systems\[1\] must be one system"),
    ([X, "water"], TypeError, r"systems\[1\] must hold real numbers, got str"),
    ([X, np.full((2, 2), np.nan)], ValueError, r"positions\[12, 0\] = nan"),
    (3, TypeError, "systems must be a sequence of points, got int"),
])  # fmt: skip
def test_what_is_no_stack(systems, error, message):
    with pytest.raises(error, match=message):
        hs.Points.stack(systems)


# ---- what is refused -----------------------------------------------------------------------

WRONG = np.arange(12.0)
WRONG[5] = np.nan


@pytest.mark.parametrize(("known", "error", "message"), [
    ({"positions": [[0.0, np.inf]]}, ValueError, r"must be finite, got positions\[0, 1\] = inf"),
    ({"positions": np.zeros((2, 9))}, ValueError, r"shape \(n, d\) with 1 <= d <= 8.*positions.T"),
    ({"positions": np.zeros(4)}, ValueError, r"one point is positions\[None, :\]"),
    ({"positions": [[2**53 + 1, 0]]}, ValueError, r"positions\[0, 0\]"),
    ({"box": [1.0, 2.0, 3.0]}, ValueError, r"box must have shape \(2,\) or \(2, 2\)"),
    ({"box": [1.0, 1.0, 1.0, 90.0, 90.0, 90.0]}, ValueError, "use Box.from_dimensions"),
    ({"box": np.stack([SKEWED] * 2)}, ValueError, "a box for each system needs Points"),
    ({"box": [[1.0, 2.0], [2.0, 4.0]]}, ValueError, "linearly independent"),
    ({"periodic": True}, ValueError, "periodic needs a box"),
    ({"box": 1.0, "periodic": "xy"}, TypeError, "periodic must be a bool or 2 bools, got 'xy'"),
    ({"box": 1.0, "periodic": [True] * 3}, ValueError, r"2 bools, got shape \(3,\)"),
    ({"radii": [0.1] * 11}, ValueError, r"radii must have shape \(12,\)"),
    ({"radii": -np.arange(12.0)}, ValueError, r"radii\[1\] = -1"),
    ({"radii": [2.0**1023] * 12}, ValueError, r"radii must be at most 2\*\*1022, got radii\[0\]"),
    ({"radii": [2**53 + 1] * 12}, ValueError, r"radii\[0\].*float64"),
    ({"types": [0.0] * 12}, TypeError, "types must hold integers or names, got dtype float64"),
    ({"types": "A"}, TypeError, "types must hold integers or names"),
    ({"types": [2**31 - 1] * 12}, ValueError, r"types must be .* below 2\*\*31 - 1"),
    ({"types": [0, -1] * 6}, ValueError, r"types\[1\] = -1"),
    ({"supports": np.ones((12, 2))}, ValueError, r"supports must have shape \(12, 2, 2\)"),
    ({"positions": np.zeros((2, 4)), "supports": [np.eye(4)] * 2}, ValueError, "to 3 dimensions"),
    ({"supports": np.tile(np.eye(2), (12, 1, 1)), "radii": [1.0] * 12}, ValueError, "together"),
    ({"batch": [0, 1] * 6}, ValueError, r"batch must ascend, got batch\[1\] = 1 before 0"),
    ({"positions": hs.Points(X, box=1.0), "box": 1.0}, ValueError, "Points bring their own box"),
    ({"positions": [X, X], "batch": [0] * 24}, ValueError, "a list of systems brings its batch"),
])  # fmt: skip
def test_what_is_refused_says_where(known, error, message):
    with pytest.raises(error, match=message) as caught:
        hs.Points(**{"positions": X, **known})
    assert "\n" not in str(caught.value)


def test_masked_and_huge_input():
    masked = np.ma.array(X, mask=False)
    masked[3, 1] = np.ma.masked
    with pytest.raises(ValueError, match=r"positions\[3, 1\] must not be masked"):
        hs.Points(masked)
    with pytest.raises(OverflowError, match=r"fewer than 2\*\*31 positions"):
        hs.Points(np.broadcast_to(np.float32(0.0), (2**31, 1)))


# ---- in searches ---------------------------------------------------------------------------


def test_queries_go_with_their_points():
    points = hs.Points(X, box=SKEWED)
    assert hs.count_pairs(points, 0.3, queries=points) == hs.count_pairs(
        X, 0.3, queries=X, box=SKEWED
    )
    for queries, message in (
        (hs.Points(X, box=1.0), "queries bring a box that is not that of points"),
        (hs.Points(X, batch=[0] * 12), "queries have a batch, and points have none"),
        (np.zeros((2, 3)), "same number of columns"),
    ):
        with pytest.raises(ValueError, match=message):
            hs.count_pairs(points, 0.3, queries=queries)
    named = hs.Points(X, types=["A", "B"] * 6)
    other = hs.Points(X[:4], types=["B", "C", "B", "C"])
    table = hs.neighbors(named, {("A", "C"): 2.0}, queries=other)
    assert table.counts.tolist() == [0, 6, 0, 6]


def test_a_molecule_without_a_cell_may_be_given_a_box():
    """Atoms without a cell say that axes do not repeat; that is no box of theirs."""
    molecule = pytest.importorskip("ase").Atoms("OH", [[0.1, 0.0, 0.0], [3.9, 0.0, 0.0]])
    both = [[0.1, 0.0, 0.0], [3.9, 0.0, 0.0]]
    for how in ({"box": 4.0}, {"box": 4.0, "periodic": [False, True, True]}):
        expected = hs.count_pairs(both, 1.0, **how)
        assert hs.count_pairs(molecule, 1.0, **how) == expected
        assert hs.count_pairs([molecule], 1.0, **how).tolist() == [expected]
        assert [len(i) for i, j in hs.trajectory_pairs([molecule], 1.0, **how)] == [expected]
        assert hs.Points(molecule, **how).types.tolist() == ["O", "H"]
    molecule.cell[:] = np.eye(3)
    with pytest.raises(ValueError, match="Atoms bring their own box: leave box out"):
        hs.Points(molecule, box=4.0)
    molecule.set_array("residuenames", np.array(["OH", "OH"]))  # from a PDB file: a placeholder
    assert hs.count_pairs(molecule, 1.0, box=4.0) == 1


def test_a_few_of_these_objects_bring_all():
    ase = pytest.importorskip("ase")
    atoms = ase.Atoms("H2O", positions=[[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.7, 0.5, 0.0]],
                      cell=[4.0, 5.0, 6.0], pbc=[True, False, False])  # fmt: skip
    points = hs.Points(atoms)
    assert points.types.tolist() == ["H", "H", "O"] and points.periodic.tolist() == [
        True,
        False,
        False,
    ]
    for name, value in (("box", 1.0), ("periodic", True), ("types", [0, 1, 2])):
        with pytest.raises(ValueError, match=f"Atoms bring their own {name}: leave {name} out"):
            hs.Points(atoms, **{name: value})
    radii = {"H": 0.31, "O": 0.66}
    assert hs.pairs(hs.Points(atoms, radii=radii), None, sort=True)[1].tolist() == [2, 2]
    two = hs.Points([atoms, atoms])
    assert two.n_systems == 2 and two.types.tolist() == ["H", "H", "O"] * 2
    atoms.pbc = False
    assert hs.Points(atoms).box is None
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"x": [0.0, 1.0], "Y": [0.0, 0.0], "element": ["Si", "O"]})
    assert hs.Points(frame).types.tolist() == ["Si", "O"] and hs.Points(frame).positions.shape == (
        2,
        2,
    )
    numbered = frame[["x", "Y"]].assign(type=[2, 1])
    assert hs.Points(numbered).types.tolist() == [2, 1]
    assert [hs.count_pairs(numbered, {(1, k): 1.5}) for k in (1, 2)] == [0, 1]
    for other in ([-1, 1], [0.5, 1.0]):  # no types, but no fault
        assert hs.Points(numbered.assign(type=other)).types is None


def test_boxes_of_queries_may_be_given_another_way():
    x, batch = [[0.0, 0.0], [1.0, 0.0]], [0, 1]
    of_all = hs.Points(x, box=3.0, batch=batch)
    of_each = hs.Points(x, box=[np.eye(2) * 3.0] * 2, batch=batch)
    flags = hs.Points(x, box=3.0, periodic=[[True, True]] * 2, batch=batch)
    other = hs.Points(x, box=[np.eye(2) * 3.0, np.eye(2) * 4.0], batch=batch)
    slab = hs.Points(x, box=3.0, periodic=[True, False], batch=batch)
    more = hs.Points(x, box=[np.eye(2) * 3.0] * 3, batch=batch)
    for points in (of_all, of_each, flags):
        for queries in (of_all, of_each, flags):
            assert len(hs.pairs_between(queries, points, 1.0)[0]) == 2
        for queries in (other, slab):
            with pytest.raises(ValueError, match="queries bring a box that is not that of points"):
                hs.pairs_between(queries, points, 1.0)
    with pytest.raises(ValueError, match="queries bring a box that is not that of points"):
        hs.pairs_between(more, of_each, 1.0)


def test_a_table_has_a_row_for_each_name():
    points = hs.Points([[0.0], [1.0], [2.0]], types=["C", "H", "O"])
    table = np.full((3, 3), 1.0)
    assert hs.count_pairs(points, table) == 2
    message = r"a row for each type, 'C', 'H', in this order, got shape \(3, 3\)"
    with pytest.raises(ValueError, match=message):
        hs.count_pairs(points[:2], table)
    assert hs.count_pairs(points[:0], table) == 0
    numbered = points.replace(types=[0, 1, 0])
    assert hs.count_pairs(numbered, table) == 2


def test_the_last_systems_of_a_list_may_be_empty():
    two = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    none = np.empty((0, 3))
    for box in (None, 5.0, [5.0, 6.0, 7.0]):
        for systems, counts in (
            ([two, none], [1, 0]), ([none, two, none], [0, 1, 0]), ([none, none], [0, 0]),
            ([two, []], [1, 0]), ([none], [0]),
        ):  # fmt: skip
            assert hs.count_pairs(systems, 1.0, box=box).tolist() == counts
            assert hs.pair_histogram(systems, [0.0, 1.0], box=box).sum(axis=-1).tolist() == counts
            queries = [two] * len(systems)
            found = hs.count_pairs(systems, 1.0, box=box, queries=queries).tolist()
            assert found == [4 * count for count in counts]
    points = hs.Points.stack([two, none])
    for one in (
        points, points[:1], points[[]], pickle.loads(pickle.dumps(points)),
        points.replace(radii=[1.0, 1.0]), points.replace(box=3.0), points.replace(positions=two),
    ):  # fmt: skip
        assert one.n_systems == 2
    assert points.replace(batch=None).n_systems == 1
    assert points.replace(batch=[0, 2]).n_systems == 3
    with pytest.raises(ValueError, match="same number of systems, got 2 and 3"):
        hs.count_pairs([two, two], [1.0, 2.0, 3.0])
    assert hs.count_pairs([two, none], [1.0, 2.0]).tolist() == [1, 0]


def test_points_are_taken_where_coordinates_alone_are():
    known = hs.Points(X, radii=np.ones(len(X)))
    wrapped = hs.Box([0.5] * 2).wrap(known)[0]
    assert np.array_equal(wrapped, hs.Box([0.5] * 2).wrap(X)[0])
    with pytest.raises(ValueError, match="a Points brings a box, for which there is no place here"):
        hs.Box([0.5] * 2).wrap(hs.Points(X, box=1.0))
    with pytest.raises(ValueError, match="points must be one system, and have a batch of 2"):
        hs.CellList([X, X], 1.0, domain=(0.0, 1.0))
    with pytest.raises(ValueError, match="must be given for the 2 systems of points, got 3"):
        hs.count_pairs([X, X], 1.0, box=[np.eye(2)] * 3)


def test_radii_of_types_of_large_numbers_need_no_table_of_all():
    types, radii = [2**31 - 2, 5, 5], {2**31 - 2: 0.5, "*": 1}
    points = hs.Points([[0.0], [1.0], [3.0]], types=types, radii=radii)
    assert points.radii.tolist() == [0.5, 1.0, 1.0]


def test_a_star_is_not_the_name_of_a_type_where_it_means_any():
    points = hs.Points([[0.0], [1.0]], types=["*", "H"])
    assert hs.count_pairs(points, 1.0) == 1
    assert hs.coordination(points, 1.0, by_type=True).tolist() == [[0, 1], [1, 0]]
    with pytest.raises(ValueError, match=r"cutoff\[\('\*', 'H'\)\] has '\*', which means any type"):
        hs.count_pairs(points, {("*", "H"): 1.0})
    with pytest.raises(ValueError, match=r"radii have a key '\*', which means any type"):
        points.replace(radii={"*": 1.0})
