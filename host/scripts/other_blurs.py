"""What the agreement with the readings does to images whose blur is no Gaussian (simulated).

    python host/scripts/other_blurs.py NIRSPI [NIRSPI ...] [--letters BEGMw3nx]
    python host/scripts/other_blurs.py NIRSPI [NIRSPI ...] --photographs DATA/natural/bsds_train.npz

Letters of `nirspi demo`, or photographs, of 64 x 64 are blurred, shrunk to 32 x 32 and given noise. Prints a
row for each blur and noise: mean PSNR in dB of `nirspi enhance` by each program, and by the last one with
--no-consistency. Needs numpy; photographs need pillow.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

SIDE = 64
LETTERS = "BEGMw3nx"
NOISES = [0.005, 0.02, 0.05]


def convolved(image, kernel):
    """The image with mirrored edges, blurred by a square kernel of odd side."""
    reach = len(kernel) // 2
    wide = np.pad(image, reach, mode="symmetric")
    windows = np.lib.stride_tricks.sliding_window_view(wide, kernel.shape)
    return np.einsum("ijkl,kl->ij", windows, kernel)


def gaussian(sigma):
    at = np.arange(-15, 16)
    line = np.exp(-(at**2) / (2 * sigma**2))
    return np.outer(line, line) / line.sum() ** 2


def disc(radius):
    y, x = np.mgrid[-12:13, -12:13]
    inside = (y**2 + x**2 <= radius**2).astype(float)
    return inside / inside.sum()


def motion(length):
    """A line of this length along x."""
    kernel = np.zeros((25, 25))
    for shift in np.linspace(-length / 2, length / 2, 8 * length + 1):
        low = int(np.floor(shift))
        kernel[12, 12 + low] += 1 - (shift - low)
        kernel[12, 13 + low] += shift - low
    return kernel / kernel.sum()


BLURS = {f"motion of {length}": motion(length) for length in (2, 4, 6, 8)}
BLURS |= {f"disc of radius {radius}": disc(radius) for radius in (2, 4, 6)}
BLURS |= {f"Gaussian of {sigma}": gaussian(sigma) for sigma in (0.5, 1, 2, 3)}


def letters(program, names, folder):
    for name in names:
        out = folder / f"letter-{ord(name)}"
        demo = [program, "demo", "--scene", f"letter:{name}", "--rain", "none", "--method", "hadamard"]
        subprocess.run(
            [*demo, "--out", str(out)], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        yield np.load(out / "truth_64.npy").astype(float)


def photographs(file):
    from PIL import Image

    stack = np.load(file)["x"]
    for at in np.linspace(0, len(stack) - 1, 24).astype(int):
        image = Image.fromarray(stack[at])
        side = min(image.size)
        image = image.crop((0, 0, side, side)).resize((SIDE, SIDE), Image.Resampling.LANCZOS)
        pixels = np.asarray(image).astype(float)
        yield (pixels - pixels.min()) / np.ptp(pixels)


def psnr_db(program, readings, truths, folder, *options):
    given, made = folder / "given.npy", folder / "made.npy"
    np.save(given, np.clip(readings, 0, 1).astype(np.float32))
    command = [program, "enhance", str(given), "--out", str(made), "--overwrite", "--json", *options]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    error = ((np.load(made) - truths) ** 2).mean(axis=(1, 2))
    return (-10 * np.log10(error)).mean()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("programs", nargs="+", metavar="NIRSPI")
    parser.add_argument("--letters", default=LETTERS)
    parser.add_argument("--photographs", type=Path)
    args = parser.parse_args()
    random = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        chosen = (
            photographs(args.photographs)
            if args.photographs
            else letters(args.programs[-1], args.letters, folder)
        )
        truths = np.stack(list(chosen))
        print("| blur | noise |", " | ".join([*args.programs, "without agreement"]), "|")
        for blur, kernel in BLURS.items():
            seen = np.stack([convolved(truth, kernel) for truth in truths])
            seen = seen.reshape(-1, 32, 2, 32, 2).mean(axis=(2, 4))
            for noise in NOISES:
                readings = seen + noise * random.normal(size=seen.shape)
                found = [psnr_db(program, readings, truths, folder) for program in args.programs]
                found.append(psnr_db(args.programs[-1], readings, truths, folder, "--no-consistency"))
                print(f"| {blur} | {noise} |", " | ".join(f"{value:.2f}" for value in found), "|")
                sys.stdout.flush()


if __name__ == "__main__":
    main()
