"""Inception-v3's weights from PyTorch's file to the safetensors file that `nirspi metrics --inception` reads.

    pip install torch safetensors
    python inception_to_safetensors.py pt_inception-2015-12-05-6726825d.pth inception.safetensors

FID is defined with pytorch-fid's file of that name (1008 classes); torchvision's has the same layout but other weights.
"""

import sys

import torch
from safetensors.torch import save_file

source, target = sys.argv[1:]
weights = torch.load(source, map_location="cpu", weights_only=True)
save_file({name: t.float().contiguous() for name, t in weights.items() if t.is_floating_point()}, target)
