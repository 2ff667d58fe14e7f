"""Fréchet distances of the features of host/nets/src/metrics/frechet.rs by SciPy's root of a matrix: the numbers of its test.

    pip install scipy==1.17.1 numpy==2.4.6 && python frechet_reference.py
"""

import numpy as np
from scipy.linalg import eigh, eigvalsh, sqrtm


def features(images, count, phase, gain):
    i, j = np.meshgrid(np.arange(images), np.arange(count), indexing="ij")
    wave = np.sin(0.37 * i * (j + 1) + phase) + 0.2 * np.cos(1.9 * j)
    return np.maximum(gain * wave * (j % 5 != 3) + 0.1 * (i % 3), 0).astype(np.float32).astype(np.float64)


def distance(a, b):
    """As pytorch-fid, `sqrtm(ca @ cb)`, and by the eigenvalues of ca^1/2 cb ca^1/2, which are exact where that is singular."""
    mean = a.mean(0) - b.mean(0)
    ca, cb = np.cov(a, rowvar=False), np.cov(b, rowvar=False)
    values, vectors = eigh(ca)
    half = vectors * np.sqrt(np.maximum(values, 0)) @ vectors.T
    root = np.sqrt(np.maximum(eigvalsh(half @ cb @ half), 0)).sum()
    alike = mean @ mean + np.trace(ca) + np.trace(cb)
    return float(alike - 2 * root), float(alike - 2 * np.trace(sqrtm(ca @ cb).real))


for images, others, count in [(40, 50, 8), (12, 9, 16), (16, 17, 16), (2, 2, 5), (300, 200, 32)]:
    exact, direct = distance(features(images, count, 0.0, 1.0), features(others, count, 0.8, 1.4))
    print(f"({images}, {others}, {count}, {exact!r})  # sqrtm: {direct!r}")
