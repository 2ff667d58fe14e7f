"""Makes the fixtures beside it: small networks of the PyTorch twin (nirspi.train.networks) with random weights, an input and
the output of each. Run: python make.py ../../training   (nirspi, torch, safetensors)"""
import hashlib
import sys
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import load_file, save_file
from torch import nn

import nirspi.train.networks as net

sys.path.insert(0, sys.argv[1])
import prior  # noqa: E402

HERE = Path(__file__).parent


def write(model, name, module, inputs, outputs):
    """Weights with metadata and checksum as shipped, and a reference of inputs and outputs."""
    for parameter in module.parameters():
        if parameter.abs().sum() == 0:
            nn.init.normal_(parameter, std=0.1)
    tensors = {key: value.contiguous() for key, value in module.state_dict().items()}
    path = HERE / f"{name}.safetensors"
    metadata = dict(model=model, version="0", recipe="random, for tests")
    save_file(tensors, path, metadata=metadata)
    raw = path.read_bytes()
    header = int.from_bytes(raw[:8], "little")
    save_file(tensors, path, metadata=metadata | dict(sha256=hashlib.sha256(raw[8 + header:]).hexdigest()))
    with torch.no_grad():
        pairs = {f"in{i}": t for i, t in enumerate(inputs)} | {
            f"out{i}": t for i, t in enumerate(outputs(module))}
    save_file({k: v.contiguous() for k, v in pairs.items()}, HERE / f"{name}_reference.safetensors")


torch.manual_seed(1)
x, y, c = torch.rand(2, 1, 16, 16), torch.rand(2, 1, 16, 16), torch.rand(2, 6)
write("diffusion", "unet", net.UNet((8, 12, 16), 2, 8), [x, y, c], lambda m: [m(x, y, c)])

estimator = net.Estimator()
for i, (a, b, stride) in enumerate([(1, 4, 1), (4, 6, 2), (6, 8, 2), (8, 10, 2)], 1):
    setattr(estimator, f"conv{i}", nn.Conv2d(a, b, 3, stride, 1))
estimator.fc1, estimator.fc2 = nn.Linear(10, 7), nn.Linear(7, 2)
write("estimator", "estimator", estimator, [y], lambda m: [m(y)])

fused = torch.rand(2, 3, 8, 8)
write("fsrcnn", "fsrcnn", net.FSRCNN(8, 5, 3), [fused], lambda m: [m(fused)])

classifier = net.Classifier()
for i, (a, b, stride) in enumerate([(1, 4, 2), (4, 4, 1), (4, 6, 2), (6, 6, 1), (6, 8, 2), (8, 8, 1)], 1):
    setattr(classifier, f"conv{i}", nn.Conv2d(a, b, 3, stride, 1))
classifier.fc = nn.Linear(8, 62)
write("classifier", "classifier", classifier, [x], lambda m: [m.features(x), m(x)])


def measured(n, share, noise, skip_mean):
    """A scene's measurements by natural row, in the units of a camera (d = H x), and what the network is given and gives."""
    y, x = torch.meshgrid(torch.arange(n) / n, torch.arange(n) / n, indexing="ij")
    scene = 0.2 + 0.5 * ((y - 0.4) ** 2 + (x - 0.6) ** 2 < 0.06).float() + 0.3 * (x + 0.5 * y < 0.5).float()
    space = prior.space_of(n)
    c = space.forward(scene[None]) + noise * torch.randn(1, n, n)
    mask = torch.from_numpy(prior.shown("zigzag", n, round(share * n * n), np.random.default_rng(1)))[None].clone()
    mask[:, 0, 0] = 0 if skip_mean else 1
    natural = torch.tensor(prior.walsh_rows(n))
    p, q = mask[0].nonzero().T
    return prior.Seen(c.clone(), mask), (natural[p] * n + natural[q]).float(), c[0, p, q] * n


small = prior.Prior(6, 2, 2, 5)
cases = {}
for case, (n, share, noise, skip_mean) in enumerate([(32, 0.3, 0.01, False), (64, 0.1, 0.0, False), (32, 0.6, 0.05, True)]):
    seen, rows, d = measured(n, share, noise, skip_mean)
    told = dict(side=torch.tensor([float(n)]), rows=rows, d=d, told=seen.told[0], noise=seen.noise, start=seen.images()[1].flatten())
    cases |= {f"{name}{case}": tensor for name, tensor in told.items()} | {f"seen{case}": seen}
inputs = {name: tensor for name, tensor in cases.items() if not name.startswith("seen")}
prior.WITHIN = 1e9  # the last step, into the noise, is the method's
write("prior", "prior", small, [], lambda m: [m(cases[f"seen{case}"]).flatten() for case in range(3)])
reference = HERE / "prior_reference.safetensors"
save_file({k: v.contiguous() for k, v in (inputs | load_file(reference)).items()}, reference)
