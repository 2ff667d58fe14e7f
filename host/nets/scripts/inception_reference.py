"""Features of pytorch-fid's Inception for weights made by a formula: the numbers of host/nets/src/metrics/inception/tests.rs.

    pip install torch==2.15.0 torchvision pytorch-fid==0.3.0 scipy && python inception_reference.py

With a program, also its whole path from images to FID against pytorch-fid's, on twice 10 images of noise:

    python inception_reference.py target/debug/nirspi
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
import torchvision
from pytorch_fid import inception as fid
from pytorch_fid.fid_score import calculate_frechet_distance
from safetensors.torch import save_file


def noise(seed, count):
    """Pseudo-random numbers in [-1, 1): entries of tensor `seed`."""
    at = np.arange(count, dtype=np.uint32)
    x = at * np.uint32(2654435761) + np.uint32(seed * 40503 % 2**32) + np.uint32(1)
    x ^= x >> np.uint32(15)
    x *= np.uint32(2246822519)
    x ^= x >> np.uint32(13)
    return (x >> np.uint32(8)).astype(np.float32) / np.float32(8388608.0) - np.float32(1.0)


def network():
    """As pytorch_fid.inception.fid_inception_v3, without its download."""
    net = torchvision.models.inception_v3(num_classes=1008, aux_logits=False, weights=None, init_weights=False)
    net.Mixed_5b = fid.FIDInceptionA(192, pool_features=32)
    net.Mixed_5c = fid.FIDInceptionA(256, pool_features=64)
    net.Mixed_5d = fid.FIDInceptionA(288, pool_features=64)
    net.Mixed_6b = fid.FIDInceptionC(768, channels_7x7=128)
    net.Mixed_6c = fid.FIDInceptionC(768, channels_7x7=160)
    net.Mixed_6d = fid.FIDInceptionC(768, channels_7x7=160)
    net.Mixed_6e = fid.FIDInceptionC(768, channels_7x7=192)
    net.Mixed_7b = fid.FIDInceptionE_1(1280)
    net.Mixed_7c = fid.FIDInceptionE_2(2048)
    return net.eval()


# In torchvision's order of a block, which is also the plan's.
BRANCHES = [
    "branch1x1", "branch5x5_1", "branch5x5_2", "branch3x3", "branch3x3_1", "branch3x3_2", "branch3x3_2a", "branch3x3_2b",
    "branch3x3dbl_1", "branch3x3dbl_2", "branch3x3dbl_3", "branch3x3dbl_3a", "branch3x3dbl_3b", "branch7x7_1", "branch7x7_2",
    "branch7x7_3", "branch7x7dbl_1", "branch7x7dbl_2", "branch7x7dbl_3", "branch7x7dbl_4", "branch7x7dbl_5",
    "branch7x7x3_1", "branch7x7x3_2", "branch7x7x3_3", "branch7x7x3_4", "branch_pool",
]


def fill(net):
    seed = 0
    with torch.no_grad():
        for name, stage in net.named_children():
            convolutions = [stage] if name.startswith("Conv2d") else []
            if name.startswith("Mixed"):
                convolutions = [getattr(stage, b) for b in BRANCHES if hasattr(stage, b)]
            for conv in convolutions:
                fan_in = np.prod(conv.conv.weight.shape[1:])
                bound = np.sqrt(np.float32(6.0) / np.float32(fan_in))
                parts = [(conv.conv.weight, 0.0, bound), (conv.bn.weight, 1.0, 0.2), (conv.bn.bias, 0.0, 0.2),
                         (conv.bn.running_mean, 0.0, 0.1), (conv.bn.running_var, 1.0, 0.5)]
                for tensor, middle, spread in parts:
                    values = np.float32(middle) + np.float32(spread) * noise(seed, tensor.numel())
                    tensor.copy_(torch.from_numpy(values.astype(np.float32)).reshape(tensor.shape))
                    seed += 1
    return net


def features(net, images):
    """As pytorch_fid.inception.InceptionV3 with its input normalised and enlarged."""
    x = torch.from_numpy(np.asarray(images, np.float32))[:, None].repeat(1, 3, 1, 1)
    x = 2 * F.interpolate(x, size=(299, 299), mode="bilinear", align_corners=False) - 1
    with torch.no_grad():
        for name, stage in net.named_children():
            if name in ("avgpool", "dropout", "fc"):
                break
            x = stage(x)
    return x.mean((2, 3)).numpy()


def statistics(values):
    values = values.astype(np.float64)
    return values.mean(0), np.cov(values, rowvar=False)


net = fill(network())
image = 0.5 + 0.5 * noise(9999, 32 * 20).reshape(1, 32, 20)
print("const PYTORCH: [f32; 16] = [", ", ".join(f"{v:.6}" for v in features(net, image)[0, ::128]), "];")

if len(sys.argv) > 1:
    rng = np.random.default_rng(1)
    sets = {name: rng.random((n, 64, 64), dtype=np.float32) ** power for name, n, power in [("a", 10, 1), ("b", 10, 2)]}
    expected = calculate_frechet_distance(*(v for s in sets.values() for v in statistics(features(net, s))))
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        floats = {k: v.contiguous() for k, v in net.state_dict().items() if v.is_floating_point()}
        save_file(floats, folder / "inception.safetensors")
        for name, images in sets.items():
            np.save(folder / f"{name}.npy", images)
        command = [sys.argv[1], "metrics", "a.npy", "b.npy", "--inception", "inception.safetensors", "--json"]
        command[0] = str(Path(command[0]).resolve())
        answer = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout
    found = json.loads(answer)["fid"]
    print(f"FID {found}, pytorch-fid {expected}")
    assert abs(found / expected - 1) < 1e-3, "FID differs"
