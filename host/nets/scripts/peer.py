"""The shipped networks in PyTorch, timed as `nirspi dev bench enhance --no-consistency` times them here: estimator, FSRCNN and one step of
the bridge, on frames in the host's memory.

usage: peer.py [--device cpu|cuda] [--frames B] [--batch N] [--repeats R] [--threads T] [--compile graph|max-autotune|default]

Without --compile, PyTorch runs operation by operation, in f32 (TF32 for convolutions on a GPU) and with automatic bf16.
With --compile, what a PyTorch programmer gets with effort, in f16 and bf16: `graph` records all operations once as a CUDA graph
and replays it; `max-autotune` and `default` are those modes of torch.compile. FSRCNN and the bridge, 99 % of the products, then
have weights and activations in half precision, and copies to and from the GPU are from and to pinned memory and overlap.
`apart` is the largest and the root mean square difference from f32 without TF32, of images in [0, 1].
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
# The networks alone: the package around them is built with Rust, which the machine with the GPU has not.
sys.path.insert(0, str(NETS.parent / "python/python/nirspi/train"))
from networks import FSRCNN, Estimator, UNet  # noqa: E402


def networks(device):
    """The shipped networks in f32."""
    weights = {name: load_file(NETS / "weights" / f"{name}.safetensors") for name in ("estimator", "fsrcnn", "diffusion")}
    state = {name: {key: value.float() for key, value in tensors.items()} for name, tensors in weights.items()}
    widths = tuple(state["diffusion"][f"encoder.{level}.0.conv1.weight"].shape[0] for level in range(3))
    nets = dict(estimator=Estimator(), fsrcnn=FSRCNN(), diffusion=UNet(widths))
    for name, net in nets.items():
        net.load_state_dict(state[name])
        net.to(device, memory_format=torch.channels_last).eval()
    return nets


def chain(nets, y, dtype):
    """Images of 64 x 64 from images of 32 x 32, both in f32; FSRCNN and the bridge compute in `dtype`."""
    found = nets["estimator"](y)
    depth = torch.zeros(len(y), 2, 32, 32, device=y.device)
    start = nets["fsrcnn"](torch.cat((y, depth), 1).to(dtype)).float().clamp(0, 1)
    s, n = (2 * found[:, 0]).clamp(0, 1.5), found[:, 1].clamp(0, 1.5)
    one = torch.ones_like(s)
    told = torch.stack((one, one, s, s * s, n, n * n), 1)
    raw = F.interpolate(y, scale_factor=2, mode="nearest")
    return start + nets["diffusion"](start.to(dtype), raw.to(dtype), told.to(dtype)).float()


def eager(nets, frames, batch, device, dtype):
    """A function that runs operation by operation."""

    @torch.inference_mode()
    def run():
        with torch.autocast(device, dtype=dtype, enabled=dtype != torch.float32):
            return torch.cat([chain(nets, y.to(device), torch.float32).cpu() for y in frames.split(batch)])

    return run


def compiled(frames, batch, device, dtype, mode):
    """A function that replays one CUDA graph, or runs what torch.compile made."""
    nets = networks(device)
    for name in ("fsrcnn", "diffusion"):
        nets[name].to(dtype)
    function = chain if mode == "graph" else torch.compile(chain, mode=None if mode == "default" else mode)
    pinned = (frames.pin_memory() if device == "cuda" else frames).split(batch)
    out = torch.empty(len(frames), 1, 64, 64, pin_memory=device == "cuda")

    if device != "cuda":

        @torch.inference_mode()
        def on_cpu():
            for y, to in zip(pinned, out.split(batch)):
                to.copy_(function(nets, y, dtype))
            return out

        return on_cpu

    static = torch.zeros(batch, 1, 32, 32, device=device)
    with torch.inference_mode():
        # Libraries choose their kernels before the recording.
        side = torch.cuda.Stream()
        side.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(side):
            for _ in range(3):
                function(nets, static, dtype)
        torch.cuda.current_stream().wait_stream(side)
        torch.cuda.synchronize()
        graph, made = None, None
        if mode == "graph":
            graph = torch.cuda.CUDAGraph()
            with torch.cuda.graph(graph):
                made = function(nets, static, dtype)

    @torch.inference_mode()
    def run():
        for y, to in zip(pinned, out.split(batch)):
            static[: len(y)].copy_(y, non_blocking=True)
            if graph is None:
                image = function(nets, static, dtype)
            else:
                graph.replay()
                image = made
            to.copy_(image[: len(y)], non_blocking=True)
        torch.cuda.synchronize()
        return out

    return run


def timed(run, frames, repeats):
    """Times of `repeats` runs, after one that is not counted."""
    run()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(1e3 * (time.perf_counter() - start))
    median = statistics.median(times)
    return dict(median_ms=median, fastest_ms=min(times), slowest_ms=max(times), frames_per_s=1e3 * frames / median)


def main(args):
    if args.threads:
        torch.set_num_threads(args.threads)
    torch.backends.cudnn.benchmark = True
    frames = torch.from_numpy(np.random.default_rng(1).random((args.frames, 1, 32, 32), np.float32))
    batch = min(args.batch, args.frames)
    nets = networks(args.device)

    def tf32(allowed):
        torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = allowed

    tf32(False)
    exact = eager(nets, frames[:256], batch, args.device, torch.float32)()
    tf32(True)

    report = dict(device=torch.cuda.get_device_name() if args.device == "cuda" else "CPU", torch=torch.__version__, threads=torch.get_num_threads(), frames=args.frames, batch=batch)
    if args.compile:
        ways = [(f"{args.compile} {name}", dtype) for name, dtype in (("f16", torch.float16), ("bf16", torch.bfloat16))]
    else:
        ways = [("f32", torch.float32), ("bf16", torch.bfloat16)]
    for name, dtype in ways:
        try:
            start = time.perf_counter()
            run = compiled(frames, batch, args.device, dtype, args.compile) if args.compile else eager(nets, frames, batch, args.device, dtype)
            apart = (run()[:256] - exact).abs()
            ready_s = time.perf_counter() - start
            report[name] = dict(ready_s=ready_s, apart=dict(largest=apart.max().item(), rms=apart.square().mean().sqrt().item()))
            report[name].update(timed(run, args.frames, args.repeats))
        except Exception as error:
            # One way that this machine's PyTorch cannot go leaves the others.
            report[name] = dict(error=f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}")
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--frames", type=int, default=64)
    parser.add_argument("--batch", type=int, default=256, help="frames at once")
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--threads", type=int)
    parser.add_argument("--compile", choices=("graph", "max-autotune", "default"))
    main(parser.parse_args())
