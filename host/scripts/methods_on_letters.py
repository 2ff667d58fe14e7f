"""Reconstruction methods on letters and a word of the virtual camera: the figures of docs/log/reconstruction.md about letters.

    python3 host/scripts/methods_on_letters.py target/release/nirspi

Runs `nirspi demo` for five scenes, two distances, two numbers of frames, three shares of the patterns and three
methods, 180 pictures in all, one after another. The readings of a case are the same for each method. Prints the mean
PSNR of each method over the scenes, before and after the networks. Simulated. Needs Python alone.
"""

import argparse
import itertools
import json
import statistics
import subprocess
import tempfile

SCENES = ["letter:R", "letter:E", "letter:S", "letter:G", "word:STOP"]
METHODS = ["hadamard", "omp", "tikhonov"]
SHARES = ["25%", "50%", "100%"]
FRAMES = [24, 244]
DISTANCES_M = [0.3, 0.6]


def demo(program, folder, scene, method, share, frames, distance_m):
    """The report of one picture."""
    words = {
        "--scene": scene,
        "--method": method,
        "--sampling": share,
        "--frames": frames,
        "--sweeps": 1,
        "--rain": "none",
        "--distance-m": distance_m,
        "--out": folder,
    }
    command = [program, "demo", "--json", *(str(word) for pair in words.items() for word in pair)]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def main():
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("program", help="the program nirspi")
    program = arguments.parse_args().program
    print("PSNR in dB of the image / of the deblurred image, mean of", ", ".join(SCENES))
    print("| distance | frames | patterns |", " | ".join(METHODS), "|")
    print("| -- | -- | -- |", " | ".join("--" for _ in METHODS), "|")
    with tempfile.TemporaryDirectory() as folder:
        for distance_m, frames, share in itertools.product(DISTANCES_M, FRAMES, SHARES):
            cells = []
            for method in METHODS:
                reports = [
                    demo(program, folder, scene, method, share, frames, distance_m) for scene in SCENES
                ]
                image = statistics.mean(report["reconstruction"]["psnr_db"] for report in reports)
                deblurred = statistics.mean(
                    report["enhancement"]["deblurred"]["psnr_db"] for report in reports
                )
                cells.append(f"{image:.2f} / {deblurred:.2f}")
            print(f"| {distance_m} m | {frames} | {share} |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
