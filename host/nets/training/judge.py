"""PSNR of one step of the bridge, without the consistency step, on images that training never sees, for blurs of each shape.

usage: judge.py FOLDER WEIGHTS [WEIGHTS ...]

FOLDER holds val.npz (characters.py); each WEIGHTS is a folder of fsrcnn, estimator and diffusion. A column for each of them, and one
for bicubic interpolation.
"""
import sys

import numpy as np
import torch
import torch.nn.functional as F
from nirspi.train.optics import REACH_PX, Optics, conditions, disc, psnr, streak
from nirspi.train.networks import FSRCNN, Estimator, UNet
from safetensors.torch import load_file

COUNTS = dict(fnt=60, hnd=60, img=60, nat=30)
SHAPES = [
    ("none", 0.0, 0.0), ("none", 0.0, 0.03), ("Gaussian", 1.0, 0.03), ("Gaussian", 2.0, 0.03), ("Gaussian", 3.0, 0.03), ("Gaussian", 2.0, 0.0),
    ("Gaussian", 3.3, 0.15), ("disc", 2.0, 0.03), ("disc", 3.3, 0.03), ("disc", 3.3, 0.15), ("motion", 1.5, 0.03), ("motion", 2.5, 0.01),
]  # fmt: skip


def networks(folder):
    nets = dict(fsrcnn=FSRCNN(), estimator=Estimator(), diffusion=UNet((48, 96, 192)))
    for name, net in nets.items():
        net.load_state_dict({key: tensor.float() for key, tensor in load_file(f"{folder}/{name}.safetensors").items()})
    return nets.values()


def readings(optics, x, shape, sigma_px, noise, generator):
    sigma, grid = torch.full((len(x),), sigma_px), torch.arange(-REACH_PX, REACH_PX, dtype=torch.float32)
    if shape == "disc":
        blurred = optics.spread(x, disc(2 * sigma, grid))
    elif shape == "motion":
        blurred = optics.spread(x, streak(24**0.5 * sigma, torch.linspace(0, 3, len(x)), grid))
    else:
        blurred = optics.blurred(x, sigma)
    y = optics.sampled(blurred)
    return (y + noise * torch.randn(y.shape, generator=generator)).clamp(0, 1)[:, None]


@torch.no_grad()
def main(folder, *weights):
    optics, chains, images = Optics("cpu"), [list(networks(each)) for each in weights], np.load(f"{folder}/val.npz")
    for kind, count in COUNTS.items():
        step = max(1, len(images[kind]) // count)
        x = torch.from_numpy(images[kind][::step][:count].astype(np.float32) / 255)[:, None]
        for shape, sigma_px, noise in SHAPES:
            y = readings(optics, x[:, 0], shape, sigma_px, noise, torch.Generator().manual_seed(5))
            made = [F.interpolate(y, scale_factor=2, mode="bicubic", align_corners=False)]
            for fsrcnn, estimator, bridge in chains:
                start = fsrcnn(torch.cat((y, torch.zeros(len(y), 2, 32, 32)), 1)).clamp(0, 1)
                found = estimator(y)
                told = conditions(torch.ones(len(y)), found[:, 0] * 8, found[:, 1] / 10)
                made.append(start + bridge(start, F.interpolate(y, scale_factor=2, mode="nearest"), told))
            print(f"{kind} {shape:8} {sigma_px:.1f} px {100 * noise:4.0f} %  " + "  ".join(f"{psnr(image, x):6.2f}" for image in made), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
