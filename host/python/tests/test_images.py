"""Images: arrays with a report, and pictures."""

import copy
import pickle
import struct
import sys

import numpy as np
import pytest

import nirspi as ns


@pytest.fixture
def images(random):
    H = ns.Hadamard(16)
    m = ns.Measurement(d=H(random.random((3, 16, 16))), rows=H.rows, n=16)
    return ns.reconstruct(m)


def test_an_image_is_an_array(images):
    assert isinstance(images, np.ndarray) and type(np.asarray(images)) is np.ndarray
    assert np.shares_memory(np.asarray(images), images)
    assert float(images.mean()) == float(np.asarray(images).mean())
    assert type(images + 1) is np.ndarray and type(images.sum(axis=0)) is np.ndarray


def test_a_part_of_a_stack_has_its_own_report(images):
    assert images[1].report == images.report[1] and images[1:].report == images.report[1:]
    assert images[1, ...].report == images.report[1]
    assert type(images[0, 3]) is np.ndarray and isinstance(images[0, 3, 4], np.floating)


def test_a_copy_keeps_the_report(images):
    for other in [pickle.loads(pickle.dumps(images)), copy.deepcopy(images), images.copy()]:
        assert (np.asarray(other) == np.asarray(images)).all()
        assert other.report == images.report and other.unit == images.unit


def test_a_notebook_shows_a_picture_with_a_bar(images):
    png = images[0]._repr_png_()
    assert png.startswith(b"\x89PNG\r\n\x1a\n")
    width, height = struct.unpack(">II", png[16:24])
    assert width >= 256 and height > width * 0.9
    assert images._repr_png_().startswith(b"\x89PNG")
    assert ns.Image(np.zeros((0, 4, 4)))._repr_png_() is None
    flat = ns.Image(np.full((4, 4), np.nan))
    assert flat.png("nothing").startswith(b"\x89PNG")


def test_other_packages_take_an_image_without_a_copy(images):
    again = np.from_dlpack(images)
    assert np.shares_memory(again, images)


def test_a_plot_without_matplotlib_says_what_to_install(images, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ns.Error, match="plot.. needs matplotlib: pip install matplotlib"):
        images[0].plot()


def test_a_plot_has_a_colour_bar(images):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    axes = images[0].plot()
    assert len(axes.figure.axes) == 2
    with pytest.raises(ns.Error, match="expected one image"):
        images.plot()


def of_noisy_readings(random, noise=60.0):
    """Images of three scenes by half of the patterns, and their readings."""
    H = ns.Hadamard(32, ns.order("sequency", 32)[:512])
    scenes = 100 * random.random((3, 8, 8)).repeat(4, axis=1).repeat(4, axis=2)
    d = H(scenes) + noise * random.standard_normal((3, 512))
    m = ns.Measurement(d=d, rows=H.rows, n=32, noise=noise)
    return ns.reconstruct(m, method="tikhonov"), m


def sharp(image):
    return np.asarray(ns.enhance(image))


def test_networks_get_the_readings_as_they_were_read(random):
    images, m = of_noisy_readings(random)
    assert all(report["penalty"]["weight_of_readings"] < 0.95 for report in images.report)
    H, given = ns.Hadamard(32), images._for_networks()
    of_given, of_image = H(given.astype(float)), H(np.asarray(images, float))
    assert np.allclose(of_given[:, m.rows], m.d, atol=0.05)
    assert np.abs(of_image[:, m.rows] - m.d).max() > 1
    # Other rows are as the method predicts them.
    others = np.setdiff1d(np.arange(1024), m.rows)
    assert np.allclose(of_given[:, others], of_image[:, others], atol=0.05)
    alone = sharp(images[1])
    assert (alone == sharp(ns.Image(given[1], rows=images.rows))).all()
    assert (alone != sharp(ns.Image(np.asarray(images[1]), rows=images.rows))).any()


def test_parts_and_copies_of_a_stack_keep_the_readings(random):
    images, _ = of_noisy_readings(random)
    given = images._for_networks()
    again = pickle.loads(pickle.dumps(images))
    for other in [again, copy.deepcopy(images), images.copy()]:
        assert (other._for_networks() == given).all()
    for index in [1, slice(1, 3), slice(None, None, -1), [2, 0], (slice(0, 2), slice(None))]:
        assert (images[index]._for_networks() == given[index]).all()


def test_pixels_that_were_changed_are_those_that_networks_get(random):
    images, _ = of_noisy_readings(random)
    given = images._for_networks()
    images[1, 4, 4] = 0
    now = images._for_networks()
    assert (now[[0, 2]] == given[[0, 2]]).all() and (now[1] == np.asarray(images[1])).all()


def test_the_flat_field_corrects_what_networks_get(random):
    class Halved:
        def correct(self, pixels):
            return pixels / 2

    plain, m = of_noisy_readings(random)
    m.flat_field = Halved()
    images = ns.reconstruct(m, method="tikhonov")
    assert (images._for_networks() == plain._for_networks() / 2).all()
    assert (np.asarray(images) == np.asarray(plain) / 2).all()


def test_both_parts_of_complex_readings_are_as_read(random):
    images, m = of_noisy_readings(random)
    turned = ns.Measurement(d=m.d * np.exp(0.5j), rows=m.rows, n=32, noise=m.noise)
    given = ns.reconstruct(turned, method="tikhonov")._for_networks()
    assert np.allclose(given, np.abs(images._for_networks()), rtol=1e-3, atol=0.05)
