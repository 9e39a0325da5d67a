# SPDX-License-Identifier: BSD-3-Clause
"""Radii, rules, types and cutoffs by type as they may be given, and all that is refused."""


import numpy as np
import pytest
from ase.build import bulk, molecule
from ase.data import chemical_symbols
from ase.neighborlist import neighbor_list

import halfshell as hs
from calls import call
from definition import SYMMETRIC
from halfshell._convert.objects import SYMBOLS
from oracles import same_arrays
from refused_calls import NAN, assert_refused

RNG = np.random.default_rng(11)
POINTS = RNG.random((30, 3))
RADII = RNG.integers(1, 9, 30) / 32.0


def with_radius(k, value, n=30):
    radii = np.full(n, 0.01)
    radii[k] = value
    return radii


def calls(points=POINTS, **how):
    """Every function of one set, with these keywords."""
    return [
        lambda: call(hs.pairs, points, None, **how),
        lambda: call(hs.count_pairs, points, None, **how),
        lambda: call(hs.neighbors, points, None, **how),
        lambda: call(hs.coordination, points, None, **how),
        lambda: call(hs.iter_pairs, points, None, **how),
        lambda: call(hs.for_each_pair, points, None, lambda *pair: None, **how),
        lambda: call(hs.verify, points, None, [0], [1], **how),
        lambda: call(hs.explain, points, None, **how),
    ]


# ---- forms ---------------------------------------------------------------------------------


def test_the_sum_is_the_rule_unless_another_is_named():
    assert same_arrays(
        call(hs.pairs, POINTS, None, radii=RADII),
        call(hs.pairs, POINTS, None, radii=RADII, rule="sum"),
    )
    counts = [call(hs.count_pairs, POINTS, None, radii=RADII, rule=rule) for rule in SYMMETRIC]
    assert counts[0] > counts[2] > counts[1] > counts[3] > 0


# ---- radii ---------------------------------------------------------------------------------


@pytest.mark.parametrize("row", [5, 140_000, 299_999])
def test_the_first_wrong_row_of_many(row):
    n = 300_000  # the caller's numbers are read in stretches, with a look for signals in between
    points, types = np.zeros((n, 1)), np.zeros(n, np.int32)
    points[:, 0] = np.arange(n)
    radii, table = with_radius(row, NAN, n), [[0.25]]

    def count(cutoff, **how):
        return lambda: call(hs.count_pairs, points, cutoff, **how)

    assert_refused(count(None, radii=radii), ValueError, rf"radii\[{row}\]")
    types[row] = 7
    assert_refused(count(table, types=types), ValueError, rf"type 7 of points\[{row}\]")
    points[row] = NAN
    radii[row], types[row] = 0.01, 0
    assert_refused(count(None, radii=radii), ValueError, rf"(points|positions)\[{row}")
    assert_refused(count(table, types=types), ValueError, rf"(points|positions)\[{row}")


def test_radii_that_cannot_be_halved():
    small = np.nextafter(2.0**-1021, 0.0)
    for refused in calls(radii=with_radius(7, small), rule="mean"):
        assert_refused(refused, ValueError, r"2\*\*-1021", "mean", r"radii\[7\]")
    for radii in (with_radius(7, 2.0**-1021), with_radius(7, 0.0)):
        assert call(hs.count_pairs, POINTS, None, radii=radii, rule="mean") == 0
    for rule in ("sum", "max", "min"):
        assert call(hs.count_pairs, POINTS, None, radii=with_radius(7, small), rule=rule) == 0


# ---- a cutoff for each two types ---------------------------------------------------------------


TABLE = np.array([[0.3, 0.5, 0.0, 0.1], [0.5, 0.0, 0.2, 0.6], [0.0, 0.2, 0.7, 0.4],
                  [0.1, 0.6, 0.4, 0.25]])  # fmt: skip
FEW = np.random.default_rng(5).random((20, 3))
TYPES = np.arange(20) % 3


# ---- forms ---------------------------------------------------------------------------------


def test_a_dict_counts_both_ways_and_may_have_names():
    numbers = {(0, 1): 0.5, (2, 0): 0.25, (1, 1): 0.4}
    expected = call(hs.pairs, FEW, numbers, types=TYPES, sort=True)
    assert len(expected[0]) > 0
    turned = {(b, a): length for (a, b), length in numbers.items()}
    names = np.array(["H", "CA", "solvent"])
    labels = names[TYPES]
    by_name = {(names[a], names[b]): length for (a, b), length in numbers.items()}
    absent = by_name | {("O", "Og"): 0.3, ("H", "O"): 0.2}  # elements that no point is
    for cutoffs, types in (
        (turned, TYPES), (turned | numbers, TYPES), (by_name, labels), (by_name, labels.tolist()),
        (by_name, labels.astype(object)), (by_name, labels.astype("U20")), (absent, labels),
    ):  # fmt: skip
        assert same_arrays(call(hs.pairs, FEW, cutoffs, types=types, sort=True), expected)


# ---- stars ---------------------------------------------------------------------------------


def test_stars_that_contradict():
    points = hs.Points(FEW, types=np.array(["H", "O", "N"])[TYPES])
    with pytest.raises(
        ValueError, match=r"differ, and both are of the pair \('H', 'O'\): give it a"
    ):
        hs.pairs(points, {("O", "*"): 0.5, ("H", "*"): 0.25})
    assert hs.count_pairs(points, {("O", "*"): 0.5, ("H", "*"): 0.25, ("O", "H"): 0.1}) > 0
    assert hs.count_pairs(points, {("O", "*"): 0.5, ("Xe", "*"): 0.25}) > 0  # no point is Xe
    with pytest.raises(ValueError, match="contradicts another cutoff of the same two"):
        hs.pairs(points, {("O", "*"): 0.5, ("*", "O"): 0.25})
    with pytest.raises(ValueError, match="is neither an element nor a type of a point"):
        hs.pairs(points, {("O", "**"): 0.5})


# ---- elements, and the lists of ASE and matscipy -----------------------------------------------


CUTOFFS = {("O", "H"): 1.2, ("O", "O"): 3.1, ("H", "H"): 0.8}


def water(n=3):
    """Molecules in a skewed box that is too small for them, shaken."""
    atoms = molecule("H2O")
    atoms.set_cell([[3.1, 0.0, 0.0], [0.4, 3.3, 0.0], [-0.3, 0.2, 3.2]])
    atoms.pbc = [True, True, False]
    atoms = atoms.repeat((n, n, 1))
    atoms.rattle(0.1, seed=4)
    return atoms


def oxide():
    atoms = bulk("MgO", "rocksalt", a=4.21, cubic=True) * (2, 2, 2)
    atoms.rattle(0.05, seed=2)
    return atoms


def rows(i, j, S):
    return sorted(zip(i.tolist(), j.tolist(), map(tuple, np.asarray(S, int).tolist())))


def ours(atoms, cutoff, **how):
    """As ASE makes lists: both directions, pairs at the cutoff left out."""
    table = call(hs.neighbors, atoms, cutoff, quantities="jS", inclusive=False, **how)
    return rows(*table.to_pairs(quantities="ijS"))


@pytest.mark.parametrize("make", [water, oxide])
def test_the_dict_of_ase(make):
    atoms = make()
    for cutoffs in (CUTOFFS, {("Mg", "O"): 2.3, ("O", "O"): 3.1}, {("Mg", "Mg"): 4.5}):
        assert ours(atoms, cutoffs) == rows(*neighbor_list("ijS", atoms, cutoffs))


def test_the_symbols_are_those_of_ase():
    assert chemical_symbols == SYMBOLS


def test_keys_that_are_no_elements():
    for cutoffs in ({("H", "Hx"): 1.0}, {("h", "O"): 1.0}, {("H", ""): 1.0}):
        assert_refused(lambda cutoffs=cutoffs: hs.pairs(water(), cutoffs), ValueError, "an element")
    assert_refused(lambda: hs.pairs(water(), {(1, 8): 1.0}), ValueError, "types are names")
    assert_refused(
        lambda: hs.pairs(water(), {("H", "O"): 1.0, ("O", "H"): 2.0}), ValueError, "contradicts"
    )
    strange = water()
    strange.numbers[3] = 300
    assert_refused(lambda: hs.pairs(strange, CUTOFFS), ValueError, r"numbers\[3\] = 300")


def test_the_cutoff_may_be_left_out_with_radii(rng):
    balls = hs.Points(rng.random((40, 3)), radii=rng.random(40) * 0.2, box=1.0)
    count = hs.count_pairs(balls, None)
    assert count == hs.count_pairs(balls) == len(hs.pairs(balls)[0]) > 5
    assert 2 * count == hs.coordination(balls).sum() == hs.neighbors(balls).n_entries
    assert count == sum(map(len, hs.iter_pairs(balls, quantities="P")))
    assert hs.clusters(balls).n_clusters == hs.clusters(balls, None).n_clusters
    assert len(hs.pairs_between(balls, balls)[0]) == 2 * count + 40
    assert [len(i) for i, _ in hs.trajectory_pairs([balls] * 2)] == [count] * 2
    assert hs.explain(balls).expected_pairs == hs.explain(balls, None).expected_pairs
    cells = hs.CellList(balls.positions, 0.3, box=1.0)
    assert hs.count_pairs(cells) == cells.count_pairs() == hs.count_pairs(cells, 0.3)
    for search in (hs.pairs, hs.neighbors, hs.count_pairs, hs.coordination, hs.clusters):
        with pytest.raises(TypeError, match="got NoneType: points without it need radii"):
            search(balls.positions)


def test_objects_that_have_symbols_only():
    atoms = water()

    class Symbols:
        positions, cell, pbc = atoms.positions, atoms.cell[:], atoms.pbc

        def get_chemical_symbols(self):
            return atoms.get_chemical_symbols()

    assert same_arrays(hs.pairs(Symbols(), CUTOFFS), hs.pairs(atoms, CUTOFFS))
