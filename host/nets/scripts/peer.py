"""The shipped networks in PyTorch, timed as `nirspi bench enhance --no-consistency` times them here: estimator, FSRCNN and one step of
the bridge, on frames in the host's memory.

usage: peer.py [--device cpu|cuda] [--frames B] [--repeats R] [--threads T]
"""
import argparse
import json
import statistics
import sys
import time
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from safetensors.torch import load_file

NETS = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(NETS / "training"))
from networks import FSRCNN, Estimator, UNet  # noqa: E402


def main(args):
    if args.threads:
        torch.set_num_threads(args.threads)
    weights = {name: load_file(NETS / "weights" / f"{name}.safetensors") for name in ("estimator", "fsrcnn", "diffusion")}
    state = {name: {key: value.float() for key, value in tensors.items()} for name, tensors in weights.items()}
    widths = tuple(state["diffusion"][f"encoder.{level}.0.conv1.weight"].shape[0] for level in range(3))
    nets = dict(estimator=Estimator(), fsrcnn=FSRCNN(), diffusion=UNet(widths))
    for name, net in nets.items():
        net.load_state_dict(state[name])
        net.to(args.device, memory_format=torch.channels_last).eval()
    frames = torch.from_numpy(np.random.default_rng(1).random((args.frames, 1, 32, 32), np.float32))

    @torch.inference_mode()
    def chain(dtype):
        with torch.autocast(args.device, dtype=dtype, enabled=dtype != torch.float32):
            out = []
            for y in frames.split(256):
                y = y.to(args.device)
                found = nets["estimator"](y)
                start = nets["fsrcnn"](torch.cat((y, torch.zeros(len(y), 2, 32, 32, device=args.device)), 1)).float().clamp(0, 1)
                s, n = (2 * found[:, 0]).clamp(0, 1.5), found[:, 1].clamp(0, 1.5)
                one = torch.ones_like(s)
                told = torch.stack((one, one, s, s * s, n, n * n), 1)
                raw = F.interpolate(y, scale_factor=2, mode="nearest")
                out.append((start + nets["diffusion"](start, raw, told)).cpu())
            return torch.cat(out)

    report = dict(device=torch.cuda.get_device_name() if args.device == "cuda" else "CPU", threads=torch.get_num_threads(), frames=args.frames)
    for name, dtype in (("f32", torch.float32), ("bf16", torch.bfloat16)):
        chain(dtype)
        times = []
        for _ in range(args.repeats):
            start = time.perf_counter()
            chain(dtype)
            times.append(1e3 * (time.perf_counter() - start))
        median = statistics.median(times)
        report[name] = dict(median_ms=median, fastest_ms=min(times), slowest_ms=max(times), frames_per_s=1e3 * args.frames / median)
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--frames", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--threads", type=int)
    main(parser.parse_args())
