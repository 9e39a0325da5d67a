# SPDX-License-Identifier: BSD-3-Clause
"""Only some of the points: their rows, and the pairs that have one of them."""

import numpy as np
import pytest

import halfshell as hs


def same(table, whole, numbers):
    assert table.n_rows == len(numbers) and table.n_points == whole.n_points
    for k, number in enumerate(numbers):
        for ours, theirs in zip(table[k], whole[number], strict=True):
            assert ours.dtype == theirs.dtype and ours.tobytes() == theirs.tobytes()


# ---- pairs -------------------------------------------------------------------------------------


POINTS = np.zeros((3, 2))


def test_some_points_of_systems_with_groups_and_exclusions(rng):
    points = hs.Points(
        rng.integers(0, 3, (20, 2)).astype(float), box=3.0, periodic=[True, False],
        batch=np.repeat([0, 2, 3], [6, 9, 5]), groups=rng.integers(0, 2, 20), labels=np.arange(20),
    )  # fmt: skip
    for exclude in (None, 1, rng.integers(0, 20, (12, 2))):
        how = {"exclude": exclude, "min_distance": 0.5}
        whole = hs.neighbors(points, 1.5, quantities="jdDS", **how)
        counts = hs.count_pairs(points, 1.5, **how)
        for numbers in ([19], [7, 3, 15, 8], list(range(19, -1, -1)), []):
            some = hs.neighbors(points, 1.5, quantities="jdDS", indices=numbers, **how)
            same(some, whole, numbers)
            bare = hs.neighbors(points, 1.5, quantities="jd", indices=numbers, **how)
            same(bare.sort(), hs.neighbors(points, 1.5, quantities="jd", **how).sort(), numbers)
            P = hs.pairs(points, 1.5, quantities="P", **how)
            found = hs.pairs(points, 1.5, quantities="P", sort=True, indices=numbers, **how)
            expected = P[np.isin(P, numbers).any(axis=1)]
            assert sorted(found.tolist()) == sorted(expected.tolist())
            assert hs.count_pairs(points, 1.5, indices=numbers, **how).sum() == len(expected)
        assert counts.sum() == len(P)


# ---- in blocks -------------------------------------------------------------------------------


@pytest.mark.parametrize("fields", [{}, {"radii": True}, {"batch": True}, {"groups": True}])
def test_blocks_are_those_of_the_pairs_of_some_points(fields, rng, monkeypatch):
    monkeypatch.setattr("halfshell._functions.indices._POINTS_OF_PART", 17)
    n, known = 150, dict.fromkeys(fields)
    known |= {"radii": rng.random(n) * 0.2} if "radii" in fields else {}
    known |= {"batch": np.arange(n) // 50} if "batch" in fields else {}
    known |= {"groups": rng.integers(0, 2, n)} if "groups" in fields else {}
    points = hs.Points(rng.random((n, 3)), box=[1.0] * 3, **known)
    bonds = rng.integers(0, n, (40, 2))
    cutoff = None if "radii" in fields else 0.25
    for some in (rng.permutation(n)[:60], np.arange(n), [], [3]):
        for quantities in ("ijdDSP", "ij", "P", "d"):
            how = {"indices": some, "exclude": bonds, "min_distance": 0.05}
            told = []
            blocks = list(hs.iter_pairs(
                points, cutoff, quantities=quantities, max_pairs=23, progress=told.append, **how
            ))  # fmt: skip
            whole = hs.pairs(points, cutoff, quantities=quantities, **how)
            whole = whole if isinstance(whole, tuple) else (whole,)
            blocks = [block if isinstance(block, tuple) else (block,) for block in blocks]
            assert {len(block[0]) for block in blocks[:-1]} <= {23} and told == sorted(told)
            for k, column in enumerate(whole):
                parts = [block[k] for block in blocks]
                joined = np.concatenate(parts) if parts else column[:0]
                assert joined.tobytes() == column.tobytes() and joined.dtype == column.dtype
                assert all(part.base is None or part.base.nbytes == part.nbytes for part in parts)


def test_blocks_of_some_points_are_of_what_was_given(rng):
    x, radii, some = rng.random((80, 3)), rng.random(80) * 0.3, np.arange(0, 80, 3)
    for points, cutoff in ((x, 0.3), (hs.Points(x, radii=radii), None)):
        whole = hs.pairs(points, cutoff, indices=some, quantities="P")
        blocks = hs.iter_pairs(points, cutoff, indices=some, quantities="P", max_pairs=9)
        x += 7.0 * rng.random((80, 3))
        assert np.array_equal(np.concatenate(list(blocks)), whole)
        x[:] = rng.random((80, 3))
    cells = hs.CellList(x, 0.3)
    whole = cells.pairs(indices=some, quantities="jk", cutoff=[0.2, 0.3])
    blocks = cells.iter_pairs(cutoff=[0.2, 0.3], indices=some, quantities="jk", max_pairs=9)
    for column, right in zip(zip(*blocks), whole, strict=True):
        assert np.array_equal(np.concatenate(column), right)
    with pytest.raises(ValueError, match="indices must name each point once"):
        hs.iter_pairs(x, 0.3, indices=[1, 1])
    blocks = hs.iter_pairs(x, 0.3, indices=some, max_pairs=9)
    next(blocks)
    blocks.close()
    assert list(blocks) == []


# ---- counted by distance ---------------------------------------------------------------------
