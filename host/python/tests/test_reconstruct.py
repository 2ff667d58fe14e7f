"""Reconstruction: every method, whole batches, other patterns."""

import numpy as np
import pytest

import nirspi as ns
from conftest import asymmetric


def scene(n=32):
    image = np.zeros((n, n), np.float32)
    image[n // 4 : n // 2, n // 8 : -n // 4] = 1
    image[n // 2 : -n // 8, n // 3 : n // 2] = 0.5
    return image


def measured(n=32, order="cake-cutting"):
    H = ns.Hadamard(n, rows=ns.order(order, n))
    return ns.Measurement(d=H(scene(n)), rows=H.rows, n=n)


@pytest.mark.parametrize("method", ns.methods())
def test_every_method_makes_an_image_and_a_report(method):
    image = ns.reconstruct(measured(), method=method, sampling=0.4)
    assert image.shape == (32, 32) and image.dtype == np.float32
    assert ns.metrics.correlation(scene(), image) > 0.9
    assert image.report["method"] == method and image.report["used"] == 410
    assert image.rows.shape == (410,) and image.facts()


@pytest.mark.parametrize("method", ["hadamard", "omp", "tikhonov"])
def test_an_image_of_a_batch_is_the_image_alone(method, random):
    H = ns.Hadamard(16)
    d = H(random.random((5, 16, 16)))
    many = ns.Measurement(d=d, rows=H.rows, n=16)
    together = ns.reconstruct(many, method=method, sampling=0.5)
    for k in range(5):
        alone = ns.reconstruct(many, method=method, sampling=0.5, index=k)
        assert (together[k] == alone).all() and together[k].report == alone.report


def test_sampling_is_read_as_people_write_it():
    m = measured()
    expected = ns.reconstruct(m, sampling=0.25)
    for same in ["25%", 25, "0.25", "25 %"]:
        assert (ns.reconstruct(m, sampling=same) == expected).all()


def test_the_order_chooses_the_patterns():
    m = measured(order="natural")
    used = ns.reconstruct(m, method="hadamard", sampling=0.1, order="recorded").rows
    assert used.tolist() == list(range(102))
    used = ns.reconstruct(m, method="hadamard", sampling=0.1, order="cake-cutting").rows
    assert (used == ns.order("cake-cutting", 32)[:102]).all()


def test_options_of_omp():
    m = measured()
    fixed = ns.reconstruct(m, method="omp", sparsity=20, keep="sparse", basis="haar")
    assert fixed.report["omp"]["sparsity"] == 20 and fixed.report["omp"]["basis"] == "haar"
    light = ns.reconstruct(m, method="omp", basis="pixel", non_negative=True, sampling=0.3)
    assert light.min() > -1e-5  # rounding of the transform
    own = ns.reconstruct(m, method="omp", dictionary=scene()[None], sparsity=1, sampling=0.1)
    assert ns.metrics.correlation(scene(), own) > 0.999
    video = ns.Measurement(d=np.stack([m.d] * 3), rows=m.rows, n=32)
    warm = ns.reconstruct(video, method="omp", sampling=0.3, warm_start=True)
    assert [report["warm"] for report in warm.report] == [False, True, True]


def test_patterns_of_ones_own(random):
    patterns = (random.random((200, 256)) > 0.5).astype(float)
    image = asymmetric(16)
    y = patterns @ image.reshape(-1)
    found = ns.reconstruct(y, matrix=patterns, method="tikhonov")
    assert found.shape == (16, 16) and ns.metrics.correlation(image, found) > 0.9
    assert found.report["rank"] == 200
    least = ns.reconstruct(np.stack([y, y]), matrix=patterns, method="pseudo-inverse")
    expected = (np.linalg.pinv(patterns) @ y).reshape(16, 16)
    assert least.shape == (2, 16, 16) and np.allclose(least[1], expected, atol=1e-3)


def test_images_are_in_the_units_of_the_readings_and_never_clipped():
    m = measured()
    m.d = m.d * -1e6
    image = ns.reconstruct(m, method="hadamard")
    assert np.allclose(image, -1e6 * scene(), atol=1)


def test_a_computation_from_two_threads_at_once_gives_the_same():
    import threading

    one = measured()
    # A measurement of its own for each thread, so that an image of another thread shows.
    many = [ns.Measurement(d=k * one.d, rows=one.rows, n=one.n) for k in range(1, 5)]
    make = lambda m: ns.reconstruct(m, method="omp", sampling=0.3)  # noqa: E731
    expected, found = [make(m) for m in many], {}
    work = lambda k: found.update({k: make(many[k])})  # noqa: E731
    threads = [threading.Thread(target=work, args=(k,)) for k in range(len(many))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4 and all((found[k] == expected[k]).all() for k in found)
