"""Makes the fixtures beside it: small networks of the PyTorch twin (host/nets/training/networks.py) with random
weights, an input and the output of each. Run: python make.py ../../training   (torch, safetensors)"""
import hashlib
import sys
from pathlib import Path

import torch
from safetensors.torch import save_file
from torch import nn

sys.path.insert(0, sys.argv[1])
import networks as net  # noqa: E402

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

discriminator = net.Discriminator()
for i, (a, b) in enumerate([(2, 4), (4, 5), (5, 6)], 1):
    setattr(discriminator, f"conv{i}", nn.Conv2d(a, b, 4, 2, 1))
discriminator.conv4 = nn.Conv2d(6, 1, 3, 1, 1)
write("discriminator", "discriminator", discriminator, [y, x], lambda m: [m(y, x)])
