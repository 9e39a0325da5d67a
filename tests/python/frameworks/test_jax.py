# SPDX-License-Identifier: BSD-3-Clause
"""`halfshell.jax`: the lists of halfshell under jit, vmap and grad, and what is refused."""

import functools
import importlib
import itertools

import numpy as np
import pytest

import halfshell as hs
from frameworks import framework, full_list, scenes

jax = framework("jax")
hj = pytest.importorskip("halfshell.jax")
jnp = jax.numpy

SKEWED = np.array([[4.0, 0.0, 0.0], [1.5, 3.0, 0.0], [-0.5, 0.75, 5.0]])


@pytest.fixture(autouse=True)
def _doubles():
    with jax.enable_x64(True):
        yield


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("jitted", [pytest.param(False, marks=pytest.mark.slow), True])
def test_lists_are_those_of_neighbors(dtype, jitted):
    for points, cutoff, box, periodic in itertools.islice(scenes(dtype), jitted, None, 1 + jitted):
        expected = full_list(points, cutoff, box, periodic)
        m = len(expected[0])
        search = functools.partial(
            hj.neighbor_list, cutoff=cutoff, capacity=m + 3, box=box, periodic=periodic
        )
        found = (jax.jit(search) if jitted else search)(jnp.asarray(points))
        assert found.needed == m and not found.overflow
        assert found.d.dtype == found.D.dtype == dtype
        for ours, other in zip((found.i, found.j, found.S), expected):
            assert ours.dtype == np.int32 and np.array_equal(ours[:m], other)
        scale = np.abs(points).max(initial=1.0) * np.finfo(dtype).eps * 8
        np.testing.assert_allclose(found.d[:m], expected[3], rtol=1e-6, atol=scale)
        np.testing.assert_allclose(found.D[:m], expected[4], rtol=1e-6, atol=scale)
        assert (found.i[m:] == len(points)).all() and (found.j[m:] == len(points)).all()
        assert (found.S[m:] == 0).all() and (found.D[m:] == 0.0).all()
        assert (found.d[m:] == np.inf).all()


def test_without_doubles_the_float32_values_are_decided_exactly():
    points = np.array([[0.0], [0.1]])
    with jax.enable_x64(False):
        assert hj.neighbor_list(jnp.asarray(points), 0.1, capacity=2).needed == 0
        assert hj.neighbor_list(jnp.asarray(points), np.float32(0.1), capacity=2).needed == 2
        assert hj.neighbor_list(jnp.asarray(points), jnp.asarray(0.1), capacity=2).needed == 2
    assert hj.neighbor_list(jnp.asarray(points), 0.1, capacity=2).needed == 2
    assert hj.neighbor_list(jnp.asarray(points), 0.1, capacity=2, inclusive=False).needed == 0


@pytest.mark.slow
@pytest.mark.parametrize("half", [False, True])
def test_what_does_not_fit_is_flagged(rng, half):
    points = jnp.asarray(rng.random((20, 3)))
    whole = hj.neighbor_list(points, 0.5, capacity=400, half=half)
    m = int(whole.needed)
    assert 10 < m and not whole.overflow
    if half:
        again = hs.pairs(np.asarray(points), 0.5, sort=True)
        assert np.array_equal(np.stack(again), np.stack((whole.i[:m], whole.j[:m])))
    for capacity in (0, 1, m - 1, m):
        part = hj.neighbor_list(points, 0.5, capacity=capacity, half=half)
        assert part.needed == m and part.overflow == (capacity < m)
        for ours, other in zip(part[:5], whole):
            assert np.array_equal(ours, other[:capacity])


@pytest.mark.slow
@pytest.mark.parametrize("boxes", ["each", "one", "fixed", "none"])
@pytest.mark.parametrize("jitted", [False, True])
def test_vmap_is_each_system_alone(rng, boxes, jitted):
    points = jnp.asarray(6.0 * rng.random((2, 3, 10, 3)))
    box = {
        "each": jnp.asarray(SKEWED * (1.0 + rng.random((2, 3, 1, 1)))),
        "one": jnp.asarray(SKEWED), "fixed": SKEWED, "none": None,
    }[boxes]  # fmt: skip
    cutoffs = jnp.asarray([1.0, 1.5, 2.0])

    def one(x, b, cutoff):
        return hj.neighbor_list(x, cutoff, capacity=50, box=b)

    axis = 0 if boxes == "each" else None
    if boxes in ("fixed", "none"):
        inner = jax.vmap(lambda x, c: one(x, box, c))
        many = jax.vmap(inner, in_axes=(0, None))
        found = (jax.jit(many) if jitted else many)(points, cutoffs)
    else:
        many = jax.vmap(jax.vmap(one, in_axes=(0, axis, 0)), in_axes=(0, axis, None))
        found = (jax.jit(many) if jitted else many)(points, box, cutoffs)
    for a, b in np.ndindex(2, 3):
        alone = one(points[a, b], box[a, b] if boxes == "each" else box, cutoffs[b])
        assert np.array_equal(found.i[a, b], alone.i) and np.array_equal(found.j[a, b], alone.j)
        assert np.array_equal(found.S[a, b], alone.S) and found.needed[a, b] == alone.needed
        np.testing.assert_allclose(found.d[a, b], alone.d, rtol=1e-12)
    assert found.overflow.any() != found.overflow.all() or not found.overflow.any()


@pytest.mark.slow
def test_derivatives_of_positions_and_strain(rng):
    points = jnp.asarray(3.0 * rng.random((12, 3)))

    def energy(x, strain):
        deform = jnp.eye(3) + strain
        found = hj.neighbor_list(x @ deform, 1.2, capacity=200, box=SKEWED @ deform)
        return jnp.where(found.d < jnp.inf, jnp.exp(-found.d), 0.0).sum() + found.D[:, 0].dot(
            found.D[:, 1]
        )

    check_grads = importlib.import_module("jax.test_util").check_grads
    inputs = points, jnp.zeros((3, 3))
    check_grads(energy, inputs, order=2, modes=("rev",), atol=1e-4, rtol=1e-4)
    compiled = jax.jit(jax.grad(energy, argnums=(0, 1)))
    for one, other in zip(
        compiled(points, jnp.zeros((3, 3))), jax.grad(energy, (0, 1))(points, jnp.zeros((3, 3)))
    ):
        np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-10)
        assert np.isfinite(one).all()
    hessian = jax.jit(jax.hessian(energy))(points, jnp.zeros((3, 3)))
    assert hessian.shape == (12, 3, 12, 3) and np.isfinite(hessian).all()


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1.0, 1e-200, 1e200])
def test_no_entry_and_no_length_have_finite_derivatives(scale):
    x = jnp.array([[0.0, 0.0], [0.0, 0.0], [3.0, 4.0]]) * scale

    def total(x):
        d = hj.neighbor_list(x, 6.0 * scale, capacity=9).d
        return jnp.where(jnp.isfinite(d), d, 0.0).sum()

    np.testing.assert_allclose(jax.grad(total)(x), [[-1.2, -1.6], [-1.2, -1.6], [2.4, 3.2]])
    assert np.isfinite(jax.hessian(total)(x)).all()
    weights = jax.grad(lambda x: (1.0 / (1.0 + hj.neighbor_list(x, 0.0, capacity=9).d)).sum())(x)
    assert np.isfinite(weights).all()


def test_many_points_inside_jit():
    points = np.random.default_rng(1).random((20_000, 3))
    expected = hs.count_pairs(points, 0.03, box=1.0)
    found = jax.jit(lambda x: hj.neighbor_list(x, 0.03, capacity=60_000, box=1.0, half=True))(
        jnp.asarray(points)
    )
    assert found.needed == expected


@pytest.mark.parametrize(
    "call, error, words",
    [
        (lambda x: hj.neighbor_list(x.astype(int), 1.0, capacity=1), TypeError, "int64"),
        (lambda x: hj.neighbor_list(x + 1j, 1.0, capacity=1), TypeError, "complex128"),
        (lambda x: hj.neighbor_list(x[0], 1.0, capacity=1), ValueError, "shape"),
        (lambda x: hj.neighbor_list(x, 1.0, capacity=-1), ValueError, "capacity"),
        (lambda x: hj.neighbor_list(x, 1.0, capacity=1.5), TypeError, "integer"),
        (lambda x: hj.neighbor_list(x, -1.0, capacity=1), Exception, "cutoff"),
        (lambda x: hj.neighbor_list(x * jnp.nan, 1.0, capacity=1), Exception, "nan|finite"),
    ],
)
def test_what_does_not_fit_is_refused(rng, call, error, words):
    with pytest.raises(error, match=words):
        jax.block_until_ready(call(jnp.asarray(rng.random((5, 3)))))


def test_a_box_with_names_works():
    points = jnp.array([[0.5], [3.5]])
    for box in (hs.Box([4.0]), 4.0, [4], jnp.array([4.0]), jnp.array([[4.0]]), jnp.asarray(4.0)):
        assert hj.neighbor_list(points, 1.0, capacity=2, box=box).S[:, 0].tolist() == [-1, 1]
