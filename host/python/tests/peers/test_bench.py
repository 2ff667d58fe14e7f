"""What is timed side by side gives the same."""

import numpy as np
import pytest

from nirspi.bench import file, omp, total_variation


def test_every_package_makes_the_same_images_of_a_file(tmp_path):
    pytest.importorskip("torch")
    contestants = file(str(tmp_path / "m.npz"), 5, 8, None)["load and reconstruct"]
    assert len(contestants) > 2
    truth = np.random.default_rng(1).random((5, 8, 8), np.float32)
    for name, run in contestants.items():
        found = np.asarray(run()).reshape(truth.shape)
        assert np.allclose(found, truth, atol=1e-5), name


def test_what_is_timed_as_the_file_alone_is_the_file(tmp_path):
    path = tmp_path / "m.npz"
    ways = file(str(path), 5, 8, None)["the file alone"]
    bytes_of = path.read_bytes()
    with np.load(path) as found:
        d = found["d"]
    assert all(np.array_equal(ways[name](), d) for name in ["nirspi, load", "numpy.load"])
    assert ways["read, fresh memory"]() == bytes_of
    assert ways["read, memory that is there"]() == len(bytes_of)


def test_every_pursuit_finds_the_same_coefficients():
    for contestants in omp(20, 30, 4, 6).values():
        found = {name: run() for name, run in contestants.items() if "another pursuit" not in name}
        dense = [one.toarray() if hasattr(one, "toarray") else np.asarray(one) for one in found.values()]
        for name, one in zip(found, dense, strict=True):
            assert np.allclose(one, dense[0], atol=1e-4), name


def test_both_solvers_of_total_variation_find_the_same_image():
    pytest.importorskip("deepinv")
    (contestants,) = total_variation(16, None).values()
    ours, theirs = (np.asarray(run()).reshape(16, 16) for run in contestants.values())
    # They stop within 1 % of the same least sum, at scenes between 0 and 1.
    assert len(contestants) == 2 and np.abs(ours - theirs).max() < 0.1
    assert np.corrcoef(ours.ravel(), theirs.ravel())[0, 1] > 0.999
