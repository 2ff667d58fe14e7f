"""Reconstruction: every method, whole batches, other patterns."""

import tracemalloc

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


def stored(tmp_path, how):
    """A file of measurements, some in a form that is read as it lies there, some in another one."""
    path, rows = tmp_path / "many.npz", ns.order("cake-cutting", 16)
    d = ns.Hadamard(16, rows=rows)(np.random.default_rng(5).normal(size=(300, 16, 16)))
    if how == "gaps":
        d[7, 3] = d[299, :40] = d[:, 9] = np.nan
    shaped = {"Fortran": np.asfortranarray(d), "one": d[0], "32 bits": d.astype("f4")}.get(how, d)
    fields = {"y": ns.Hadamard(16, rows=rows, split=True)(scene(16))} if how == "pairs" else {"d": shaped}
    (np.savez_compressed if how == "compressed" else np.savez)(path, n=16, h_row=rows, **fields)
    return path


FORMS = ["as it lies there", "32 bits", "compressed", "Fortran", "gaps", "one", "pairs"]


@pytest.mark.parametrize("how", FORMS)
@pytest.mark.parametrize("options", [{"method": "hadamard"}, {"sampling": 0.3}])
def test_a_file_that_is_read_while_it_is_reconstructed_gives_the_same(tmp_path, how, options):
    path = stored(tmp_path, how)
    expected = ns.reconstruct(ns.load(path, index="all", transpose=True), **options)
    made = ns.reconstruct(path, index="all", transpose=True, **options)
    assert np.array_equal(made, expected) and made.report == expected.report and made.unit == expected.unit
    assert (
        np.array_equal(np.asarray(made.rows), np.asarray(expected.rows))
        if how != "gaps"
        else all(map(np.array_equal, made.rows, expected.rows))
    )
    made.report[0]["note of mine"] = 1
    assert len(made) == 1 or "note of mine" not in made.report[1]


def test_one_measurement_of_a_file_is_that_of_load(tmp_path):
    path = stored(tmp_path, "gaps")
    made, expected = ns.reconstruct(str(path), index=7), ns.reconstruct(ns.load(path, index=7))
    assert made.shape == (16, 16) and (made == expected).all() and made.report == expected.report
    with pytest.raises(TypeError, match="an argument that needs the path of a file: side"):
        ns.reconstruct(measured(), side=32)
    with pytest.raises(TypeError, match="an unexpected keyword argument: sampeling, expected sampling$"):
        ns.reconstruct(measured(), sampeling=0.3)
    with pytest.raises(TypeError, match="an unexpected keyword argument: sides, expected side$"):
        ns.reconstruct(path, index=7, sides=32)


def test_a_file_is_refused_in_the_words_of_load(tmp_path):
    d = np.ones((300, 256))
    d[200, 5] = np.inf
    np.savez(tmp_path / "inf.npz", n=16, h_row=ns.order("natural", 16), d=d)
    (tmp_path / "cut.npz").write_bytes((tmp_path / "inf.npz").read_bytes()[:-1000])
    for name in ["inf.npz", "cut.npz", "none.npz"]:
        words = []
        for call in (
            lambda path: ns.reconstruct(ns.load(path, index="all"), method="hadamard"),
            lambda path: ns.reconstruct(path, index="all", method="hadamard"),
        ):
            with pytest.raises((ns.Error, OSError)) as error:
                call(tmp_path / name)
            words.append((type(error.value), str(error.value)))
        assert words[0] == words[1], words


def test_a_file_that_is_read_while_it_is_reconstructed_is_never_whole_in_memory(tmp_path):
    # NumPy tells tracemalloc of its arrays.
    rows, n = ns.order("natural", 32)[:512], 32
    d = np.random.default_rng(3).normal(size=(4000, 512))
    # No pattern collects more light than the all-on pattern, so nothing has to be looked at again.
    d[:, 0] = 20
    np.savez(tmp_path / "d.npz", n=n, h_row=rows, d=d)

    def peak(run):
        tracemalloc.start()
        try:
            run()
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    path, options = tmp_path / "d.npz", {"method": "hadamard"}
    pixels = 4 * 4000 * n * n
    assert peak(lambda: ns.reconstruct(ns.load(path, index="all"), **options)) > d.nbytes + pixels
    assert peak(lambda: ns.reconstruct(path, index="all", **options)) < pixels + d.nbytes / 4


def test_sampling_is_read_as_people_write_it():
    m = measured()
    expected = ns.reconstruct(m, sampling=0.25)
    for same in ["25%", "0.25", "25 %"]:
        assert (ns.reconstruct(m, sampling=same) == expected).all()


def test_the_order_chooses_the_patterns():
    m = measured(order="natural")
    used = ns.reconstruct(m, method="hadamard", sampling=0.1, first_of="recorded").rows
    assert used.tolist() == list(range(102))
    used = ns.reconstruct(m, method="hadamard", sampling=0.1, first_of="cake-cutting").rows
    assert (used == ns.order("cake-cutting", 32)[:102]).all()


def test_options_of_omp():
    m = measured()
    fixed = ns.reconstruct(m, method="omp", sparsity=20, basis="haar")
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
    least = ns.reconstruct(np.stack([y, y]), matrix=patterns, method="pseudo-inverse", dark=False)
    expected = (np.linalg.pinv(patterns) @ y).reshape(16, 16)
    assert least.shape == (2, 16, 16) and np.allclose(least[1], expected, atol=1e-3)


def test_patterns_of_any_height_and_width(random):
    patterns = (random.random((170, 12, 15)) > 0.5).astype(float)
    image = np.zeros((12, 15))
    image[3:9, 2:7] = 1
    image[6:, 9:12] = 0.5
    y = np.tensordot(patterns, image, 2)
    found = ns.reconstruct(y, matrix=patterns)
    assert found.shape == (12, 15) and ns.metrics.correlation(image, found) > 0.98
    flat = ns.reconstruct([y, y], matrix=patterns.reshape(170, -1), n=(12, 15), method="tikhonov")
    assert flat.shape == (2, 12, 15) and flat[1]._repr_png_().startswith(b"\x89PNG")
    assert flat._repr_png_() is None
    with pytest.raises(ns.Error, match="expected square images: draw images"):
        flat.png()


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


def test_measurements_of_one_scene_tell_a_matrix_their_noise(random):
    scene = np.add.outer(np.linspace(0, 1, 16), np.linspace(0, 2, 16))
    matrix = (random.random((150, 256)) < 0.5).astype(float)
    y = matrix @ scene.ravel() + 20 * random.normal(size=(3, 150))
    images = ns.reconstruct(y, matrix=matrix, method="tikhonov")
    alone = ns.reconstruct(y[0], matrix=matrix, method="tikhonov")
    report = images[0].report
    assert report["noise_from"] == "measurements of one scene"
    assert report["noise_of_a_reading"] == pytest.approx(20, rel=0.15)
    assert alone.report["noise_of_a_reading"] is None
    assert np.abs(images[0] - scene).mean() < np.abs(alone - scene).mean()
    # A method that does not weigh noise says nothing of it.
    tv = ns.reconstruct(y, matrix=matrix, method="tv")
    assert tv[0].report["noise_from"] is None
