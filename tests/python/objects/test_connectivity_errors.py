# SPDX-License-Identifier: BSD-3-Clause
"""What is refused, with a message that says what, and leaves everything as it was; what is asked
for and was not built; what is not built does not take any memory."""

from functools import partial

import numpy as np
import pytest

import halfshell as hs
from halfshell._settings import settings
from refused_calls import check_refusals


def three():
    return [
        hs.NodeList("a", [[0.0], [1.0], [2.0]], [0.5] * 3, n_ghost=1),
        hs.NodeList("b", [[0.5]], [0.1]),
    ]  # fmt: skip


NODE_LISTS = {
    "n_ghost must be from 0 to 1": lambda: hs.NodeList("a", [[0.0]], [1.0], 2),
    "H must have shape": lambda: hs.NodeList("a", [[0.0]], [1.0, 2.0]),
    "H must be finite": lambda: hs.NodeList("a", [[0.0]], [-1.0]),
    "H must be 0 or from": lambda: hs.NodeList("a", [[0.0]], [1e-200]),
    "ids must have shape": lambda: hs.NodeList("a", [[0.0]], [1.0], ids=[1, 2]),
}
CONNECTIVITIES = {
    "names must differ, got 'a'": lambda: hs.Connectivity(
        [hs.NodeList("a", [[0.0]], [1.0]), hs.NodeList("a", [[0.0]], [1.0])]
    ),
    "same number of dimensions": lambda: hs.Connectivity(
        [hs.NodeList("a", [[0.0]], [1.0]), hs.NodeList("b", [[0.0, 1.0]], [1.0])]
    ),
    "extent must be": lambda: hs.Connectivity(three(), 0.0),
    "extent must be from": lambda: hs.Connectivity(three(), 2.0**65),
    r"got extent\[1\] = 0.0": lambda: hs.Connectivity(three(), [1.0, 0.0]),
    "one for each list": lambda: hs.Connectivity(three(), [1.0, 2.0, 3.0]),
    "names a node that does not exist": lambda: hs.Connectivity(three(), exclude=[(3, 0, 0, 1)]),
    r"does not exist: \[0, 0, 9223372036854775807, 0\]": lambda: hs.Connectivity(
        three(), exclude=np.array([(0, 0, 2**64 - 1, 0)], np.uint64)
    ),
    "two nodes": lambda: hs.Connectivity(three(), exclude=[(1, 0, 1, 0)]),
    "exclude must have shape": lambda: hs.Connectivity(three(), exclude=[1, 0, 1, 0]),
    "exclude must return": lambda: hs.Connectivity(three(), exclude=lambda *_: np.zeros(7, bool)),
    "morton_box needs": lambda: hs.Connectivity(three(), morton_box=[[0.0], [1.0]]),
    "low must not be above": lambda: hs.Connectivity(
        three(), order="morton", morton_box=[[1.0], [0.0]]
    ),
    "periodic needs a box": lambda: hs.Connectivity(three(), periodic=True),
}


def test_bad_values_are_refused():
    cases = (NODE_LISTS | CONNECTIVITIES).items()
    check_refusals([(call, ValueError, message) for message, call in cases])
    alone = partial(hs.Connectivity, hs.NodeList("a", [], []))
    check_refusals([(alone, TypeError, "^(?!.*iterable)")])


CHANGES = {
    "rebuild needs the lists": lambda c: c.rebuild(three()[:1]),
    "keep must have shape": lambda c: c.patch([[True] * 2, [True]]),
    "keep must have an array for each": lambda c: c.patch([[True] * 3]),
    "old2new must give": lambda c: c.patch([[True] * 3, [True]], [[0, 0, 2], [0]]),
    "each once": lambda c: c.patch([[True, False, True], [True]], [[0, 0, 2], [0]]),
    "keep the ghosts of 'a' behind": lambda c: c.patch([[True] * 3, [True]], [[0, 2, 1], [0]]),
    "old2new must have shape": lambda c: c.patch([[True] * 3, [True]], [[0, 1], [0]]),
    "which must have shape": lambda c: c.remove([True]),
    "which must return": lambda c: c.remove(lambda *_: 3),
}


def test_a_change_that_fails_changes_nothing():
    for message in CHANGES:
        c = hs.Connectivity(three(), overlap=True)
        field = hs.PairField(c.pairs)
        before = c.pairs, c.offsets, c.indices, c.overlap_indices, c.n_nodes
        with pytest.raises(ValueError, match=message):
            CHANGES[message](c)
        assert (c.pairs, c.offsets, c.indices, c.overlap_indices, c.n_nodes) == before or all(
            one is other for one, other in zip(before[:4], (
                c.pairs, c.offsets, c.indices, c.overlap_indices), strict=True)
        )  # fmt: skip
        assert field[0] == 0.0
        c.validate()


def test_what_was_not_built_names_the_flag():
    c = hs.Connectivity(three())
    for call, flag in (
        (lambda: c.neighbors(0, 2), "ghosts=True"),
        (lambda: c.n_neighbors(0, 2), "ghosts=True"),
        (lambda: c.overlap(0, 0), "overlap=True"),
        (lambda: c.overlap_offsets, "overlap=True"),
        (lambda: c.intersection(0), "intersection=True"),
        (lambda: c.intersection_indices, "intersection=True"),
        (lambda: c.union_of(0, 0, 0, 2), "ghosts=True"),
        (lambda: c.morton_keys(0), 'order="morton"'),
        (lambda: hs.Connectivity(three(), box=9.0).union_of(0, 0, 0, 1), "intersection=True"),
    ):
        with pytest.raises(ValueError, match=flag):
            call()
    for call in (lambda: c.neighbors(2, 0), lambda: c.neighbors(0, 3), lambda: c.neighbors("z", 0),
                 lambda: c.pairs[99], lambda: c.traversal(-1)):  # fmt: skip
        with pytest.raises(IndexError):
            call()
    with pytest.raises(AttributeError, match="box"):
        _ = c.shifts


def test_pairs_that_are_not_there():
    c = hs.Connectivity(three())
    field = hs.PairField(c.pairs)
    for pair in ((0, 0, 2, 0), (0, 0, 0, 0), (0, 7, 0, 0), (-1, 0, 0, 0)):
        with pytest.raises(KeyError):
            c.pairs.index(pair)
        with pytest.raises(KeyError):
            _ = field[pair]
    with pytest.raises(KeyError):
        c.pairs.index([(0, 0, 1, 0), (0, 0, 2, 0)])


def test_what_is_not_wanted_takes_no_memory():
    rng = np.random.default_rng(0)
    lists = [hs.NodeList(name, rng.random((3000, 3)), np.full(3000, 0.05)) for name in "ab"]
    with_all = hs.Connectivity(lists, overlap=True, intersection=True, order="morton")
    plain = hs.Connectivity(lists)
    optional = ("shifts", "pairs", "coupling", "lookup", "overlap", "gather", "intersection",
                "order", "points")  # fmt: skip
    assert all(plain.nbytes[name] == 0 for name in optional)
    assert len(plain.pairs) == len(with_all.pairs) > 10_000
    assert plain.nbytes["rows"] == with_all.nbytes["rows"]
    assert plain.nbytes["rows"] == 8 * (len(plain.pairs) + len(plain.offsets))
    for name in ("overlap", "gather", "intersection", "order", "points"):
        assert with_all.nbytes[name] > 0
    assert sum(plain.nbytes.values()) < 0.25 * sum(with_all.nbytes.values())
    limit = 3.0 * plain.nbytes["rows"]  # enough for rows, and for the search for them
    with settings(memory_limit=limit):
        hs.Connectivity(lists)
        for option in ("overlap", "intersection"):
            with pytest.raises(MemoryError):
                hs.Connectivity(lists, **{option: True})


def test_pairs_that_lack_memory_are_made_later():
    lists = [hs.NodeList("a", np.random.default_rng(0).random((300, 3)), np.full(300, 0.1))]
    c = hs.Connectivity(lists)
    want = hs.Connectivity(lists).pairs.view().tolist()
    with settings(memory_limit=100.0), pytest.raises(MemoryError):
        len(c.pairs)
    assert c.pairs.view().tolist() == want


def test_inputs_are_not_modified_and_not_kept():
    x, h = np.array([[0.0], [1.0]]), np.array([1.0, 1.0])
    nodes = hs.NodeList("a", x, h)
    c = hs.Connectivity([nodes], intersection=True)
    x[:] = 50.0
    c.patch([[True, True]])
    assert c.intersection(0)[0].tolist() == [0, 1]
    assert x.flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        nodes.positions[0] = 1.0


def test_nodes_near_two_planes():
    for seed in range(6):
        from fractions import Fraction

        rng = np.random.default_rng(seed)
        d = int(rng.integers(1, 4))
        x = rng.integers(-6, 7, (80, d)) * 0.35
        h = rng.choice([0.35, 0.7, 0.1], 80)
        nodes = hs.NodeList("a", x, h)
        normal = rng.integers(-2, 3, d) * 1.0 + (np.arange(d) == 0) * 5.0
        p, q = x[0], x[0] + 2.8 * (np.arange(d) == 0)
        near, partners = nodes.between_planes((p, normal), (q, -2.0 * normal), 1.1)
        n = [Fraction(float(a)) for a in normal]
        for k in range(80):
            height = sum(a * (Fraction(float(b)) - Fraction(float(c)))
                         for a, b, c in zip(n, x[k], p, strict=True))  # fmt: skip
            reach = Fraction(1.1) * Fraction(float(h[k]))
            assert (k in near) == (height**2 <= reach**2 * sum(a * a for a in n))
        images = x[near] + (q - p)
        reach = 1.1 * np.maximum(h[:, None], h[near][None])
        apart = np.sqrt(((x[:, None] - images[None]) ** 2).sum(-1))
        sure = (apart < reach * (1 - 1e-12)).any(axis=1)
        maybe = (apart <= reach * (1 + 1e-12)).any(axis=1)
        assert set(np.flatnonzero(sure)) <= set(partners) <= set(np.flatnonzero(maybe))


@pytest.mark.parametrize("d", [1, 2, 3])
def test_ellipsoids_near_a_plane(d):
    rng = np.random.default_rng(d)
    turns = np.linalg.qr(rng.normal(size=(300, d, d)))[0]
    H = np.einsum("iab,ib,icb->iac", turns, rng.uniform(0.5, 50.0, (300, d)), turns)
    H = (H + H.transpose(0, 2, 1)) / 2.0
    H[:100] = np.eye(d) * 2.0
    x = rng.integers(-4, 5, (300, d)) * 0.5
    normal = np.eye(d)[0] * 3.0
    near, _ = hs.NodeList("a", x, H).between_planes((x[0] * 0.0, normal), (normal, normal), 2.0)
    reach = 2.0 * np.linalg.norm(np.linalg.solve(H, np.tile(normal, (300, 1))[:, :, None]), axis=1)
    height = np.abs(x @ normal)
    assert set(np.flatnonzero(height < reach[:, 0] * (1 - 1e-9))) <= set(near)
    assert set(near) <= set(np.flatnonzero(height < reach[:, 0] * (1 + 1e-9)))
    assert set(near[near < 100]) == set(np.flatnonzero(np.abs(x[:100, 0]) <= 1.0))


def test_supports_that_are_singular_in_floats_are_decided_exactly():
    """Positive definite by its last digits; and numbers whose squares are none."""
    tight = np.array([[1.0, 1.0], [1.0, 1.0 + 2.0**-52]])
    flat = np.array([[1.0, 2.0**-30], [2.0**-30, 2.0**-60 + 2.0**-110]])
    wide = np.eye(2) * 2.0**-3
    x = np.array([[3.0, 0.0], [3.0, 0.0], [3.0, 0.0], [9.0, 0.0]])
    nodes = hs.NodeList("a", x, [tight, flat, wide, wide])
    plane = ([0.0, 0.0], [1.0, 0.0])
    assert nodes.between_planes(plane, plane, 1.0)[0].tolist() == [0, 1, 2]
    for exponent in (-1060, -530, 530, 1000):
        same = ([0.0, 0.0], [2.0**exponent, 0.0])
        assert nodes.between_planes(same, same, 1.0)[0].tolist() == [0, 1, 2]
    none = np.array([[1.0, 1.0], [1.0, 1.0]])
    for bad in (none, none - np.eye(2) * 2.0**-53, np.zeros((2, 2)), none * 2.0**-400):
        with pytest.raises(ValueError, match="positive definite"):
            hs.NodeList("a", x[:1], [bad])


def test_planes_near_round_nodes_in_any_unit():
    for exponent in (-530, -300, 0, 300):
        unit = 2.0**exponent
        nodes = hs.NodeList("a", np.array([[1.0], [2.0], [3.0]]) * 2.0**-400, [2.0**-399] * 3)
        plane = ([0.0], [3.0 * unit])
        assert nodes.between_planes(plane, plane, 1.0)[0].tolist() == [0, 1]


def test_planes_that_are_none():
    nodes = hs.NodeList("a", [[0.0, 0.0]], [1.0])
    for enter, exit_plane, message in (
        (([0.0, 0.0], [0.0, 0.0]), ([0.0, 0.0], [1.0, 0.0]), "zero"),
        (([0.0, 0.0], [1.0, 0.0]), ([0.0, 0.0], [1.0, 1e-9]), "parallel"),
        (([0.0], [1.0, 0.0]), ([0.0, 0.0], [1.0, 0.0]), "shape"),
        (3.0, ([0.0, 0.0], [1.0, 0.0]), "point and a normal"),
    ):
        with pytest.raises(ValueError, match=message):
            nodes.between_planes(enter, exit_plane)


def test_validate_finds_what_is_wrong():
    c = hs.Connectivity(three(), ghosts=True, overlap=True, intersection=True)
    c.validate()
    for name in ("offsets", "indices", "overlap_indices", "intersection_indices"):
        array = getattr(c, name)
        array.flags.writeable = True  # as a program in C might
        array[0] += 1
        with pytest.raises(ValueError, match=r"rows say|not each there once"):
            c.validate()
        array[0] -= 1
    c.validate()
