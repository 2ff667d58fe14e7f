"""The networks that python -m nirspi.train trains: sizes, numbers, and whose weights are refused."""

import subprocess

import numpy as np
import pytest
from test_train_data import pairs

import nirspi as ns
from conftest import ROOT

torch = pytest.importorskip("torch", reason="skipped: no torch (pip install torch)")

from test_train import DEBLURRERS, WIDTHS  # noqa: E402

from nirspi.train import data, folder, networks  # noqa: E402
from nirspi.train.scenes import Scenes  # noqa: E402
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


def test_the_program_gives_fsrcnn_the_depth_that_training_gives_it(tmp_path, cli):
    torch.manual_seed(5)
    net = networks.FSRCNN(8, 4)
    # As if training had made much of depth.
    for parameter in net.parameters():
        parameter.data *= 2
    weights = tmp_path / "weights.safetensors"
    about = {"model": "fsrcnn", "version": "1", "recipe": "random"}
    folder.whole(weights, folder.weights(net.state_dict(), about))
    # Near, far, farther than 3 m, and zones without depth.
    read = data.pairs([pairs(tmp_path / "p.npz", [-1], [-1])], [], [])
    read["depth_m"][0] = 0.07 * np.arange(1, 65).reshape(8, 8)
    read["depth_m"][0].flat[2::5] = 0
    batch = Scenes([], [], read, camera_share=1.0).readings(1)
    with torch.no_grad():
        expected = net(torch.cat((batch.y, batch.depth), 1)).clamp(0, 1)[0, 0]
        blind = net(torch.cat((batch.y, 0 * batch.depth), 1)).clamp(0, 1)[0, 0]
    np.save(tmp_path / "in.npy", read["y"][0])
    np.save(tmp_path / "depth.npy", read["depth_m"])
    options = ["--depth", "depth.npy", "--weights", weights, "--backend", "cpu", "--out", "out.npy"]
    command_line = [cli, "dev", "upscale", "in.npy", *options]
    subprocess.run(command_line, cwd=tmp_path, check=True, capture_output=True)
    found = torch.from_numpy(np.load(tmp_path / "out.npy").reshape(64, 64))
    assert (blind - expected).abs().max() > 1e-2
    assert (found - expected).abs().max() < 1e-4
