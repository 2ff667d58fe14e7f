"""Images: arrays with a report, and pictures."""

import copy
import pickle
import struct

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


def test_a_plot_has_a_colour_bar(images):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    axes = images[0].plot()
    assert len(axes.figure.axes) == 2
    with pytest.raises(ns.Error, match="expected one image"):
        images.plot()
