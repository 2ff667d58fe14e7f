"""Orthogonal matching pursuit: nirspi beside other programs, on the same problems, in the same run.

    python3 -m venv peers && peers/bin/pip install numpy scikit-learn spams-bin batched-omp
    cargo build --release -p nirspi
    peers/bin/python host/recon/benches/peers.py            # from the root, or benches/peers.py from host/recon
        --grid                 also K = 16, 64, 256 by M = 256, 512, 1024
        --input problem.npz    a problem of your own: D (M x N), Y (B x M), k
        --supports 24          instead: as many problems of random shapes and kinds, supports against scikit-learn's
        --seed 1               the same problems again; without it they are new ones each time, and the seed is said
        --device cuda          also batched-omp and nirspi on the graphics card
        --nirspi FILE          a binary of your own

Every problem is solved by each program in turn, round after round, so that other load falls on all alike; medians of all
runs are compared. `nirspi` runs in a process of its own and times itself; its supports come back through a file.

`nirspi` decides as the others do between atoms that look the same, by the last bit, in double precision where it must;
`--normalise` lets one of them stand for all; `--precision f32` never looks twice.

What is timed: the solution of all frames from `D` and `Y` in memory. scikit-learn gets the Gram matrix and the initial
projections for nothing, as its `orthogonal_mp_gram` wants them. nirspi gets its Gram matrix (`prepare` says what that
costs, once for a dictionary), and projects. SPAMS and batched-omp get `D`: SPAMS multiplies out the Gram matrix of a batch
within its time, of one frame it does without one; batched-omp gets it from us. The column `with Gram` adds nirspi's preparation
to its time.

`--device cuda` compares the two that run on a GPU, `nirspi --backend cuda` and batched-omp, one frame and batches, with dictionary and
Gram matrix on the card: the time is from measurements in the host's memory to supports and coefficients there; nirspi brings
images (the coefficients at their places) too, and in its first row solves again on the processor what f32 cannot decide.
"""

import argparse
import importlib
import json
import os
import secrets
import statistics
import subprocess
import sys
import tempfile
import time
import types
import warnings

from pathlib import Path

import numpy as np

# Beside the sources wherever the script is called from.
ROOT = Path(__file__).resolve().parents[3]
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))

warnings.simplefilter("ignore")


def problem(kind, m, n, k, frames, seed):
    """A dictionary with columns of unit norm, and frames that are sums of k of them with noise.

    `random`: normal numbers. `correlated`: neighbours share most of what they are. `camera`: random rows of a Hadamard matrix see
    cosines of an image; some of these look the same to the rows that happen to be there, and which of two equal atoms is chosen
    is then left to rounding.
    """
    rng = np.random.default_rng(seed)
    if kind == "camera":
        d = cosines_by_hadamard_rows(rng, m, n)
    else:
        d = rng.standard_normal((m, n))
    if kind == "correlated":
        for j in range(1, n):
            d[:, j] = 0.8 * d[:, j - 1] + 0.6 * d[:, j]
    d /= np.linalg.norm(d, axis=0)
    y = np.empty((frames, m))
    for f in range(frames):
        y[f] = d[:, rng.choice(n, k, replace=False)] @ rng.standard_normal(k)
    y += 0.05 * np.std(y) * rng.standard_normal(y.shape)
    return d, y


def cosines_by_hadamard_rows(rng, m, n):
    side = int(round(n**0.5))
    i = np.arange(side)
    cosines = np.cos(np.pi * (2 * i[None, :] + 1) * i[:, None] / (2 * side)) * np.sqrt(2 / side)
    cosines[0] /= np.sqrt(2)
    walsh = np.array([[(-1.0) ** bin(a & b).count("1") for b in range(n)] for a in rng.permutation(n)[:m]])
    d = walsh @ np.kron(cosines, cosines).T / side
    norms = np.linalg.norm(d, axis=0)
    # Atoms that the rows do not see: noise of unit norm instead, since the others divide by their norms.
    unseen = norms < 1e-6
    d[:, unseen] = rng.standard_normal((m, unseen.sum()))
    return d


class Nirspi:
    def __init__(self, binary, options, d, y, k, folder, repeats=15):
        # A solution of its own for each program: `bench omp` replaces no file.
        self.path, self.out = os.path.join(folder, "problem.npz"), os.path.join(folder, f"{'-'.join(options)}solution.npz")
        np.savez(self.path, D=d, Y=y, k=k)
        self.command = [binary, "dev", "bench", "omp", "--input", self.path, "--out", self.out,
                        "--repeats", str(repeats), *options]
        self.prepare = []

    def __call__(self):
        Path(self.out).unlink(missing_ok=True)
        ran = subprocess.run(self.command, capture_output=True, text=True)
        if ran.returncode:
            raise RuntimeError(ran.stderr.strip())
        report = json.loads(ran.stdout)
        self.prepare.append(report["prepare_ms"])
        with np.load(self.out) as solution:
            self.support = solution["support"]
        return report["median_ms"], self.support


def timed(run, repeats):
    """Median of a few runs, in milliseconds, and what the last returned."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        found = run()
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times), found


def scikit(d, y, k, repeats):
    from sklearn.linear_model import orthogonal_mp_gram

    gram, xy = d.T @ d, (y @ d).T.copy()

    def run():
        # It works on the Gram matrix in place and puts it back in order only for itself: a fresh one each time, not timed.
        return orthogonal_mp_gram(np.asfortranarray(gram_copy), xy, n_nonzero_coefs=k, copy_Gram=False,
                                  copy_Xy=True, return_path=False)

    times = []
    for _ in range(repeats):
        gram_copy = gram.copy(order="F")
        start = time.perf_counter()
        coefficients = run()
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times), np.atleast_2d(coefficients.T)


def spams_omp(d, y, k, dtype, threads, repeats):
    import spams

    d, y = np.asfortranarray(d, dtype=dtype), np.asfortranarray(y.T, dtype=dtype)
    ms, found = timed(lambda: spams.omp(y, d, L=k, eps=0.0, lambda1=None, numThreads=threads), repeats)
    return ms, found.T.toarray()


def omp_v0():
    """batched-omp's function for PyTorch's devices. Its package wants compiled helpers, which only its variant for NumPy calls."""
    name = "orthogonal_matching_pursuit_gpu"
    try:
        return importlib.import_module(name).omp_v0
    except ImportError:
        helpers = types.ModuleType(f"{name}.blas_kernels")
        for helper in ("argmax_blast", "ppsv", "update_projections_blast", "update_D_mybest_blast"):
            setattr(helpers, helper, None)
        for module in [module for module in sys.modules if module.startswith(name)]:
            del sys.modules[module]
        sys.modules[helpers.__name__] = helpers
        return importlib.import_module(name).omp_v0


def batched(d, y, k, repeats, device="cpu"):
    import torch

    solve = omp_v0()
    x, yt = torch.from_numpy(d.astype(np.float32)).to(device), torch.from_numpy(y.astype(np.float32))
    gram = x.T @ x

    def run():
        sets, values = solve(x, yt.to(device), gram, n_nonzero_coefs=k)[:2]
        return sets.cpu(), values.cpu()

    if device != "cpu":
        run()
    return timed(run, repeats)


def compare_on_gpu(args, kind, m, n, k, frames):
    d, y = problem(kind, m, n, k, frames, args.seed)
    with tempfile.TemporaryDirectory() as folder:
        programs = {
            "nirspi": Nirspi(args.nirspi, ["--backend", "cuda"], d, y, k, folder),
            "nirspi --precision f32": Nirspi(args.nirspi, ["--backend", "cuda", "--precision", "f32"], d, y, k, folder),
            "batched-omp v0": lambda: batched(d, y, k, 5, "cuda"),
        }
        times, found = run_in_turn(programs, args.rounds)
    medians = {name: statistics.median(t) for name, t in times.items() if t}
    print(f"\n{kind} dictionary, N = {n}, M = {m}, K = {k}, {frames} frame{'s' * (frames > 1)}, on the GPU")
    print(f"{'program':26} {'median ms':>10} {'frames/s':>10} {'of nirspi':>10}  same supports")
    for name in programs:
        if name not in medians:
            print(f"{name:26} {found[name]}")
            continue
        same = "-"
        if not isinstance(found["nirspi"], str):
            same = sum(a == b for a, b in zip(sets_of(found["nirspi"]), sets_of(found[name])))
        ratio = medians[name] / medians.get("nirspi", float("nan"))
        print(f"{name:26} {medians[name]:10.3f} {1e3 * frames / medians[name]:10.0f} {ratio:9.1f}x  {same} of {frames}")
    return {"dictionary": kind, "m": m, "n": n, "k": k, "frames": frames, "median_ms": medians}


def sets_of(found):
    """Support of each frame as a set, from a support array or dense coefficients."""
    if isinstance(found, tuple):
        return [set(np.asarray(row).tolist()) for row in found[0]]
    found = np.asarray(found)
    if np.issubdtype(found.dtype, np.integer):
        return [set(row[row >= 0].tolist()) for row in found]
    return [set(np.flatnonzero(row).tolist()) for row in found]


def run_in_turn(programs, rounds):
    times, found = {name: [] for name in programs}, {}
    for _ in range(rounds):
        for name, run in programs.items():
            try:
                ms, found[name] = run()
                times[name].append(ms)
            except Exception as error:  # a peer that fails is reported, not hidden
                found[name] = f"failed: {error}"[:70]
    return times, found


def compare(args, kind, d, y, k):
    (m, n), frames = d.shape, len(y)
    repeats = 9 if frames == 1 else 1
    with tempfile.TemporaryDirectory() as folder:
        ours = Nirspi(args.nirspi, [], d, y, k, folder)
        programs = {
            "nirspi": ours,
            "nirspi --normalise": Nirspi(args.nirspi, ["--normalise"], d, y, k, folder),
            "nirspi --precision f32": Nirspi(args.nirspi, ["--precision", "f32"], d, y, k, folder),
            "scikit-learn gram": lambda: scikit(d, y, k, repeats),
        }
        for dtype in (np.float64, np.float32):
            for threads in (1, 2):
                name = f"SPAMS {dtype.__name__}, {threads} thread{'s' * (threads > 1)}"
                programs[name] = lambda dtype=dtype, threads=threads: spams_omp(d, y, k, dtype, threads, repeats)
        programs["batched-omp v0"] = lambda: batched(d, y, k, repeats)
        times, found = run_in_turn(programs, args.rounds)
    medians = {name: statistics.median(t) for name, t in times.items() if t}
    within = medians["nirspi"] + statistics.median(ours.prepare)
    reference = sets_of(found["nirspi"])
    print(f"\n{kind} dictionary, N = {n}, M = {m}, K = {k}, {frames} frame{'s' * (frames > 1)} (prepare {within - medians['nirspi']:.1f} ms)")
    print(f"{'program':26} {'median ms':>10} {'of nirspi':>10} {'with Gram':>10}  same supports")
    for name in programs:
        if name not in medians:
            print(f"{name:26} {found[name]}")
            continue
        same = sum(a == b for a, b in zip(reference, sets_of(found[name])))
        ms = medians[name]
        print(f"{name:26} {ms:10.3f} {ms / medians['nirspi']:9.1f}x {ms / within:9.1f}x  {same} of {frames}")
    spams_best = min(ms for name, ms in medians.items() if name.startswith("SPAMS"))
    return {"dictionary": kind, "m": m, "n": n, "k": k, "frames": frames, "prepare_ms": within - medians["nirspi"],
            "median_ms": medians, "of_spams_best": spams_best / medians["nirspi"],
            "of_scikit": medians["scikit-learn gram"] / medians["nirspi"]}


def supports(args):
    """Problems of random shapes and kinds: are the supports scikit-learn's?"""
    rng = np.random.default_rng(args.seed)
    total = same_total = 0
    print("kind            M     N    K frames  same supports   where they part, the lead of the one over the other")
    for number in range(args.supports):
        kind = ("random", "correlated", "tall", "camera")[number % 4]
        n = 4 ** rng.integers(3, 6) if kind == "camera" else int(rng.integers(20, 900))
        m = int(rng.integers(n // 3 + 1, n)) if kind != "tall" else int(rng.integers(n, 2 * n))
        k, frames = int(rng.integers(1, max(2, min(m, n) // 4))), int(rng.integers(1, 40))
        d, y = problem("random" if kind == "tall" else kind, m, int(n), k, frames, int(rng.integers(1 << 31)))
        with tempfile.TemporaryDirectory() as folder:
            _, ours = Nirspi(args.nirspi, [], d, y, k, folder, repeats=1)()
        _, theirs = scikit(d, y, k, 1)
        pairs = list(zip(ours, theirs))
        same = sum(set(a[a >= 0].tolist()) == set(np.flatnonzero(b).tolist()) for a, b in pairs)
        leads = [lead_at_the_parting(d, y[i], a, set(np.flatnonzero(b).tolist()))
                 for i, (a, b) in enumerate(pairs) if set(a[a >= 0].tolist()) != set(np.flatnonzero(b).tolist())]
        total, same_total = total + frames, same_total + same
        said = f"{max(leads):.1e} at most" if leads else ""
        print(f"{kind:12} {m:5} {n:5} {k:4} {frames:6}  {same:5} of {frames:4}   {said}")
    print(f"{same_total} of {total} frames have scikit-learn's support")


def lead_at_the_parting(d, y, ours, theirs):
    """By how much, relative to the measurement, our first atom that is none of theirs was better than the best that is theirs."""
    for step, atom in enumerate(ours):
        if atom not in theirs:
            chosen = d[:, ours[:step]]
            residual = y - chosen @ np.linalg.lstsq(chosen, y, rcond=None)[0] if step else y
            score = np.abs(d.T @ residual) / np.linalg.norm(y)
            rest = [j for j in theirs if j not in set(ours[:step].tolist())]
            return float(score[atom] - max(score[j] for j in rest)) if rest else float("nan")
    return float("nan")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--nirspi", default=str(TARGET / "release" / "nirspi"))
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--grid", action="store_true", help="also K = 16, 64, 256 by M = 256, 512, 1024")
    parser.add_argument("--input", help="time this problem (.npz with D, Y, k) instead")
    parser.add_argument("--supports", type=int, metavar="N", help="compare supports on N random problems instead")
    parser.add_argument("--seed", type=int, help="of the problems; new ones each time without it")
    parser.add_argument("--json", help="write all medians here")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help="cuda: the programs that run there")
    args = parser.parse_args()
    if not os.access(args.nirspi, os.X_OK):
        parser.error(f"no program at {args.nirspi}: cargo build --release -p nirspi, or --nirspi PATH")
    if args.seed is None:
        args.seed = secrets.randbelow(1 << 31)
    print(f"seed {args.seed}, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    if args.supports:
        return supports(args)
    if args.device == "cuda":
        shapes = [(kind, frames) for kind in ("random", "camera") for frames in (1, 256, 4096)]
        return write(args, [compare_on_gpu(args, kind, 512, 1024, 64, frames) for kind, frames in shapes])
    if args.input:
        with np.load(args.input) as file:
            results = [compare(args, "given", file["D"], np.atleast_2d(file["Y"]), int(file["k"]))]
    else:
        shapes = [(kind, 512, 64, frames) for kind in ("random", "camera") for frames in (1, 256)]
        if args.grid:
            shapes += [("random", m, k, frames) for m in (256, 512, 1024) for k in (16, 64, 256) for frames in (1, 64)
                       if (m, k) != (512, 64)]
        results = []
        for kind, m, k, frames in shapes:
            results.append(compare(args, kind, *problem(kind, m, 1024, k, frames, args.seed), k))
    print("\ndictionary     N     M    K frames  SPAMS's best   scikit-learn   (times nirspi's median)")
    for r in results:
        print(f"{r['dictionary']:10} {r['n']:5} {r['m']:5} {r['k']:4} {r['frames']:6} {r['of_spams_best']:12.1f}x {r['of_scikit']:13.1f}x")
    write(args, results)


def write(args, results):
    if args.json:
        with open(args.json, "w") as file:
            json.dump(results, file, indent=1)


if __name__ == "__main__":
    main()
