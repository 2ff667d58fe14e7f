"""Single-pixel imaging: arrays in, arrays out.

Images are ``(..., n, n)`` with rows first, readings ``(..., M)``. Values are in the units of the
readings and are never clipped or scaled unless a function says so. Everything computes on the
processor unless ``device`` names something else that is there (:func:`devices`).

>>> import numpy as np
>>> import nirspi as ns
>>> scene = np.zeros((16, 16), np.float32)
>>> scene[4:12, 6:10] = 1
>>> H = ns.Hadamard(16, rows=ns.order("zig-zag", 16)[:64])
>>> measurement = ns.Measurement(d=H(scene), rows=H.rows, n=16)
>>> image = ns.reconstruct(measurement, method="tikhonov")
>>> image.shape, bool(ns.metrics.correlation(scene, image) > 0.9)
((16, 16), True)
"""

from importlib.metadata import PackageNotFoundError, version

from . import metrics, omp, rain
from ._nirspi import Error, devices
from .camera import Account, Camera, Frame
from .camera_model import CameraModel
from .feed import Feed, FeedAccount, FeedFrame, Page, serve
from .hadamard import Hadamard, order, orders, patterns
from .images import Image
from .measurement import Measurement, load, read
from .networks import deblur, deblur_models, enhance
from .reconstruction import bases, methods, reconstruct
from .recording import Recording

try:
    __version__ = version("nirspi")
except PackageNotFoundError:  # a source tree that is not installed
    __version__ = "0.0.0"

__all__ = [
    "Account",
    "Camera",
    "CameraModel",
    "Error",
    "Feed",
    "FeedAccount",
    "FeedFrame",
    "Frame",
    "Hadamard",
    "Image",
    "Measurement",
    "Page",
    "Recording",
    "bases",
    "deblur",
    "deblur_models",
    "devices",
    "enhance",
    "load",
    "methods",
    "metrics",
    "omp",
    "order",
    "orders",
    "patterns",
    "rain",
    "read",
    "reconstruct",
    "serve",
]
