"""The operator for torch, and beside SPyRiT's and deepinv's."""

import numpy as np
import pytest

import nirspi as ns
from conftest import asymmetric

torch = pytest.importorskip("torch")


@pytest.mark.parametrize("split", [False, True])
@pytest.mark.parametrize("scale", ["sum", "ortho"])
def test_tensors_come_out_as_arrays_do(scale, split):
    operator = ns.Hadamard(16, rows=ns.order("zig-zag", 16)[:100], split=split, scale=scale)
    x = torch.rand(2, 3, 16, 16)
    y = operator(x)
    assert isinstance(y, torch.Tensor) and y.dtype == torch.float32
    assert (y.numpy() == operator(x.numpy())).all()
    assert (operator.adjoint(y).numpy() == operator.adjoint(y.numpy())).all()
    assert np.allclose(operator.pinv(y).numpy(), operator.pinv(y.numpy()), atol=1e-5)
    assert operator(x.half()).dtype == torch.float16 and operator(x.double()).dtype == torch.float64


@pytest.mark.parametrize("split", [False, True])
@pytest.mark.parametrize("scale", ["sum", "ortho"])
def test_gradients_are_those_of_the_matrix(scale, split):
    operator = ns.Hadamard(4, rows=[3, 0, 9, 14], split=split, scale=scale)
    x = torch.rand(2, 4, 4, dtype=torch.float64, requires_grad=True)
    y = torch.rand(2, operator.shape[0], dtype=torch.float64, requires_grad=True)
    for function, value in ((operator.forward, x), (operator.adjoint, y), (operator.pinv, y)):
        assert torch.autograd.gradcheck(function, value)
        assert torch.autograd.gradgradcheck(function, value)
        assert torch.autograd.gradcheck(function, value, check_forward_ad=True, check_backward_ad=False)


def test_what_torch_computes_on_another_device_is_the_same():
    from nirspi import _torch

    for split in (False, True):
        operator = ns.Hadamard(16, rows=ns.order("random:1", 16)[:77], split=split, scale="ortho")
        x = torch.rand(3, 16, 16, dtype=torch.float64)
        y = _torch._on_device(operator, "forward", x)
        assert np.allclose(y, operator(x), atol=1e-12)
        assert np.allclose(_torch._on_device(operator, "adjoint", y), operator.adjoint(y), atol=1e-12)


def test_a_tensor_that_does_not_fit_is_refused():
    operator = ns.Hadamard(8)
    for wrong, words in [
        (torch.rand(8, 9), "expected (..., 8, 8)"),
        (torch.rand(8), "expected (..., 8, 8)"),
        (torch.rand(8, 8) + 0j, "expected real numbers"),
        (torch.rand(8, 8).to_sparse(), "layout"),
    ]:
        with pytest.raises(ns.Error) as error:
            operator(wrong)
        assert words in str(error.value)
    assert operator(torch.ones(8, 8, dtype=torch.uint8)).dtype == torch.float32
    assert operator(torch.rand(8, 8).t()).shape == (64,)
    assert operator(torch.rand(8, 8, requires_grad=True)).requires_grad


@pytest.mark.parametrize("n", [8, 32, 64])
@pytest.mark.parametrize("order", ["walsh-2d", "cake-cutting", "random:5"])
def test_the_operator_is_spyrits(order, n):
    pytest.importorskip("spyrit")
    rows = ns.order(order, n)[: n * n // 2]
    signed, split = ns.Hadamard(n, rows=rows), ns.Hadamard(n, rows=rows, split=True)
    theirs = signed.spyrit(dtype=torch.float64)
    x = torch.from_numpy(np.stack([asymmetric(n, seed) for seed in range(3)]))
    scale = float(signed(x).abs().max())
    y = theirs.measure(x)
    assert torch.allclose(y, split(x), atol=1e-6 * scale)
    assert torch.allclose(theirs.measure_H(x), signed(x), atol=1e-6 * scale)
    assert torch.allclose(theirs.adjoint(y).reshape(x.shape), split.adjoint(y), atol=1e-6 * scale * n)
    d = split.unsplit(y)
    adjoint = theirs.adjoint_H(d).reshape(x.shape)
    assert torch.allclose(adjoint, signed.adjoint(d), atol=1e-6 * scale * n)
    assert torch.allclose(theirs.fast_pinv(d).reshape(x.shape), signed.pinv(d), atol=1e-6)
    assert torch.allclose(split.pinv(y), signed.pinv(d), atol=1e-12)


def test_a_network_of_spyrit_reconstructs_a_recording_of_nirspi(tmp_path):
    pytest.importorskip("spyrit")
    from spyrit.core.recon import PinvNet

    with ns.Camera("virtual", sampling=0.5) as camera:
        camera.record(tmp_path / "rec.mcap", frames=100)
    m = ns.load(tmp_path / "rec.mcap")
    network = PinvNet(ns.Hadamard(32, rows=m.rows).spyrit())
    found = network.reconstruct(torch.from_numpy(m.d.astype(np.float32))[None, None])
    ours = ns.reconstruct(m, method="hadamard")
    assert np.allclose(found.numpy().reshape(32, 32), ours, atol=1e-3 * abs(ours).max())


@pytest.mark.parametrize("n", [8, 32, 64])
@pytest.mark.parametrize("ordering", ["sequency", "cake_cutting", "zig_zag", "xy"])
def test_the_operator_is_deepinvs(ordering, n):
    physics = pytest.importorskip("deepinv.physics")
    theirs = physics.SinglePixelCamera(n * n // 3, (1, n, n), ordering=ordering, dtype=torch.float64)
    ours = ns.Hadamard.of(theirs)
    assert ours.scale == "ortho" and ours.shape == (n * n // 3, n * n)
    x = torch.from_numpy(asymmetric(n))[None, None]
    y = theirs(x)
    measured = theirs.mask.reshape(-1) > 0
    assert torch.allclose(y.reshape(-1)[measured], ours(x).reshape(-1), atol=1e-6)
    for name in ("A_adjoint", "A_dagger"):
        back = getattr(theirs, name)(y)
        assert torch.allclose(back, getattr(ours, name)(ours(x)), atol=1e-6), name


@pytest.mark.parametrize("split", [False, True])
def test_deepinv_tests_and_solves_with_our_operator(split):
    deepinv = pytest.importorskip("deepinv")
    operator = ns.Hadamard(32, rows=ns.order("zig-zag", 32)[:300], split=split, scale="ortho")
    physics = operator.deepinv(noise_model=deepinv.physics.GaussianNoise(0.01))
    # Relative to a product of random vectors, which may be near 0: single precision has no bound that always holds.
    assert physics.adjointness_test(torch.rand(2, 1, 32, 32, dtype=torch.float64)) < 1e-10
    norm = float(physics.compute_sqnorm(torch.rand(1, 32, 32), verbose=False))
    largest = np.linalg.norm(operator.matrix(np.float64), 2) ** 2
    assert norm == pytest.approx(largest, rel=1e-2) and (split or norm == pytest.approx(1, rel=1e-4))


def test_a_solver_of_deepinv_improves_on_the_pseudo_inverse():
    deepinv = pytest.importorskip("deepinv")
    truth = torch.zeros(1, 1, 32, 32)
    truth[..., 8:20, 5:25] = 1
    physics = ns.Hadamard(32, rows=ns.order("zig-zag", 32)[:300], scale="ortho").deepinv()
    y = physics(truth)
    solver = deepinv.optim.PGD(
        prior=deepinv.optim.prior.TVPrior(n_it_max=20),
        data_fidelity=deepinv.optim.data_fidelity.L2(),
        stepsize=1.0,
        lambda_reg=0.01,
        max_iter=60,
    )
    found = solver(y, physics).detach()
    before = ns.metrics.psnr(truth[0], physics.A_dagger(y)[0], data_range=1)
    after = ns.metrics.psnr(truth[0], found[0], data_range=1)
    assert after > before + 3, (before, after)


def test_a_network_learns_through_the_operator():
    operator = ns.Hadamard(16, rows=ns.order("zig-zag", 16)[:64], scale="ortho")
    torch.manual_seed(1)
    truth = torch.rand(32, 1, 16, 16)
    layer = torch.nn.Conv2d(1, 1, 5, padding=2)
    optimiser = torch.optim.Adam(layer.parameters(), 1e-2)
    losses = []
    for _ in range(30):
        loss = (operator(layer(operator.pinv(operator(truth)))) - operator(truth)).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert losses[-1] < 0.2 * losses[0]


def test_images_and_torch_share_memory():
    operator = ns.Hadamard(16)
    m = ns.Measurement(d=operator(asymmetric(16)), rows=operator.rows, n=16)
    image = ns.reconstruct(m)
    tensor = torch.from_dlpack(image)
    assert tensor.data_ptr() == image.ctypes.data and tensor.shape == (16, 16)
