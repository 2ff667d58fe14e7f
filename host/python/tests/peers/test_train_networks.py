"""The networks that python -m nirspi.train trains: sizes, numbers, and whose weights are refused."""

import pytest

import nirspi as ns
from conftest import ROOT

torch = pytest.importorskip("torch", reason="skipped: no torch (pip install torch)")

from test_train import DEBLURRERS, WIDTHS  # noqa: E402

from nirspi.train import folder, networks  # noqa: E402
from nirspi.train.tasks import TASKS, enlarger  # noqa: E402


@pytest.mark.parametrize("network", list(TASKS))
def test_networks_are_trained_at_the_size_of_the_shipped_ones(network):
    shipped = ROOT / "host/nets/weights"
    place = (
        shipped if network in ("fsrcnn", "diffusion", "estimator", "classifier") else shipped / "baselines"
    )
    state = folder.tensors(place / f"{network}.safetensors")
    net = TASKS[network].network(None, TASKS[network].widths)
    assert {name: tensor.shape for name, tensor in net.state_dict().items()} == {
        name: t.shape for name, t in state.items()
    }
    net.load_state_dict(state)


@pytest.mark.parametrize(
    ("name", "net"),
    [
        ("unet", lambda: networks.UNet((8, 12, 16), 2, 8)),
        ("fsrcnn", lambda: networks.FSRCNN(8, 5, 3)),
        ("estimator", lambda: networks.Estimator((4, 6, 8, 10), hidden=7)),
        ("classifier", lambda: networks.Classifier((4, 6, 8))),
    ],
)
def test_networks_give_the_numbers_that_the_program_is_tested_with(name, net):
    at = ROOT / "host/nets/tests/pytorch"
    net, pairs = net(), folder.tensors(at / f"{name}_reference.safetensors")
    net.load_state_dict(folder.tensors(at / f"{name}.safetensors"))
    inputs = [pairs[key] for key in sorted(pairs) if key.startswith("in")]
    with torch.no_grad():
        found = net(*inputs)
    assert (found - pairs[max(key for key in pairs if key.startswith("out"))]).abs().max() < 1e-5


@pytest.mark.parametrize("network", list(TASKS))
def test_an_image_gives_the_same_in_whatever_batch_it_comes(network):
    torch.manual_seed(5)
    net = TASKS[network].network(None, WIDTHS[network])
    for parameter in net.parameters():
        parameter.data = 2 * parameter.data + 0.05 * torch.randn_like(parameter)
    side, channels = {"fsrcnn": (32, 3), "estimator": (32, 1)}.get(network, (64, 1))
    inputs = [torch.rand(5, channels, side, side) * torch.linspace(0.2, 1, 5)[:, None, None, None]]
    if network in DEBLURRERS:
        inputs += [torch.rand(5, 1, 64, 64), torch.rand(5, 6)]
    with torch.no_grad():
        whole = net(*inputs)
        apart = torch.cat([net(*(array[i : i + 1] for array in inputs)) for i in range(5)])
        turned = net(*(array.flip(0) for array in inputs)).flip(0)
    largest = whole.abs().max()
    assert (whole[0] - whole[1]).abs().max() > 1e-2 * largest
    assert (whole - apart).abs().max() < 1e-5 * largest and (whole - turned).abs().max() < 1e-5 * largest


def test_weights_of_another_network_or_form_are_refused_as_fsrcnn(tmp_path):
    at = ROOT / "host/nets/tests/pytorch"
    good = folder.tensors(at / "fsrcnn.safetensors")

    def refused(state):
        with pytest.raises(ns.Error, match="^own.safetensors: ") as error:
            enlarger("own.safetensors", state, "cpu")
        return str(error.value)

    # Any size of the network is good.
    reference = folder.tensors(at / "fsrcnn_reference.safetensors")
    found = enlarger("own.safetensors", good, "cpu")(reference["in0"])
    assert (found - reference["out0"]).abs().max() < 1e-5 and not found.requires_grad
    other = "weights of another network, expected those of fsrcnn"
    for name in ("estimator", "classifier", "unet", "prior"):
        assert other in refused(folder.tensors(at / f"{name}.safetensors"))
    for name in good:
        bare = {key: tensor for key, tensor in good.items() if key != name}
        assert other in refused(bare)
        assert other in refused(good | {name: good[name].flatten()[:-1]})
        assert other in refused(good | {name: torch.tensor(1.0)})
    assert other in refused(good | {"fc.weight": torch.zeros(2, 2)})
    bad = good["expand.bias"].clone()
    bad[-1] = float("nan")
    assert "expand.bias holds a value that is not finite" in refused(good | {"expand.bias": bad})
