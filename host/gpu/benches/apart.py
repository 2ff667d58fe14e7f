"""Compares `nirspi enhance` on a GPU with the processor, on images with an edge, a grid and noise.

usage: apart.py NIRSPI [--precision f32|f16] [--frames N] [--backend cuda]

Prints the largest and the root mean square difference as JSON, and ends with 1 if one is over what `nirspi_nets::Arithmetic`
promises: 1e-4 of full scale in f32, 5e-3 and 2e-4 in f16.
"""
import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

LIMITS = {"f32": (1e-4, 1e-4), "f16": (5e-3, 2e-4)}


def images(frames):
    """Squares, discs and gratings at random places, blurred and with noise: (frames, 32, 32) in [0, 1]."""
    random = np.random.default_rng(3)
    y, x = np.mgrid[:32, :32].astype(np.float32)
    made = []
    for kind in np.arange(frames) % 3:
        cx, cy, size = random.uniform(8, 24, 2).tolist() + [random.uniform(4, 9)]
        across, down = np.abs(x - cx), np.abs(y - cy)
        soft = random.uniform(0.5, 2)
        if kind == 0:
            image = 1 / (1 + np.exp((np.maximum(across, down) - size) / soft))
        elif kind == 1:
            image = 1 / (1 + np.exp((np.hypot(across, down) - size) / soft))
        else:
            image = 0.5 + 0.4 * np.sin(6 * (x * np.cos(cx) + y * np.sin(cx)) / size)
        made.append(image + random.uniform(0, 0.05) * random.standard_normal((32, 32)))
    return np.clip(np.array(made), 0, 1).astype(np.float32)


def enhanced(nirspi, folder, source, backend, precision):
    """What the program makes of the images."""
    out = folder / f"{backend}.npy"
    command = [nirspi, "enhance", source, "--out", out, "--backend", backend, "--no-consistency"]
    command += ["--precision", precision] if backend != "cpu" else []
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{backend}: {done.stderr.strip()}")
    # Notes say where a GPU did something else than asked.
    notes = [line for line in done.stderr.splitlines() if line.startswith("nirspi:")]
    return np.load(out).astype(np.float64), notes


def main(args):
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        source = folder / "images.npy"
        np.save(source, images(args.frames))
        there, notes = enhanced(args.nirspi, folder, source, args.backend, args.precision)
        here, _ = enhanced(args.nirspi, folder, source, "cpu", "f32")
    apart = np.abs(there - here)
    largest, rms = float(apart.max()), float(np.sqrt(np.mean(apart**2)))
    most = LIMITS[args.precision]
    print(json.dumps(dict(backend=args.backend, precision=args.precision, frames=args.frames, largest=largest, rms=rms, most=most, notes=notes)))
    # With NaN, neither comparison is true.
    return 0 if largest <= most[0] and rms <= most[1] else 1


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("nirspi")
    parser.add_argument("--precision", choices=sorted(LIMITS), default="f32")
    parser.add_argument("--frames", type=int, default=96)
    parser.add_argument("--backend", default="cuda")
    sys.exit(main(parser.parse_args()))
