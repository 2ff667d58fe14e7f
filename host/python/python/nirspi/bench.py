"""Times nirspi beside other packages, in one run: ``python -m nirspi.bench``.

Each round runs every contestant once, one after another, so that a change of the machine's load meets
all of them. What is printed are medians of the rounds, the 10th and 90th percentiles, and the median time of
the processor, all threads together: other programs change that least.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from . import devices, order
from .hadamard import Hadamard
from .measurement import Measurement, load
from .omp import Dictionary, orthogonal_mp
from .reconstruction import reconstruct

Contestants = dict[str, Callable[[], Any]]


TURN_S = 0.01


def time_in_turn(contestants: Contestants, seconds: float) -> dict[str, dict[str, float]]:
    """Milliseconds of one run of each contestant, in rounds of one turn of each."""
    runs = {}
    for name, run in contestants.items():
        run()
        start = time.perf_counter()
        run()
        runs[name] = max(1, round(min(TURN_S, seconds) / (time.perf_counter() - start)))
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in contestants}
    began = time.perf_counter()
    while time.perf_counter() - began < seconds or len(next(iter(found.values()))) < 5:
        for name, run in contestants.items():
            for _ in range(runs[name] if runs[name] > 1 else 0):
                run()
            start, cpu = time.perf_counter(), time.process_time()
            for _ in range(runs[name]):
                run()
            took = time.perf_counter() - start, time.process_time() - cpu
            found[name].append((1e3 * took[0] / runs[name], 1e3 * took[1] / runs[name]))
    rounds = len(next(iter(found.values())))
    facts = {}
    for name, times in found.items():
        low, middle, high = np.percentile([wall for wall, _ in times], (10, 50, 90))
        cpu = float(np.median([cpu for _, cpu in times]))
        facts[name] = {"median_ms": middle, "p10_ms": low, "p90_ms": high, "cpu_ms": cpu, "rounds": rounds}
    return facts


def hadamard(n: int, batch: int, threads: int | None) -> dict[str, Contestants]:
    """All rows of an operator on a batch, beside SPyRiT's fast one and deepinv's."""
    rows = order("walsh-2d", n)
    ours = Hadamard(n, rows=rows)
    x = np.random.default_rng(1).random((batch, 1, n, n), np.float32)
    y = ours(x)
    forward: Contestants = {"nirspi, NumPy": lambda: ours(x)}
    adjoint: Contestants = {"nirspi, NumPy": lambda: ours.adjoint(y)}
    try:
        import torch
    except ImportError:
        return {"forward": forward, "adjoint": adjoint}
    if threads:
        torch.set_num_threads(threads)
    tx, ty = torch.from_numpy(x), torch.from_numpy(y)
    forward["nirspi, torch"] = lambda: ours(tx)
    adjoint["nirspi, torch"] = lambda: ours.adjoint(ty)
    try:
        from spyrit.core.meas import HadamSplit2d

        spyrit = HadamSplit2d(n, fast=True)
        forward["SPyRiT, fast=True"] = lambda: spyrit.measure_H(tx)
        adjoint["SPyRiT, fast=True"] = lambda: spyrit.adjoint_H(ty)
    except ImportError:
        pass
    try:
        from deepinv.physics import SinglePixelCamera

        camera = SinglePixelCamera(n * n, (1, n, n))
        measured = camera.A(tx)
        forward["deepinv"] = lambda: camera.A(tx)
        adjoint["deepinv"] = lambda: camera.A_adjoint(measured)
    except ImportError:
        pass
    return {"forward": forward, "adjoint": adjoint}


def omp(measurements: int, atoms: int, sparsity: int, frames: int) -> dict[str, Contestants]:
    """Pursuits over a prepared dictionary, and with its preparation, beside scikit-learn and SPAMS."""
    random = np.random.default_rng(1)
    X = np.asfortranarray(random.standard_normal((measurements, atoms)))
    X /= np.linalg.norm(X, axis=0)
    Y = np.asfortranarray(random.standard_normal((measurements, frames)))
    dictionary = Dictionary(X)
    solve: Contestants = {"nirspi, Dictionary.solve": lambda: dictionary.solve(Y, n_nonzero_coefs=sparsity)}
    whole: Contestants = {"nirspi, orthogonal_mp": lambda: orthogonal_mp(X, Y, n_nonzero_coefs=sparsity)}
    try:
        from sklearn.linear_model import orthogonal_mp as sklearn_omp
        from sklearn.linear_model import orthogonal_mp_gram

        gram, projected = X.T @ X, X.T @ Y
        solve["scikit-learn, Gram given"] = lambda: orthogonal_mp_gram(
            gram, projected, n_nonzero_coefs=sparsity
        )
        whole["scikit-learn"] = lambda: sklearn_omp(X, Y, n_nonzero_coefs=sparsity, precompute=True)
    except ImportError:
        pass
    try:
        import spams

        # Without eps=0. SPAMS returns at once with nothing.
        whole["SPAMS (another pursuit)"] = lambda: spams.omp(Y, X, L=sparsity, eps=0.0)
    except ImportError:
        pass
    return {"prepared": solve, "with preparation": whole}


def file(path: str, count: int, n: int, threads: int | None) -> dict[str, Contestants]:
    """A file of measurements, read and inverted: all rows, so that every package has the same images.
    And the file read alone, which no package can do without."""
    rows = order("walsh-2d", n)
    images = np.random.default_rng(1).random((count, n, n), np.float32)
    Measurement(d=Hadamard(n, rows=rows)(images), rows=rows, n=n).save(path)
    whole: Contestants = {
        "nirspi, load and reconstruct": lambda: reconstruct(load(path, index="all"), method="hadamard"),
        "nirspi, reconstruct the path": lambda: reconstruct(path, index="all", method="hadamard"),
    }
    compared = {"load and reconstruct": whole, "the file alone": reading(path)}
    try:
        import torch
    except ImportError:
        return compared
    if threads:
        torch.set_num_threads(threads)

    def readings(path: str) -> Any:
        with np.load(path) as found:
            return torch.from_numpy(found["d"].astype(np.float32))

    try:
        from spyrit.core.meas import HadamSplit2d

        spyrit = HadamSplit2d(n, fast=True)
        whole["SPyRiT, fast_pinv"] = lambda: spyrit.fast_pinv(readings(path))
    except ImportError:
        pass
    try:
        from deepinv.physics import SinglePixelCamera

        camera = SinglePixelCamera(n * n, (1, n, n))
        # In its own order, in which a measurement has the shape of an image.
        its_own = path + ".deepinv.npz"
        np.savez(its_own, d=Hadamard.of(camera)(images))
        whole["deepinv, A_dagger"] = lambda: camera.A_dagger(readings(its_own).reshape(-1, 1, n, n))
    except ImportError:
        pass
    return compared


def reading(path: str) -> Contestants:
    """Ways of bringing the bytes of a file into memory, each with less work than the one before."""
    held = np.empty(os.path.getsize(path), np.uint8)
    from_memory = held.copy()

    def with_numpy() -> Any:
        with np.load(path) as found:
            return found["d"]

    def fresh() -> Any:
        with open(path, "rb", buffering=0) as file:
            return file.readall()

    def into_held() -> Any:
        with open(path, "rb", buffering=0) as file:
            return file.readinto(held.data)

    return {
        "nirspi, load": lambda: load(path, index="all").d,
        "numpy.load": with_numpy,
        "read, fresh memory": fresh,
        "read, memory that is there": into_held,
        "copy in memory, no file": lambda: np.copyto(held, from_memory),
    }


def sum_of(image: Any, H: Hadamard, y: np.ndarray, weight: float) -> float:
    """What total variation makes small: half the squared misfit, and the length of the gradients."""
    x = np.asarray(image, np.float64).reshape(H.n, H.n)
    down, across = np.zeros_like(x), np.zeros_like(x)
    down[:-1], across[:, :-1] = np.diff(x, axis=0), np.diff(x, axis=1)
    return float(np.square(H(x) - y).sum() / 2 + weight * np.hypot(down, across).sum())


# Iterations of deepinv's solver, and of its total variation in each of them.
_OUTER = (2, 3, 4, 5, 6, 7, 8, 10, 12, 15, 20, 30, 50, 100, 200)
_INNER = (5, 10, 20, 50, 100)


def total_variation(n: int, threads: int | None) -> dict[str, Contestants]:
    """The minimum of one sum, misfit and total variation, from 40 % of the patterns, by each package's
    own solver. nirspi makes 200 iterations, whatever they give. deepinv makes the fewest that bring the
    sum at least as low, which a search before the clock starts has found."""
    rows = order("zig-zag", n)[: max(1, n * n * 2 // 5)]
    H = Hadamard(n, rows=rows, scale="ortho")
    scene = np.zeros((n, n))
    scene[n // 8 : n // 2, n // 4 : 3 * n // 4], scene[5 * n // 8 : 7 * n // 8, n // 8 : n // 2] = 1, 0.5
    y = H(scene) + np.random.default_rng(1).normal(0, 0.05, len(rows))
    measurement = Measurement(d=y * n, rows=rows, n=n)
    # "sparse": measured rows take the values of the minimum too.
    options: Any = {"method": "tv", "strength": 1.0}
    whole: Contestants = {"nirspi": lambda: reconstruct(measurement, **options)}
    try:
        import torch
        from deepinv.optim import PGD
        from deepinv.optim.data_fidelity import L2
        from deepinv.optim.prior import TVPrior
    except ImportError:
        return {"total variation": whole}
    if threads:
        torch.set_num_threads(threads)
    made = reconstruct(measurement, **options)
    weight = made.report["penalty"]["noise_of_a_measurement"] / n
    enough = sum_of(made, H, y, weight)
    physics, readings = H.deepinv(), torch.from_numpy(y.astype(np.float32))[None, None]

    def solver(outer: int, inner: int) -> Any:
        prior, fidelity = TVPrior(n_it_max=inner), L2()
        return PGD(
            prior=prior,
            data_fidelity=fidelity,
            stepsize=1.0,
            lambda_reg=weight,
            max_iter=outer,
            early_stop=False,
        )

    for outer, inner in sorted(((o, i) for o in _OUTER for i in _INNER), key=lambda pair: pair[0] * pair[1]):
        chosen = solver(outer, inner)

        def run(chosen: Any = chosen) -> np.ndarray:
            return chosen(readings, physics).detach().numpy()

        if sum_of(run(), H, y, weight) <= enough:
            whole[f"deepinv, PGD, {outer} x {inner} times"] = run
            break
    return {"total variation": whole}


def machine() -> dict[str, Any]:
    """What the times hold for."""
    load = os.getloadavg() if hasattr(os, "getloadavg") else None
    return {
        "processor": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "load": None if load is None else [round(one, 2) for one in load],
        "python": platform.python_version(),
        "numpy": np.__version__,
        "devices": [name for name, _hardware in devices()],
    }


def main(arguments: list[str] | None = None) -> int:
    """The program.

    Examples
    --------
    >>> from nirspi.bench import main
    >>> few = ["--batch", "2", "--frames", "1", "--n", "8", "--measurements", "3"]
    >>> main(["--seconds", "0.01", *few, "--json"]) == 0
    ... # doctest: +ELLIPSIS
    {...}
    True
    """
    parser = argparse.ArgumentParser(prog="python -m nirspi.bench", description=__doc__)
    parser.add_argument("--n", type=int, default=64, help="side of the image (default 64)")
    parser.add_argument("--batch", type=int, nargs="*", default=[32, 256], help="images at once")
    parser.add_argument("--frames", type=int, nargs="*", default=[1, 16, 256], help="measurements of OMP")
    parser.add_argument("--measurements", type=int, default=10_000, help="of a file (default 10000)")
    parser.add_argument("--problem", type=int, nargs=3, default=[512, 1024, 64], metavar=("M", "N", "K"))
    parser.add_argument("--threads", type=int, help="threads of torch (default: its own choice)")
    parser.add_argument("--seconds", type=float, default=2.0, help="for each comparison (default 2)")
    parser.add_argument("--json", action="store_true", help="print JSON")
    asked = parser.parse_args(arguments)
    before = machine()
    results: dict[str, Any] = {}
    for batch in asked.batch:
        for name, contestants in hadamard(asked.n, batch, asked.threads).items():
            title = f"Hadamard {name}, {asked.n} x {asked.n}, batch of {batch}"
            results[title] = time_in_turn(contestants, asked.seconds)
    for frames in asked.frames:
        measurements, atoms, sparsity = asked.problem
        for name, contestants in omp(measurements, atoms, sparsity, frames).items():
            title = "OMP {} x {}, {} atoms, {}, {} frames".format(*asked.problem, name, frames)
            results[title] = time_in_turn(contestants, asked.seconds)
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "measurements.npz")
        for name, contestants in file(path, asked.measurements, 32, asked.threads).items():
            title = f"{name}, a file of {asked.measurements} measurements of 32 x 32"
            results[title] = time_in_turn(contestants, asked.seconds)
    for name, contestants in total_variation(asked.n, asked.threads).items():
        title = f"{name}, one image of {asked.n} x {asked.n}, 40 % of the patterns"
        results[title] = time_in_turn(contestants, asked.seconds)
    report = {"machine": before, "load_afterwards": machine()["load"], "results": results}
    if asked.json:
        print(json.dumps(report, indent=2))
        return 0
    print("machine:", json.dumps(before))
    for title, found in results.items():
        print(f"\n{title}")
        ours = min(f["median_ms"] for name, f in found.items() if name.startswith("nirspi"))
        for name, facts in found.items():
            times = facts["median_ms"] / ours
            print(
                f"  {name:<28} {facts['median_ms']:9.3f} ms"
                f"  ({facts['p10_ms']:.3f} to {facts['p90_ms']:.3f}, {facts['rounds']} rounds)"
                f"  {times:6.2f} x  processor {facts['cpu_ms']:.3f} ms"
            )
    load = report["load_afterwards"]
    cores = os.cpu_count() or 1
    if load is not None and max(load[0], before["load"][0]) > cores:
        loads = f"{before['load'][0]} to {load[0]} on {cores} cores"
        print(f"\nthe machine was loaded ({loads}): not for publication")
    return 0


if __name__ == "__main__":
    sys.exit(main())
