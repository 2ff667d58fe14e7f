"""Times one archive by one process and by Ray on this machine: the figures of docs/clusters.md.

python tests/cluster/throughput.py [FILES]
"""

import os
import pathlib
import sys
import tempfile
import time

import numpy as np
import ray

import nirspi as ns
import nirspi.ray

METHOD = {"method": "omp", "sampling": "30%"}


def archive_of(place, files):
    random = np.random.default_rng(1)
    scene = np.zeros((32, 32))
    scene[6:14, 8:26] = 1.0
    d = ns.Hadamard(32)(scene).reshape(-1)
    rows = ns.order("zig-zag", 32)
    for k in range(files):
        noisy = d[rows] + random.normal(0, 0.5, 1024)
        ns.Measurement(d=noisy, rows=rows, n=32).save(place / f"{k:05}.npz")


def timed(work):
    began, used = time.perf_counter(), os.times()
    work()
    now = os.times()
    return time.perf_counter() - began, now.user + now.system - used.user - used.system


def main():
    files = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    with tempfile.TemporaryDirectory() as name:
        place = pathlib.Path(name)
        (place / "in").mkdir()
        archive_of(place / "in", files)
        work = ns.Archive(place / "in", **METHOD)
        print(f"{files} files of 1024 readings, {METHOD}, load {os.getloadavg()[0]:.1f}")
        for jobs in (1, 2):
            wall, used = timed(lambda jobs=jobs: work.run(place / f"{jobs}.parquet", jobs=jobs))
            print(
                f"one process, jobs={jobs}: {wall:.2f} s, {files / wall:.0f} files/s, processor {used:.2f} s"
            )
        wall, _ = timed(lambda: ray.init(num_cpus=2, log_to_driver=False, object_store_memory=10**8))
        print(f"ray.init: {wall:.2f} s")
        for workers in (1, 2, 1, 2):
            out = place / f"ray-{workers}-{time.monotonic_ns()}"
            wall, _ = timed(lambda workers=workers, out=out: nirspi.ray.run(work, out, workers=workers))
            print(f"Ray, workers={workers}: {wall:.2f} s, {files / wall:.0f} files/s")
        few = ns.Archive([place / "in/00000.npz"], **METHOD)
        wall, _ = timed(lambda: nirspi.ray.run(few, place / "few"))
        print(f"Ray, one file: {wall:.2f} s")


if __name__ == "__main__":
    main()
