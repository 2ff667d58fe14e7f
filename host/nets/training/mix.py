"""Weights between those of two trainings of one network, each tensor a weighted mean: what a network keeps of its first training
while it has most of the second (Wortsman et al., Robust fine-tuning of zero-shot models, CVPR 2022).

usage: mix.py OLD NEW SHARE_OF_NEW OUT
"""
import sys

import torch
from safetensors import safe_open
from safetensors.torch import save_file


def read(path):
    with safe_open(path, "pt") as file:
        return file.metadata(), {name: file.get_tensor(name).to(torch.float32) for name in file.keys()}


def main(old, new, share, out):
    (old_about, old), (about, new), share = read(old), read(new), float(share)
    if {name: tensor.shape for name, tensor in old.items()} != {name: tensor.shape for name, tensor in new.items()}:
        raise SystemExit("the two files are weights of different networks")
    mixed = {name: (1 - share) * old[name] + share * tensor for name, tensor in new.items()}
    about["recipe"] += f"; mixed with {1 - share:g} of version {old_about['version']}"
    save_file(mixed, out, about)


if __name__ == "__main__":
    main(*sys.argv[1:])
