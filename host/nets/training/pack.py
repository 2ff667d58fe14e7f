"""Weights as they are shipped: half precision for the large networks, a checksum over all bytes behind the header.

usage: pack.py FOLDER_OF_SAFETENSORS OUT_FOLDER
"""
import hashlib
import json
import sys
from pathlib import Path

import torch
from safetensors import safe_open
from safetensors.torch import save_file

LARGE_BYTES = 1 << 20
BASELINES = ("gan", "ancestral", "regression")


def main(source, out):
    for path in sorted(Path(source).glob("*.safetensors")):
        with safe_open(path, "pt") as file:
            metadata = file.metadata()
            tensors = {name: file.get_tensor(name) for name in file.keys()}
        if path.stat().st_size > LARGE_BYTES:
            tensors = {name: tensor.to(torch.float16) for name, tensor in tensors.items()}
        folder = Path(out) / ("baselines" if path.stem in BASELINES else "")
        target = folder / path.name
        save_file(tensors, target, metadata)
        raw = target.read_bytes()
        header = 8 + int.from_bytes(raw[:8], "little")
        save_file(tensors, target, metadata | dict(sha256=hashlib.sha256(raw[header:]).hexdigest()))
        print(target, target.stat().st_size, json.dumps(metadata))


if __name__ == "__main__":
    main(*sys.argv[1:])
