# SPDX-License-Identifier: BSD-3-Clause
"""`halfshell.torch`: the lists of halfshell, derivatives, compilation, and what is refused."""

import numpy as np
import pytest

import halfshell as hs
from frameworks import framework, full_list, scenes

torch = framework("torch")
ht = pytest.importorskip("halfshell.torch")

SKEWED = [[4.0, 0.0, 0.0], [1.5, 3.0, 0.0], [-0.5, 0.75, 5.0]]


def tensor(values, **options):
    return torch.tensor(values, dtype=torch.float64, **options)


@pytest.fixture
def points(rng):
    return torch.from_numpy(3.0 * rng.random((30, 3)))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_lists_are_those_of_neighbors(dtype):
    for points, cutoff, box, periodic in scenes(dtype):
        expected = full_list(points, cutoff, box, periodic)
        given = torch.from_numpy(points)
        i, j, S, d, D, P = ht.neighbor_list(
            given, cutoff, box=box, periodic=periodic, quantities="ijSdDP"
        )
        assert i.dtype == j.dtype == P.dtype == torch.int64 and S.dtype == torch.int32
        assert d.dtype == D.dtype == given.dtype
        for ours, other in zip((i, j, S), expected):
            assert np.array_equal(ours.numpy(), other)
        tolerance = 1e-6 if dtype == np.float32 else 1e-9  # 1e6 away, and S @ box is rounded
        np.testing.assert_allclose(d.numpy(), expected[3], rtol=tolerance, atol=tolerance)
        np.testing.assert_allclose(D.numpy(), expected[4], rtol=tolerance, atol=tolerance)
        assert np.array_equal(P.numpy(), np.stack(expected[:2], 1))
        half = ht.neighbor_list(
            given, cutoff, box=box, periodic=periodic, half=True, quantities="ijS"
        )
        again = hs.pairs(points, cutoff, box=box, periodic=periodic, quantities="ijS", sort=True)
        assert all(np.array_equal(a.numpy(), b) for a, b in zip(half, again))


def test_the_boundary_is_decided_exactly():
    x = tensor([[0.0], [0.1]])
    assert len(ht.neighbor_list(x, 0.1, quantities="i")) == 2
    assert len(ht.neighbor_list(x, 0.1, quantities="i", inclusive=False)) == 0
    assert len(ht.neighbor_list(x.float(), 0.1, quantities="i")) == 0  # float32(0.1) > 0.1


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_halves_are_searched_as_the_numbers_that_they_are(dtype, rng):
    x = torch.from_numpy(4.0 * rng.random((60, 3))).to(dtype)
    box = torch.diag(tensor([4.0, 4.25, 4.5])).to(dtype)
    batch = torch.arange(60) // 20
    for options in ({}, {"box": box}, {"box": box, "half": True}, {"batch": batch}):
        exact = {k: v.double() if k == "box" else v for k, v in options.items()}
        found = ht.neighbor_list(x, 1.25, quantities="ijSdD", **options)
        wanted = ht.neighbor_list(x.double(), 1.25, quantities="ijSdD", **exact)
        for one, other in zip(found[:3], wanted):
            assert torch.equal(one, other) and len(one)
        for one, other in zip(found[3:], wanted[3:]):
            assert one.dtype == dtype and torch.equal(one, other.to(dtype))
    assert torch.equal(ht.radius_graph(x, 1.25, batch), ht.radius_graph(x.double(), 1.25, batch))
    assert torch.equal(ht.radius(x, x[:9], 1.25), ht.radius(x.double(), x[:9].double(), 1.25))
    two = torch.tensor([[0.0], [0.1]], dtype=dtype)
    exactly = float(two[1])  # above 0.1 or below it, as it was rounded
    for cutoff in (0.1, exactly, np.nextafter(exactly, 0.0)):
        assert len(ht.neighbor_list(two, cutoff, quantities="i")) == 2 * (exactly <= cutoff)


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_derivatives_by_halves_have_their_type(dtype, rng):
    values, lengths = torch.from_numpy(4.0 * rng.random((20, 3))), tensor([4.0, 4.25, 4.5])
    gradients = []
    for kind in (dtype, torch.float64):
        x = values.to(dtype).to(kind).requires_grad_()
        box = lengths.to(kind).requires_grad_()
        d = ht.neighbor_list(x, 1.25, box=box, quantities="d")
        gradients.append(torch.autograd.grad(d.sum(), (x, box)))
        assert [one.dtype for one in gradients[-1]] == [kind, kind]
    for one, other in zip(*gradients):
        torch.testing.assert_close(one.double(), other, rtol=0.02, atol=0.1)


def test_systems_of_a_batch_are_apart(rng):
    sizes = [5, 0, 9]
    boxes = tensor(np.stack([np.diag([2.0, 3.0]), np.eye(2), [[2.0, 1.0], [0.0, 2.0]]]))
    parts = [torch.from_numpy(4.0 * rng.random((n, 2))) for n in sizes]
    batch = torch.repeat_interleave(torch.arange(3), torch.tensor(sizes))
    found = ht.neighbor_list(
        torch.cat(parts), 1.5, box=boxes, batch=batch, quantities="ijSdD"
    )
    each = [ht.neighbor_list(p, 1.5, box=b, quantities="ijSdD") for p, b in zip(parts, boxes)]
    starts = [0, 5, 5]
    for k, column in enumerate(found):
        rows = [e[k] + start if k < 2 else e[k] for e, start in zip(each, starts)]
        torch.testing.assert_close(column, torch.cat(rows))


@pytest.mark.parametrize("batched", [False, True])
def test_first_and_second_derivatives(points, batched):
    batch = torch.arange(2).repeat_interleave(15) if batched else None
    boxes = tensor([SKEWED, np.diag([4.0, 5.0, 6.0]).tolist()]) if batched else tensor(SKEWED)

    def energy(x, box):
        d, D = ht.neighbor_list(x, 1.1, box=box, batch=batch, quantities="dD")
        return (torch.exp(-d)).sum() + (D[:, 0] * D[:, 1] * d).sum()

    inputs = points.requires_grad_(), boxes.requires_grad_()
    assert torch.autograd.gradcheck(energy, inputs)
    assert torch.autograd.gradgradcheck(energy, inputs)


def test_derivatives_by_lengths_of_a_box(points):
    def lengths(x, box):
        return ht.neighbor_list(x, 1.1, box=box, quantities="d")

    inputs = points.requires_grad_(), tensor([4.0, 3.5, 3.25], requires_grad=True)
    assert torch.autograd.gradcheck(lengths, inputs)
    assert torch.autograd.gradgradcheck(lengths, inputs)


@pytest.mark.parametrize("scale", [1.0, 1e-200, 1e200])
def test_no_length_has_a_gradient_that_is_not_finite(scale):
    x = (scale * tensor([[0.0, 0.0], [0.0, 0.0], [3.0, 4.0]])).requires_grad_()
    d = ht.neighbor_list(x, 6.0 * scale, quantities="d")
    assert d.tolist() == pytest.approx([0.0, 5 * scale, 0.0, 5 * scale, 5 * scale, 5 * scale])
    (first,) = torch.autograd.grad(d.sum(), x, create_graph=True)
    torch.testing.assert_close(first, tensor([[-1.2, -1.6], [-1.2, -1.6], [2.4, 3.2]]))
    (second,) = torch.autograd.grad(first.square().sum(), x)
    assert second.isfinite().all()


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["eager", "aot_eager"])
@pytest.mark.parametrize("box", [None, SKEWED, [4.0, 4.0, 4.0]])
def test_compiled_functions_give_the_same(points, backend, box):
    box = None if box is None else tensor(box)

    def energy(x):
        i, d = ht.neighbor_list(x, 1.1, box=box, quantities="id")
        return torch.zeros(len(x), dtype=x.dtype).index_add(0, i, torch.exp(-d)).sum()

    torch._dynamo.reset()
    compiled = torch.compile(energy, fullgraph=True, backend=backend)
    for x in (points, points + 0.25, 100.0 * points):  # the last one without any pair in the open
        x = x.clone().requires_grad_()
        (expected,) = torch.autograd.grad(energy(x), x, allow_unused=True)
        (found,) = torch.autograd.grad(compiled(x), x, allow_unused=True)
        torch.testing.assert_close(found, expected)


@pytest.mark.parametrize("backend", ["eager", "aot_eager"])
def test_compiled_graphs_give_the_same(points, backend):
    torch._dynamo.reset()

    def both(x):
        return ht.radius_graph(x, 1.0, loop=True), ht.radius(x, x[:5], 1.0)

    compiled = torch.compile(both, fullgraph=True, backend=backend)
    for found, expected in zip(compiled(points), both(points)):
        assert torch.equal(found, expected)


@pytest.mark.slow
def test_inductor_gives_the_same(points):
    torch._dynamo.reset()

    def energy(x):
        return torch.exp(-ht.neighbor_list(x, 1.1, quantities="d")).sum()

    compiled = torch.compile(energy, fullgraph=True)
    torch.testing.assert_close(compiled(points), energy(points))


def test_operators_are_what_pytorch_expects(points):
    operators = torch.ops.halfshell
    whole = (points, 1.1, tensor(SKEWED), [True, True, False], None, False, True)
    torch.library.opcheck(operators.neighbor_list.default, whole)
    for y, loop in ((None, True), (points[:4], False)):
        torch.library.opcheck(operators.radius.default, (points, y, 1.1, None, None, loop, None))


@pytest.mark.parametrize("flow", ["source_to_target", "target_to_source"])
@pytest.mark.parametrize("loop", [False, True])
def test_graphs_have_all_shorter_edges(rng, flow, loop):
    x = torch.from_numpy(rng.integers(0, 4, (60, 2)).astype(np.float64))
    batch = torch.arange(60) // 25
    found = ht.radius_graph(x, 2.0, batch, loop=loop, flow=flow)
    near = (x[:, None] - x).square().sum(-1) < 4.0
    near &= batch[:, None] == batch
    if not loop:
        near.fill_diagonal_(False)
    expected = near.nonzero().T
    assert torch.equal(found, expected if flow == "target_to_source" else expected.flip(0))
    assert found.shape[1] > 32 * 10  # more than the usual cap for some of them


def test_two_sets_have_all_shorter_edges(rng):
    x = torch.from_numpy(rng.integers(0, 4, (60, 2)).astype(np.float64))
    y, batch_x, batch_y = x[:20] + 0.5, torch.arange(60) // 20, torch.arange(20) // 5
    near = (y[:, None] - x).square().sum(-1) < 3.0625
    assert torch.equal(ht.radius(x, y, 1.75), near.nonzero().T)
    near &= batch_y[:, None] == batch_x
    assert torch.equal(ht.radius(x, y, 1.75, batch_x, batch_y), near.nonzero().T)
    near = (y[:, None] - x).square().sum(-1) < 3.0625
    near[5:] = False
    assert torch.equal(ht.radius(x, y, 1.75, None, batch_y), near.nonzero().T)
    assert ht.radius(x[:0], y, 1.0, batch_x[:0], batch_y).shape == (2, 0)


def test_too_many_neighbors_are_an_error_and_not_left_out():
    x = torch.zeros(40, 3)
    assert ht.radius_graph(x, 1.0).shape == (2, 40 * 39)
    assert ht.radius_graph(x, 1.0, max_num_neighbors=39).shape == (2, 40 * 39)
    for call in (
        lambda: ht.radius_graph(x, 1.0, max_num_neighbors=32),
        lambda: ht.radius(x[:39], x, 1.0, max_num_neighbors=32),
    ):
        with pytest.raises(hs.CapacityError, match=r"32.* 39 ") as caught:
            call()
        assert caught.value.needed == 39


@pytest.mark.parametrize(
    "call, error, words",
    [
        (lambda x: ht.neighbor_list([[0.0]], 1.0), TypeError, "torch.Tensor, got list"),
        (lambda x: ht.neighbor_list(x.to("meta"), 1.0), TypeError, "on meta"),
        (lambda x: ht.neighbor_list(x.to_sparse(), 1.0), TypeError, "dense"),
        (lambda x: ht.neighbor_list(x.to(torch.complex128), 1.0), TypeError, "complex128"),
        (lambda x: ht.neighbor_list(x.long(), 1.0), TypeError, "int64"),
        (lambda x: ht.neighbor_list(x.bool(), 1.0), TypeError, "bool"),
        (lambda x: ht.neighbor_list(x[0], 1.0), ValueError, r"shape \(n, d\), got \(3,\)"),
        (lambda x: ht.neighbor_list(x / 0.0, 1.0), ValueError, "finite|nan|inf"),
        (lambda x: ht.neighbor_list(x, -1.0), ValueError, "cutoff"),
        (lambda x: ht.neighbor_list(x, 1.0, periodic=True), ValueError, "box"),
        (lambda x: ht.neighbor_list(x, 1.0, box=[3.0] * 3, periodic="x"), TypeError, "periodic"),
        (lambda x: ht.neighbor_list(x, 1.0, box=x.long()[:1]), TypeError, "box .*int64"),
        (lambda x: ht.neighbor_list(x, 1.0, box=x), ValueError, "box"),
        (lambda x: ht.neighbor_list(x, 1.0, quantities="ix"), ValueError, "quantities"),
        (lambda x: ht.neighbor_list(x, 1.0, quantities=""), ValueError, "quantities"),
        (lambda x: ht.neighbor_list(x, 1.0, batch=x[:, 0]), TypeError, "batch .*float64"),
        (lambda x: ht.radius_graph(x, 1.0, flow="up"), ValueError, "flow"),
        (lambda x: ht.radius_graph(x, 1.0, max_num_neighbors=-1), ValueError, "max_num"),
        (lambda x: ht.radius(x, x, 1.0, torch.arange(30).flip(0)), ValueError, "ascend"),
        (lambda x: ht.radius(x, x, 1.0, torch.arange(3)), ValueError, "shape"),
    ],
)
def test_what_does_not_fit_is_refused(points, call, error, words):
    with pytest.raises(error, match=words):
        call(points)


def test_vmap_says_what_to_do(points):
    with pytest.raises(NotImplementedError, match="batch="):
        torch.vmap(lambda x: ht.neighbor_list(x, 1.0, quantities="i"))(points.reshape(2, 15, 3))


def test_other_forms_of_tensors_and_boxes(points):
    expected = ht.neighbor_list(points, 1.0, box=4.0, quantities="P")
    strided = torch.stack((points, points), -1)[..., 0]
    assert not strided.is_contiguous()
    for box in (hs.Box([4.0] * 3), [4, 4, 4], tensor(4.0), 4.0 * torch.eye(3)):
        assert torch.equal(ht.neighbor_list(strided, 1.0, box=box, quantities="P"), expected)
    assert torch.equal(ht.neighbor_list(points, 1.0, box=4.0, periodic=True, quantities="P"),
                       expected)
